"""Writing and reading a checkpoint by all ranks together: one file, the same for any number of ranks. Collective.

Rank 0 creates the file with space for everything. All ranks write their shares, with parallel HDF5 if h5py has it, else
one after the other. Rank 0 seals the file, and all ranks flush it to the disk. An unsealed file is not a checkpoint.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np

from pgfmd.errors import RunError
from pgfmd.files.checksum import block_sums
from pgfmd.files.hdf5 import open_serial
from pgfmd.files.regular_files import bring_to_disk
from pgfmd.files.row_pieces import write_together
from pgfmd.files.storage import agree, attempt, on_root
from pgfmd.solver.finite import lines_of, not_finite_on

from . import checkpoint_layout
from .checkpoint_layout import Damaged, Entry, compare_sums

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

PIECE_BYTES = 2**20
"""Most bytes in one collective write of a rank, because MPI-IO keeps copies of them."""


@dataclass(frozen=True)
class Place:
    """This rank's columns in the whole array: the first one, the total number, and the largest number of any rank."""

    first: int
    total: int
    widest: int

    @classmethod
    def of(cls, comm: Intracomm, width: int) -> Place:
        """The place of a share with `width` columns. Collective."""
        widths = comm.allgather(width) if comm.size > 1 else [width]
        return cls(sum(widths[: comm.rank]), sum(widths), max(widths))


def write(path: Path, comm: Intracomm, head: dict, arrays: dict[str, np.ndarray], wanted: Path | None = None) -> int:
    """Writes head and arrays (this rank's shares) to a new file; returns its size [bytes].

    wanted: the final name of the file, for messages.

    Raises, on every rank: RunError if a number is not finite, with array and index, before anything is written;
    ResultError if the file can't be written, which is then deleted.
    """
    shares = {name: lines_of(array) for name, array in sorted(arrays.items())}
    places = {name: Place.of(comm, share.shape[1]) for name, share in shares.items()}
    # Arrays that are empty on all ranks need no dataset.
    shares = {name: share for name, share in shares.items() if len(share) and places[name].total}
    _require_finite(comm, shares)
    entries = [_entry(comm, name, share, places[name]) for name, share in shares.items()]
    what, size = f"{wanted or path}: could not be written", None
    try:
        on_root(comm, what, lambda: checkpoint_layout.create(path, head, entries))
        _write_shares(path, comm, shares, places, what)
        size = on_root(comm, what, lambda: checkpoint_layout.seal(path))
        # Each rank: on a cluster the data may still be in its own node's memory.
        agree(comm, attempt(what, lambda: bring_to_disk(path))[1])
    except BaseException:
        if comm.rank == 0:
            path.unlink(missing_ok=True)
        raise
    return comm.bcast(size)


def read_head(path: Path, comm: Intracomm) -> dict:
    """The head of a file with a valid seal, on every rank. Raises Damaged on every rank if it is invalid or missing."""
    head, problem = None, None
    if comm.rank == 0:
        try:
            head = checkpoint_layout.read_head(path)
        except Damaged as error:
            problem = str(error)
        except FileNotFoundError:
            problem = "missing"
    head, problem = comm.bcast((head, problem))
    if problem:
        raise Damaged(problem)
    return head


class Reader:
    """Reads this rank's shares of the arrays of a file, and checks their checksums: `reader(name, share)` fills
    `share`. Collective. Raises Damaged on every rank if an array has changed."""

    def __init__(self, path: Path, comm: Intracomm, head: dict):
        self.path, self.comm = path, comm
        self.entries = {entry.name: entry for entry in head["entries"]}

    def __call__(self, name: str, share: np.ndarray) -> None:
        lines = lines_of(share)
        place, entry = Place.of(self.comm, lines.shape[1]), self.entries.get(name)
        if entry is None and not (len(lines) and place.total):
            return
        shape = (len(lines), place.total)
        if entry is None or entry.shape != shape or entry.dtype != lines.dtype.str:
            found = f"{entry.dtype} {entry.shape}" if entry else "not there"
            raise Damaged(f"its array {name} is {found}, expected {lines.dtype.str} {shape}")
        _, error = attempt(f"{self.path}: could not be read", lambda: self._fill(name, lines, place.first))
        failed = self.comm.allreduce(int(error is not None))
        if failed:
            raise Damaged(f"its array {name} can't be read on {failed} of {self.comm.size} ranks: {error or ''}")
        compare_sums(entry, _over_ranks(self.comm, block_sums(lines, place.first, place.total)))

    def _fill(self, name: str, lines: np.ndarray, first: int) -> None:
        if lines.shape[1]:
            with open_serial(self.path, "r") as file:
                file[name].read_direct(lines, np.s_[:, first : first + lines.shape[1]])


def _over_ranks(comm: Intracomm, sums: np.ndarray) -> np.ndarray:
    """Sums modulo 2^64 over all ranks."""
    if comm.size == 1:
        return sums
    total = np.empty_like(sums)
    comm.Allreduce(sums, total)
    return total


def _entry(comm: Intracomm, name: str, share: np.ndarray, place: Place) -> Entry:
    sums = _over_ranks(comm, block_sums(share, place.first, place.total))
    return Entry(name, (len(share), place.total), share.dtype.str, sums)


def _require_finite(comm: Intracomm, shares: dict[str, np.ndarray]) -> None:
    """RunError on every rank if a number of a share is not finite."""
    where = not_finite_on(comm, shares)
    if where:
        raise RunError(f"the state is no longer finite: {where}. The checkpoints from before are valid")


def _write_shares(
    path: Path, comm: Intracomm, shares: dict[str, np.ndarray], places: dict[str, Place], what: str
) -> None:
    """Writes every rank's shares into the datasets. Raises ResultError on every rank, with a message that begins with
    `what`, if one fails."""
    if comm.size > 1 and h5py.get_config().mpi:
        agree(comm, attempt(what, lambda: _write_together(path, comm, shares, places))[1])
        return
    for turn in range(comm.size):
        agree(comm, attempt(what, lambda: _write_alone(path, shares, places))[1] if turn == comm.rank else None)


def _write_alone(path: Path, shares: dict[str, np.ndarray], places: dict[str, Place]) -> None:
    with open_serial(path, "r+") as file:
        for name, share in shares.items():
            if share.shape[1]:
                first = places[name].first
                file[name].write_direct(share, dest_sel=np.s_[:, first : first + share.shape[1]])


def _write_together(path: Path, comm: Intracomm, shares: dict[str, np.ndarray], places: dict[str, Place]) -> None:
    with h5py.File(path, "r+", driver="mpio", comm=comm) as file:
        problem = write_together(f"{path}: could not be written", _calls(file, shares, places))
    if problem is not None:
        raise problem


def _calls(file: h5py.File, shares: dict[str, np.ndarray], places: dict[str, Place]) -> Iterator[tuple]:
    """Dataset, piece of this rank's share and its position, for the same number of collective writes on every rank."""
    for name, share in shares.items():
        place, most = places[name], PIECE_BYTES // share.itemsize
        lines = max(1, most // place.widest)
        for line in range(0, len(share), lines):
            for start in range(0, place.widest, most):
                piece = share[line : line + lines, start : start + most]
                yield file[name], piece, (line, place.first + start)
