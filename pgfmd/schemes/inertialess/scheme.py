"""The massless limit of the paper's model, by implicit steps in the traction (docs: model, "Time").

    u = G0 w,   w = J_inf f + sum_m J_m phi_m,   lambda_m dphi_m/dt = f - phi_m,   f = Gamma'(d(t) + z - u)

w is the effective traction, phi_m are the internal variables. Each stage of a step (retardation.py) is a static contact
problem (newton.py) with the compliance J_i G0. Its start is extrapolated from the last ends of steps
(path_following.py).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pgfmd.errors import RunError
from pgfmd.physics.drive import AT_REST, Phase
from pgfmd.physics.rheology import CreepSeries
from pgfmd.schemes.path_following import EVENT_TOLERANCE, PathFollowing
from pgfmd.solver import kernels
from pgfmd.solver.machine import out_of_reach
from pgfmd.solver.newton import NewtonSolver
from pgfmd.solver.state import State
from pgfmd.solver.trial_step import Trial

from . import retardation_kernels
from .audit import EnergyAudit, tension_of, work_of
from .retardation import IMPLICIT_EULER, SDIRK2, StagedTrial, step_weights

if TYPE_CHECKING:
    from pgfmd.solver.machine import Machine

LOOSEST_TOLERANCE = 2e-2
"""Largest tolerance of a solve, whatever the allowed error of the step, so that its end is close to equilibrium."""
EVENT_SHARE = 0.25
"""Tolerance of solves that locate an event, as a fraction of the usual one: the error of the force is then half of the
allowed error of the preload."""
JUMP_SHARPNESS = 1e-3
"""Tolerance of solves in a jump, as a fraction of the usual one: just after the loss of stability the residual on the
unstable branch is tiny, and a solve with a large tolerance would stay on it."""
NEARLY_ELASTIC = 0.5
"""An elastomer is nearly elastic if more than this fraction of its compliance is instantaneous."""
ELASTIC_PATIENCE = 2
"""Patience of the conjugate gradients (newton.py) for elastic and nearly elastic elastomers, and for machines softer than
the contact. Such a machine has one direction in which the surface is far softer than in all others. The first update is
along it, and small: with a patience of one, solves ended there, steps were limited by what these had left, and a sphere
with a stiff overlap took 25 times as many steps."""
ELASTIC_SHARPNESS = 0.25
"""Tolerance of the solves in elastic scenes, as a fraction of that of the step: they are the only source of error."""


class Inertialess(PathFollowing):
    """Steps of the massless model. `try_step` does not change the state; `accept` advances it.

    solver: NewtonSolver. creep: CreepSeries. tolerance: of a step, in ranges of adhesion; the static problems are
    solved to the same tolerance, as their errors enter the error estimate with a tenth of their size. audit: whether to
    compute energies. far_weights: of the far displacement (far_field.py), empty if there is none. near_gap [m]: below
    which a point is near. order: 2 or 1, of steps with retardation. machine: the spring that carries the punch, None
    for a rigid one. All fields have the precision of the solver's
    convolution.
    """

    cure = "Try a smaller solver.accuracy, or a larger adhesion.range."

    def __init__(
        self, solver: NewtonSolver, creep: CreepSeries, tolerance: float, audit: bool, far_weights: np.ndarray,
        near_gap: float, order: int = 2, machine: Machine | None = None,
    ):  # fmt: skip
        # Without retardation each step is an equilibrium of its own: one stage.
        self.tableau = SDIRK2 if creep.elements and order == 2 else IMPLICIT_EULER
        super().__init__(solver, tolerance, self.tableau.nodes, far_weights, near_gap)
        self.creep, self.audit, self.machine, self._machine = creep, audit, machine, machine
        solver.cg.patience = ELASTIC_PATIENCE if creep.J_inf > NEARLY_ELASTIC else 1
        points, stages = solver.points, self.tableau.stages
        self._f = np.zeros((stages, points.size), solver.dtype)
        self._history = np.zeros((stages, points.size), solver.dtype)
        self._audit = None
        if audit:
            error = solver.force_share * tolerance * solver.force_scale
            self._audit = EnergyAudit(points, creep, solver.law, self.tableau, tolerance, solver.dtype, error)
        if machine:
            self.control(next(iter(machine.springs)))
        self._rows = np.zeros((2, points.rows))
        self._stage_compliance = 1.0

    @property
    def order(self) -> int:
        """Order of the method in time."""
        return self.tableau.order

    def new_state(self, position: float) -> State:
        """A state with the surface at rest, the punch at `position` [m]; call `start` before stepping."""
        points, elements = self.points, self.creep.elements
        dtype = self.solver.dtype
        internal = np.zeros((elements, points.size), dtype)
        internal_displacements = np.zeros((elements, points.size if self.audit else 0), dtype)
        u, w, f = (points.zeros(dtype) for _ in range(3))
        return State(u, w, f, internal, internal_displacements, position, phase_start=position)

    def start(self, state: State) -> float:
        """Computes the instantaneous equilibrium with the punch at its first position; returns the force [N].

        Does nothing if the punch is beyond the range of adhesion. Raises RunError if there is no equilibrium.
        """
        solver = self.solver
        history, solve = self._history[0], solver.solve
        history[:] = 0.0
        if not self.creep.elements and state.position < self.law.reach and not self.machine:
            # The start is far from a relaxed surface at rest, and most of Newton's corrections would be truncated.
            from pgfmd.solver.descent import Descent

            solve = Descent(solver).solve
        surface = state.surface_displacement, state.effective_traction
        for jump in (False, True):
            # If the punch starts in contact, the equilibrium may be far from the surface at rest.
            place = self._begin(state.phase_start, surface, history, self.creep.J_inf, state.position, state.traction)
            outcome = solve(
                place, history, self.creep.J_inf, *surface, 0.1 * self.tolerance, jump, largest_force=solver.force_scale
            )
            state.position, force = self._end(state.phase_start, surface, self.creep.J_inf, place, outcome.force)
            state.counters.take(outcome)
            if outcome.converged:
                break
        else:
            first = Trial(0.0, state.position, AT_REST, converged=False, left_over=outcome.left_over)
            where = f"d = {state.position:.6g} m"
            raise RunError(f"no equilibrium found at the start ({where}). {self.advice(state, first)}")
        state.traction[:] = solver.traction
        if self.audit:
            kernels.dot(state.traction, state.surface_displacement, self.points.offset, self._rows)
            stored = 0.5 * self.points.reduced(self._rows[:1], 1)[0] * self.points.grid.cell_area
            state.energies.elastic = state.energies.elastic_start = stored
        return force

    def try_step(self, state: State, phase: Phase, step: float, sharp: bool = False, jump: bool = False) -> StagedTrial:
        """Solves the stages of a step of `step` [s] from `state`. Collective.

        sharp: smaller tolerance, to locate events. jump: even smaller tolerance, and start each stage from the last one
        instead of extrapolating, so that the decrease of the potential is that of the surface's jump.
        """
        weights = step_weights(self.creep, self.tableau, step)
        retardation_kernels.weigh_internal_variables(state.internal_variables, weights.internal_weight, self._history)
        trial = StagedTrial(step, state.position, phase, converged=True, is_jump=jump, weights=weights)
        if self.machine:
            self.machine.fallen = 0.0
        for i, (node, compliance) in enumerate(zip(self.nodes, weights.compliance.tolist(), strict=True)):
            history = self._history[i]
            elapsed = state.elapsed + node * step
            self._stage_compliance = compliance
            drive, surface = state.phase_start + phase.displacement(elapsed), (self._u[i], self._w[i])
            trial.position = trial.position if self.machine else drive
            extrapolation = self._predict(state, trial, i, node * step)
            if self.machine:
                expected = self._expected(state, trial, extrapolation)
                # Of a stage that follows a jump in this step, points interact that did not before.
                interacting = self.solver.traction if i else state.traction
                trial.position = self._begin(drive, surface, history, compliance, expected, interacting, jump)
            outcome = self.solver.solve(
                trial.position, history, compliance, *surface,
                self._tolerance(state, phase, sharp, jump), jump, largest_force=0.0 if sharp else self._scale(state, trial),
            )  # fmt: skip
            self._after_solve(trial.position, outcome)
            force = outcome.force
            if self.machine:
                trial.position, force = self._end(drive, surface, compliance, trial.position, force)
            trial.newton_iterations += outcome.newton_iterations
            trial.cg_iterations += outcome.cg_iterations
            trial.potential_drop += outcome.potential_drop
            trial.force = force
            trial.forces.append(force)
            trial.positions.append(trial.position)
            if not outcome.converged:
                trial.converged, trial.left_over = False, outcome.left_over
                return trial
            # The traction that follows from w, not from the law; the two differ by the error of the solve. Because of
            # u = G0 w, the displacements G0 phi and the stored energy belong to this traction.
            stage = self._w[i], history, compliance
            if i + 1 < self.tableau.stages:
                weight, following = float(weights.stage_weight[i + 1, i]), self._history[i + 1]
                retardation_kernels.stage_and_history(*stage, weight, self._f[i], following)
            else:
                retardation_kernels.stage_of(*stage, self._f[i])
        if self.machine and self._is_runaway(self.machine, trial):
            self._follow_flight(self.machine, state, trial, jump)
        # As many ends of steps as have an error of the step's order; elastic steps are judged by how smooth the path
        # is.
        trial.change = self._change(state, trial, self.order + 1 if self.creep.elements else 3)
        if self.creep.elements:
            trial.error = trial.change.error(self.tableau.error_constant, self.order)
        else:
            trial.error = trial.change.elastic_error(self.solver.law.attractive)
        if self._audit and self._audit.bounds_steps and not jump:
            trial.energy_error = self._audit.error(state, trial, self._u, self._f, outcome.adhesive)
        return trial

    def accept(self, state: State, trial: StagedTrial) -> None:
        """Advances fields, history and energies of the state to the end of the trial step."""
        weights = trial.weights
        spring = self.spring_compliance
        stiffness = self.machine.stiffness if self.machine else math.inf
        work = work_of(state, trial, self.tableau, spring, stiffness)
        state.energies.work += work
        state.least_force, pulled = tension_of(state, trial, self.tableau, work, spring)
        state.energies.work_of_separation += pulled
        if self._audit:
            state.energies.elastic, viscous = self._audit.energies(state, weights, self._u, self._f, keep=True)
            state.energies.viscous += viscous
        else:
            retardation_kernels.advance_internal_variables(
                state.internal_variables, weights.decay, self._f, weights.gain, self.tableau.stages
            )
        self._move_on(state, trial)

    def control(self, control: str, state: State | None = None) -> None:
        """Prepares for phases in which the machine controls this: with its spring, the soft one of a load, or none."""
        if self._machine:
            self._machine.control(control)
            self.spring_compliance = self._machine.compliance
            self.machine = self._machine if self.spring_compliance else None
            slow = self._machine.is_soft or self.creep.J_inf > NEARLY_ELASTIC
            self.solver.cg.patience = ELASTIC_PATIENCE if slow else 1
            if self._audit:
                self._audit.spring = self.spring_compliance

    def drive_at(self, state: State) -> float:
        """Position D [m] of what is driven: the punch, or the machine's end of its spring."""
        return state.position - self.spring_compliance * state.force

    def machine_share(self, state: State) -> float:
        """How many times farther what is driven goes than the punch. Collective where there is a spring."""
        if not self.machine:
            return 1.0
        return self.machine.share(self.machine.interacting(state.traction) > 0)

    def _begin(
        self,
        drive: float,
        surface: tuple[np.ndarray, np.ndarray],
        history: np.ndarray,
        compliance: float,
        expected: float,
        traction: np.ndarray,
        jump: bool = False,
    ) -> float:
        """Before a solve, with the machine at `drive` [m]: the position of the punch [m]; traction [Pa]: before it."""
        if not self.machine:
            return drive
        u, w = surface
        place, corrected = self.machine.begin(drive, u, w, history, compliance, expected, traction, jump)
        if corrected:
            self._drift = self._drift.renewed(self._extent(place))
        return place

    def _end(
        self, drive: float, surface: tuple[np.ndarray, np.ndarray], compliance: float, place: float, force: float
    ) -> tuple[float, float]:
        """After a solve with the punch at `place` [m] that ended at a force [N]: where it is now, and that force."""
        return self.machine.end(drive, *surface, compliance) if self.machine else (place, force)

    def _expected(self, state: State, trial: Trial, weights: list[float]) -> float:
        """Where the last ends of steps and stages, by their weights, place the punch [m]."""
        places = [*trial.positions[-1:], *self._places(state, trial)]
        return sum(weight * place for weight, place in zip(weights, places, strict=False))

    def _surface_of(self, w: np.ndarray, u: np.ndarray) -> None:
        (self.machine.surface_of if self.machine else self.solver.convolve)(w, u)

    def _extent(self, position: float) -> float:
        """Size of u [ranges of adhesion]. The load's rounding reaches it through the spring."""
        elongation = self.spring_compliance * self.solver.force_scale / self._stage_compliance
        return super()._extent(position) + elongation / self.law.length

    def _is_runaway(self, machine: Machine, trial: Trial) -> bool:
        """Whether a dead load has pulled the punch off in a trial. Collective."""
        return machine.dead_load and trial.phase.may_let_go and not machine.interacting(self.solver.curvature)

    def _follow_flight(self, machine: Machine, state: State, trial: Trial, jump: bool) -> None:
        """Stops a punch that a dead load has torn off just out of reach. The energy released is counted up to there; the
        soft spring that represents the load would release more."""
        trial.runaway = True
        if machine.interacting(state.traction):
            # No step is short enough for a punch to come free under a load: it jumps.
            trial.converged = jump
        clear = out_of_reach(self.points, self._u[-1], self.height, self.law.reach)
        trial.position = min(trial.position, max(clear, state.position))
        trial.potential_drop -= machine.fallen
        trial.potential_drop -= state.force * (trial.position - state.position)

    def _tolerance(self, state: State, phase: Phase, sharp: bool, jump: bool) -> float:
        if jump:
            return JUMP_SHARPNESS * self.tolerance
        share = 1.0 if self.creep.elements else ELASTIC_SHARPNESS
        if self._audit:
            share = min(share, self._audit.sharpness(state.energies))
        # Of an oscillation the error counts relative to its amplitude.
        usual = share * self.tolerance * min(1.0, phase.small_travel / self.law.length)
        return min(EVENT_TOLERANCE, EVENT_SHARE * usual) if sharp else min(LOOSEST_TOLERANCE, usual)
