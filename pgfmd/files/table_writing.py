"""A table that grows by whole lines, readable at any time, and can be cut back to what a checkpoint knows."""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pgfmd.errors import ResultError

from .regular_files import open_regular
from .storage import on_root
from .tables import Table

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

PIECE = 2**20
"""Bytes that are read at a time: tables may be of any length."""


class TableFile:
    """A table that grows by whole lines, each handed to the system at once. Only rank 0 writes; all ranks call.

    A file that is already there is continued, with the columns that it has: its header must be one of the table's layouts,
    and a line cut short by a crash is dropped.

    Attributes:
        table: its declaration.
        rows: lines in the file, without the header; the same on every rank.
        offered: rows handed in, also those that `every` left out.
        skipped: whether the last of them was left out.
    """

    def __init__(self, table: Table, path: str | Path, comm: Intracomm, every: int = 1):
        """every: of the rows that `append` is given, each which is written."""
        if every < 1:
            raise ValueError(f"every = {every}: expected at least 1")
        self.table, self.path, self.every = table, Path(path), every
        self._comm = comm
        self._columns, self._header = table.columns, table.headers[0].encode()
        self._file: Any = None
        self._digest = hashlib.sha256()
        self.rows = comm.bcast(on_root(comm, f"{self.path}: could not be opened", self._open))
        self.offered, self.skipped = self.rows, False

    def append(self, row: Any, force_write: bool = False, before: Any = None) -> None:
        """Write this row if its turn has come (each `every`-th, the first included) or `force_write` says so.

        Args:
            row: one of the table's; that of rank 0 is written.
            force_write: the same on every rank.
            before: the last row, to be written first if it was left out and this one is written by force; or None.

        Raises:
            ResultError: on every rank, naming file and reason; the file then ends with the line before.
        """
        turn = self.offered % self.every == 0
        self.offered += 1
        if turn or force_write:
            self._hand_over([before, row] if force_write and self.skipped and before is not None else [row])
        self.skipped = not (turn or force_write)

    def extend(self, rows: Sequence[Any]) -> None:
        """Write these rows, as many on every rank, in one go and whatever `every` is.

        Raises:
            ResultError: on every rank, naming file and reason; the file is then as it was.
        """
        if rows:
            self.offered += len(rows)
            self._hand_over(rows)

    def _hand_over(self, rows: Sequence[Any]) -> None:
        what = f"{self.path}: could not be written"
        on_root(
            self._comm, what, lambda: self._write("".join(self.table.line(row, self._columns) for row in rows).encode())
        )
        self.rows += len(rows)

    def mark(self) -> dict[str, Any] | None:
        """What a checkpoint has to hold of the table, which is brought to the disk for it; on rank 0, else None.

        Raises:
            ResultError: on every rank.
        """
        return on_root(self._comm, f"{self.path}: could not be brought to the disk", self._mark)

    def cut_back(self, mark: dict[str, Any]) -> None:
        """Cut back to what a checkpoint has marked.

        Raises:
            ResultError: on every rank, if the file does not begin with the rows that were marked.
        """
        on_root(self._comm, f"{self.path}: could not be cut back", lambda: self._cut_to(mark))
        self.rows, self.offered, self.skipped = mark["rows"], mark["offered"], mark["skipped"]

    def close(self) -> None:
        """Close the file; nothing is lost without it."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _open(self) -> int:
        # "a" would write at the end whatever `truncate` did before on some network file systems: seek instead.
        self._file = os.fdopen(open_regular(self.path, os.O_RDWR | os.O_CREAT), "r+b", buffering=0)
        count, end = self._lines()
        if not count:
            self._file.truncate(0)
            self._file.seek(0)
            self._write(self._header)
            return 0
        self._file.seek(0)
        start = self._file.read(len(self._header))
        layouts = zip(self.table.layouts, self.table.headers, strict=True)
        known = [(columns, header.encode()) for columns, header in layouts if start.startswith(header.encode())]
        if not known:
            raise ResultError(f"{self.path}: its columns are not {self._header.decode().strip()}; move it away")
        self._columns, self._header = known[0]
        self._keep(end)
        return count - 1

    def _lines(self) -> tuple[int, int]:
        """How many newlines there are, and the offset just after the last."""
        count = end = position = 0
        self._file.seek(0)
        while piece := self._file.read(PIECE):
            count += piece.count(b"\n")
            if b"\n" in piece:
                end = position + piece.rindex(b"\n") + 1
            position += len(piece)
        return count, end

    def _keep(self, size: int) -> None:
        self._file.truncate(size)
        self._file.seek(0)
        self._digest = hashlib.sha256()
        while piece := self._file.read(PIECE):
            self._digest.update(piece)

    def _mark(self) -> dict[str, Any]:
        os.fsync(self._file.fileno())
        size, digest = self._file.tell(), self._digest.hexdigest()
        return {
            "rows": self.rows, "offered": self.offered, "skipped": self.skipped, "bytes": size, "sha256": digest
        }  # fmt: skip

    def _cut_to(self, mark: dict[str, Any]) -> None:
        if not begins_as_marked(self.path, mark):
            raise ResultError(
                f"{self.path}: can't be continued: its first {mark['rows']} rows are not those that the checkpoint knows. "
                "Put the file back, or start anew with --fresh, which keeps the old results"
            )
        self._keep(mark["bytes"])

    def _write(self, line: bytes) -> None:
        if self._file is None:
            raise ResultError(f"{self.path}: could not be written: the file is closed")
        start, rest = self._file.tell(), memoryview(line)
        try:
            while rest:
                rest = rest[self._file.write(rest) :]
        except OSError:
            # A disk that fills up takes part of a line; half a number must not pass for a whole one.
            with contextlib.suppress(OSError):
                self._keep(start)
            raise
        self._digest.update(line)


def begins_as_marked(path: Path, mark: dict[str, Any]) -> bool:
    """Whether a table begins with the rows that a checkpoint has marked. OSError if it can't be read."""
    digest, left = hashlib.sha256(), mark["bytes"]
    with open(path, "rb") as file:
        while left and (piece := file.read(min(left, PIECE))):
            digest.update(piece)
            left -= len(piece)
    return bool(digest.hexdigest() == mark["sha256"])
