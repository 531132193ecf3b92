"""The loop: performs the steps of the loading programme, and notifies observers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from pgfmd.errors import RunError
from pgfmd.files.packing import arrays_of
from pgfmd.physics.drive import AREA, COMPLETED, DETACHED, FORCE, LOAD, PLACE, PRELOAD, STEP_END, TRAVEL, Drive, Phase

from .ending_search import PRELOAD_TOLERANCE, is_over, signs_at
from .finite_check import not_finite_on
from .interruption import Interrupted, Question
from .state import UNKNOWN_PHASE, State

if TYPE_CHECKING:
    from pgfmd.schemes.base import Scheme, StepController

SAME_LOAD = 1e-2
"""How far a load to follow may begin from that on the punch, as a fraction of the larger of it and the preload."""
STOPPED_PRELOAD = "preload not reached"
STOPPED_STEPS = "max_steps reached"


@dataclass(frozen=True)
class Event:
    """Something that happened at the end of a step: "start", "step", "jump", "preload", "step end" of a
    programme, "time", or "end"."""

    kind: str
    released: float = 0.0


class Observer:
    """Base class of observers of a simulation; its methods do nothing."""

    def before_step(self, simulation: Simulation) -> None:
        """Called before each step, also before the first one after a restart."""

    def next_time(self, simulation: Simulation) -> float:
        """The next time [s] at which a step has to end; infinity for none. A pure query."""
        return math.inf

    def observe(self, simulation: Simulation, event: Event) -> None:
        """Called at the start, after each step or jump, at the preload, at requested times, and at the end."""


def _goes_on_when_free(phase: Phase) -> bool:
    """Whether a phase has an end that a punch out of reach of the surface still comes to: a time, or a place."""
    if phase.ends_with == DETACHED:
        return False
    moves = any(ending.quantity in (PLACE, TRAVEL) for ending in phase.endings)
    return moves or math.isfinite(phase.duration)


class Simulation:
    """A tack test: scheme, controller, programme and state, with observers (`Observer`).

    scheme, controller: as defined in schemes.base. deepest [m]: indentation at which an approach ends without a
    preload.
    """

    def __init__(self, scheme: Scheme, controller: StepController, drive: Drive, deepest: float, max_steps: int):
        self.scheme, self.controller, self.drive = scheme, controller, drive
        self.points, self.deepest, self.max_steps = scheme.points, deepest, max_steps
        self.phases = drive.phases
        self.has_cycles = self.phases[-1].cycle > 1
        # A programme without repeats may get some when it is continued.
        self._follows_cycles = bool(drive.programme)
        self.observers: list[Observer] = []
        self.state: State = scheme.new_state(drive.clearance)

    @property
    def phase(self) -> Phase:
        """The phase of the next step."""
        return self.phases[self.state.phase]

    @property
    def retracting(self) -> bool:
        """Whether the drive moves upward at the end of the last step: in the retraction, or after the deepest point of
        the turn."""
        return self.phase.recedes(self.state.elapsed)

    @property
    def punch_position(self) -> float:
        """Displacement d of the punch [m]: the position of the drive, corrected for a machine's spring."""
        return self.scheme.place(self.state)

    def run(
        self, only_to_preload: bool = False, attend: Callable[[Simulation], bool] | None = None,
        interrupt: Callable[[], bool] | None = None,
    ) -> State:  # fmt: skip
        """Runs the programme to its end, or to the preload; returns the state, whose `finished` says how it ended.

        Continues from the present state. attend: called at the start and after each step, at the end before the
        observers are notified; the run stops, unfinished, if it returns True. interrupt: polled within steps on each
        rank; if it returns True on one of them, the step is abandoned, and `attend` is called with the previous state.
        Raises Interrupted if no step has been completed yet.
        """
        state = self.state
        earlier = state.counters.transform_pairs - self.scheme.pairs

        def is_to_stop() -> bool:
            state.counters.transform_pairs = earlier + self.scheme.pairs
            return attend is not None and attend(self)

        if state.stepped == UNKNOWN_PHASE:
            state.stepped = state.phase - (1 if state.phase and not state.elapsed else 0)
        self.scheme.control(self.phase.control)
        stopped, question = False, Question(self.points.comm, interrupt) if interrupt else None
        if not state.started:
            with self._heeding(question):
                self._start()
            stopped = is_to_stop()
        while not (stopped or state.finished or (only_to_preload and state.preload_time is not None)):
            phase = self.phase
            if not state.elapsed and state.phase and (self._is_over(phase) or self._has_nothing_to_hold(phase)):
                # The punch is there already, or out of reach of the load that it should keep.
                self._end_phase(phase)
                continue
            for observer in self.observers:
                observer.before_step(self)
            until = min((observer.next_time(self) for observer in self.observers), default=math.inf) - state.time
            released = state.energies.released
            try:
                with self._heeding(question):
                    taken, why = self.controller.advance(state, phase, until)
            except Interrupted:
                # The abandoned step must not be counted, so that a continued run has the same counters.
                earlier = state.counters.transform_pairs - self.scheme.pairs
                stopped = is_to_stop()
                continue
            except RunError:
                # If numbers are not finite, that is the reason, and not a missing equilibrium.
                self._require_finite()
                raise
            state.stepped = state.phase
            self._measure()
            self._note(Event("jump" if taken.is_jump else "step", state.energies.released - released))
            if why == "time":
                self._note(Event("time"))
            self._turn_page(phase, why)
            stopped = is_to_stop()
        if not stopped:
            self._note(Event("end"))
            state.counters.transform_pairs = earlier + self.scheme.pairs
        return state

    @contextmanager
    def _heeding(self, question: Question | None) -> Iterator[None]:
        """A context in which solves poll whether they are to be abandoned; the state is then unchanged."""
        solver = self.scheme.solver
        if question is None or solver is None:
            yield
            return
        state = self.state
        # Apart from these, trials do not change the state.
        counters = replace(state.counters)
        modes = [(mode, mode.copy()) for mode in (state.softest_mode, state.softest_mode_dual) if mode is not None]
        question.begin()
        solver.cg.poll = question
        try:
            yield
        except Interrupted:
            state.counters = counters
            for mode, before in modes:
                mode[:] = before
            raise
        finally:
            del solver.cg.poll

    def _start(self) -> None:
        self.state.started = True
        self.state.force = self.state.least_force = self.scheme.start(self.state)
        self._require_room_to_approach()
        self._measure()
        self.state.energies.adhesive_start = self.state.energies.adhesive
        self.state.energies.largest_residual = 0.0
        self._begin_phase()
        if self._follows_cycles:
            self.state.cycle.begin(self.state, 1)
        self._note(Event("start"))

    def _require_room_to_approach(self) -> None:
        """Raises RunError if the force at the first position is already above the preload, which could then not be
        met."""
        force, clearance = self.state.force, self.drive.clearance
        for ending in self.phases[0].endings:
            if ending.quantity == FORCE and ending.sign * (force - ending.value) > PRELOAD_TOLERANCE * abs(
                ending.value
            ):
                key = "until" if self.drive.programme else "drive.preload"
                raise RunError(
                    f"at the start, with the punch at drive.clearance = {clearance:.6g} m, the force is {force:.6g} N at "
                    f"once: more than {key} = {ending.value:.6g} N, at which the approach is to end. Raise "
                    f"{key}, or start higher: a larger drive.clearance, or none, to start just out of reach."
                )

    def _turn_page(self, phase: Phase, why: str) -> None:
        """Ends phases and the run."""
        state = self.state
        if why in ("duration", "ending"):
            if why == "duration" and phase.settles:
                state.unmet.append(
                    f"cycle {phase.cycle}, step {phase.stage}: given up after {state.elapsed:.3g} s, a hundred of the longest "
                    f"retardation times, in which {_told(phase) or 'the punch has not come off'} was not met"
                )
            self._end_phase(phase)
        elif (self.retracting or phase.holds_load) and state.smallest_gap >= self.scheme.law.reach:
            # After its deepest point the punch accelerates, and a surface without force decelerates, so that
            # the two don't meet again.
            state.has_detached = state.cycle.detached = True
            goes_on = not (phase.final or phase.holds_load) and _goes_on_when_free(phase)
            if phase.endings and phase.ends_with != DETACHED and not goes_on:
                state.unmet.append(f"cycle {phase.cycle}, step {phase.stage}: the punch was free before {_told(phase)}")
            if phase.final:
                state.finished = DETACHED
            elif not goes_on:
                self._end_phase(phase)
        elif phase.velocity_end < 0.0 and not phase.recedes(state.elapsed) and -self.punch_position > self.deepest:
            state.finished = STOPPED_PRELOAD
        if not state.finished and state.counters.steps >= self.max_steps:
            state.finished = STOPPED_STEPS

    def _begin_phase(self) -> None:
        """Keeps what the ends of a phase are counted from."""
        state, phase = self.state, self.phase
        wrong = abs(state.force - phase.starts_at) > SAME_LOAD * max(abs(phase.starts_at), self.drive.preload)
        if wrong:
            raise RunError(
                f"step {phase.stage} of the programme follows a load that begins at {phase.starts_at:.6g} N, but at t = "
                f"{state.time:.6g} s the punch carries {state.force:.6g} N: add a step that ends at this load before it"
            )
        state.phase_place = state.punch_displacement
        if phase.name == "turn" or not (state.phase and self.phases[state.phase - 1].name == "turn"):
            state.began_free = state.phase == 0 or state.smallest_gap >= self.scheme.law.reach
        state.phase_signs = signs_at(phase, self.scheme.values_of(state, phase))

    def _is_over(self, phase: Phase) -> bool:
        """Whether a phase that begins is over at once."""
        return is_over(phase, self.scheme.values_of(self.state, phase), self.state.phase_signs)

    def _has_nothing_to_hold(self, phase: Phase) -> bool:
        """Whether a phase that does not press the punch in has a load to keep, and the punch is free: its soft spring would
        only pull it far away."""
        pulls = phase.control == LOAD and phase.velocity_end >= 0.0
        return pulls and self.state.smallest_gap >= self.scheme.law.reach

    def _end_phase(self, phase: Phase) -> None:
        """Goes to the next phase, or ends the run."""
        state = self.state
        if phase.ends_with == PRELOAD:
            if state.preload_time is None:
                state.preload_time, state.preload, state.preload_displacement = (
                    state.time,
                    state.force,
                    state.punch_displacement,
                )
            state.cycle.preload = state.force
            self._note(Event("preload"))
        elif self.drive.programme and phase.name != "turn":
            self._note(Event(STEP_END))
        if state.phase + 1 == len(self.phases):
            state.finished = COMPLETED
            return
        state.phase += 1
        state.forget_history()
        if self.drive.programme:
            self.scheme.control(self.phase.control, state)
        state.elapsed, state.phase_start, state.step = 0.0, self.scheme.drive_at(state), 0.0
        self._begin_phase()
        if self.phase.cycle != phase.cycle:
            state.cycles.append(state.cycle.row(state))
            state.cycle.begin(state, self.phase.cycle)

    def _measure(self) -> None:
        """Computes from the fields the values of the curve and of the energy audit."""
        state, energies = self.state, self.state.energies
        self.scheme.measure(state)
        state.punch_displacement = self.punch_position
        if not math.isfinite(state.force + energies.adhesive + energies.residual + state.far_displacement):
            self._require_finite()
        if self.scheme.audit:
            energies.largest_residual = max(energies.largest_residual, abs(energies.residual))
        if state.contact_points and state.first_contact_time is None:
            state.first_contact_time = state.time
        state.largest_force = max(state.largest_force, state.force)
        phase = self.phase
        approaches, recedes = phase.velocity_end < 0.0 and phase.name != "turn", self.retracting or phase.holds_load
        if phase.name == "follow":
            # Of a path that goes both ways, the first way in of each cycle.
            approaches = not recedes and state.cycle.pull_off_force == 0.0
        # Where the punch is still held, tension on the way in is what is left of that on the way out.
        approaches = approaches and state.began_free
        if approaches and not recedes:
            state.snap_in_force = min(state.snap_in_force, state.least_force)
            state.snap_in_at_ends = min(state.snap_in_at_ends, state.force)
        elif recedes:
            state.pull_off_force = min(state.pull_off_force, state.least_force)
            state.pull_off_at_ends = min(state.pull_off_at_ends, state.force)
        if self._follows_cycles:
            state.cycle.follow(state, approaches, recedes)

    def _require_finite(self) -> None:
        """Raises RunError with array and entry if a field of the state is not finite. Collective."""
        state = self.state
        where = not_finite_on(self.points.comm, arrays_of(state))
        if where or not math.isfinite(state.force):
            raise RunError(
                f"the surface is no longer finite in step {state.counters.steps} ({self.phase.name}, t = "
                f"{state.time:.6g} s, d = {self.punch_position:.6g} m): {where or f'force = {state.force}'}. What was "
                f"written before is valid. {self.scheme.cure}"
            )

    def _note(self, event: Event) -> None:
        for observer in self.observers:
            observer.observe(self, event)


def _told(phase: Phase) -> str:
    """The values that were to end a phase, in SI units."""
    units = {FORCE: "N", AREA: "m^2"}
    return " or ".join(
        f"{ending.quantity} {ending.value:.6g} {units.get(ending.quantity, 'm')}" for ending in phase.endings
    )
