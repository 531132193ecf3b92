"""The end of a curve.csv, which may be long and may be growing: its last rows, and how many there are. No MPI."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

from .curve_file import CURVE_COLUMNS, EARLIER_CURVE_COLUMNS, CurveRow

TAIL_BYTES = 2**16
"""How much of the file is looked at: some hundred rows."""
PIECE = 2**20
RISE = 0.75
"""A slope reaches back to where the force was this share of what it is."""


class CurveTail:
    """Up to the last newline of a file, or up to `end` [bytes].

    rows: the last ones, oldest first; empty if there is none yet. strange: how many lines among them are no rows of a
    curve, and are left out. written [s since 1970]: when the file was. earlier: whether it is of version 0.1
    (is_earlier). OSError if it can't be read.
    """

    def __init__(self, path: Path, end: int | None = None):
        self.path = path
        with open(path, "rb") as file:
            about = os.fstat(file.fileno())
            self.written = about.st_mtime
            end = about.st_size if end is None else min(end, about.st_size)
            start = max(0, end - TAIL_BYTES)
            file.seek(start)
            text = file.read(end - start)
        # The header, or a row of which the beginning is missing; after the last newline, a row that is being written.
        lines = text[: text.rfind(b"\n") + 1].split(b"\n")[1:-1]
        self.earlier = is_earlier(path)
        columns = EARLIER_CURVE_COLUMNS if self.earlier else CURVE_COLUMNS
        found = [_row(line.decode(errors="replace"), columns) for line in lines]
        self.rows = [row for row in found if row]
        self.strange = len(found) - len(self.rows)

    @property
    def stiffness(self) -> float | None:
        """Slope [N/m] of the force over the indentation in the last rows of an approach; None if it has not risen."""
        rows = [row for row in self.rows if row.phase == "approach"]
        if not rows or rows[-1].force <= 0.0:
            return None
        last = rows[-1]
        before = next((row for row in reversed(rows) if row.force <= RISE * last.force), rows[0])
        way = before.displacement - last.displacement
        return (last.force - before.force) / way if way > 0.0 and last.force > before.force else None


def is_earlier(path: Path) -> bool:
    """Whether a curve has the columns of version 0.1, which counts overlap as contact. OSError if it can't be read."""
    header = ",".join(EARLIER_CURVE_COLUMNS).encode() + b"\n"
    with open(path, "rb") as file:
        return file.read(len(header)) == header


def count_ends(path: Path, start: int = 0, ending: str = "") -> int:
    """How many lines end with these characters, from an offset at the beginning of a line on. OSError."""
    wanted, count, kept = f"{ending}\n".encode(), 0, b""
    with open(path, "rb") as file:
        file.seek(start)
        while piece := file.read(PIECE):
            text = kept + piece
            count += text.count(wanted)
            # The beginning of an ending that goes on in the next piece.
            kept = text[max(0, len(text) - len(wanted) + 1) :] if len(wanted) > 1 else b""
    return count


def _row(line: str, columns: tuple[str, ...]) -> CurveRow | None:
    """The row of a line that has these columns, NaN where it has none; None if it is no such line."""
    values = dict(zip(columns, line.split(","))) if line.count(",") == len(columns) - 1 else {}
    with contextlib.suppress(ValueError):
        numbers = [float(values.get(name, "nan")) for name in CURVE_COLUMNS[:-1]]
        return CurveRow(*numbers, values[CURVE_COLUMNS[-1]]) if values else None
    return None
