"""Whether `flock` on a file works across hosts, or only on the same host."""

from __future__ import annotations

import os
import re
from pathlib import Path

_LOCAL = ("ext2", "ext3", "ext4", "xfs", "btrfs", "zfs", "f2fs", "jfs", "bcachefs", "tmpfs", "overlay")
_SHARED = ("nfs", "nfs4", "gpfs", "ceph")
_MOUNTS = Path("/proc/self/mountinfo")


def has_common_locks(folder: Path, mounts: str | None = None) -> bool:
    """Whether a lock on a file in this folder is visible everywhere the folder is; False if unknown.

    mounts: text of /proc/self/mountinfo (proc(5)), which is read by default. A local file system belongs to one kernel,
    even if containers have different host names. NFS keeps locks on its server unless mount options disable this.
    """
    if mounts is None:
        try:
            # Decoded like paths, independent of the locale.
            mounts = os.fsdecode(_MOUNTS.read_bytes())
        except OSError:
            return False
    kind, options = _mount_of(str(Path(folder).resolve()), mounts)
    if kind == "lustre":
        return "flock" in options
    if kind in ("nfs", "nfs4"):
        return not options & {"nolock", "local_lock=all", "local_lock=flock"}
    return kind in _LOCAL or kind in _SHARED


def _mount_of(folder: str, mounts: str) -> tuple[str, set[str]]:
    """(type, options) of the file system that an absolute path is on."""
    longest, kind, options = "", "", set()
    for line in mounts.splitlines():
        first, _, last = (part.split() for part in line.partition(" - "))
        if len(first) < 6 or len(last) < 3:
            continue
        # Blanks in paths are written as octal escapes.
        point = re.sub(r"\\([0-7]{3})", lambda match: chr(int(match[1], 8)), first[4])
        inside = folder == point or folder.startswith(point.rstrip("/") + "/")
        # Of several mounts on one point, the last one is effective.
        if inside and len(point) >= len(longest):
            longest, kind, options = point, last[0], {*first[5].split(","), *last[2].split(",")}
    return kind, options
