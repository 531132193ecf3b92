"""The lower face of a scene's punch at the points of its grid, as `pgfmd show` draws and `pgfmd export` writes it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pgfmd.physics.topography import Topography
from pgfmd.scene_objects import topography_of
from pgfmd.solver.grid import Grid

if TYPE_CHECKING:
    from pgfmd.scene import Scene

Array = NDArray[np.float64]
AT_A_TIME = 2**18
"""Points whose heights are taken at a time: formulas need many arrays."""
EQUAL = 1e-9
"""Heights that differ by this share of all are equal but for rounding."""
SLACK = 1e-12
"""Relative width by which a point may be beyond the outline, as in the grid of a run."""


@dataclass(frozen=True, eq=False)
class Face:
    """Heights of a punch's face above its lowest point, which touches first.

    x, y [m]: of the columns and rows, (columns,), (rows,), evenly spaced, from the punch's axis. z [m]: (rows, columns). inside:
    which points are below the punch, (rows, columns); beyond it the face goes on as its formula or map does. radius [m]: of the
    outline, None where the face fills the cell, and is repeated.
    """

    x: Array
    y: Array
    z: Array
    inside: NDArray[np.bool_]
    radius: float | None

    @property
    def spacing(self) -> float:
        """Distance [m] of neighbours."""
        return float(self.x[1] - self.x[0]) if self.x.size > 1 else float("nan")

    @property
    def size(self) -> tuple[float, float]:
        """Lengths [m] along x and y, with half a spacing beyond the outermost points."""
        return self.x.size * self.spacing, self.y.size * self.spacing

    @property
    def relief(self) -> float:
        """From the lowest to the highest point below the punch [m]."""
        return float(self.z[self.inside].max())

    def first_contact(self) -> tuple[int, int]:
        """Row and column of the point that touches first; of several the one nearest to the axis."""
        lowest = np.argwhere(self.inside & (self.z <= EQUAL * self.relief))
        far = np.hypot(self.y[lowest[:, 0]], self.x[lowest[:, 1]])
        row, column = lowest[int(np.argmin(far))]
        return int(row), int(column)

    def cut(self) -> Array:
        """The heights [m], NaN beyond the outline."""
        return np.where(self.inside, self.z, np.nan)

    def cut_around(self) -> Array:
        """The heights [m], NaN where none is needed to interpolate below the punch: one point beyond the outline stays, so that
        each pixel that the outline passes through has a height, and its neighbours."""
        if self.radius is None:
            return self.z
        x, y = (np.maximum(np.abs(line) - self.spacing, 0.0) for line in (self.x, self.y))
        return np.where(np.hypot(x, y[:, np.newaxis]) <= self.radius * (1.0 + SLACK), self.z, np.nan)


def face_on_grid(scene: Scene, margin: int = 0) -> Face:
    """The face of a scene at the points of its grid.

    margin: points on each side of the square around the punch's outline that are looked at as well; none where the face fills
    the cell. Raises ValueError, OSError for a map that can't be used.
    """
    grid, radius = Grid(scene.grid.n, scene.grid.length), scene.punch.radius
    start, count = grid.block(radius)
    margin = 0 if radius is None else margin
    line = grid.coordinate(np.arange(start - margin, start + count + margin))
    z = heights_of(topography_of(scene.punch), line, line)
    inside = np.ones(z.shape, bool)
    if radius is not None:
        inside = np.hypot(line, line[:, np.newaxis]) <= radius * (1.0 + SLACK)
    return Face(line, line, z - z[inside].min(), inside, radius)


def heights_of(topography: Topography, x: Array, y: Array) -> Array:
    """Raw heights [m] at all points of the lines x and y [m], (rows, columns), a few rows at a time."""
    some = max(1, AT_A_TIME // x.size)
    parts = [topography.heights(x, y[first : first + some, np.newaxis]) for first in range(0, y.size, some)]
    return np.concatenate(parts)
