"""The loading machine: a spring between the driven end and the punch.

The machine's end D(t) is driven; a spring of stiffness k_M holds the punch at d = D + F/k_M. In the frame of the
machine, the surface u' = u - (d - D) = G0 w - (1/k_M) F is that of a body with an additional uniform compliance:

    u' = G0' w,   G0' = G0 + 1 1^T h^2 / (J k_M),   w = J f

so equilibria with G0' are found in the same way as with G0. Force control is the limit of a soft spring.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import stability_kernels

if TYPE_CHECKING:
    from pgfmd.solver.grid import PunchPoints
    from pgfmd.solver.tiles import Convolves


class SprungConvolution:
    """G0' as a Convolution: u' = G0' * w between point vectors.

    convolve: the Convolution with G0. spring [m/N]: 1/k_M. compliance: J of the equilibria that it is used for.
    """

    def __init__(self, convolve: Convolves, spring: float, compliance: float):
        self.convolve, self.points, self.dtype = convolve, convolve.points, convolve.dtype
        self.mean_compliance = convolve.mean_compliance + spring * self.points.total * self.points.grid.cell_area
        self._uniform = spring * self.points.grid.cell_area / compliance
        self._rows = np.zeros((1, self.points.rows))

    @property
    def pairs(self) -> int:
        """Pairs of transforms so far."""
        return self.convolve.pairs

    @property
    def seconds(self) -> float:
        """Time [s] spent in them."""
        return self.convolve.seconds

    def __call__(self, traction: np.ndarray, displacement: np.ndarray, scale: float = 1.0) -> np.ndarray:
        """displacement = scale * G0' * traction; collective."""
        self.convolve(traction, displacement, scale)
        displacement += scale * self._uniform * total(self.points, traction, self._rows)
        return displacement

    def whole_cell(self, traction: np.ndarray) -> tuple[np.ndarray, int]:
        """The true surface of the cell, without the spring (transform.Convolution)."""
        return self.convolve.whole_cell(traction)


def total(points: PunchPoints, values: np.ndarray, rows: np.ndarray) -> float:
    """Sum of a point vector over all ranks, the same bits on any number of them; rows: work array (1, rows).
    Collective."""
    stability_kernels.sum_in_rows(values, points.offset, rows)
    return float(points.total_of(rows[:1])[0])


def sprung(convolve: Convolves, spring: float, compliance: float) -> Convolves:
    """The convolution including the machine's spring; unchanged for a rigid machine."""
    return SprungConvolution(convolve, spring, compliance) if spring else convolve
