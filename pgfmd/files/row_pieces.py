"""Writing distributed arrays to a file in pieces. Collective.

MPI counts elements, bytes of pickles and offsets in a gathered array with 31 bits, and a larger number is an error on
one rank only; MPI-IO keeps copies of pending data. So there is a limit to the size of each call, for any number of
points and ranks, and no rank ever has the whole array.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy import ascontiguousarray as contiguous

from pgfmd.errors import ResultError

from .storage import attempt

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

PIECE_BYTES = 2**24
"""Largest size of a call."""


def rows_on_root(comm: Intracomm, rows: np.ndarray, first: int) -> Iterator[tuple[int, np.ndarray]]:
    """The rows of all ranks on rank 0, in pieces, as (first row, rows); nothing on other ranks. Has to be iterated to
    the end on every rank, because the others wait until rank 0 has received everything.

    rows: this rank's (any, width), contiguous, double, of the same width everywhere; first: index of the first of them.
    A piece is valid until the next.
    """
    most = max(1, PIECE_BYTES // (8 * max(1, rows.shape[1])))
    shares = comm.allgather((int(first), len(rows)))
    if comm.rank > 0:
        for start in range(0, len(rows), most):
            comm.Send(rows[start : start + most], 0)
        return
    room = np.empty((min(most, max(count for _, count in shares)), rows.shape[1]))
    for rank, (begin, count) in enumerate(shares):
        for start in range(0, count, most):
            piece = rows[start : start + most]
            if rank > 0:
                piece = room[: min(most, count - start)]
                comm.Recv(piece, rank)
            yield begin + start, piece


def write_together(what: str, calls: Iterator[tuple[h5py.Dataset, np.ndarray, tuple[int, ...]]]) -> ResultError | None:
    """Collective writes through MPI-IO, the same number on every rank; returns the first error on this rank.

    calls: dataset, this rank's piece of it (lines, width), which may be empty, and the index of its first element.
    After an error the rank takes part in the remaining calls with empty pieces, because the others would wait for it.
    what: beginning of the message.
    """
    together = h5py.h5p.create(h5py.h5p.DATASET_XFER)
    together.set_dxpl_mpio(h5py.h5fd.MPIO_COLLECTIVE)
    problem = None
    for dataset, piece, begin in calls:
        # Prepared before, so that an error can't keep the rank from the collective call.
        ready, error = attempt(what, partial(_ready, dataset, piece if problem is None else piece[:0], begin))
        if ready is None:
            ready = _ready(dataset, piece[:0], begin)
        failed = attempt(what, partial(dataset.id.write, *ready, dxpl=together))[1]
        problem = problem or error or failed
    return problem


def _ready(dataset: h5py.Dataset, piece: np.ndarray, begin: tuple[int, ...]) -> tuple[Any, ...]:
    """Selections in memory and in the file, and the data; a rank may have nothing."""
    space = dataset.id.get_space()
    if piece.size:
        space.select_hyperslab(begin, (*(1,) * (len(begin) - 2), *piece.shape))
        return h5py.h5s.create_simple(piece.shape), space, contiguous(piece)
    # Slices of h5py would skip the call on such a rank, for which the others then wait.
    space.select_none()
    memory = h5py.h5s.create_simple((1, 1))
    memory.select_none()
    return memory, space, np.zeros((1, 1), piece.dtype)
