"""Quantities as a physicist writes them, "375 um" or "50 mJ/m^2", turned into SI floats and back.

The number is read by Python and the unit by pint, whose registry keeps decimal prefixes exact: "375 um" gives the same
bits as 375e-6, and what `format_quantity` writes is read back without a change. The registry takes a third of a second
to build, so it is built with the first quantity that is read, not at import.
"""

from __future__ import annotations

import difflib
import functools
import re
from dataclasses import dataclass
from decimal import Decimal


@dataclass(frozen=True)
class Dimension:
    """A kind of quantity: its name with article, the SI unit a scene is resolved to, and an example for messages."""

    phrase: str
    unit: str
    example: str


DIMENSIONS = {
    "length": Dimension("a length", "m", "375 um"),
    "time": Dimension("a time", "s", "400 us"),
    "speed": Dimension("a speed", "m/s", "1 um/s"),
    "force": Dimension("a force", "N", "40 mN"),
    "modulus": Dimension("a modulus", "Pa", "2 MPa"),
    "energy per area": Dimension("an energy per area", "J/m^2", "50 mJ/m^2"),
    "angular frequency": Dimension("an angular frequency", "rad/s", "15700 rad/s"),
    "wavenumber": Dimension("a wavenumber", "1/m", "5e6 1/m"),
    "stiffness": Dimension("a stiffness", "N/m", "38.1 kN/m"),
}

_NUMBER = r"[+-]?(?:(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|inf(?:inity)?|nan)"
_NAME = r"[^\W\d_]+(?:(?:\^|\*\*)-?\d|⁻?[¹²³])?"
# Only products of named units and one-digit powers reach pint, which would also evaluate endless arithmetic.
_UNIT = rf"(?:1\s*/\s*)?{_NAME}(?:\s*[*/·]\s*{_NAME}|\s+{_NAME})*"
_QUANTITY = re.compile(rf"\s*(?P<number>{_NUMBER})(?:\s*(?P<unit>{_UNIT}))?\s*", re.IGNORECASE)
_USUAL_UNITS = (
    *("m", "mm", "um", "nm", "s", "ms", "us", "m/s", "mm/s", "um/s", "nm/s", "N", "mN", "uN", "nN"),
    *("Pa", "kPa", "MPa", "GPa", "J/m^2", "mJ/m^2", "N/m", "kN/m", "1/m", "1/mm", "1/um", "rad/s"),
)


class UnitError(ValueError):
    """A text that is not the quantity wanted: says what was expected and how to write it."""

    def __init__(self, expected: str, cure: str = ""):
        self.expected, self.cure = expected, cure
        super().__init__(f"expected {expected}; {cure}" if cure else f"expected {expected}")


@functools.cache
def _registry():
    import pint

    return pint.UnitRegistry(non_int_type=Decimal)


@functools.cache
def _si_factor(unit: str):
    """(factor to SI base units, dimensionality) of a unit; LookupError if pint does not know it."""
    import pint

    try:
        base = _registry().Quantity(Decimal(1), _registry().parse_expression(unit).units)
        scale = base.to_base_units()
    except (pint.PintError, AttributeError, ArithmeticError) as error:
        raise LookupError(unit) from error
    return scale.magnitude, scale.dimensionality


def _expectation(dimension: str) -> str:
    kind = DIMENSIONS[dimension]
    return f'{kind.phrase} with its unit, such as "{kind.example}"'


def _refuse_dimension(text: str, dimensionality, dimension: str) -> UnitError:
    for kind in DIMENSIONS.values():
        if _si_factor(kind.unit)[1] == dimensionality:
            return UnitError(_expectation(dimension), f'"{text.strip()}" is {kind.phrase}')
    return UnitError(_expectation(dimension), f'"{text.strip()}" has the dimension {dimensionality}')


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
        raise UnitError(expected, "write a number, a space and a unit")
    number = match["number"].lower().replace("_", "")
    if match["unit"] is None:
        if "inf" in number:
            return float(number)
        raise UnitError(expected, f'the unit is missing: if it is in {kind.unit}, write "{number} {kind.unit}"')
    try:
        factor, dimensionality = _si_factor(match["unit"])
    except LookupError:
        near = difflib.get_close_matches(match["unit"], _USUAL_UNITS, n=1, cutoff=0.5)
        hint = f'; did you mean "{near[0]}"?' if near else ""
        raise UnitError(expected, f'the unit "{match["unit"]}" is not known{hint}') from None
    if dimensionality != _si_factor(kind.unit)[1]:
        raise _refuse_dimension(text, dimensionality, dimension)
    return float(Decimal(number) * factor)


def format_quantity(value: float, dimension: str) -> str:
    """The SI value as a text that `parse_quantity` reads back to the same bits; "inf" has no unit."""
    value = float(value)
    if value in (float("inf"), float("-inf")):
        return str(value)
    return f"{value!r} {DIMENSIONS[dimension].unit}"
