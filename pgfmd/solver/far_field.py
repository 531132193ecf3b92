"""The surface far from the punch in a periodic cell, from the traction alone (paper, "Refinements and corrections").

    u_inf = 6 u(L/2, L/2) - 5 u(L/2, 0)        relative to the punch's axis: the cell's corner, and the middle of its
    edge

is linear in w, so it is a sum over the punch, u_inf = <weights, w>, that needs no transform once the weights are known.
Plain NumPy.
"""

from __future__ import annotations

import numpy as np

_ROWS_OF_MODES, _ROWS_OF_POINTS = 256, 32


def far_weights(compliance, points) -> np.ndarray:
    """Weights [m/Pa] of the local points under the punch, (size,), such that u_inf [m] = sum of weights * w over all
    ranks.

    compliance: the periodic G0(qx, qy). points: PunchPoints. The two points lie between grid points; the displacement
    there is that of the trigonometric interpolation. At L = 4a, u_inf is about 11 % off the displacement at infinity of
    a free surface.
    """
    grid = points.grid
    n, unit = grid.n, 2.0 * np.pi / grid.length
    modes = np.arange(n // 2 + 1)
    # Modes with k and -k are one term; the mode k = n/2 vanishes half-way between grid points.
    fold = np.where(modes == 0, 1.0, 2.0)
    fold[2 * modes == n] = 0.0
    to_column = _cosines(modes, points.block_start + np.arange(points.nb), n) * fold[:, None]
    corner_and_edge = 6.0 - 5.0 * (-1.0) ** modes
    # Products of matrices of other shapes have other last bits: rows are grouped as in the block, not as on the rank.
    start, end = points.row_start, points.row_start + points.rows
    groups = range(start - start % _ROWS_OF_POINTS, end, _ROWS_OF_POINTS) if points.rows else ()
    within = points.block_start + np.arange(_ROWS_OF_POINTS)
    to_row = [_cosines(modes, group + within, n) * fold[:, None] for group in groups]
    rows = np.zeros((len(groups), _ROWS_OF_POINTS, points.nb))
    for first in range(0, modes.size, _ROWS_OF_MODES):
        some = slice(first, first + _ROWS_OF_MODES)
        spectrum = compliance(unit * modes[some, None], unit * modes[None, :]) * corner_and_edge
        for group, waves in zip(rows, to_row, strict=True):
            group += (spectrum @ waves).T @ to_column[some]
    skipped = start % _ROWS_OF_POINTS
    return rows.reshape(-1, points.nb)[skipped : skipped + points.rows][points.inside()] / n**2


def _cosines(modes: np.ndarray, indices: np.ndarray, n: int) -> np.ndarray:
    """cos(2 pi k (i + 1/2) / n), (modes, indices): a wave's value at a point, counted from the corner of the cell."""
    return np.cos(2.0 * np.pi / n * np.outer(modes, indices + 0.5))


class FarPoints:
    """The same u_inf [m] out of the whole plane, where that is at hand.

    plane: transform.Plane. The corner and, for even n, the middle of the edge lie half-way between grid points: six of
    them on either axis give the surface there to sixth order in the spacing. (The two terms of u_inf nearly cancel, and
    means of the nearest points are too coarse.)
    """

    def __init__(self, plane):
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
        # Each entry comes from one rank alone, so the sum over ranks is exact.
        return float(self._weights @ self.plane.sum_over_ranks(edge))


_AROUND, _MIDPOINT = np.arange(-3, 3), np.array([3.0, -25.0, 150.0, 150.0, -25.0, 3.0]) / 256.0
