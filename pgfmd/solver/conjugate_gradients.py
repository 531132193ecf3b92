"""Newton's correction by conjugate gradients: (A^-1 + K) s = r, preconditioned by A = J G0 (newton.py).

Each direction p is stored with its dual y = A^-1 p, so that A^-1 is never applied, and one application of G0 per
iteration is the only transform. At negative curvature, the correction ends at the boundary of the trust region
(Steihaug).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from . import kernels

if TYPE_CHECKING:
    from pgfmd.physics.adhesion.base import CohesiveLaw

    from .grid import PunchPoints
    from .tiles import Convolves

UNSURE = 1e-6
"""If the curvature along a direction is below this fraction of its terms, it is computed directly, not by a
difference."""


class ConjugateGradients:
    """Computes corrections on point vectors, and owns the arrays for this.

    points: PunchPoints. operator: the Convolution with G0. law: CohesiveLaw. floating: whether G0 is zero for a uniform
    traction. Before `correct`, `r` is the residual [Pa] and `curvature` is K; after it, `s` [m] is the correction, `t`
    [Pa] its dual A^-1 s, and the others are work arrays.
    """

    largest_count = 400
    forcing = 0.1
    """CG ends when its last update is below half this fraction of the correction so far (inexact Newton)."""
    linear_share = 1.0
    """CG also ends when its last update is below this fraction of the tolerance."""
    patience = 1
    """Number of consecutive small updates after which CG ends. One is enough if the compliance is that of a short time.
    For a relaxed or elastic surface CG converges more slowly, and a small update may be followed by larger ones."""
    poll = staticmethod(lambda: None)
    """Called in each iteration of CG, on every rank; may raise Interrupted (interruption.py)."""

    def __init__(self, points: PunchPoints, operator: Convolves, law: CohesiveLaw, floating: bool):
        self.points, self.operator, self.law, self.floating = points, operator, law, floating
        vectors = [points.zeros(operator.dtype) for _ in "krstpyz"]
        self.curvature, self.r, self.s, self.t, self.p, self.y, self.z = vectors
        self._rows = np.zeros((6, points.rows))

    def correct(
        self, compliance: float, tolerance: float, unbalanced: float, trust: float, imbalance: float
    ) -> tuple[int, float, bool]:
        """Newton's correction s and its dual t by CG; (iterations, largest |s| in ranges, negative curvature met).

        All sums of an iteration are communicated together, as soon as z = A r is known (Chronopoulos and Gear,
        J. Comput. Appl. Math. 25, 153 (1989)): the curvature along the next direction follows from that along the last.
        If it is too small for this recursion, it is computed from the direction itself. The size of the next update is
        estimated from |z| and beta |last p| as if they were orthogonal. (Their sum, an upper bound, took 4 to 7 % more
        iterations.)
        """
        points, s, t, p, y, z, r = self.points, self.s, self.t, self.p, self.y, self.z, self.r
        k, offset, rows = self.curvature, points.offset, self._rows
        per_range, size, previous, alpha, quiet, beta, pull = 1.0 / self.law.length, 0.0, 1.0, 1.0, 0, 0.0, 0.0
        rows[4:6] = 0.0
        if self.floating:
            self._clear()
        imbalance = self._level(imbalance)
        for count in range(1, self.largest_count + 1):
            self.poll()
            first = count == 1 and not self.floating
            self.operator(r, z, compliance)
            kernels.survey(z, r, k, offset, rows)
            energy, stiff, bent, largest, turn, size = points.reduced(rows, 3)
            largest, turn, size = largest * per_range, turn * per_range, size * per_range
            if energy <= 0.0:
                if first:
                    self._clear()
                return count, size, False
            beta = 0.0 if count == 1 else energy / previous
            bend = energy + stiff - beta * energy / alpha
            sure = bend > UNSURE * (energy + abs(stiff))
            if not sure:
                bend = self._bend(beta, first)
                if bend <= 0.0:
                    return count, self._steihaug_exit(trust), True
            alpha, previous = energy / bend, energy
            # Sums of y + K p and of r. The latter is zero if the mean traction is set directly.
            left = 0.0 if self.floating else imbalance
            pull = left + bent + beta * pull
            imbalance = left - alpha * pull
            change = alpha * math.hypot(largest, beta * turn)
            so_far = size if count > 1 else change
            small = change < max(self.linear_share * tolerance, 0.5 * self.forcing * so_far)
            quiet = quiet + 1 if small and abs(imbalance) <= 0.5 * unbalanced else 0
            last = size + change > 2.0 * trust or quiet >= self.patience or count == self.largest_count
            if sure:
                kernels.turn_and_advance(z, beta, alpha, k, p, y, s, t, r, first, last, rows[4:6])
            else:
                kernels.advance(alpha, p, y, k, s, t, r, offset, rows)
                rows[4], rows[5] = rows[0] / alpha, rows[1]
            self._level(imbalance)
            if last:
                break
        if first and sure:
            return count, alpha * largest, False
        return count, points.reduced(rows[5:6], 0)[0] * per_range, False

    def stiffen(self, spring: float, compliance: float) -> None:
        """Hears of another spring of the machine, which its operator has already (machine.ConvolutionWithSpring)."""

    def _clear(self) -> None:
        """Clears correction and direction. Without a directly set mean traction, the first pass of CG overwrites
        them."""
        for vector in (self.s, self.t, self.p, self.y):
            vector[:] = 0.0

    def _bend(self, beta: float, first: bool) -> float:
        """Replaces p and y by the next direction and its dual; returns the curvature p (A^-1 + K) p along it, per area
        of a point. Collective."""
        if first:
            self._clear()
        kernels.turn_direction(
            self.z, self.r, beta, self.curvature, self.p, self.y, self.points.offset, self._rows
        )  # fmt: skip
        return self.points.reduced(self._rows[:1], 1)[0]

    def _level(self, imbalance: float) -> float:
        """If A is singular for a uniform traction, sets the mean traction so that the mean residual is zero.

        Returns the force imbalance; in the singular case, the change of the force by the last direction.
        """
        if self.floating:
            mean = imbalance / self.points.total
            self.r -= mean
            self.t += mean
        return imbalance

    def _steihaug_exit(self, trust: float) -> float:
        """Steihaug's exit: follows the last direction, along which the curvature is negative, to the boundary of the
        trust region; returns the largest |s| in ranges."""
        points = self.points
        kernels.largest_in_rows(self.p, self.curvature, points.offset, self._rows)
        largest = points.reduced(self._rows[:1], 0)[0]
        if largest == 0.0:
            # No interacting point moves, so the curvature is positive except for rounding: the solve has ended.
            return 0.0
        alpha = trust * self.law.length / largest
        kernels.advance(alpha, self.p, self.y, self.curvature, self.s, self.t, self.r, points.offset, self._rows)
        return points.reduced(self._rows[1:2], 0)[0] / self.law.length
