"""The summits of a punch's face for a bearing-area model: positions, heights and curvature radii."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from pgfmd.physics.contact_sites import KINDS, SUMMIT, contact_sites
from pgfmd.physics.topography import Topography
from pgfmd.results.curve import Array
from pgfmd.scene_objects import topography_of
from pgfmd.solver.grid import Grid

FINE = 400
"""Fraction of a wavelength over which curvatures are computed if the face is a formula."""
FLATTEST = 1e-3
"""Ridges are not summits: the product of their curvatures is below this fraction of the square of their sum."""


@dataclass(frozen=True, eq=False)
class Summits:
    """Positions x, y [m] relative to the punch's axis, heights z [m] above the lowest grid point, and curvature radii
    [m], the geometric means of the two principal ones; all of shape (count,), lowest z first.

    A summit between grid points is slightly below zero.
    """

    x: Array
    y: Array
    height: Array
    radius: Array

    def __len__(self) -> int:
        return len(self.x)


def summits_of(scene: Any) -> Summits:
    """The summits of a scene's punch.

    They are the summits of `contact_sites`. In a height map, only those that stand out by `punch.file_relief` count, so
    that noise makes no asperities; curvatures are computed over one step of the grid, or one pixel if that is larger.
    Summits outside of the rim and ridges do not count. Layers of a printed face are ignored, because they have no
    curvature.

    scene: from `pgfmd.scene.load_scene`. Raises ValueError, OSError for a topography file that can't be used.
    """
    face = dataclasses.replace(topography_of(scene.punch), layer_step=0.0)
    grid = Grid(scene.grid.n, scene.grid.length)
    lowest = float(_on_grid(face, grid).min())
    sites = contact_sites(face, grid.length)
    top = sites.kind == KINDS.index(SUMMIT)
    x, y = sites.x[top], sites.y[top]
    smooth = (face.wavelength or face.shortest or FINE * grid.spacing) / FINE
    step = max(grid.spacing, *face.map.pixel) if face.pattern == "file" else smooth
    xx, yy, xy = _curvatures(face, x, y, step)
    determinant = xx * yy - xy**2
    peaked = (xx + yy > 0) & (determinant > FLATTEST * (xx + yy) ** 2)
    x, y, determinant = x[peaked], y[peaked], determinant[peaked]
    height = face.heights(x, y) - lowest
    order = np.argsort(height, kind="stable")
    return Summits(x[order], y[order], height[order], 1 / np.sqrt(determinant[order]))


def _on_grid(face: Topography, grid: Grid) -> Array:
    """Heights [m] on the grid's block under the punch, infinite beyond the rim."""
    start, nb = grid.block(face.radius)
    axis = grid.coordinate(np.arange(start, start + nb))
    z = face.heights(axis, axis[:, np.newaxis])
    if face.radius is not None:
        z[np.hypot(axis, axis[:, np.newaxis]) > face.radius * (1 + 1e-12)] = np.inf
    return z


def _curvatures(face: Topography, x: Array, y: Array, e: float) -> Array:
    """Second derivatives xx, yy, xy [1/m], (3, count), by central differences over e [m]."""

    def at(i: int, j: int) -> Array:
        return face.heights(x + i * e, y + j * e)

    middle, mixed = at(0, 0), (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / 4
    return np.array([at(1, 0) - 2 * middle + at(-1, 0), at(0, 1) - 2 * middle + at(0, -1), mixed]) / e**2
