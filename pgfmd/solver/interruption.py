"""Asking within a step that takes long whether it is to be given up: all ranks together, about twice a second."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

EVERY = 0.5
"""Time [s] between two questions, about."""
FIRST = 8
"""Iterations until the first question."""
LONGEST = 10_000
"""Most iterations between two questions."""


class Interrupted(Exception):
    """A step that was given up: on every rank, at the same place."""


class Question:
    """Called once an iteration by every rank; raises Interrupted on all of them if one of them wants to.

    asked: whether this rank wants to. How many iterations lie between two questions is rank 0's to say, by its clock.
    """

    def __init__(self, comm: Intracomm, asked: Callable[[], bool]):
        self._comm, self._asked = comm, asked
        self._pause = self._left = FIRST
        self._last = time.perf_counter()

    def begin(self) -> None:
        """A new step: what was between the last one and this was no iteration."""
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
