"""Extrema and saddles of a sampled surface that stand out from its noise, by topological persistence. Plain NumPy.

The surface is flooded from below. At each local minimum a lake begins. Where two lakes meet, at a pass, the one with
the higher minimum ends: the height from there to the pass is its relief. Flooded from above, the surface has its maxima
in the same way. Extrema with less than the given relief are noise; a pass that ends a lake of sufficient relief is a
saddle. In a periodic cell two more saddles count, at which no lake ends: where the water first connects around the
cell, and where it first does so in another direction.

Pixels of equal height are ordered by their indices, so plateaus need no special treatment. A pixel has eight neighbours
in the flood from below, and four in that from above. So low and high regions never cross, and each saddle belongs to
one of the two floods.

Source: H. Edelsbrunner, D. Letscher, A. Zomorodian, Discrete Comput. Geom. 28 (2002) 511,
doi:10.1007/s00454-002-2885-2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.integer]
Steps = tuple[tuple[int, int], ...]
Passes = tuple[Numbers, Numbers, Numbers, Numbers]

FOUR: Steps = ((-1, 0), (0, -1), (0, 1), (1, 0))
EIGHT: Steps = ((-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 1), (1, -1), (1, 0), (1, 1))
"""Steps to the neighbours, by row and column. The second half are those of the first half backwards."""
SPAN = 1024
"""A winding around the periodic cell, with numbers of periods up and to the right, is stored as one integer: up * SPAN
+ right."""


@dataclass(frozen=True, eq=False)
class CriticalPoints:
    """Flat indices of pixels, each array (count,) in rising order.

    In a periodic cell there are as many saddles as minima and maxima together (Euler). A pixel where n lakes meet
    counts as n - 1 saddles, and is listed n - 1 times.
    """

    minima: Numbers
    saddles: Numbers
    maxima: Numbers


def critical_points(z: Array, relief: float, periodic: bool = False) -> CriticalPoints:
    """The extrema of heights z[iy, ix] whose relief is not less than asked for, and the saddles that belong to them.

    relief >= 0: in the unit of z. periodic: the array is repeated over the plane. Otherwise it ends at its border,
    where extrema and saddles count like others; the caller drops those that only exist because of the border. The
    relief of
    the lowest minimum and of the highest maximum is the height range of all; a plane has no points at all.
    """
    order = np.argsort(z, axis=None, kind="stable")
    places = np.empty(z.size, np.int32)
    places[order] = np.arange(z.size, dtype=np.int32)
    rank, height = places.reshape(z.shape), z.ravel()[order]
    minima, low, around = _flooded(rank, height, relief, EIGHT, periodic)
    # From above, in the reverse order. The water connects around the cell at the same two saddles.
    last = z.size - 1
    maxima, high = (last - ranks for ranks in _flooded(last - rank, -height[::-1], relief, FOUR, periodic)[:2])
    if not periodic:
        # Next to the border both floods may end a lake at the same saddle.
        high = high[~np.isin(high, low)]
    saddles = np.concatenate([low, high, around])
    return CriticalPoints(*(np.sort(order[ranks]) for ranks in (minima, saddles, maxima)))


def _flooded(
    rank: Numbers, height: Array, relief: float, steps: Steps, periodic: bool
) -> tuple[Numbers, Numbers, Numbers]:
    """Ranks of the prominent minima, of the passes that end their lakes, and of those where the water connects around
    the cell.

    rank: of each pixel in the order of heights. height: of each rank.
    """
    basin, winding, minima = _basins(rank, steps, periodic)
    end, around = _joined(minima.size, _passes(rank, basin, winding, minima.size, steps, periodic))
    never = end < 0
    rise = np.where(never, height[-1], height[end]) - height[minima]
    # Equal heights only differ by their order.
    out = (rise >= relief) & (rise > 0.0)
    return minima[out], end[out & ~never], around if out.any() else around[:0]


def _basins(rank: Numbers, steps: Steps, periodic: bool) -> tuple[Numbers, Numbers, Numbers]:
    """Number of each pixel's basin, the winding of the path from the pixel to its minimum, and the ranks of the basins'
    minima in rising order."""
    lowest, first = rank.copy(), np.zeros(rank.shape, np.int32)
    for there, seam in _neighbours(rank, steps, periodic):
        lower = there < lowest
        np.copyto(lowest, there, where=lower)
        np.copyto(first, seam, where=lower)
    to: Numbers = np.empty(rank.size, np.int32)
    winding: Numbers = np.empty(rank.size, np.int32)
    to[rank.ravel()], winding[rank.ravel()] = lowest.ravel(), first.ravel()
    to, winding = _followed(to, winding)
    minima = np.flatnonzero(to == np.arange(to.size))
    number = np.empty(rank.size, np.int32)
    number[minima] = np.arange(minima.size)
    return number[to][rank], winding[rank], minima


def _neighbours(values: Numbers, steps: Steps, periodic: bool) -> Iterator[tuple[Numbers, Numbers]]:
    """For each step, the values of all pixels' neighbours, and the winding of the step. Beyond a border the value is
    the number of pixels, which is larger than any rank or basin."""
    padded = np.pad(values, 1, mode="wrap") if periodic else np.pad(values, 1, constant_values=values.size)
    rows, columns = values.shape
    up, right = (np.zeros(count + 2, np.int32) for count in values.shape)
    if periodic:
        up[[0, -1]], right[[0, -1]] = (-SPAN, SPAN), (-1, 1)
    for i, j in steps:
        here = slice(1 + i, 1 + i + rows), slice(1 + j, 1 + j + columns)
        yield padded[here], up[here[0], np.newaxis] + right[here[1]]


def _passes(rank: Numbers, basin: Numbers, winding: Numbers, count: int, steps: Steps, periodic: bool) -> Passes:
    """The lowest pass between any two basins, in rising order: the numbers of the basins, the winding of the path from
    the first minimum to the second one across this pass, and the rank of its higher pixel; each (passes,).

    Two basins that meet across several sides of the cell have a pass for each winding. A basin that meets itself around
    the cell has one too.
    """
    found, half = [], steps[: len(steps) // 2]
    neighbours = (_neighbours(values, half, periodic) for values in (rank, basin, winding))
    for (above, seam), (other, _), (its_winding, _) in zip(*neighbours, strict=True):
        turn = seam + its_winding - winding if periodic else np.zeros_like(rank)
        meet = ((basin != other) | (turn != 0)) & (above < rank.size)
        found.append((basin[meet], other[meet], turn[meet], np.maximum(rank, above)[meet]))
    one, two, turn, top = (np.concatenate(parts) for parts in zip(*found, strict=True))
    order = np.argsort(top, kind="stable")
    return _lowest(one[order], two[order], turn[order], top[order], count)


def _lowest(one: Numbers, two: Numbers, turn: Numbers, top: Numbers, count: int) -> Passes:
    """The first of the passes, in rising order, between the same two lakes with the same winding; the older lake is
    first."""
    turn = np.where(one > two, -turn, turn)
    one, two = np.minimum(one, two), np.maximum(one, two)
    key = (one.astype(np.int64) * count + two) * SPAN**2 + turn
    first = np.sort(np.unique(key, return_index=True)[1])
    return one[first], two[first], turn[first], top[first]


def _joined(count: int, passes: Passes) -> tuple[Numbers, Numbers]:
    """For each basin the rank of the pass where its lake ends, -1 if it never does, and the ranks of the passes across
    which the water first connects around the cell, in two directions.

    In each round, every lake ends whose lowest pass leads to an older one, because the water rises over this pass
    first. Then the passes between the remaining lakes are examined again. Basins are numbered in the order of their
    minima.
    """
    one, two, turn, top = passes
    end, still = np.full(count, -1, np.int64), np.arange(count)
    while (one != two).any():
        apart = np.flatnonzero(one != two)
        first = np.full(count, one.size)
        np.minimum.at(first, one[apart], apart)
        np.minimum.at(first, two[apart], apart)
        # The older lake of a pass is its first one.
        ends = np.flatnonzero(first < one.size)
        ends = ends[two[first[ends]] == ends]
        by = first[ends]
        to: Numbers = still.copy()
        winding: Numbers = np.zeros(count, np.int64)
        to[ends], winding[ends], end[ends] = one[by], -turn[by], top[by]
        to, winding = _followed(to, winding)
        turn = turn + winding[two] - winding[one]
        one, two = to[one], to[two]
        kept = (one != two) | (turn != 0)
        one, two, turn, top = _lowest(one[kept], two[kept], turn[kept], top[kept], count)
    # The remaining passes lead from the last lake around the cell to itself.
    up = np.rint(turn / SPAN).astype(np.int64)
    right = turn - SPAN * up
    another = up[:1] * right != right[:1] * up
    return end, np.concatenate([top[:1], top[another][:1]])


def _followed(to: Numbers, winding: Numbers) -> tuple[Numbers, Numbers]:
    """The ends of chains of pointers, and the windings summed along them."""
    while True:
        further = to[to]
        if np.array_equal(further, to):
            return to, winding
        winding, to = winding + winding[to], further
