"""When to write a checkpoint, and when to stop with one: decided between steps by all ranks together.

Times are those of rank 0's clock. Signals count on any rank.
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
"""Used like the number of a signal: the time limit is near."""
RESERVE_SHARE = 0.03
"""Time reserved before the limit, as a fraction of the time that was available at the start."""
RESERVE = 1.0
"""Least time reserved in this way [s]."""
MOST_RESERVE = 60.0
"""Most time reserved in this way [s]."""
STEPS_KEPT = 3.0
"""Time reserved in addition for steps, in units of the longest step so far."""
SAVES_KEPT = 3.0
"""Time reserved in addition for checkpoints, in units of the longest checkpoint so far."""
STEPS_OF_PATIENCE = 4.0
"""Time, in units of the longest step, within which all ranks must have noticed a signal before one of them gives up."""
SLOW_DISK = 50e6
"""Speed [bytes/s] of the disk that is assumed until a checkpoint has been written."""


@dataclass(frozen=True)
class Timing:
    """every: time [s] between checkpoints, infinite for only the last one. limit: when (time.time()) the run must have
    ended. whose: what sets this limit, for messages."""

    every: float = 600.0
    limit: float = math.inf
    whose: str = ""


class Keeper:
    """Writes the checkpoints of a run and decides when it stops. `attend` is called at the start, between steps, and at
    the end.

    Attributes:
        why: the reason for stopping, such as "USR1"; empty while the run continues.
        out_of_time: whether the reason is the time limit.
    """

    def __init__(
        self, comm: Intracomm, checkpoints: Checkpoints, outputs: Outputs, signals: StopSignals, timing: Timing,
        about: dict[str, Any], history: History, bytes_expected: int, say: Callable[[str], None],
    ):  # fmt: skip
        """about: data on the run for the head of every checkpoint (scene, files, versions); bytes_expected: approximate
        size of a checkpoint."""
        self.comm, self.checkpoints, self.outputs, self.signals = comm, checkpoints, outputs, signals
        self.timing, self.about, self.history = timing, about, history
        self.say = say if comm.rank == 0 else (lambda line: None)
        self.why, self.out_of_time = "", False
        self._began = time.time()
        self._last_save = self._last_step = time.perf_counter()
        self._longest_step, self._longest_save = 0.0, bytes_expected / SLOW_DISK
        self._phase: int | None = None

    def attend(self, simulation: Simulation) -> bool:
        """Writes a checkpoint if one is due; returns whether to stop, with the reason in `why`. Collective."""
        state = simulation.state
        if state.finished:
            # Before the last rows are written: a run that ended at solver.max_steps may continue from here.
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
        """Whether the run has to stop now, before its first step, with the reason in `why`. Collective."""
        # OUT_OF_TIME is negative, so that signals take precedence.
        mine = self.signals.stop if self.signals.asked else OUT_OF_TIME if self.interrupts() else 0
        stops = self.comm.allgather(mine)
        stop = max(stops) or min(stops)
        if stop:
            self.out_of_time, self.why = stop == OUT_OF_TIME, self._why(stop)
        return bool(stop)

    def interrupts(self) -> bool:
        """Whether this rank requests that the present step is abandoned. A step that may end in time is not."""
        return self.signals.asked or (self.comm.rank == 0 and self._time_is_up(steps_kept=0.0))

    def _why(self, stop: int) -> str:
        if stop != OUT_OF_TIME:
            return StopSignals.name_of(stop)
        return f"{LIMIT_OF_TIME} ({self.timing.whose})" if self.timing.whose else LIMIT_OF_TIME

    def go_on(self, simulation: Simulation) -> None:
        """To be called after a restart: no checkpoint is due, and the time that one takes is known."""
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
        # A signal that arrives now must not end a process while it writes.
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
        # The first measured time replaces the estimate.
        self._longest_save = max(self._longest_save, took) if self.history.now.checkpoints else took
        self._phase = state.phase
        self.history.now.checkpoints += 1
        self.history.now.checkpoint_s += took
        return saved
