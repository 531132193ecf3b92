"""Reading and writing regular files only, not links, FIFOs or devices. No MPI.

Other users may be able to write to a folder. A link in place of a file could redirect writing to any other file, and
opening a FIFO could block for ever. So both are refused, and temporary files have unpredictable names that must not
exist before.
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
"""Age [s] from which on a temporary file is abandoned."""
_UNFINISHED = re.compile(r"(?P<name>.+)\.[0-9a-f]{32}\.tmp")
_KINDS: tuple[tuple[Callable[[int], bool], str], ...] = (
    (stat.S_ISLNK, "a symbolic link"), (stat.S_ISFIFO, "a FIFO"), (stat.S_ISDIR, "a folder"),
    (stat.S_ISSOCK, "a socket"),
)  # fmt: skip
_NO_FSYNC = (errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EBADF, errno.EACCES, errno.EPERM,
             errno.EISDIR)  # fmt: skip
"""Errors of file systems that can't flush a folder, or can't open it for that."""

_NO_LINKS = (errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK, errno.EACCES)
"""Errors of file systems on which a file has one name only."""


def require_regular(path: Path, links: bool = False) -> bool:
    """Whether there is a file of this name.

    links: whether a link to a file is accepted, as for reading. Raises ResultError if it is something else, and
    OSError.
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
    """The mode of the target of a link."""
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
    """A descriptor of a regular file, opened without following links and without blocking. Raises ResultError,
    OSError."""
    require_regular(path)
    # Also in the flags, because the file may have been replaced in between.
    descriptor = os.open(path, flags | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o644)
    mode = os.fstat(descriptor).st_mode
    if not stat.S_ISREG(mode):
        os.close(descriptor)
        raise _refusal(path, mode)
    return descriptor


def open_folder(folder: Path) -> int:
    """A descriptor of a folder, which stays valid after a rename; -1 if it may not be read."""
    with contextlib.suppress(OSError):
        return os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    return -1


def name_of_folder(descriptor: int) -> Path | None:
    """The present name of an open folder, if the system provides it; None for a deleted one."""
    with contextlib.suppress(OSError):
        found = os.readlink(f"/proc/self/fd/{descriptor}")
        return Path(found) if os.path.isdir(found) else None
    return None


def temporary_name_for(path: Path) -> Path:
    """A temporary name for the replacement of a file; to be created with O_EXCL, as by mode "x"."""
    return path.with_name(f"{path.name}.{uuid.uuid4().hex}.tmp")


def write_atomically(path: Path, content: bytes) -> None:
    """Replaces a small file atomically: temporary file, fsync, rename. The old file survives a failure.

    Raises:
        OSError: as the system reports it; the temporary file is removed.
        ResultError: if the name belongs to something other than a file.
    """
    require_regular(path)
    temporary = temporary_name_for(path)
    try:
        with open(temporary, "xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_new(path: Path, content: str | bytes, force: bool = False) -> None:
    """Writes a new file, texts in UTF-8; replaces an existing one if `force` is set. Its name appears with the whole content
    only. Raises FileExistsError, OSError, ResultError."""
    content = content.encode() if isinstance(content, str) else content
    if force:
        write_atomically(path, content)
        return
    taken = FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), str(path))
    if os.path.lexists(path):
        raise taken
    temporary = temporary_name_for(path)
    try:
        with open(temporary, "xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        try:
            # Unlike a rename, it never replaces what another process has written meanwhile.
            os.link(temporary, path)
        except FileExistsError:
            raise taken from None
        except OSError as problem:
            if problem.errno not in _NO_LINKS:
                raise
            if os.path.lexists(path):
                raise taken from None
            temporary.rename(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_figure(path: Path, figure: Any) -> None:
    """Writes a Matplotlib figure atomically, in the format of the name's suffix. Raises OSError, ResultError, and
    ValueError for an unknown format."""
    image = io.BytesIO()
    figure.savefig(image, format=path.suffix.removeprefix(".") or None)
    write_atomically(path, image.getvalue())


def remove_unfinished(folder: Path, own: Collection[str] = ()) -> None:
    """Removes temporary files of killed processes from a folder.

    own: names of files that no other process can be writing now. Temporary files for other names are kept as long as a
    process may be about to finish them. Only regular files of this user are removed. Never raises.
    """
    # Temporary files of earlier versions have no digits.
    earlier = {f"{name}.tmp" for name in own}
    with contextlib.suppress(OSError), os.scandir(folder) as entries:
        for entry in list(entries):
            match = _UNFINISHED.fullmatch(entry.name)
            if match is None and entry.name not in earlier:
                continue
            with contextlib.suppress(OSError):
                about = entry.stat(follow_symlinks=False)
                ours = entry.name in earlier or (match is not None and match["name"] in own)
                may_go = ours or time.time() - about.st_mtime > LEFT_BEHIND
                if stat.S_ISREG(about.st_mode) and about.st_uid == os.geteuid() and may_go:
                    os.unlink(entry.path)


def bring_to_disk(path: Path) -> None:
    """Flushes a file or folder to the disk. Raises OSError, except for a folder of a file system that can't do this."""
    is_folder = path.is_dir()
    try:
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
    except OSError as problem:
        # The files in it have been flushed themselves.
        if not (is_folder and problem.errno in _NO_FSYNC):
            raise
