"""The table of a study: a row a case, its axes and what came out. SI units, named in the header. No MPI."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pgfmd.errors import ResultError
from pgfmd.files import storage
from pgfmd.files.regular_files import write_atomically
from pgfmd.results.curve import WHOLE

from . import areas
from .cases import Case
from .standing import Standing
from .study_file import Axis
from .values import header, label_of_value, unit_of

FILE = "table.csv"
MEASURED = {
    "pull_off_force [N]": "pull_off_force_N",
    "snap_in_force [N]": "snap_in_force_N",
    "preload [N]": "preload_N",
    "work_of_separation [J]": "work_of_separation_J",
    "work [J]": "work_J",
    "viscous [J]": "viscous_J",
    "released [J]": "released_J",
    "energy_residual [1]": "energy_residual",
    "range [m]": "range_m",
    "steps": "steps",
    "jumps": "jumps",
    "transform_pairs": "transform_pairs",
    "ranks": "ranks",
    "wall [s]": "wall_s",
    "peak_rss [bytes]": "peak_rss_bytes",
    "largest_force [N]": "largest_force_N",
    "time_to_preload [s]": "time_to_preload_s",
    "pull_off_force_uncertainty [N]": "pull_off_force_uncertainty_N",
    "snap_in_force_uncertainty [N]": "snap_in_force_uncertainty_N",
    "work_of_separation_uncertainty [J]": "work_of_separation_uncertainty_J",
    "work_uncertainty [J]": "work_uncertainty_J",
}
"""Columns after the axes, and the keys of `run.json` that they hold."""
COLUMNS = (*MEASURED, *areas.COLUMNS)
"""All columns after the axes and the state."""
OF_LOOP = ("work [J]", "energy_residual [1]", "work_uncertainty [J]")
"""Columns that mean nothing where the loop is not closed."""


@dataclass(frozen=True)
class Row:
    """A case with its standing. places: its value on each axis, an SI number, a text, or None for a single case on an
    axis of bundles; measured: numbers by COLUMNS, None where there is none yet."""

    case: Case
    standing: Standing
    places: dict[str, Any]
    measured: dict[str, float | None]


def rows_of(
    cases: Sequence[Case], axes: Sequence[Axis], standings: dict[str, Standing], out: Path | None = None
) -> list[Row]:
    """The rows of a study, in the order of its cases. out: the folder of their folders; without it, without areas."""
    rows = []
    for case in cases:
        standing = standings[case.name]
        record = standing.record or {}
        measured = {column: record.get(key) for column, key in MEASURED.items()}
        if record.get("finished", WHOLE) != WHOLE:
            measured |= dict.fromkeys(OF_LOOP)
        measured |= areas.areas_of(out / case.name) if out and record else dict.fromkeys(areas.COLUMNS)
        rows.append(Row(case, standing, {axis.name: place_of(case, axis) for axis in axes}, measured))
    return rows


def place_of(case: Case, axis: Axis) -> Any:
    """Where a case is on an axis: the key's value in its scene, SI, or the name of its bundle."""
    if axis.bundles:
        return case.places.get(axis.name)
    section, _, name = axis.name.rpartition(".")
    value = getattr(case.scene.section(section), name)
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return value if number or value is None else label_of_value(value)


def write_table(path: Path, rows: Sequence[Row], axes: Sequence[Axis]) -> None:
    """Write the table as CSV. Raises ResultError if that can't be done."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    heads = [axis.name if axis.bundles else header(axis.name, unit_of(axis.name)) for axis in axes]
    writer.writerow(["case", *heads, "state", *COLUMNS])
    for row in rows:
        cells = [*row.places.values(), str(row.standing).splitlines()[0], *row.measured.values()]
        writer.writerow([row.case.name, *("" if cell is None else _plain(cell) for cell in cells)])
    try:
        write_atomically(path, text.getvalue().encode())
    except OSError as error:
        raise ResultError(f"{path}: could not be written: {storage.reason(error)}") from error


def _plain(cell: Any) -> Any:
    # Not -0.0.
    return cell + 0.0 if isinstance(cell, float) else cell


def overview(rows: Sequence[Row]) -> list[str]:
    """The rows as lines for a terminal, with the numbers that are looked at first; contact is that at the preload."""
    columns = {
        "pull-off [mN]": ("pull_off_force [N]", 1e3),
        "separation [nJ]": ("work_of_separation [J]", 1e9),
        "loop [nJ]": ("work [J]", 1e9),
        "contact [mm2]": (areas.AT_PRELOAD.format("contact"), 1e6),
        "residual [%]": ("energy_residual [1]", 1e2),
        "steps": ("steps", 1.0),
        "wall [s]": ("wall [s]", 1.0),
    }
    lines = [["case", *columns, "state"]]
    for row in rows:
        found = [(row.measured[column], factor) for column, factor in columns.values()]
        cells = ["" if value is None else f"{value * factor + 0.0:.4g}" for value, factor in found]
        lines.append([row.case.name, *cells, str(row.standing).splitlines()[0]])
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip() for line in lines]
