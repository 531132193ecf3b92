"""Files with a displacement or a load against time for a machine to follow. No MPI."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

import numpy as np

from pgfmd.errors import MeasurementError

from .column_names import Vocabulary
from .text_table import read_table

EXAMPLE = {"displacement": "time (s), indentation (um)", "load": "time (s), force (mN)"}
NAMES = {
    "time": ("time", "t", "test time", "elapsed time", "total time", "zeit"),
    "indentation": ("indentation", "depth", "penetration", "indentation depth", "eindringtiefe"),
    "displacement": ("displacement", "position", "d", "z", "u", "gap", "extension", "weg"),
    "force": ("force", "load", "normal force", "f", "F", "kraft", "normalkraft"),
}
"""Column names by quantity."""
MOST_ROWS = 100_000


def read_path(path: str | Path, of: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Times [s] and displacements [m], negative when the punch is pushed in, or loads [N], positive in compression.

    of: "displacement", whose column is called indentation and grows inwards, or "load". A file that has not changed is read
    once. Raises MeasurementError for a file that can't be read, or whose times do not grow; OSError where there is none.
    """
    found = os.stat(path)
    return _read(str(path), of, (found.st_mtime_ns, found.st_size))


@lru_cache(maxsize=8)
def _read(path: str, of: str, version: tuple[int, int]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """As `read_path`; version: of the file."""
    table = read_table(path, Vocabulary(NAMES), EXAMPLE[of])
    wanted = "indentation" if of == "displacement" else "force"
    columns = {}
    for quantity in ("time", wanted):
        found = table.found(quantity)
        if len(found) != 1:
            cure = ""
            if quantity == "indentation" and not found and table.found("displacement"):
                cure = ": a displacement may grow inwards or outwards; call it indentation, which grows inwards"
            raise MeasurementError(
                f"{table.where}: expected one column of {quantity}, such as {EXAMPLE[of]}, found {table.titles}{cure}"
            )
        columns[quantity] = found[0]
    numbers = table.numbers(columns)
    dimensions = {"time": "time", "indentation": "length", "force": "force"}
    si = {q: numbers[q] * table.factor(columns[q], dimensions[q], EXAMPLE[of]) for q in columns}
    time, values = si["time"], si[wanted] if of == "load" else -si[wanted]
    bad = ~(np.isfinite(time) & np.isfinite(values))
    if bad.any():
        lines = [f"line {table.rows[row][0]}: expected two numbers" for row in np.flatnonzero(bad)]
        raise table.refuse(lines)
    if not 2 <= len(time) <= MOST_ROWS:
        raise MeasurementError(f"{table.where}: expected 2 to {MOST_ROWS} rows, found {len(time)}")
    if (back := np.flatnonzero(np.diff(time) <= 0.0)).size:
        line = table.rows[back[0] + 1][0]
        raise MeasurementError(f"{table.path}, line {line}: expected times that grow from row to row")
    return tuple(time.tolist()), tuple(values.tolist())
