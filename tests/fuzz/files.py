"""The files that scenes name: height maps and compliances, good and broken ones."""

from __future__ import annotations

import math
import struct
from pathlib import Path

import numpy as np

MAPS = ("smooth.npy", "rough.csv", "level.npz", "tilted.npy", "whole.npy", "narrow.txt")
"""Height maps that can be used, if a scene gives them their size, and WHOLE its unit."""
WHOLE = "whole.npy"
"""Heights that count steps."""
BROKEN = (
    "garbage.npy", "empty.npy", "holes.npy", "single.npy", "line.csv", "words.csv", "archive.npz", "huge.npy",
    "objects.npy", "complex.npy", "nothing.npz", "unknown.bmp", "no-such-file.npy", "folder.npy", ".",
    "~nosuchuser/x.npy",
)  # fmt: skip
"""Files that can't be used as a map."""
COMPLIANCE = "compliance.txt"
"""An elastic half-space of E* = 2.65 MPa as a table, from 1e-6 to 1e12 rad/m."""
LAW = "law.txt"
"""A law of adhesion as a table."""
BROKEN_COMPLIANCES = (
    "short.txt",
    "negative.txt",
    "backwards.txt",
    "one-column.txt",
    "words.csv",
    "no-such-file.txt",
    ".",
)


def write_files(folder: Path, length: float = 1e-3) -> None:
    """Writes all of them into a folder; length [m]: heights are of a thousandth of it, or less."""
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(0)
    y, x = (2 * math.pi * np.mgrid[0:24, 0:20] + math.pi) / 24
    np.save(folder / "smooth.npy", 1e-3 * length * (np.cos(x + 0.3) + np.sin(2 * y) + 0.3 * np.cos(3 * x - 2 * y)))
    np.savetxt(folder / "rough.csv", 2e-4 * length * random.normal(size=(17, 19)), delimiter=",")
    np.savez(folder / "level.npz", z=np.zeros((96, 96)), size=np.array([4 * length, 4 * length]))
    np.save(folder / "tilted.npy", 1e-4 * length * x)
    np.save(folder / "whole.npy", (np.arange(24 * 36) % 3).reshape(24, 36).astype(np.int32))
    np.savetxt(folder / "narrow.txt", 1e-4 * length * random.normal(size=(24, 36)))
    wave = np.logspace(-6, 12, 40)
    np.savetxt(folder / COMPLIANCE, np.column_stack([wave, 2 / (2.65e6 * wave)]))
    (folder / LAW).write_text("gap [nm], traction [kPa]\n0 0\n20 60\n80 25\n200 0\n", encoding="utf-8")
    _write_broken(folder, wave)


def _write_broken(folder: Path, wave: np.ndarray) -> None:
    (folder / "garbage.npy").write_bytes(b"not numpy's")
    (folder / "empty.npy").write_bytes(b"")
    np.save(folder / "holes.npy", np.full((8, 8), np.nan))
    np.save(folder / "single.npy", np.zeros((1, 1)))
    (folder / "line.csv").write_text("1,2,3\n", encoding="utf-8")
    (folder / "words.csv").write_text("height,of\nthe,punch\n", encoding="utf-8")
    (folder / "archive.npz").write_bytes(b"PK\003\004junk")
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000, 100000), }".ljust(117) + b"\n"
    (folder / "huge.npy").write_bytes(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head)
    np.save(folder / "objects.npy", np.array([["a", None], [1, 2.0]], dtype=object), allow_pickle=True)
    np.save(folder / "complex.npy", np.full((8, 8), 1j))
    np.savez(folder / "nothing.npz")
    (folder / "unknown.bmp").write_bytes(b"BM")
    (folder / "folder.npy").mkdir(exist_ok=True)
    np.savetxt(folder / "short.txt", np.array([[1.0, 1e-6]]))
    np.savetxt(folder / "negative.txt", np.column_stack([wave, -1 / wave]))
    np.savetxt(folder / "backwards.txt", np.column_stack([wave, 1 / wave])[::-1])
    np.savetxt(folder / "one-column.txt", wave)
