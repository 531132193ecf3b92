"""Communication within a step: through shared memory between ranks of a node, by messages between nodes.

There are two operations: gathering a few numbers per row of points, which every rank then sums in the same order; and
the transposition of the rows of a half spectrum to columns and back. Both only move numbers, so results have the same
bits for any distribution of ranks over nodes.
"""

from __future__ import annotations

import gc
import math
import time
import weakref
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from types import ModuleType

    from mpi4py.MPI import Intracomm, Win
    from numpy.typing import DTypeLike

_LINE = 64
"""Bytes of a cache line: flags of two ranks must not share one."""
_PATIENCE = 1e-4
"""Time [s] after which a waiting rank sleeps, because the others then probably have no core. (Yielding the core instead
loses it for milliseconds if another program wants it; a sleeping process is soon scheduled again.)"""
_NAP = 2e-5
"""Duration [s] of such a sleep; the system adds about 50 us."""


def _mpi() -> ModuleType:
    """mpi4py's MPI, which a single process need not load."""
    from mpi4py import MPI

    return MPI


@dataclass
class _Piece:
    """Memory shared by the ranks of a node: its window, a buffer of mpi4py's a rank, their sizes [bytes]."""

    window: Win
    buffers: list[Any]
    sizes: list[int]
    free: bool = True

    def fits(self, sizes: list[int]) -> bool:
        """Whether it is large enough for these sizes, and not much larger."""
        enough = all(own >= wanted for own, wanted in zip(self.sizes, sizes, strict=True))
        return enough and sum(self.sizes) <= 2 * sum(sizes) + _LINE

    def release(self) -> None:
        self.free = True


class Node:
    """The ranks of a communicator that share memory with this one, and their synchronisation.

    ranks: their numbers in the communicator, including this one.
    meetings, waited [s]: number of synchronisations, and the time spent in them.
    messages, sent [bytes], gathers: communication of this rank with other nodes.
    Made once per communicator, by `Node.of`.
    """

    _key: int | None = None
    _flags: _Piece | None = None

    def __init__(self, comm: Intracomm, colour: int | None = None):
        MPI = _mpi()
        self.comm = comm
        shared = comm.Split_type(MPI.COMM_TYPE_SHARED)
        self.local = shared if colour is None else shared.Split(colour, comm.rank)
        self.meetings, self.waited = 0, 0.0
        self.messages = self.sent = self.gathers = 0
        # Memory [bytes] that this rank contributes: now, and the largest so far.
        self.held = self.most_held = 0
        self._pieces: list[_Piece] = []
        if self.local.size > 1 and not self._share_flags():
            # Without shared memory, as in containers with a small /dev/shm, each rank is a node of its own.
            self.local = comm.Split(comm.rank, 0)
        self.ranks = self.local.allgather(comm.rank)
        self.leaders = comm.Split(0 if self.local.rank == 0 else MPI.UNDEFINED, comm.rank)
        self.count = comm.allreduce(int(self.local.rank == 0))

    @classmethod
    def of(cls, comm: Intracomm) -> Node:
        """The node of this rank of a communicator. The first call is collective."""
        found = cls._known(comm)
        return cls.arrange(comm) if found is None else found

    @classmethod
    def _known(cls, comm: Intracomm) -> Node | None:
        found = comm.Get_attr(cls._key) if cls._key is not None else None
        return found if isinstance(found, Node) else None

    @classmethod
    def arrange(cls, comm: Intracomm, colour: int | None = None) -> Node:
        """Makes the nodes of a communicator; ranks of different colours are taken to be on different ones.
        Collective."""
        if cls._key is None:
            cls._key = _mpi().Comm.Create_keyval()
        node = cls(comm, colour)
        comm.Set_attr(cls._key, node)
        return node

    def _share_flags(self) -> bool:
        """Allocates the flags; whether this worked on all ranks of the node."""
        piece = self._allocate([_LINE] * self.local.size)
        if piece is None:
            return False
        self._flags = piece
        flags = [memoryview(own).cast("q") for own in piece.buffers]
        self._mine = flags[self.local.rank]
        self._others = [flag for rank, flag in enumerate(flags) if rank != self.local.rank]
        self._mine[0] = self.meetings = 0
        self.local.Barrier()
        return True

    def take(self, owner: object, size: int) -> list[Any]:
        """Memory that the ranks of the node share for as long as `owner` lives: one buffer a rank, this one's of at
        least `size` bytes. Collective on the node; MemoryError, on all of its ranks, where there is no more.

        Memory whose owners have died on all ranks is reused. A window can only be freed by all ranks together, and they
        do not delete an object at the same time.
        """
        sizes = self.local.allgather(size)
        free = np.array([piece.free for piece in self._pieces], dtype=np.int8)
        everywhere = np.empty_like(free)
        self.local.Allreduce(free, everywhere, op=_mpi().MIN)
        known = zip(self._pieces, everywhere, strict=True)
        piece = next((piece for piece, usable in known if usable and piece.fits(sizes)), None)
        if piece is None:
            piece = self._allocate(sizes)
            if piece is None:
                raise MemoryError(f"{sum(sizes)} bytes of memory shared by the ranks of a node")
            self._pieces.append(piece)
        piece.free = False
        weakref.finalize(owner, piece.release).atexit = False
        return piece.buffers

    def trim(self) -> None:
        """Frees memory that has no owner on any rank. Collective on the node."""
        free = np.array([piece.free for piece in self._pieces], dtype=np.int8)
        everywhere = np.empty_like(free)
        self.local.Allreduce(free, everywhere, op=_mpi().MIN)
        kept = []
        for piece, unused in zip(self._pieces, everywhere, strict=True):
            if unused:
                piece.window.Unlock_all()
                piece.buffers.clear()
                piece.window.Free()
                self.held -= piece.sizes[self.local.rank]
            else:
                kept.append(piece)
        self._pieces = kept

    @classmethod
    def leave(cls, comm: Intracomm) -> None:
        """Frees the shared memory of a communicator that is to be freed, except memory that still has an owner.
        Collective.

        MPI itself would free windows at its end, in an order that differs between ranks if only some of them have this
        communicator: they would wait for each other for ever.
        """
        node = cls._known(comm)
        if node is None or cls._key is None:
            return
        # Deletes objects that refer to each other.
        gc.collect()
        node.trim()
        flags = node._flags
        if flags is not None and node.local.size > 1:
            node._mine.release()
            for other in node._others:
                other.release()
            flags.window.Unlock_all()
            flags.buffers.clear()
            flags.window.Free()
            node.held -= flags.sizes[node.local.rank]
            node._flags = None
        for part in (node.leaders, node.local):
            if part != _mpi().COMM_NULL:
                part.Free()
        comm.Delete_attr(cls._key)

    def _allocate(self, sizes: list[int]) -> _Piece | None:
        """New memory of these sizes [bytes], one per rank of the node; None, on all of them, if there is none."""
        MPI = _mpi()
        info = MPI.Info.Create()
        # Each rank's part begins a page, in the memory nearest to it.
        info.Set("alloc_shared_noncontig", "true")
        window: Win | None = None
        errors = self.local.Get_errhandler()
        self.local.Set_errhandler(MPI.ERRORS_RETURN)
        try:
            window = MPI.Win.Allocate_shared(max(sizes[self.local.rank], _LINE), 1, info, self.local)
        except MPI.Exception:
            pass
        finally:
            self.local.Set_errhandler(errors)
            info.Free()
        if self.local.allreduce(int(window is not None), MPI.MIN) == 0 or window is None:
            return None
        window.Lock_all(MPI.MODE_NOCHECK)
        self.held += sizes[self.local.rank]
        self.most_held = max(self.most_held, self.held)
        return _Piece(window, [window.Shared_query(rank)[0] for rank in range(self.local.size)], sizes)

    def meet(self) -> None:
        """Barrier of the ranks of the node; afterwards all see what was written into shared memory.

        Unlike MPI's own barrier, a rank that waits for long yields its core.
        """
        began, others, flags = time.perf_counter(), self._others, self._flags
        assert flags is not None, "ranks that share no memory don't meet"
        flags.window.Sync()
        self.meetings += 1
        now = self._mine[0] = self.meetings
        while not all(flag[0] >= now for flag in others):
            if time.perf_counter() - began > _PATIENCE:
                time.sleep(_NAP)
        flags.window.Sync()
        self.waited += time.perf_counter() - began


class RowExchange:
    """Gathers a few numbers per row, of rows distributed over the ranks, on all ranks.

    node: of the communicator. start, count: this rank's rows, of `total`. kinds: largest number of numbers per row.
    """

    def __init__(self, node: Node, start: int, count: int, total: int, kinds: int):
        self.node, self.mine = node, slice(start, start + count)
        local = node.local
        # Two buffers in turns: a rank may write the next numbers while another still reads these.
        self._turn, shape = 0, (2, kinds, total)
        if local.size > 1:
            buffers = node.take(self, 8 * math.prod(shape) if local.rank == 0 else 0)
            self._all = np.frombuffer(buffers[0], count=math.prod(shape)).reshape(shape)
        else:
            self._all = np.empty(shape)
        if node.count > 1:
            rows = local.gather((start, count))
            if rows is not None:
                everywhere = node.leaders.allgather([row for first, size in rows for row in range(first, first + size)])
                self._here = np.array(everywhere[node.leaders.rank], dtype=np.intp)
                self._there = np.array([row for rows in everywhere for row in rows], dtype=np.intp)
                self._counts = np.array([len(rows) for rows in everywhere])

    def __call__(self, local: np.ndarray) -> np.ndarray:
        """The numbers of all rows, (kinds, total), from this rank's (kinds, count). A view, valid until the next call.
        Collective."""
        kinds = local.shape[0]
        self._turn = 1 - self._turn
        rows: np.ndarray = self._all[self._turn, :kinds]
        rows[:, self.mine] = local
        if self.node.local.size > 1:
            self.node.meet()
        if self.node.count > 1:
            if self.node.local.rank == 0:
                self.node.gathers += 1
                gathered = np.empty((len(self._there), kinds))
                self.node.leaders.Allgatherv(
                    np.ascontiguousarray(rows[:, self._here].T), [gathered, self._counts * kinds]
                )
                rows[:, self._there] = gathered.T
            if self.node.local.size > 1:
                self.node.meet()
        return rows


class Transposition:
    """Transposes the rows of a half spectrum, distributed over the ranks, to complete columns, and back.

    rows: (start, count) of each rank's rows; columns: the same for its columns.
    `columns` (all rows, columns of this rank): the columns of this rank.
    `blocks`, one for each rank with columns: (first, last, array (rows of this rank, columns of that rank)). This rank
    writes its rows there, and reads them afterwards. On one node these are parts of the `columns` of other ranks, so
    nothing is copied; blocks for other nodes are sent directly into their place, and sent back.
    """

    def __init__(self, comm: Intracomm, rows: list[tuple[int, int]], columns: list[tuple[int, int]], dtype: DTypeLike):
        self.comm, rank = comm, comm.rank
        self._node = Node.of(comm) if comm.size > 1 else None
        kind, total = np.dtype(dtype), sum(count for _, count in rows)
        mine = slice(rows[rank][0], sum(rows[rank]))
        shape = (total, columns[rank][1])
        arrays: dict[int, np.ndarray] = {}
        here = [rank] if self._node is None else self._node.ranks
        if self._node is not None and len(here) > 1:
            buffers = self._node.take(self, math.prod(shape) * kind.itemsize)
            for peer, shared in zip(here, buffers, strict=True):
                size = total * columns[peer][1]
                arrays[peer] = np.frombuffer(shared, kind, size).reshape(total, columns[peer][1])
        else:
            arrays[rank] = np.empty(shape, kind)
        self.columns = arrays[rank]
        self.blocks: list[tuple[int, int, np.ndarray]] = []
        self._remote: list[tuple[int, np.ndarray, np.ndarray]] = []
        for peer, (first, count) in enumerate(columns):
            if peer in arrays:
                block = arrays[peer][mine]
            else:
                block = np.empty((rows[rank][1], count), kind)
                self._remote.append((peer, block, self.columns[rows[peer][0] : sum(rows[peer])]))
            if count:
                self.blocks.append((first, first + count, block))

    def to_columns(self) -> None:
        """To be called after all blocks have been written: completes `columns`. Collective."""
        self._pass([(peer, block, part) for peer, block, part in self._remote])
        self.meet()

    def to_rows(self) -> None:
        """To be called after `columns` have been written: fills `blocks`. Collective."""
        self.meet()
        self._pass([(peer, part, block) for peer, block, part in self._remote])

    def meet(self) -> None:
        """Waits until no rank of the node uses its `columns` any more; for columns that are not transposed back."""
        if self._node is not None and self._node.local.size > 1:
            self._node.meet()

    def _pass(self, pairs: list[tuple[int, np.ndarray, np.ndarray]]) -> None:
        """Sends the first array of each pair to its rank, and receives the second."""
        if not pairs or self._node is None:
            return
        receive = [self.comm.Irecv(target, peer) for peer, _, target in pairs if target.size]
        send = [self.comm.Isend(source, peer) for peer, source, _ in pairs if source.size]
        self._node.messages += len(send)
        self._node.sent += sum(source.nbytes for _, source, _ in pairs)
        _mpi().Request.Waitall(receive + send)
