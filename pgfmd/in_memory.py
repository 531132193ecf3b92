"""A run in memory: a scene is simulated without a folder, and a function may look at every step."""

from __future__ import annotations

import signal
import sys
import threading
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .assemble import assemble
from .files.tables import CurveRow
from .host.launch import communicator
from .output.observers import Snapshots, curve_row
from .output.outputs import snapshots_wanted
from .output.record import record_of, versions
from .output.recorder import STEPS, FieldsInMemory, Recorder, Rows
from .physics.heightfile import forget
from .restart.history import History
from .results.curve import Loop, Measures, measure
from .results.reading import Results, table_of
from .scene import Scene
from .solver.interruption import Interrupted
from .solver.simulation import Event, Observer, Simulation

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


class Step:
    """The present state of a simulation, as a callback of `simulate` sees it. SI units.

    kind: "start", "step", or "jump"; number: of steps so far. The arrays are made when they are first asked for, within the
    callback: afterwards the state has moved on. Collective where several ranks work together, each of which has its own rows.
    """

    def __init__(self, simulation: Simulation, kind: str):
        self._present: Simulation | None = simulation
        self.kind = kind
        self.number = simulation.state.counters.steps
        self.row: CurveRow = curve_row(simulation)
        self.stopped = False

    @property
    def _simulation(self) -> Simulation:
        if self._present is None:
            raise RuntimeError(
                f"step {self.number}: its arrays are those of a state that has moved on; take them within the function"
            )
        return self._present

    def pass_by(self) -> None:
        """The state moves on: arrays that were not asked for can't be had any more."""
        self._present = None

    @property
    def time(self) -> float:
        """Time [s] since the start of the programme."""
        return self.row.time

    @property
    def phase(self) -> str:
        """Part of the programme: "approach", "turn", "dwell", "retract", or "hold", "ramp", "oscillate", "follow"."""
        return self.row.phase

    @property
    def cycle(self) -> int:
        """Number of the repeat of the programme, from 1."""
        return self.row.cycle

    @property
    def stage(self) -> int:
        """Number of the step of the programme, from 1; a turn belongs to the step that it leads to."""
        return self.row.stage

    @property
    def displacement(self) -> float:
        """Displacement of the punch [m], negative when it is pushed in."""
        return self.row.displacement

    @property
    def force(self) -> float:
        """Force [N] on the punch, positive in compression."""
        return self.row.force

    @property
    def contact_area(self) -> float:
        """Area [m^2] of the points whose gap is below that of the largest traction."""
        return self.row.contact_area

    @cached_property
    def x(self) -> np.ndarray:
        """Places of the columns [m], from the punch's axis, (columns,)."""
        points = self._simulation.points.whole
        return points.grid.coordinate(points.block_start + np.arange(points.nb))

    @cached_property
    def y(self) -> np.ndarray:
        """Places of the rows [m], from the punch's axis, (rows,)."""
        points = self._simulation.points.whole
        return points.grid.coordinate(points.block_start + points.row_start + np.arange(points.rows))

    @cached_property
    def gap(self) -> np.ndarray:
        """Gap [m] between punch and elastomer, (rows, columns), NaN beyond the punch."""
        simulation = self._simulation
        return self._rows(
            np.float64(simulation.state.position) + simulation.scheme.height - simulation.state.surface_displacement
        )

    @cached_property
    def traction(self) -> np.ndarray:
        """Traction on the elastomer [Pa], positive where it pulls up, (rows, columns), NaN beyond the punch."""
        return self._rows(self._simulation.state.traction)

    @cached_property
    def surface(self) -> np.ndarray:
        """Displacement of the elastomer's surface [m], positive upward, (rows, columns), NaN beyond the punch."""
        simulation = self._simulation
        # Seen from the machine, the surface hangs on its spring, as the punch does.
        return self._rows(simulation.state.surface_displacement) + simulation.scheme.machine_compliance * self.force

    def _rows(self, values: np.ndarray) -> np.ndarray:
        points = self._simulation.points
        return points.whole.to_rows(points.unfold(values))

    def stop(self) -> None:
        """Ends the simulation after this step; on several ranks it is enough that one asks for it."""
        self.stopped = True


class Recording(Results):
    """What a simulation in memory has found: as `Results` of a folder, but for patches and sites.

    curve, energy, events: tables as in a folder; fields: snapshots (recorder.FieldsInMemory); run: the record; loop and
    measures: of the tack test.
    """

    patches = sites = None
    counts_overlap = False
    has_fields = True

    def __init__(self, scene: Scene, recorder: Recorder, fields: FieldsInMemory, record: dict[str, Any]):
        super().__init__(Path(scene.title or "simulation"))
        self.of, self._recorder = scene, recorder
        self.__dict__.update(fields=fields, run=record, scene=tomllib.loads(scene.to_toml()))

    def __repr__(self) -> str:
        return f"<Recording of {self.of!r}: {self.run['finished'] or 'stopped'}, {self.run['steps']} steps>"

    @cached_property
    def curve(self) -> Any:
        """A row for every step: a pandas DataFrame, or without pandas a structured array; columns as of `curve.csv`."""
        return _table(self._recorder.curve)

    @cached_property
    def energy(self) -> Any | None:
        """The energy audit, like `curve`; None if the scene asks for none."""
        return _table(self._recorder.energy) if len(self._recorder.energy) else None

    @cached_property
    def events(self) -> Any:
        """Jumps, the preload, the end, like `curve`."""
        return _table(self._recorder.events)

    @property
    def loop(self) -> Loop:
        """The tack test as a loop of force and displacement. ResultError without a step."""
        return Loop.of(self)

    @property
    def measures(self) -> Measures:
        """Pull-off force, works and areas of the loop."""
        return measure(self.loop)

    def close(self) -> None:
        """Nothing is open."""


def _table(rows: Rows) -> Any:
    return table_of(rows.columns(), rows.table)


class _StepCallback(Observer):
    """Calls a function with each step. The simulation ends when that function asks for it, or on Ctrl-C.

    asked: its entry is whether Ctrl-C has come, on this rank.
    """

    def __init__(self, simulation: Simulation, asked: list[bool], each: Callable[[Step], object] | None):
        self._points, self._asked, self._each = simulation.points, asked, each
        self.stopped = self.interrupted = False

    def observe(self, simulation: Simulation, event: Event) -> None:
        if self._each and event.kind in STEPS:
            step = Step(simulation, event.kind)
            self._each(step)
            step.pass_by()
            self.stopped = self.stopped or step.stopped

    def interrupts(self) -> bool:
        """Whether this rank wants the present step given up."""
        return self._asked[0]

    def has_to_stop(self) -> bool:
        """Whether any rank wants the simulation to end. Collective."""
        stopped, self.interrupted = (bool(most) for most in self._points.maxima_of(self.stopped, self._asked[0]))
        return stopped or self.interrupted


def _say_nothing(line: str) -> None:
    """Simulations in memory are silent."""


def simulate(
    scene: Scene | str | Path | Mapping[str, Any],
    each: Callable[[Step], object] | None = None,
    comm: Intracomm | None = None,
) -> Recording:
    """Simulates a scene in memory, writing nothing. Collective over `comm`.

    Args:
        scene: a Scene, or what one is made from.
        each: called with a `Step` at the start and after every step; `step.stop()` ends the simulation.
        comm: an mpi4py communicator; may be left out by a process that is alone.

    Ctrl-C ends the simulation between two iterations. In a notebook, or another interactive session, what was found
    until then is returned; elsewhere, and before the first step, KeyboardInterrupt is raised.

    Raises:
        SceneError: if the scene can't be; LaunchError: if several ranks were started, and no `comm` is given;
        RunError: if a step can't be solved.
    """
    scene = scene if isinstance(scene, Scene) else Scene(scene)
    comm = communicator(comm, "simulate")
    began, simulation, recorder = time.perf_counter(), assemble(scene, comm), Recorder()
    fields = FieldsInMemory(simulation.points.whole)
    history = History(comm.size, versions(), began)
    with _heeding_ctrl_c() as asked:
        callback = _StepCallback(simulation, asked, each)
        snapshots = Snapshots(fields, [], [])
        simulation.observers += [recorder, snapshots, callback]
        try:
            snapshots.replan(simulation.state, *snapshots_wanted(scene, simulation.state, comm, _say_nothing, callback))
            forget()
            simulation.run(attend=lambda _: callback.has_to_stop(), interrupt=callback.interrupts)
        except Interrupted:
            raise KeyboardInterrupt("interrupted before the first step") from None
        # It may have come after the last step, too.
        callback.has_to_stop()
    if callback.interrupted:
        _tell_of_interruption(simulation, comm)
    return Recording(scene, recorder, fields, record_of(simulation, scene, comm, history))


def _tell_of_interruption(simulation: Simulation, comm: Intracomm) -> None:
    where = f"interrupted after step {simulation.state.counters.steps}, t = {simulation.state.time:.6g} s"
    if not _is_interactive():
        raise KeyboardInterrupt(where)
    if comm.rank == 0:
        print(f"{where}; what was found until then is returned")


def _is_interactive() -> bool:
    """Whether someone types commands: a notebook, IPython, or Python's own prompt."""
    return hasattr(sys, "ps1") or "ipykernel" in sys.modules


@contextmanager
def _heeding_ctrl_c() -> Iterator[list[bool]]:
    """Within this, a first Ctrl-C is noted in the list's entry; a second one raises KeyboardInterrupt at once."""
    asked = [False]
    if threading.current_thread() is not threading.main_thread():
        # Signals are the main thread's.
        yield asked
        return

    def note(number: int, frame: Any) -> None:
        asked[0] = True
        signal.signal(signal.SIGINT, signal.default_int_handler)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield asked
    finally:
        signal.signal(signal.SIGINT, before)
