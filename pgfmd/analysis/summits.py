"""The summits of a punch's face: where they are, how high, and how sharp. What a bearing-area model knows of a
surface."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.ndimage import center_of_mass, label, minimum_filter

from pgfmd.parts import topography_of
from pgfmd.physics.contact_sites import KINDS, SUMMIT, contact_sites
from pgfmd.physics.topography import Topography
from pgfmd.solver.grid import Grid

from .loop import Array

FINE = 400
"""Parts of a wavelength over which curvatures are taken where the face is a formula."""
FLATTEST = 1e-3
"""A ridge is no summit: the product of its curvatures is below this share of the square of their sum."""


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

    Those of `contact_sites` for a face that is a formula; for a height map, the grid points that are lower than their
    eight neighbours. Summits whose top is beyond the rim do not count, nor do ridges; layers of a printed face, which
    have no curvature, are left out.

    scene: from `pgfmd.scene.load_scene`. Raises ValueError, OSError for a topography file that can't be used.
    """
    face = dataclasses.replace(topography_of(scene.punch), layer_step=0.0)
    grid = Grid(scene.grid.n, scene.grid.length)
    z, axis = _on_grid(face, grid)
    lowest = float(z.min())
    if face.pattern == "file":
        around = minimum_filter(z, size=3, mode="wrap" if face.radius is None else "constant", cval=np.inf)
        # Neighbours of equal height are one summit.
        patches, count = label((z == around) & np.isfinite(z), structure=np.ones((3, 3)))
        place = np.array(center_of_mass(patches > 0, patches, range(1, count + 1))).reshape(-1, 2)
        x, y, step = axis[0] + grid.spacing * place[:, 1], axis[0] + grid.spacing * place[:, 0], grid.spacing
    else:
        sites = contact_sites(face, grid.length)
        top = sites.kind == KINDS.index(SUMMIT)
        x, y, step = sites.x[top], sites.y[top], (face.wavelength or FINE * grid.spacing) / FINE
    xx, yy, xy = _curvatures(face, x, y, step)
    determinant = xx * yy - xy**2
    peaked = (xx + yy > 0) & (determinant > FLATTEST * (xx + yy) ** 2)
    x, y, determinant = x[peaked], y[peaked], determinant[peaked]
    height = face.heights(x, y) - lowest
    order = np.argsort(height, kind="stable")
    return Summits(x[order], y[order], height[order], 1 / np.sqrt(determinant[order]))


def _on_grid(face: Topography, grid: Grid) -> tuple[Array, Array]:
    """Heights [m] on the grid's block under the punch, infinite beyond the rim, and the positions along a side [m]."""
    start, nb = grid.block(face.radius)
    axis = grid.coordinate(np.arange(start, start + nb))
    z = face.heights(axis, axis[:, np.newaxis])
    if face.radius is not None:
        z[np.hypot(axis, axis[:, np.newaxis]) > face.radius * (1 + 1e-12)] = np.inf
    return z, axis


def _curvatures(face: Topography, x: Array, y: Array, e: float) -> Array:
    """Second derivatives xx, yy, xy [1/m], (3, count), by central differences over e [m]."""

    def at(i: int, j: int) -> Array:
        return face.heights(x + i * e, y + j * e)

    middle, mixed = at(0, 0), (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / 4
    return np.array([at(1, 0) - 2 * middle + at(-1, 0), at(0, 1) - 2 * middle + at(0, -1), mixed]) / e**2
