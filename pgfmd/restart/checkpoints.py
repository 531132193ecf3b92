"""The checkpoints of a results folder: the newest and the one before, replaced so that one always exists.

A new checkpoint is written to a temporary file. Then the newest gets its second name by a hard link, and the new one
gets the first name by a rename. So both names refer to a complete file at any moment. Collective.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.files.regular_files import bring_to_disk, require_regular, temporary_name_for
from pgfmd.files.storage import CHECKPOINT_FILE, PREVIOUS_CHECKPOINT_FILE, on_root

from . import checkpoint_file
from .checkpoint_layout import Damaged, none_valid

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


@dataclass(frozen=True)
class Saved:
    """Size [bytes] and time [s] of writing a checkpoint."""

    bytes: int
    seconds: float


class Checkpoints:
    """Saves to, and restores from, a folder.

    guard: called on rank 0 before a change; raises if the folder is no longer the one that was locked.
    """

    def __init__(self, folder: Path, comm: Intracomm, guard: Callable[[], None] = lambda: None):
        self.comm, self.guard = comm, guard
        self.newest, self.previous = folder / CHECKPOINT_FILE, folder / PREVIOUS_CHECKPOINT_FILE
        # A damaged file must not replace the one from which the run was restored.
        self._newest_is_whole = False

    def save(self, head: dict, arrays: dict[str, np.ndarray]) -> Saved:
        """Writes head (of rank 0) and arrays (this rank's shares) as the newest checkpoint.

        Raises, on every rank: RunError if a number is not finite; ResultError if the file can't be written. The earlier
        checkpoints then remain.
        """
        began = time.perf_counter()
        on_root(self.comm, f"{self.newest}: could not be written", self.guard)
        unfinished = self.comm.bcast(temporary_name_for(self.newest))
        size = checkpoint_file.write(unfinished, self.comm, head, arrays, self.newest)
        on_root(self.comm, f"{self.newest}: could not be replaced", lambda: self._rotate_or_drop(unfinished))
        self._newest_is_whole = True
        return Saved(size, time.perf_counter() - began)

    def drop_previous(self) -> None:
        """Deletes the checkpoint before the newest, which a finished run does not need. Collective."""
        on_root(self.comm, f"{self.previous}: could not be deleted", self._drop_previous)

    def _drop_previous(self) -> None:
        self.guard()
        self.previous.unlink(missing_ok=True)

    def restore(self, apply: Callable[[dict, checkpoint_file.Reader], Any], warn: Callable[[str], None]) -> Path:
        """Calls `apply` with the head and a reader of the newest valid checkpoint; returns its path.

        A damaged checkpoint is reported (`warn`, on rank 0) and skipped, so `apply` may be called twice. Raises
        ResultError on every rank if there is no valid one.
        """
        problems = []
        for path in (self.newest, self.previous):
            try:
                head = checkpoint_file.read_head(path, self.comm)
                apply(head, checkpoint_file.Reader(path, self.comm, head))
            except Damaged as damage:
                problems.append(f"{path}: {damage}")
                continue
            except (KeyError, ValueError, TypeError) as problem:
                raise ResultError(
                    f"{path}: was written by another version of pgfmd ({head.get('pgfmd')}): {problem}. Go on with that "
                    "version, or start anew with --fresh, which keeps the old results"
                ) from problem
            self._newest_is_whole = path == self.newest
            if problems and self.comm.rank == 0:
                warn(f"warning: {problems[0]}; going on from the checkpoint before it, {path.name}")
            return path
        raise none_valid(problems)

    def _rotate_or_drop(self, unfinished: Path) -> None:
        try:
            # Writing may have taken long.
            self.guard()
            self._rotate(unfinished)
        except BaseException:
            unfinished.unlink(missing_ok=True)
            raise

    def _rotate(self, unfinished: Path) -> None:
        if require_regular(self.newest) and self._newest_is_whole:
            second = temporary_name_for(self.previous)
            try:
                os.link(self.newest, second)
                second.replace(self.previous)
                # If both names belong to the same file, a rename does nothing.
                second.unlink(missing_ok=True)
            except OSError:
                # No hard links on this file system: for a moment there is only the previous one.
                with contextlib.suppress(FileNotFoundError):
                    self.newest.replace(self.previous)
        unfinished.replace(self.newest)
        bring_to_disk(self.newest.parent)
