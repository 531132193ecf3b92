"""Infinitely slow loading: a path of equilibria, and the jumps between them (docs: model, "Without time").

    u = G0 w,   w = J f,   f = Gamma'(d + z - u),   A^-1 + K > 0,   A = J G0

Each load step ends in a minimum of the potential

    Phi(u) = sum u w / (2 J) + Gamma(d + z - u)        [+ F^2/(2 k_M), the machine's spring]

that is reached downhill from the last one. A step that meets no instability is reversible: its work is stored. What is
left of the work of a step that met one is the energy that the jump has released. Each minimum is confirmed by a search
for its lowest curvature (soft_mode.py). Time only counts how far the machine has gone.
"""

from __future__ import annotations

import math

import numpy as np

from pgfmd import kernels
from pgfmd.drive import Phase
from pgfmd.machine import SprungConvolution, total
from pgfmd.newton import NewtonSolver, Outcome
from pgfmd.schemes.path_following import PathFollowing
from pgfmd.schemes.trial import Trial
from pgfmd.soft_mode import SoftMode
from pgfmd.state import State

SHARPNESS = 0.25
"""Share of the tolerance to which equilibria are solved: a step's only error is its solve's."""
EVENT_TOLERANCE = 2.5e-4
"""Largest tolerance of solves close to the preload."""
PATIENCE = 2
"""Of CG (newton.py): for a relaxed surface it is slow, and one small move may be followed by larger ones."""
MOST_SLIDES = 20
"""Saddles on the way down from one instability at which a step is given up."""
BENT, STRAIGHT = 4.0, 1e-2
"""Error of the trapezoid that is reckoned with: this multiple of what the parabola makes of it, and at least this share
of half of the changes of force and place."""
FREE = 1e-9
"""A punch out of reach whose force is below this share of the preload hangs on its spring alone."""
NEAREST_PAST = 0.2
"""The work of a step takes the last step's start in, unless that was shorter than this share of the step: too close to
tell how the force bends."""


class Quasistatic(PathFollowing):
    """Load steps without time. `try_step` leaves the state alone; `accept` moves it on.

    solver: NewtonSolver, its convolution that of the machine's spring too where there is one (`sprung`). compliance: J,
    of the relaxed body 1, of the instantaneous one E(0)/E(infinity). tolerance: of a step, in ranges of adhesion.
    spring [m/N]: 1/k_M, 0 for a rigid machine. contact_stiffness [N/m]: of the contact of the whole punch, about.
    dead_load: whether the spring stands for one.
    """

    cure = "Try a smaller solver.accuracy."
    order = 1
    audit = True
    """Energies decide about jumps, so they are always followed."""

    def __init__(
        self, solver: NewtonSolver, compliance: float, tolerance: float, far_weights: np.ndarray, spring: float = 0.0,
        contact_stiffness: float = math.inf, dead_load: bool = False,
    ):  # fmt: skip
        super().__init__(solver, tolerance, (1.0,), far_weights)
        self.compliance, self.machine_compliance, self.contact_stiffness = compliance, spring, contact_stiffness
        self.dead_load = dead_load
        solver.patience = PATIENCE
        # Without attraction the potential is convex: there is one equilibrium, and nothing to search.
        self.soft_mode = SoftMode(solver, compliance) if solver.law.attractive else None
        self._none = np.zeros(self.points.size, solver.dtype)
        self._rows = np.zeros((1, self.points.rows))
        self._stored = 0.0

    def new_state(self, position: float) -> State:
        """A state with the surface at rest, the machine at `position` [m]; call `start` before stepping."""
        points, dtype = self.points, self.solver.dtype
        u, w, f = (points.zeros(dtype) for _ in range(3))
        nothing = np.zeros((0, points.size), dtype)
        state = State(u, w, f, nothing, nothing.copy(), position, phase_start=position)
        if self.soft_mode:
            state.soft_mode, state.soft_load = (points.zeros(self.solver.rough.dtype) for _ in range(2))
        return state

    def start(self, state: State) -> float:
        """Brings the surface into balance with the punch at its first position, downhill from rest; returns the force
        [N]."""
        outcome = self._solve(state.position, state.displacement, state.load, 0.1 * self.tolerance, jump=True)
        state.counters.newton_iterations += outcome.newton_iterations
        state.counters.cg_iterations += outcome.cg_iterations
        state.traction[:] = self.solver.traction
        force = self._force(state.load)
        state.energies.elastic = state.energies.elastic_start = self._elastic(state.displacement, state.load, force)
        return force

    def try_step(self, state: State, phase: Phase, step: float, sharp: bool = False, jump: bool = False) -> Trial:
        """Solves for the equilibrium after a step of `step` [s]. Collective.

        sharp: solve tighter, for finding the preload. jump: follow an instability to its end; otherwise the trial is
        given up, unconverged, where it meets one. A trial that jumped says how much energy that has released, and how
        well that is known.
        """
        trial = Trial(step, state.position, phase, converged=True)
        trial.position = state.phase_start + phase.displacement(state.elapsed + step)
        self._predict(state, trial, 0, step)
        u, w = self._u[0], self._w[0]
        if self.machine_compliance and not state.past_u and state.contact_points:
            self._carry(trial.position - state.position, state, u, w)
        tolerance = SHARPNESS * self.tolerance
        tolerance = min(EVENT_TOLERANCE, tolerance) if sharp else tolerance
        outcome = self._solve(trial.position, u, w, tolerance, jump)
        self._take(trial, outcome)
        left = outcome.met_negative_curvature
        if trial.converged and self.soft_mode:
            outcome, left = self._leave_saddles(state, trial, outcome, tolerance, jump, left)
        if not trial.converged:
            return trial
        trial.force = self._force(w)
        trial.forces.append(trial.force)
        self._stored = self._elastic(u, w, trial.force)
        trial.change = self._change(state, trial)
        trial.error = trial.change.elastic_error(self.law.attractive)
        gained = self._stored - state.energies.elastic + outcome.adhesive - state.energies.adhesive
        plain = self._work(state, trial, bent=False)
        trial.potential_drop = plain - gained
        trial.uncertainty = 0.5 * abs(trial.force - state.force) * abs(self.place(trial) - self.place(state))
        # How far the trapezoid is off; where the force happens not to bend, the next order counts.
        bend = abs(self._work(state, trial, bent=True) - plain)
        bend = max(BENT * bend, STRAIGHT * trial.uncertainty)
        noise = self._noise(state, trial, tolerance)
        # A step that met nothing may have passed over a jump as well: a path of equilibria loses no energy.
        told = left or trial.error > self.tolerance or bool(state.past_steps)
        trial.is_jump = bool(self.soft_mode) and told and trial.potential_drop > bend + noise
        return trial

    def accept(self, state: State, trial: Trial) -> None:
        """Moves fields, history and energies of the state to the end of the trial step."""
        energies = state.energies
        work = self._work(state, trial, bent=not trial.is_jump)
        energies.work += work
        state.least_force = min(state.force, trial.force)
        energies.work_of_separation += self._pulled(state, trial)
        energies.elastic = self._stored
        self._move_on(state, trial)

    def _carry(self, way: float, state: State, u: np.ndarray, w: np.ndarray) -> None:
        """Carries the surface with the punch where nothing is known yet of how it moves: a soft spring's end may go a
        long way [m] while punch and surface hardly move, and without this it went through the surface.

        The load that this takes is spread evenly over the contact.
        """
        touching = np.flatnonzero(state.position + self.height - state.displacement < 0.0)
        stiffness = 1.0 / (self.machine_compliance + 1.0 / self.contact_stiffness)
        area = self.points.grid.cell_area * state.contact_points
        w[touching] += self.compliance * way * stiffness / area
        self.solver.convolve(w, u)

    def _solve(self, position: float, u: np.ndarray, w: np.ndarray, tolerance: float, jump: bool) -> Outcome:
        outcome = self.solver.solve(position, self._none, self.compliance, u, w, tolerance, jump, timid=not jump)
        self._drift = self._drift.disturbed(self._rough * outcome.moved)
        return outcome

    @staticmethod
    def _take(trial: Trial, outcome: Outcome) -> None:
        trial.newton_iterations += outcome.newton_iterations
        trial.cg_iterations += outcome.cg_iterations
        trial.converged = outcome.converged

    def _leave_saddles(self, state: State, trial: Trial, outcome: Outcome, tolerance: float, jump: bool, left: bool):
        """Confirms that the equilibrium is a minimum; goes on downhill along the soft mode where it is not, if that is
        wanted. Returns the last outcome, and whether an instability was met."""
        u, w = self._u[0], self._w[0]
        for slide in range(MOST_SLIDES):
            seed = MOST_SLIDES * (state.counters.steps + 1) + slide
            curvature = self.soft_mode.search(state.soft_mode, state.soft_load, seed)
            trial.cg_iterations += curvature.iterations
            if curvature.lowest >= 0.0:
                return outcome, left
            if not jump:
                left = True
                break
            dropped = self.solver.slide(
                trial.position, self._none, self.compliance, u, w, state.soft_mode, state.soft_load
            )
            if dropped == 0.0:
                # Indifferent, to rounding: no lower place either way.
                return outcome, left
            left = True
            outcome = self._solve(trial.position, u, w, tolerance, jump)
            self._take(trial, outcome)
            if not outcome.converged:
                return outcome, left
        trial.converged = False
        return outcome, left

    def _force(self, load: np.ndarray) -> float:
        """Force on the punch [N] that the load asks for: with it, the spring's length is that of u and w."""
        return -total(self.points, load, self._rows) * self.points.grid.cell_area / self.compliance

    def _elastic(self, u: np.ndarray, w: np.ndarray, force: float) -> float:
        """Energy stored in the body [J]: what u and w store, less the spring's part."""
        kernels.dot(u, w, self.points.offset, self._rows)
        stored = 0.5 * float(self.points.total_of(self._rows)[0]) * self.points.grid.cell_area / self.compliance
        return stored - 0.5 * self.machine_compliance * force**2

    def place(self, where: State | Trial) -> float:
        """Position d of the punch [m], at the end of its spring. A punch that a dead load flings away is followed until
        it is out of reach: there is no end to its way."""
        place = where.position + self.machine_compliance * where.force
        return self.law.reach if self._is_flung(where, place) else place

    def _is_flung(self, where: State | Trial, place: float) -> bool:
        return self.dead_load and place > self.law.reach and abs(where.force) < FREE * self.solver.force_scale

    def _work(self, state: State, trial: Trial, bent: bool) -> float:
        """Work of the punch [J] over the step: by the trapezoid, or by the parabola through the last step's start too.

        In a jump the machine stands still, and the spring works on the punch: that is the trapezoid as well.
        """
        start, end = self.place(state), self.place(trial)
        last_force = trial.force
        if self.dead_load and end == self.law.reach:
            # The load is still there.
            last_force = min(trial.force, state.force + (end - start) / self.machine_compliance)
        work = -0.5 * (state.force + last_force) * (end - start)
        if not bent or not state.past_steps or end == start:
            return work
        past_position = state.phase_start + trial.phase.displacement(state.elapsed - state.past_steps[0])
        past_force = state.past_forces[0]
        past = past_position + self.machine_compliance * past_force
        if abs(start - past) < NEAREST_PAST * abs(end - start):
            return work
        slope, before = (trial.force - state.force) / (end - start), (state.force - past_force) / (start - past)
        return work + (slope - before) / (end - past) * (end - start) ** 3 / 6.0

    def _pulled(self, state: State, trial: Trial) -> float:
        """Work [J] of a retracting punch where it pulls, the force being linear within the step."""
        first, last = -state.force, -trial.force
        if trial.phase.velocity_end <= 0.0 or max(first, last) <= 0.0:
            return 0.0
        share = 1.0 if min(first, last) >= 0.0 else max(first, last) / abs(last - first)
        return 0.5 * share * (max(first, 0.0) + max(last, 0.0)) * (self.place(trial) - self.place(state))

    def _noise(self, state: State, trial: Trial, tolerance: float) -> float:
        """How far a step's energies may be off for the errors of its two equilibria [J]: they are minima, so these enter
        squared; and by rounding."""
        law, area = self.law, self.points.grid.cell_area
        interacting = math.pi**2 * law.work_of_adhesion * tolerance**2 * area * max(state.contact_points, 1)
        return 1e-2 * interacting + 1e-13 * (self._stored + law.work_of_adhesion * self.points.total * area)


def sprung(convolve, spring: float, compliance: float):
    """The convolution with the machine's spring in it; as it is where the machine is rigid."""
    return SprungConvolution(convolve, spring, compliance) if spring else convolve
