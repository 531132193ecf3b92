"""Snapshots of gap, traction and displacement in `fields.h5`, written by all ranks together or gathered to rank 0.

Rank 0 alone changes the structure of the file (`fields_layout`), serially and with the disk space secured; then every
rank writes its rows into room that is there already. So nothing that can fail for want of space or rights happens in a
collective HDF5 call, where one rank's failure would leave the others waiting.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import h5py
import numpy as np

from pgfmd.errors import ResultError
from pgfmd.files import fields_layout, row_pieces
from pgfmd.files.checksum import whole_sum
from pgfmd.files.fields_layout import BLOCK_FIELDS, SURFACE_FIELD, Layout
from pgfmd.files.hdf5 import open_serial
from pgfmd.files.regular_files import bring_to_disk, require_regular
from pgfmd.files.storage import agree, attempt, on_root
from pgfmd.host.streams import say

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

# HDF5's own book-keeping for one more snapshot: B-tree nodes and chunks of the per-snapshot numbers.
BOOKKEEPING_BYTES = 2**17
Rows = np.ndarray | Callable[[], np.ndarray]

_noticed = False


def notice_once(comm: Intracomm) -> None:
    """Say on rank 0, once per process, that arrays go through rank 0."""
    global _noticed
    if not _noticed and comm.rank == 0:
        say("h5py has no MPI here: snapshots are gathered to rank 0 and written from there")
    _noticed = True


Producer = Callable[[], tuple[np.ndarray, int]]
"""What makes rows of this rank, and tells the first of them."""


class FieldsFile:
    """Snapshots of a run. The file is opened, extended and closed for each, and continued if it is there already.

    Attributes:
        frames: snapshots in the file, the same on every rank: all that a checkpoint has to hold.
        parallel: whether all ranks write (MPI-IO) or rank 0 does; the file is the same.
    """

    def __init__(
        self,
        path: str | Path,
        comm: Intracomm,
        n: int,
        length: float,
        block_start: int,
        nb: int,
        row_start: int,
        rows_local: int,
        inside: np.ndarray,
        surface: bool = False,
        parallel: bool | None = None,
        guard: Callable[[], None] = lambda: None,
        extra_attributes: Mapping[str, float] = MappingProxyType({}),
    ):
        """Make or continue the file; collective.

        Args:
            path: the file. comm: the communicator, kept.
            n, length: points a side and side [m] of the cell.
            block_start, nb: first row and column of the punch block in the cell, and its side.
            row_start, rows_local: this rank's rows of the block; may be none. Together the ranks' rows are the block's.
            inside: (rows_local, nb) bool, the points under the punch; all others are written as NaN.
            surface: also keep the displacement of the whole cell.
            parallel: True: through MPI-IO; False: through rank 0; None: MPI-IO if h5py has it, for several ranks.
            guard: called on rank 0 before the file is changed; raises if its folder is no longer the one that it was.
            extra_attributes: of a new file's root: what its readers have to know of the run.

        Raises:
            ResultError: on every rank, if the file can't be made, is damaged or belongs to another grid.
            ValueError: on every rank, if the ranks' rows do not make up the block.
        """
        self.path = Path(path)
        self._comm, self._guard, self._extra_attributes = comm, guard, extra_attributes
        self._layout = Layout(n, length, block_start, nb, surface)
        self._rows = (row_start, rows_local)
        self._inside = np.asarray(inside, dtype=bool)
        self.parallel = _writes_together(self.path, comm, parallel)
        _check_rows(comm, self._rows, nb)
        agree(comm, self._shape_problem("inside", self._inside, (rows_local, nb)))
        self.frames: int = comm.bcast(on_root(comm, f"{self.path}: could not be opened", self._open))

    def append(
        self,
        label: str,
        time: float,
        displacement: float,
        force: float,
        gap: Rows,
        traction: Rows,
        displacement_field: Rows,
        surface: tuple[np.ndarray, int] | None = None,
    ) -> None:
        """Add one snapshot; collective.

        Args:
            label: what this moment is called, up to 80 bytes of UTF-8.
            time, displacement, force: time [s], punch position [m], force on the punch [N]; rank 0's are written.
            gap, traction, displacement_field: (rows_local, nb) on this rank's rows of the block: [m], [Pa], [m]; or functions,
                collective, that make a new array of them each time: then only one of these exists at a time.
            surface: displacement [m] of this rank's rows of the whole cell, (any, n), and the first of these rows;
                needed if the file keeps surfaces.

        Raises:
            ResultError: on every rank, if it can't be written. The file is as before, or put right by the next start.
            ValueError: on every rank, if the ranks' rows of the surface do not make up the cell.
        """
        fields = self._fields(gap, traction, displacement_field, surface)
        sums = {name: self._checksum(*self._local(name, make)) for name, make in fields.items()}
        frame, what = self.frames, f"{self.path}: could not be written"

        def make_room() -> None:
            self._guard()
            fields_layout.put_back(self.path)
            size = fields_layout.reserve(self.path, self._layout.frame_bytes + BOOKKEEPING_BYTES)
            fields_layout.remember(self.path, self._layout, size)
            fields_layout.resize(self.path, self._layout, frame + 1)
            numbers = {"time": time, "punch_position": displacement, "force": force}
            fields_layout.describe(self.path, self._layout, frame, label, sums, **numbers)

        on_root(self._comm, what, make_room)
        write = self._write_together if self.parallel else self._write_gathered
        for name, make in fields.items():
            # Made before: what can fail without others must not do so within a collective write.
            agree(self._comm, attempt(what, partial(write, name, frame, *self._local(name, make)))[1])
        # Each rank: on a cluster the data may still be in its own node's memory.
        agree(self._comm, attempt(what, lambda: bring_to_disk(self.path))[1])
        on_root(self._comm, what, lambda: fields_layout.forget(self.path))
        self.frames += 1

    def truncate(self, frames: int) -> None:
        """Cut back to the first `frames` snapshots, as a checkpoint counted them; collective.

        Raises:
            ResultError: on every rank, if the file holds fewer.
        """
        if not 0 <= frames <= self.frames:
            raise ResultError(
                f"{self.path}: holds {self.frames} snapshots, can't be cut back to {frames}. Put the file back, or start "
                "anew with --fresh, which keeps the old results"
            )

        def cut() -> None:
            self._guard()
            fields_layout.remember(self.path, self._layout, self.path.stat().st_size)
            fields_layout.resize(self.path, self._layout, frames)
            fields_layout.forget(self.path)

        if frames < self.frames:
            on_root(self._comm, f"{self.path}: could not be cut back", cut)
            self.frames = frames

    def _open(self) -> int:
        self._guard()
        fields_layout.put_back(self.path)
        if not require_regular(self.path):
            fields_layout.create(self.path, self._layout, self._extra_attributes)
        return fields_layout.count_frames(self.path, self._layout)

    def _fields(
        self, gap: Rows, traction: Rows, displacement: Rows, surface: tuple[np.ndarray, int] | None
    ) -> dict[str, Producer]:
        """name -> what makes (rows of this rank, first row) of it."""
        rows = dict(zip(BLOCK_FIELDS, (gap, traction, displacement), strict=True))
        fields: dict[str, Producer] = {name: partial(self._produce, values) for name, values in rows.items()}
        if self._layout.surface:
            fields[SURFACE_FIELD] = lambda: (np.empty(0), 0) if surface is None else surface
        return fields

    def _produce(self, values: Rows) -> tuple[np.ndarray, int]:
        return self._punch_rows(values), self._rows[0]

    def _punch_rows(self, values: Rows) -> np.ndarray:
        """Rows of the block as they will be written, or as they are where their shape is wrong."""
        produced = values() if callable(values) else np.array(values, dtype=np.float64)
        produced = np.asarray(produced, dtype=np.float64)
        if produced.shape == self._inside.shape:
            np.copyto(produced, np.nan, where=~self._inside)
        return produced

    def _local(self, name: str, make: Producer) -> tuple[np.ndarray, int]:
        """Rows of this rank, and the first row, checked on all ranks."""
        values, first = make()
        wanted = self._inside.shape if name != SURFACE_FIELD else (len(values), self._layout.n)
        values = np.ascontiguousarray(values, dtype=np.float64)
        agree(self._comm, self._shape_problem(name, values, wanted))
        if name == SURFACE_FIELD:
            _check_rows(self._comm, (first, len(values)), self._layout.n)
        return values, int(first)

    def _checksum(self, values: np.ndarray, first: int) -> np.uint64:
        """Checksum of the whole array, from the shares of all ranks."""
        mine = whole_sum(values, first * values.shape[1])
        return np.array(self._comm.allgather(mine), dtype=np.uint64).sum(dtype=np.uint64)

    def _shape_problem(self, name: str, values: np.ndarray, shape: tuple[int, ...]) -> ResultError | None:
        if values.shape == shape:
            return None
        where = f"{name} on rank {self._comm.rank}"
        return ResultError(f"{self.path}: {where} has the shape {values.shape}, expected {shape}")

    def _write_together(self, name: str, frame: int, values: np.ndarray, first: int) -> None:
        with h5py.File(self.path, "r+", driver="mpio", comm=self._comm) as file:
            calls = self._calls(file[name], frame, values, first)
            problem = row_pieces.write_together(f"{self.path}: could not be written", calls)
        if problem is not None:
            raise problem

    def _calls(self, dataset: h5py.Dataset, frame: int, values: np.ndarray, first: int) -> Iterator[tuple]:
        """Dataset, rows and their place, for as many collective writes on every rank."""
        most = max(1, row_pieces.PIECE_BYTES // (8 * values.shape[1]))
        for start in range(0, max(self._comm.allgather(len(values))), most):
            yield dataset, values[start : start + most], (frame, first + start, 0)

    def _write_gathered(self, name: str, frame: int, values: np.ndarray, first: int) -> None:
        problem, what = None, f"{self.path}: could not be written"
        for start, rows in row_pieces.rows_on_root(self._comm, values, first):
            # What is left is taken in any case: the others wait until it is.
            if problem is None:
                problem = attempt(what, partial(self._write_rows, name, frame, start, rows))[1]
        if problem is not None:
            raise problem

    def _write_rows(self, name: str, frame: int, start: int, rows: np.ndarray) -> None:
        with open_serial(self.path, "r+") as file:
            file[name][frame, start : start + len(rows)] = rows


def _writes_together(path: Path, comm: Intracomm, parallel: bool | None) -> bool:
    """Whether to use MPI-IO; ResultError if it is demanded of an h5py that has none. The same on every rank."""
    has_mpi = h5py.get_config().mpi
    if parallel and not has_mpi:
        raise ResultError(f"{path}: parallel output was asked for, but this h5py has no MPI")
    if parallel is None and comm.size > 1 and not has_mpi:
        notice_once(comm)
    return (has_mpi and comm.size > 1) if parallel is None else parallel


def _check_rows(comm: Intracomm, mine: tuple[int, int], side: int) -> None:
    """ValueError on every rank, unless the ranks' (first row, rows) make up 0 ... side without gap or overlap."""
    rows = comm.allgather(tuple(map(int, mine)))
    reached = 0
    for first, count in sorted(share for share in rows if share[1]):
        if first != reached:
            break
        reached += count
    if reached != side or any(count < 0 for _, count in rows):
        raise ValueError(f"the ranks' rows (first, count) {rows} do not make up {side} rows")
