"""LOBPCG for the lowest curvature of the potential and its mode: is an equilibrium a minimum?

With A = J G0 and K = Gamma'' an equilibrium is a minimum if A^-1 + K is positive definite, that is, if the lowest
Rayleigh quotient mu = x K x / (x A^-1 x) is above -1. It is computed by the locally optimal preconditioned conjugate
gradient method (LOBPCG, block size one; Knyazev, SIAM J. Sci. Comput. 23, 517): the minimum over span{x, A g, p} with
the gradient g and the last direction p. As in newton.py, each vector v is stored with its dual A^-1 v, and each
iteration applies A once.

The softest mode is followed from step to step, which needs few iterations. But another mode may suddenly become the
softest, because the curvature of the law is discontinuous where points enter its range. Such a mode is localised at
these points, so the first direction of each search is the response to tractions on points that have softened since the
last step. A mode that breaks the symmetry of a symmetric scene has no component in any residual. So noise is added to
these tractions, or to the first gradient if there are none; it is the same on any number of ranks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg

from pgfmd.solver import kernels

from . import stability_kernels as kernels_of_modes

if TYPE_CHECKING:
    from pgfmd.solver.newton import NewtonSolver

NOISE = 1.0
"""Amplitude of the noise in the first gradient of a search, relative to the mode (in the norm of A^-1)."""
STEADY = 0.5
"""A search continues while an iteration lowers the curvature by more than this fraction of its present value."""
INDEPENDENT = {"float64": 1e-10, "float32": 1e-5}
"""A direction is not used if its component independent of the others is smaller than this, by the precision of the
mode: otherwise rounding would create spurious modes."""


@dataclass(frozen=True)
class Curvature:
    """The result of a search: `lowest` = 1 + mu, negative at a saddle point; error: there is an eigenvalue within this
    distance; iterations: each takes one pair of transforms."""

    lowest: float
    error: float
    iterations: int


class SoftestMode:
    """Searches for the lowest curvature, starting from the mode of the last search.

    solver: NewtonSolver, whose work vectors are used between its solves; its `curvature` is K of the last one.
    compliance: J, dimensionless.
    """

    least_iterations, most_iterations, first_iterations = 3, 12, 30
    """Smallest and largest number of iterations of a search; largest number without an initial mode."""

    def __init__(self, solver: NewtonSolver, compliance: float):
        self.solver, self.points, self.compliance = solver, solver.points, compliance
        self._rows = np.zeros((12, self.points.rows))
        # Displacement of a point by a unit traction on it; independent noise at every point has about this norm each.
        unit_traction, moved = (self.points.zeros(solver.rough.dtype) for _ in range(2))
        middle = self.points.total // 2 - self.points.first_point
        unit_traction[middle : middle + 1] = 1.0 if 0 <= middle < self.points.size else 0.0
        solver.rough(unit_traction, moved, compliance)
        self._own_response = self.points.maximum_of(float(moved.max(initial=0.0)))
        self._independent = INDEPENDENT[solver.rough.dtype.name]

    def search(self, mode: np.ndarray, dual: np.ndarray, seed: int, before: tuple[Any, ...] | None = None) -> Curvature:
        """Moves mode [m] and its dual [Pa] (size,) to the softest mode at the present surface. Collective.

        before: position [m] and surface [m] (size,) of the last equilibrium; None beyond the range of adhesion. A mode
        of zeros starts from noise. If K is nowhere negative, the curvature is at least 1, and the mode does not change.
        All work vectors are overwritten except the solver's traction and curvature.
        """
        solver, points = self.solver, self.points
        k, z, g, p, dp = solver.curvature, solver.cg.z, solver.cg.r, solver.cg.p, solver.cg.y
        if points.maximum_of(float(-k.min(initial=0.0))) == 0.0:
            # x K x is nowhere negative.
            return Curvature(1.0, 0.0, 0)
        p[:], dp[:] = 0.0, 0.0
        kernels_of_modes.noise(points.first_point, seed, k, g)
        noise = NOISE / math.sqrt(self._norm(g, g) * self._own_response)
        count, most = 0, self.most_iterations
        if not self._norm(mode, dual) > 0.0:
            solver.rough(g, z, self.compliance)
            mode[:], dual[:] = z, g
            count, most = 1, self.first_iterations
        size = math.sqrt(self._norm(mode, dual))
        mode /= size
        dual /= size
        kernels.dot(k * mode, mode, points.offset, self._rows)
        mu, error = self._total(1)[0], math.inf
        known = count == 0 and self._softened(seed, before)
        while count < most:
            solver.cg.poll()
            if not known:
                if noise:
                    kernels_of_modes.noise(points.first_point, seed, k, g)
                kernels_of_modes.pull_of(k, mode, dual, mu, noise, g)
            noise = 0.0
            solver.rough(g, z, self.compliance)
            count += 1
            # One rank decides, because different processors may round differently.
            best = self.points.comm.bcast(self._best(k, mode, dual, z, g, p, dp))
            if best is None and not known:
                break
            if best is not None:
                last, (mu, (a, b, c), error) = mu, best
                kernels_of_modes.recombine(a, b, c, mode, z, p)
                kernels_of_modes.recombine(a, b, c, dual, g, dp)
            known = False
            g[:] = 0.0
            if mu < -1.0 or (count >= self.least_iterations and mu < 0.0 and last - mu <= STEADY * (1.0 + mu)):
                break
        return Curvature(1.0 + mu, error, count)

    def _softened(self, seed: int, before: tuple[Any, ...] | None) -> bool:
        """Whether points have softened since `before`; the tractions on them are then in the vector of the residual.
        Collective."""
        solver, g = self.solver, self.solver.cg.r
        position, u = before if before else (math.inf, self.solver.cg.z)
        kernels_of_modes.softened(
            self.points.first_point, seed, solver.height, position, u, solver.law_numbers, solver.curvature, g
        )
        return self._norm(g, g) > 0.0

    def _total(self, kinds: int) -> np.ndarray:
        return self.points.total_of(self._rows[:kinds])

    def _norm(self, v: np.ndarray, dual: np.ndarray) -> float:
        kernels.dot(v, dual, self.points.offset, self._rows)
        return float(self._total(1)[0])

    def _best(
        self, k: np.ndarray, x: np.ndarray, dx: np.ndarray, z: np.ndarray, dz: np.ndarray, p: np.ndarray, dp: np.ndarray
    ) -> tuple[float, tuple[float, float, float], float] | None:
        """(mu, weights of x, z and p, error) of the lowest quotient in their span; None if it is that of x."""
        kernels_of_modes.quotients(k, x, dx, z, dz, p, dp, self.points.offset, self._rows)
        bend, norm = (_symmetric(values) for values in np.split(self._total(12), 2))
        if not np.isfinite(bend + norm).all():
            return None
        size = np.sqrt(np.maximum(np.diag(norm), 0.0))
        used = size > 0.0
        size[~used] = 1.0
        bend, norm = bend / np.outer(size, size), norm / np.outer(size, size)
        keep = [0] + [i for i in (1, 2) if used[i]]
        if len(keep) == 3 and np.linalg.eigvalsh(norm)[0] < self._independent:
            keep = [0, 1]
        if len(keep) < 2 or np.linalg.eigvalsh(norm[np.ix_(keep, keep)])[0] < self._independent:
            return None
        values, vectors = scipy.linalg.eigh(bend[np.ix_(keep, keep)], norm[np.ix_(keep, keep)])
        weights = np.zeros(3)
        weights[keep] = vectors[:, 0]
        # From the gradient before this step: its norm bounds the distance to an eigenvalue.
        gradient = size[1] if used[1] else 0.0
        of_x, of_z, of_p = weights / size
        return float(values[0]), (of_x, of_z, of_p), float(gradient)


def _symmetric(six: np.ndarray) -> np.ndarray:
    """A symmetric 3 x 3 matrix from its entries 00, 01, 02, 11, 12, 22."""
    matrix: np.ndarray = six[np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])]
    return matrix
