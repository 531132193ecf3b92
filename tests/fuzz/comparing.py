"""Whether the results of two runs agree: to the same bits, or to the same bits of numbers in other units."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.files import tables
from pgfmd.results import load
from pgfmd.results.uncertainty import share_of
from pgfmd.solver.simulation import STOPPED_STEPS

from .declarations import EXPONENTS
from .faults import Fault

TABLES = tuple(table.name for table in tables.TABLES)
FIELDS = ("gap", "traction", "displacement", "surface_displacement", "time", "punch_position", "force", "label")
ABOUT_THE_PROCESS = (
    "ranks", "wall_s", "transform_s", "checkpoint_s", "peak_rss_bytes", "versions", "links", "outputs",
    "transform_pairs",
)  # fmt: skip
"""Entries of the record that tell of the processes that made a run, not of the run."""
UNITS = {
    "m": EXPONENTS["length"], "s": EXPONENTS["time"], "N": EXPONENTS["force"], "Pa": EXPONENTS["modulus"],
    "J": (3, 1, 0),
    "m^2": (2, 0, 0), "rad": (0, 0, -1),
}  # fmt: skip
"""Powers of length, modulus and time of the units in headers, of arrays, and at the end of the record's names."""
Factor = Callable[[str], float]


def same(unit: str) -> float:
    """No change of units."""
    return 1.0


def compared(one: Path, other: Path, *, factor: Factor = same, names: tuple[str, ...] = TABLES, record: bool = True,
             fields: bool = True, but: tuple[str, ...] = ()) -> list[Fault]:  # fmt: skip
    """Differences of two folders, none where all bits agree.

    factor: from a unit to what numbers of `one` in this unit are to be multiplied by. names (of tables), record, fields: what
    is looked at, as far as both folders have it. but: entries of the record that may differ.
    """
    with load(one) as first, load(other) as second:
        faults = [
            fault for table in tables.TABLES if table.name in names for fault in _table(table, first, second, factor)
        ]
        if record:
            faults += _records(one, other, factor, ABOUT_THE_PROCESS + but)
        if fields:
            faults += _fields(first, second, factor)
    return faults


def _table(table: tables.Table, first: Any, second: Any, factor: Factor) -> Iterator[Fault]:
    one, other = getattr(first, table.name), getattr(second, table.name)
    if one is None or other is None:
        return
    if len(one) != len(other):
        yield Fault(f"{table.file} has more or fewer rows", f"{len(one)}, {len(other)}")
        return
    for entry in table.columns:
        change = factor(entry.unit) if entry.unit else 1.0
        fault = _different(np.asarray(one[entry.title]), np.asarray(other[entry.title]), change)
        if fault:
            yield Fault(f"{table.file} differs", f"{entry.title}: {fault}")
            return


def _different(one: np.ndarray, other: np.ndarray, factor: float) -> str:
    """Where two arrays of equal shape differ, and by how much; empty where they don't."""
    if one.shape != other.shape:
        return f"shapes {one.shape}, {other.shape}"
    if one.dtype.kind not in "fiu":
        unequal = np.asarray(one != other)
        return f"entry {int(np.argmax(unequal))}" if unequal.any() else ""
    expected = one * factor if one.dtype.kind == "f" else one
    unequal = ~(
        (expected == other) | (np.isnan(expected) & np.isnan(other)) if one.dtype.kind == "f" else expected == other
    )
    if not unequal.any():
        return ""
    place = np.unravel_index(int(np.argmax(unequal)), one.shape)
    scale = float(np.nanmax(np.abs(expected)))
    worst = float(np.nanmax(np.abs(expected - other)))
    where = ", ".join(map(str, place))
    share = worst / (scale or 1.0)
    return f"first at {where}, {expected[place]!r} and {other[place]!r}; at most {share:.2g} of the largest"


def _records(one: Path, other: Path, factor: Factor, but: tuple[str, ...]) -> Iterator[Fault]:
    first, second = (json.loads((path / "run.json").read_text(encoding="utf-8")) for path in (one, other))
    for name in first.keys() | second.keys():
        if name in but:
            continue
        value, found = first.get(name), second.get(name)
        if isinstance(value, float):
            value *= factor(_unit_of(name))
        if value != found:
            yield Fault(f"record differs: {name}", f"{value!r}, {found!r}")


def _unit_of(name: str) -> str:
    """The unit that an entry of the record ends in, empty for none."""
    end = "rad" if name.endswith("_rad_s") else name.rpartition("_")[2]
    return end if end in UNITS else ""


def _fields(first: Any, second: Any, factor: Factor) -> Iterator[Fault]:
    if not (first.has_fields and second.has_fields):
        if first.has_fields != second.has_fields:
            yield Fault("one has snapshots, the other has none")
        return
    if len(first.labels) != len(second.labels):
        yield Fault("fields.h5 has more or fewer snapshots", f"{first.labels}, {second.labels}")
        return
    for name in FIELDS:
        if name not in first.fields or name not in second.fields or (name == "label" and factor is not same):
            continue
        unit = {"traction": "Pa", "force": "N", "time": "s", "label": ""}.get(name, "m")
        fault = _different(np.asarray(first.fields[name][:]), np.asarray(second.fields[name][:]), factor(unit))
        if fault:
            yield Fault("fields.h5 differs", f"{name}: {fault}")
            return


def close(one: Path, other: Path, names: dict[str, float]) -> list[Fault]:
    """Entries of the record that are further apart than a relative error; each is told with its own."""
    first, second = (json.loads((path / "run.json").read_text(encoding="utf-8")) for path in (one, other))
    faults = []
    for name, error in names.items():
        value, found = first[name], second[name]
        if (value is None) != (found is None) or (value is not None and not math.isclose(value, found, rel_tol=error)):
            faults.append(Fault(f"record differs: {name}", f"{value!r}, {found!r}"))
    return faults


UNCERTAIN = ("pull_off_force_N", "snap_in_force_N", "work_of_separation_J", "work_J")
"""Entries of the record that come with an uncertainty."""


def within_uncertainty(one: Path, other: Path) -> list[Fault]:
    """Numbers of two runs that are further apart than both may be off, where rounding has led to other steps.

    Forces and works have their uncertainties with them. How the run ends, and the preload at which it turns round, are
    the same for both.
    """
    first, second = (json.loads((path / "run.json").read_text(encoding="utf-8")) for path in (one, other))
    if STOPPED_STEPS in (first["finished"], second["finished"]):
        # The same number of steps, of other lengths, ends elsewhere.
        return []
    faults = [
        Fault(f"record differs: {name}", f"{first[name]!r}, {second[name]!r}")
        for name in ("finished", "scheme", "n", "range_m")
        if first[name] != second[name]
    ]
    for name in UNCERTAIN:
        value, found = first[name], second[name]
        if (value is None) != (found is None):
            faults.append(Fault(f"record differs: {name}", f"{value!r}, {found!r}"))
        elif value is not None:
            allowed = _uncertainty(name, first) + _uncertainty(name, second)
            if not abs(value - found) <= allowed:
                faults.append(
                    Fault(f"further apart than both may be off: {name}", f"{value!r}, {found!r}, {allowed:.3g}")
                )
    return faults


def _uncertainty(name: str, record: dict) -> float:
    """How far off an entry of a record may be; without an audit, which knows more, what its steps leave of works."""
    quantity, _, unit = name.rpartition("_")
    told = record[f"{quantity}_uncertainty_{unit}"]
    works = max(abs(record[name]), abs(record["work_of_separation_J"] or 0.0))
    return share_of(record) * works if told is None else told
