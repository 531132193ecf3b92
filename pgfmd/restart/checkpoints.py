"""The checkpoints of a results folder: the newest and the one before, replaced so that one is always there.

A new one is written beside them. Then the newest gets its second name (a hard link), and the new one takes its first:
at no moment is there a name without a whole file behind it. Collective.
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
from pgfmd.files.regular_files import bring_to_disk, require_regular, unfinished_beside
from pgfmd.files.storage import CHECKPOINT_FILE, PREVIOUS_CHECKPOINT_FILE, on_root

from . import checkpoint_file
from .checkpoint_layout import Damaged, none_valid

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm


@dataclass(frozen=True)
class Saved:
    """A checkpoint that was written: its size, and the time [s] that it took."""

    bytes: int
    seconds: float


class Checkpoints:
    """Saves to, and restores from, a folder.

    guard: called on rank 0 before anything there is changed; raises if the folder is no longer the one that it was.
    """

    def __init__(self, folder: Path, comm: Intracomm, guard: Callable[[], None] = lambda: None):
        self.comm, self.guard = comm, guard
        self.newest, self.previous = folder / CHECKPOINT_FILE, folder / PREVIOUS_CHECKPOINT_FILE
        # A file that could not be restored from must not take the place of the one that could.
        self._newest_is_whole = False

    def save(self, head: dict, arrays: dict[str, np.ndarray]) -> Saved:
        """Makes head (rank 0's) and arrays (this rank's shares) the newest checkpoint.

        RunError on every rank where a number is not finite, ResultError on every rank where it can't be written; the
        checkpoints of before are unharmed.
        """
        began = time.perf_counter()
        on_root(self.comm, f"{self.newest}: could not be written", self.guard)
        unfinished = self.comm.bcast(unfinished_beside(self.newest))
        size = checkpoint_file.write(unfinished, self.comm, head, arrays, self.newest)
        on_root(self.comm, f"{self.newest}: could not be replaced", lambda: self._rotate_or_drop(unfinished))
        self._newest_is_whole = True
        return Saved(size, time.perf_counter() - began)

    def drop_previous(self) -> None:
        """Deletes the checkpoint before the newest: a run that is finished needs it no more. Collective."""
        on_root(self.comm, f"{self.previous}: could not be deleted", self._drop_previous)

    def _drop_previous(self) -> None:
        self.guard()
        self.previous.unlink(missing_ok=True)

    def restore(self, apply: Callable[[dict, checkpoint_file.Reader], Any], warn: Callable[[str], None]) -> Path:
        """Has `apply` take the state from the newest valid checkpoint, by its head and a reader of its arrays; returns
        its path.

        A damaged one is told of (`warn`, on rank 0) and passed over: `apply` may be called twice. ResultError on every
        rank if there is no valid one.
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
            second = unfinished_beside(self.previous)
            try:
                os.link(self.newest, second)
                second.replace(self.previous)
                # A rename of one name of a file to another of its names does nothing.
                second.unlink(missing_ok=True)
            except OSError:
                # No hard links on this file system: for a moment there is only the previous one.
                with contextlib.suppress(FileNotFoundError):
                    self.newest.replace(self.previous)
        unfinished.replace(self.newest)
        bring_to_disk(self.newest.parent)
