"""The static adhesive contact problem of an implicit step, solved by Newton's method with a trust region.

The unknowns are the effective traction w and the displacement u = G0 w of the surface, with
w = J f(d + z - u) + w_hist. Solutions are stationary points of the incremental potential

    Phi(u) = sum u (w/2 - w_hist) / J + Gamma(d + z - u)

Newton's correction s solves (A^-1 + K) s = r with A = J G0, K = Gamma'' and r = f - (w - w_hist) / J. It is found by
conjugate gradients (CG) preconditioned by A. Each direction p is stored with its dual y = A^-1 p, so that A^-1 is never
applied. u, w and Phi are updated locally, and one application of G0 per CG iteration is the only transform. If the
curvature along p is negative, or the correction leaves the trust region, it ends at the boundary of that region, as in
Steihaug's method (SIAM J. Numer. Anal. 20, 626 (1983)). Phi must decrease.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from . import contact_kernels, kernels
from .conjugate_gradients import ConjugateGradients
from .grid import PunchPoints
from .stagnation import MOST_IDLE, Progress
from .tiles import Convolves

if TYPE_CHECKING:
    from pgfmd.physics.adhesion.base import CohesiveLaw

MakeCorrections = Callable[[PunchPoints, Convolves, "CohesiveLaw", bool], ConjugateGradients]
"""Makes the solver for corrections, with the arguments of ConjugateGradients."""
Sums = tuple[float, float, float, float]
"""Sums of f, r and Gamma, and the increase of the rest of Phi, per area of a point."""
SLACK = {("float64", "float64"): 1e-12, ("float64", "float32"): 1e-10, ("float32", "float32"): 1e-6}
"""Relative increase of Phi that is attributed to rounding, by the precisions of u and w, and of the corrections."""
SLIDES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
"""Lengths of the first move away from a saddle point, in ranges of adhesion: the first that decreases the potential."""
MOST_SLIDE = 4.0
"""Longest such move. The length is doubled up to this as long as the potential decreases."""


@dataclass(frozen=True)
class Outcome:
    """The result of a solve: whether it converged, its iterations, the force on the punch [N], the decrease of Phi, and
    the adhesive energy [J].

    moved: sum over all corrections of the largest displacement of the surface [ranges of adhesion].
    left_over: force imbalance relative to the tolerance, if the solve ended at the limit of rounding; else 0.
    renewed: whether u was evaluated again from w during the solve.
    """

    converged: bool
    newton_iterations: int
    cg_iterations: int
    force: float
    potential_drop: float
    adhesive: float
    met_negative_curvature: bool
    moved: float = 0.0
    left_over: float = 0.0
    renewed: bool = False

    def followed_by(self, later: Outcome) -> Outcome:
        """The combined result of this solve and a later one that continued from it."""
        return replace(
            later,
            newton_iterations=self.newton_iterations + later.newton_iterations,
            cg_iterations=self.cg_iterations + later.cg_iterations,
            potential_drop=self.potential_drop + later.potential_drop,
            met_negative_curvature=self.met_negative_curvature or later.met_negative_curvature,
            moved=self.moved + later.moved,
            renewed=self.renewed or later.renewed,
        )


@dataclass(frozen=True)
class _Problem:
    """The arguments of `NewtonSolver.solve`. u and w are changed in place."""

    position: float
    history: np.ndarray
    compliance: float
    u: np.ndarray
    w: np.ndarray


@dataclass
class _Course:
    """The values of Outcome during a solve; pull [Pa], adhesive and drop [J/m^2] are sums over points."""

    pull: float
    adhesive: float
    newton_iterations: int = 0
    cg_iterations: int = 0
    drop: float = 0.0
    met_negative_curvature: bool = False
    moved: float = 0.0
    renewed: bool = False

    def correct(self, iterations: int, bent: bool) -> None:
        """Counts a correction with its iterations of CG; bent: whether there was negative curvature."""
        self.newton_iterations += 1
        self.cg_iterations += iterations
        self.met_negative_curvature = self.met_negative_curvature or bent


class NewtonSolver:
    """Solves implicit steps on point vectors. Owns work arrays, but keeps nothing from one solve to the next.

    points: PunchPoints. convolve: the Convolution with G0. height z [m] (size,). law: CohesiveLaw.
    force_scale [N]: unit of relative errors of the force: the preload.
    rough: the same operator in single precision, if corrections are computed with it; residuals, u and w have the
    precision of `convolve`.
    corrections: makes the solver for corrections, with the arguments of ConjugateGradients.
    After a solve, `traction` and `curvature` are those of the solution.
    """

    largest_newton_count = 60
    largest_jump_count = 20_000
    """Largest number of corrections in a jump, where a crack may propagate through the whole punch, by about one grid
    cell per correction."""
    longest_stable_travel = 0.5
    """A solve with `stop_at_instability` ends when the surface has moved by more than this many ranges of adhesion."""
    force_share = 0.2
    """Tolerance of the force imbalance, relative to force_scale, as a fraction of the tolerance."""

    def __init__(
        self, points: PunchPoints, convolve: Convolves, height: np.ndarray, law: CohesiveLaw, force_scale: float,
        rough: Convolves | None = None, corrections: MakeCorrections = ConjugateGradients,
    ):  # fmt: skip
        self.force_scale = force_scale
        # A traction on the whole plane has a mean, for which a half-space has no compliance.
        self.floating = points.total == points.grid.n**2 and convolve.mean_compliance == 0.0
        self.points, self.convolve, self.height, self.law = points, convolve, height, law
        self.law_numbers = law.numbers
        self.rough = rough or convolve
        self.operators = [convolve, rough] if rough else [convolve]
        self.dtype, self._slack = convolve.dtype, SLACK[convolve.dtype.name, self.rough.dtype.name]
        self.traction = points.zeros(self.dtype)
        self.cg = corrections(points, self.rough, law, self.floating)
        self.curvature = self.cg.curvature
        # Sum of w at which a machine's spring has the length that a solve's position assumes, None without a spring.
        self.start: float | None = None
        self._rows = np.zeros((4, points.rows))

    def solve(
        self, position: float, history: np.ndarray, compliance: float, u: np.ndarray, w: np.ndarray, tolerance: float,
        jump: bool = False, stop_at_instability: bool = False, largest_force: float = 0.0,
    ) -> Outcome:  # fmt: skip
        """Moves u [m] and w [Pa] (in place, with u = G0 w) downhill to a minimum of Phi.

        position: d [m]. history: w_hist [Pa] (size,). compliance: J (dimensionless, relative to the relaxed one).
        tolerance: of the displacement of interacting points, in ranges of adhesion. A fifth of it is the tolerance of
        the force imbalance, in units of force_scale. (An error of long wavelength far below the range may correspond to
        a large force, because K_0 rho is a large stress.)
        jump: the surface may move far.
        stop_at_instability: end at a negative curvature, or if the surface has moved far, because a better start is available.
        largest_force [N]: so far, or 0. At the limit of rounding, an imbalance that is small compared with this force
        is accepted.
        If the solve does not converge, u and w are those with the lowest Phi.
        """
        problem = _Problem(position, history, compliance, u, w)
        pull, imbalance, potential, _ = self._evaluate(problem, 0.0)
        course, trust, last_pull = _Course(pull, potential), 1.0, pull
        if not math.isfinite(potential):
            return self._outcome(course, False)
        unbalanced = self.force_share * tolerance * self.force_scale / self.points.grid.cell_area
        progress, noise = Progress(tolerance, unbalanced), 0.0
        for count in range(1, 1 + (self.largest_jump_count if jump else self.largest_newton_count)):
            used, size, bent = self.cg.correct(compliance, tolerance, unbalanced, trust, imbalance)
            course.correct(used, bent)
            if stop_at_instability and (bent or course.moved + size > self.longest_stable_travel):
                break
            longest = trust / size if size > trust or (bent and size > 0.0) else 1.0
            shortest = self._shortest(tolerance, size, everywhere=course.renewed and not stop_at_instability)
            scale, (course.pull, imbalance, trial, growth) = self._go_down(problem, course.adhesive, longest, shortest)
            if scale == 0.0:
                # Phi does not decrease along a descent direction: u has drifted from G0 w, or this is the limit of rounding.
                if course.renewed:
                    break
                self._renew(w, u)
                course.renewed = True
                course.pull, imbalance, course.adhesive, _ = self._evaluate(problem, 0.0)
                continue
            kernels.move(u, w, self.cg.s, self.cg.t, scale, scale * compliance)
            # If the mean traction is set directly, the error of the force is its change in the last correction.
            unsettled = max(abs(imbalance), abs(course.pull - last_pull) if self.floating else 0.0)
            last_pull = course.pull
            gained, course.adhesive = course.adhesive - trial - growth, trial
            course.drop += gained
            small = size < tolerance or (self.cg.forcing + size) * size < tolerance
            if scale == 1.0 and not bent and small and unsettled <= unbalanced:
                course.moved += size
                return self._outcome(course, True)
            noise = self._noise(compliance, u, w) if count == MOST_IDLE else noise
            if progress.stalls(course.drop, self._slack_of(course.adhesive) + noise, size, unsettled):
                enough, left_over = self._settle_for(progress, bent, size, unsettled, course.pull, largest_force)
                course.moved += size
                return self._outcome(course, enough, left_over)
            moved = scale * size
            course.moved += moved
            trust = 2.0 * max(trust, moved) if gained > 0.0 and moved >= 0.99 * trust else max(2.0 * moved, 0.25)
        return self._outcome(course, False)

    def _renew(self, w: np.ndarray, u: np.ndarray) -> None:
        """Computes u of w anew, with what a machine's spring has given way since the start. Collective."""
        from .machine import ConvolutionWithSpring

        if self.start is None:
            self.convolve(w, u)
        else:
            assert isinstance(self.convolve, ConvolutionWithSpring)
            self.convolve.since(self.start, w, u)

    def stiffen(self, spring: float, compliance: float) -> None:
        """Prepares for solves with a machine's spring of the compliance `spring` [m/N], and J = compliance."""
        from .machine import ConvolutionWithSpring

        for operator in self.operators:
            assert isinstance(operator, ConvolutionWithSpring)
            operator.stiffen(spring, compliance)
        self.cg.stiffen(spring, compliance)

    def _settle_for(
        self, progress: Progress, bent: bool, size: float, unsettled: float, pull: float, largest_force: float
    ) -> tuple[bool, float]:
        """Whether the result of a stalled solve is accepted, and Outcome.left_over."""
        if bent or size >= progress.tolerance:
            return False, 0.0
        largest = max(largest_force, abs(pull) * self.points.grid.cell_area) if largest_force else 0.0
        enough = unsettled <= progress.unbalanced * max(1.0, largest / self.force_scale)
        return enough, 0.0 if enough else progress.least_unsettled / progress.unbalanced

    def _slack_of(self, potential: float) -> float:
        """Increase of Phi attributed to rounding, per area of a point."""
        slack: float = self._slack * (abs(potential) + 0.1 * self.law.work_of_adhesion * self.points.total)
        return slack

    def _noise(self, compliance: float, u: np.ndarray, w: np.ndarray) -> float:
        """Error of Phi due to the rounding of u, per area of a point. The displacement of a soft spring may be so large
        that corrections are lost in rounding. Collective."""
        squares = []
        for vector in (u, w):
            kernels.dot(vector, vector, self.points.offset, self._rows)
            squares.append(self.points.reduced(self._rows[:1], 1)[0])
        return float(np.finfo(self.dtype).eps) * math.sqrt(squares[0] * squares[1]) / compliance

    def _shortest(self, tolerance: float, size: float, everywhere: bool) -> float:
        """Smallest fraction of a correction that is tried. everywhere: measure the correction at all points, not only
        at interacting ones. This is needed if no point interacts: the correction then releases the surface without
        regard to obstacles, and may press it far into the punch. Collective."""
        if everywhere and size == 0.0:
            size = self.points.maximum_of(float(np.abs(self.cg.s).max(initial=0.0))) / self.law.length
        return 1e-3 * tolerance / max(size, 1.0)

    def _go_down(self, problem: _Problem, potential: float, longest: float, shortest: float) -> tuple[float, Sums]:
        """Halves the step along s until Phi does not increase; (step, result of `_evaluate` there), with step 0 if it
        always increases."""
        scale = longest
        slack = self._slack_of(potential)
        while scale >= shortest:
            values = self._evaluate(problem, scale)
            if values[2] + values[3] <= potential + slack:
                return scale, values
            scale *= 0.5
        return 0.0, self._evaluate(problem, 0.0)

    def slide(
        self, position: float, history: np.ndarray, compliance: float, u: np.ndarray, w: np.ndarray, mode: np.ndarray,
        dual: np.ndarray,
    ) -> float:  # fmt: skip
        """Moves u [m] and w [Pa] along a mode of negative curvature, to about the lowest Phi on either side; returns
        the decrease [J].

        mode [m] and its dual A^-1 mode [Pa]. The move is long enough that the descent does not return to the saddle
        point. If Phi is not lower on either side, nothing moves, and traction and curvature are those of the present
        surface. Collective.
        """
        problem = _Problem(position, history, compliance, u, w)
        self.cg.s[:], self.cg.t[:] = mode, dual
        whole = self.law.length / self.points.maximum_of(float(np.abs(mode).max(initial=0.0)))
        values = self._evaluate(problem, 0.0)
        start, best, best_step = values[2], -self._slack * abs(values[2]), 0.0
        for first in SLIDES:
            for sign in (1.0, -1.0):
                step = sign * first * whole
                while abs(step) <= MOST_SLIDE * whole:
                    values = self._evaluate(problem, step)
                    if not values[2] + values[3] - start < best:
                        break
                    best, best_step = values[2] + values[3] - start, step
                    step *= 2.0
            if best_step:
                kernels.move(u, w, self.cg.s, self.cg.t, best_step, best_step * compliance)
                return -best * self.points.grid.cell_area
        self._evaluate(problem, 0.0)
        return 0.0

    def _outcome(self, course: _Course, converged: bool, left_over: float = 0.0) -> Outcome:
        if not converged:
            # The next solve starts with 0 s and 0 t, so these must be finite.
            self.cg.s[:] = 0.0
            self.cg.t[:] = 0.0
        area = self.points.grid.cell_area
        return Outcome(
            converged, course.newton_iterations, course.cg_iterations, -course.pull * area, course.drop * area,
            course.adhesive * area, course.met_negative_curvature, course.moved, left_over, course.renewed,
        )  # fmt: skip

    def _evaluate(self, problem: _Problem, step: float) -> Sums:
        """Sums of f, r and Gamma, and the increase of the rest of Phi along s (kernels.py), per area of a point; sets
        traction, curvature and residual at u + step s."""
        contact_kernels.evaluate(
            self.height, problem.position, problem.u, problem.w, self.cg.s, self.cg.t, step, step * problem.compliance,
            problem.history, problem.compliance, self.law_numbers, self.points.offset, self.traction, self.curvature,
            self.cg.r, self._rows,
        )  # fmt: skip
        pull, imbalance, adhesive, growth = self.points.reduced(self._rows, 4)
        return pull, imbalance, adhesive, growth
