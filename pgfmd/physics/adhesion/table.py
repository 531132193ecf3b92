"""A law from a text file: traction against gap, interpolated by a piecewise cubic.

    # gap [nm], traction [kPa]
    0      0
    20     60
    80     25
    200    0

The first line has the names and units of the two columns, with or without #; columns are separated by blanks, tabs,
commas or semicolons. Gaps ascend from 0 to the reach, and the traction is zero at both. The traction and its slope are
continuous, and the traction is never outside of the range of the two neighbouring rows (F. N. Fritsch, J. Butland,
SIAM J. Sci. Stat. Comput. 5 (1984) 300, doi:10.1137/0905021). The range is the reach, the work of adhesion the area under
the traction; where a scene gives other ones, gaps and tractions are scaled to them.
"""

from __future__ import annotations

import functools
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from pgfmd.files.text import read_text
from pgfmd.units import UnitError, parse_quantity

from .base import PRESENT, CohesiveLaw
from .functions import chosen, clipped, piece_of

COLUMNS = {"gap": ("length", "nm"), "traction": ("modulus", "kPa")}
"""Names of the columns, with their dimensions and a usual unit."""
HEADER = "gap [nm], traction [kPa]"
_COLUMN = re.compile(r"\s*(?P<name>[^\[\](),;]+?)\s*[\[(]\s*(?P<unit>[^\[\]()]+?)\s*[\])]\s*[,;]?")


class TableNumbers(NamedTuple):
    """K_o, the reach and the largest stiffness; gaps of the rows [m] (m,), and for each piece between two of them
    (m - 1, 5): A [J/m^2] at its beginning, and the coefficients of the traction, by powers of the distance from there
    [m]."""

    overlap: float
    reach: float
    stiffness: float
    knots: NDArray[np.float64]
    pieces: NDArray[np.float64]


@dataclass(frozen=True)
class Table(CohesiveLaw):
    """A law from a file. gaps [m] and tractions [Pa] of its rows, before scaling."""

    gaps: tuple[float, ...] = ()
    tractions: tuple[float, ...] = ()

    name = "table"
    meaning = "a traction of your own, from a file"
    strength_note = "the largest traction of the file, scaled"
    known = ("work_of_adhesion", "range")
    required = frozenset({"file"})
    optional = CohesiveLaw.optional | {"work_of_adhesion", "overlap_stiffness"}

    @classmethod
    def of(cls, adhesion: Any) -> Self:
        gaps, tractions = read_law(adhesion.file)
        return cls(adhesion.work_of_adhesion, adhesion.range, adhesion.overlap_stiffness, gaps, tractions)

    @classmethod
    def own_values(cls, adhesion: Any) -> dict[str, float]:
        knots, pieces = _pieces_of(*read_law(adhesion.file))
        return {"work_of_adhesion": -float(pieces[0, 0]), "range": float(knots[-1])}

    @classmethod
    def stiffness_number(cls, adhesion: Any) -> float:
        knots, pieces = _pieces_of(*read_law(adhesion.file))
        return _largest_slope(knots, pieces) * float(knots[-1]) ** 2 / -float(pieces[0, 0])

    @functools.cached_property
    def numbers(self) -> TableNumbers:
        knots, pieces = _pieces_of(self.gaps, self.tractions)
        longer, deeper = self.range / float(knots[-1]), self.work_of_adhesion / -float(pieces[0, 0])
        knots = knots * longer
        pieces = pieces * deeper / longer ** np.arange(5)
        largest = _largest_slope(knots, pieces)
        return TableNumbers(self.own_overlap_stiffness or largest, float(knots[-1]), largest, knots, pieces)

    @property
    def contact_gap(self) -> float:
        return self.gaps[int(np.argmax(self.tractions))] * self.range / self.gaps[-1]

    @property
    def strength(self) -> float:
        return float(self.numbers.pieces[:, 1].max())

    def facts(self) -> Iterator[tuple[str, float, str, str]]:
        gaps, tractions = self.range / self.gaps[-1], self.strength / max(self.tractions)
        yield "gaps relative to those of the file", gaps, "", "1 where range is left out"
        yield (
            "tractions relative to those of the file",
            tractions,
            "",
            "1 where range and work_of_adhesion are left out",
        )


def attraction(gap: Any, law: Any) -> Any:
    piece = piece_of(gap, law.knots)
    distance = clipped(gap, 0.0, law.reach) - law.knots[piece]
    pull, slope = law.pieces[piece, 1], law.pieces[piece, 2]
    square, cube = law.pieces[piece, 3], law.pieces[piece, 4]
    traction = pull + distance * (slope + distance * (square + distance * cube))
    bend = slope + distance * (2.0 * square + 3.0 * distance * cube) + PRESENT * law.stiffness
    depth = -law.pieces[0, 0]
    level = law.pieces[piece, 0] + distance * (
        pull + distance * (slope / 2.0 + distance * (square / 3.0 + distance * cube / 4.0))
    )
    return traction, chosen(gap < 0.0, law.overlap, bend), depth, level / depth


def energy(gap: Any, law: Any) -> Any:
    return attraction(gap, law)[2:]


def stiffness(gap: Any, law: Any) -> Any:
    return attraction(gap, law)[1]


def read_law(path: str | Path) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Gaps [m] and tractions [Pa] of a file. Raises OSError, and ValueError that names line and cure."""
    about = os.stat(path)
    return _read(str(path), about.st_mtime_ns, about.st_size)


@functools.lru_cache(maxsize=8)
def _read(path: str, _time: int, _size: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    lines = [(number, text.strip()) for number, text in enumerate(read_text(path).splitlines(), 1)]
    lines = [(number, text) for number, text in lines if text.strip("# \t")]
    found = [(number, text) for number, text in lines if list(_COLUMN.finditer(text))]
    if not found:
        raise ValueError(f"expected a line with names and units of its columns, such as: {HEADER}")
    factors = _factors(*found[0])
    rows = []
    for number, text in lines:
        if number <= found[0][0] or text.startswith("#"):
            continue
        try:
            row = [float(cell) for cell in re.split(r"\s*[,;\s]\s*", text.partition("#")[0].strip(" \t,;"))]
        except ValueError:
            raise ValueError(f"line {number}: expected numbers with decimal points, found {text!r}") from None
        if len(row) != len(factors) or not np.isfinite(row).all():
            raise ValueError(f"line {number}: expected {len(factors)} finite numbers, found {text!r}")
        rows.append(row)
    gaps, tractions = (
        tuple(factor * row[column] for row in rows) for column, factor in (factors["gap"], factors["traction"])
    )
    _confirm(gaps, tractions)
    return gaps, tractions


def _factors(number: int, text: str) -> dict[str, tuple[int, float]]:
    """For each column of a header its index and its unit in SI."""
    names = [(match["name"].strip("# ").lower(), match["unit"]) for match in _COLUMN.finditer(text)]
    if sorted(name for name, _ in names) != sorted(COLUMNS):
        raise ValueError(f"line {number}: expected the two columns {HEADER}, found {text!r}")
    found = {}
    for place, (name, unit) in enumerate(names):
        try:
            found[name] = place, parse_quantity(f"1 {unit}", COLUMNS[name][0])
        except UnitError as error:
            raise ValueError(f"line {number}: the unit of {name}: {error}") from None
    return found


def _confirm(gaps: tuple[float, ...], tractions: tuple[float, ...]) -> None:
    """Raises ValueError if the rows are not a law of adhesion."""
    if len(gaps) < 3:
        raise ValueError(f"expected at least three rows, found {len(gaps)}")
    if gaps[0] != 0.0 or tractions[0] != 0.0:
        cure = "count gaps from where nothing pulls or pushes; what is below is harmonic, overlap_stiffness"
        raise ValueError(f"expected a first row with the gap 0 and the traction 0; {cure}")
    if any(np.diff(gaps) <= 0.0):
        raise ValueError("expected gaps that ascend; sort the rows, and leave out doubled ones")
    if tractions[-1] != 0.0:
        raise ValueError("expected a last row with the traction 0, at the reach of the law")
    if max(tractions) <= 0.0 or -_pieces_of(gaps, tractions)[1][0, 0] <= 0.0:
        raise ValueError("expected tractions that attract: positive, and so the area under them")


@functools.lru_cache(maxsize=8)
def _pieces_of(
    gaps: tuple[float, ...], tractions: tuple[float, ...]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Knots and pieces, see TableNumbers, of unscaled rows."""
    # Not at the top: only this law needs it.
    from scipy.interpolate import PchipInterpolator

    knots = np.array(gaps)
    cubic = PchipInterpolator(knots, tractions)
    # The highest power comes first there.
    pull = cubic.c[::-1].T
    distance = np.diff(knots)
    areas = (pull * distance[:, None] ** np.arange(1, 5) / np.arange(1, 5)).sum(axis=1)
    levels = -np.cumsum(areas[::-1])[::-1]
    return knots, np.ascontiguousarray(np.column_stack([levels, pull]))


def _largest_slope(knots: NDArray[np.float64], pieces: NDArray[np.float64]) -> float:
    """The largest stiffness [Pa/m], of either sign: at a row, or at an extremum of the slope of a piece."""
    slope, square, cube = pieces[:, 2:].T
    distance = np.diff(knots)
    turn = np.divide(-square, 3.0 * cube, out=np.zeros_like(cube), where=cube != 0.0).clip(0.0, distance)
    places = np.stack([np.zeros_like(distance), turn, distance])
    return float(np.abs(slope + places * (2.0 * square + 3.0 * places * cube)).max())
