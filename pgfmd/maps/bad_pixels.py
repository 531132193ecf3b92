"""Bad pixels of a height map: numbers that mean "missing", and single spikes.

Instruments can't see some places, and programs write a number there: 0, -32768, -9999, 1e38. As heights these are needles or
holes. Such a number is recognised because it is at an end of all heights, beyond a gap larger than between any neighbours.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from . import raw as limits
from .raw import Array

USUAL_CODES = (
    -32768.0, -32767.0, 32767.0, 65535.0, -999.0, -9999.0, -99999.0, -999999.0, -99999.9999, 9999.0, 99999.0, 999999.0,
    2147483640.0, 2147483646.0, 2147483647.0, -2147483647.0, -2147483648.0, 1e10, -1e10, 1e20, 1e30, -1e30, 1e38, -1e38,
    9.969209968386869e36, float(np.finfo(np.float32).max), -float(np.finfo(np.float32).max), 1.70141e38, -1.70141e38,
)  # fmt: skip
"""Numbers that programs write for a pixel without a height; with 0, which may be a height as well."""
MOST_CODES = 4
LARGEST_SHARE = 0.1
"""Share of the pixels up to which a number that is none of the usual codes is taken for one: more is a floor."""
BEYOND = 3.0
"""Gap between a code and the heights next to it, in the largest steps between neighbours, all but a thousandth."""
FAR_BEYOND = 10.0
"""Gap from which on even one pixel is taken for a code, in ranges of all heights."""
FEWEST = 16
"""Heights that must be left to tell what is usual."""
STICKS_OUT = 8.0
"""How far a lone spike sticks out, in what the pixels around it differ."""
CANDIDATES = 4000
"""Pixels that are looked at closely for spikes: those that differ most from the mean of their neighbours."""
OFTEN, APART = 3.0, 3.0
"""How much more often than any other a height within the range is there to be suspected, and how far it is from its neighbours in
what neighbours differ."""


class Code(NamedTuple):
    """A number that stands for missing pixels, in the units of the file, and how many pixels hold it."""

    number: float
    pixels: int


class Spike(NamedTuple):
    """A pixel that sticks out: row and column; by how much above (positive) or below the median around it."""

    row: int
    column: int
    height: float


def extremes(heights: Array, rows: int, columns: int) -> tuple[Array, Array]:
    """The lowest and the highest heights of blocks of so many rows and columns, smaller ones at the ends; NaN where a block
    holds nothing else. Each of shape (ceil(rows of all / rows), ceil(columns of all / columns))."""
    starts = np.arange(0, len(heights), rows), np.arange(0, heights.shape[1], columns)
    low, high = (
        found.reduceat(found.reduceat(heights, starts[0], axis=0), starts[1], axis=1) for found in (np.fmin, np.fmax)
    )
    return low, high


def farthest(numbers: Array, every: int) -> Array:
    """Of each block of `every` rows and columns the number that is farthest from the middle of all, so that no odd pixel is
    passed over; a stripe of rows after another, as a large map stays on the disk."""
    known = np.asarray(numbers[::every, ::every])
    known = known[np.isfinite(known)]
    middle = float(np.median(known)) if known.size else 0.0
    some, found = every * max(1, limits.WHOLE // (every * numbers.shape[1])), []
    for row in range(0, len(numbers), some):
        low, high = extremes(np.asarray(numbers[row : row + some]), every, every)
        with np.errstate(invalid="ignore"):
            found.append(np.where(middle - low > high - middle, low, high))
    return np.concatenate(found)


def missing_codes(numbers: Array, inside: NDArray[np.bool_]) -> list[Code]:
    """The numbers that mean missing among those (rows, columns) that are `inside`; none where that can't be told."""
    left = np.where(inside, numbers, np.nan).astype(float)
    found: list[Code] = []
    while len(found) < MOST_CODES:
        code = _code_among(left)
        if code is None:
            break
        found.append(code)
        left[left == code.number] = np.nan
    return found


def _code_among(left: Array) -> Code | None:
    known = left[np.isfinite(left)]
    if known.size < FEWEST:
        return None
    for number, other_end in ((float(known.min()), np.max), (float(known.max()), np.min)):
        rest = known[known != number]
        count = known.size - rest.size
        if rest.size < FEWEST:
            continue
        spread = float(np.ptp(rest))
        gap = abs(float((rest.min() if other_end is np.max else rest.max()) - number))
        usual = any(abs(number - code) <= 1e-6 * abs(code) for code in USUAL_CODES)
        if (usual and gap > spread) or (spread > 0.0 and count <= LARGEST_SHARE * known.size and (
            gap > FAR_BEYOND * spread or (count > 1 and gap > BEYOND * _largest_step(np.where(left == number, np.nan, left)))
        )):  # fmt: skip
            return Code(number, count)
    return None


def _largest_step(heights: Array) -> float:
    """The largest differences of neighbours, but for a thousandth of them."""
    steps = np.concatenate([np.abs(np.diff(heights, axis=axis)).ravel() for axis in (0, 1)])
    steps = steps[np.isfinite(steps)]
    return float(np.quantile(steps, 0.999)) if steps.size else np.inf


def suspect_number(numbers: Array, inside: NDArray[np.bool_]) -> Code | None:
    """A number within the range of the heights that is there far more often than any other, and where it is not what
    its neighbours are: perhaps a code as well."""
    known = numbers[inside & np.isfinite(numbers)]
    values, counts = np.unique(known, return_counts=True)
    if values.size < FEWEST:
        return None
    first, second = np.sort(counts)[-1:-3:-1]
    number = float(values[int(counts.argmax())])
    if first < 5 or first <= OFTEN * second or number in (known.min(), known.max()):
        return None
    at = inside & (numbers == number)
    others = np.where(inside & ~at, numbers, np.nan)
    jumps = [np.abs(_shifted(others, *step) - number)[at] for step in ((0, 1), (0, -1), (1, 0), (-1, 0))]
    found = np.concatenate(jumps)
    found = found[np.isfinite(found)]
    steps = np.abs(np.concatenate([np.diff(others, axis=axis).ravel() for axis in (0, 1)]))
    usual = float(np.nanmedian(steps)) if np.isfinite(steps).any() else np.inf
    return Code(number, int(first)) if found.size and float(np.median(found)) > APART * usual else None


def _shifted(values: Array, rows: int, columns: int) -> Array:
    """Values moved by so many rows and columns, NaN where nothing moves in."""
    moved = np.roll(values, (rows, columns), (0, 1))
    if rows:
        moved[0 if rows > 0 else -1] = np.nan
    if columns:
        moved[:, 0 if columns > 0 else -1] = np.nan
    return moved


def lone_spikes(heights: Array, inside: NDArray[np.bool_], least: float) -> list[Spike]:
    """Single pixels that stick out by many times what the 5 x 5 pixels around them differ, and by `least` or more; the
    largest first. heights (rows, columns), NaN where there is none."""
    z = np.where(inside, heights, np.nan)
    around = np.stack([_shifted(z, *step) for step in ((0, 1), (0, -1), (1, 0), (-1, 0))])
    counted = np.isfinite(around).sum(axis=0)
    mean = np.nansum(around, axis=0) / np.maximum(counted, 1)
    bend = np.where(np.isfinite(z) & (counted > 1), np.abs(z - mean), 0.0).ravel()
    if not (bend > 0.5 * least).any():
        return []
    places = np.argpartition(bend, -CANDIDATES)[-CANDIDATES:] if bend.size > CANDIDATES else np.arange(bend.size)
    places = places[bend[places] > 0.5 * least]
    rows, columns = np.unravel_index(places, z.shape)
    padded = np.pad(z, 2, constant_values=np.nan)
    steps = np.arange(5)
    windows = padded[rows[:, None, None] + steps[:, None], columns[:, None, None] + steps].reshape(len(places), 25)
    enough = np.isfinite(windows).sum(axis=1) >= 12
    places, windows = places[enough], windows[enough]
    if not places.size:
        return []
    low, middle, high = np.nanquantile(windows, [0.2, 0.5, 0.8], axis=1)
    out = z.ravel()[places] - middle
    found = np.abs(out) > np.maximum(STICKS_OUT * (high - low), least)
    order = np.argsort(-np.abs(out[found]), kind="stable")
    return [
        Spike(int(place // z.shape[1]), int(place % z.shape[1]), float(by))
        for place, by in zip(places[found][order], out[found][order], strict=True)
    ]
