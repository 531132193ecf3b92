"""Ranks for which their node has no core. They wait for the others and do no work.

Ranks synchronise several times in each pair of transforms. A rank that shares its core is late each time, and all
others
wait for it: three ranks on two cores take at least a third longer than two.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from pgfmd.errors import PgfmdError

from .launch import RelayedError
from .processes import cores_of
from .streams import say

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

ALL_RANKS = "PGFMD_ALL_RANKS"
"""Environment variable; if it is 1, all ranks get work."""
_NAP = 0.02
"""Interval [s] at which a rank without work checks whether the others have finished."""
_ENDING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that a launcher forwards to all ranks, and that working ranks handle."""


def on_cores(comm: Intracomm, action: Callable[[Any], Any]) -> Any:
    """Calls `action` on the ranks that have a core of their own, with a communicator of these; returns its result
    there, and None on the other ranks after it has finished. To be used within launch.guarded(comm). Collective.

    On each node the first ranks work, as many as there are cores that its ranks may use. An error on rank 0 also ends
    the ranks without work, with the same exit code.
    """
    if comm.size == 1 or os.environ.get(ALL_RANKS) == "1":
        return action(comm)
    from mpi4py import MPI

    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    works = node.rank < max(1, len(set().union(*node.allgather(cores_of()))))
    node.Free()
    working = comm.allgather(works)
    if all(working):
        return action(comm)
    workers, channel = comm.Split(int(not works), comm.rank), comm.Dup()
    if not works:
        _wait(channel)
        return None
    if comm.rank == 0:
        say(_notice(comm.size, sum(working)))
    spare = [rank for rank, has_work in enumerate(working) if not has_work] if comm.rank == 0 else []
    try:
        result = action(workers)
    except PgfmdError as error:
        _tell(channel, spare, error.exit_code)
        raise
    _tell(channel, spare, 0)
    return result


def _notice(ranks: int, working: int) -> str:
    others = f"{ranks - working} {'waits' if ranks - working == 1 else 'wait'}"
    return (
        f"note: {ranks} ranks, but cores for {working}: {working} work{'s' * (working == 1)} and {others}, which is faster. "
        f"Start {working}, or set {ALL_RANKS}=1 to give all of them work"
    )


def _tell(channel: Intracomm, spare: list[int], code: int) -> None:
    for rank in spare:
        channel.Send(bytes([code]), rank)


def _wait(channel: Intracomm) -> None:
    """Waits until rank 0 has finished. Raises RelayedError if it had an error."""
    for number in _ENDING:
        # launch.guarded restores the earlier handlers at its end.
        signal.signal(number, signal.SIG_IGN)
    code = bytearray(1)
    request = channel.Irecv(code, 0)
    while not request.Test():
        time.sleep(_NAP)
    if code[0]:
        raise RelayedError("rank 0 ended with an error", code[0])
