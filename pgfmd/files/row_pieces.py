"""Arrays that the ranks hold side by side, brought to a file a piece at a time. Collective.

MPI counts elements, bytes of pickles and places in a gathered array with 31 bits, and refuses more on the one rank that
finds out; MPI-IO keeps copies of what is under way. So nothing large goes through one call, whatever the number of
points and ranks, and no rank ever holds the whole.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import h5py
import numpy as np
from numpy import ascontiguousarray as contiguous

from pgfmd.errors import ResultError

from .storage import attempt

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

PIECE_BYTES = 2**24
"""Most that goes through one call."""


def rows_on_root(comm: Intracomm, rows: np.ndarray, first: int) -> Iterator[tuple[int, np.ndarray]]:
    """The rows of all ranks on rank 0, in pieces, as (first row, rows); nothing elsewhere. To be gone through to its
    end on every rank, as the others wait until rank 0 has taken all that they send.

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
    """Collective writes through MPI-IO, as many on every rank; returns what went wrong on this rank first.

    calls: dataset, this rank's piece of it (lines, width), which may be empty, and the place of its first element.
    After a failure the rank still takes part in the calls that are left, with nothing to write: the others would wait
    for it.
    what: begin of the message.
    """
    together = h5py.h5p.create(h5py.h5p.DATASET_XFER)
    together.set_dxpl_mpio(h5py.h5fd.MPIO_COLLECTIVE)
    problem = None
    for dataset, piece, begin in calls:
        # Made ready beforehand: what fails before the call must not keep the rank from it.
        ready, error = attempt(what, partial(_ready, dataset, piece if problem is None else piece[:0], begin))
        if ready is None:
            ready = _ready(dataset, piece[:0], begin)
        failed = attempt(what, partial(dataset.id.write, *ready, dxpl=together))[1]
        problem = problem or error or failed
    return problem


def _ready(dataset: h5py.Dataset, piece: np.ndarray, begin: tuple[int, ...]) -> tuple:
    """Places in memory and in the file, and what is to be written there; a rank may have nothing."""
    space = dataset.id.get_space()
    if piece.size:
        space.select_hyperslab(begin, (*(1,) * (len(begin) - 2), *piece.shape))
        return h5py.h5s.create_simple(piece.shape), space, contiguous(piece)
    # Slices of h5py skip the call of such a rank, for which the others then wait.
    space.select_none()
    memory = h5py.h5s.create_simple((1, 1))
    memory.select_none()
    return memory, space, np.zeros((1, 1), piece.dtype)
