"""The format of `fields.h5`, and adding snapshots without the risk of a broken file. No MPI.

The file follows netCDF-4 and the CF conventions: dimension scales, units, `axis`, `coordinates`; and VTKHDF
(vtk_group.py). One process adds a snapshot, with space for all its arrays (filled with NaN); then one or several processes
write the arrays.

HDF5 has no transactions: a process killed while it adds a snapshot may leave a file that can't be opened, or an
incomplete snapshot. So all bytes that are not complete arrays are first copied to `fields.h5.undo` (some ten kB), and
restored at the next start if the copy still exists.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import h5py
import numpy as np

from pgfmd import __version__
from pgfmd.errors import ResultError

from . import vtk_group
from .checksum import whole_sum
from .hdf5 import open_serial
from .regular_files import bring_to_disk, open_regular, require_regular, write_atomically
from .storage import UNDO_SUFFIX, secure_space

BLOCK_FIELDS = {
    "gap": ("m", "gap between punch and elastomer"),
    "traction": ("Pa", "normal traction on the elastomer, positive where it pulls up"),
    "displacement": ("m", "displacement of the elastomer's surface, positive upward"),
}
SURFACE_FIELD = "surface_displacement"
SNAPSHOT_NUMBERS = {
    "time": ("s", "time since the start of the loading programme"),
    "punch_position": ("m", "displacement of the punch, negative when pushed in"),
    "force": ("N", "normal force on the punch, positive in compression"),
}
LABEL_BYTES = 80
LABEL_AXIS = "label_bytes"
"""Dimension of a label's characters; a dimension only, not a variable."""
NUMBERS = "numbers"
"""Name of the checksum of a snapshot's numbers and label."""
CHUNK_BYTES = 2**26
SCALAR_CHUNK = 64


@dataclass(frozen=True)
class Layout:
    """Grid of a file: cell of `n` x `n` points and side `length` [m]; block of `nb` x `nb` from `block_start` on."""

    n: int
    length: float
    block_start: int
    nb: int
    surface: bool = False

    @property
    def arrays(self) -> dict[str, tuple[str, str, int, tuple[str, str]]]:
        """name -> (units, long name, side in points, names of the two axes)."""
        arrays = {name: (*about, self.nb, ("y", "x")) for name, about in BLOCK_FIELDS.items()}
        if self.surface:
            about = ("m", "displacement of the whole surface of the cell, positive upward")
            arrays[SURFACE_FIELD] = (*about, self.n, ("y_cell", "x_cell"))
        return arrays

    @property
    def axes(self) -> dict[str, np.ndarray]:
        """name -> positions [m] relative to the punch's axis."""
        # As the grid has them (solver/grid.py): mirror images to the last bit.
        cell = (np.arange(self.n) + (0.5 - 0.5 * self.n)) * (self.length / self.n)
        block = cell[self.block_start : self.block_start + self.nb]
        axes = {"y": block, "x": block}
        return axes | {"y_cell": cell, "x_cell": cell} if self.surface else axes

    @property
    def attributes(self) -> dict[str, object]:
        """Attributes of the file's root, which a continued file must have as well."""
        return {"n": self.n, "length": self.length, "block_start": self.block_start, "nb": self.nb,
                "surface": int(self.surface)}  # fmt: skip

    @property
    def frame_bytes(self) -> int:
        """Size of one snapshot's arrays, rounded up to whole chunks."""
        sides = [side for _, _, side, _ in self.arrays.values()]
        return sum(8 * side * -(-side // _chunk_rows(side)) * _chunk_rows(side) for side in sides)


def _chunk_rows(side: int) -> int:
    return max(1, min(side, CHUNK_BYTES // (8 * side)))


def create(path: Path, layout: Layout, extra_attributes: Mapping[str, float] = MappingProxyType({})) -> None:
    """Creates a file without snapshots. extra_attributes: of its root, besides those of the layout. Raises OSError if it can't be written."""
    # "x": fails if anything of this name exists, even a link.
    with open_serial(path, "x") as file:
        file.attrs["Conventions"] = "CF-1.11"
        file.attrs["title"] = "pgfmd: snapshots of an adhesive contact"
        file.attrs["source"] = f"pgfmd {__version__}"
        for name, value in {**extra_attributes, **layout.attributes}.items():
            file.attrs[name] = value
        for name, position in layout.axes.items():
            axis = file.create_dataset(name, data=position)
            letter = name[0]
            axis.attrs.update(units="m", long_name=f"{letter}, relative to the axis of the punch", axis=letter.upper())
            axis.make_scale(name)
        _growing(file, "snapshot", "i8", long_name="number of the snapshot").make_scale("snapshot")
        for name, (units, long_name) in SNAPSHOT_NUMBERS.items():
            _growing(file, name, "f8", units=units, long_name=long_name)
        _create_labels(file)
        for name in (*layout.arrays, NUMBERS):
            _growing(file, checksum_of(name), "u8", long_name=f"checksum of {name}, for `pgfmd verify`")
        for name in (*SNAPSHOT_NUMBERS, "label", *map(checksum_of, (*layout.arrays, NUMBERS))):
            file[name].dims[0].attach_scale(file["snapshot"])
        for name in layout.arrays:
            _create_array(file, name, layout)
        vtk_group.add(file, layout)


def _create_labels(file: h5py.File) -> None:
    """Labels as netCDF's character arrays, which every reader of netCDF makes texts of.

    Not text of fixed length, which netCDF's library can't read; nor of free length, for which HDF5 takes another 4 kB
    with every snapshot, to be copied aside with each that follows.
    """
    # How netCDF-4 stores a dimension without values.
    only_a_dimension = file.create_dataset(LABEL_AXIS, (LABEL_BYTES,), ">f4")
    only_a_dimension.make_scale(f"This is a netCDF dimension but not a netCDF variable.{LABEL_BYTES:10d}")
    labels = file.create_dataset(
        "label", (0, LABEL_BYTES), "S1", maxshape=(None, LABEL_BYTES), chunks=(SCALAR_CHUNK, LABEL_BYTES)
    )
    labels.attrs.update(long_name="what the programme calls this moment", _Encoding="utf-8")
    labels.dims[1].attach_scale(only_a_dimension)


def _growing(file: h5py.File, name: str, dtype: object, **attributes: str) -> h5py.Dataset:
    dataset = file.create_dataset(name, (0,), dtype, maxshape=(None,), chunks=(SCALAR_CHUNK,))
    dataset.attrs.update(attributes)
    return dataset


def _create_array(file: h5py.File, name: str, layout: Layout) -> None:
    units, long_name, side, axes = layout.arrays[name]
    # Early allocation: growing the file takes the disk space at once, so that one process notices a full disk, and
    # ranks that write together never allocate.
    early = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    early.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    shape, chunks = (0, side, side), (1, _chunk_rows(side), side)
    array = file.create_dataset(
        name, shape, "f8", maxshape=(None, side, side), chunks=chunks, fillvalue=np.nan, dcpl=early
    )
    array.attrs.update(units=units, long_name=long_name, coordinates=" ".join((*SNAPSHOT_NUMBERS, "label")))
    array.attrs["_FillValue"] = np.array([np.nan])
    for dimension, axis in enumerate(("snapshot", *axes)):
        array.dims[dimension].attach_scale(file[axis])


def count_frames(path: Path, layout: Layout) -> int:
    """Number of snapshots in a file. Raises ResultError if it does not have this layout."""
    try:
        with open_serial(path, "r") as file:
            found = {name: file.attrs.get(name) for name in layout.attributes}
            frames = len(file["snapshot"]) if "snapshot" in file else 0
    except OSError as problem:
        cure = (
            "close it if this process reads it (Results.close), else it is damaged: put it back, or start anew with --fresh, "
            "which keeps the old results"
        )
        raise ResultError(f"{path}: can't be continued: {problem}; {cure}") from problem
    for name, value in layout.attributes.items():
        if found[name] != value:
            differs = f"its {name} is {found[name]}, the run's is {value}"
            raise ResultError(f"{path}: can't be continued, {differs}; move it away")
    return frames


def resize(path: Path, layout: Layout, frames: int) -> None:
    """Sets the number of snapshots: new ones are NaN, surplus ones are deleted."""
    with open_serial(path, "r+") as file:
        sums = map(checksum_of, (*layout.arrays, NUMBERS))
        for name in ("snapshot", *SNAPSHOT_NUMBERS, "label", *layout.arrays, *sums):
            file[name].resize(frames, axis=0)
        file["snapshot"][:] = np.arange(frames)
        vtk_group.update(file)


def checksum_of(name: str) -> str:
    """The variable with the checksum of an array for each snapshot (checksum.py: `whole_sum`)."""
    return f"{name}_checksum"


def label_of(labels: h5py.Dataset, frame: int) -> bytes:
    """The label of one snapshot, in UTF-8, from the variable `label` of a file of this version or of an earlier one,
    which kept text of fixed length."""
    return bytes(labels[frame].tobytes().rstrip(b"\0"))


def _write_label(labels: h5py.Dataset, frame: int, text: bytes) -> None:
    labels[frame] = np.frombuffer(text.ljust(LABEL_BYTES, b"\0"), dtype="S1") if labels.ndim == 2 else text


def variables(file: h5py.File) -> list[str]:
    """Names of the variables of a file, without pure dimensions and groups."""
    return [name for name in file if name not in (LABEL_AXIS, vtk_group.GROUP)]


def sum_of_numbers(label: bytes, numbers: Sequence[float]) -> np.uint64:
    """Checksum of a snapshot's `SNAPSHOT_NUMBERS` and label."""
    text = np.frombuffer(label.ljust(LABEL_BYTES, b"\0"), dtype=np.uint64)
    return whole_sum(np.concatenate([np.array(numbers, dtype=np.float64).view(np.uint64), text]), 0)


def describe(
    path: Path, layout: Layout, frame: int, label: str, sums: Mapping[str, int | np.uint64], **numbers: float
) -> None:
    """Write label, checksums of the arrays and `SNAPSHOT_NUMBERS` of one snapshot. A label longer than 80 bytes is cut
    between characters."""
    cut = label.encode()[:LABEL_BYTES].decode(errors="ignore").encode()
    sums = {**sums, NUMBERS: sum_of_numbers(cut, [numbers[name] for name in SNAPSHOT_NUMBERS])}
    with open_serial(path, "r+") as file:
        _write_label(file["label"], frame, cut)
        for name in SNAPSHOT_NUMBERS:
            file[name][frame] = numbers[name]
        for name, total in sums.items():
            file[checksum_of(name)][frame] = total
        if vtk_group.GROUP in file:
            vtk_group.update(file)
        else:
            # An earlier version began it.
            vtk_group.add(file, layout)


def reserve(path: Path, size: int) -> int:
    """Reserves `size` more bytes of disk before HDF5 writes, because it does not recover from a full disk.

    HDF5 releases unused space when it closes the file. Returns the size before.

    Raises:
        OSError: if there is not enough space; the file is then unchanged.
    """
    before = path.stat().st_size
    try:
        secure_space(path, before, size)
    except OSError:
        with contextlib.suppress(OSError):
            os.truncate(path, before)
        raise
    return before


def undo_path(path: Path) -> Path:
    """The path of the undo file."""
    return path.with_name(path.name + UNDO_SUFFIX)


def remember(path: Path, layout: Layout, size: int) -> None:
    """Copies everything except complete arrays from the first `size` bytes of the file to the undo file.

    Raises:
        OSError: if the undo file can't be written; it is then deleted.
    """
    with open_serial(path, "r") as file:
        chunks = [array.id.get_chunk_info(k) for array in map(file.get, layout.arrays)
                  for k in range(array.id.get_num_chunks())]  # fmt: skip
    edges = [0]
    for start, length in sorted((chunk.byte_offset, chunk.size) for chunk in chunks):
        edges += [start, start + length]
    edges.append(size)
    spans = [(start, end - start) for start, end in zip(edges[::2], edges[1::2], strict=True) if end > start]
    with open(path, "rb") as file:
        kept = b"".join(os.pread(file.fileno(), length, start) for start, length in spans)
    head = {"size": size, "spans": spans, "sha256": hashlib.sha256(kept).hexdigest()}
    undo = undo_path(path)
    write_atomically(undo, json.dumps(head).encode() + b"\n" + kept)


def forget(path: Path) -> None:
    """Completes a change: flushes the file to the disk and deletes the undo file."""
    bring_to_disk(path)
    undo_path(path).unlink(missing_ok=True)


def put_back(path: Path) -> bool:
    """Reverts an incomplete addition, if there is one; returns whether. Raises ResultError for a damaged undo file."""
    undo = undo_path(path)
    if not (require_regular(undo) and require_regular(path)):
        return False
    head, _, kept = undo.read_bytes().partition(b"\n")
    try:
        about = json.loads(head)
        whole = hashlib.sha256(kept).hexdigest() == about["sha256"]
    except (ValueError, KeyError):
        whole = False
    if not whole:
        raise ResultError(f"{undo}: damaged, so the snapshots in {path} can't be trusted; move both away")
    with os.fdopen(open_regular(path, os.O_RDWR), "r+b") as file:
        position = 0
        for start, length in about["spans"]:
            file.seek(start)
            file.write(kept[position : position + length])
            position += length
        file.truncate(about["size"])
        file.flush()
        os.fsync(file.fileno())
    undo.unlink()
    return True
