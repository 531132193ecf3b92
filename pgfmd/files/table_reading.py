"""Tables of a run read back: piece by piece, as a long run's has millions of rows, or the end of one that grows. What
is read is one of the layouts that the table's declaration knows (tables.py), and can be held against it (`faults_of`).
No MPI.
"""

from __future__ import annotations

import contextlib
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.errors import ResultError

from .storage import reason
from .tables import CURVE, Column, CurveRow, Table

NUMPY_TYPES: Mapping[type, Any] = {float: "f8", int: "i8", str: object}
"""Of a column, by its kind. Texts are objects: any width that an array had for them would cut a longer one."""
PIECE = 2**14
"""Rows that are read at a time."""
PIECE_BYTES = 2**20
"""Bytes that are read at a time where lines are only counted."""
SHOWN = 80
"""Letters of a broken line that are shown."""
TAIL_BYTES = 2**16
"""How much of a growing curve is looked at: some hundred rows."""
RISE = 0.75
"""A slope reaches back to where the force was this share of what it is."""


def read_columns(path: Path, table: Table) -> dict[str, np.ndarray]:
    """The columns of a table, (rows,) each, by their titles: of float64, int64, or objects that are texts.

    A last line without its end, which a live run has just begun, is left out. Columns that a table of an earlier
    version does not have are NaN.

    Raises:
        ResultError: if it can't be read, has other columns, or a line that is no row.
    """
    try:
        # What a live run adds from here on is left out.
        most = max(count_ends(path) - 1, 0)
        found = {entry.title: np.empty(most, NUMPY_TYPES[entry.kind]) for entry in table.columns}
        rows = 0
        for piece in pieces_of(path, table, most):
            count = len(piece[table.titles[0]])
            if not rows:
                # Whole numbers that are missing are NaN, which is none.
                found = {title: np.empty(most, piece[title].dtype) for title in found}
            for title, values in piece.items():
                found[title][rows : rows + count] = values
            rows += count
    except (OSError, ValueError) as problem:
        raise ResultError(f"{path}: could not be read: {reason(problem)}") from problem
    return {title: values[:rows] for title, values in found.items()}


def pieces_of(path: Path, table: Table, most: int) -> Iterator[dict[str, np.ndarray]]:
    """The first `most` rows as `read_columns` has them, so many at a time; none of an empty table.

    Raises:
        ResultError: as there; OSError, ValueError: if the file can't be read, or is no text.
    """
    with open(path, encoding="utf-8", newline="\n") as file:
        there = _layout_of(path, file.readline(), table)
        missing = [entry for entry in table.columns if entry not in there]
        dtype = [(entry.title, NUMPY_TYPES[entry.kind]) for entry in there]
        for piece in _parsed(islice(file, most), path, dtype):
            found = {entry.title: piece[entry.title] for entry in there}
            found |= {entry.title: _shared_texts(found[entry.title]) for entry in there if entry.kind is str}
            yield found | {entry.title: np.full(len(piece), np.nan) for entry in missing}


def _layout_of(path: Path, line: str, table: Table) -> tuple[Column, ...]:
    """The columns that a table's first line names, of this version or an earlier one. ResultError for others."""
    for columns, header in zip(table.layouts, table.headers, strict=True):
        if line == header:
            return columns
    found, expected = line.removesuffix("\n") if line.endswith("\n") else "", table.headers[0].rstrip("\n")
    raise ResultError(f"{path}: its first line is {found!r}, expected {expected!r}; a run of another version of pgfmd?")


def _parsed(all_lines: Iterator[str], path: Path, dtype: list[tuple[str, Any]]) -> Iterator[np.ndarray]:
    first = 2
    while lines := list(islice(all_lines, PIECE)):
        if not any(line.strip() for line in lines):
            first += len(lines)
            continue
        try:
            yield np.loadtxt(lines, dtype, delimiter=",", ndmin=1, comments=None)
        except ValueError:
            number = next((k for k, line in enumerate(lines) if not _is_row(line, dtype)), 0)
            text = lines[number].rstrip("\n")
            shown = text if len(text) <= SHOWN else f"{text[:SHOWN]}..."
            raise ResultError(f"{path}: could not be read: line {first + number} is no row of it: {shown!r}") from None
        first += len(lines)


def _is_row(line: str, dtype: list[tuple[str, Any]]) -> bool:
    try:
        return not line.strip() or np.loadtxt([line], dtype, delimiter=",", comments=None).size == 1
    except ValueError:
        return False


def _shared_texts(values: np.ndarray) -> np.ndarray:
    """The same texts, those in a row that are alike as one object: few bytes each, however long a text is."""
    starts = np.flatnonzero(np.concatenate(([True], values[1:] != values[:-1])))
    return np.repeat(values[starts], np.diff([*starts, len(values)]))


@dataclass(frozen=True)
class ColumnFault:
    """A number or text of a column that its declaration does not allow; row: the first of them, from 0."""

    title: str
    what: str
    row: int

    def __str__(self) -> str:
        return f"{self.title} {self.what} in row {self.row}"


def faults_of(table: Table, pieces: Iterable[Mapping[str, Any]]) -> Iterator[ColumnFault]:
    """What the columns of a table hold and can't, by its declaration: the first of each kind in each piece.

    pieces: of the table, one after the other, as `pieces_of` gives them; a whole table is one.
    """
    rows = 0
    last: dict[str, Any] = {}
    for piece in pieces:
        # Of an earlier version all columns are missing that came after the same one.
        lacking = [entry for entry in table.columns if entry.after]
        known = {entry.after for entry in lacking if not np.isnan(np.asarray(piece[entry.title])).all()}
        for entry in table.columns:
            values = np.asarray(piece[entry.title])
            if entry.after and entry.after not in known:
                continue
            for what, wrong in _wrong(entry, values, last.get(entry.title)):
                if wrong.any():
                    yield ColumnFault(entry.title, what, rows + int(np.argmax(wrong)))
            if len(values):
                last[entry.title] = values[-1]
        rows += len(values)


def _wrong(entry: Column, values: np.ndarray, before: Any) -> Iterator[tuple[str, np.ndarray]]:
    """What may be wrong, and in which rows it is; before: the value above the first, None where there is none."""
    if entry.kind is float:
        yield "not finite", np.isinf(values) if entry.may_lack else ~np.isfinite(values)
    if entry.at_least is not None:
        yield f"below {entry.at_least:g}", values < entry.at_least
    if entry.never_falls and len(values):
        yield "falls", np.diff(values, prepend=values[0] if before is None else before) < 0
    if entry.one_of:
        yield f"none of {', '.join(map(repr, entry.one_of))}", ~np.isin(values.astype(str), entry.one_of)


def count_ends(path: Path, start: int = 0, ending: str = "") -> int:
    """How many lines end with these characters, from an offset at the beginning of a line on. OSError."""
    wanted, count, kept = f"{ending}\n".encode(), 0, b""
    with open(path, "rb") as file:
        file.seek(start)
        while piece := file.read(PIECE_BYTES):
            text = kept + piece
            count += text.count(wanted)
            # The beginning of an ending that goes on in the next piece.
            kept = text[max(0, len(text) - len(wanted) + 1) :] if len(wanted) > 1 else b""
    return count


def is_earlier(path: Path) -> bool:
    """Whether a curve is of version 0.1, which counts overlap as contact, and has no column of overlap. OSError if it
    can't be read."""
    return all(entry.name != "overlap_area" for entry in _columns_of_curve(path))


def _columns_of_curve(path: Path) -> tuple[Column, ...]:
    """The columns of a curve by its first line; those of this version where that is no header."""
    with open(path, "rb") as file:
        start = file.read(max(map(len, CURVE.headers)))
    known = zip(CURVE.layouts, CURVE.headers, strict=True)
    return next((columns for columns, header in known if start.startswith(header.encode())), CURVE.columns)


class CurveTail:
    """The end of a curve, which may be long and may be growing: up to its last newline, or up to `end` [bytes].

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
        columns = _columns_of_curve(path)
        found = [_curve_row(line.decode(errors="replace"), columns) for line in lines]
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
        travel = before.displacement - last.displacement
        return (last.force - before.force) / travel if travel > 0.0 and last.force > before.force else None


def _curve_row(line: str, columns: Sequence[Column]) -> CurveRow | None:
    """The row of a line that has these columns, NaN where it has none; None if it is no such line."""
    cells = line.split(",")
    if len(cells) != len(columns):
        return None
    with contextlib.suppress(ValueError):
        values = {entry.name: entry.kind(cell) for entry, cell in zip(columns, cells, strict=True)}
        return CurveRow(**{entry.name: values.get(entry.name, math.nan) for entry in CURVE.columns})
    return None
