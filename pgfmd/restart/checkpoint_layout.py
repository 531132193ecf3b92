"""The format of a checkpoint file; creating, sealing and examining it by one process. No MPI.

The file is HDF5 with a user block. Each array of the state is one contiguous dataset, under the name that packing.py
gives it. The dataset `head` has everything else as JSON text. The user block, the first bytes of the file, is the seal.
It is written last. It has the size of the file, and SHA-256 sums of all bytes that belong to no array and of itself.
The arrays have their own checksums (files/checksum.py) in the head. So a change of any byte is detected.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from pgfmd.errors import ResultError
from pgfmd.files.checksum import block_sums
from pgfmd.files.hdf5 import open_serial
from pgfmd.files.storage import reason, secure_space

FORMAT = 1
HEAD = "head"
SEAL_BYTES = 4096
"""Size of the user block, which lists the bytes that belong to no array."""
BOOKKEEPING = 2**12
"""Most bytes that HDF5 needs for its own structures, per dataset."""
PIECE = 2**20
"""Elements read at a time by a process that examines a whole array."""


class Damaged(Exception):
    """A file is not a valid checkpoint; the message says why."""


def none_valid(problems: list[str], further: str = "") -> ResultError:
    """The error for a folder without a valid checkpoint. problems: one for each file; further: an additional
    sentence."""
    return ResultError(
        "no valid checkpoint to go on from:\n  - " + "\n  - ".join(problems) + "\n"
        f"{further}Start anew with --fresh, which keeps the old results"
    )


@dataclass(frozen=True)
class Entry:
    """One array of a checkpoint: name, shape (lines, width) over all ranks, type of its elements, checksums of its
    blocks."""

    name: str
    shape: tuple[int, int]
    dtype: str
    sums: np.ndarray

    @property
    def bytes(self) -> int:
        """Size of the array."""
        return self.shape[0] * self.shape[1] * np.dtype(self.dtype).itemsize

    def as_json(self) -> dict:
        """The entry as the head holds it."""
        return {"name": self.name, "shape": self.shape, "dtype": self.dtype, "sums": self.sums.tolist()}

    @classmethod
    def from_json(cls, entry: dict) -> Entry:
        """The entry of a head."""
        sums = np.array(entry["sums"], dtype=np.uint64)
        lines, width = entry["shape"]
        return cls(entry["name"], (lines, width), entry["dtype"], sums)


def create(path: Path, head: dict, entries: list[Entry]) -> None:
    """Creates a file with its head and reserved space for the arrays, so that later writes can't fill the disk. Raises
    OSError if there is not enough space."""
    text = json.dumps({**head, "arrays": [entry.as_json() for entry in entries]}, allow_nan=True).encode()
    # HDF5 does not recover from a full disk. So it starts from a file that has all the space it needs, and releases
    # the rest when it closes the file.
    with open(path, "xb") as file:
        file.write(_empty_file())
    needed = len(text) + sum(entry.bytes for entry in entries) + BOOKKEEPING * (len(entries) + 2)
    secure_space(path, path.stat().st_size, needed)
    with open_serial(path, "r+") as file:
        file.create_dataset(HEAD, data=np.frombuffer(text, dtype=np.uint8), track_times=False)
        for entry in entries:
            room = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
            room.set_layout(h5py.h5d.CONTIGUOUS)
            room.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
            room.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
            room.set_obj_track_times(False)
            file.create_dataset(entry.name, entry.shape, entry.dtype, dcpl=room)


def _empty_file() -> bytes:
    """An HDF5 file with space for the seal and nothing else."""
    image = io.BytesIO()
    with h5py.File(image, "w", userblock_size=SEAL_BYTES):
        pass
    return image.getvalue()


def seal(path: Path) -> int:
    """Writes the user block of a file whose arrays are complete; returns the file's size [bytes]. Raises OSError."""
    size = path.stat().st_size
    with open_serial(path, "r") as file:
        spans = _others(_spans_of_arrays(file), size)
    with open(path, "r+b") as file:
        digest = _digest(file, spans)
        text = json.dumps({"pgfmd checkpoint": FORMAT, "size": size, "spans": spans, "sha256": digest}).encode() + b"\n"
        if len(text) + 65 > SEAL_BYTES:
            raise OSError(f"{path}: {len(spans)} pieces don't fit into the seal")
        block = text + hashlib.sha256(text).hexdigest().encode() + b"\n"
        file.seek(0)
        file.write(block.ljust(SEAL_BYTES, b"\0"))
    return size


def read_head(path: Path) -> dict:
    """The head of a file with a valid seal, with its `entries` as Entry. The arrays are not examined.

    Raises Damaged for a file that is truncated, changed or of another format, and FileNotFoundError.
    """
    try:
        with open(path, "rb") as file:
            about = _read_seal(file.read(SEAL_BYTES))
            size = os.fstat(file.fileno()).st_size
            if size != about["size"]:
                raise Damaged(f"it has {size} bytes instead of {about['size']}")
            if _digest(file, about["spans"]) != about["sha256"]:
                raise Damaged("its structure is changed: wrong checksum")
        with open_serial(path, "r") as file:
            head = json.loads(bytes(file[HEAD][:]))
    except FileNotFoundError:
        raise
    except (OSError, ValueError, KeyError, RuntimeError) as problem:
        raise Damaged(f"can't be read: {reason(problem)}") from problem
    head["entries"] = [Entry.from_json(entry) for entry in head.pop("arrays")]
    return head


def examine(path: Path) -> dict:
    """The head of a file, after every byte has been checked. Raises Damaged or FileNotFoundError."""
    head = read_head(path)
    try:
        with open_serial(path, "r") as file:
            for entry in head["entries"]:
                compare_sums(entry, _sums_of_whole(file[entry.name], entry))
    except (OSError, RuntimeError, KeyError) as problem:
        raise Damaged(f"can't be read: {reason(problem)}") from problem
    return head


def compare_sums(entry: Entry, found: np.ndarray) -> None:
    """Raises Damaged if the checksums of an array differ from those in the head."""
    wrong = np.flatnonzero(found != entry.sums)
    if wrong.size:
        raise Damaged(f"its array {entry.name} is changed: wrong checksum of block {wrong[0]} of {entry.sums.size}")


def _sums_of_whole(dataset: h5py.Dataset, entry: Entry) -> np.ndarray:
    """Checksums of an array on disk, read in pieces, as one long line in the order of the whole array."""
    (lines, width), sums = entry.shape, np.zeros_like(entry.sums)
    several = max(1, PIECE // width)
    for line in range(0, lines, several):
        for start in range(0, width, PIECE):
            piece = dataset[line : line + several, start : min(start + PIECE, width)].reshape(1, -1)
            sums += block_sums(piece, line * width + start, lines * width)
    return sums


def _read_seal(block: bytes) -> dict:
    text, _, rest = block.partition(b"\n")
    if not text:
        raise Damaged("it is not finished: it has no seal")
    own = hashlib.sha256(text + b"\n").hexdigest().encode() + b"\n"
    if rest != own.ljust(SEAL_BYTES - len(text) - 1, b"\0"):
        raise Damaged("its seal is changed, or it is no checkpoint")
    about = json.loads(text)
    if about.get("pgfmd checkpoint") != FORMAT:
        raise Damaged(f"it has format {about.get('pgfmd checkpoint')}, this version of pgfmd reads {FORMAT}")
    return about


def _spans_of_arrays(file: h5py.File) -> list[tuple[int, int]]:
    """(offset, bytes) of every array's data."""
    found = []

    def visit(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and name != HEAD:
            found.append((item.id.get_offset(), item.id.get_storage_size()))

    file.visititems(visit)
    return found


def _others(spans: list[tuple[int, int]], size: int) -> list[tuple[int, int]]:
    """(offset, bytes) of everything between the seal and the end of the file that belongs to no array."""
    edges = [SEAL_BYTES]
    for start, length in sorted(spans):
        edges += [start, start + length]
    edges.append(size)
    return [(start, end - start) for start, end in zip(edges[::2], edges[1::2], strict=True) if end > start]


def _digest(file: Any, spans: list[tuple[int, int]]) -> str:
    digest = hashlib.sha256()
    for start, length in spans:
        digest.update(os.pread(file.fileno(), length, start))
    return digest.hexdigest()
