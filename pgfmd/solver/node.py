"""What ranks pass to each other within a step: through memory that the ranks of a node share, by messages between nodes.

Two things are passed: a few numbers for each row of points, from which sums are made in one order everywhere; and the rows
of a half spectrum, which become columns and rows again. Both only move numbers, so results have the same bits for any
split of the ranks into nodes.
"""

from __future__ import annotations

import gc
import math
import time
import weakref
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from types import ModuleType

    from mpi4py.MPI import Intracomm, Win, buffer
    from numpy.typing import DTypeLike

_LINE = 64
"""Bytes of a cache line: flags of two ranks must not share one."""
_PATIENCE = 1e-4
"""Time [s] after which a waiting rank sleeps: the others are then not just behind, they have no core. (Offering this
rank's core instead gives it away for milliseconds where another program wants it; who sleeps is soon on again.)"""
_NAP = 2e-5
"""Time [s] of such a sleep; the system adds about 50 us."""


def _mpi() -> ModuleType:
    """mpi4py's MPI, which a single process need not load."""
    from mpi4py import MPI

    return MPI


@dataclass
class _Piece:
    """Memory shared by the ranks of a node: its window, a buffer a rank, their sizes [bytes]."""

    window: Win
    buffers: list[buffer]
    sizes: list[int]
    free: bool = True

    def fits(self, sizes: list[int]) -> bool:
        """Whether it is enough for these sizes, and not much more."""
        enough = all(own >= wanted for own, wanted in zip(self.sizes, sizes, strict=True))
        return enough and sum(self.sizes) <= 2 * sum(sizes) + _LINE

    def release(self) -> None:
        self.free = True


class Node:
    """The ranks of a communicator that share memory with this one, and where they meet.

    `ranks`: their ranks in the communicator, this one's among them. `meetings`, `waited` [s]: how many there were, and the
    time spent in them. `messages`, `sent` [bytes], `gathers`: what this rank has passed to other nodes. Made once for a
    communicator, by `Node.of`.
    """

    _key: int | None = None

    def __init__(self, comm: Intracomm, colour: int | None = None):
        MPI = _mpi()
        self.comm = comm
        shared = comm.Split_type(MPI.COMM_TYPE_SHARED)
        self.local = shared if colour is None else shared.Split(colour, comm.rank)
        self.meetings, self.waited = 0, 0.0
        self.messages = self.sent = self.gathers = 0
        # Memory [bytes] that this rank has given to share: now, and the most so far.
        self.held = self.most_held = 0
        self._pieces: list[_Piece] = []
        if self.local.size > 1 and not self._share_flags():
            # No shared memory to be had, as in containers with a small /dev/shm: each rank is a node of its own.
            self.local = comm.Split(comm.rank, 0)
        self.ranks = self.local.allgather(comm.rank)
        self.leaders = comm.Split(0 if self.local.rank == 0 else MPI.UNDEFINED, comm.rank)
        self.count = comm.allreduce(int(self.local.rank == 0))

    @classmethod
    def of(cls, comm: Intracomm) -> Node:
        """The node of this rank of a communicator. Collective where it is asked for the first time."""
        found = comm.Get_attr(cls._key) if cls._key is not None else None
        return cls.arrange(comm) if found is None else found

    @classmethod
    def arrange(cls, comm: Intracomm, colour: int | None = None) -> Node:
        """Makes the nodes of a communicator; ranks of different colours are taken to be on different ones. Collective."""
        if cls._key is None:
            cls._key = _mpi().Comm.Create_keyval()
        node = cls(comm, colour)
        comm.Set_attr(cls._key, node)
        return node

    def _share_flags(self) -> bool:
        """Whether all ranks of this node got memory for their flags."""
        piece = self._allocate([_LINE] * self.local.size)
        if piece is None:
            return False
        self._flags = piece
        flags = [memoryview(buffer).cast("q") for buffer in piece.buffers]
        self._mine = flags[self.local.rank]
        self._others = [flag for rank, flag in enumerate(flags) if rank != self.local.rank]
        self._mine[0] = self.meetings = 0
        self.local.Barrier()
        return True

    def take(self, owner: object, size: int) -> list[buffer]:
        """Memory that the ranks of the node share for as long as `owner` lives: one buffer a rank, this one's of at
        least `size` bytes. Collective on the node; MemoryError, on all of its ranks, where there is no more.

        What the owners of all ranks have left is used again: a window can't be given back but by all ranks at once, and
        they don't forget an object at the same time.
        """
        sizes = self.local.allgather(size)
        free = np.array([piece.free for piece in self._pieces], dtype=np.int8)
        everywhere = np.empty_like(free)
        self.local.Allreduce(free, everywhere, op=_mpi().MIN)
        for piece, usable in zip(self._pieces, everywhere, strict=True):
            if usable and piece.fits(sizes):
                break
        else:
            piece = self._allocate(sizes)
            if piece is None:
                raise MemoryError(f"{sum(sizes)} bytes of memory shared by the ranks of a node")
            self._pieces.append(piece)
        piece.free = False
        weakref.finalize(owner, piece.release).atexit = False
        return piece.buffers

    def trim(self) -> None:
        """Gives memory back that no rank's owners need any more. Collective on the node."""
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
        """Gives back what is shared on a communicator that is to be freed, but what an object still holds. Collective.

        MPI itself would give windows back at its end, in an order that differs between ranks of which only some have had
        this communicator: they would wait for each other for ever.
        """
        node = comm.Get_attr(cls._key) if cls._key is not None else None
        if node is None:
            return
        # Of objects that refer to each other, Python has not let go yet.
        gc.collect()
        node.trim()
        flags = getattr(node, "_flags", None)
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
        """New memory of these sizes [bytes], one a rank of the node; None, on all of them, where there is none."""
        MPI = _mpi()
        info = MPI.Info.Create()
        # Each rank's part begins a page, in the memory that is nearest to it.
        info.Set("alloc_shared_noncontig", "true")
        window, errors = None, self.local.Get_errhandler()
        self.local.Set_errhandler(MPI.ERRORS_RETURN)
        try:
            window = MPI.Win.Allocate_shared(max(sizes[self.local.rank], _LINE), 1, info, self.local)
        except MPI.Exception:
            pass
        finally:
            self.local.Set_errhandler(errors)
            info.Free()
        if self.local.allreduce(int(window is not None), MPI.MIN) == 0:
            return None
        window.Lock_all(MPI.MODE_NOCHECK)
        self.held += sizes[self.local.rank]
        self.most_held = max(self.most_held, self.held)
        return _Piece(window, [window.Shared_query(rank)[0] for rank in range(self.local.size)], sizes)

    def meet(self) -> None:
        """Goes on when all ranks of the node are here; what they have written into shared memory is then seen by all.

        A rank that finds the others late leaves its core to others, MPI's own barrier does not.
        """
        began, others = time.perf_counter(), self._others
        self._flags.window.Sync()
        self.meetings += 1
        now = self._mine[0] = self.meetings
        while not all(flag[0] >= now for flag in others):
            if time.perf_counter() - began > _PATIENCE:
                time.sleep(_NAP)
        self._flags.window.Sync()
        self.waited += time.perf_counter() - began


class RowExchange:
    """A few numbers a row, of rows that are shared out over the ranks, brought to all of them.

    node: of the communicator. start, count: this rank's rows, of `total`. kinds: most numbers a row.
    """

    def __init__(self, node: Node, start: int, count: int, total: int, kinds: int):
        self.node, self.mine = node, slice(start, start + count)
        local = node.local
        # Two of them, in turns: a rank may write the next numbers while another still reads these.
        self._turn, shape = 0, (2, kinds, total)
        if local.size > 1:
            buffers = node.take(self, 8 * math.prod(shape) if local.rank == 0 else 0)
            self._all = np.frombuffer(buffers[0], count=math.prod(shape)).reshape(shape)
        else:
            self._all = np.empty(shape)
        if node.count > 1:
            rows = local.gather((start, count))
            if local.rank == 0:
                everywhere = node.leaders.allgather([row for first, size in rows for row in range(first, first + size)])
                self._here = np.array(everywhere[node.leaders.rank], dtype=np.intp)
                self._there = np.array([row for rows in everywhere for row in rows], dtype=np.intp)
                self._counts = np.array([len(rows) for rows in everywhere])

    def __call__(self, local: np.ndarray) -> np.ndarray:
        """The numbers of all rows, (kinds, total), from this rank's (kinds, count). A view, good until the next call.
        Collective."""
        kinds = local.shape[0]
        self._turn = 1 - self._turn
        rows = self._all[self._turn, :kinds]
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
    """The rows of a half spectrum, shared out over the ranks, as whole columns, and back.

    rows: (start, count) of each rank's rows; columns: the same of its columns. `columns` (all rows, columns of this rank)
    is where columns are worked on. `blocks`, one for each rank with columns: (first, last, array (rows of this rank,
    columns of that one)), where this rank writes its rows, and finds them again. On one node these are parts of the
    others' `columns`, so nothing is copied; others are sent, into their place at once, and sent back.
    """

    def __init__(self, comm: Intracomm, rows: list[tuple[int, int]], columns: list[tuple[int, int]], dtype: DTypeLike):
        self.comm, self._node, rank = comm, None, comm.rank
        dtype, total = np.dtype(dtype), sum(count for _, count in rows)
        mine, here = slice(rows[rank][0], sum(rows[rank])), [rank]
        shape = (total, columns[rank][1])
        arrays = {}
        if comm.size > 1:
            self._node = Node.of(comm)
            here = self._node.ranks
        if len(here) > 1:
            buffers = self._node.take(self, math.prod(shape) * dtype.itemsize)
            for peer, buffer in zip(here, buffers, strict=True):
                size = total * columns[peer][1]
                arrays[peer] = np.frombuffer(buffer, dtype, size).reshape(total, columns[peer][1])
        else:
            arrays[rank] = np.empty(shape, dtype)
        self.columns, self.blocks, self._remote = arrays[rank], [], []
        for peer, (first, count) in enumerate(columns):
            if peer in arrays:
                block = arrays[peer][mine]
            else:
                block = np.empty((rows[rank][1], count), dtype)
                self._remote.append((peer, block, self.columns[rows[peer][0] : sum(rows[peer])]))
            if count:
                self.blocks.append((first, first + count, block))

    def to_columns(self) -> None:
        """After all blocks have been written: `columns` are whole. Collective."""
        self._pass([(peer, block, part) for peer, block, part in self._remote])
        self.meet()

    def to_rows(self) -> None:
        """After `columns` have been written: `blocks` are. Collective."""
        self.meet()
        self._pass([(peer, part, block) for peer, block, part in self._remote])

    def meet(self) -> None:
        """Waits until no rank of the node works on its `columns` any more, where these are not to become rows."""
        if self._node is not None and self._node.local.size > 1:
            self._node.meet()

    def _pass(self, pairs: list[tuple[int, np.ndarray, np.ndarray]]) -> None:
        """Sends the first array of each pair to its rank, and receives the second."""
        if not pairs:
            return
        receive = [self.comm.Irecv(target, peer) for peer, _, target in pairs if target.size]
        send = [self.comm.Isend(source, peer) for peer, source, _ in pairs if source.size]
        self._node.messages += len(send)
        self._node.sent += sum(source.nbytes for _, source, _ in pairs)
        _mpi().Request.Waitall(receive + send)
