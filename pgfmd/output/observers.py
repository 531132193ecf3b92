"""What watches a run: the curve, the energy audit, events, snapshots and progress. Collective where they write."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from pgfmd.files.packing import unpack
from pgfmd.files.table_writing import TableFile
from pgfmd.files.tables import CurveRow, EnergyRow, EventRow
from pgfmd.physics.drive import STEP_END
from pgfmd.solver.simulation import Observer
from pgfmd.solver.state import State

from .regular_snapshots import RegularSnapshots

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.scene import Scene
    from pgfmd.scene.output_section import Rhythm
    from pgfmd.solver.simulation import Event, Simulation


class Curve(Observer):
    """Writes a row of `curve.csv`, and of `energy.csv` where energies are followed, for each accepted step.

    A jump has a row before it and one after it, and the preload, the end of a phase and that of the run have theirs,
    whatever rows `every` leaves out.
    """

    def __init__(self, curve: TableFile, energy: TableFile | None):
        self.files: list[tuple[TableFile, Callable[[Simulation], Any]]] = [(curve, curve_row)]
        if energy:
            self.files.append((energy, energy_row))
        self.before: list = [None] * len(self.files)

    def before_step(self, simulation: Simulation) -> None:
        # What the rows are now is known after a restart as well.
        if self.files[0][0].every > 1 and simulation.state.started:
            if _at_turn_of_phase(simulation):
                self._make_up(simulation)
            self.before = [row(simulation) for _, row in self.files]

    def observe(self, simulation: Simulation, event: Event) -> None:
        if event.kind in ("start", "step", "jump"):
            for (file, row), before in zip(self.files, self.before, strict=True):
                # The first step's row is there in any case: it tells a run from one that never began.
                first = simulation.state.counters.steps == 1
                forced = first or event.kind != "step"
                file.append(row(simulation), forced, before if event.kind == "jump" else None)
        elif event.kind in ("preload", STEP_END, "end"):
            # That a step is the last of its phase, or of the run, is known only after it.
            self._make_up(simulation)

    def _make_up(self, simulation: Simulation) -> None:
        """Writes the rows of the present state where `every` has left them out."""
        for file, row in self.files:
            if file.skipped:
                file.append(row(simulation), force_write=True)


def _at_turn_of_phase(simulation: Simulation) -> bool:
    """Whether the last step ended a phase, and the next one has not moved the punch yet."""
    return simulation.state.phase > 0 and simulation.state.elapsed == 0.0


def curve_row(simulation: Simulation) -> CurveRow:
    """The row of the present state."""
    state = simulation.state
    cell = simulation.points.grid.cell_area
    # The phase that the step belongs to, not the one that comes next.
    phase = simulation.phases[state.stepped]
    return CurveRow(
        time=state.time, displacement=simulation.punch_position,
        indentation=-simulation.punch_position, force=state.force,
        contact_area=state.contact_points * cell, overlap_area=state.overlap_points * cell,
        near_area=state.near_points * cell, u_inf=state.far_displacement, step=state.last_step,
        cycle=phase.cycle, stage=phase.stage, phase=phase.name,
    )  # fmt: skip


def gaps_of(simulation: Simulation, scene: Scene) -> dict[str, float]:
    """The gaps [m] below which points of the run are in contact, and near: what record and snapshots say of it."""
    return {"contact_gap_m": simulation.scheme.law.contact_gap, "near_gap_m": scene.output.near_gap}


def energy_row(simulation: Simulation) -> EnergyRow:
    """The audit of the present state, stored energies counted from the start."""
    e = simulation.state.energies
    return EnergyRow(
        time=simulation.state.time, work=e.work, elastic=e.elastic - e.elastic_start,
        adhesive=e.adhesive - e.adhesive_start, viscous=e.viscous, released=e.released, residual=e.residual,
    )  # fmt: skip


class Watch(Protocol):
    """Who knows which contact the last jump has changed, as fields of an EventRow (patch_observer.ContactWatch)."""

    change: Any


def event_row(simulation: Simulation, event: Event) -> EventRow:
    """The row of a jump, the preload, or the end, which says how the run has ended."""
    state = simulation.state
    name = state.finished if event.kind == "end" else event.kind
    return EventRow(
        time=state.time, displacement=simulation.punch_position, force=state.force, released=event.released, event=name
    )  # fmt: skip


class Events(Observer):
    """Writes `events.csv`: jumps with the energy they release, the preload, the end.

    watch: who hears of a jump before, and knows what it has changed; or None.
    """

    def __init__(self, file: TableFile, watch: Watch | None = None):
        self.file, self.watch = file, watch

    def observe(self, simulation: Simulation, event: Event) -> None:
        if event.kind in ("jump", "preload", STEP_END, "end"):
            row = event_row(simulation, event)
            if self.watch and event.kind == "jump":
                row = replace(row, **vars(self.watch.change))
            self.file.append(row)


def _nothing() -> np.ndarray:
    return np.zeros(0)


@dataclass
class Frame:
    """A surface kept back until it is known to be wanted; `kept`: what its whole cell is made of (Surface). length [m]: of
    the machine's spring, if the surface is that seen from the machine."""

    held: bool = False
    time: float = 0.0
    position: float = 0.0
    force: float = 0.0
    length: float = 0.0
    displacement: np.ndarray = field(default_factory=_nothing)
    traction: np.ndarray = field(default_factory=_nothing)
    kept: np.ndarray = field(default_factory=_nothing)

    def take(self, state: State, surface: Surface | None, compliance: float) -> Frame:
        """Holds a copy of the present fields of the state, in the arrays of before where there are some."""
        if (self.displacement.size, self.displacement.dtype) != (
            state.surface_displacement.size,
            state.surface_displacement.dtype,
        ):
            self.displacement, self.traction = np.empty_like(state.surface_displacement), np.empty_like(state.traction)
        self.displacement[:], self.traction[:] = state.surface_displacement, state.traction
        if surface:
            kept = surface.keep(state)
            if (self.kept.size, self.kept.dtype) != (kept.size, kept.dtype):
                self.kept = np.empty_like(kept)
            self.kept[:] = kept
        self.held, self.time, self.position, self.force = True, state.time, state.position, state.force
        self.length = compliance * state.force
        return self


@dataclass(frozen=True)
class Surface:
    """How the surface of the whole cell is had: what is kept of a state, and how the surface is made of that.

    keep: gives a vector, this rank's share, good until the next step. make: gives (rows of this rank, n) [m], and the first row's index.
    Collective.
    """

    keep: Callable[[State], np.ndarray]
    make: Callable[[np.ndarray], tuple[np.ndarray, int]]


@dataclass
class Agenda:
    """What snapshots are still to come, and what a checkpoint has to know of them.

    wanted: times [s] with labels, in order; fractions: of the time t_pl from first contact to preload, whose times are
    not known yet. tension: the surface at the largest tension so far. regular: those at regular distances.
    """

    wanted: list[tuple[float, str]]
    fractions: list[float]
    tension: Frame = field(default_factory=Frame)
    regular: RegularSnapshots = field(default_factory=RegularSnapshots)


Producer = Callable[[], np.ndarray]


class SnapshotFile(Protocol):
    """Where snapshots go: into `fields.h5`, or into memory. frames: how many there are."""

    @property
    def frames(self) -> int: ...

    def append(
        self, label: str, time: float, position: float, force: float, gap: Producer, traction: Producer, displacement: Producer, /,
        surface: tuple[np.ndarray, int] | None = None,
    ) -> None:  # fmt: skip
        """Adds one, of functions that make this rank's rows (fields_file.py). Collective."""


class Snapshots(Observer):
    """Writes `fields.h5`: at wanted times, at the preload, and at the end of a step with the largest tension of the
    retraction.

    wanted: times [s] with labels; fractions: of the time t_pl from first contact to preload, above 1. surface: how
    to have the whole cell's surface, or None. follow: called with number, time [s], gap [m] and traction [Pa] of each snapshot
    written, of the whole punch.
    The largest tension is known only when it is over: the surface is kept back until then.
    """

    def __init__(
        self, file: SnapshotFile, wanted: list[tuple[float, str]], fractions: list[float], surface: Surface | None = None,
        follow: Callable[[int, float, np.ndarray, np.ndarray], None] | None = None,
    ):  # fmt: skip
        self.file, self.surface, self.follow = file, surface, follow
        self.agenda = Agenda(sorted(wanted), fractions)

    def replan(
        self, state: State, wanted: list[tuple[float, str]], fractions: list[float], rhythms: list[Rhythm]
    ) -> None:
        """Other snapshots from now on; what is over already is left out."""
        self.agenda.regular = RegularSnapshots.of(rhythms, state)
        coming = [entry for entry in wanted if _is_to_come(entry, state) or not state.started]
        self.agenda.wanted, self.agenda.fractions = sorted(coming), fractions
        if state.preload_time is not None:
            self._schedule(state)

    def recall(self, state: State, numbers: dict, read: Callable[[str, np.ndarray], None]) -> None:
        """Takes up the agenda of a checkpoint (restart/packing.py)."""
        # The arrays that are to be filled.
        self.agenda.tension = Frame().take(state, self.surface, 0.0) if numbers["tension"]["held"] else Frame()
        unpack(self.agenda, numbers, read)
        self.agenda.wanted = [(time, label) for time, label in self.agenda.wanted]

    def next_time(self, simulation: Simulation) -> float:
        single = self.agenda.wanted[0][0] if self.agenda.wanted else math.inf
        return min(single, self.agenda.regular.next_time(simulation.state))

    def observe(self, simulation: Simulation, event: Event) -> None:
        state, tension = simulation.state, self.agenda.tension
        first = event.kind == "preload" and state.preload_time == state.time
        if first:
            self._write_present(simulation, "preload")
            self._schedule(state)
        elif event.kind in ("step", "jump"):
            tense = simulation.retracting and state.force < 0.0
            if tense and (not tension.held or state.force < tension.force):
                tension.take(state, self.surface, simulation.scheme.machine_compliance)
        elif event.kind == "end" and tension.held:
            self._write(simulation, "largest tension", tension)
        if event.kind in ("step", "jump"):
            for label in self.agenda.regular.take(state):
                self._write_present(simulation, label)
        elif event.kind in ("preload", STEP_END) and not first and self.agenda.regular.step_ends:
            phase = simulation.phases[state.stepped]
            self._write_present(simulation, f"end of step {phase.stage}, cycle {phase.cycle}")
        if event.kind != "end":
            self._write_due(simulation)

    def _write_due(self, simulation: Simulation) -> None:
        """Writes what is wanted by now; twice the same time, or one that has passed, would ask for a step of no
        length."""
        state, wanted = simulation.state, self.agenda.wanted
        while wanted and not _is_to_come(wanted[0], state):
            _, label = wanted.pop(0)
            self._write_present(simulation, label)

    def _schedule(self, state: State) -> None:
        """Turns fractions of the time to the preload into times."""
        times = [(time_of(state, value), f"{value:g} t_pl") for value in self.agenda.fractions]
        self.agenda.wanted = sorted(self.agenda.wanted + [entry for entry in times if _is_to_come(entry, state)])
        self.agenda.fractions = []

    def _write_present(self, simulation: Simulation, label: str) -> None:
        state = simulation.state
        kept = self.surface.keep(state) if self.surface else _nothing()  # No copies: it is written at once.
        length = simulation.scheme.machine_compliance * state.force
        frame = Frame(
            True, state.time, state.position, state.force, length, state.surface_displacement, state.traction, kept
        )
        self._write(simulation, label, frame)

    def _write(self, simulation: Simulation, label: str, frame: Frame) -> None:
        points, height = simulation.points, simulation.scheme.height
        # The punch hangs on its spring, and so, seen from the machine, does the surface.
        length = frame.length

        def gap() -> np.ndarray:  # In double precision, whatever that of the fields.
            return points.unfold(np.float64(frame.position) + height - frame.displacement)

        def traction() -> np.ndarray:
            return points.unfold(frame.traction)

        surface = self.surface.make(frame.kept) if self.surface else None
        # One field of the whole punch at a time.
        self.file.append(
            label, frame.time, frame.position + length, frame.force, lambda: points.whole.to_rows(gap()),
            lambda: points.whole.to_rows(traction()),
            lambda: points.whole.to_rows(points.unfold(frame.displacement + length)), surface=surface,
        )  # fmt: skip
        if self.follow:
            self.follow(self.file.frames - 1, frame.time, gap(), traction())


def _is_to_come(entry: tuple[float, str], state: State) -> bool:
    """Whether a wanted time is more than rounding away."""
    return entry[0] > state.time + 1e-9 * state.last_step


def time_of(state: State, fraction: float) -> float:
    """Time [s] at a fraction of t_pl, the time from first contact to the preload; for a state past its preload."""
    first = state.first_contact_time if state.first_contact_time is not None else 0.0
    assert state.preload_time is not None, "asked for before the preload"
    return first + fraction * (state.preload_time - first)


class Progress(Observer):
    """Prints a line every few seconds: rank 0 alone, on its own clock, so that nothing waits for it."""

    def __init__(self, comm: Intracomm, say: Callable[[str], None], every: float = 5.0):
        self.silent, self.say, self.every = comm.rank != 0, say, every
        self.last = self.began = time.perf_counter()
        self.first_step: int | None = None

    def observe(self, simulation: Simulation, event: Event) -> None:
        if self.silent:
            return
        now = time.perf_counter()
        if self.first_step is None:
            # Of this process: the run may have been gone on with.
            self.first_step = max(0, simulation.state.counters.steps - 1)
        if now - self.last < self.every and event.kind not in ("preload", STEP_END, "end"):
            return
        self.last = now
        rate = (simulation.state.counters.steps - self.first_step) / max(now - self.began, 1e-9)
        self.say(progress_line(simulation, event, rate))


def progress_line(simulation: Simulation, event: Event, rate: float) -> str:
    """The present state in a line. rate: of steps per second."""
    state = simulation.state
    area = state.contact_points * simulation.points.grid.cell_area
    what = {"end": state.finished, "preload": "preload"}.get(event.kind, simulation.phases[state.stepped].name)
    if simulation.has_cycles:
        what = f"{simulation.phases[state.stepped].cycle} {what}"
    return (
        f"{what:>9}  t {state.time:.4g} s  indentation {-simulation.punch_position * 1e6:.4f} um"
        f"  force {state.force * 1e3 + 0.0:.4f} mN  contact {area * 1e6:.4f} mm^2  step {state.last_step:.2g} s"
        f"  {state.counters.steps} steps, {rate:.1f}/s"
    )
