"""The file `run.lock`, which allows only one run at a time in a results folder. No MPI; for rank 0.

A lock is written to a temporary file and linked to its name, so that nobody sees an incomplete one. In addition the
file stays open and locked (`flock`) while the process lives, if the file system supports it; the kernel releases it
when the process dies. The lock of a dead run is stale. It is replaced by a rename, by the process that holds its
`flock`, so that only one of several processes succeeds.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import getpass
import json
import os
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pgfmd.errors import ResultError
from pgfmd.files.regular_files import name_of_folder, open_folder, open_regular, remove_unfinished, temporary_name_for
from pgfmd.files.storage import reason

from . import batch
from .mounts import has_common_locks
from .processes import Process

LOCK_FILE = "run.lock"
_MEETING = 2.0
"""Time [s] that a process waits for another one to finish taking over a stale lock."""
_SETTLING = 1.0
"""Time [s] after which, without `flock`, the last process that replaced a stale lock owns it."""


@dataclass(frozen=True)
class Holder:
    """The owner of a lock. job: "Slurm job 4711", or "". since: local time as text. alive: None if unknown."""

    host: str
    pid: int
    job: str
    since: str
    user: str
    ranks: int
    alive: bool | None

    def __str__(self) -> str:
        if not self.pid:
            return "a run that can't be named, as its lock is damaged"
        job = f", {self.job}" if self.job else ""
        return f"process {self.pid} on {self.host}{job}, of {self.user}, since {self.since}"


class RunLock:
    """The lock of a results folder, held by this process.

    Attributes:
        recovered: "", or a line about the stale lock that was taken over.
    """

    def __init__(self, path: Path, descriptor: int, recovered: str):
        self._path, self._descriptor, self.recovered = path, descriptor, recovered
        self._place = open_folder(path.parent)
        self._owner = os.getpid()

    @classmethod
    def acquire(cls, folder: Path, ranks: int) -> RunLock:
        """Locks a folder for a run on this number of ranks.

        Raises:
            ResultError: if another run holds the lock, or may hold it; if the lock can't be written.
        """
        path = Path(folder) / LOCK_FILE
        aside = temporary_name_for(path)
        descriptor = -1
        try:
            descriptor = os.open(aside, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
            guarded = _lock(descriptor) is True
            text = json.dumps(_about(ranks, guarded), indent=2) + "\n"
            os.write(descriptor, text.encode())
            recovered = _enter(path, aside, text)
        except BaseException as problem:
            with contextlib.suppress(OSError):
                os.close(descriptor)
            if isinstance(problem, OSError):
                raise ResultError(f"{path}: could not be written: {reason(problem)}") from problem
            raise
        finally:
            with contextlib.suppress(OSError):
                aside.unlink()
        remove_unfinished(path.parent)
        return cls(path, descriptor, recovered)

    def require_held(self) -> None:
        """Raises ResultError if the folder of this name is not the locked one any more: it may belong to another run.
        Raises OSError if this can't be determined."""
        if not _is_at(self._descriptor, self._path):
            folder, now = self._path.parent, name_of_folder(self._place)
            there = f"its {LOCK_FILE} is another one's" if os.path.lexists(self._path) else f"there is no {LOCK_FILE}"
            moved = f"The run's own folder is {now} now. " if now and now != folder.resolve() else ""
            raise ResultError(
                f"{folder}: no longer the folder that this run has locked, {there}: it was renamed, replaced, or its lock "
                f"removed while the run went on. {moved}The run ends here and writes nothing more; from the last checkpoint "
                "the same command goes on, with --out and the name that the folder has now"
            )

    def release(self) -> None:
        """Removes the lock if it still belongs to this process; never raises."""
        if self._descriptor < 0 or self._owner != os.getpid():
            return
        # This also works if the folder was renamed.
        now = name_of_folder(self._place)
        for path in (self._path, *([now / LOCK_FILE] if now else [])):
            with contextlib.suppress(OSError):
                if _is_at(self._descriptor, path):
                    path.unlink()
        for descriptor in (self._descriptor, self._place):
            with contextlib.suppress(OSError):
                os.close(descriptor)
        self._descriptor = self._place = -1


def holder(folder: Path) -> Holder | None:
    """The owner of the lock in a folder; None if there is no lock. Raises OSError if it can't be read."""
    try:
        descriptor = open_regular(Path(folder) / LOCK_FILE, os.O_RDONLY)
    except FileNotFoundError:
        return None
    try:
        return _holder_in(_text(descriptor), Path(folder), _lock(descriptor, shared=True))
    finally:
        os.close(descriptor)


def _about(ranks: int, guarded: bool) -> dict[str, Any]:
    """The contents of a new lock; guarded: whether its file is also locked with `flock`."""
    job = batch.this_job()
    return {
        **asdict(Process.this()),
        "job": asdict(job) if job else None,
        "user": _user(),
        "ranks": ranks,
        "since": time.strftime("%Y-%m-%d %H:%M:%S"),
        "command": sys.argv,
        "guarded": guarded,
    }


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        # A user id without a name, as in containers.
        return str(os.getuid())


def _enter(path: Path, aside: Path, text: str) -> str:
    """Gives a prepared lock its name; returns a line about the replaced one. Raises ResultError if the lock is not
    stale."""
    latest = time.monotonic() + _MEETING
    while not _linked(aside, path):
        try:
            found = _open(path)
        except FileNotFoundError:
            continue
        try:
            # Held from here to the rename, so that no other process replaces this file.
            free = _lock(found)
            before = _text(found)
            there = _holder_in(before, path.parent, free)
            if not _is_at(found, path):
                continue
            if there.alive is False:
                os.replace(aside, path)
                if free is None and not _prevails(path, text):
                    raise ResultError(f"{path.parent}: another run was started in it at the same time")
                return f"the lock of a run that is gone was taken over: {there}" if before else ""
            # An unknown owner may be another process that is about to replace the lock.
            if free is not False or time.monotonic() > latest or _process_in(_parsed(before)).is_alive():
                raise _refusal(path, there)
        finally:
            os.close(found)
        time.sleep(0.02)
    return ""


def _linked(aside: Path, path: Path) -> bool:
    """Links a file to a second name; False if that exists."""
    try:
        os.link(aside, path)
        return True
    except FileExistsError:
        # It may be our own: over a network, the reply to a first attempt may have been lost.
        with contextlib.suppress(OSError):
            return aside.samefile(path)
        return False
    except OSError as problem:
        if problem.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK):
            raise
    # This file system has no hard links: create an empty file, which is then replaced by the first process.
    with contextlib.suppress(FileExistsError):
        os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o644))
    return False


def _open(path: Path) -> int:
    try:
        # NFS gives exclusive locks only to writers.
        return open_regular(path, os.O_RDWR)
    except PermissionError:
        return open_regular(path, os.O_RDONLY)


def _lock(descriptor: int, shared: bool = False) -> bool | None:
    """Locks an open file. True: done; False: another process has it; None: not supported by the file system."""
    try:
        fcntl.flock(descriptor, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return None
    return True


def _text(descriptor: int) -> str:
    return os.pread(descriptor, 2**20, 0).decode(errors="replace")


def _is_at(descriptor: int, path: Path) -> bool:
    """Whether this open file still has this name."""
    with contextlib.suppress(FileNotFoundError, NotADirectoryError):
        return os.path.samestat(os.fstat(descriptor), path.lstat())
    return False


def _prevails(path: Path, text: str) -> bool:
    time.sleep(_SETTLING)
    return path.read_text(encoding="utf-8") == text


def _parsed(text: str) -> dict[str, Any]:
    """The contents of a lock; {} if it is damaged."""
    try:
        found = json.loads(text)
        return found if isinstance(found, dict) and _process_in(found).pid else {}
    except ValueError:
        return {}


def _process_in(found: dict[str, Any]) -> Process:
    """The process named in a lock; pid 0 if there is none."""
    host, pid, started, boot = (found.get(name) for name in ("host", "pid", "started", "boot"))
    if not (isinstance(host, str) and isinstance(pid, int) and isinstance(started, int | None)):
        return Process("", 0, None, "")
    return Process(host, pid, started, str(boot or ""))


def _holder_in(text: str, folder: Path, free: bool | None) -> Holder:
    """The owner named in a lock; free: whether its file was unlocked, None if unknown."""
    found = _parsed(text)
    process, job = _process_in(found), _job_in(found)
    if free is False:
        alive: bool | None = True
    elif not found:
        alive = False
    else:
        alive = process.is_alive()
        if alive is None and free and found.get("guarded") and has_common_locks(folder):
            alive = False
        # Batch systems may hide the jobs of others.
        if alive is None and job and found.get("user") == _user() and batch.is_over(job):
            alive = False
    named = {name: str(found.get(name, "")) for name in ("since", "user")}
    ranks = found.get("ranks")
    return Holder(process.host, process.pid, str(job or ""), ranks=ranks if isinstance(ranks, int) else 0, alive=alive,
                  **named)  # fmt: skip


def _job_in(found: dict[str, Any]) -> batch.Job | None:
    with contextlib.suppress(TypeError):
        return batch.Job(**found["job"]) if found.get("job") else None
    return None


def _refusal(path: Path, there: Holder) -> ResultError:
    if there.alive:
        return ResultError(f"{path.parent}: in use by {there}. Wait until it has ended, or choose another folder")
    return ResultError(
        f"{path.parent}: in use by {there}, as far as can be told from here. If that run is gone, remove {path}"
    )
