"""Descent to a minimum of the incremental potential Phi (newton.py) by nonlinear conjugate gradients.

Each iteration computes the preconditioned gradient z = A r and minimises Phi in the span of z and the last update p, by
Newton's method in two unknowns. Every vector is stored with its dual, A^-1 times it, so this minimisation takes no
transform; that of z is the only pair of the iteration. Close to a minimum the method is equivalent to the linear
conjugate gradients of conjugate_gradients.py. Far from a minimum, it does not solve for corrections that would then be
truncated, and always uses the present curvature. All updates are combinations of residuals, so the descent preserves
every symmetry of its start, like Newton's method.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from . import descent_kernels as kernels
from .newton import NewtonSolver, Outcome
from .stagnation import MOST_IDLE, Progress

FAITHFUL = 0.25
"""Newton's method in two unknowns continues if the decrease of Phi differs from the expected one by more than this
fraction."""
MOST_TURNS = 5
"""Its largest number of iterations."""
FLAT = 1e-3
"""Lower bound of the absolute value of a curvature; the trust region then limits the step."""
INDEPENDENT = {"float64": 1e-8, "float32": 1e-4}
"""The last update is not used if its component orthogonal to z is smaller than this (squared, relative), by the
precision of directions: nearly parallel vectors would amplify rounding errors by the inverse."""

Pair = tuple[float, float]
Three = tuple[float, float, float]


@dataclass
class _Place:
    """Values at a trial point: sums of f and r [Pa] and of Gamma, and the increase of the rest of Phi since the start
    [Pa m]; downhill slopes of Phi, and curvatures K (zz, zp, pp) along z and p; the largest displacement [ranges]."""

    pull: float
    imbalance: float
    adhesive: float
    rise: float
    slope: Pair
    bend: Three
    size: float

    @property
    def potential(self) -> float:
        """Phi, without the part of u and w at the start."""
        return self.adhesive + self.rise


LEAST_SCALE = 1e-9
"""Smallest fraction of an update: if numbers are not finite even then, the update is not the cause."""


class Descent:
    """Moves surfaces downhill, with the work vectors of a NewtonSolver, whose `traction` and `curvature` are afterwards
    those of the solution. Keeps nothing from one solve to the next."""

    largest_count, largest_jump_count = 600, 100_000
    """Largest number of iterations, normally and in a jump, where a crack may propagate through the whole punch cell by
    cell."""
    patience = 2
    """Number of consecutive updates below the tolerance after which a solve ends: a small one may be followed by larger
    ones."""

    def __init__(self, solver: NewtonSolver):
        self.solver, self.points, self.law = solver, solver.points, solver.law
        self._independent = INDEPENDENT[solver.rough.dtype.name]
        self._rows = np.zeros((10, solver.points.rows))

    def solve(
        self, position: float, history: np.ndarray, compliance: float, u: np.ndarray, w: np.ndarray, tolerance: float, jump: bool = False,
        stop_at_instability: bool = False, largest_force: float = 0.0,
    ) -> Outcome:  # fmt: skip
        """As NewtonSolver.solve."""
        solver, cg = self.solver, self.solver.cg
        self._at = position, u, w, history, compliance
        unbalanced = solver.force_share * tolerance * solver.force_scale / self.points.grid.cell_area
        progress, noise, left_over, count = Progress(tolerance, unbalanced), 0.0, 0.0, 0
        trust, moved, drop, quiet, turns = 1.0, 0.0, 0.0, 0, 0
        here, negative, renewed, converged = self._begin(), False, False, False
        for count in range(1, 1 + (self.largest_jump_count if jump else self.largest_count)):
            if not math.isfinite(here.adhesive):
                break
            norm, start = self._steepest(here)
            if not norm[0] > 0.0:
                # The residual is zero or not finite.
                converged = norm[0] <= 0.0
                break
            slack = solver._slack_of(here.adhesive)
            there, step, bent, used = self._lower(norm, start, trust, slack, 1e-3 * tolerance)
            turns, negative = turns + used, negative or bent
            if stop_at_instability and (bent or moved + there.size > solver.longest_stable_travel):
                here = self._probe((0.0, 0.0))
                break
            if used == 0:
                # Phi does not decrease: u has drifted from G0 w, or this is the limit of rounding.
                if renewed:
                    break
                solver.convolve(w, u)
                here, renewed = self._begin(), True
                continue
            kernels.move_on(step[0], cg.z, cg.t, step[1], cg.p, cg.y, compliance, u, w)
            self._level(there)
            gained = here.adhesive - there.potential
            drop, moved, size = drop + gained, moved + there.size, there.size
            unsettled = abs(there.pull - here.pull) if solver.floating else abs(there.imbalance)
            here, trust = there, 2.0 * trust if size >= 0.99 * trust else trust
            quiet = quiet + 1 if size < tolerance and unsettled <= unbalanced and not bent else 0
            if quiet >= self.patience:
                converged = True
                break
            noise = solver._noise(compliance, u, w) if count == MOST_IDLE else noise
            if progress.stalls(drop, slack + noise, size, unsettled):
                converged, left_over = solver._settle_for(progress, bent, size, unsettled, here.pull, largest_force)
                break
        area = self.points.grid.cell_area
        return Outcome(
            converged, turns, count, -here.pull * area, drop * area, here.adhesive * area, negative, moved, left_over, renewed
        )  # fmt: skip

    def _begin(self) -> _Place:
        """The present point, without a last update."""
        cg = self.solver.cg
        cg.p[:], cg.y[:], cg.z[:], cg.t[:] = 0.0, 0.0, 0.0, 0.0
        here = self._probe((0.0, 0.0))
        self._level(here)
        return here

    def _steepest(self, here: _Place) -> tuple[Three, _Place]:
        """z = A r, with one pair of transforms; products v A^-1 v' (zz, zp, pp) of z and p, and the present point with
        slopes and curvatures along these. Collective."""
        cg = self.solver.cg
        cg.poll()
        self.solver.rough(cg.r, cg.z, self._at[4])
        # The dual of z is the residual; the next residual uses another array.
        cg.r, cg.t = cg.t, cg.r
        kernels.products(cg.curvature, cg.z, cg.t, cg.p, cg.y, self.points.offset, self._rows)
        sums = self.points.total_of(self._rows[:6]).tolist()
        place = _Place(here.pull, here.imbalance, here.adhesive, 0.0, tuple(sums[3:5]), tuple(sums[:3]), 0.0)
        return tuple(sums[3:]), place

    def _probe(self, moved: Pair) -> _Place:
        """The point u + moved (z, p); sets traction, curvature and residual. Collective."""
        cg, (position, u, w, history, compliance) = self.solver.cg, self._at
        kernels.probe(
            self.solver.height, position, u, w, moved[0], cg.z, cg.t, moved[1], cg.p, cg.y, history, compliance,
            self.solver.law_numbers, self.points.offset, self.solver.traction, cg.curvature, cg.r, self._rows,
        )  # fmt: skip
        rows = self.points.all_rows(self._rows)
        sums = self.points.summed(rows[:9]).tolist()
        pull, imbalance, adhesive, rise, down, along, zz, zp, pp = sums
        return _Place(
            pull, imbalance, adhesive, rise, (down, along), (zz, zp, pp), float(rows[9].max()) / self.law.length
        )

    def _lower(
        self, norm: Three, start: _Place, trust: float, slack: float, least: float
    ) -> tuple[_Place, Pair, bool, int]:
        """A lower point in the span: (the point, its coordinates (z, p), whether there is negative curvature in the
        span, iterations of Newton's method, 0 if there is no lower point). trust, least: largest and smallest update
        [ranges]."""
        here, moved, bent, used = start, (0.0, 0.0), False, 0
        for turn in range(MOST_TURNS):
            more, expected, lowest = newton_step(norm, here.bend, here.slope, self._independent)
            bent = lowest <= 0.0 if turn == 0 else bent
            there, scale = self._step_down(here, moved, more, trust, slack, least)
            if scale == 0.0:
                here = self._probe(moved)
                break
            used += 1
            gain = here.potential - there.potential
            here, moved = there, _further(moved, scale, more)
            if scale < 1.0 or abs(gain - expected) <= FAITHFUL * expected + slack:
                break
        return here, moved, bent, used

    def _step_down(
        self, here: _Place, moved: Pair, more: Pair, trust: float, slack: float, least: float
    ) -> tuple[_Place, float]:
        """The point at `moved` plus a fraction of `more`, halved until Phi does not increase: (the point, the fraction).
        The fraction is 0 if Phi always increases, or if the sum is too long and `moved` is not zero."""
        scale = 1.0
        while True:
            there = self._probe(_further(moved, scale, more))
            if not math.isfinite(there.size + there.potential) and scale < LEAST_SCALE:
                return there, 0.0
            if there.size > trust * (1.0 + 1e-9):
                if moved != (0.0, 0.0):
                    return there, 0.0
                scale *= trust / there.size
            elif there.potential <= here.potential + slack:
                return there, scale
            elif there.size < least:
                return there, 0.0
            else:
                scale *= 0.5

    def _level(self, there: _Place) -> None:
        """If A is singular for a uniform traction, sets the mean traction so that the mean residual is zero."""
        if self.solver.floating:
            mean = there.imbalance / self.points.total
            self.solver.cg.r -= mean
            w, compliance = self._at[2], self._at[4]
            w += compliance * mean


def _further(moved: Pair, scale: float, more: Pair) -> Pair:
    return moved[0] + scale * more[0], moved[1] + scale * more[1]


def newton_step(norm: Three, bend: Three, slope: Pair, least: float) -> tuple[Pair, float, float]:
    """Newton's step in the span of two directions z and p: (its coordinates (z, p), the expected decrease of Phi, the
    lowest curvature in the span).

    norm, bend: products (zz, zp, pp) with A^-1, where zz > 0, and with K. slope: downhill slopes of Phi along z and p.
    p is not used if its component orthogonal to z, squared and relative, is not above `least`. Along a direction of
    negative curvature the step uses its absolute value. The arithmetic is the same on any processor.
    """
    size, along = math.sqrt(norm[0]), norm[1] / norm[0]
    a, first = 1.0 + bend[0] / norm[0], slope[0] / size
    across = norm[2] - along * norm[1]
    if not across > least * norm[2]:
        length = first / max(abs(a), FLAT)
        return (length / size, 0.0), 0.5 * first * length, a
    # In the orthonormal directions z / size and (p - along z) / width, eigenvalues of the matrix ((a, b), (b, c)).
    width = math.sqrt(across)
    b = (bend[1] - along * bend[0]) / (size * width)
    c = 1.0 + (bend[2] - 2.0 * along * bend[1] + along * along * bend[0]) / across
    second = (slope[1] - along * slope[0]) / width
    half = 0.5 * (a - c)
    lowest, apart = 0.5 * (a + c), math.sqrt(half * half + b * b)
    # The direction of the lowest eigenvalue, (cosine, sine), without cancellation.
    x, y = (-b, half + apart) if half >= 0.0 else (apart - half, -b)
    length = math.sqrt(x * x + y * y)
    cosine, sine = (x / length, y / length) if length > 0.0 else (1.0, 0.0)
    low, high = cosine * first + sine * second, cosine * second - sine * first
    down = low / max(abs(lowest - apart), FLAT)
    other = high / max(abs(lowest + apart), FLAT)
    one, two = cosine * down - sine * other, sine * down + cosine * other
    step = one / size - two * along / width, two / width
    return step, 0.5 * (low * down + high * other), lowest - apart
