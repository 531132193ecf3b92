"""A height map as its file has it, and what its keys in a scene say about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import Problem
from pgfmd.units import UnitError, parse_quantity

Array = NDArray[np.float64]
Peaks = Literal["up", "down"]

USUAL = {
    "micron": "um", "microns": "um", "micrometer": "um", "micrometers": "um", "micrometre": "um", "micrometres": "um",
    "mikrometer": "um", "mue": "um", "mum": "um", "~m": "um", "Âµm": "um", "\ufffdm": "um", "?m": "um",
    "meter": "m", "meters": "m", "metre": "m", "metres": "m", "millimeter": "mm", "millimeters": "mm",
    "nanometer": "nm", "nanometers": "nm", "nanometre": "nm", "nanometres": "nm", "inches": "inch",
    "Å": "angstrom", "\u212b": "angstrom", "Ang": "angstrom", "ang": "angstrom", "Angstroms": "angstrom",
}  # fmt: skip
"""Names of units that files have, as `parse_quantity` knows them; the last ones with a µ are what is left of it in a
wrong encoding."""


WHOLE = 2**22
"""Most samples of a map that is held in memory as a whole, if its file allows that. Larger ones are taken in stripes of about
so many samples."""


class Unit(NamedTuple):
    """A unit of length: its name as it was written, and how many metres it is."""

    name: str
    metres: float


METRE = Unit("m", 1.0)


def unit_of(text: str) -> Unit:
    """The unit of length that a text such as "um", "[µm]" or "0.25 nm" names. Raises ValueError for anything else."""
    name = text.strip().strip("()[]").strip()
    plain = USUAL.get(name, name)
    quantity = plain if plain[:1].isdigit() or plain[:1] == "." else f"1 {plain}"
    try:
        metres = parse_quantity(quantity, "length")
    except UnitError as error:
        raise ValueError(f'"{name}" is no unit of length') from error
    if not 0.0 < metres < np.inf:
        raise ValueError(f'"{name}" is no unit of length')
    return Unit(name, metres)


class MapError(ValueError):
    """A height map that can't be used as it is. problems: what is wrong, by keys of a scene."""

    def __init__(self, problems: list[Problem]):
        self.problems = problems
        super().__init__("; ".join(str(problem) for problem in problems))


@dataclass(frozen=True)
class MapKeys:
    """The keys of a scene about its map, in addition to the file: see the keys `file_...` of `Topography`; None: nothing."""

    size: tuple[float, float] | None = None
    unit: str | None = None
    peaks: Peaks | None = None
    detrend: Literal["none", "tilt", "curvature"] = "none"
    missing: Literal["refuse", "fill"] = "refuse"
    missing_value: tuple[float, ...] | None = None


@dataclass(frozen=True, eq=False)
class RawMap:
    """A height map as its file has it.

    numbers: (rows, columns), real, row 0 at the lowest y and column 0 at the lowest x; NaN where the file itself marks a
    missing pixel. A large one may be on the disk (numpy.memmap).
    kind: what the file was read as, for messages.
    unit: of the heights, None where the file does not say. odd_unit: its name where it is none of length.
    size: (x, y) of the whole map, pixels of the edges included, in size_unit; None where the file does not say.
    size_unit: None where the file does not say it, nor the format; that of the heights may be another.
    peaks: which way the numbers grow, where the file says: "up", away from the body, or "down", into it.
    codes: numbers that the file itself declares to mean a missing pixel.
    doubts: lines of its header about a unit of length that were not understood. notes: what else the user should know.
    """

    numbers: Array
    kind: str
    unit: Unit | None = None
    odd_unit: str = ""
    size: tuple[float, float] | None = None
    size_unit: Unit | None = METRE
    peaks: Peaks | None = None
    codes: tuple[float, ...] = ()
    doubts: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """ValueError for what is no array of two dimensions of real numbers."""
        if self.numbers.dtype.kind not in "iuf":
            raise ValueError(f"holds values of the type {self.numbers.dtype}, expected real numbers")
        if self.numbers.ndim != 2 or min(self.numbers.shape) < 2:
            raise ValueError(f"found shape {self.numbers.shape}, expected at least 2 x 2 heights")
