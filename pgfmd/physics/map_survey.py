"""Examination of the height map of a punch before a run: first contact, and signs of errors. Plain NumPy.

Heights are those of the face: the map with missing pixels filled and the trend subtracted, plus the curvature of the
whole punch. Printing layers are not included.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgfmd.maps import raw as limits
from pgfmd.maps.bad_pixels import Code, Spike, extremes, lone_spikes

from .heightfile import HeightMap
from .persistence import critical_points
from .topography import Topography

Array = NDArray[np.float64]

MOST_ACROSS = 1024
"""Largest number of pixels along a side at which every pixel is examined. In larger maps, contact and spikes are found
from the lowest and highest pixels of blocks, and statistics from every second, third, ... pixel."""
RELIEF = 0.05
"""Default of the least relief of a summit, relative to the height range of the face."""
AT_RIM = 0.02
"""Distance from the outline, in radii, within which a point counts as at the rim."""
OTHERS = 3
"""Number of further summits in the report."""
EQUAL = 1e-3
"""Height above the lowest point, in ranges of adhesion, that is negligible."""
NEARLY = 0.1
"""Height above the lowest point, in ranges of adhesion, up to which a point counts as touching first."""
LOW = 2.0
"""Height above the lowest point, in ranges of adhesion, up to which points belong to the first contact."""
SMOOTHEST = 0.2
"""Fraction of these heights that may be smoother than the reported value."""
LEAST_SPIKE = 0.1
"""Least height of a single spike, in ranges of adhesion."""
CLIPPED, CLIPPED_TIMES = 5, 4.0
"""Number of pixels at an end of the range of heights, and ratio to the number at neighbouring levels, above which the
range seems clipped."""
TERRACES = 0.1
"""Fraction of neighbours of equal height, along either axis, above which heights are taken to be discrete."""
LEVELS = 8
"""Number of levels with which an end of the range of heights is compared. Maps with fewer levels are taken to be
intended."""


@dataclass(frozen=True)
class Place:
    """A point of a face: x, y [m] from the axis; height [m] above the first contact, and distance [m] from it; whether
    it is at the rim."""

    x: float
    y: float
    height: float = 0.0
    distance: float = 0.0
    at_rim: bool = False


@dataclass(frozen=True)
class Survey:
    """Properties of a map, with heights of the face in m.

    relief: from the lowest to the highest point; slope: the steepest, over a spacing of the grid where that is more than a pixel;
    rms: of the heights about their mean; tilt: slopes along x and y of the plane through them. first: first contact;
    others: the next summits. lift: mean height by which the tilt lifts the point that would touch first without it.
    sag: least bending of heights around the first contact within a pixel. step: between levels of the heights, 0 for
    continuous heights. spikes: single pixels with large deviations, with position and height (positive up, away from
    the substrate). clipped: the end of the range of heights that seems clipped, in m. pixels: under the punch,
    (columns, rows) of the square around it.
    """

    relief: float
    slope: float
    rms: float
    tilt: tuple[float, float]
    first: Place
    others: tuple[Place, ...]
    lift: float
    sag: float
    step: float
    spikes: tuple[Place, ...]
    clipped: Code | None
    pixels: tuple[int, int]


def survey(face: Topography, spacing: float, reach: float) -> Survey:
    """Examines a face with the pattern "file". spacing [m]: of the grid; reach [m]: the range of adhesion.

    Raises ValueError, OSError for a map that can't be used.
    """
    relief, slope = relief_and_slope(face, spacing)
    lines = _lines(face)
    heights, x, y, inside = _window(face, lines)
    z = np.where(inside, heights, np.nan)
    low, high = (z, z) if max(map(_step_of, lines)) == 1 else _extremes(face, lines)
    there = np.isfinite(low)
    lowest = float(np.nanmin(low)) if there.any() else 0.0
    tilt, level = _levelled(z, x, y)
    first, others = _places(face, heights if low is z else np.where(there, low, heights), there, x, y, reach)
    with np.errstate(invalid="ignore"):
        lifted = z[level <= np.nanmin(level) + NEARLY * reach] if inside.any() else np.zeros(1)
    spikes = lone_spikes(low, there, LEAST_SPIKE * reach)
    if low is not high:
        both_senses = [spike for spike in spikes if spike.height < 0.0]
        both_senses += [spike for spike in lone_spikes(high, there, LEAST_SPIKE * reach) if spike.height > 0.0]
        spikes = sorted(both_senses, key=lambda spike: -abs(spike.height))
    return Survey(
        relief, slope, float(np.nanstd(z)) if inside.any() else 0.0, tilt, first, others,
        float(np.mean(lifted)) - (float(np.nanmin(z)) if inside.any() else 0.0), _sag(z, lowest + LOW * reach), _step(z),
        tuple(_at(spike, x, y) for spike in spikes), _clipped(z[inside]), (x.size, y.size),
    )  # fmt: skip


def relief_and_slope(face: Topography, spacing: float) -> tuple[float, float]:
    """Height range [m] of a face with the pattern "file", and its steepest slope.

    From all pixels under the punch, in stripes of rows, because a large map stays on the disk. Slopes are over a
    spacing [m] of the grid, or a pixel if that is larger.
    """
    found = face.map
    count_y, count_x = found.heights.shape
    pixel_x, pixel_y = found.pixel
    step_x, step_y = (max(1, round(spacing / pixel)) for pixel in found.pixel)
    # A periodic map continues with its first rows and columns.
    repeated = face.radius is None and found.periodic
    step_x, step_y = (step_x, step_y) if repeated else (min(step_x, count_x - 1), min(step_y, count_y - 1))
    rows = np.arange(count_y + repeated * step_y) % count_y
    columns = np.arange(count_x + repeated * step_x) % count_x
    highest, lowest, slope = [], [], 0.0
    some = max(1, limits.WHOLE // count_x)
    # Each stripe overlaps with the next by the rows of one difference.
    for first in range(0, len(rows) - step_y, some):
        heights = _under_the_punch(face, found, rows[first : first + some + step_y], columns)
        along_x = np.abs(heights[:, step_x:] - heights[:, :-step_x]) / (step_x * pixel_x)
        along_y = np.abs(heights[step_y:] - heights[:-step_y]) / (step_y * pixel_y)
        slopes = along_x, along_y, np.hypot(along_x[:-step_y], along_y[:, :-step_x])
        slope = max(slope, *map(_largest, slopes))
        if np.isfinite(heights).any():
            highest.append(float(np.nanmax(heights)))
            lowest.append(float(np.nanmin(heights)))
    return max(highest, default=0.0) - min(lowest, default=0.0), slope


def _under_the_punch(face: Topography, found: HeightMap, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Array:
    """Heights [m] of these rows and columns of a map, with the curvature of the whole punch; NaN outside of the
    punch."""
    x, y, heights = _taken(face, found, rows, columns)
    if face.radius is None:
        return heights
    # With the pixels on both sides of the rim.
    rim = face.radius + math.hypot(*found.pixel)
    return np.where(np.hypot(x, y[:, None]) <= rim, heights, np.nan)


def _taken(
    face: Topography, found: HeightMap, rows: NDArray[np.int64], columns: NDArray[np.int64]
) -> tuple[Array, Array, Array]:
    """x (columns,), y (rows,) and heights (rows, columns) [m] of some pixels."""
    (size_x, size_y), (count_y, count_x) = found.size, found.heights.shape
    x, y = (columns + 0.5) * (size_x / count_x) - 0.5 * size_x, (rows + 0.5) * (size_y / count_y) - 0.5 * size_y
    heights = found.heights[rows][:, columns].astype(float)
    if math.isfinite(face.curvature_radius):
        heights = heights + (x**2 + y[:, None] ** 2) / (2.0 * face.curvature_radius)
    return x, y, heights


def _largest(values: Array) -> float:
    """The largest number that is not NaN; 0 if there is none."""
    return float(np.nanmax(values)) if np.isfinite(values).any() else 0.0


def _lines(face: Topography) -> list[NDArray[np.int64]]:
    """Columns and rows of the square around the punch; for a large map every second, third, ..."""
    found, lines = face.map, []
    for count, pixel in zip(found.heights.shape[::-1], found.pixel, strict=True):
        middle = 0.5 * (count - 1)
        reach = middle if face.radius is None else face.radius / pixel + 2.0
        first, last = max(math.ceil(middle - reach), 0), min(math.floor(middle + reach), count - 1)
        lines.append(np.arange(first, last + 1, max(1, math.ceil((last - first + 1) / MOST_ACROSS))))
    return lines


def _step_of(line: NDArray[np.int64]) -> int:
    return int(line[1] - line[0]) if line.size > 1 else 1


def _extremes(face: Topography, lines: list[NDArray[np.int64]]) -> tuple[Array, Array]:
    """The lowest and the highest heights under the punch in the blocks of pixels that begin with these columns and
    rows; NaN for blocks outside of the punch. In stripes of rows."""
    counts, steps = face.map.heights.shape[::-1], list(map(_step_of, lines))
    columns, rows = (
        np.arange(line[0], min(line[-1] + step, count)) for line, step, count in zip(lines, steps, counts, strict=True)
    )
    some, found = steps[1] * max(1, limits.WHOLE // (steps[1] * columns.size)), []
    for first in range(0, rows.size, some):
        x, y, heights = _taken(face, face.map, rows[first : first + some], columns)
        if face.radius is not None:
            heights = np.where(np.hypot(x, y[:, None]) <= face.radius, heights, np.nan)
        found.append(extremes(heights, steps[1], steps[0]))
    low, high = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return low, high


def _window(face: Topography, lines: list[NDArray[np.int64]]) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Heights (rows, columns) of these columns and rows, their x and y, and which pixels are under the punch."""
    x, y, heights = _taken(face, face.map, lines[1], lines[0])
    inside = np.ones(heights.shape, bool) if face.radius is None else np.hypot(x, y[:, None]) <= face.radius
    return heights, x, y, inside


def _levelled(z: Array, x: Array, y: Array) -> tuple[tuple[float, float], Array]:
    """Slopes along x and y of the plane fitted to heights, and the heights minus this plane."""
    here = np.isfinite(z)
    if np.count_nonzero(here) < 3:
        return (0.0, 0.0), z
    column, row = np.broadcast_to(x, z.shape), np.broadcast_to(y[:, None], z.shape)
    terms = np.stack([np.ones(np.count_nonzero(here)), column[here], row[here]])
    scale = np.abs(terms).max(axis=1, keepdims=True)
    terms /= np.where(scale > 0.0, scale, 1.0)
    c = np.linalg.lstsq(terms @ terms.T, terms @ z[here], rcond=None)[0] / np.where(scale > 0.0, scale, 1.0)[:, 0]
    return (float(c[1]), float(c[2])), z - (c[0] + c[1] * column + c[2] * row)


def _places(
    face: Topography, heights: Array, inside: NDArray[np.bool_], x: Array, y: Array, reach: float
) -> tuple[Place, tuple[Place, ...]]:
    """The first contact (of equal points the one nearest to the axis), and the next prominent summits, the lowest
    first. At the rim, the outline makes summits as well."""
    if not inside.any():
        return Place(0.0, 0.0), ()
    lowest, highest = float(heights[inside].min()), float(heights[inside].max())
    from_axis = np.hypot(x, y[:, None])
    equal = inside & (heights <= lowest + EQUAL * reach)
    first = _index(np.where(equal, from_axis, np.inf).argmin(), heights.shape)
    pixel = max(face.map.pixel)

    def place(row: int, column: int) -> Place:
        here = float(x[column]), float(y[row])
        distance = math.hypot(here[0] - float(x[first[1]]), here[1] - float(y[first[0]]))
        rim = face.radius is not None and math.hypot(*here) > face.radius - max(1.5 * pixel, AT_RIM * face.radius)
        return Place(*here, float(heights[row, column]) - lowest, distance, rim)

    relief = face.file_relief or max(RELIEF * (highest - lowest), NEARLY * reach)
    if highest - lowest < relief:
        return place(*first), ()
    walled = np.where(inside, heights, highest + relief)
    points = critical_points(walled, relief, periodic=face.radius is None).minima
    summits = [place(*_index(point, heights.shape)) for point in points if inside.ravel()[point]]
    # The summit of the first contact is not one of the next.
    own = min(summits, key=lambda other: (other.height > EQUAL * reach, other.distance), default=None)
    others = sorted((other for other in summits if other is not own), key=lambda other: (other.height, other.distance))
    return place(*first), tuple(others[:OTHERS])


def _index(flat: np.integer, shape: tuple[int, ...]) -> tuple[int, int]:
    """Row and column of a flat index."""
    return int(flat) // shape[1], int(flat) % shape[1]


def _sag(z: Array, below: float) -> float:
    """Least bending within a pixel of most heights below a level, from second differences [m]. Edges may bend more."""
    with np.errstate(invalid="ignore"):
        low = z <= below
    bends = [
        (np.abs(z[2:] - 2.0 * z[1:-1] + z[:-2]) / 8.0)[low[1:-1]],
        (np.abs(z[:, 2:] - 2.0 * z[:, 1:-1] + z[:, :-2]) / 8.0)[low[:, 1:-1]],
    ]
    found = np.concatenate(bends)
    found = found[np.isfinite(found)]
    return float(np.quantile(found, SMOOTHEST)) if found.size else 0.0


def _step(z: Array) -> float:
    """Step between levels [m] of discrete heights with terraces, as from an analog-to-digital converter; 0 for
    others."""
    level = [np.diff(z, axis=axis) for axis in (0, 1)]
    level = [steps[np.isfinite(steps)] for steps in level]
    if not all(steps.size and np.count_nonzero(steps == 0.0) > TERRACES * steps.size for steps in level):
        return 0.0
    levels = np.unique(z[np.isfinite(z)])
    if levels.size < LEVELS:
        return 0.0
    steps = np.diff(levels)
    steps = steps[steps > 1e-9 * np.ptp(levels)]
    least = float(steps.min())
    share = steps / least
    return least if (np.abs(share - np.round(share)) < 0.05).all() else 0.0


def _clipped(z: Array) -> Code | None:
    """The lowest or highest height, if it is much more frequent than the levels next to it."""
    levels, counts = np.unique(z[np.isfinite(z)], return_counts=True)
    if levels.size < 2 * LEVELS:
        return None
    for end, neighbours in ((0, slice(1, LEVELS + 1)), (-1, slice(-LEVELS - 1, -1))):
        if counts[end] > CLIPPED and counts[end] > CLIPPED_TIMES * float(np.median(counts[neighbours])):
            return Code(float(levels[end]), int(counts[end]))
    return None


def _at(spike: Spike, x: Array, y: Array) -> Place:
    return Place(float(x[spike.column]), float(y[spike.row]), spike.height)
