"""The common part of the implicit schemes: extrapolation, error estimates and history of surfaces.

A step consists of one or more static problems (newton.py). The start of each is extrapolated from the last ends of
steps. The difference between extrapolation and solution gives the error estimate of the step.
"""

from __future__ import annotations

from itertools import accumulate

import numpy as np

from pgfmd.errors import WRITTEN_IS_VALID, RunError
from pgfmd.physics.drive import Phase
from pgfmd.solver import contact_kernels, kernels
from pgfmd.solver.drift import ROUNDING, SINGLE_ROUNDING, Drift
from pgfmd.solver.ending_search import values_of
from pgfmd.solver.extrapolation import lagrange_weights
from pgfmd.solver.newton import NewtonSolver, Outcome
from pgfmd.solver.state import State
from pgfmd.solver.trial_step import Change, Trial

EVENT_TOLERANCE = 2.5e-4
"""Largest tolerance of solves that locate an event."""
FORCE_ROUNDING = 10.0
"""Rounding error of the force, in units in the last place of the largest force so far: it is a sum with both signs."""
LARGER_PRELOAD = 10.0
"""If rounding prevents the equilibrium of forces, the advised preload is this multiple of the smallest possible one,
because rounding may be worse elsewhere on the path."""
SINGLE_NOISE = 1e-7
"""Error of a step's energies in single precision, relative to the energies involved."""
DRIFT_SHARE = 1e-2
"""Largest drift |u - G0 w| (drift.py), as a fraction of the tolerance, before u is evaluated again."""


Terms = tuple[float, np.ndarray, float, np.ndarray, float, np.ndarray]
"""Three weights, each with a surface, whose sum is meant."""


class PathFollowing:
    """Displacements u and effective tractions w of the stages of a step: extrapolation, error, history.

    solver: NewtonSolver. tolerance: of a step, in ranges of adhesion. nodes: times of the stages, in steps; the last is
    the end of the step. far_weights: of the far displacement (far_field.py), empty if there is none. near_gap [m]:
    below which a point is near. All fields have the precision of the solver's convolution.
    """

    cure: str
    """What to do about steps that no equilibrium is found for."""
    machine_compliance = 0.0
    """Compliance of the spring between machine and punch [m/N], if the surface of a state includes its elongation; zero for
    a rigid machine."""
    spring_compliance = 0.0
    """Compliance of the spring [m/N], if its elongation is that of the punch alone."""

    def __init__(
        self, solver: NewtonSolver, tolerance: float, nodes: tuple[float, ...], far_weights: np.ndarray, near_gap: float
    ):
        self.solver, self.points, self.tolerance, self.nodes = solver, solver.points, tolerance, nodes
        self.height, self.law, self.far_weights = solver.height, solver.law, far_weights
        points = solver.points
        self._u = [points.zeros(solver.dtype) for _ in nodes]
        self._w = [points.zeros(solver.dtype) for _ in nodes]
        self._rounding = ROUNDING if solver.dtype == np.float64 else SINGLE_ROUNDING
        # Error of u = G0 w due to corrections in single precision, relative to their size.
        self._rough = SINGLE_ROUNDING if solver.rough.dtype == np.float32 else 0.0
        self._drift = Drift(rounding=self._rounding)
        self._levels = self.law.contact_gap, 0.0, near_gap
        self._observed = np.zeros((6, points.rows))

    def place(self, state: State) -> float:
        """Displacement d of the punch [m]."""
        return state.position

    def drive_at(self, state: State) -> float:
        """Position D [m] of what is driven: the punch, or the machine's end of its spring."""
        return state.position

    def control(self, control: str, state: State | None = None) -> None:
        """Prepares for phases in which the machine controls this; nothing to do for a rigid machine."""

    def values_of(self, state: State, phase: Phase, trial: Trial | None = None) -> list[float]:
        """The values of the quantities that may end the phase, of the state or at the end of a trial. Collective."""
        if not phase.endings:
            return []
        if trial is None:
            return values_of(
                phase, state, state.force, state.punch_displacement, lambda: state.contact_points * self._cell
            )
        return values_of(phase, state, trial.force, self.punch_at(state, trial), lambda: self._area(trial))

    def punch_at(self, state: State, trial: Trial) -> float:
        """Displacement d of the punch [m] at the end of a trial."""
        return trial.position

    @property
    def _cell(self) -> float:
        return self.points.grid.cell_area

    def _area(self, trial: Trial) -> float:
        """Contact area [m^2] at the end of the last trial. Collective."""
        contact_kernels.observe(
            self.height, trial.position, self._u[-1], self._w[-1], self.far_weights, self.solver.law_numbers,
            self._levels, self.points.offset, self._observed,
        )  # fmt: skip
        area: float = self.points.reduced(self._observed, 5)[0] * self._cell
        return area

    def machine_share(self, state: State) -> float:
        """How many times farther what is driven goes than the punch."""
        return 1.0

    def advice(self, state: State, trial: Trial) -> str:
        """Advice for a step without an equilibrium, from its last trial."""
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
        """Raises RunError if a trial that should end the approach misses the preload by more than `slack` [N] because
        of rounding."""
        scale = self.solver.force_scale
        if abs(trial.force - scale) > slack and self._least_preload(state, trial) > scale:
            raise RunError(
                f"the preload is not found in step {state.counters.steps + 1} (t = {state.time:.6g} s, d = "
                f"{state.position:.6g} m, "
                f"force {trial.force:.3g} N). {WRITTEN_IS_VALID} {self.advice(state, trial)}"
            )

    def _least_preload(self, state: State, trial: Trial) -> float:
        """The smallest preload [N] that rounding allows, with a margin."""
        rounded = float(np.finfo(self.solver.dtype).eps) * self._scale(state, trial)
        smallest = FORCE_ROUNDING * rounded / (self.solver.force_share * EVENT_TOLERANCE)
        return LARGER_PRELOAD * max(trial.left_over * self.solver.force_scale, smallest)

    def surface_of(self, state: State) -> np.ndarray:
        """The effective traction w, from which the surface of the whole cell can be computed."""
        return state.effective_traction

    def whole_cell(self, kept: np.ndarray) -> tuple[np.ndarray, int]:
        """The surface [m] of the periodic cell for an effective traction: rows of this rank, and the index of the first
        one. Collective."""
        return self.solver.convolve.whole_cell(kept)

    @property
    def pairs(self) -> int:
        """Number of pairs of transforms so far."""
        return sum(operator.pairs for operator in self.solver.operators)

    @property
    def transform_seconds(self) -> float:
        """Time [s] that this rank has spent in transforms."""
        return sum(operator.seconds for operator in self.solver.operators)

    def measure(self, state: State) -> None:
        """Computes the values of the curve for the present surface: contact, overlap and near points, smallest gap, far
        displacement, adhesive energy. Collective."""
        solver, points = self.solver, self.points
        contact_kernels.observe(
            self.height, state.position, state.surface_displacement, state.effective_traction, self.far_weights, solver.law_numbers,
            self._levels, points.offset, self._observed,
        )  # fmt: skip
        contact, overlap, near, energy, far, closest = points.reduced(self._observed, 5)
        state.contact_points, state.overlap_points, state.near_points = int(contact), int(overlap), int(near)
        state.smallest_gap, state.far_displacement = -closest, far
        state.energies.adhesive = energy * points.grid.cell_area

    def _predict(self, state: State, trial: Trial, stage: int, ahead: float) -> list[float]:
        """Start of a stage's solve: extrapolated from the last three known surfaces, including stages of this step;
        the weights of the extrapolation, newest first."""
        nodes = self.nodes
        times = _times_of(state)
        u, w = (
            [state.surface_displacement, *state.past_displacements],
            [state.effective_traction, *state.past_effective_tractions],
        )
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
            self._surface_of(self._w[stage], self._u[stage])
            self._drift = self._drift.renewed(size)
        return c

    def _surface_of(self, w: np.ndarray, u: np.ndarray) -> None:
        """u = G0 w [m] of an effective traction w [Pa], as defined in State."""
        self.solver.convolve(w, u)

    def _extent(self, position: float) -> float:
        """Size of u [ranges of adhesion], to which its rounding error is relative, for a position [m] of the drive."""
        return abs(position) / self.law.length

    def _after_solve(self, position: float, outcome: Outcome) -> None:
        """Updates the drift after a solve at this position [m] of the drive."""
        if outcome.renewed:
            self._drift = self._drift.renewed(self._extent(position))
        self._drift = self._drift.disturbed(self._rough * outcome.moved)

    def _change(self, state: State, trial: Trial, count: int = 3) -> Change:
        """Changes of surface and force in the step, and their distances from the extrapolation of the last `count`
        ends."""
        known = [state.surface_displacement, *state.past_displacements][:count]
        times = _times_of(state)[:count]
        c = lagrange_weights(times, trial.step)
        forces = [state.force, *state.past_forces][:count]
        extrapolated = sum(weight * force for weight, force in zip(c, forces, strict=True))
        law, scale = self.solver.law, self._scale(state, trial)
        local = kernels.largest_difference_near(
            *_terms(c, known), self._u[-1], self.solver.height, trial.position, law.length
        )
        distance, moved = (value / law.length for value in self.points.maxima_of(*local))
        if self.spring_compliance:
            # A punch on a spring moves by itself.
            places = self._places(state, trial)[:count]
            there = sum(weight * place for weight, place in zip(c, places, strict=True))
            distance = max(distance, abs(trial.position - there) / law.length)
            moved = max(moved, abs(trial.position - state.position) / law.length)
        return Change(
            moved, distance, abs(trial.force - state.force) / scale, abs(trial.force - extrapolated) / scale,
            tuple(times), trial.step,
        )  # fmt: skip

    def _places(self, state: State, trial: Trial) -> list[float]:
        """Displacements of the punch [m] at the last ends of steps, newest first."""
        places = [state.position]
        for span, force in zip(accumulate(state.past_steps), state.past_forces, strict=True):
            drive = state.phase_start + trial.phase.displacement(state.elapsed - span)
            places.append(drive + self.spring_compliance * force)
        return places

    def _scale(self, state: State, trial: Trial) -> float:
        """The unit [N] of changes of the force: the largest force so far or the preload, whichever is larger."""
        return max(self.solver.force_scale, abs(trial.force), -state.pull_off_force, -state.snap_in_force)

    def _move_on(self, state: State, trial: Trial) -> None:
        """Advances the state to the end of the trial step: surface, history, displacement, time, energy released in a
        jump."""
        if trial.is_jump:
            state.energies.released += trial.potential_drop
            state.counters.jumps += 1
            state.forget_history()
        self._require_time(state, trial)
        self._remember(state, trial)
        # The next solve overwrites the old arrays of the state.
        state.traction, self.solver.traction = self.solver.traction, state.traction
        state.position, state.force = trial.position, trial.force
        state.time += trial.step
        state.elapsed += trial.step
        state.last_step = trial.step
        state.counters.steps += 1

    def _require_time(self, state: State, trial: Trial) -> None:
        """Raises RunError if neither time nor surface advance in repeated steps, because such a run would never end.

        A single such step may meet an event, and growing steps end by themselves.
        """
        longest = max(trial.step, state.last_step)
        moves = state.elapsed + longest > state.elapsed or known_change(trial.change).largest >= self.tolerance
        if moves or trial.step > state.last_step:
            return
        raise RunError(
            f"time stands still in step {state.counters.steps + 1} ({trial.phase.name}, t = {state.time:.6g} s, d = "
            f"{state.position:.6g} m): steps of {trial.step:.3g} s vanish in it. {WRITTEN_IS_VALID} "
            f"{self.advice(state, trial)}"
        )

    def _remember(self, state: State, trial: Trial) -> None:
        """Shifts the history of ends of steps; reuses the arrays of the oldest one for the next trial."""
        if len(state.past_displacements) == 2:
            old_u, old_w = state.past_displacements.pop(), state.past_effective_tractions.pop()
            state.past_steps.pop()
            state.past_forces.pop()
        else:
            old_u, old_w = (self.points.zeros(self.solver.dtype) for _ in range(2))
        if known_change(trial.change).largest < self.tolerance:
            # If hardly anything moves, extrapolation would only amplify the errors of the solves.
            state.forget_history()
        elif not trial.is_jump:
            state.past_displacements.insert(0, state.surface_displacement)
            state.past_effective_tractions.insert(0, state.effective_traction)
            state.past_steps.insert(0, trial.step)
            state.past_forces.insert(0, state.force)
        state.surface_displacement, self._u[-1] = self._u[-1], old_u
        state.effective_traction, self._w[-1] = self._w[-1], old_w
        # Of the surfaces of the drift, newest first, the end of the step and those before the step are kept.
        before = range(len(self.nodes), len(self.nodes) + len(state.past_displacements))
        # In the same memory layout as after a restart, because last bits of results depend on it.
        state.drift = np.ascontiguousarray(self._drift.kept([0, *before]).factor)


def known_change(change: Change | None) -> Change:
    """The change of a trial that has converged."""
    assert change is not None, "a trial that was not solved can't be taken"
    return change


def _times_of(state: State) -> list[float]:
    """Times [s] of the known ends of steps, newest first, relative to the last."""
    return [0.0, *(-span for span in accumulate(state.past_steps))]


def _terms(weights: list[float], surfaces: list[np.ndarray]) -> Terms:
    """Three pairs of weight and surface as arguments of kernels, padded with zeros."""
    c, a = [*weights, 0.0, 0.0], [*surfaces, surfaces[0], surfaces[0]]
    return c[0], a[0], c[1], a[1], c[2], a[2]
