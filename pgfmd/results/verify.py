"""Verification of all bytes of a results folder that have a checksum. No MPI; needs memory for a small piece only.

In a folder in use, only completed data are examined, because checkpoints are replaced and tables grow.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from pgfmd.errors import ResultError
from pgfmd.files import storage
from pgfmd.files.checksum import whole_sum
from pgfmd.files.fields_layout import (
    LABEL_BYTES,
    NUMBERS,
    SNAPSHOT_NUMBERS,
    Layout,
    checksum_of,
    label_of,
    sum_of_numbers,
    undo_path,
)
from pgfmd.files.hdf5 import open_serial
from pgfmd.files.table_reading import count_ends, faults_of, pieces_of
from pgfmd.files.table_writing import begins_as_marked
from pgfmd.files.tables import TABLES, Table
from pgfmd.restart.checkpoint_layout import Damaged, examine
from pgfmd.units import UnitError

from .inventory import Inventory, require_known, take_inventory
from .reading import Results

PAUSE = 1.0
"""Time [s] after which a file that a run may be writing is examined again."""
PIECE = 2**20
"""Elements of a snapshot read at a time."""
UNREADABLE = (OSError, RuntimeError, LookupError, ValueError, TypeError, MemoryError)
"""Exceptions when reading a damaged file."""
ANEW = "start anew with --fresh, which keeps the old results"


@dataclass(frozen=True)
class Part:
    """The result for a file: whether it is fine, what was found, and what to do if it is not."""

    path: Path
    fine: bool
    found: str
    cure: str = ""

    def __str__(self) -> str:
        cure = f"; {self.cure}" if self.cure else ""
        return f"{'OK  ' if self.fine else 'FAIL'} {self.path}: {self.found}{cure}"


def verify(folder: str | Path) -> Iterator[Part]:
    """Examines the files of a results folder one after the other. Raises ResultError if it is not one, or can't be
    read."""
    folder = Path(folder)
    inventory = take_inventory(folder)
    if inventory is None:
        yield Part(folder, True, "no run yet")
        return
    if inventory.in_use:
        yield Part(folder, True, f"in use by {inventory.holder}: examined as far as it is safe")
    newest, previous = (_examined(folder / name) for name in storage.CHECKPOINT_FILES)
    yield _about_newest(newest, previous, inventory)
    if previous.head or previous.problem:
        yield _about_previous(newest, previous, inventory)
    head = newest.head or previous.head
    for table in TABLES:
        part = _guarded(folder / table.file, partial(_table, table=table, head=head, inventory=inventory))
        if part:
            yield part
    yield from _fields(folder / storage.FIELDS_FILE, head, inventory)
    yield from _texts(inventory)


def _guarded(path: Path, examine_part: Callable[[Path], Part | None]) -> Part | None:
    """The result of an examination, also if the file can't be read."""
    try:
        return examine_part(path)
    except UNREADABLE as problem:
        return _unreadable(path, problem)


def _unreadable(path: Path, problem: Exception) -> Part:
    return Part(path, False, f"can't be read: {storage.reason(problem)}", f"put the file back, or {ANEW}")


@dataclass(frozen=True)
class _Examined:
    """A checkpoint: its head if it is valid, else the problem; neither if it does not exist."""

    path: Path
    head: dict[str, Any] = field(default_factory=dict)
    problem: str = ""

    def __str__(self) -> str:
        state = self.head["state"]
        count = sum(entry.bytes for entry in self.head["entries"])
        return f"step {state['counters']['steps']}, t = {state['time']:.6g} s, {count} bytes of arrays"


def _examined(path: Path) -> _Examined:
    """Reads every byte of a checkpoint, again if a run has replaced it meanwhile."""
    problem = ""
    for _ in range(2):
        try:
            before = _identity(path)
            try:
                return _Examined(path, require_known(examine(path)))
            except Damaged as damage:
                problem = str(damage)
            if _identity(path) == before:
                break
        except FileNotFoundError:
            return _Examined(path)
    return _Examined(path, problem=problem)


def _identity(path: Path) -> tuple[int, int, int]:
    about = path.stat()
    return about.st_ino, about.st_mtime_ns, about.st_size


def _about_newest(newest: _Examined, previous: _Examined, inventory: Inventory) -> Part:
    if newest.head:
        return Part(newest.path, True, str(newest))
    if previous.head:
        cure = f"the run goes on from the one before it, step {previous.head['state']['counters']['steps']}"
        return Part(newest.path, False, newest.problem or "missing", cure)
    if newest.problem or previous.problem:
        cure = "the results don't need it: move it away" if inventory.finished else f"nothing to go on from: {ANEW}"
        return Part(newest.path, False, newest.problem or "missing", cure)
    if inventory.in_use or inventory.finished or inventory.rows_from(0) <= 2:
        return Part(newest.path, True, "there is none, nor anything that it should tell")
    return Part(newest.path, False, "missing", f"nothing to go on from: {ANEW}")


def _about_previous(newest: _Examined, previous: _Examined, inventory: Inventory) -> Part:
    if previous.head:
        return Part(previous.path, True, str(previous))
    spare = newest.head or inventory.finished
    return Part(previous.path, False, previous.problem, "it is not needed: delete it" if spare else "see above")


def _marks(head: dict | None, inventory: Inventory) -> tuple[dict, str]:
    """The expected contents of tables and snapshots, and their source: the record of a finished run, or a
    checkpoint."""
    done = inventory.record.get("outputs") if inventory.finished and inventory.record and not inventory.in_use else None
    return (done, "record") if done else (head["outputs"] if head else {}, "checkpoint")


def _table(path: Path, table: Table, head: dict | None, inventory: Inventory) -> Part | None:
    """Compares a table with its expected contents, or, if these are unknown, with the allowed values of its columns."""
    marks, witness = _marks(head, inventory)
    mark = marks.get(table.name)
    if mark is None:
        return _unmarked(path, table) if path.exists() else None
    if not path.exists():
        return Part(path, False, "missing", f"put it back, or {ANEW}")
    if not begins_as_marked(path, mark):
        found = f"its first {mark['rows']} rows are not those that the {witness} knows"
        return Part(path, False, found, f"put the file back, or {ANEW}")
    more = path.stat().st_size - mark["bytes"]
    if more and witness == "record":
        return Part(path, False, f"{more} bytes after the end of the run", f"cut it back to {mark['bytes']} bytes")
    later = f", and {more} bytes written since, not examined" if more else ""
    return Part(path, True, f"{mark['rows']} rows as the {witness} knows them{later}")


def _unmarked(path: Path, table: Table) -> Part:
    """Examines a table that no checkpoint covers."""
    unknown, rows = "no checkpoint tells what it should be", max(count_ends(path) - 1, 0)
    fault: object = None
    try:
        fault = next(faults_of(table, pieces_of(path, table, rows)), None) if rows else None
    except ResultError as error:
        fault = _short(error, path)
    if fault:
        return Part(path, False, f"{fault}, and {unknown}", f"put the file back, or {ANEW}")
    return Part(path, True, f"there, and its {rows} rows are such as its columns can have, but {unknown}")


def _fields(path: Path, head: dict | None, inventory: Inventory) -> Iterator[Part]:
    """Examines the snapshots, and an incomplete addition to them."""
    undo, marked = undo_path(path), _marks(head, inventory)[0].get("fields", {}).get("frames")
    if undo.exists():
        if inventory.in_use:
            yield Part(undo, True, "a snapshot is just being added")
        elif _is_whole(undo):
            yield Part(undo, False, "an addition to the snapshots did not end", "the next start puts it right")
        else:
            yield Part(undo, False, "damaged, so the snapshots can't be trusted", "move both away")
    if not path.exists():
        if marked:
            yield Part(path, False, f"missing, {marked} snapshots were in it", f"put it back, or {ANEW}")
        return
    for pause in (PAUSE, 0.0):
        # An incomplete addition is not examined; everything before the checkpoint is.
        try:
            part = _snapshots(path, marked, inventory.in_use or undo.exists())
        except UNREADABLE as problem:
            part = _unreadable(path, problem)
            if undo.exists():
                part = Part(path, True, "not examined, as adding a snapshot has not ended")
        if part.fine or not inventory.in_use:
            break
        time.sleep(pause)
    yield part


def _is_whole(undo: Path) -> bool:
    head, _, kept = undo.read_bytes().partition(b"\n")
    try:
        return hashlib.sha256(kept).hexdigest() == json.loads(head)["sha256"]
    except (ValueError, KeyError, TypeError):
        return False


def _snapshots(path: Path, marked: int | None, only_marked: bool) -> Part:
    """Compares the arrays of all snapshots, or only of those in a checkpoint, with their checksums.

    Raises ValueError, or others of UNREADABLE, if the file is no file of snapshots.
    """
    with open_serial(path, "r") as file:
        layout = Layout(**{name: file.attrs[name] for name in ("n", "length", "block_start", "nb", "surface")})
        frames, names = len(file["snapshot"]), list(layout.arrays)
        if frames < (marked or 0):
            found = f"has {frames} snapshots, the checkpoint knows {marked}"
            return Part(path, False, found, f"put the file back, or {ANEW}")
        if any(checksum_of(name) not in file for name in (*names, NUMBERS)):
            return Part(path, True, f"{frames} snapshots without checksums, of an earlier version: not examined")
        strange = _strange(file, layout, frames)
        if strange:
            raise ValueError(f"its structure is changed: {', '.join(strange)}")
        count = min(frames, marked or 0) if only_marked else frames
        wrong = [f"{name} of snapshot {frame}" for frame in range(count) for name in names
                 if _sum_of(file[name], frame) != file[checksum_of(name)][frame]]  # fmt: skip
        strange_frames = [frame for frame in range(count) if not _numbers_are_right(file, frame)]
        wrong += [f"numbers or label of snapshot {frame}" for frame in strange_frames]
        wrong += _other_gaps(path.parent, file.attrs)
    if wrong:
        return Part(path, False, f"changed: {', '.join(wrong)}", "don't use that; put the file back if there is a copy")
    left_out = f", and {frames - count} not examined" if frames > count else ""
    return Part(path, True, f"{count} snapshots of {len(names)} arrays{left_out}")


def _strange(file: h5py.File, layout: Layout, frames: int) -> list[str]:
    """Variables that do not agree with the file's own attributes and number of snapshots."""
    shapes: dict[str, tuple[int, ...]] = {name: (frames, side, side) for name, (_, _, side, _) in layout.arrays.items()}
    for name in (*SNAPSHOT_NUMBERS, *map(checksum_of, (*layout.arrays, NUMBERS))):
        shapes[name] = (frames,)
    # In files of 0.1: one text per snapshot.
    shapes["label"] = (frames, LABEL_BYTES) if file["label"].ndim == 2 else (frames,)
    found = [name for name, shape in shapes.items() if file[name].shape != shape]
    return found + [name for name, axis in layout.axes.items() if not _is_axis(file[name], axis, layout)]


def _is_axis(found: h5py.Dataset, axis: np.ndarray, layout: Layout) -> bool:
    """Whether positions are those of the grid, to the last bit, or to rounding where version 0.1 has written the
    file."""
    if found.shape != axis.shape:
        return False
    error = float(np.abs(found[:] - axis).max())
    rounding = layout.length * float(np.finfo(np.float64).eps)
    return error == 0.0 or (found.file["label"].ndim == 1 and error <= rounding)


def _other_gaps(folder: Path, attributes: Mapping) -> list[str]:
    """Attributes about contact that disagree with record and scene."""
    try:
        results = Results(folder)
        known = {"contact_gap_m": results.contact_gap, "near_gap_m": results.near_gap}
    except (ResultError, UnitError):
        # This is reported for the file that can't be read.
        return []
    return [f"attribute {name}" for name, gap in known.items() if attributes.get(name, gap) != gap]


def _numbers_are_right(file: h5py.File, frame: int) -> bool:
    numbers = [file[name][frame] for name in SNAPSHOT_NUMBERS]
    return sum_of_numbers(label_of(file["label"], frame), numbers) == file[checksum_of(NUMBERS)][frame]


def _sum_of(array: h5py.Dataset, frame: int) -> np.uint64:
    """The checksum of one snapshot of an array, read by rows."""
    _, rows, side = array.shape
    step = max(1, PIECE // side)
    sums = [whole_sum(np.ascontiguousarray(array[frame, row : row + step]), row * side) for row in range(0, rows, step)]
    return np.array(sums, dtype=np.uint64).sum(dtype=np.uint64)


def _texts(inventory: Inventory) -> Iterator[Part]:
    """Whether scene and record can be read; they have no checksum."""
    path = inventory.folder / storage.SCENE_FILE
    try:
        _ = Results(inventory.folder).scene
        yield Part(path, True, "can be read")
    except ResultError as error:
        yield Part(path, False, _short(error, path), "the next start of the run writes it anew")
    path = inventory.folder / storage.RUN_FILE
    if inventory.problem:
        yield Part(path, False, _short(inventory.problem, path))
    elif inventory.record is not None:
        yield Part(path, True, f"how the run ended: {inventory.record['finished']}")


def _short(problem: object, path: Path) -> str:
    return str(problem).removeprefix(f"{path}: ")
