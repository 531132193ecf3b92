"""Columns of measured moduli: which quantity each holds, of tension or of shear, and its factor to SI units.

Names of instruments (Netzsch, TA, Malvern, Anton Paar, RepTate) and of standards, in English and German, are known. What
a name does not say is not guessed: a frequency is in hertz or in radians a second by its unit, and moduli that are called
by neither E nor G are of shear if there is a column of torque.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pgfmd.errors import MeasurementError
from pgfmd.files.column_names import Column, usual_unit
from pgfmd.files.text_table import TextTable

Kind = Literal["tensile", "shear"]

ABSOLUTE_ZERO = -273.15
EXAMPLE = "frequency (Hz), E' (MPa), E'' (MPa)"
PER_SECOND = {"rad/s": 1.0, "rad/sec": 1.0, "rad s^-1": 1.0, "rad·s^-1": 1.0, "rad*s^-1": 1.0}
CYCLES = {"mHz": 1e-3, "Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9, "cycles/s": 1.0}
CELSIUS = ("C", "°C", "ºC", "℃", "degC", "deg C", "° C", "celsius")
KELVIN = ("K", "kelvin")
DEGREES = ("°", "º", "deg", "degree", "degrees", "grad")

_LETTERS = {"tensile": "E", "shear": "G"}
_ADJECTIVES = {"tensile": ("tensile", "young's"), "shear": ("shear",)}
_WORDS = {
    # Marks behind the letter, words behind the letter alone, and words that need no letter.
    "storage": (("'",), ("prime",), ("storage modulus", "storage", "stor modulus", "storage mod", "speichermodul")),
    "loss": (("''",), ("double prime",), ("loss modulus", "loss", "loss mod", "verlustmodul")),
    "complex": (("*",), ("star",), ("complex modulus", "complex mod", "dynamic modulus", "komplexer modul")),
    "relaxation": (("(t)", "t", ""), (), ("relaxation modulus", "relaxationsmodul", "relax modulus")),
}
_OTHERS = {
    "shear storage": ("shear modulus (elastic component)", "elastic shear modulus"),
    "shear loss": ("shear modulus (viscous component)", "viscous shear modulus"),
    "shear complex": ("shear modulus (complex component)", "complex shear modulus", "|G*|"),
    "shear relaxation": ("shear modulus", "schubmodul"),
    "tensile complex": ("complex tensile modulus", "complex young's modulus", "|E*|"),
    "tensile relaxation": ("young's modulus", "e-modulus", "e modulus", "e-modul", "tensile modulus"),
}


def _names_of_moduli() -> dict[str, tuple[str, ...]]:
    """Names of columns by what they hold: "tensile storage", "shear loss", or " complex" if neither is named."""
    names: dict[str, tuple[str, ...]] = {}
    for part, (marks, short, words) in _WORDS.items():
        names[f" {part}"] = words
        for kind, letter in _LETTERS.items():
            symbols = [letter + mark for mark in marks]
            found = [*symbols, *_OTHERS.get(f"{kind} {part}", ()), *(f"{letter} {word}" for word in (*short, *words))]
            found += [f"{adjective} {word}" for adjective in _ADJECTIVES[kind] for word in words]
            found += [
                form.format(symbol, word)
                for form in ("{0} {1}", "{1} {0}", "{1} ({0})", "{0} ({1})", "{1}, {0}")
                for symbol in symbols
                for word in words
            ]
            names[f"{kind} {part}"] = tuple(found)
    return names


NAMES: dict[str, tuple[str, ...]] = {
    "omega": ("omega", "ω", "w", "angular frequency", "angular freq", "ang frequency", "ang. frequency", "kreisfrequenz"),
    "frequency": ("frequency", "freq", "f", "ν", "frequenz", "test frequency", "prüffrequenz"),
    "time": ("time", "t", "zeit", "relaxation time", "step time", "test time"),
    "tan delta": (
        "tan delta", "tan(delta)", "tan δ", "tan(δ)", "tandelta", "tan d", "tan(d)", "tand", "tan phi", "loss factor",
        "loss tangent", "damping factor", "verlustfaktor",
    ),
    "phase": ("phase angle", "phaseangle", "phase", "delta", "δ", "loss angle", "phasenwinkel", "phase shift angle"),
    "temperature": ("temperature", "temp", "T", "temperatur", "sample temperature", "temp sample", "probentemperatur"),
    "torque": ("torque", "oscillation torque", "drehmoment", "shear stress", "shear strain", "osc. torque", "deflection angle"),
    "compliance": ("J'", "J''", "J(t)", "creep compliance", "J", "storage compliance"),
    **_names_of_moduli(),
}  # fmt: skip
"""Column names by quantity, for `files.text_table.read_table`."""

_ROTATIONAL = re.compile(
    r"parallel[- ]plates?|plate[- ]plate|cone|couette|rheometer|\b(?:PP|CP)-?\d\d?\b|platte[- ]platte", re.I
)
"""Words of rotational rheometers, as lines above a header may have them."""
PARTS = ("storage", "loss", "complex", "relaxation")
OSCILLATION = (
    ("storage", "loss"), ("storage", "tan delta"), ("storage", "phase"), ("complex", "tan delta"), ("complex", "phase"),
)  # fmt: skip
"""Pairs of which either makes E' and E'', the better ones first."""


@dataclass(frozen=True)
class Chosen:
    """The columns that are used, by quantity ("omega", "storage", ...), with their factors to SI units (NaN of degrees
    Celsius); kind: of the moduli; named: whether their names say so."""

    columns: dict[str, Column]
    factors: dict[str, float]
    kind: Kind
    named: bool


def choose(table: TextTable, modulus: Kind | None = None) -> Chosen:
    """The columns of a table from which moduli follow; modulus: what they are, where their names don't say.

    Raises MeasurementError for columns that are missing, there twice, of another kind, or without a unit.
    """
    swept = bool(table.found("omega") or table.found("frequency"))
    kind, named = _kind(table, modulus, swept)
    columns: dict[str, Column] = {}
    if swept:
        rate = _one(table, ["omega"] if table.found("omega") else ["frequency"])
        columns[rate.quantity] = rate
        if rate.quantity == "omega" and len(table.found("frequency")) == 1:
            # In addition, for a comparison.
            columns["frequency"] = table.found("frequency")[0]
        pair = next((pair for pair in OSCILLATION if all(_of(table, part, kind, named) for part in pair)), None)
        if pair is None:
            raise _lacking(table, kind, named)
        columns |= {part: _one(table, _of(table, part, kind, named)) for part in pair}
        if pair == ("storage", "loss") and table.found("tan delta"):
            columns["tan delta"] = _one(table, ["tan delta"])
    elif table.found("time") and _of(table, "relaxation", kind, named):
        columns["time"] = _one(table, ["time"])
        columns["relaxation"] = _one(table, _of(table, "relaxation", kind, named))
    else:
        raise _lacking(table, kind, named)
    if table.found("temperature"):
        columns["temperature"] = _one(table, ["temperature"])
    factors = {quantity: _factor(table, quantity, column) for quantity, column in columns.items()}
    return Chosen(columns, factors, kind, named)


def _kind(table: TextTable, modulus: Kind | None, swept: bool) -> tuple[Kind, bool]:
    """Of what kind the moduli of a table are, and whether their names say so."""
    parts = PARTS[:3] if swept else PARTS[3:]
    by_kind = {kind: [c for part in parts for c in table.found(f"{kind} {part}")] for kind in ("tensile", "shear")}
    both = [kind for kind, columns in by_kind.items() if columns]
    if len(both) == 2 and modulus is None:
        raise MeasurementError(
            f"{table.where}: expected tensile or shear moduli, found both ('{by_kind['tensile'][0].title}' and "
            f"'{by_kind['shear'][0].title}'); say which: --modulus tensile|shear"
        )
    if modulus in both or not both:
        kind = modulus or "tensile"
        if not both and modulus is None and (why := _sign_of_shear(table)):
            raise MeasurementError(
                f"{table.where}: expected names of moduli with E or G in them; {why} they will be of shear, but no name "
                "says so: give --modulus shear (or tensile)"
            )
        return kind, bool(both)
    if modulus is not None:
        title = by_kind[both[0]][0].title
        raise MeasurementError(
            f"{table.where}: '{title}' is a {both[0]} modulus by its name; leave out --modulus {modulus}"
        )
    return ("shear" if both == ["shear"] else "tensile"), True


def _sign_of_shear(table: TextTable) -> str:
    """What of a table tells of a rotational rheometer: a torque, or words above the header; "" for nothing."""
    if torque := table.found("torque"):
        return f"next to '{torque[0].title}'"
    words = next((match[0] for line in table.preamble if (match := _ROTATIONAL.search(line))), None)
    return f"as the lines above speak of '{words}'" if words else ""


def _of(table: TextTable, part: str, kind: Kind, named: bool) -> list[str]:
    """The quantities of the table under which a part of the moduli stands; [] if it has none."""
    if part not in PARTS:
        return [part] if table.found(part) else []
    wanted = [f"{kind} {part}", f" {part}"] if named else [f" {part}"]
    return next(([quantity] for quantity in wanted if table.found(quantity)), [])


def _one(table: TextTable, quantities: Iterable[str]) -> Column:
    """The only column of these quantities."""
    found = [column for quantity in quantities for column in table.found(quantity)]
    if len(found) > 1:
        raise MeasurementError(
            f"{table.where}: expected one column with {found[0].quantity.strip()}, found '{found[0].title}' and "
            f"'{found[1].title}'; rename or delete the one that is not to be used"
        )
    return found[0]


def _lacking(table: TextTable, kind: Kind, named: bool) -> MeasurementError:
    """The message for a table without the columns of a sweep or of a relaxation."""
    letter = _LETTERS[kind]
    if table.found("compliance"):
        cure = "compliances can't be read: export moduli"
    elif not (table.found("omega") or table.found("frequency")):
        missing = "frequency or omega" if not table.found("time") else f"{letter}(t) beside the time, or frequency"
        cure = f"name the columns as in {EXAMPLE}, or as in time (s), E (MPa) for a relaxation"
        return MeasurementError(f"{table.where}: expected a column {missing}, found {table.titles}; {cure}")
    else:
        cure = f"name the columns as in {EXAMPLE}"
    has = [part for part in PARTS[:3] if _of(table, part, kind, named)]
    missing = f"{letter}'' or tan delta" if "storage" in has else f"{letter}', or |{letter}*| and tan delta"
    return MeasurementError(f"{table.where}: expected a column {missing}, found {table.titles}; {cure}")


def _factor(table: TextTable, quantity: str, column: Column) -> float:
    """What a unit is in rad/s, Pa, s, K or rad; NaN for degrees Celsius, which have no factor."""
    unit = usual_unit(column.unit)
    if quantity in ("omega", "frequency"):
        return _rate(table, quantity, column)
    if quantity == "temperature":
        if unit in (*CELSIUS, *KELVIN):
            return np.nan if unit in CELSIUS else 1.0
        raise _unit(table, column, "a unit of temperature: C or K", "temperature (C)")
    if quantity == "tan delta":
        if unit in ("", "-", "1"):
            return 1.0
        raise _unit(table, column, "no unit", "tan delta")
    if quantity == "phase":
        if unit in (*DEGREES, "rad"):
            return 1.0 if unit == "rad" else np.pi / 180.0
        raise _unit(table, column, "an angle, ° or rad", "phase angle (°)")
    if quantity == "time":
        return table.factor(column, "time", "time (s)")
    example = f"{column.title.split('(')[0].strip() or 'E'} (MPa)"
    return table.factor(column, "modulus", example, "a unit of modulus: Pa, kPa, MPa, GPa")


def _rate(table: TextTable, quantity: str, column: Column) -> float:
    """A unit of frequency in rad/s: "1/s" can be either of an unnamed one, and is refused."""
    unit = usual_unit(column.unit).replace("⁻¹", "^-1").replace("s-1", "s^-1")
    if unit in PER_SECOND or (quantity == "omega" and unit in ("", "1/s", "s^-1")):
        return 1.0
    if quantity == "frequency" and unit in CYCLES:
        return 2.0 * np.pi * CYCLES[unit]
    if quantity == "frequency" and unit in ("1/s", "s^-1"):
        raise MeasurementError(
            f"{table.where}, column '{column.title}': a frequency in {column.unit} is in hertz by its name, but many write "
            "radians a second like this, a factor of 6.28; write frequency (Hz) or omega (rad/s)"
        )
    if quantity == "omega" and unit in CYCLES:
        raise MeasurementError(
            f"{table.where}, column '{column.title}': an angular frequency is in rad/s, found '{column.unit}'; "
            "write omega (rad/s), or frequency (Hz) if it counts cycles"
        )
    expected = "a unit of frequency: Hz, kHz, rad/s"
    raise _unit(table, column, expected, "frequency (Hz)" if quantity == "frequency" else "omega (rad/s)")


def _unit(table: TextTable, column: Column, expected: str, example: str) -> MeasurementError:
    found = f"found '{column.unit}'" if column.unit else "found none"
    return MeasurementError(
        f"{table.where}, column '{column.title}': expected {expected}, {found}; write for instance {example}"
    )
