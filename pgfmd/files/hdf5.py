"""HDF5 files opened by one process."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py


def open_serial(path: Path, mode: str, **options: Any) -> h5py.File:
    """Opens a file without HDF5's file locks, so that a reader can't stop a run."""
    return h5py.File(path, mode, locking=False, **options)
