"""Observers of a run: the curve, the energy audit, events, snapshots and progress. Writing is collective."""

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
    """Writes a row of `curve.csv`, and with the audit one of `energy.csv`, for each accepted step.

    `every` leaves out rows, but never those before and after a jump, at the preload, at the end of a phase, and at the
    end of the run.
    """

    def __init__(self, curve: TableFile, energy: TableFile | None):
        self.files: list[tuple[TableFile, Callable[[Simulation], Any]]] = [(curve, curve_row)]
        if energy:
            self.files.append((energy, energy_row))
        self.before: list = [None] * len(self.files)

    def before_step(self, simulation: Simulation) -> None:
        # The present length of the tables is also known after a restart.
        if self.files[0][0].every > 1 and simulation.state.started:
            if _at_turn_of_phase(simulation):
                self._make_up(simulation)
            self.before = [row(simulation) for _, row in self.files]

    def observe(self, simulation: Simulation, event: Event) -> None:
        if event.kind in ("start", "step", "jump"):
            for (file, row), before in zip(self.files, self.before, strict=True):
                # The row of the first step is always written. It shows that the run has begun.
                first = simulation.state.counters.steps == 1
                forced = first or event.kind != "step"
                file.append(row(simulation), forced, before if event.kind == "jump" else None)
        elif event.kind in ("preload", STEP_END, "end"):
            # Whether a step is the last of its phase, or of the run, is only known afterwards.
            self._make_up(simulation)

    def _make_up(self, simulation: Simulation) -> None:
        """Writes the rows of the present state if `every` has left them out."""
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
    """The gaps [m] below which points of the run are in contact, and near, for the record and snapshots."""
    return {"contact_gap_m": simulation.scheme.law.contact_gap, "near_gap_m": scene.output.near_gap}


def energy_row(simulation: Simulation) -> EnergyRow:
    """The audit of the present state, stored energies counted from the start."""
    e = simulation.state.energies
    return EnergyRow(
        time=simulation.state.time, work=e.work, elastic=e.elastic - e.elastic_start,
        adhesive=e.adhesive - e.adhesive_start, viscous=e.viscous, released=e.released, residual=e.residual,
    )  # fmt: skip


class Watch(Protocol):
    """Gives the contacts that the last jump changed, as fields of an EventRow (patch_observer.ContactWatch)."""

    change: Any


def event_row(simulation: Simulation, event: Event) -> EventRow:
    """The row of a jump, of the preload, or of the end with its reason."""
    state = simulation.state
    name = state.finished if event.kind == "end" else event.kind
    return EventRow(
        time=state.time, displacement=simulation.punch_position, force=state.force, released=event.released, event=name
    )  # fmt: skip


class Events(Observer):
    """Writes `events.csv`: jumps with the energy they release, the preload, the end.

    watch: gives the contacts that a jump changed, or None. It is called before this observer.
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
    """A surface that is kept in memory, because only later steps decide whether it is written. kept: the vector from
    which the surface of the whole cell is computed (Surface). length [m]: of the machine's spring, if the surface is that
    seen from the machine."""

    held: bool = False
    time: float = 0.0
    position: float = 0.0
    force: float = 0.0
    length: float = 0.0
    displacement: np.ndarray = field(default_factory=_nothing)
    traction: np.ndarray = field(default_factory=_nothing)
    kept: np.ndarray = field(default_factory=_nothing)

    def take(self, state: State, surface: Surface | None, compliance: float) -> Frame:
        """Copies the present fields of the state, into existing arrays if there are any."""
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
    """How the surface of the whole cell is computed: what is kept of a state, and how the surface follows from it.

    keep: returns a vector, this rank's share, valid until the next step. make: returns (rows of this rank, n) [m], and
    the index of the first row.
    Collective.
    """

    keep: Callable[[State], np.ndarray]
    make: Callable[[np.ndarray], tuple[np.ndarray, int]]


@dataclass
class Agenda:
    """The snapshots that are still to be taken, as a checkpoint holds them.

    wanted: times [s] with labels, in order; fractions: of the time t_pl from first contact to preload, whose times are
    not known yet. tension: the surface at the largest tension so far. regular: those at regular distances.
    """

    wanted: list[tuple[float, str]]
    fractions: list[float]
    tension: Frame = field(default_factory=Frame)
    regular: RegularSnapshots = field(default_factory=RegularSnapshots, metadata={"unknown": RegularSnapshots()})


Producer = Callable[[], np.ndarray]


class SnapshotFile(Protocol):
    """Storage of snapshots: `fields.h5`, or memory. frames: their number."""

    @property
    def frames(self) -> int: ...

    def append(
        self, label: str, time: float, position: float, force: float, gap: Producer, traction: Producer, displacement: Producer, /,
        surface: tuple[np.ndarray, int] | None = None,
    ) -> None:  # fmt: skip
        """Adds a snapshot. The functions return this rank's rows (fields_file.py). Collective."""


class Snapshots(Observer):
    """Writes `fields.h5`: at wanted times, at the preload, and at the end of a step with the largest tension of the
    retraction.

    wanted: times [s] with labels; fractions: of the time t_pl from first contact to preload, above 1. surface: how to
    compute the surface of the whole cell, or None. follow: called with number, time [s], gap [m] and traction [Pa] of
    each snapshot, for the whole punch. The largest tension is only known afterwards, so its surface is kept in memory
    until then.
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
        """Sets other snapshots from now on, without times that have passed."""
        self.agenda.regular = RegularSnapshots.of(rhythms, state)
        coming = [entry for entry in wanted if _is_to_come(entry, state) or not state.started]
        self.agenda.wanted, self.agenda.fractions = sorted(coming), fractions
        if state.preload_time is not None:
            self._schedule(state)

    def recall(self, state: State, numbers: dict, read: Callable[[str, np.ndarray], None]) -> None:
        """Restores the agenda of a checkpoint (files/packing.py)."""
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
        """Writes the snapshots that are due. Equal times, and times that have passed, are removed, because they would
        need a step of zero length."""
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
        # Relative to the machine, punch and surface are displaced by the elongation of the spring.
        length = frame.length

        def gap() -> np.ndarray:  # In double precision, also for fields in single precision.
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
    """Whether a time lies ahead by more than rounding."""
    return entry[0] > state.time + 1e-9 * state.last_step


def time_of(state: State, fraction: float) -> float:
    """Time [s] at a fraction of t_pl, the time from first contact to the preload; for a state past its preload."""
    first = state.first_contact_time if state.first_contact_time is not None else 0.0
    assert state.preload_time is not None, "asked for before the preload"
    return first + fraction * (state.preload_time - first)


class Progress(Observer):
    """Prints a line every few seconds, on rank 0 by its own clock, without communication."""

    def __init__(self, comm: Intracomm, say: Callable[[str], None], every: float = 5.0):
        self.silent, self.say, self.every = comm.rank != 0, say, every
        self.last = self.began = time.perf_counter()
        self.first_step: int | None = None

    def observe(self, simulation: Simulation, event: Event) -> None:
        if self.silent:
            return
        now = time.perf_counter()
        if self.first_step is None:
            # Steps of this process, because the run may have been continued.
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
