"""One implicit step: a static adhesive contact problem, solved downhill by Newton's method with conjugate gradients.

A step asks for w and u = G0 w with w = J f(d + z - u) + w_hist. Its solutions are the stationary points of

    Phi(u) = sum u (w/2 - w_hist) / J + Gamma(d + z - u)

Newton's correction s solves (A^-1 + K) s = r with A = J G0, K = Gamma'' and r = f - (w - w_hist) / J. It is found by
conjugate gradients preconditioned by A. With every direction p its dual y = A^-1 p is carried along, so A^-1 is never
applied; u, w and Phi are updated locally, and one application of G0 a CG iteration is the only transform. Where the
curvature along p is negative, or the correction leaves the region of trust, the step ends at that region's edge; Phi
must go down.
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
    from pgfmd.physics.cohesion import CohesiveLaw

MakeCorrections = Callable[[PunchPoints, Convolves, "CohesiveLaw", bool], ConjugateGradients]
"""What makes the finder of corrections, as ConjugateGradients is made."""
Sums = tuple[float, float, float, float]
"""Of f, r and Gamma, and the growth of the rest of Phi, per area of a point."""
SLACK = {("float64", "float64"): 1e-12, ("float64", "float32"): 1e-10, ("float32", "float32"): 1e-6}
"""How far Phi may rise by rounding, relative to itself: by the precision of u and w, and of the corrections."""
SLIDES = (1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5)
"""Lengths of the first move away from a saddle point, in ranges of adhesion: the first that decreases the potential."""
MOST_SLIDE = 4.0
"""Longest such move. The length is doubled up to this as long as the potential decreases."""


@dataclass(frozen=True)
class Outcome:
    """How a solve ended: whether it converged, its iterations, the force on the punch [N], by how much Phi fell, and
    the adhesive energy [J].

    moved: sum of the largest moves of the surface [ranges of adhesion] by all corrections. left_over: the force out of
    balance, relative to what was allowed, where the solve ended because rounding allows no less; else 0. renewed:
    whether u was evaluated anew from w on the way.
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
        """Of two solves, the second of which went on where this one ended."""
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
    """What a solve is given, as `NewtonSolver.solve` names it. u and w move."""

    position: float
    history: np.ndarray
    compliance: float
    u: np.ndarray
    w: np.ndarray


@dataclass
class _Course:
    """A solve so far, as Outcome has it at its end; pull [Pa], adhesive and drop [J/m^2]: sums over points."""

    pull: float
    adhesive: float
    newton_iterations: int = 0
    cg_iterations: int = 0
    drop: float = 0.0
    met_negative_curvature: bool = False
    moved: float = 0.0
    renewed: bool = False

    def correct(self, iterations: int, bent: bool) -> None:
        """One more correction, of so many iterations of CG; bent: whether Phi bends down along it."""
        self.newton_iterations += 1
        self.cg_iterations += iterations
        self.met_negative_curvature = self.met_negative_curvature or bent


class NewtonSolver:
    """Solves implicit steps on point vectors. Holds the work arrays; keeps nothing from one solve to the next.

    points: PunchPoints. convolve: the Convolution with G0. height z [m] (size,). law: CohesiveLaw. force_scale [N]: the
    force that a relative error of one would be, the preload. rough: the same operator in single precision, if
    corrections are to be found by it; residuals, u and w keep the precision of `convolve`. corrections: makes what finds
    them, as ConjugateGradients is made.
    After a solve, `traction` and `curvature` are those of the solution.
    """

    largest_newton_count = 60
    largest_jump_count = 20_000
    """Correction counts at which a solve gives up. In a jump a crack may run through the whole punch, a cell or so a
    correction."""
    timid_way = 0.5
    """A timid solve gives up when the surface moves by more than this many ranges of adhesion."""
    force_share = 0.2
    """The force out of balance, relative to the force scale, may be this share of the tolerance."""

    def __init__(
        self, points: PunchPoints, convolve: Convolves, height: np.ndarray, law: CohesiveLaw, force_scale: float,
        rough: Convolves | None = None, corrections: MakeCorrections = ConjugateGradients,
    ):  # fmt: skip
        self.force_scale = force_scale
        # A traction on the whole plane has a mean, and a half-space no compliance for it.
        self.floating = points.total == points.grid.n**2 and convolve.mean_compliance == 0.0
        self.points, self.convolve, self.height, self.law = points, convolve, height, law
        self.law_numbers = (law.stiffness, law.range, 1.0 if law.attractive else 0.0)
        self.rough = rough or convolve
        self.operators = [convolve, rough] if rough else [convolve]
        self.dtype, self._slack = convolve.dtype, SLACK[convolve.dtype.name, self.rough.dtype.name]
        self.traction = points.zeros(self.dtype)
        self.cg = corrections(points, self.rough, law, self.floating)
        self.curvature = self.cg.curvature
        self._rows = np.zeros((4, points.rows))

    def solve(
        self, position: float, history: np.ndarray, compliance: float, u: np.ndarray, w: np.ndarray, tolerance: float,
        jump: bool = False, timid: bool = False, largest_force: float = 0.0,
    ) -> Outcome:  # fmt: skip
        """Moves u [m] and w [Pa] (in place, consistent: u = G0 w) to a minimum of Phi downhill of where they are.

        position d [m]; history w_hist [Pa] (size,); compliance J (dimensionless, relative to the relaxed one);
        tolerance: largest displacement error over interacting points, in ranges of adhesion; a fifth of it bounds the
        force that is out of balance, in force scales. (A long-waved error far below the range can carry a force: K_0
        rho is no small stress.) jump: the way down may be long. timid: give up where the potential bends down along a
        direction, or the surface has moved far: there is a better start, nearer by. largest_force [N] so far, if not 0:
        where rounding allows no better balance, one that is good beside this force will do. Where it does not converge,
        u and w stay at the lowest Phi found.
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
            if timid and (bent or course.moved + size > self.timid_way):
                break
            longest = trust / size if size > trust or (bent and size > 0.0) else 1.0
            shortest = self._shortest(tolerance, size, everywhere=course.renewed and not timid)
            scale, (course.pull, imbalance, trial, growth) = self._go_down(problem, course.adhesive, longest, shortest)
            if scale == 0.0:
                # Not downhill along a direction that should be: u has drifted off G0 w, or rounding is reached.
                if course.renewed:
                    break
                self.convolve(w, u)
                course.renewed = True
                course.pull, imbalance, course.adhesive, _ = self._evaluate(problem, 0.0)
                continue
            kernels.move(u, w, self.cg.s, self.cg.t, scale, scale * compliance)
            # Where the mean load balances by itself, the force is known as well as the last correction has left it.
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

    def _settle_for(
        self, progress: Progress, bent: bool, size: float, unsettled: float, pull: float, largest_force: float
    ) -> tuple[bool, float]:
        """Whether what a stalled solve has reached will do, and Outcome.left_over."""
        if bent or size >= progress.tolerance:
            return False, 0.0
        largest = max(largest_force, abs(pull) * self.points.grid.cell_area) if largest_force else 0.0
        enough = unsettled <= progress.unbalanced * max(1.0, largest / self.force_scale)
        return enough, 0.0 if enough else progress.least_unsettled / progress.unbalanced

    def _slack_of(self, potential: float) -> float:
        """How far Phi may rise by rounding, per area of a point."""
        return self._slack * (abs(potential) + 0.1 * self.law.work_of_adhesion * self.points.total)

    def _noise(self, compliance: float, u: np.ndarray, w: np.ndarray) -> float:
        """What the rounding of u alone makes of Phi, per area of a point: the end of a soft spring is so far away that
        corrections vanish in it. Collective."""
        squares = []
        for vector in (u, w):
            kernels.dot(vector, vector, self.points.offset, self._rows)
            squares.append(self.points.reduced(self._rows[:1], 1)[0])
        return float(np.finfo(self.dtype).eps) * math.sqrt(squares[0] * squares[1]) / compliance

    def _shortest(self, tolerance: float, size: float, everywhere: bool) -> float:
        """Least part of a correction that is tried. everywhere: where nothing interacts, so that the correction knows
        of no obstacle on its way, by how far it moves any point: it sets the surface free, and may press it far into
        the punch. Collective."""
        if everywhere and size == 0.0:
            size = self.points.maximum_of(float(np.abs(self.cg.s).max(initial=0.0))) / self.law.range
        return 1e-3 * tolerance / max(size, 1.0)

    def _go_down(self, problem: _Problem, potential: float, longest: float, shortest: float) -> tuple[float, Sums]:
        """Halves the step along s until Phi does not rise; (step, what `_evaluate` gives there), step 0 where it always
        rises."""
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
        """Moves u [m] and w [Pa] along a mode of negative curvature, to about the lowest Phi either way; by how much it
        fell [J].

        mode [m] and its dual A^-1 mode [Pa]. A saddle is left that far that no descent leads back. Where there is no
        lower place either way, nothing moves, and traction and curvature are those of the surface as it is. Collective.
        """
        problem = _Problem(position, history, compliance, u, w)
        self.cg.s[:], self.cg.t[:] = mode, dual
        whole = self.law.range / self.points.maximum_of(float(np.abs(mode).max(initial=0.0)))
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
            # The next solve begins without a move along these, 0 s and 0 t, so they must be numbers.
            self.cg.s[:] = 0.0
            self.cg.t[:] = 0.0
        area = self.points.grid.cell_area
        return Outcome(
            converged, course.newton_iterations, course.cg_iterations, -course.pull * area, course.drop * area,
            course.adhesive * area, course.met_negative_curvature, course.moved, left_over, course.renewed,
        )  # fmt: skip

    def _evaluate(self, problem: _Problem, step: float) -> Sums:
        """Sums of f, r and Gamma, and the growth of the rest of Phi along s (kernels.py), per area of a point; sets
        traction, curvature and residual at u + step s."""
        contact_kernels.evaluate(
            self.height, problem.position, problem.u, problem.w, self.cg.s, self.cg.t, step, step * problem.compliance,
            problem.history, problem.compliance, self.law_numbers, self.points.offset, self.traction, self.curvature,
            self.cg.r, self._rows,
        )  # fmt: skip
        pull, imbalance, adhesive, growth = self.points.reduced(self._rows, 4)
        return pull, imbalance, adhesive, growth
