"""Comparison of two results folders bit by bit, as for an interrupted and an uninterrupted run. No MPI."""

from __future__ import annotations

from pathlib import Path

import h5py

from pgfmd.files import storage
from pgfmd.files.hdf5 import open_serial

from .checkpoint_layout import HEAD, examine


def differences(one: Path, other: Path) -> list[str]:
    """Names of tables, snapshots and state variables that differ between two runs; empty if all are equal.

    Everything that depends on the clock, such as run times, is ignored. Raises OSError or Damaged if a file can't be
    read.
    """
    tables = (
        storage.CURVE_FILE, storage.ENERGY_FILE, storage.EVENTS_FILE, storage.PATCHES_FILE, storage.SITES_FILE,
    )  # fmt: skip
    found = [name for name in tables if _content(one / name) != _content(other / name)]
    found += _different_arrays(one / storage.FIELDS_FILE, other / storage.FIELDS_FILE)
    heads = [examine(folder / storage.CHECKPOINT_FILE) for folder in (one, other)]
    found += _different_arrays(one / storage.CHECKPOINT_FILE, other / storage.CHECKPOINT_FILE)
    states = [head["state"] for head in heads]
    keys = sorted(states[0].keys() | states[1].keys())
    return found + [f"{storage.CHECKPOINT_FILE}: {key}" for key in keys if states[0].get(key) != states[1].get(key)]


def _content(path: Path) -> bytes | None:
    return path.read_bytes() if path.exists() else None


def _different_arrays(one: Path, other: Path) -> list[str]:
    """The datasets of two HDF5 files that differ in type, shape or contents, or exist in only one of them."""
    if not (one.exists() and other.exists()):
        return [] if one.exists() == other.exists() else [f"{one.name}: only in one of the two"]
    with open_serial(one, "r") as first, open_serial(other, "r") as second:
        names: list[set[str]] = [set(), set()]
        for found, file in zip(names, (first, second), strict=True):
            file.visititems(lambda name, item, found=found: found.add(name) if _is_data(name, item) else None)
        both = names[0] & names[1]
        wrong = [name for name in both if not _equal(first[name], second[name])]
    return [f"{one.name}: {name}" for name in sorted(wrong + list(names[0] ^ names[1]))]


def _is_data(name: str, item: object) -> bool:
    # The head contains times of day.
    return isinstance(item, h5py.Dataset) and name != HEAD


def _equal(one: h5py.Dataset, other: h5py.Dataset) -> bool:
    if one.shape != other.shape or one.dtype != other.dtype:
        return False
    if not one.shape or one.ndim < 2:
        return one[()].tobytes() == other[()].tobytes()
    return all(one[k].tobytes() == other[k].tobytes() for k in range(one.shape[0]))
