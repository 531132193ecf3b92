"""When to write a checkpoint, and when to stop for one: between steps, all ranks together.

Rank 0's clock decides about times; signals count on whatever rank they reach.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pgfmd.files.packing import arrays_of, numbers_of
from pgfmd.host.stop_signals import PATIENCE, StopSignals
from pgfmd.host.walltime import LIMIT_OF_TIME

from .checkpoints import Checkpoints, Saved
from .history import History

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.output.outputs import Outputs
    from pgfmd.solver.simulation import Simulation

OUT_OF_TIME = -1
"""In the place of the number of a signal: the limit of time is near."""
RESERVE, RESERVE_SHARE, MOST_RESERVE = 1.0, 0.03, 60.0
"""Time [s] kept free before a limit: at least the first, a share of what there was, at most the last; and what is
needed."""
STEPS_KEPT, SAVES_KEPT = 3.0, 3.0
"""So many of the longest steps, and of the longest checkpoints, must fit into the time that is left."""
STEPS_OF_PATIENCE = 4.0
"""So many of the longest steps ranks may take to hear of a signal, before one of them gives up."""
SLOW_DISK = 50e6
"""Speed [bytes/s] at which a checkpoint is supposed to be written, before one has been."""


@dataclass(frozen=True)
class Timing:
    """Time [s] between checkpoints, infinite for none but the last; limit: when (time.time()) the run has to be over,
    and whose limit that is."""

    every: float = 600.0
    limit: float = math.inf
    whose: str = ""


class Keeper:
    """Looks after a run: `attend` at the start, between steps, and when it is finished.

    Attributes:
        why: what the run has stopped for, such as "USR1"; empty as long as it goes on. out_of_time: whether that is the
            limit of time.
    """

    def __init__(
        self, comm: Intracomm, checkpoints: Checkpoints, outputs: Outputs, signals: StopSignals, timing: Timing,
        about: dict[str, Any], history: History, bytes_expected: int, say: Callable[[str], None],
    ):  # fmt: skip
        """about: what the head of every checkpoint says of the run (scene, files, versions); bytes_expected: about how
        large a checkpoint is going to be."""
        self.comm, self.checkpoints, self.outputs, self.signals = comm, checkpoints, outputs, signals
        self.timing, self.about, self.history = timing, about, history
        self.say = say if comm.rank == 0 else (lambda line: None)
        self.why, self.out_of_time = "", False
        self._began = time.time()
        self._last_save = self._last_step = time.perf_counter()
        self._longest_step, self._longest_save = 0.0, bytes_expected / SLOW_DISK
        self._phase: int | None = None

    def attend(self, simulation: Simulation) -> bool:
        """Writes a checkpoint if it is time to; returns whether to stop, which `why` then explains. Collective."""
        state = simulation.state
        if state.finished:
            # Before the last rows are written: a run that ended for want of steps may go on from here.
            self._save(simulation)
            return False
        now = time.perf_counter()
        if state.counters.steps > 0:
            self._longest_step = max(self._longest_step, now - self._last_step)
        if self.comm.size > 1:
            self.signals.patience = max(PATIENCE, STEPS_OF_PATIENCE * self._longest_step)
        stop, due = self._agree(now)
        if stop:
            self.out_of_time = stop == OUT_OF_TIME
            self.why = self._why(stop)
            self._save(simulation)
        elif due or (self._phase != state.phase and math.isfinite(self.timing.every)):
            saved = self._save(simulation)
            if due:
                self.say(
                    f"checkpoint  t {state.time:.4g} s  {state.counters.steps} steps  {saved.bytes * 1e-6:.3g} MB"
                    f" in {saved.seconds:.2g} s"
                )
        self._last_step = time.perf_counter()
        return bool(stop)

    def has_to_stop(self) -> bool:
        """Whether the run has to stop now, before a step of its own, as `why` then explains. Collective."""
        # OUT_OF_TIME is below zero, for a signal to count more.
        mine = self.signals.stop if self.signals.asked else OUT_OF_TIME if self.interrupts() else 0
        stops = self.comm.allgather(mine)
        stop = max(stops) or min(stops)
        if stop:
            self.out_of_time, self.why = stop == OUT_OF_TIME, self._why(stop)
        return bool(stop)

    def interrupts(self) -> bool:
        """Whether this rank wants a step given up that has begun. One that may end in time is waited for."""
        return self.signals.asked or (self.comm.rank == 0 and self._time_is_up(steps_kept=0.0))

    def _why(self, stop: int) -> str:
        if stop != OUT_OF_TIME:
            return StopSignals.name_of(stop)
        return f"{LIMIT_OF_TIME} ({self.timing.whose})" if self.timing.whose else LIMIT_OF_TIME

    def go_on(self, simulation: Simulation) -> None:
        """The simulation has come from a checkpoint: it needs no new one, and knows how long one takes."""
        self._phase = simulation.state.phase
        self._last_save = self._last_step = time.perf_counter()
        known = [link["checkpoint_s"] / link["checkpoints"] for link in self.history.earlier if link["checkpoints"]]
        self._longest_save = max(known, default=self._longest_save)

    def _agree(self, now: float) -> tuple[int, bool]:
        """(signal or OUT_OF_TIME or 0, whether a checkpoint is due), the same on all ranks."""
        found = np.array([self.signals.stop, self.signals.take_save(), 0], dtype=np.int64)
        if self.comm.rank == 0:
            found[1] |= now - self._last_save >= self.timing.every
            found[2] = self._time_is_up()
        if self.comm.size > 1:
            from mpi4py import MPI

            self.comm.Allreduce(MPI.IN_PLACE, found, op=MPI.MAX)
        signal, due, late = found.tolist()
        return signal or (OUT_OF_TIME if late else 0), bool(due)

    def _time_is_up(self, steps_kept: float = STEPS_KEPT) -> bool:
        if math.isinf(self.timing.limit):
            return False
        kept = max(RESERVE, min(RESERVE_SHARE * (self.timing.limit - self._began), MOST_RESERVE))
        kept += steps_kept * self._longest_step + SAVES_KEPT * self._longest_save
        return time.time() >= self.timing.limit - kept

    def _save(self, simulation: Simulation) -> Saved:
        # A signal that comes now must not end a process while it writes.
        self.signals.heard()
        state, snapshots = simulation.state, self.outputs.snapshots
        began = time.perf_counter()
        outputs = self.outputs.marks() | {"snapshots": numbers_of(snapshots.agenda)}
        links = self.history.update(state.counters.steps, simulation.scheme.transform_seconds)
        head = {**self.about, "why": self.why, "state": numbers_of(state), "outputs": outputs, "links": links}
        arrays = {f"state/{name}": array for name, array in arrays_of(state).items()}
        arrays |= {f"snapshots/{name}": array for name, array in arrays_of(snapshots.agenda).items()}
        saved = self.checkpoints.save(head, arrays)
        self._last_save = time.perf_counter()
        took = self._last_save - began
        # The first one takes the place of the guess.
        self._longest_save = max(self._longest_save, took) if self.history.now.checkpoints else took
        self._phase = state.phase
        self.history.now.checkpoints += 1
        self.history.now.checkpoint_s += took
        return saved
