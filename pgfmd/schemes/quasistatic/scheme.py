"""Quasi-static loading: a path of equilibria, and the jumps between them (docs: model, "Quasi-static equilibria").

    u = G0 w,   w = J f,   f = Gamma'(d + z - u),   A^-1 + K > 0,   A = J G0

Each step of the machine ends in a minimum of the potential

    Phi(u) = sum u w / (2 J) + Gamma(d + z - u)        [+ F^2/(2 k_M), the machine's spring]

that is reached downhill from the last one. A step without an instability is reversible: its work is stored. In a step
with an instability, the work minus the change of stored energy is the energy released by the jump. Each minimum is
confirmed by a search for its lowest curvature (lobpcg.py). Time is only a measure of the travel of the machine.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pgfmd.errors import RunError
from pgfmd.physics.drive import AT_REST, LOAD, Phase
from pgfmd.schemes.path_following import EVENT_TOLERANCE, SINGLE_NOISE, PathFollowing, known_change
from pgfmd.solver import kernels
from pgfmd.solver.descent import Descent
from pgfmd.solver.drift import Drift
from pgfmd.solver.machine import nonzero, total
from pgfmd.solver.newton import NewtonSolver, Outcome
from pgfmd.solver.state import State
from pgfmd.solver.trial_step import Trial

from .lobpcg import SoftestMode
from .spring_work import SpringWork

SHARPNESS = 0.25
"""Tolerance of the solves, as a fraction of that of a step: they are its only source of error."""
PATIENCE = 2
"""Patience of CG (newton.py): for a relaxed surface it converges slowly, and a small update may be followed by larger
ones."""
MOST_SLIDES = 20
"""A step is abandoned after so many saddle points in the descent from one instability."""
QUIET_SLIDES = 3
"""An equilibrium is accepted as a minimum after so many consecutive saddle points no higher than the noise of a
solve."""
BENT = 1.0
"""Assumed error of the trapezoidal rule, as a multiple of the estimate by the polynomial."""
STRAIGHT = 1e-2
"""Lower bound of this error, as a fraction of half the product of the changes of force and displacement."""
LEAST_SIGN = 1e-2
"""A step that met no instability may have passed over a jump only if its error is at least this fraction of the
tolerance: the surface is then not where the extrapolation predicted."""
FAST = 4.0
"""If there is no such prediction: only if the surface moved so many times as far as the punch."""
LEAST_TENSION = 1e-2
"""Under tension, changes of the force are relative to the largest tension so far, or at least to this fraction of the
preload: a pull-off force may be much smaller than the preload."""
NOISE = 1e-13
"""Rounding error of a step's energies in double precision, relative to the energies involved."""


class Quasistatic(PathFollowing):
    """Quasi-static steps. `try_step` changes nothing in the state except the softest mode, which it only improves;
    `accept` advances the state.

    solver: NewtonSolver, whose convolution includes the machine's spring (`with_spring`). compliance: J, 1 for the relaxed
    body, E(0)/E(infinity) for the instantaneous one. tolerance: of a step, in ranges of adhesion. springs: compliance
    1/k_M [m/N] by what the machine controls, 0 for a rigid machine. contact_stiffness [N/m]: approximate stiffness of the
    contact of the whole punch. far_weights, near_gap: as in PathFollowing.
    """

    cure = "Try a smaller solver.accuracy."
    order = 1
    audit = True
    """Jumps are detected by energies, so these are always computed."""

    def __init__(
        self, solver: NewtonSolver, compliance: float, tolerance: float, far_weights: np.ndarray, near_gap: float,
        springs: Mapping[str, float], contact_stiffness: float = math.inf,
    ):  # fmt: skip
        super().__init__(solver, tolerance, (1.0,), far_weights, near_gap)
        self.compliance, self.contact_stiffness, self._springs = compliance, contact_stiffness, springs
        self._has_spring = any(springs.values())
        solver.cg.patience = PATIENCE
        # A soft spring is softer than all modes of the surface by decades. The first updates of a descent would only concern
        # the spring, and be so small that the descent would end.
        self._go_down = solver.solve if self._has_spring else Descent(solver).solve
        # Without attraction the potential is convex: the equilibrium is unique, and no search is needed.
        self.softest_mode = SoftestMode(solver, compliance) if solver.law.attractive else None
        self._none = np.zeros(self.points.size, solver.dtype)
        self._rows = np.zeros((1, self.points.rows))
        self._stored = 0.0
        self.control(next(iter(springs)))

    def control(self, control: str, state: State | None = None) -> None:
        """Prepares for phases in which the machine controls this: with its spring, the soft one of a load, or none.

        The surface of a state is that seen from the machine, which moves where the spring becomes another one.
        """
        spring, place = self._springs[control], self.place(state) if state else 0.0
        changes = state is not None and spring != self.machine_compliance
        self.machine_compliance = spring
        self.spring = SpringWork(spring, control == LOAD, self.solver.law.reach)
        if self._has_spring:
            self.solver.hold_up(spring)
            self.solver.stiffen(spring, self.compliance)
        if state is not None:
            # A punch that a load has torn off is where it was stopped, and so is the machine.
            state.position = place - spring * state.force
        if state is not None and changes:
            self.solver.convolve(state.effective_traction, state.surface_displacement)
            if state.softest_mode is not None and state.softest_mode_dual is not None:
                # A mode that is not A of its dual would take the surface away from G0 w with it.
                self.solver.rough(state.softest_mode_dual, state.softest_mode, self.compliance)
            drift = Drift(state.drift, self._rounding).renewed(self._extent(state.position))
            state.drift = np.ascontiguousarray(drift.kept([0]).factor)

    def punch_at(self, state: State, trial: Trial) -> float:
        """Displacement d of the punch [m] at the end of a trial."""
        return self.spring.end(state, trial)

    def new_state(self, position: float) -> State:
        """A state with the surface at rest, the machine at `position` [m]; call `start` before stepping."""
        points, dtype = self.points, self.solver.dtype
        u, w, f = (points.zeros(dtype) for _ in range(3))
        nothing = np.zeros((0, points.size), dtype)
        state = State(u, w, f, nothing, nothing.copy(), position, phase_start=position)
        if self.softest_mode:
            state.softest_mode, state.softest_mode_dual = (points.zeros(self.solver.rough.dtype) for _ in range(2))
        state.energies.unbalanced = state.energies.jump_variance = 0.0
        return state

    def start(self, state: State) -> float:
        """Computes the equilibrium with the punch at its first position, downhill from rest; returns the force [N].
        Raises RunError if there is none."""
        first, tolerance = Trial(0.0, state.position, AT_REST, converged=True), SHARPNESS * self.tolerance
        u, w, largest = state.surface_displacement, state.effective_traction, self.solver.force_scale
        outcome = self._solve(state.position, u, w, tolerance, True, largest)
        self._take(first, outcome)
        if first.converged and self.softest_mode:
            self._leave_saddles(state, first, (u, w), outcome, tolerance, True, False, largest)
        state.counters.take(first)
        if not first.converged:
            where = f"d = {state.position:.6g} m"
            raise RunError(f"no equilibrium found at the start ({where}). {self.advice(state, first)}")
        state.traction[:] = self.solver.traction
        force = self._force(state.effective_traction)
        state.energies.elastic = state.energies.elastic_start = self._elastic(
            state.surface_displacement, state.effective_traction, force
        )
        return force

    def try_step(self, state: State, phase: Phase, step: float, sharp: bool = False, jump: bool = False) -> Trial:
        """Solves for the equilibrium after a step of `step` [s]. Collective.

        sharp: smaller tolerance, to locate the preload. jump: follow an instability to its end; otherwise the trial
        ends there without convergence. A trial with a jump has the released energy and its uncertainty.
        """
        trial = Trial(step, state.position, phase, converged=True)
        trial.position = state.phase_start + phase.displacement(state.elapsed + step)
        self._predict(state, trial, 0, step)
        u, w = self._u[0], self._w[0]
        if self.machine_compliance and not state.past_displacements:
            self._carry(trial, state, u, w)
        tolerance = SHARPNESS * self.tolerance * min(1.0, phase.small_travel / self.law.length)
        tolerance = min(EVENT_TOLERANCE, tolerance) if sharp else tolerance
        largest = 0.0 if sharp else PathFollowing._scale(self, state, trial)
        outcome = self._solve(trial.position, u, w, tolerance, jump, largest)
        self._take(trial, outcome)
        left = outcome.met_negative_curvature
        if trial.converged and self.softest_mode:
            outcome, left = self._leave_saddles(state, trial, (u, w), outcome, tolerance, jump, left, largest)
        if not trial.converged:
            return trial
        trial.force = self._force(w)
        trial.forces.append(trial.force)
        self._stored = self._elastic(u, w, trial.force)
        trial.runaway = self.spring.dead_load and phase.may_let_go and self._is_free()
        trial.change = self._change(state, trial)
        trial.error = trial.change.elastic_error(self.law.attractive)
        gained = self._stored - state.energies.elastic + outcome.adhesive - state.energies.adhesive
        if trial.runaway:
            trial.parted = self.spring.parted(state, gained)
        plain = self.spring.work(state, trial)
        trial.potential_drop = plain - gained
        # What the spring stores is known, wherever the jump was: of the machine's way, the jump's part of the force
        # counts.
        travel, jumped = abs(self.spring.end(state, trial) - self.place(state)), abs(trial.force - state.force)
        from_path = trial.change.force_distance * self._scale(state, trial) * abs(trial.position - state.position)
        trial.uncertainty = 0.5 * min(jumped * travel, from_path)
        # Error of the trapezoidal rule; if the force happens to have no curvature, the next order matters.
        smooth = self.spring.work(state, trial, smooth=True)
        bend = abs(smooth - plain)
        bend = max(BENT * bend, STRAIGHT * trial.uncertainty)
        noise = self._noise(state, trial, tolerance)
        # A step without instability may have passed over a jump as well: a path of equilibria loses no energy.
        suspected = left or trial.error > self.tolerance or self._shows_jump(state, trial)
        lost = suspected and min(smooth, plain) - gained > bend + noise
        trial.is_jump = bool(self.softest_mode) and (lost or trial.runaway)
        return trial

    def _shows_jump(self, state: State, trial: Trial) -> bool:
        """Whether a step without instability may have passed over a jump."""
        if state.past_steps:
            return trial.error > LEAST_SIGN * self.tolerance
        return known_change(trial.change).surface * self.law.length > FAST * abs(trial.position - state.position)

    def accept(self, state: State, trial: Trial) -> None:
        """Advances fields, history and energies of the state to the end of the trial step."""
        energies = state.energies
        work = self.spring.work(state, trial, smooth=not trial.is_jump)
        energies.work += work
        state.least_force = min(state.force, trial.force)
        energies.work_of_separation += self.spring.pulled(state, trial)
        energies.elastic = self._stored
        self._doubt(state, trial)
        if trial.runaway:
            # Later there is no telling it from the state.
            state.punch_displacement = self.spring.end(state, trial)
        self._move_on(state, trial)

    def _doubt(self, state: State, trial: Trial) -> None:
        """Adds to what is uncertain about the loop. Collective.

        The traction of the law and the deformed body give the same force only in equilibrium. A solve that stops short of it
        leaves the surface behind the punch, on the way in and on the way out, which widens the loop as friction would. So
        the differences do not cancel over the path, whereas those of the places of jumps do.
        """
        energies = state.energies
        if energies.unbalanced is None or energies.jump_variance is None:
            # Of a checkpoint that lacks them: the sums would only be those of the rest.
            return
        if trial.is_jump:
            energies.jump_variance += trial.uncertainty**2
        if not trial.runaway:
            by_law = -total(self.points, self.solver.traction, self._rows) * self.points.grid.cell_area
            travel = abs(self.spring.end(state, trial) - self.place(state))
            energies.unbalanced += abs(trial.force - by_law) * travel

    def _carry(self, trial: Trial, state: State, u: np.ndarray, w: np.ndarray) -> None:
        """Moves the surface with the punch if there is no history to extrapolate from. The machine's end of a soft
        spring may travel far while punch and surface hardly move; without this, the punch would go through the surface.

        The required traction is distributed evenly over all interacting points, because under tension few or none of
        them have a negative gap.
        """
        count = self.interacting(state)
        if count == 0:
            return
        stiffness = 1.0 / (self.machine_compliance + 1.0 / self.contact_stiffness)
        area = self.points.grid.cell_area * count
        travel = trial.position - state.position
        w[np.flatnonzero(state.traction)] += self.compliance * travel * stiffness / area
        self.solver.convolve(w, u)
        # Earlier surfaces have a drift that this one no longer has, which matters for extrapolation.
        self._drift = self._drift.renewed(self._extent(trial.position))

    def _solve(
        self, position: float, u: np.ndarray, w: np.ndarray, tolerance: float, jump: bool, largest: float = 0.0
    ) -> Outcome:
        outcome = self._go_down(
            position,
            self._none,
            self.compliance,
            u,
            w,
            tolerance,
            jump,
            stop_at_instability=not jump,
            largest_force=largest,
        )
        if outcome.left_over and not self.machine_compliance:
            # Rounding stopped it before equilibrium. Newton's corrections, each of many updates, are rounded only once.
            more = self.solver.solve(
                position, self._none, self.compliance, u, w, tolerance, jump, largest_force=largest
            )
            outcome = outcome.followed_by(more)
        self._after_solve(position, outcome)
        return outcome

    def _extent(self, position: float) -> float:
        """Size of u [ranges of adhesion] with the machine at a position [m]. The tractions of single points stretch a
        soft spring more than their sum does; about the preload is assumed for this."""
        return super()._extent(position) + self.machine_compliance * self.solver.force_scale / self.law.length

    @staticmethod
    def _take(trial: Trial, outcome: Outcome) -> None:
        trial.newton_iterations += outcome.newton_iterations
        trial.cg_iterations += outcome.cg_iterations
        trial.converged, trial.left_over = outcome.converged, outcome.left_over

    def _leave_saddles(
        self, state: State, trial: Trial, surface: tuple[np.ndarray, np.ndarray], outcome: Outcome, tolerance: float, jump: bool, left: bool,
        largest: float = 0.0,
    ) -> tuple[Outcome, bool]:  # fmt: skip
        """Confirms that the equilibrium is a minimum; if it is not, optionally continues downhill along the soft mode.
        Returns the last outcome, and whether there was an instability."""
        u, w = surface
        search, mode, dual = self.softest_mode, state.softest_mode, state.softest_mode_dual
        assert search is not None and mode is not None and dual is not None, "only asked for where there is attraction"
        noise, quiet = self._noise(state, trial, tolerance), 0
        before = None if u is state.surface_displacement else (state.position, state.surface_displacement)
        for slide in range(MOST_SLIDES):
            seed = MOST_SLIDES * (state.counters.steps + 1) + slide
            curvature = search.search(mode, dual, seed, before)
            trial.cg_iterations += curvature.iterations
            if curvature.lowest >= 0.0:
                return outcome, left
            if not jump:
                left = True
                break
            dropped = self.solver.slide(trial.position, self._none, self.compliance, u, w, mode, dual)
            if dropped == 0.0:
                # Neutral to rounding: the potential is not lower on either side.
                return outcome, left
            outcome = self._solve(trial.position, u, w, tolerance, jump, largest)
            self._take(trial, outcome)
            # The curvature jumps where points leave the range of adhesion, and a saddle point may be one only in a tiny region.
            quiet = quiet + 1 if dropped < noise else 0
            left |= quiet == 0
            if not outcome.converged or quiet == QUIET_SLIDES:
                return outcome, left
        trial.converged = False
        return outcome, left

    def interacting(self, state: State) -> int:
        """Number of points of the punch within the reach of the law. Collective."""
        return nonzero(self.points, state.traction, self._rows)

    def _is_free(self) -> bool:
        """Whether no point interacts at the surface of the last solve. Collective."""
        return self.points.maximum_of(float(np.abs(self.solver.curvature).max(initial=0.0))) == 0.0

    def _force(self, effective_traction: np.ndarray) -> float:
        """Force on the punch [N] for an effective traction, consistent with the length of the spring in u and w."""
        return -total(self.points, effective_traction, self._rows) * self.points.grid.cell_area / self.compliance

    def _elastic(self, u: np.ndarray, w: np.ndarray, force: float) -> float:
        """Energy stored in the body [J]: that of u and w, minus that of the spring."""
        kernels.dot(u, w, self.points.offset, self._rows)
        stored = 0.5 * float(self.points.total_of(self._rows)[0]) * self.points.grid.cell_area / self.compliance
        return stored - 0.5 * self.machine_compliance * force**2

    def place(self, state: State) -> float:
        """Displacement d of the punch [m], at the end of its spring (spring_work.py)."""
        return self.spring.place(state)

    def _scale(self, state: State, trial: Trial) -> float:
        if max(state.force, trial.force) >= 0.0:
            return super()._scale(state, trial)
        largest = max(-trial.force, -state.force, -state.pull_off_force, -state.snap_in_force)
        return max(largest, LEAST_TENSION * self.solver.force_scale)

    def _noise(self, state: State, trial: Trial, tolerance: float) -> float:
        """Error [J] of a step's energies due to the errors of its two equilibria (squared, because they are minima), to
        rounding, and, for a soft spring with a distant end, to the drift of u from G0 w."""
        law, area = self.law, self.points.grid.cell_area
        interacting = math.pi**2 * law.work_of_adhesion * tolerance**2 * area * max(self.interacting(state), 1)
        rounding = SINGLE_NOISE if self.solver.dtype == np.float32 else NOISE
        at_stake = self._stored + law.work_of_adhesion * self.points.total * area
        at_stake += 0.5 * self.machine_compliance * trial.force**2
        noise: float = 1e-2 * interacting + rounding * at_stake
        if self.machine_compliance:
            noise += abs(trial.force) * (self._drift.newest + Drift(state.drift).newest) * law.length
        return noise
