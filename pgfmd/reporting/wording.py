"""Numbers as a page shows them: with their uncertainty, in a handy unit, and texts of scenes with theirs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pgfmd.units import handy

DIGITS = 4
"""Of a number without an uncertainty."""
UNITS = {"m^2": "m²", "J/m^2": "J/m²"}


@dataclass(frozen=True)
class Entry:
    """A number on the page: name, value (with its uncertainty) as a text, unit, and what it says."""

    name: str
    value: str
    unit: str = ""
    note: str = ""


def entry(name: str, value: Any, unit: str = "", note: str = "", uncertainty: float | None = None) -> Entry:
    """A number, a text, or nothing (None), as a page shows it.

    value: in the SI unit `unit`; uncertainty: in the same, None where none is known. The value has as many decimals as the
    two digits of its uncertainty.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return Entry(name, "–" if value is None else str(value), "" if value is None else UNITS.get(unit, unit), note)
    if not math.isfinite(value):
        return Entry(name, "not finite", "", note)
    if isinstance(value, int) and not unit:
        return Entry(name, grouped(value), "", note)
    # Four digits of an area are best read in mm², unless it is that of an asperity.
    factor, shown = (1e-6, "mm²") if unit == "m^2" and 1e-9 <= abs(value) < 1.0 else handy([value], unit)
    return Entry(name, with_uncertainty(value / factor, None if uncertainty is None else uncertainty / factor),
                  UNITS.get(shown, shown), note)  # fmt: skip


def with_uncertainty(value: float, uncertainty: float | None) -> str:
    """ "1.414 ± 0.028"; without a known uncertainty DIGITS digits."""
    value += 0.0
    if not uncertainty or not math.isfinite(uncertainty):
        return minus(f"{value:.{DIGITS}g}")
    decimals = 1 - math.floor(math.log10(abs(uncertainty)))
    if decimals > 9 or decimals < -2:
        return minus(f"{value:.{DIGITS}g} ± {uncertainty:.2g}")
    decimals = max(decimals, 0)
    return minus(f"{value:.{decimals}f} ± {uncertainty:.{decimals}f}")


def minus(text: str) -> str:
    """A number with a true minus sign, but for its exponent."""
    return text.replace("-", "\N{MINUS SIGN}", 1) if text.startswith("-") else text


def grouped(value: int) -> str:
    """A whole number in groups of three digits, with narrow spaces."""
    return minus(f"{value:,}".replace(",", "\N{NARROW NO-BREAK SPACE}"))


def seconds(value: float | None) -> str:
    """A time [s] as a person says it: "42 s", "3.5 min", "7.2 h", "2.1 d"; a dash for None."""
    if value is None:
        return "–"
    for size, name in ((86400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if value >= 1.5 * size:
            return f"{value / size:.3g} {name}"
    return f"{value:.3g} s"


def of_scene(value: Any) -> str:
    """A value of a resolved scene as a reader wants it: "1e-06 m/s" is 1 µm/s; lists and texts stay what they are."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Sequence) and not isinstance(value, str):
        texts = [of_scene(each) for each in value]
        return ", ".join(texts) if len(texts) <= 12 else ", ".join(texts[:11]) + f", … ({len(texts)} in all)"
    number, _, unit = str(value).partition(" ")
    try:
        amount = float(number)
    except ValueError:
        return str(value)
    if not math.isfinite(amount):
        return str(value)
    if isinstance(value, int):
        return str(value)
    factor, shown = handy([amount], unit)
    return f"{minus(f'{amount / factor:.6g}')} {UNITS.get(shown, shown)}".strip()
