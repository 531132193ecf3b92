"""Whether the disk has room for what a run is going to write. No MPI."""

from __future__ import annotations

import shutil
from pathlib import Path

from pgfmd.errors import ResultError

COPIES = 3
"""Checkpoints that are there at once: the newest, the one before, and the one being written."""


def require_space(folder: Path, checkpoint_bytes: int, snapshot_bytes: int) -> None:
    """Raises ResultError if the disk lacks room for checkpoints of one size and snapshots of a size in all; what the
    folder holds of a run that goes on is counted as room."""
    about = shutil.disk_usage(folder)
    if about.total == 0:
        # A file system that does not tell, as some in user space don't. A disk that is full is noticed when it is.
        return
    free = about.free + sum(file.stat().st_size for file in folder.iterdir() if file.suffix == ".h5")
    needed = COPIES * checkpoint_bytes + snapshot_bytes
    if needed > free:
        raise ResultError(
            f"{folder}: the run needs {needed / 1e9:.3g} GB of disk space ({COPIES} checkpoints of "
            f"{checkpoint_bytes / 1e9:.3g} GB, and snapshots), but only {free / 1e9:.3g} GB are free. Make room, choose "
            "another --out, or take fewer output.snapshots"
        )
