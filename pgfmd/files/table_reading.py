"""A table of a run read back, piece by piece: a long run's has millions of rows. No MPI."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.errors import ResultError

from .curve_tail import count_ends
from .storage import reason

NUMPY_TYPES = {"float": "f8", "int": "i8", "str": "U64"}
"""Of a column, by how the field of its row is declared."""
PIECE = 2**14
"""Rows that are read at a time."""
SHOWN = 80
"""Letters of a broken line that are shown."""


def read_table(
    path: Path, columns: tuple[str, ...], row: type, earlier: tuple[str, ...] = ()
) -> dict[str, np.ndarray]:
    """Its columns, (rows,) each, by what the header calls them: of float64, int64, or objects that are texts.

    A last line without its end, which a live run has just begun, is left out. row: the dataclass of its rows. earlier:
    those of the columns that tables of an earlier version had; all others, which are numbers, are then NaN.

    Raises:
        ResultError: if it can't be read, has other columns, or a line that is no row.
    """
    kinds = [NUMPY_TYPES[entry.type] for entry in dataclasses.fields(row)]
    try:
        # What a live run adds from here on is left out.
        most = max(count_ends(path) - 1, 0)
        found = {name: np.empty(most, _kept_as(kind)) for name, kind in zip(columns, kinds, strict=True)}
        rows = 0
        with open(path, encoding="utf-8", newline="\n") as file:
            there = _columns_of(path, file.readline(), columns, earlier)
            for name in set(columns).difference(there):
                found[name][:] = np.nan
            kept = [(name, kind) for name, kind in zip(columns, kinds, strict=True) if name in there]
            for piece in _pieces(islice(file, most), path, kept):
                for name in there:
                    part = piece[name]
                    found[name][rows : rows + len(piece)] = _shared_texts(part) if part.dtype.kind == "U" else part
                rows += len(piece)
    except (OSError, ValueError) as problem:
        raise ResultError(f"{path}: could not be read: {reason(problem)}") from problem
    return {name: values[:rows] for name, values in found.items()}


def _columns_of(path: Path, line: str, columns: tuple[str, ...], earlier: tuple[str, ...]) -> tuple[str, ...]:
    """The columns that a table's first line names, of this version or an earlier one. ResultError for others."""
    header = line.removesuffix("\n") if line.endswith("\n") else ""
    for there in filter(None, (columns, earlier)):
        if header == ",".join(there):
            return there
    raise ResultError(
        f"{path}: its first line is {header!r}, expected {','.join(columns)!r}; a run of another version of pgfmd?"
    )


def _pieces(all_lines: Iterator[str], path: Path, dtype: list[tuple[str, str]]) -> Iterator[np.ndarray]:
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


def _is_row(line: str, dtype: list[tuple[str, str]]) -> bool:
    try:
        return not line.strip() or np.loadtxt([line], dtype, delimiter=",", comments=None).size == 1
    except ValueError:
        return False


def _kept_as(kind: str) -> Any:
    return object if kind.startswith("U") else kind


def _shared_texts(values: np.ndarray) -> np.ndarray:
    """The same texts as objects, those in a row that are alike as one: few bytes each, however long a text is."""
    starts = np.flatnonzero(np.concatenate(([True], values[1:] != values[:-1])))
    texts = np.array([str(text) for text in values[starts]], dtype=object)
    return np.repeat(texts, np.diff([*starts, len(values)]))
