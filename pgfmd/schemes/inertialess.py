"""The massless limit of the paper's model, by implicit steps in the traction (docs: model, "Time").

    u = G0 w,   w = J_inf f + sum_m J_m phi_m,   lambda_m dphi_m/dt = f - phi_m,   f = Gamma'(d(t) + z - u)

Each stage of a step (retardation.py) is a static contact problem (newton.py) with the compliance J_i G0. The start of each
solve is extrapolated from the last ends of steps; the difference between that and the solution is the error estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pgfmd import kernels
from pgfmd.drift import Drift
from pgfmd.drive import Phase
from pgfmd.extrapolation import lagrange_weights, parabola_integral
from pgfmd.newton import NewtonSolver
from pgfmd.retardation import IMPLICIT_EULER, SDIRK2, StepWeights, step_weights
from pgfmd.rheology import CreepSeries
from pgfmd.state import State

DRIFT_SHARE = 1e-2
"""Largest drift |u - G0 w| (drift.py), as a share of the tolerance, before an extrapolated u is evaluated anew as G0 w."""


LOOSEST_TOLERANCE, EVENT_TOLERANCE, JUMP_SHARPNESS = 2e-2, 2.5e-4, 1e-3
"""Largest tolerance of any solve, whatever error a step may make: the step's end has to be a state at all. Largest tolerance of solves that look for an event: the force is then good to half of the preload's own tolerance. And share
of the tolerance for jumps: just past the loss of stability the residual of the lost branch is tiny, and a loose solve
lingers on it."""
SMALLEST_SHARE = 0.03
"""The error is at least this share of the distance to the extrapolated surface. For steps much shorter than those before, a smooth
motion has a far smaller one; but a jump does not shrink with the step, and would pass for one."""
ELASTIC_PATIENCE, EQUILIBRIUM_SHARPNESS = 2, 0.25
"""Patience of CG (newton.py) and share of the tolerance for elastic scenes."""
EQUILIBRIUM_SHARE = 0.05
CURVE_SHARE = 0.25
"""Elastic scenes: the error that counts, as a share of the distance of the surface to the extrapolated one, and of the force.
The second keeps the curve smooth between the ends of steps."""


@dataclass
class Trial:
    """The outcome of a step that was tried: nothing of it is in the State yet.

    error: estimated error of u over interacting points, in ranges of adhesion. potential_drop [J]: by how much the stages'
    potentials fell from their starting points. change, force_change: of u over the
    step, like the error, and of the force, relative to the largest so far. powers [W]: of the punch, at the stages. The fields belong to the scheme and live until the next trial.
    """

    step: float
    position: float
    phase: Phase
    converged: bool
    error: float = np.inf
    force: float = 0.0
    newton_iterations: int = 0
    cg_iterations: int = 0
    potential_drop: float = 0.0
    is_jump: bool = False
    change: float = np.inf
    force_change: float = np.inf
    powers: list[float] = field(default_factory=list)
    weights: StepWeights | None = field(default=None, repr=False)


class Inertialess:
    """Steps of the massless model. `try_step` leaves the state alone; `accept` moves it on.

    solver: NewtonSolver. creep: CreepSeries. tolerance: of a step, in ranges of adhesion; the static problems are solved to the same
    tolerance, as their errors enter the error estimate with a tenth of their size. audit: whether to follow energies.
    """

    def __init__(self, solver: NewtonSolver, creep: CreepSeries, tolerance: float, audit: bool):
        self.solver, self.creep, self.tolerance, self.audit = solver, creep, tolerance, audit
        # Without retardation each step is an equilibrium of its own: one stage.
        self.tableau = SDIRK2 if creep.elements else IMPLICIT_EULER
        solver.patience = 1 if creep.elements else ELASTIC_PATIENCE
        points, stages = solver.points, self.tableau.stages
        self.points = points
        self._u = [points.zeros() for _ in range(stages)]
        self._w = [points.zeros() for _ in range(stages)]
        self._f = np.zeros((stages, points.size))
        self._history = np.zeros((stages, points.size))
        self._g = np.zeros((stages, points.size)) if audit else np.zeros((stages, 0))
        self._drift = Drift()
        self._rows = np.zeros((2, points.rows))

    @property
    def order(self) -> int:
        """Order of the method in time."""
        return self.tableau.order

    def new_state(self, position: float) -> State:
        """A state with the surface at rest, the punch at `position` [m]; call `start` before stepping."""
        points, elements = self.points, self.creep.elements
        branches = np.zeros((elements, points.size))
        images = np.zeros((elements, points.size if self.audit else 0))
        zeros = points.zeros
        return State(zeros(), zeros(), zeros(), branches, images, position, phase_start=position)

    def start(self, state: State) -> float:
        """Brings the surface into instantaneous balance with the punch at its first position; returns the force [N].

        Nothing to do, and nothing done, for a punch out of reach.
        """
        solver = self.solver
        history = self._history[0]
        history[:] = 0.0
        outcome = solver.solve(
            state.position, history, self.creep.J_inf, state.displacement, state.load, 0.1 * self.tolerance
        )
        state.counters.newton_iterations += outcome.newton_iterations
        state.counters.cg_iterations += outcome.cg_iterations
        state.traction[:] = solver.traction
        if self.audit:
            kernels.dot(state.traction, state.displacement, self.points.offset, self._rows)
            stored = 0.5 * self.points.total_of(self._rows)[0] * self.points.grid.cell_area
            state.energies.elastic = state.energies.elastic_start = stored
        return outcome.force

    def try_step(self, state: State, phase: Phase, step: float, sharp: bool = False, jump: bool = False) -> Trial:
        """Solves the stages of a step of `step` [s] from `state`. Collective.

        sharp: solve tighter, for finding events. jump: solve tighter still, and start each stage from the last one instead of extrapolating, so that the
        potential drop is that of the surface's jump.
        """
        weights = step_weights(self.creep, self.tableau, step)
        self._weigh(state.branches, weights)
        trial = Trial(step, state.position, phase, converged=True, is_jump=jump, weights=weights)
        for i, node in enumerate(self.tableau.nodes):
            history = self._history[i]
            for j in range(i):
                history += weights.stage_weight[i, j] * self._f[j]
            elapsed = state.elapsed + node * step
            trial.position = state.phase_start + phase.displacement(elapsed)
            self._predict(state, trial, i, node * step)
            outcome = self.solver.solve(
                trial.position, history, weights.compliance[i], self._u[i], self._w[i],
                self._tolerance(sharp, jump), jump,
            )  # fmt: skip
            trial.newton_iterations += outcome.newton_iterations
            trial.cg_iterations += outcome.cg_iterations
            trial.potential_drop += outcome.potential_drop
            trial.force = outcome.force
            trial.powers.append(-outcome.force * phase.velocity(elapsed))
            if not outcome.converged:
                trial.converged = False
                return trial
            self._f[i] = self.solver.traction
        trial.error = self._error(state, trial)
        return trial

    def accept(self, state: State, trial: Trial) -> None:
        """Moves fields, history and energies of the state to the end of the trial step."""
        weights = trial.weights
        start_power = -state.force * trial.phase.velocity(state.elapsed)
        state.energies.work += self._work(state, trial, start_power)
        if self.audit:
            self._advance_energies(state, weights)
        else:
            kernels.advance_branches(state.branches, weights.decay, self._f, weights.gain, self.tableau.stages)
        if trial.is_jump:
            state.energies.released += trial.potential_drop
            state.counters.jumps += 1
            state.forget_history()
        self._remember(state, trial)
        state.traction[:] = self._f[-1]
        state.position, state.force = trial.position, trial.force
        state.time += trial.step
        state.elapsed += trial.step
        state.last_step = trial.step
        state.counters.steps += 1
        state.power = start_power

    def _tolerance(self, sharp: bool, jump: bool) -> float:
        if jump:
            return JUMP_SHARPNESS * self.tolerance
        # An elastic step's only error is that of its solve.
        usual = self.tolerance if self.creep.elements else EQUILIBRIUM_SHARPNESS * self.tolerance
        return min(EVENT_TOLERANCE if sharp else LOOSEST_TOLERANCE, usual)

    def _weigh(self, branches: np.ndarray, weights: StepWeights) -> None:
        kernels.weigh_branches(branches, weights.branch_weight, self._history)

    def _predict(self, state: State, trial: Trial, stage: int, ahead: float) -> None:
        """Start of a stage's solve: through the last three known surfaces, this step's stages included."""
        nodes = self.tableau.nodes
        times = [0.0, *-np.cumsum(state.past_steps)]
        u, w = [state.displacement, *state.past_u], [state.load, *state.past_w]
        if stage:
            last = stage - 1
            times = [ahead * nodes[last] / nodes[stage], *times]
            u, w = [self._u[last], *u], [self._w[last], *w]
        else:
            self._drift = Drift(state.drift)
        c = lagrange_weights(times[: 1 if trial.is_jump else 3], ahead)
        self._combine(c, u, self._u[stage])
        self._combine(c, w, self._w[stage])
        size = abs(trial.position) / self.solver.law.range
        self._drift = self._drift.extrapolated(c, size)
        if self._drift.newest > DRIFT_SHARE * self.tolerance:
            self.solver.convolve(self._w[stage], self._u[stage])
            self._drift = self._drift.renewed(size)

    @staticmethod
    def _combine(weights: list[float], surfaces: list[np.ndarray], out: np.ndarray) -> None:
        c, a = [*weights, 0.0, 0.0], [*surfaces, surfaces[0], surfaces[0]]
        kernels.combine(c[0], a[0], c[1], a[1], c[2], a[2], out)

    def _error(self, state: State, trial: Trial) -> float:
        """Error of the step's end, of u or of the force, from its distance to the extrapolation of earlier ends of steps.

        Where fewer than three are known the distance, weighed down, is a safe guess: the steps after a kink are small.
        Without retardation every step ends in equilibrium: the distance then only tells how well the path is followed.
        """
        known = [state.displacement, *state.past_u]
        times = [0.0, *-np.cumsum(state.past_steps)]
        c = lagrange_weights(times, trial.step)
        while len(known) < 3:
            c, known = [*c, 0.0], [*known, known[0]]
        law = self.solver.law
        local = kernels.largest_difference_near(
            c[0], known[0], c[1], known[1], c[2], known[2], self._u[-1], self.solver.height, trial.position, law.range
        )
        distance, trial.change = (value / law.range for value in self.points.maxima_of(*local))
        forces = [state.force, *state.past_forces]
        extrapolated = sum(weight * force for weight, force in zip(c, forces, strict=False))
        scale = max(self.solver.force_scale, abs(trial.force), -state.pull_off_force, -state.snap_in_force)
        force_distance, trial.force_change = abs(trial.force - extrapolated) / scale, abs(trial.force - state.force) / scale
        if not self.creep.elements:
            # Without attraction the equilibrium is unique, and the path to it of no concern.
            curve = min(CURVE_SHARE * force_distance, 0.5 * trial.force_change)
            return max(EQUILIBRIUM_SHARE * distance if law.attractive else 0.0, curve)
        share = 0.25
        if len(times) == 3:
            h = trial.step
            prediction = h * (h - times[1]) * (h - times[2]) / 6.0
            own = self.tableau.error_constant * h**3
            share = max(SMALLEST_SHARE, own / (prediction + own))
        # The error is hardly more than half of the change; extrapolated rounding and solver errors can be.
        return max(min(share * distance, 0.5 * trial.change), min(share * force_distance, 0.5 * trial.force_change))

    def _work(self, state: State, trial: Trial, start_power: float) -> float:
        """Work of the punch [J] over the step: the parabola through its power at the start and at the stages.

        A single stage (elastic) takes the end of the step before as the third point. A jump takes no time worth counting.
        """
        h = trial.step
        times = [0.0, *(node * h for node in self.tableau.nodes)]
        powers = [start_power, *trial.powers]
        if self.tableau.stages == 1 and state.past_steps:
            times.append(-state.past_steps[0])
            powers.append(state.power)
        return parabola_integral(times, powers, h)

    def _remember(self, state: State, trial: Trial) -> None:
        """Shifts the history of ends of steps; the arrays of the oldest are used again for the trial's."""
        if len(state.past_u) == 2:
            old_u, old_w = state.past_u.pop(), state.past_w.pop()
            state.past_steps.pop()
            state.past_forces.pop()
        else:
            old_u, old_w = self.points.zeros(), self.points.zeros()
        if max(trial.change, trial.force_change) < self.tolerance:
            # Where hardly anything moves, extrapolation would only amplify the errors of the solves.
            state.forget_history()
        elif not trial.is_jump:
            state.past_u.insert(0, state.displacement)
            state.past_w.insert(0, state.load)
            state.past_steps.insert(0, trial.step)
            state.past_forces.insert(0, state.force)
        state.displacement, self._u[-1] = self._u[-1], old_u
        state.load, self._w[-1] = self._w[-1], old_w
        # Of the surfaces that the drift knows, newest first, the end of the step stays, and those before the step.
        before = range(self.tableau.stages, self.tableau.stages + len(state.past_u))
        state.drift = self._drift.kept([0, *before]).covariance

    def _advance_energies(self, state: State, weights: StepWeights) -> None:
        """Branches and their images phi_m, G0 phi_m, with what they store and dissipate. No transform: G0 f = (u - G0 w_hist) / J."""
        stages, area = self.tableau.stages, self.points.grid.cell_area
        self_images = self._g
        kernels.weigh_branches(state.images, weights.branch_weight, self_images)
        for i in range(stages):
            g = self_images[i]
            for j in range(i):
                g += weights.stage_weight[i, j] * self_images[j]
            np.subtract(self._u[i], g, out=g)
            g /= weights.compliance[i]
        offset = self.points.offset
        kernels.advance_branches_and_energy(
            state.branches, state.images, weights.decay, self._f, self_images, weights.gain, weights.rate_decay,
            weights.rate_gain, weights.quadrature, self.creep.J, stages, offset, self._rows,
        )  # fmt: skip
        stored, lost = self.points.total_of(self._rows)
        kernels.dot(self._f[-1], self_images[-1], offset, self._rows)
        stored += 0.5 * self.creep.J_inf * self.points.total_of(self._rows[:1])[0]
        state.energies.elastic = stored * area
        state.energies.viscous += lost * area
