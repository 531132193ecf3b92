"""Interruption of a long step: all ranks together ask about twice a second whether to abandon it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

EVERY = 0.5
"""Approximate time [s] between two questions."""
FIRST = 8
"""Iterations before the first question."""
LONGEST = 10_000
"""Most iterations between two questions."""


class Interrupted(Exception):
    """A step was abandoned, on every rank at the same place."""


class StopCondition(Protocol):
    """Whether a run has to end: on a signal, at a limit of time (restart/checkpoint_policy.py), on Ctrl-C
    (in_memory.py)."""

    def interrupts(self) -> bool:
        """Whether this rank wants a step given up that has begun."""
        ...

    def has_to_stop(self) -> bool:
        """Whether any rank wants the run to stop before its next step. Collective."""
        ...


class Question:
    """Called in each iteration by every rank; raises Interrupted on all ranks if one of them requests it.

    asked: returns whether this rank requests it. The number of iterations between two questions follows rank 0's clock.
    """

    def __init__(self, comm: Intracomm, asked: Callable[[], bool]):
        self._comm, self._asked = comm, asked
        self._pause = self._left = FIRST
        self._last = time.perf_counter()

    def begin(self) -> None:
        """Starts a new step; the time since the last one does not count."""
        self._left, self._last = self._pause, time.perf_counter()

    def __call__(self) -> None:
        self._left -= 1
        if self._left:
            return
        now = time.perf_counter()
        found = np.array([self._asked(), 0], dtype=np.int64)
        if self._comm.rank == 0:
            rate = self._pause / max(now - self._last, 1e-9)
            found[1] = min(max(round(rate * EVERY), 1), 4 * self._pause, LONGEST)
        if self._comm.size > 1:
            from mpi4py import MPI

            self._comm.Allreduce(MPI.IN_PLACE, found, op=MPI.MAX)
        self._pause = self._left = int(found[1])
        self._last = now
        if found[0]:
            raise Interrupted
