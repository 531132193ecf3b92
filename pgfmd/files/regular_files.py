"""Regular files alone: nothing is read or written through what only has the name of a file. No MPI.

A folder may be one that others can write to. A link in place of a file would have any other file overwritten, and a
FIFO lets whoever opens it wait without an end. So both are refused; and what is not finished yet has a name that nobody
can guess, under which nothing may have been before.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import re
import stat
import time
import uuid
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

from pgfmd.errors import ResultError

LEFT_BEHIND = 600.0
"""Age [s] of an unfinished file that nobody is going to finish any more."""
_UNFINISHED = re.compile(r"(?P<name>.+)\.[0-9a-f]{32}\.tmp")
_KINDS: tuple[tuple[Callable[[int], bool], str], ...] = (
    (stat.S_ISLNK, "a symbolic link"), (stat.S_ISFIFO, "a FIFO"), (stat.S_ISDIR, "a folder"),
    (stat.S_ISSOCK, "a socket"),
)  # fmt: skip
_NO_FSYNC = (errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EBADF, errno.EACCES, errno.EPERM,
             errno.EISDIR)  # fmt: skip
"""What file systems answer that can't bring a folder to the disk, or don't let it be opened for that."""


def require_regular(path: Path, links: bool = False) -> bool:
    """Whether there is a file of this name.

    links: whether a link to a file will do, as it does for reading. ResultError if there is something else in its
    place; OSError.
    """
    try:
        mode = os.lstat(path).st_mode
        if links and stat.S_ISLNK(mode):
            mode = _behind(path)
    except FileNotFoundError:
        return False
    if not stat.S_ISREG(mode):
        raise _refusal(path, mode)
    return True


def _behind(path: Path) -> int:
    """The mode of what a link leads to."""
    try:
        return os.stat(path).st_mode
    except OSError as problem:
        if problem.errno in (errno.ENOENT, errno.ENOTDIR, errno.ELOOP):
            raise ResultError(f"{path}: is a symbolic link to nothing, not a file; move it away") from None
        raise


def _refusal(path: Path, mode: int) -> ResultError:
    kind = next((text for is_kind, text in _KINDS if is_kind(mode)), None)
    if kind is None:
        return ResultError(f"{path}: is a device, not a file; choose another name")
    return ResultError(f"{path}: is {kind}, not a file; move it away")


def open_regular(path: Path, flags: int) -> int:
    """A descriptor of a regular file, opened without following a link and without waiting. ResultError; OSError."""
    require_regular(path)
    # Again in the flags, as it may have been replaced in between.
    descriptor = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o644)
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        raise _refusal(path, mode)
    return descriptor


def open_folder(folder: Path) -> int:
    """A descriptor by which a folder is found again after it was renamed; -1 where it may not be read."""
    with contextlib.suppress(OSError):
        return os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    return -1


def name_of_folder(descriptor: int) -> Path | None:
    """What an open folder is called by now, where the system tells that; None for one that was deleted."""
    with contextlib.suppress(OSError):
        found = os.readlink(f"/proc/self/fd/{descriptor}")
        return Path(found) if os.path.isdir(found) else None
    return None


def unfinished_beside(path: Path) -> Path:
    """A name beside a file's own for what is going to replace it; make it with O_EXCL, as mode "x" does."""
    return path.with_name(f"{path.name}.{uuid.uuid4().hex}.tmp")


def write_atomically(path: Path, content: bytes) -> None:
    """Replace a small file in one step: temporary file, fsync, rename. The old file survives a failure.

    Raises:
        OSError: as the system reports it; the temporary file is removed.
        ResultError: if the name is that of something else than a file.
    """
    require_regular(path)
    temporary = unfinished_beside(path)
    try:
        with open(temporary, "xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_new(path: Path, text: str, force: bool = False) -> None:
    """Write a file that must not be there yet, unless `force` is set, in UTF-8. FileExistsError, OSError,
    ResultError."""
    if force:
        write_atomically(path, text.encode())
        return
    file = open(path, "x", encoding="utf-8")  # noqa: SIM115 - one that was there before must not be removed below
    try:
        with file:
            file.write(text)
    except BaseException:
        # Half a file would stand in the way of the next attempt.
        Path(path).unlink(missing_ok=True)
        raise


def write_figure(path: Path, figure: Any) -> None:
    """Replace a picture by a figure of Matplotlib, in the format of the name's ending, in one step. OSError,
    ResultError, ValueError for an unknown format."""
    image = io.BytesIO()
    figure.savefig(image, format=path.suffix.removeprefix(".") or None)
    write_atomically(path, image.getvalue())


def remove_unfinished(folder: Path, own: Collection[str] = ()) -> None:
    """Removes what processes that were killed have left unfinished in a folder.

    own: names of files that nobody else may be writing now; what would have become another one is left alone as long as
    somebody may be about to finish it. Only regular files of this user go. Never raises.
    """
    # Earlier versions put nothing between name and ending.
    earlier = {f"{name}.tmp" for name in own}
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in list(entries):
            match = _UNFINISHED.fullmatch(entry.name)
            if not (match or entry.name in earlier):
                continue
            with contextlib.suppress(OSError):
                about = entry.stat(follow_symlinks=False)
                may_go = entry.name in earlier or match["name"] in own or time.time() - about.st_mtime > LEFT_BEHIND
                if stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and may_go:
                    os.unlink(entry.path)


def bring_to_disk(path: Path) -> None:
    """Waits until a file or folder is on the disk. OSError, but for a folder of a file system that can't do that."""
    is_folder = path.is_dir()
    try:
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as problem:
        # The files in it have been brought to the disk by themselves.
        if not (is_folder and problem.errno in _NO_FSYNC):
            raise
