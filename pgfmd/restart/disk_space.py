"""Whether the disk has enough space for a run. No MPI."""

from __future__ import annotations

import shutil
from pathlib import Path

from pgfmd.errors import ResultError

COPIES = 3
"""Number of checkpoints that exist at the same time: the newest, the one before, and the one being written."""


def require_space(folder: Path, checkpoint_bytes: int, snapshot_bytes: int) -> None:
    """Raises ResultError if there is not enough space for checkpoints (of this size each) and snapshots (in total).
    Files that already exist in the folder of a continued run count as space."""
    about = shutil.disk_usage(folder)
    if about.total == 0:
        # Some file systems in user space do not report their free space. A full disk is then detected when it is full.
        return
    free = about.free + sum(file.stat().st_size for file in folder.iterdir() if file.suffix == ".h5")
    needed = COPIES * checkpoint_bytes + snapshot_bytes
    if needed > free:
        raise ResultError(
            f"{folder}: the run needs {needed / 1e9:.3g} GB of disk space ({COPIES} checkpoints of "
            f"{checkpoint_bytes / 1e9:.3g} GB, and snapshots), but only {free / 1e9:.3g} GB are free. Make room, choose "
            "another --out, or take fewer output.snapshots"
        )
