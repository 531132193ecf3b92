"""The live tables of a run, `curve.csv`, `energy.csv` and `events.csv`: units in the header, a line a row, readable at
any time."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
from dataclasses import astuple, dataclass
from pathlib import Path

from .errors import ResultError
from .storage import on_root

CURVE_COLUMNS = (
    "time [s]",
    "displacement [m]",
    "indentation [m]",
    "force [N]",
    "contact_area [m^2]",
    "u_inf [m]",
    "step [s]",
    "phase",
)
ENERGY_COLUMNS = (
    "time [s]",
    "work [J]",
    "elastic [J]",
    "adhesive [J]",
    "viscous [J]",
    "released [J]",
    "residual [J]",
)


@dataclass(frozen=True)
class CurveRow:
    """One accepted step. SI units; force positive in compression, displacement negative when pushed in."""

    time: float
    displacement: float
    indentation: float
    force: float
    contact_area: float
    u_inf: float
    step: float
    phase: str


@dataclass(frozen=True)
class EnergyRow:
    """The terms of the energy audit [J] up to `time` [s], each counted from the start of the run."""

    time: float
    work: float
    elastic: float
    adhesive: float
    viscous: float
    released: float
    residual: float


EVENT_COLUMNS = ("time [s]", "displacement [m]", "force [N]", "released [J]", "event")


@dataclass(frozen=True)
class EventRow:
    """Something that happened at an instant: the preload, the detachment, or a jump with the energy [J] it released."""

    time: float
    displacement: float
    force: float
    released: float
    event: str


class CsvFile:
    """A table that grows by whole lines, each handed to the system at once. Only rank 0 writes; all ranks call.

    A file that is already there is continued: its header must match, and a line cut short by a crash is dropped.

    Attributes:
        rows: lines in the file, without the header; the same on every rank.
        offered: rows handed in, also those that `every` left out.
    """

    def __init__(self, path: str | Path, comm, columns: tuple[str, ...], every: int = 1):
        if every < 1:
            raise ValueError(f"every = {every}: expected at least 1")
        self.path, self.every = Path(path), every
        self._comm = comm
        self._header = (",".join(columns) + "\n").encode()
        self._file = None
        self._digest = hashlib.sha256()
        self.rows = comm.bcast(on_root(comm, f"{self.path}: could not be opened", self._open))
        self.offered = self.rows

    def append(self, row: CurveRow | EnergyRow | EventRow, force_write: bool = False) -> None:
        """Write this row if its turn has come (each `every`-th, the first included) or `force_write` says so.

        Args:
            row: the values of rank 0 are written, floats with all their digits.
            force_write: the same on every rank.

        Raises:
            ResultError: on every rank, naming file and reason; the file then ends with the line before.
        """
        turn = self.offered % self.every == 0
        self.offered += 1
        if turn or force_write:
            on_root(self._comm, f"{self.path}: could not be written", lambda: self._write(_line(row)))
            self.rows += 1

    def mark(self) -> dict | None:
        """What a checkpoint has to hold of the table, which is brought to the disk for it; on rank 0, else None.

        Raises:
            ResultError: on every rank.
        """
        return on_root(self._comm, f"{self.path}: could not be brought to the disk", self._mark)

    def cut_back(self, mark: dict) -> None:
        """Cut back to what a checkpoint has marked.

        Raises:
            ResultError: on every rank, if the file does not begin with the rows that were marked.
        """
        on_root(self._comm, f"{self.path}: could not be cut back", lambda: self._cut_to(mark))
        self.rows, self.offered = mark["rows"], mark["offered"]

    def close(self) -> None:
        """Close the file; nothing is lost without it."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _open(self) -> int:
        # "a" would write at the end whatever `truncate` did before on some network file systems: seek instead.
        self._file = os.fdopen(os.open(self.path, os.O_RDWR | os.O_CREAT, 0o644), "r+b", buffering=0)
        ends = self._line_ends()
        if not ends:
            self._file.truncate(0)
            self._file.seek(0)
            self._write(self._header)
            return 0
        self._file.seek(0)
        if self._file.read(ends[0]) != self._header:
            raise ResultError(f"{self.path}: its columns are not {self._header.decode().strip()}; move it away")
        self._keep(ends[-1])
        return len(ends) - 1

    def _line_ends(self) -> list[int]:
        """Offsets just after every newline."""
        self._file.seek(0)
        return [newline.end() for newline in re.finditer(b"\n", self._file.readall())]

    def _keep(self, size: int) -> None:
        self._file.truncate(size)
        self._file.seek(0)
        self._digest = hashlib.sha256(self._file.read(size))

    def _mark(self) -> dict:
        os.fsync(self._file.fileno())
        size, digest = self._file.tell(), self._digest.hexdigest()
        return {"rows": self.rows, "offered": self.offered, "bytes": size, "sha256": digest}

    def _cut_to(self, mark: dict) -> None:
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


def begins_as_marked(path: Path, mark: dict) -> bool:
    """Whether a table begins with the rows that a checkpoint has marked. OSError if it can't be read."""
    digest, left = hashlib.sha256(), mark["bytes"]
    with open(path, "rb") as file:
        while left and (piece := file.read(min(left, 2**20))):
            digest.update(piece)
            left -= len(piece)
    return digest.hexdigest() == mark["sha256"]


def _line(row: CurveRow | EnergyRow | EventRow) -> bytes:
    values = (value if isinstance(value, str) else repr(float(value)) for value in astuple(row))
    return (",".join(values) + "\n").encode()


class CurveFile(CsvFile):
    """`curve.csv`: force, position and contact of the accepted steps (`CurveRow`)."""

    def __init__(self, path: str | Path, comm, every: int = 1):
        super().__init__(path, comm, CURVE_COLUMNS, every)


class EnergyFile(CsvFile):
    """`energy.csv`: the energy audit (`EnergyRow`)."""

    def __init__(self, path: str | Path, comm, every: int = 1):
        super().__init__(path, comm, ENERGY_COLUMNS, every)


class EventFile(CsvFile):
    """`events.csv`: jumps, the preload, the detachment (`EventRow`)."""

    def __init__(self, path: str | Path, comm):
        super().__init__(path, comm, EVENT_COLUMNS)
