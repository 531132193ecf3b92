"""From the numbers of a file to heights in metres: units, the way the numbers grow, missing pixels, tilt.

The heights of the result are those of a punch's lower face: lower ones touch first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import MISSING, Problem
from pgfmd.units import handy_quantity as shown

from . import raw as limits
from .bad_pixels import Code, farthest, missing_codes, suspect_number
from .raw import METRE, Array, MapError, MapKeys, Peaks, RawMap, Unit, unit_of

FEWEST_ACROSS = 4
"""Pixels that must lie across a punch."""
HIGHEST = 1e30
"""Number from which on none is a height, whatever its unit."""
RIM = 1.5
"""Pixels from the rim within which no height is taken for a number that means missing."""
MOST_MISSING = 0.5
"""Share of the pixels under the punch that may be filled."""


class Stated(NamedTuple):
    """A property of a map, and what states it: "key", "file", or "" for a default."""

    word: str
    by: str


@dataclass(frozen=True)
class MapFacts:
    """What was found while a map was read.

    kind: what the file was read as. shape: (rows, columns). size: (x, y) [m] of the map; file_size: that by the file, None
    where it says none or in no unit; file_unit, file_peaks: by the file. unit, peaks: as used.
    tilt: slopes along x and y of the plane through the heights under the punch, before
    one was taken off. under: pixels under the punch; missing: those of them without a height; codes: numbers that were taken for
    missing pixels; suspect: one that may be. notes: of the reader; problems: what must be set right before a run.
    """

    kind: str
    shape: tuple[int, int]
    size: tuple[float, float]
    file_size: tuple[float, float] | None
    file_unit: Unit | None
    file_peaks: Peaks | None
    unit: Stated
    peaks: Stated
    tilt: tuple[float, float]
    under: int
    missing: int
    codes: tuple[Code, ...]
    suspect: Code | None
    notes: tuple[str, ...]
    problems: tuple[Problem, ...]


@dataclass(frozen=True, eq=False)
class Trend:
    """c . (1, u, v, u^2, u v, v^2) [m] with u = x/size_x, v = y/size_y, to be taken off a map."""

    coefficients: Array

    def __call__(self, u: Array, v: Array) -> Array:
        """Heights [m] at places u (columns,) and v (rows,), of shape (rows, columns)."""
        c, v = self.coefficients, v[:, None]
        return c[0] + c[1] * u + c[2] * v + c[3] * u * u + c[4] * u * v + c[5] * v * v


@dataclass(frozen=True, eq=False)
class Stripes:
    """A large map on the disk with its heights in metres made row by row, as one asks for them."""

    numbers: Array
    factor: float
    trend: Trend | None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.numbers.shape

    @property
    def size(self) -> int:
        """Number of pixels."""
        return self.numbers.size

    @property
    def ndim(self) -> int:
        """2."""
        return 2

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, rows: slice | NDArray[np.int64]) -> Array:
        """Heights [m] of these rows, (rows, columns)."""
        heights = self.numbers[rows] * self.factor
        if self.trend is None:
            return heights
        v = _middles(len(self.numbers))[rows]
        return heights - self.trend(_middles(self.numbers.shape[1]), v)


def _middles(count: int) -> Array:
    """Places of pixels along a side of length 1 around 0."""
    return (np.arange(count) + 0.5) / count - 0.5


def prepared(raw: RawMap, keys: MapKeys, radius: float | None) -> tuple[Array | Stripes, MapFacts]:
    """Heights [m] (rows, columns) and facts of a map, for a punch of a radius [m]; None: all of it counts.

    Raises MapError for what can't be a height map of this punch; what else is to be set right before a run is among the facts.
    """
    unit, unit_by = _unit(raw, keys)
    peaks = Stated(keys.peaks, "key") if keys.peaks else Stated(raw.peaks or "down", "file" if raw.peaks else "")
    problems = list(_unstated(raw, peaks, unit_by))
    file_size = _size_in_file(raw)
    size = keys.size or file_size
    if size is None:
        raise MapError([_sizeless(raw), *problems])
    if len(size) != 2 or not all(math.isfinite(side) and side > 0 for side in size):
        raise MapError([Problem("punch.file_size", size, "two positive lengths (x, y)"), *problems])
    shape = raw.numbers.shape
    problems += _too_coarse(shape, size, "punch.file_size" if keys.size else "the file", radius)
    every = max(1, math.ceil(math.sqrt(raw.numbers.size / limits.WHOLE)))
    sample = np.asarray(raw.numbers) if every == 1 else farthest(raw.numbers, every)
    # At the rim there may be the ground around a punch, which is at an end of all heights as well.
    codes, suspect = _codes(raw, keys, sample, _under(sample.shape, size, radius, reach=-RIM))
    if every > 1 and codes:
        codes = _counted(raw.numbers, codes, size, radius)
    factor = unit.metres * (-1.0 if peaks.word == "up" else 1.0)
    numbers, missing, under = raw.numbers, 0, _under(shape, size, radius)
    gone = _gone(numbers, [code.number for code in codes])
    if gone is not None:
        missing = int(np.count_nonzero(gone & under))
        if missing and (keys.missing == "refuse" or missing > MOST_MISSING * np.count_nonzero(under)):
            raise MapError([_missing(keys, codes, gone & under, under, size), *problems])
        numbers = np.where(gone, np.nan, numbers)
    # Of what was measured alone, and before gaps are filled: across a gap at the rim a tilt would not go on.
    inner = _under(shape, size, radius, reach=0.0)
    plane, trend = _trends(numbers, inner if gone is None else inner & ~gone, factor, keys.detrend)
    heights = _heights(numbers, factor, trend)
    if gone is not None and not isinstance(heights, Stripes):
        heights = filled(heights, _under(shape, size, radius, reach=1.0))
    tilt = float(plane[1] / size[0]), float(plane[2] / size[1])
    facts = MapFacts(
        raw.kind, shape, size, file_size, raw.unit, raw.peaks, Stated(unit.name, unit_by), peaks, tilt,
        int(np.count_nonzero(under)), missing, tuple(codes), suspect, raw.notes, tuple(problems),
    )  # fmt: skip
    return heights, facts


def _heights(numbers: Array, factor: float, trend: Trend | None) -> Array | Stripes:
    """Heights [m] in memory; of a large map on the disk row by row, or, where nothing is to be done, the map itself."""
    if isinstance(numbers, np.memmap) and numbers.size > limits.WHOLE:
        return numbers if factor == 1.0 and trend is None else Stripes(numbers, factor, trend)
    heights = np.asarray(numbers, dtype=float)
    if factor != 1.0:
        heights = heights * factor
    if trend is not None:
        heights = heights - trend(_middles(heights.shape[1]), _middles(heights.shape[0]))
    return heights


def _unit(raw: RawMap, keys: MapKeys) -> tuple[Unit, str]:
    if keys.unit is not None:
        return unit_of(keys.unit), "key"
    return (raw.unit, "file") if raw.unit is not None else (METRE, "")


def _size_in_file(raw: RawMap) -> tuple[float, float] | None:
    if raw.size is None or raw.size_unit is None:
        return None
    return raw.size[0] * raw.size_unit.metres, raw.size[1] * raw.size_unit.metres


def _sizeless(raw: RawMap) -> Problem:
    """The message for a map without a size, or with a size without a unit; the unit of the heights is often another."""
    if raw.size is None:
        cure = 'add file_size = ["840 um", "840 um"], with the size of the map along x and y, to [punch]'
        return Problem("punch.file_size", MISSING, "the size of the map, as the file does not say it", cure)
    x, y = (f"{side:.9g}" for side in raw.size)
    return Problem(
        "punch.file_size",
        MISSING,
        f"the unit of the map's size, as by the file it is {x} x {y}, without a unit",
        f'add file_size = ["{x} um", "{y} um"], or what the unit is, to [punch]',
    )


def _too_coarse(shape: tuple[int, int], size: tuple[float, float], who: str, radius: float | None) -> Iterator[Problem]:
    """Maps with next to no pixel under the punch, as a size in a wrong unit makes them."""
    rows, columns = shape
    pixels = size[0] / columns, size[1] / rows
    if radius is None or 2.0 * radius >= FEWEST_ACROSS * max(pixels):
        return
    whole, each = (" x ".join(shown(side, "length") for side in sides) for sides in (size, pixels))
    yield Problem(
        "punch.file_size",
        [f"{side:.6g} m" for side in size],
        f"at least {FEWEST_ACROSS} pixels across the punch, which is {shown(2.0 * radius, 'length')} wide",
        f"by {who} the map is {whole} and its {columns} x {rows} pixels are {each}: look at the unit of the size, and give it "
        'right by file_size = ["840 um", "840 um"] or the like, or in the file',
    )


def _under(
    shape: tuple[int, int], size: tuple[float, float], radius: float | None, reach: float = 0.5
) -> NDArray[np.bool_]:
    """Which pixels are under the punch, wholly or in part; with a reach of 1 pixel, not half of one, those that heights under
    it are interpolated from; with 0 those whose middles are; below that those as far from its rim."""
    if radius is None:
        return np.ones(shape, bool)
    x, y = (
        np.maximum(np.abs(_middles(count)) - reach / count, 0.0) * side
        for count, side in zip(shape[::-1], size, strict=True)
    )
    return np.hypot(x, y[:, None]) <= radius


def _codes(raw: RawMap, keys: MapKeys, sample: Array, under: NDArray[np.bool_]) -> tuple[list[Code], Code | None]:
    """Numbers that mean missing: those that scene or file name, and, unless the scene does, those that stand apart; and a
    suspect one."""
    named = raw.codes if keys.missing_value is None else keys.missing_value
    codes = [Code(number, int(np.count_nonzero(sample[under] == number))) for number in named]
    if keys.missing_value is not None:
        return codes, None
    for code in codes:
        under = under & (sample != code.number)
    found = missing_codes(sample, under)
    for code in found:
        under = under & (sample != code.number)
    return codes + found, suspect_number(sample, under)


def _counted(numbers: Array, codes: list[Code], size: tuple[float, float], radius: float | None) -> list[Code]:
    """Codes with the number of all pixels under the punch that hold them; a stripe of rows after another."""
    under, some = _under(numbers.shape, size, radius), max(1, limits.WHOLE // numbers.shape[1])
    counts = [0] * len(codes)
    for row in range(0, len(numbers), some):
        part = numbers[row : row + some][under[row : row + some]]
        counts = [count + int(np.count_nonzero(part == code.number)) for count, code in zip(counts, codes, strict=True)]
    return [Code(code.number, count) for count, code in zip(counts, codes, strict=True)]


def _gone(numbers: Array, codes: list[float]) -> NDArray[np.bool_] | None:
    """Which pixels have no height; None if all have one."""
    some, found = max(1, limits.WHOLE // numbers.shape[1]), []
    anything = False
    for row in range(0, len(numbers), some):
        part = numbers[row : row + some]
        # Nothing real is as high as the numbers that floating point has for nothing.
        gone = ~(np.abs(part) <= HIGHEST)
        for code in codes:
            gone |= part == code
        anything = anything or bool(gone.any())
        found.append(gone)
    return np.concatenate(found) if anything else None


def _missing(
    keys: MapKeys, codes: list[Code], gone: NDArray[np.bool_], under: NDArray[np.bool_], size: tuple[float, float]
) -> Problem:
    """The message for missing pixels under the punch."""
    rows, columns = np.nonzero(gone)
    x, y = _middles(gone.shape[1])[columns[0]] * size[0], _middles(gone.shape[0])[rows[0]] * size[1]
    count, all_of_them = rows.size, int(np.count_nonzero(under))
    where = f"one at x = {shown(x, 'length')}, y = {shown(y, 'length')}, row {rows[0] + 1}, column {columns[0] + 1}"
    what = ""
    if codes:
        numbers = " and ".join(f"{code.number:.9g}" for code in codes)
        what = f"; pixels that hold {numbers} are taken for missing"
        if keys.missing_value is None:
            what += (
                " (if these are heights, name the numbers that mean missing, such as file_missing_value = [1e30], and no "
                "other is taken for it)"
            )
    found = f"{count} of {all_of_them} pixels under the punch have no height, {where}{what}"
    if keys.missing == "fill":
        return Problem("punch.file_missing", "fill", "a height for at least half of the pixels under the punch", found)
    cure = 'set file_missing = "fill" to continue the heights around them, or measure anew'
    return Problem("punch.file_missing", keys.missing, "a height for each pixel under the punch", f"{found}: {cure}")


def filled(numbers: Array, under: NDArray[np.bool_]) -> Array:
    """Numbers (rows, columns) with a value for each NaN.

    Those `under` the punch solve Laplace's equation with the pixels around them, so none is beyond these; others, which do not
    count, get the nearest number.
    """
    # Not at the top: few maps have missing pixels.
    from scipy.ndimage import distance_transform_edt
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import spsolve

    gone = ~np.isfinite(numbers)
    nearest = distance_transform_edt(gone, return_distances=False, return_indices=True)
    whole = numbers[tuple(nearest)].astype(float)
    rows, columns = np.nonzero(under & gone)
    if not rows.size:
        return whole
    number = np.full(numbers.shape, -1)
    number[rows, columns] = np.arange(rows.size)
    pairs, right, count = [], np.zeros(rows.size), np.zeros(rows.size)
    for step_y, step_x in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        at_y, at_x = rows + step_y, columns + step_x
        here = (at_y >= 0) & (at_y < numbers.shape[0]) & (at_x >= 0) & (at_x < numbers.shape[1])
        at_y, at_x, me = at_y[here], at_x[here], np.flatnonzero(here)
        # What is missing beyond the punch as well is no neighbour.
        unknown = number[at_y, at_x] >= 0
        known = ~unknown & ~gone[at_y, at_x]
        np.add.at(count, me[unknown | known], 1.0)
        np.add.at(right, me[known], whole[at_y[known], at_x[known]])
        pairs.append(np.stack([me[unknown], number[at_y, at_x][unknown]]))
    lone = count == 0.0
    right[lone], count[lone] = whole[rows, columns][lone], 1.0
    own, other = np.concatenate(pairs, axis=1)
    diagonal = np.arange(rows.size)
    entries = np.concatenate([count, -np.ones(own.size)])
    places = np.concatenate([diagonal, own]), np.concatenate([diagonal, other])
    matrix = coo_array((entries, places), shape=(rows.size, rows.size)).tocsc()
    found = np.atleast_1d(spsolve(matrix, right))
    # A gap without a known neighbour at all keeps what is nearest.
    whole[rows, columns] = np.where(np.isfinite(found), found, whole[rows, columns])
    return whole


def _trends(numbers: Array, inner: NDArray[np.bool_], factor: float, detrend: str) -> tuple[Array, Trend | None]:
    """Coefficients of the plane through the heights under the punch, and what is to be taken off them. factor: from numbers to
    heights [m]; a stripe of rows after another."""
    u, v = _middles(numbers.shape[1]), _middles(len(numbers))
    some = max(1, limits.WHOLE // numbers.shape[1])
    products, right = np.zeros((6, 6)), np.zeros(6)
    for first in range(0, len(numbers), some):
        row, column = np.nonzero(inner[first : first + some])
        z = numbers[first : first + some][row, column] * factor
        x, y = u[column], v[first + row]
        terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y])
        products += terms @ terms.T
        right += terms @ z
    plane = _solved(products, right, 3)
    if detrend == "none":
        return plane, None
    return plane, Trend(plane if detrend == "tilt" else _solved(products, right, 6))


def _solved(products: Array, right: Array, terms: int) -> Array:
    """Coefficients of least squares of the first so many terms, from their products with each other and with the heights."""
    found = np.zeros(6)
    found[:terms] = np.linalg.lstsq(products[:terms, :terms], right[:terms], rcond=None)[0]
    return found


def _unstated(raw: RawMap, peaks: Stated, unit_by: str) -> Iterator[Problem]:
    """What neither the file nor the scene says, and nobody may guess."""
    if not peaks.by:
        yield Problem(
            "punch.file_peaks",
            MISSING,
            '"up" or "down", as the file does not say which way its heights grow',
            'add file_peaks = "up" to [punch] for a map as instruments measure it, whose largest heights stick out of the punch '
            'and touch first, or file_peaks = "down" where the lowest ones touch first, as was taken for granted before',
        )
    if unit_by:
        return
    if raw.odd_unit:
        yield Problem(
            "punch.file_unit", MISSING, f'a unit of length, as the heights of the file are in "{raw.odd_unit}"',
            'choose a channel of heights, or add, for instance, file_unit = "um" to [punch]',
        )  # fmt: skip
    elif raw.doubts:
        yield Problem(
            "punch.file_unit", MISSING, f"the unit of the heights, as the file says in words not understood: {raw.doubts[0]!r}",
            'add file_unit = "um", or what it is, to [punch]',
        )  # fmt: skip
