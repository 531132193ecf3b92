"""A punch as a closed surface of triangles, to be printed or meshed: the face, straight walls and a flat back.

The solid lies on its back, face up, so that the mirror image is not printed: a punch with heights z(x, y) of its lower face is
turned by half a turn about the x axis, and the point (x, y) of the scene is at (x, -y, -z). Its highest points, which touch
first, are in the plane 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import PgfmdError
from pgfmd.scene_objects import topography_of
from pgfmd.solver.grid import Grid
from pgfmd.units import handy_quantity

from .face import SLACK, Array

if TYPE_CHECKING:
    from pgfmd.scene import Scene


class ExportError(PgfmdError):
    """A punch that can't be written as it was asked for: says what was expected and what to do."""

    exit_code = 2


MOST_POINTS = 2**23
"""Points of the grid that a solid is made of, at most: its file then has 800 megabytes."""
APART = 0.1
"""The outline keeps at least this share of the distance of two circles of points away from both: no sliver is thinner."""

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed surface. points [m]: (count, 3). triangles: numbers of their corners, (count, 3), in the mathematical sense as
    seen from outside."""

    points: Array
    triangles: Indices

    def corners(self) -> Array:
        """The corners of each triangle [m], (count, 3, 3)."""
        return self.points[self.triangles]

    @property
    def size(self) -> tuple[float, float, float]:
        """Its lengths along the axes [m]."""
        x, y, z = np.ptp(self.points, axis=0)
        return float(x), float(y), float(z)

    @property
    def volume(self) -> float:
        """[m^3], by Gauss's theorem."""
        one, two, three = np.moveaxis(self.corners(), 1, 0)
        return float(np.sum(np.cross(one, two) * three) / 6.0)


def solid_of(scene: Scene, height: float | None = None, magnify: float = 1.0) -> Solid:
    """The punch of a scene; its face has corners at all points of the grid below the punch, and on the outline.

    height [m]: from the back to the highest points; unless it is given, half of the width. magnify: by how much everything is
    made larger, but for `height`, which is that of the solid itself. Raises ExportError where the height does not reach below the
    face, or the grid is too fine; ValueError, OSError for a map that can't be used.
    """
    grid, radius, topography = Grid(scene.grid.n, scene.grid.length), scene.punch.radius, topography_of(scene.punch)
    start, count = grid.block(radius)
    if count**2 > MOST_POINTS:
        raise ExportError(
            f"grid.n = {grid.n}: a solid of {count} x {count} points is larger than any program that prints it can read; "
            f"set a coarser grid, such as grid.n={int(grid.n * math.sqrt(MOST_POINTS) / count)}"
        )
    if radius is None:
        # With the first row and column of the next cell, where the face goes on as it begins.
        line = grid.coordinate(np.arange(start, start + count + 1))
        top, triangles = _sheet(line, np.ones((line.size, line.size), bool), math.inf)
    else:
        line = grid.coordinate(np.arange(start - 1, start + count + 1))
        far = np.hypot(line, line[:, np.newaxis])
        inside = far <= radius * (1.0 + SLACK)
        top, triangles = _sheet(line, inside, _outline(radius, far, inside))
    # The scene's y runs the other way.
    z = topography.heights(top[:, 0], -top[:, 1])
    z -= z.min()
    relief, half = magnify * float(z.max()), 0.5 * magnify * float(np.ptp(top[:, 0]))
    height = max(half, 2.0 * relief) if height is None else height
    if height <= relief:
        raise ExportError(
            f"--height {handy_quantity(height, 'length')}: the solid has to reach below its face, whose deepest point is "
            f"{handy_quantity(relief, 'length')} below the highest; give more than that"
        )
    return _closed(np.column_stack([magnify * top, -magnify * z]), triangles, -height)


def _outline(radius: float, far: Array, inside: NDArray[np.bool_]) -> float:
    """The radius [m] of the outline that is meshed: that of the punch, moved by less than the distance of the circles on which
    the nearest points lie, so that these are neither on it nor beside it."""
    inner, outer = float(far[inside].max()), float(far[~inside].min())
    margin = APART * (outer - inner)
    return min(max(radius, inner + margin), outer - margin)


def _sheet(line: Array, inside: NDArray[np.bool_], radius: float) -> tuple[Array, Indices]:
    """The plane figure of a square grid within a circle: its points (count, 2), those of the grid first, row by row, then those
    where lines of the grid meet the circle; and its triangles. Every square of the grid is cut to a polygon of up to five corners."""
    rows, columns = inside.shape
    nodes = np.where(inside, np.cumsum(inside).reshape(inside.shape) - 1, -1)
    row, column = np.nonzero(inside)
    found = [np.column_stack([line[column], line[row]])]
    taken = row.size
    # Numbers of the crossings of the edges along x, (rows, columns - 1), and along y.
    along_x, along_y = np.full((rows, columns - 1), -1), np.full((rows - 1, columns), -1)
    row, column = np.nonzero(inside[:, :-1] != inside[:, 1:])
    along_x[row, column] = taken + np.arange(row.size)
    sign = np.where(inside[row, column], 1.0, -1.0)
    found.append(
        np.column_stack([sign * np.sqrt(radius**2 - line[row] ** 2), line[row]]) if row.size else np.zeros((0, 2))
    )
    taken += row.size
    row, column = np.nonzero(inside[:-1] != inside[1:])
    along_y[row, column] = taken + np.arange(row.size)
    sign = np.where(inside[row, column], 1.0, -1.0)
    found.append(
        np.column_stack([line[column], sign * np.sqrt(radius**2 - line[column] ** 2)]) if row.size else np.zeros((0, 2))
    )
    around = [
        nodes[:-1, :-1], along_x[:-1], nodes[:-1, 1:], along_y[:, 1:], nodes[1:, 1:], along_x[1:], nodes[1:, :-1],
        along_y[:, :-1],
    ]  # fmt: skip
    return np.concatenate(found), _fans(np.stack([part.ravel() for part in around], axis=1))


def _fans(around: Indices) -> Indices:
    """Triangles of polygons, each given by numbers of points in order, (polygons, 8), among which -1 stands for none."""
    around = around[np.count_nonzero(around >= 0, axis=1) >= 3]
    order = np.argsort(around < 0, axis=1, kind="stable")
    corners = np.take_along_axis(around, order, axis=1)
    count = np.count_nonzero(corners >= 0, axis=1)
    fans = [corners[count > k + 1][:, [0, k, k + 1]] for k in range(1, 7)]
    return np.concatenate(fans)


def _closed(face: Array, triangles: Indices, back: float) -> Solid:
    """A face with straight walls down to the plane `back` [m], and a bottom."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    # The rim: edges that no other triangle has, in the direction of their own.
    key = edges.min(axis=1) * len(face) + edges.max(axis=1)
    _, first, times = np.unique(key, return_index=True, return_counts=True)
    one, two = edges[first[times == 1]].T
    rim, below = np.unique(one), np.full(len(face), -1)
    below[rim] = len(face) + np.arange(rim.size)
    middle = len(face) + rim.size
    bottom = np.column_stack([face[rim, :2], np.full(rim.size, back)])
    centre = np.append(face[rim, :2].mean(axis=0), back)
    walls = np.concatenate([
        np.column_stack([one, below[one], below[two]]), np.column_stack([one, below[two], two]),
        np.column_stack([np.full(one.size, middle), below[two], below[one]]),
    ])  # fmt: skip
    return Solid(np.concatenate([face, bottom, centre[np.newaxis]]), np.concatenate([triangles, walls]))
