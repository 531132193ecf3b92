"""What is in a results folder: the lock, the heads of the checkpoints, the end of the curve, the record. No MPI."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from pgfmd.errors import ResultError
from pgfmd.files import storage
from pgfmd.files.table_reading import CurveTail, count_ends
from pgfmd.host import run_lock
from pgfmd.restart import resume
from pgfmd.restart.checkpoint_layout import Damaged, read_head

from .reading import require_folder

_HARMLESS = re.compile(r"previous-\d+|.*\.png")
"""What a folder may hold besides, and still have no run."""


@dataclass(frozen=True)
class Checkpoint:
    """A checkpoint file and its head. written [s since 1970], bytes: of the file; problem: why it is not valid, then
    there is no head."""

    path: Path
    written: float
    bytes: int
    head: dict | None = None
    problem: str = ""

    @property
    def state(self) -> dict:
        """Numbers of the State then."""
        return self.head["state"]

    @property
    def steps(self) -> int:
        """Steps of the run until then."""
        return self.state["counters"]["steps"]

    @property
    def curve_bytes(self) -> int:
        """Size of the curve then."""
        return self.head["outputs"]["curve"]["bytes"]


@dataclass(frozen=True)
class Inventory:
    """checkpoints: those that are there, newest first. began [s since 1970]: when the lock was taken, 0 without one.
    tail: of the whole curve, None without one. record: of a run that ended; `problem` is what is wrong with it."""

    folder: Path
    holder: run_lock.Holder | None
    began: float
    checkpoints: list[Checkpoint]
    tail: CurveTail | None
    record: dict | None
    problem: str

    @property
    def valid(self) -> Checkpoint | None:
        """The newest valid checkpoint: from it the run goes on."""
        return next((checkpoint for checkpoint in self.checkpoints if checkpoint.head), None)

    @property
    def in_use(self) -> bool:
        """Whether a live process holds the lock, or one that may be alive."""
        return self.holder is not None and self.holder.alive is not False

    @property
    def failure(self) -> str:
        """Why the run failed; empty if it did not."""
        return self.record.get("error", "failed") if self.record and self.record["finished"] == resume.FAILED else ""

    @property
    def finished(self) -> str:
        """How the run finished, as its record says; empty if it has none, or failed."""
        return self.record["finished"] if self.record and not self.failure else ""

    @property
    def why_stopped(self) -> str:
        """What the newest valid checkpoint was written for at last: a signal, a limit of time; empty if the run was to
        go on."""
        return self.valid.head.get("why") or "" if self.valid else ""

    def rows_from(self, start: int) -> int:
        """Lines of the curve from an offset on."""
        return count_ends(self.tail.path, start) if self.tail else 0


def take_inventory(folder: Path) -> Inventory | None:
    """What is in a folder; None if there is no run in it, nor anything else that does not belong there.

    Raises ResultError if it is no results folder, or can't be read.
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
    """The checkpoint of a name; None if there is none. One that is being replaced is read as it was, or as it is."""
    try:
        about = path.stat()
        head = require_known(read_head(path))
    except FileNotFoundError:
        return None
    except Damaged as damage:
        return Checkpoint(path, about.st_mtime, about.st_size, problem=str(damage))
    return Checkpoint(path, about.st_mtime, about.st_size, head)


def require_known(head: dict) -> dict:
    """The head, if it has what is used here. Damaged if another version of pgfmd has written it otherwise."""
    try:
        _ = (head["scene"], head["state"]["counters"]["steps"], head["outputs"]["fields"]["frames"],
             head["outputs"]["curve"]["bytes"], head["links"][-1]["first_step"])  # fmt: skip
    except (KeyError, TypeError, IndexError) as missing:
        raise Damaged(f"of another version of pgfmd ({head.get('pgfmd')}): it has no {missing}") from missing
    return head
