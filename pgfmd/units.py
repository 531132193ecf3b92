"""Quantities as a physicist writes them, "375 um" or "50 mJ/m^2", turned into SI floats and back.

The number is read by Python and the unit by pint, whose registry keeps decimal prefixes exact: "375 um" gives the same
bits as 375e-6, and what `format_quantity` writes is read back without a change. Pint and its registry take a third of a
second, so they are loaded with the first unit that is not one of the usual ones, whose factors are known here.
"""

from __future__ import annotations

import difflib
import functools
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pint import UnitRegistry
    from pint.util import UnitsContainer


@dataclass(frozen=True)
class Dimension:
    """A kind of quantity: its name with article, the SI unit a scene is resolved to, an example for messages, and the
    units that are usually written, which hints name."""

    phrase: str
    unit: str
    example: str
    usual: tuple[str, ...]


DIMENSIONS = {
    "length": Dimension("a length", "m", "375 um", ("m", "mm", "um", "nm", "pm", "cm", "km")),
    "time": Dimension("a time", "s", "400 us", ("s", "ms", "us", "ns", "ps", "min", "h")),
    "speed": Dimension("a speed", "m/s", "1 um/s", ("m/s", "mm/s", "um/s", "nm/s", "um/min", "mm/min")),
    "force": Dimension("a force", "N", "40 mN", ("N", "mN", "uN", "nN", "pN", "kN", "MN")),
    "modulus": Dimension("a modulus", "Pa", "2 MPa", ("Pa", "kPa", "MPa", "GPa", "TPa", "mPa")),
    "energy per area": Dimension("an energy per area", "J/m^2", "50 mJ/m^2", ("J/m^2", "mJ/m^2", "uJ/m^2", "mN/m")),
    "angular frequency": Dimension("an angular frequency", "rad/s", "15700 rad/s", ("rad/s", "1/s")),
    "wavenumber": Dimension("a wavenumber", "1/m", "5e6 1/m", ("1/m", "1/mm", "1/um", "1/nm")),
    "stiffness per area": Dimension("a stiffness per area", "Pa/m", "20 GPa/mm", ("Pa/m", "GPa/m", "GPa/mm", "MPa/um")),
    "area": Dimension("an area", "m^2", "0.2 mm^2", ("m^2", "mm^2", "um^2", "cm^2")),
    "force rate": Dimension("a rate of force", "N/s", "10 mN/s", ("N/s", "mN/s", "uN/s", "N/min", "mN/min")),
    "frequency": Dimension("a frequency", "Hz", "10 Hz", ("Hz", "kHz", "mHz", "1/s")),
    "stiffness": Dimension("a stiffness", "N/m", "38.1 kN/m", ("N/m", "kN/m", "MN/m", "mN/m", "N/mm", "N/um")),
}

_NUMBER = r"[+-]?(?:(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf(?:inity)?|nan)"
_NAME = r"[^\W\d_]+(?:(?:\^|\*\*)-?\d|⁻?[¹²³])?"
# Only products of named units and one-digit powers reach pint, which would also evaluate endless arithmetic.
_UNIT = rf"(?:1\s*/\s*)?{_NAME}(?:\s*[*/·]\s*{_NAME}|\s+{_NAME})*"
_QUANTITY = re.compile(rf"\s*(?P<number>{_NUMBER})(?:\s*(?P<unit>{_UNIT}))?\s*", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"(?P<before>\s*[+-]?\d+),(?P<after>\d+(?:[eE][+-]?\d+)?)(?!\d)(?P<rest>[^,.]*)")
_BARE_POWER = re.compile(r".*[^\W\d_]\d\s*")
_DECIMAL = re.compile(r"(?P<prefix>[TGMkcmunp]?)(?P<base>rad|Pa|m|s|N|J)(?:\^(?P<power>\d))?|1")
_MINUTES = {"min": Decimal(60), "h": Decimal(3600)}
_POWERS = {"T": 12, "G": 9, "M": 6, "k": 3, "": 0, "c": -2, "m": -3, "u": -6, "n": -9, "p": -12}
_PREFIXES = {12: "T", 9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "u", -9: "n", -12: "p"}
_PREFIXED = ("m", "s", "N", "Pa", "J/m^2", "m/s", "N/m", "N/s", "Hz")
"""Units that a person writes with a prefix; `rad/s` and `1/m` are not among them."""
_FACTORS = {1e9: "G", 1e6: "M", 1e3: "k", 1.0: "", 1e-3: "m", 1e-6: "µ", 1e-9: "n", 1e-12: "p", 1e-15: "f"}
_AREAS = {1.0: "m²", 1e-6: "mm²", 1e-12: "µm²"}
_SCALABLE = ("m", "s", "N", "Pa", "J", "m/s", "rad/s", "J/m^2")
"""Units whose prefix an axis of a picture chooses."""
_LONG_TIMES = {"years": 31557600.0, "days": 86400.0, "h": 3600.0, "min": 60.0}


class UnitError(ValueError):
    """A text that is not the quantity wanted: says what was expected and how to write it."""

    def __init__(self, expected: str, cure: str = ""):
        self.expected, self.cure = expected, cure
        super().__init__(f"expected {expected}; {cure}" if cure else f"expected {expected}")


@functools.cache
def _registry() -> UnitRegistry[Any]:
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


@functools.cache
def _si_factor(unit: str) -> tuple[Decimal, UnitsContainer]:
    """(factor to SI base units, dimensionality) of a unit; LookupError if pint does not know it."""
    import pint

    try:
        base = _registry().Quantity(Decimal(1), _registry().parse_expression(unit).units)
        scale = base.to_base_units()
    except (pint.PintError, AttributeError, ArithmeticError, TypeError, ValueError) as error:
        # TypeError: units of logarithmic scales, such as dB, have no factor.
        raise LookupError(unit) from error
    return scale.magnitude, scale.dimensionality


@functools.cache
def _usual_factor(unit: str, dimension: str) -> Decimal | None:
    """What `_si_factor` gives for the usual units of a dimension; None for others, and for speeds in minutes."""
    unit = unit.replace("µ", "u").replace("μ", "u")
    if unit not in DIMENSIONS[dimension].usual:
        return None
    if unit in _MINUTES:
        return _MINUTES[unit]
    power = 0
    for sign, name in zip((1, -1), unit.split("/"), strict=False):
        match = _DECIMAL.fullmatch(name)
        if match is None:
            return None
        power += sign * _POWERS[match["prefix"] or ""] * int(match["power"] or 1)
    return Decimal(1).scaleb(power)


def _expectation(dimension: str) -> str:
    kind = DIMENSIONS[dimension]
    return f'{kind.phrase} with its unit, such as "{kind.example}"'


def _refuse_dimension(text: str, unit: str, dimensionality: UnitsContainer, dimension: str) -> UnitError:
    hint = _meant(unit, dimension, cutoff=1.0)
    for kind in DIMENSIONS.values():
        if _si_factor(kind.unit)[1] == dimensionality:
            return UnitError(_expectation(dimension), f'"{text.strip()}" is {kind.phrase}{hint}')
    return UnitError(_expectation(dimension), f'"{text.strip()}" has the dimension {dimensionality}{hint}')


def _meant(unit: str, dimension: str, cutoff: float) -> str:
    """A hint at the usual units of a dimension that a text may mean: those that differ in capitals only, else the one
    nearest to it; empty if there is none."""
    usual = DIMENSIONS[dimension].usual
    plain = unit.replace("µ", "u").replace("μ", "u")
    near = [known for known in usual if known.lower() == plain.lower()]
    near = near or difflib.get_close_matches(plain, usual, n=1, cutoff=cutoff)
    return f"; did you mean {' or '.join(f'{chr(34)}{known}{chr(34)}' for known in near)}?" if near else ""


def decimal_comma(text: str) -> str:
    """How to write a text whose number has a comma, as a cure; empty if it has none."""
    match = _DECIMAL_COMMA.fullmatch(text)
    if match is None:
        return ""
    before, after, rest = match["before"].strip(), match["after"], match["rest"].rstrip()
    if len(after) == 3 and after.isdigit() and before.lstrip("+-") != "0":
        return f'write "{before}.{after}{rest}" or "{before}{after}{rest}", whichever is meant, without a comma'
    return f'write a decimal point, "{before}.{after}{rest}", not a comma'


def parse_quantity(text: object, dimension: str) -> float:
    """The SI value of a quantity such as "375 um".

    text: a number and its unit; infinity is also read without a unit. dimension: a key of `DIMENSIONS`. The result may
    be infinite, NaN or negative: the caller knows what the key allows. Raises UnitError for anything that is not a
    quantity of this dimension, a bare number included.
    """
    kind, expected = DIMENSIONS[dimension], _expectation(dimension)
    if isinstance(text, (int, float)) and not isinstance(text, bool):
        if text in (float("inf"), float("-inf")):
            return float(text)
        raise UnitError(expected, f'a bare number has no unit: if it is in {kind.unit}, write "{text} {kind.unit}"')
    if not isinstance(text, str):
        raise UnitError(expected)
    if not text.strip():
        raise UnitError(expected, "the text is empty")
    match = _QUANTITY.fullmatch(text)
    if match is None:
        powers = 'write powers with ^, as in "J/m^2"' if _BARE_POWER.fullmatch(text) else ""
        raise UnitError(expected, decimal_comma(text) or powers or "write a number, a space and a unit")
    number = match["number"].lower().replace("_", "")
    if match["unit"] is None:
        if "inf" in number:
            return float(number)
        raise UnitError(expected, f'the unit is missing: if it is in {kind.unit}, write "{number} {kind.unit}"')
    factor = _usual_factor(match["unit"], dimension)
    if factor is None:
        factor = _unusual_factor(text, match["unit"], dimension)
    try:
        value = float(Decimal(number) * factor)
    except ArithmeticError:
        # An exponent beyond any that can be computed with.
        value = float(number)
    if value in (float("inf"), float("-inf")) and "inf" not in number:
        raise UnitError(expected, "it must be a finite number, this one is too large")
    return value


def usual_first(text: object, dimensions: Sequence[str]) -> list[str]:
    """The dimensions of which a text may be a quantity, first the one whose usual units have its unit: pint, which knows
    all others, need not be loaded to find that out."""
    match = _QUANTITY.fullmatch(text) if isinstance(text, str) else None
    unit = match["unit"] if match else None
    return sorted(dimensions, key=lambda name: unit is None or _usual_factor(unit, name) is None)


def _unusual_factor(text: str, unit: str, dimension: str) -> Decimal:
    """Factor to SI of any unit of a dimension; UnitError if pint does not know it, or it is of another dimension."""
    try:
        factor, dimensionality = _si_factor(unit)
    except LookupError:
        hint = _meant(unit, dimension, cutoff=0.5)
        raise UnitError(_expectation(dimension), f'the unit "{unit}" is not known{hint}') from None
    if dimensionality != _si_factor(DIMENSIONS[dimension].unit)[1]:
        raise _refuse_dimension(text, unit, dimensionality, dimension)
    return factor


def in_si(value: float | str, dimension: str) -> float:
    """The SI value of what a Python program gives: a number in SI units, or a text with a unit. Raises UnitError."""
    return parse_quantity(value, dimension) if isinstance(value, str) else float(value)


def format_quantity(value: float, dimension: str) -> str:
    """The SI value as a text that `parse_quantity` reads back to the same bits; "inf" has no unit."""
    value = float(value)
    if value in (float("inf"), float("-inf")):
        return str(value)
    return f"{value!r} {DIMENSIONS[dimension].unit}"


def handy_quantity(value: float, dimension: str, digits: int = 3) -> str:
    """The SI value as a person would write it, for messages: "375 um", "40 mN"; rounded, so not to compute with."""
    unit = DIMENSIONS[dimension].unit
    for name, seconds in _LONG_TIMES.items():
        if unit == "s" and 2 * seconds <= abs(value) < math.inf:
            return f"{value / seconds:.{digits}g} {name}"
    if unit not in _PREFIXED or not math.isfinite(value) or value == 0.0:
        return f"{value:.{digits}g} {unit}"
    # Rounded first: 999.9996 um is 1 mm.
    value = float(f"{value:.{digits - 1}e}")
    power = math.floor(math.log10(abs(value)) + 1e-12)
    power = min(max(3 * (power // 3), min(_PREFIXES)), max(_PREFIXES))
    # Three digits at least: 290 nm, not 2.9e+02 nm.
    return f"{value / 10.0**power:.{max(digits, 3)}g} {_PREFIXES[power]}{unit}"


def handy(values: Iterable[float], unit: str) -> tuple[float, str]:
    """Factor and name of the unit in which the largest of the values is between 1 and 1000: (1e-6, "µm/s").

    Areas in m², mm² or µm², the largest at least a tenth.
    """
    largest = max((abs(value) for value in values), default=0.0)
    if unit == "m^2":
        return next(((factor, name) for factor, name in _AREAS.items() if largest >= 0.1 * factor), (1e-12, "µm²"))
    if unit not in _SCALABLE or largest == 0.0:
        return 1.0, unit
    for factor, prefix in _FACTORS.items():
        # What is 1000 nm but for rounding is 1 um.
        if largest >= factor * (1.0 - 1e-9):
            return factor, f"{prefix}{unit}".replace("^2", "²")
    return 1.0, unit
