"""The contents of a results folder: lock, heads of checkpoints, end of the curve, record. No MPI."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pgfmd.errors import ResultError
from pgfmd.files import storage
from pgfmd.files.table_reading import CurveTail, count_ends
from pgfmd.host import run_lock
from pgfmd.restart import resume
from pgfmd.restart.checkpoint_layout import Damaged, read_head

from .reading import require_folder

_HARMLESS = re.compile(rf"previous-\d+|report\.html|.*\.({'|'.join(storage.PICTURES)})")
"""Other files that may be in a folder without a run."""


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint file and its head. written [s since 1970], bytes: of the file; problem: why it is invalid, in which
    case there is no head."""

    path: Path
    written: float
    bytes: int
    head: dict[str, Any] = field(default_factory=dict)
    problem: str = ""

    @property
    def state(self) -> dict:
        """Numbers of the State in the checkpoint."""
        return self.head["state"]

    @property
    def steps(self) -> int:
        """Number of steps in the checkpoint."""
        return self.state["counters"]["steps"]

    @property
    def curve_bytes(self) -> int:
        """Size of the curve at the checkpoint."""
        return self.head["outputs"]["curve"]["bytes"]


@dataclass(frozen=True)
class Inventory:
    """checkpoints: existing ones, newest first. began [s since 1970]: time of the lock, 0 without one. tail: of the
    curve, None without one. record: of an ended run; `problem` is what is wrong with it."""

    folder: Path
    holder: run_lock.Holder | None
    began: float
    checkpoints: list[Checkpoint]
    tail: CurveTail | None
    record: dict | None
    problem: str

    @property
    def valid(self) -> Checkpoint | None:
        """The newest valid checkpoint, from which the run would continue."""
        return next((checkpoint for checkpoint in self.checkpoints if checkpoint.head), None)

    @property
    def in_use(self) -> bool:
        """Whether the lock belongs to a process that is or may be alive."""
        return self.holder is not None and self.holder.alive is not False

    @property
    def failure(self) -> str:
        """Why the run failed; empty if it did not."""
        return self.record.get("error", "failed") if self.record and self.record["finished"] == resume.FAILED else ""

    @property
    def finished(self) -> str:
        """How the run finished, from its record; empty without a record, or if it failed."""
        return self.record["finished"] if self.record and not self.failure else ""

    @property
    def why_stopped(self) -> str:
        """Why the run stopped at the newest valid checkpoint: a signal, or the time limit; empty if it was to
        continue."""
        return self.valid.head.get("why") or "" if self.valid else ""

    def rows_from(self, start: int) -> int:
        """Number of lines of the curve from an offset on."""
        return count_ends(self.tail.path, start) if self.tail else 0


def take_inventory(folder: Path) -> Inventory | None:
    """The contents of a folder; None if it has neither a run nor foreign files.

    Raises ResultError if it is not a results folder, or can't be read.
    """
    found, error = storage.attempt(f"{folder}: can't be read", lambda: _take(folder))
    if error is not None:
        raise error
    return found


def _take(folder: Path) -> Inventory | None:
    require_folder(folder)
    names = {path.name for path in folder.iterdir()}
    if not {*storage.RESULTS, run_lock.LOCK_FILE} & names:
        if all(_HARMLESS.fullmatch(name) for name in names):
            return None
        cure = "name the folder that a run wrote to"
        raise ResultError(f"{folder}: not a results folder, it has none of the files of a run; {cure}")
    storage.require_regular_files(folder, links=True)
    holder = run_lock.holder(folder)
    lock, curve = folder / run_lock.LOCK_FILE, folder / storage.CURVE_FILE
    began = lock.stat().st_mtime if holder and lock.exists() else 0.0
    checkpoints = [checkpoint for name in storage.CHECKPOINT_FILES if (checkpoint := _checkpoint(folder / name))]
    record, problem = None, ""
    try:
        record = resume.finished_record(folder)
    except ResultError as error:
        problem = str(error)
    return Inventory(folder, holder, began, checkpoints, CurveTail(curve) if curve.exists() else None, record, problem)


def _checkpoint(path: Path) -> Checkpoint | None:
    """The checkpoint of this name; None if there is none. While it is being replaced, either version is read."""
    try:
        about = path.stat()
        head = require_known(read_head(path))
    except FileNotFoundError:
        return None
    except Damaged as damage:
        return Checkpoint(path, about.st_mtime, about.st_size, problem=str(damage))
    return Checkpoint(path, about.st_mtime, about.st_size, head)


def require_known(head: dict) -> dict:
    """The head, if it has everything that is used here. Raises Damaged for a head of an incompatible version."""
    try:
        _ = (head["scene"], head["state"]["counters"]["steps"], head["outputs"]["fields"]["frames"],
             head["outputs"]["curve"]["bytes"], head["links"][-1]["first_step"])  # fmt: skip
    except (KeyError, TypeError, IndexError) as missing:
        raise Damaged(f"of another version of pgfmd ({head.get('pgfmd')}): it has no {missing}") from missing
    return head
