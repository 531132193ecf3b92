"""The results folder: created before the first step, never overwritten; and the agreement of ranks on errors.

Only rank 0 uses the folder here. An error there is raised on every rank with the same text, so that no rank continues
to a collective call that the others never reach.
"""

from __future__ import annotations

import errno
import json
import math
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from pgfmd.errors import ResultError

from .regular_files import open_regular, require_regular, write_atomically

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

CURVE_FILE = "curve.csv"
ENERGY_FILE = "energy.csv"
EVENTS_FILE = "events.csv"
PATCHES_FILE = "patches.csv"
SITES_FILE = "sites.csv"
FIELDS_FILE = "fields.h5"
RUN_FILE = "run.json"
ANALYSIS_FILE = "analysis.json"
REPORT_FILE = "report.html"
SCENE_FILE = "scene.resolved.toml"
CHECKPOINT_FILE = "checkpoint.h5"
PREVIOUS_CHECKPOINT_FILE = "checkpoint.previous.h5"
CHECKPOINT_FILES = (CHECKPOINT_FILE, PREVIOUS_CHECKPOINT_FILE)
"""Newest first."""
UNDO_SUFFIX = ".undo"
RESULTS = (*CHECKPOINT_FILES, RUN_FILE, ANALYSIS_FILE, ENERGY_FILE, EVENTS_FILE, PATCHES_FILE, SITES_FILE,
           FIELDS_FILE + UNDO_SUFFIX, FIELDS_FILE, SCENE_FILE, CURVE_FILE)  # fmt: skip
"""The files of a run, in the order in which they are moved away: if this is interrupted, the rest must not look like a
run that can be continued, nor, as long as there is a curve, like an empty folder."""

CHECKPOINT_COPIES = 3
"""Number of checkpoints that exist at the same time: the newest, the one before, and the one being written."""
PICTURES = ("png", "pdf", "svg", "mp4", "gif")
"""Suffixes of pictures and movies, which are drawn into the folder of a run."""

Value = TypeVar("Value")


def reason(error: BaseException) -> str:
    """The cause of an error in a few words: the system's own message if there is one."""
    if isinstance(error, OSError) and error.errno and error.strerror:
        return os.strerror(error.errno)
    return str(error) or type(error).__name__


def agree(comm: Intracomm, error: Exception | None) -> None:
    """Ends an operation that may have failed on some ranks: returns on all ranks, or raises the same ResultError on
    all.

    Args:
        comm: the communicator; collective over it.
        error: of this rank, or None. The error of the lowest rank is raised.

    Raises:
        ResultError: if any rank failed.
    """
    # With one rank there is nothing to agree on, and an MPI call takes longer than writing a line.
    if not (comm.allreduce(0 if error is None else 1) if comm.size > 1 else error):
        return
    texts = comm.allgather(None if error is None else reason(error))
    raise ResultError(next(text for text in texts if text is not None)) from error


def attempt(what: str, action: Callable[[], Value]) -> tuple[Value | None, ResultError | None]:
    """The result of `action`, or its error as a ResultError that begins with `what`, for `agree`."""
    try:
        return action(), None
    except ResultError as problem:
        return None, problem
    except (OSError, RuntimeError, ValueError, KeyError) as problem:
        error = ResultError(f"{what}: {reason(problem)}")
        error.__cause__ = problem
        return None, error


def on_root(comm: Intracomm, what: str, action: Callable[[], Value]) -> Value | None:
    """Calls `action` on rank 0 and agrees that it worked; returns its result on rank 0, None on other ranks.

    Args:
        comm: the communicator; collective over it.
        what: beginning of the message if it fails, such as "out/curve.csv: could not be written".

    Raises:
        ResultError: on every rank, with `what` and the reason; a ResultError of the action keeps its own text.
    """
    result, error = attempt(what, action) if comm.rank == 0 else (None, None)
    agree(comm, error)
    return result


def require_regular_files(directory: Path, links: bool = False) -> None:
    """Raises ResultError if anything in a results folder with the name of a run's file is not a regular file.

    links: whether links to files will do, as they do for reading.
    """
    for name in RESULTS:
        require_regular(directory / name, links)


def make_directory(path: Path) -> None:
    """Make the results folder, and those above it, and prove that it can be written. OSError if it can't."""
    path.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=path) as probe:
        probe.write(b"probe")


def set_aside(directory: Path) -> Path | None:
    """Move the results in a folder to a folder `previous-<k>` within it, which is returned; None without results."""
    # What only has the name of a file too, such as a link to nothing.
    old = [directory / name for name in RESULTS if os.path.lexists(directory / name)]
    if not old:
        return None
    target = next(folder for k in range(1, 10**6) if not os.path.lexists(folder := directory / f"previous-{k}"))
    target.mkdir()
    pictures = [path for path in sorted(directory.iterdir()) if path.suffix.removeprefix(".") in PICTURES]
    for file in (*old, *pictures, *directory.glob(REPORT_FILE)):
        file.rename(target / file.name)
    return target


def require_space(folder: Path, checkpoint_bytes: int, snapshot_bytes: int) -> None:
    """Raises ResultError if there is not enough space for checkpoints (of this size each) and snapshots (in total).
    Files that already exist in the folder of a continued run count as space."""
    about = shutil.disk_usage(folder)
    if about.total == 0:
        # Some file systems in user space do not report their free space. A full disk is then detected when it is full.
        return
    free = about.free + sum(file.stat().st_size for file in folder.iterdir() if file.suffix == ".h5")
    needed = CHECKPOINT_COPIES * checkpoint_bytes + snapshot_bytes
    if needed > free:
        raise ResultError(
            f"{folder}: the run needs {needed / 1e9:.3g} GB of disk space ({CHECKPOINT_COPIES} checkpoints of "
            f"{checkpoint_bytes / 1e9:.3g} GB, and snapshots), but only {free / 1e9:.3g} GB are free. Make room, choose "
            "another --out, or take fewer output.snapshots"
        )


def secure_space(path: Path, start: int, size: int) -> None:
    """Make sure that the disk has room for `size` bytes of the file from `start` on.

    Raises:
        OSError: if it has not.
    """
    if size <= 0 or not hasattr(os, "posix_fallocate"):
        return
    with os.fdopen(open_regular(path, os.O_RDWR), "r+b") as file:
        try:
            os.posix_fallocate(file.fileno(), start, size)
        except OSError as problem:
            if problem.errno not in (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS):
                raise


def require_record(path: Path, found: Any) -> dict[str, Any]:
    """What was read from `run.json`, if it is the record of a run that has ended; else ResultError."""
    if not isinstance(found, dict) or not isinstance(found.get("finished"), str):
        raise ResultError(f"{path}: damaged: it does not say how a run has finished; move it away")
    return found


def write_run_json(
    path: str | Path, comm: Intracomm, record: dict[str, Any], guard: Callable[[], None] = lambda: None
) -> None:
    """Write the record of a run, keys in the order given; numbers that are not finite become null.

    Args:
        path: the file. comm: the communicator; collective over it, the record of rank 0 is written.
        record: nested dicts and sequences of numbers (NumPy ones too), text, booleans, None and paths.
        guard: called on rank 0 before; raises if the folder is no longer the one that it was.

    Raises:
        ResultError: on every rank, if it can't be written; the file of before is then unharmed.
    """
    path = Path(path)

    def write() -> None:
        guard()
        try:
            text = json.dumps(plain(record), indent=2, ensure_ascii=False, allow_nan=False)
        except TypeError as problem:
            raise ResultError(f"{path}: could not be written: {problem}") from problem
        write_atomically(path, f"{text}\n".encode())

    on_root(comm, f"{path}: could not be written", write)


def plain(value: Any) -> Any:
    """A value as JSON knows it: NumPy numbers and arrays, tuples and paths unwrapped, NaN and infinity as None."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
