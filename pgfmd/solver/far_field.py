"""The surface far from the punch in a periodic cell, from the traction alone (paper, "Refinements and corrections").

    u_inf = 6 u(L/2, L/2) - 5 u(L/2, 0)        relative to the punch's axis: the cell's corner, and the middle of its
    edge

is linear in the effective traction w. So it is a sum over the punch, u_inf = <weights, w>, that needs no transform once
the weights are known. By reciprocity, the weights are the displacements under the punch due to point tractions at the
two points, which take half a pair of transforms.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from .node import Node
from .transform import Pruned

if TYPE_CHECKING:
    from .grid import PunchPoints
    from .multiplier import Compliance
    from .transform import Plane


def far_weights(compliance: Compliance, points: PunchPoints) -> np.ndarray:
    """Weights [m/Pa] of the local points under the punch, (size,), such that u_inf [m] = sum of weights * w over all
    ranks. Collective.

    compliance: the periodic G0(qx, qy). points: PunchPoints with an even distribution of rows. The two points lie
    between grid points; the displacement there is that of the trigonometric interpolation. At L = 4a, u_inf is about 11
    % off the displacement at infinity of a free surface.
    """
    grid, start = points.grid, points.block_start
    n, unit = grid.n, 2.0 * np.pi / grid.length
    ky = (np.arange(n) + n // 2) % n - n // 2
    # 6 - 5 (-1)^ky: from the corner of the cell to the middle of its edge, every other wave along y changes its sign.
    along_y = np.where(ky % 2, 11.0, 1.0) * _waves(ky, start, n) / n**2

    def columns(kx: np.ndarray) -> np.ndarray:
        half = compliance(unit * kx[:, None], unit * np.arange(n // 2 + 1)[None, :])
        found: np.ndarray = half[:, np.abs(ky)] * (_waves(kx, start, n)[:, None] * along_y)
        return found

    weights = Synthesis(points, n).at_points(columns)
    if points.comm.size > 1:
        Node.of(points.comm).trim()
    return weights


class Synthesis(Pruned):
    """Fourier synthesis at the points under the punch, real, in double precision: half a pair of transforms per
    call."""

    def __init__(self, points: PunchPoints, n: int):
        super().__init__(points, n, "estimate", np.float64)

    def at_points(self, columns: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Sum over kx and ky of a(kx, ky) exp(2 pi i (kx x + ky y)/n) at the local points (size,), x and y counted from
        the block's first row and column; collective.

        columns: a for some kx (any,) as (any, n), ky in the order of numpy.fft; kx runs over 0 ... n//2, as
        a(-kx, -ky) is the conjugate of a(kx, ky).
        """
        kx, batch = self.spectrum.kx, self._column.shape[0]
        places = np.arange(self.points.top, self.points.nb)
        for column in self._transposition.groups:
            some = kx[column : column + batch]
            self._column[: some.size] = columns(some)
            self._backward()
            self._transposition.store(column, self._column, places)
        values = self.points.zeros()
        self._rows_backward(values)
        return values


def _waves(k: np.ndarray, start: int, n: int) -> np.ndarray:
    """exp(2 pi i k (start + 1/2) / n): waves at the first point of the block, counted from the corner of the cell.
    Those with k = n/2 vanish half-way between grid points."""
    # Large phases would lose digits.
    turns = k * (2 * start + 1) % (2 * n) / (2 * n)
    return np.where(2 * np.abs(k) == n, 0.0, np.exp(2j * np.pi * turns))


class FarPoints:
    """The same u_inf [m] from the displacement of the whole plane.

    plane: transform.Plane. The corner and, for even n, the middle of the edge lie half-way between grid points: six of
    them on either axis give the surface there to sixth order in the spacing. (The two terms of u_inf nearly cancel, and
    means of the nearest points are too coarse.)
    """

    def __init__(self, plane: Plane):
        n = plane.n
        middle, middle_weights = (n // 2 + _AROUND, _MIDPOINT) if n % 2 == 0 else (np.array([n // 2]), np.ones(1))
        rows = np.concatenate([_AROUND, middle]) % n
        local = rows - plane.row_start
        self.plane, self._columns = plane, _AROUND % n
        self._here = (local >= 0) & (local < plane.real.shape[0])
        self._rows = local[self._here]
        self._weights = np.concatenate([6.0 * _MIDPOINT, -5.0 * middle_weights])

    def displacement(self) -> float:
        """u_inf of the surface that the plane holds, the same on every rank. Collective."""
        edge = np.zeros(self._weights.size)
        if self._rows.size:
            edge[self._here] = self.plane.real[self._rows[:, None], self._columns] @ _MIDPOINT
        # Only one rank has each entry, so the sum over ranks is exact.
        return float(self._weights @ self.plane.sum_over_ranks(edge))


_AROUND, _MIDPOINT = np.arange(-3, 3), np.array([3.0, -25.0, 150.0, 150.0, -25.0, 3.0]) / 256.0
