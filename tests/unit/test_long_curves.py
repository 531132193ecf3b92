"""Tables of millions of rows: read in pieces, drawn by the rows that are seen, opened without being held in memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.errors import ResultError
from pgfmd.files import table_reading
from pgfmd.files.table_reading import read_columns
from pgfmd.files.table_writing import TableFile
from pgfmd.files.tables import CURVE, CurveRow
from pgfmd.plots.drawing import seen, seen_rows
from pgfmd.results import load

PHASES = np.array(["approach", "dwell", "retract"])


def write(path, rows: int) -> np.ndarray:
    """A curve with these numbers in its rows; returns them, (rows, 11), with cycle and stage."""
    numbers = np.random.default_rng(3).standard_normal((rows, 11)) * 1e-6
    numbers[:, 9:] = np.arange(2 * rows).reshape(rows, 2)
    phases = PHASES[3 * np.arange(rows) // rows]
    lines = [
        ",".join([*map(repr, row[:9]), *(str(int(k)) for k in row[9:]), phase])
        for row, phase in zip(numbers.tolist(), phases, strict=True)
    ]
    path.write_text("\n".join([",".join(CURVE.titles), *lines, ""]))
    return numbers


def test_every_bit_is_read_across_pieces(tmp_path, monkeypatch):
    monkeypatch.setattr(table_reading, "PIECE", 10)
    for rows in (0, 1, 10, 25):
        numbers = write(tmp_path / "curve.csv", rows)
        with open(tmp_path / "curve.csv", "a") as file:
            file.write("1.0,2.0")
        found = read_columns(tmp_path / "curve.csv", CURVE)
        assert np.array_equal(np.column_stack([found[name] for name in CURVE.titles[:-1]]).reshape(rows, 11), numbers)
        assert list(found["phase"]) == list(PHASES[3 * np.arange(rows) // max(rows, 1)])
        assert len(load(tmp_path).curve) == rows
    # No more texts than there are runs of them in a piece.
    assert len({id(text) for text in found["phase"]}) == 5


def test_a_broken_line_is_named_by_its_number(tmp_path, monkeypatch):
    monkeypatch.setattr(table_reading, "PIECE", 10)
    write(tmp_path / "curve.csv", 25)
    lines = (tmp_path / "curve.csv").read_text().splitlines()
    for wrong in ("1,2,3", "oops,0,0,0,0,0,0,0,0,1,1,dwell", "\0" * 200):
        (tmp_path / "curve.csv").write_text("\n".join([*lines[:17], wrong, *lines[18:], ""]))
        with pytest.raises(ResultError, match="could not be read: line 18 is no row of it: ") as caught:
            read_columns(tmp_path / "curve.csv", CURVE)
        assert len(str(caught.value)) < 500 + len(str(tmp_path))


def test_a_thinned_line_keeps_its_ends_and_extremes():
    x = np.linspace(0.0, 1.0, 300_001)
    y = np.sin(40.0 * x)
    y[123_456], y[-2] = 7.0, -7.0
    rows = seen_rows(x, y)
    assert rows[0] == 0 and rows[-1] == len(x) - 1 and {123_456, len(x) - 2} <= set(rows) and len(rows) < 12_000
    assert np.all(np.diff(rows) > 0) and np.array_equal(seen(x, y)[1], y[rows])
    # No part of it goes further than the rows that are drawn.
    for part in np.array_split(np.arange(len(x)), 1500):
        near = y[rows[(rows >= part[0] - 300) & (rows <= part[-1] + 300)]]
        assert near.min() <= y[part].min() and near.max() >= y[part].max()
    assert np.array_equal(seen_rows(x[:50], y[:50]), np.arange(50))


def test_a_long_table_is_opened_and_cut_back_in_little_memory(tmp_path):
    path, row = tmp_path / "curve.csv", CurveRow(*[0.1] * 9, 1, 1, "approach")
    write(path, 30_000)
    size = path.stat().st_size
    with open(path, "a") as file:
        file.write("0.5,half a row")
    tracemalloc.start()
    file = TableFile(CURVE, path, MPI.COMM_SELF)
    assert file.rows == 30_000 and path.stat().st_size == size
    mark = file.mark()
    file.append(row)
    file.cut_back(mark)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert path.stat().st_size == size == mark["bytes"] and file.mark() == mark
    assert most < size / 2 < 4e6
