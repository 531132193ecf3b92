"""What schemes share that go from one solved surface to the next: where each solve starts, and how far it went.

A step ends with one or more static problems (newton.py). The start of each is extrapolated from the last ends of steps;
the difference between that and the solution is what the step's error is made of.
"""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from pgfmd.errors import WRITTEN_IS_VALID, RunError
from pgfmd.solver import contact_kernels, kernels
from pgfmd.solver.drift import ROUNDING, SINGLE_ROUNDING, Drift
from pgfmd.solver.extrapolation import lagrange_weights
from pgfmd.solver.newton import NewtonSolver, Outcome
from pgfmd.solver.state import State
from pgfmd.solver.trial import Change, Trial

EVENT_TOLERANCE = 2.5e-4
"""Largest tolerance of solves that look for an event."""
FORCE_ROUNDING = 10.0
"""Rounding of the force, in units in the last place of the largest force so far: it is a sum of pulls and pushes."""
LARGER_PRELOAD = 10.0
"""Where rounding spoils the balance of forces, the preload that is asked for is so many times the one that would just
do: elsewhere on the path rounding may be worse."""
SINGLE_NOISE = 1e-7
"""Error of a step's energies in single precision, as a share of those at stake."""
DRIFT_SHARE = 1e-2
"""Largest drift |u - G0 w| (drift.py), as a share of the tolerance, before an extrapolated u is evaluated anew."""


class PathFollowing:
    """Surfaces u and loads w of the stages of a step, extrapolated, compared and remembered.

    solver: NewtonSolver. tolerance: of a step, in ranges of adhesion. nodes: times of the stages, in steps; the last is
    the step's end. far_weights: of the far displacement (far_field.py), empty where there is none. near_gap [m]: below
    which a point is near. All fields have the precision of the solver's convolution.
    """

    machine_compliance = 0.0
    """Of the spring between the machine and the punch [m/N]; zero where the punch itself is driven."""

    def __init__(
        self, solver: NewtonSolver, tolerance: float, nodes: tuple[float, ...], far_weights: np.ndarray, near_gap: float
    ):
        self.solver, self.points, self.tolerance, self.nodes = solver, solver.points, tolerance, nodes
        self.height, self.law, self.far_weights = solver.height, solver.law, far_weights
        points = solver.points
        self._u = [points.zeros(solver.dtype) for _ in nodes]
        self._w = [points.zeros(solver.dtype) for _ in nodes]
        self._rounding = ROUNDING if solver.dtype == np.float64 else SINGLE_ROUNDING
        # By how much corrections in single precision let u and w part, relative to the way they go.
        self._rough = SINGLE_ROUNDING if solver.rough.dtype == np.float32 else 0.0
        self._drift = Drift(rounding=self._rounding)
        self._levels = self.law.contact_gap, 0.0, near_gap
        self._observed = np.zeros((6, points.rows))

    def place(self, state: State) -> float:
        """Position d of the punch [m]."""
        return state.position

    def advice(self, state: State, trial: Trial) -> str:
        """What to do about a step that no equilibrium is found for, by its last trial."""
        scale, least = self.solver.force_scale, self._least_preload(state, trial)
        if trial.left_over == 0.0 and least <= scale:
            return self.cure
        single = self.solver.dtype == np.float32
        return (
            f"In {'single' if single else 'double'} precision the forces on the surface can't be balanced as well as "
            f"so small a preload, {scale:.3g} N, asks for. "
            + ('Set solver.precision = "mixed".' if single else f'Raise drive.preload to "{least:.2g} N" or more.')
        )

    def require_preload(self, state: State, trial: Trial, slack: float) -> None:
        """RunError where a trial that is to end the approach misses the preload by more than `slack` [N], and rounding
        allows no better."""
        scale = self.solver.force_scale
        if abs(trial.force - scale) > slack and self._least_preload(state, trial) > scale:
            raise RunError(
                f"the preload is not found in step {state.counters.steps + 1} (t = {state.time:.6g} s, d = "
                f"{state.position:.6g} m, "
                f"force {trial.force:.3g} N). {WRITTEN_IS_VALID} {self.advice(state, trial)}"
            )

    def _least_preload(self, state: State, trial: Trial) -> float:
        """The preload [N] that rounding allows to find, with some room."""
        rounded = float(np.finfo(self.solver.dtype).eps) * self._scale(state, trial)
        smallest = FORCE_ROUNDING * rounded / (self.solver.force_share * EVENT_TOLERANCE)
        return LARGER_PRELOAD * max(trial.left_over * self.solver.force_scale, smallest)

    def surface_of(self, state: State) -> np.ndarray:
        """The load w, of which the surface of the whole cell is made."""
        return state.load

    def whole_cell(self, kept: np.ndarray) -> tuple[np.ndarray, int]:
        """The surface [m] of the periodic cell under a load: rows of this rank, and the first one's index. Collective."""
        return self.solver.convolve.whole_cell(kept)

    @property
    def pairs(self) -> int:
        """Pairs of transforms so far."""
        return sum(operator.pairs for operator in self.solver.operators)

    @property
    def transform_seconds(self) -> float:
        """Time [s] that this rank has spent in transforms."""
        return sum(operator.seconds for operator in self.solver.operators)

    def measure(self, state: State) -> None:
        """What the curve holds of the present surface: contact, overlap, near points, smallest gap, far displacement,
        adhesive energy. Collective."""
        solver, points = self.solver, self.points
        contact_kernels.observe(
            self.height, state.position, state.displacement, state.load, self.far_weights, solver.law_numbers,
            self._levels, points.offset, self._observed,
        )  # fmt: skip
        contact, overlap, near, energy, far, closest = points.reduced(self._observed, 5)
        state.contact_points, state.overlap_points, state.near_points = int(contact), int(overlap), int(near)
        state.smallest_gap, state.far_displacement = -closest, far
        state.energies.adhesive = energy * points.grid.cell_area

    def _predict(self, state: State, trial: Trial, stage: int, ahead: float) -> None:
        """Start of a stage's solve: through the last three known surfaces, this step's stages included."""
        nodes = self.nodes
        times = _times_of(state)
        u, w = [state.displacement, *state.past_u], [state.load, *state.past_w]
        if stage:
            last = stage - 1
            times = [ahead * nodes[last] / nodes[stage], *times]
            u, w = [self._u[last], *u], [self._w[last], *w]
        else:
            self._drift = Drift(state.drift, self._rounding)
        c = lagrange_weights(times[: 1 if trial.is_jump else 3], ahead)
        kernels.combine(*_terms(c, u), self._u[stage])
        kernels.combine(*_terms(c, w), self._w[stage])
        size = self._extent(trial.position)
        self._drift = self._drift.extrapolated(c, size)
        if self._drift.newest > DRIFT_SHARE * self.tolerance:
            self.solver.convolve(self._w[stage], self._u[stage])
            self._drift = self._drift.renewed(size)

    def _extent(self, position: float) -> float:
        """Size of u [ranges of adhesion], of which its rounding is a share, with the punch's end at a position [m]."""
        return abs(position) / self.law.range

    def _after_solve(self, position: float, outcome: Outcome) -> None:
        """Keeps the drift up with a solve that ended at this position [m] of the punch's end."""
        if outcome.renewed:
            self._drift = self._drift.renewed(self._extent(position))
        self._drift = self._drift.disturbed(self._rough * outcome.moved)

    def _change(self, state: State, trial: Trial, count: int = 3) -> Change:
        """How far the step has moved surface and force, and how far from where the last `count` ends of steps point."""
        known = [state.displacement, *state.past_u][:count]
        times = _times_of(state)[:count]
        c = lagrange_weights(times, trial.step)
        forces = [state.force, *state.past_forces][:count]
        extrapolated = sum(weight * force for weight, force in zip(c, forces, strict=True))
        law, scale = self.solver.law, self._scale(state, trial)
        local = kernels.largest_difference_near(
            *_terms(c, known), self._u[-1], self.solver.height, trial.position, law.range
        )
        distance, moved = (value / law.range for value in self.points.maxima_of(*local))
        return Change(
            moved, distance, abs(trial.force - state.force) / scale, abs(trial.force - extrapolated) / scale,
            tuple(times), trial.step,
        )  # fmt: skip

    def _scale(self, state: State, trial: Trial) -> float:
        """What changes of the force [N] are measured by: the largest so far, at least the preload."""
        return max(self.solver.force_scale, abs(trial.force), -state.pull_off_force, -state.snap_in_force)

    def _move_on(self, state: State, trial: Trial) -> None:
        """Takes the state to the end of the trial step: surface and history, place and time, what a jump released."""
        if trial.is_jump:
            state.energies.released += trial.potential_drop
            state.counters.jumps += 1
            state.forget_history()
        self._require_time(state, trial)
        self._remember(state, trial)
        # The next solve writes over what was the state's.
        state.traction, self.solver.traction = self.solver.traction, state.traction
        state.position, state.force = trial.position, trial.force
        state.time += trial.step
        state.elapsed += trial.step
        state.last_step = trial.step
        state.counters.steps += 1

    def _require_time(self, state: State, trial: Trial) -> None:
        """RunError where in step after step neither time nor the surface moves on: such a run would never end.

        One such step may meet an event, and those that grow come to an end.
        """
        longest = max(trial.step, state.last_step)
        moves = state.elapsed + longest > state.elapsed or trial.change.largest >= self.tolerance
        if moves or trial.step > state.last_step:
            return
        raise RunError(
            f"time stands still in step {state.counters.steps + 1} ({trial.phase.name}, t = {state.time:.6g} s, d = "
            f"{state.position:.6g} m): steps of {trial.step:.3g} s vanish in it. {WRITTEN_IS_VALID} "
            f"{self.advice(state, trial)}"
        )

    def _remember(self, state: State, trial: Trial) -> None:
        """Shifts the history of ends of steps; the arrays of the oldest are used again for the trial's."""
        if len(state.past_u) == 2:
            old_u, old_w = state.past_u.pop(), state.past_w.pop()
            state.past_steps.pop()
            state.past_forces.pop()
        else:
            old_u, old_w = (self.points.zeros(self.solver.dtype) for _ in range(2))
        if trial.change.largest < self.tolerance:
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
        before = range(len(self.nodes), len(self.nodes) + len(state.past_u))
        # In one order of memory, as after a restart: the last bits of what is made of it depend on that.
        state.drift = np.ascontiguousarray(self._drift.kept([0, *before]).factor)


def _times_of(state: State) -> list[float]:
    """Times [s] of the known ends of steps, newest first, counted from the last."""
    return [0.0, *(-span for span in accumulate(state.past_steps))]


def _terms(weights: list[float], surfaces: list[np.ndarray]) -> tuple:
    """Weight, surface, weight, surface, weight, surface: what kernels take as a sum, with zeros where there are
    fewer."""
    c, a = [*weights, 0.0, 0.0], [*surfaces, surfaces[0], surfaces[0]]
    return c[0], a[0], c[1], a[1], c[2], a[2]
