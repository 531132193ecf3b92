"""Summits, saddles and valleys of a punch's lower face, where contact begins and closes. Plain NumPy.

They are the points with grad z = 0 within the outline: a summit is a local minimum of z, as lowest z touches first, a
valley a local maximum. The face is taken without its printing layers, whose plateaus have no such points; macroscopic
curvature and unequal heights are included. Extrema that exist only because the face is cut off at the rim are not
sites.

A face that only varies along one direction has lines of such points. It gets one site per line, where the line crosses
the x axis: a summit for each ridge, a valley for each trough. A flat face has no sites, a sphere or power law has one
summit.

A measured height map has an extremum every few pixels because of noise. Only prominent ones are sites (`persistence`):
every path from a summit to a lower place climbs by at least `file_relief`; a valley likewise downwards; saddles are the
passes between such summits, and those that close the ring around such a valley. Their positions are pixels of the map,
or of a coarser grid if the map has more than MOST_SAMPLES along a side. On a plateau or a level ridge the first pixel
counts.

A map is also examined outside of the outline, up to MARGIN. So features at the outline have their whole relief, and the
outline makes no extrema. A summit near the rim does not count if a path with a climb of less than `file_relief` leads
from it to a lower point outside of the outline, or at the edge of the map, because there the face continues downwards.
The last pixels within the outline have no sites, because a map may end there, or drop from the face to the ground.

A random face is examined in the same way, on a grid of eight points per shortest wave.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, minimum_filter
from scipy.spatial import cKDTree

from .persistence import critical_points
from .topography import PATTERNS, Topography

Array = NDArray[np.float64]

SUMMIT, SADDLE, VALLEY = KINDS = ("summit", "saddle", "valley")

PER_WAVE = 16
"""Points per wavelength of the lattice from which the search starts."""
SHORT = 1.5
"""A Newton step this long, in spacings of that lattice, leads to a site close by."""
DIFFERENCE = 1e-3
"""Step of the finite differences, in wavelengths: fourth order leaves 1e-10 of a gradient, rounding 1e-12."""
AT_A_TIME = 2**20
"""Points of that lattice that are examined at a time."""
MARGIN_ROWS = 3
"""Neighbouring rows on either side, which differences and their minima need."""
MOST_ITERATIONS = 50
FAR = 0.2
"""A search that moves further than this from its start, in wavelengths, is abandoned, because other searches start
nearer."""
CLOSE = 1e-9
"""Last step of a search that has converged, in wavelengths."""
SAME = 1e-3
"""Sites closer than this, in wavelengths, are the same."""
DEGENERATE = 1e-6
"""Ratio of the two curvatures below which the smaller one counts as zero."""
SLACK = 1e-9
"""Relative width by which a site may be beyond the outline."""

RELIEF = 0.05
"""Default of the least relief of the sites of a height map, relative to the height range of the face."""
FLAT = 1e-12
"""Height range relative to the largest height below which a map counts as flat, because the rest is rounding."""
MARGIN = 0.5
"""Width of the region beyond the outline in which a height map is examined, in radii."""
MOST_SAMPLES = 2048
"""Most samples of a height map along a side."""


@dataclass(frozen=True, eq=False)
class ContactSites:
    """Sites in order of kind, then y, then x; a site's number is its place here.

    x, y [m]: positions (count,) relative to the punch's axis. z [m]: raw heights there (topography.py), without layers.
    kind: for each an index of KINDS (count,).
    """

    x: Array
    y: Array
    z: Array
    kind: NDArray[np.int64]

    def __len__(self) -> int:
        return self.x.size

    def names(self) -> list[str]:
        """The kinds as words."""
        return [KINDS[kind] for kind in self.kind]

    def count(self, which: NDArray[np.bool_] | slice = slice(None)) -> list[int]:
        """Numbers of summits, saddles and valleys in a selection of the sites."""
        counts: list[int] = np.bincount(self.kind[which], minlength=len(KINDS)).tolist()
        return counts


def contact_sites(topography: Topography, side: float | None = None) -> ContactSites:
    """The sites of a punch's lower face.

    side [m]: of the cell that the face fills, if the punch has no radius. ValueError without both. Raises
    ValueError, OSError for a height map that can't be used.
    """
    if topography.radius is None and side is None:
        raise ValueError("a face without an outline: give the side of the cell")
    # With an outline, the cell is not needed.
    side = math.nan if side is None else side
    face = replace(topography, layer_step=0.0)
    pattern = PATTERNS[face.pattern]
    if pattern.lattice is not None:
        x, y, kind = _found(face, side, in_row=pattern.lattice(face).row)
    elif pattern.sampled:
        x, y, kind = _prominent(face, side)
    else:
        x, y, kind = _on_axis(face)
    order = np.lexsort((x, np.round(y / _smallest_length(face, side), 6), kind))
    x, y, kind = x[order], y[order], kind[order]
    return ContactSites(x, y, face.heights(x, y) if x.size else np.zeros(0), kind)


def _smallest_length(face: Topography, side: float) -> float:
    return face.wavelength or face.radius or side


def _on_axis(face: Topography) -> tuple[Array, Array, NDArray[np.int64]]:
    """The sites of a face of revolution: its axis, unless it is flat there."""
    radius = 1e-3 * (face.radius or face.curvature_radius)
    middle, outside = face.heights(np.array([0.0, radius]), np.zeros(2))
    count = int(middle != outside)
    return np.zeros(count), np.zeros(count), np.full(count, KINDS.index(SUMMIT if outside > middle else VALLEY))


def _prominent(face: Topography, side: float) -> tuple[Array, Array, NDArray[np.int64]]:
    """The sites of a height map or a random face: prominent extrema, and their saddles."""
    x, y = _samples(face, side)
    z = face.heights(x, y[:, np.newaxis])
    inside = inner = np.ones(z.shape, bool)
    if face.radius is not None:
        inside = np.hypot(x, y[:, np.newaxis]) <= face.radius * (1.0 + SLACK)
        inner = binary_erosion(inside, np.ones((3, 3)))
    if not inner.any() or np.ptp(z[inside]) <= FLAT * np.abs(z[inside]).max():
        return np.zeros(0), np.zeros(0), np.zeros(0, np.int64)
    relief = face.file_relief or RELIEF * np.ptp(z[inside])
    points = critical_points(z, relief, periodic=face.radius is None)
    place = np.concatenate([points.minima, points.saddles, points.maxima])
    kind = np.repeat(np.arange(len(KINDS)), [points.minima.size, points.saddles.size, points.maxima.size])
    kept = inner.ravel()[place]
    row, column = np.unravel_index(place[kept], z.shape)
    return x[column], y[row], kind[kept]


def _samples(face: Topography, side: float) -> tuple[Array, Array]:
    """x and y [m] of the samples of a height map or a random face: its pixels within outline and margin, or in the
    cell."""
    radius = face.radius
    if face.pattern == "rough":
        samples = math.ceil(PER_WAVE / 2 * face.period / face.shortest)
        pixel = face.period / samples
        sizes, pixels, periodic = (face.period, face.period), (pixel, pixel), True
    else:
        sizes, pixels, periodic = face.map.size, face.map.pixel, face.map.periodic
    if radius is None:
        counts = [min(max(round(side / pixel), 1), MOST_SAMPLES) for pixel in pixels]
        x, y = (((np.arange(count) + 0.5) / count - 0.5) * side for count in counts)
        return x, y
    # Refuses a map that is smaller than the punch.
    face.heights(np.array([-radius, radius, 0.0, 0.0]), np.array([0.0, 0.0, -radius, radius]))
    lines = []
    for size, pixel in zip(sizes, pixels, strict=True):
        reach, middle, count = (1.0 + MARGIN) * radius / pixel, 0.5 * (size / pixel - 1.0), round(size / pixel)
        first, last = math.ceil(middle - reach), math.floor(middle + reach)
        if not periodic:
            first, last = max(first, 0), min(last, count - 1)
        # There may be no pixel under a small punch.
        step = max(1, math.ceil((last - first + 1) / MOST_SAMPLES))
        lines.append((np.arange(first, last + 1, step, dtype=float) - middle) * pixel)
    return lines[0], lines[1]


def _found(face: Topography, side: float, in_row: bool) -> tuple[Array, Array, NDArray[np.int64]]:
    """The sites of a pattern with a wavelength, by Newton's method from the points of least slope of a fine lattice.

    in_row: the pattern varies along x only; then all sites are on the x axis.
    """
    wave, reach = face.wavelength, face.radius or 0.5 * side
    x, y = _candidates(face, reach, in_row)
    start_x, start_y, arrived = x.copy(), y.copy(), np.zeros(x.shape, bool)
    moving = np.arange(x.size)
    for _ in range(MOST_ITERATIONS):
        here = x[moving], y[moving]
        step_x, step_y = _newton_step(_derivatives(face.heights, *here, DIFFERENCE * wave), in_row)
        long = np.hypot(step_x, step_y)
        # If a curvature vanishes nearby, the full step leads to another site far away.
        share = np.minimum(1.0, wave / PER_WAVE / np.maximum(long, 1e-300))
        x[moving], y[moving] = here[0] + share * step_x, here[1] + share * step_y
        arrived[moving] = long < CLOSE * wave
        lost = np.hypot(x - start_x, y - start_y)[moving] > FAR * wave
        moving = moving[~(arrived[moving] | lost)]
        if not moving.size:
            break
    kind = _kinds(_derivatives(face.heights, x, y, DIFFERENCE * wave), in_row)
    good = arrived & (kind >= 0) & _within(face.radius, reach, x, y)
    x, y, kind = x[good], y[good], kind[good]
    keep = _without_repeats(x, y, SAME * wave)
    return x[keep], y[keep], kind[keep]


def _candidates(face: Topography, reach: float, in_row: bool) -> tuple[Array, Array]:
    """Lattice points from which a Newton step by differences on the lattice is short, and those at which |grad z| is
    not larger than at any neighbour.

    The latter alone miss one of two sites close together, for example if macroscopic curvature nearly removes them. The
    former alone miss sites whose curvature is large on the scale of the lattice.
    """
    # Also outside of the outline, so that a site at the rim has all its neighbours.
    count = math.ceil(reach * PER_WAVE / face.wavelength) + 2
    line = np.arange(-count, count + 1, dtype=float) * (face.wavelength / PER_WAVE)
    if in_row:
        slope = np.abs(np.gradient(face.heights(line, 0.0)))
        lowest = slope <= minimum_filter(slope, 3)
        return line[lowest], np.zeros(np.count_nonzero(lowest))
    # A few rows at a time, with the neighbours that differences and their minima need.
    found, some = [], max(1, AT_A_TIME // line.size)
    for begin in range(0, line.size, some):
        first, end = max(0, begin - MARGIN_ROWS), min(line.size, begin + some + MARGIN_ROWS)
        chosen = _chosen(face, line, line[first:end])
        chosen[: begin - first] = chosen[begin - first + some :] = False
        row, column = np.nonzero(chosen)
        found.append((line[column], line[first + row]))
    x, y = (np.concatenate(places) for places in zip(*found, strict=True))
    return x, y


def _chosen(face: Topography, x: Array, y: Array) -> NDArray[np.bool_]:
    """Which points of a lattice are candidates, (y, x)."""
    slope_y, slope_x = _gradient(face.heights(*np.meshgrid(x, y)))
    _, xx = _gradient(slope_x)
    yy, xy = _gradient(slope_y)
    slope = np.hypot(slope_x, slope_y)
    step = np.hypot(*_newton_step((slope_x, slope_y, xx, yy, xy), in_row=False))
    chosen: NDArray[np.bool_] = (slope <= minimum_filter(slope, 3)) | (step < SHORT)
    return chosen


def _gradient(z: Array) -> tuple[Array, Array]:
    """Differences along y and x from point to point."""
    found: tuple[Array, Array] = np.gradient(z)  # type: ignore[assignment]  # of two axes
    return found


def _derivatives(height: Callable[[Array, Array], Array], x: Array, y: Array, d: float) -> tuple[Array, ...]:
    """z_x, z_y, z_xx, z_yy, z_xy at points, by central differences of fourth order (the last of second order)."""
    here = height(x, y)
    slopes: list[Array] = []
    bends: list[Array] = []
    for a, b in ((d, 0.0), (0.0, d)):
        near = height(x + a, y + b), height(x - a, y - b)
        far = height(x + 2 * a, y + 2 * b), height(x - 2 * a, y - 2 * b)
        slopes.append((8.0 * (near[0] - near[1]) - (far[0] - far[1])) / (12.0 * d))
        bends.append((16.0 * (near[0] + near[1]) - (far[0] + far[1]) - 30.0 * here) / (12.0 * d * d))
    mixed = height(x + d, y + d) + height(x - d, y - d) - height(x + d, y - d) - height(x - d, y + d)
    return (*slopes, *bends, mixed / (4.0 * d * d))


def _newton_step(derivatives: tuple[Array, ...], in_row: bool) -> tuple[Array, Array]:
    """The step to the point where the slope vanishes; infinite, or arbitrary, if the face is not curved."""
    slope_x, slope_y, xx, yy, xy = derivatives
    with np.errstate(divide="ignore", invalid="ignore"):
        if in_row:
            steps = -slope_x / xx, np.zeros_like(xx)
        else:
            determinant = xx * yy - xy * xy
            steps = (xy * slope_y - yy * slope_x) / determinant, (xy * slope_x - xx * slope_y) / determinant
    along_x, along_y = (np.nan_to_num(step, posinf=1e300, neginf=-1e300) for step in steps)
    return along_x, along_y


def _kinds(derivatives: tuple[Array, ...], in_row: bool) -> NDArray[np.int64]:
    """Indices of KINDS by the signs of the two curvatures; -1 if one is zero, unless the site represents a line."""
    _, _, xx, yy, xy = derivatives
    middle, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    low, high = middle - radius, middle + radius
    large, small = (np.where((np.abs(low) > np.abs(high)) == first, low, high) for first in (True, False))
    flat = np.abs(small) <= DEGENERATE * np.abs(large)
    small = np.where(flat, large if in_row else 0.0, small)
    up = (large > 0.0).astype(int) + (small > 0.0)
    kind = np.array([KINDS.index(VALLEY), KINDS.index(SADDLE), KINDS.index(SUMMIT)])[up]
    return np.where((small == 0.0) | (large == 0.0), -1, kind)


def _within(radius: float | None, reach: float, x: Array, y: Array) -> NDArray[np.bool_]:
    """Which points are within the outline, or in the cell: its left and lower edges belong to it."""
    if radius is not None:
        return np.hypot(x, y) <= radius * (1.0 + SLACK)
    edge = reach * SLACK
    return (x >= -reach - edge) & (x < reach - edge) & (y >= -reach - edge) & (y < reach - edge)


def _without_repeats(x: Array, y: Array, distance: float) -> list[int]:
    """The first of the points of every cluster."""
    twins = cKDTree(np.column_stack([x, y])).query_pairs(distance) if x.size else ()
    later = {max(pair) for pair in twins}
    return [k for k in range(x.size) if k not in later]
