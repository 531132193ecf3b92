"""The table of a study: a row for each case, with its values on the axes and its results. SI units, named in the
header. No MPI.

Areas are contact, overlap and near, each with its own name. A case that counted only overlap has numbers in the columns
of overlap only.
"""

from __future__ import annotations

import csv
import html
import io
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pgfmd.errors import ResultError
from pgfmd.files import storage
from pgfmd.files.regular_files import write_atomically
from pgfmd.physics.drive import DETACHED, ENDED_WELL
from pgfmd.results import load
from pgfmd.results.curve import KINDS_OF_AREA, Loop, measure
from pgfmd.scene.dotted_keys import value_of

from .case_state import CaseState
from .cases import Case
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
AREAS = {
    f"{name.format(kind)} [m^2]": (kind, moment)
    for kind in KINDS_OF_AREA
    for moment, name in (
        ("at_preload", "{}_area_at_preload"), ("largest", "largest_{}_area"), ("at_pull_off", "{}_area_at_pull_off"),
    )
}  # fmt: skip
"""Columns of areas, with the kind of area in `Measures.areas` and the moment."""
GAPS = {"contact_gap [m]": "contact", "near_gap [m]": "near"}
"""Columns with the gaps below which points count, and their areas."""
AREA_COLUMNS = (*AREAS, *GAPS)
AT_PRELOAD = "{}_area_at_preload [m^2]"
MOST_NAMED = 5
"""Number of cases that a remark names."""
COLUMNS = (*MEASURED, *AREA_COLUMNS)
"""All columns after the axes and the state."""
OF_LOOP = ("work [J]", "energy_residual [1]", "work_uncertainty [J]")
"""Columns without meaning if the loop is not closed."""


@dataclass(frozen=True)
class Row:
    """A case with its state. places: its value on each axis, an SI number, a text, or None for a single case on an axis
    of bundles. measured: numbers by COLUMNS, None if there is none yet. trouble: why the curve of a case can't be
    read."""

    case: Case
    state: CaseState
    places: dict[str, Any]
    measured: dict[str, float | None]
    trouble: str = ""


def rows_of(
    cases: Sequence[Case], axes: Sequence[Axis], states: dict[str, CaseState], out: Path | None = None
) -> list[Row]:
    """The rows of a study, in the order of its cases. out: the folder of their folders; without it there are no
    areas."""
    rows = []
    for case in cases:
        state = states[case.name]
        record = state.record or {}
        measured = {column: record.get(key) for column, key in MEASURED.items()}
        if record.get("finished", DETACHED) not in ENDED_WELL:
            measured |= dict.fromkeys(OF_LOOP)
        measured |= dict.fromkeys(AREA_COLUMNS)
        trouble = ""
        if out and record:
            try:
                measured |= areas_of(out / case.name)
            except ResultError as error:
                trouble = str(error)
        rows.append(Row(case, state, {axis.name: place_of(case, axis) for axis in axes}, measured, trouble))
    if any((row.state.record or {}).get("cycles") for row in rows):
        for row in rows:
            row.measured.update(_of_last_cycle(row.state.record or {}))
    if any(case.twin for case in cases):
        # Not at the top: few studies have twins.
        from .twins import add_shares

        add_shares(rows)
    return rows


LAST_CYCLE = {
    "pull_off_force_of_last_cycle [N]": "pull_off_force_N",
    "work_of_separation_of_last_cycle [J]": "work_of_separation_J",
    "work_of_last_cycle [J]": "work_J",
}
"""Further columns of studies with a programme with repeats, and the key of a cycle in `run.json`."""


def _of_last_cycle(record: Mapping[str, Any]) -> dict[str, float | None]:
    """The number of cycles, and numbers of the last one, None for a run without repeats or that has not ended."""
    cycles = record.get("cycles") or [{}]
    return {"cycles": cycles[-1].get("cycle")} | {column: cycles[-1].get(key) for column, key in LAST_CYCLE.items()}


def areas_of(folder: Path) -> dict[str, float | None]:
    """Numbers by AREA_COLUMNS, None if unknown. Raises ResultError if the curve can't be read."""
    with load(folder) as results:
        found = measure(Loop.of(results)).areas
        gaps = {"contact": results.contact_gap, "near": results.near_gap}
    areas = {column: getattr(found.get(kind), moment, None) for column, (kind, moment) in AREAS.items()}
    return areas | {column: gaps[kind] if kind in found else None for column, kind in GAPS.items()}


def place_of(case: Case, axis: Axis) -> Any:
    """The value of a case on an axis: that of the key in its scene, SI, or the name of its bundle."""
    if axis.bundles:
        return case.places.get(axis.name)
    value = value_of(case.scene, axis.name)
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return value if number or value is None else label_of_value(value)


def write_table(path: Path, rows: Sequence[Row], axes: Sequence[Axis]) -> None:
    """Write the table as CSV. Raises ResultError if that can't be done."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["case", *map(_head, axes), "state", *_columns(rows)])
    for row in rows:
        cells = [*row.places.values(), str(row.state).splitlines()[0], *row.measured.values()]
        writer.writerow([row.case.name, *("" if cell is None else _plain(cell) for cell in cells)])
    try:
        write_atomically(path, text.getvalue().encode())
    except OSError as error:
        raise ResultError(f"{path}: could not be written: {storage.reason(error)}") from error


def _columns(rows: Sequence[Row]) -> Sequence[str]:
    """The columns after the state."""
    return list(rows[0].measured) if rows else COLUMNS


def _plain(cell: Any) -> Any:
    # Not -0.0.
    return cell + 0.0 if isinstance(cell, float) else cell


@dataclass(frozen=True, eq=False)
class StudyTable:
    """The table of a study: a row for each case, with its values on the axes and the measured numbers. SI units.

    `table["pull_off_force [N]"]` is a column. rows: in the order of the cases; axes: of the study; out: the folder of
    the cases' folders; title: of pictures.
    """

    rows: list[Row]
    axes: tuple[Axis, ...]
    out: Path
    title: str = ""

    @property
    def columns(self) -> list[str]:
        """What the header calls them: "case", the axes, "state", COLUMNS, and `twins.SHARE` where there are twins."""
        return ["case", *map(_head, self.axes), "state", *_columns(self.rows)]

    def __getitem__(self, name: str) -> list[Any]:
        """A column with an entry for each case: numbers, texts, or None if there is nothing yet. KeyError if there is
        none."""
        if name not in self.columns:
            raise KeyError(f"{name!r}: expected one of {', '.join(self.columns)}")
        place = self.columns.index(name)
        return [cells[place] for cells in self._cells()]

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """The rows as mappings by column."""
        return (dict(zip(self.columns, cells, strict=True)) for cells in self._cells())

    def _cells(self) -> Iterator[list[Any]]:
        for row in self.rows:
            yield [row.case.name, *row.places.values(), str(row.state).splitlines()[0], *row.measured.values()]

    @property
    def remarks(self) -> list[str]:
        """Remarks on the numbers."""
        return remarks(self.rows)

    def __repr__(self) -> str:
        return "\n".join(overview(self.rows))

    def _repr_html_(self) -> str:
        """The most important numbers, for notebooks."""
        head, *body = overview_cells(self.rows)
        lines = [f"<tr>{''.join(f'<th>{html.escape(cell)}</th>' for cell in head)}</tr>"]
        lines += [f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in cells)}</tr>" for cells in body]
        return f"<table>{''.join(lines)}</table>"

    def to_csv(self, path: str | Path) -> None:
        """Writes it as CSV. ResultError if that can't be done."""
        write_table(Path(path), self.rows, self.axes)

    def to_dataframe(self) -> Any:
        """A pandas DataFrame of all columns. ImportError where pandas is not installed."""
        try:
            import pandas
        except ImportError:
            raise ImportError("pandas is not installed: pip install pandas; or take the table's own columns") from None
        return pandas.DataFrame({name: self[name] for name in self.columns})


def _head(axis: Axis) -> str:
    return axis.name if axis.bundles else header(axis.name, unit_of(axis.name))


def counted_overlap(numbers: Mapping[str, float | None]) -> bool:
    """Whether a case has its overlap, but not its contact."""
    largest = "largest_{}_area [m^2]"
    return numbers.get(largest.format("overlap")) is not None and numbers.get(largest.format("contact")) is None


def remarks(rows: Sequence[Row]) -> list[str]:
    """Remarks on cases whose curve is missing, and on those that counted only overlap."""
    lost = [
        f"{row.case.name} has no areas and is in no picture of curves: {row.trouble}" for row in rows if row.trouble
    ]
    old = [row.case.name for row in rows if counted_overlap(row.measured)]
    if not old:
        return lost
    names = ", ".join(old[:MOST_NAMED]) + (f" and {len(old) - MOST_NAMED} more" if len(old) > MOST_NAMED else "")
    which = names if len(old) < len(rows) else "all cases"
    counted = "areas of overlap (gap < 0), not of contact"
    text = f"{which}: run by version 0.1 of pgfmd, which counted {counted}"
    if any(row.measured.get(AT_PRELOAD.format("contact")) is not None for row in rows):
        text += "; the other cases count contact: to compare them, move these folders away and run the study again"
    return [*lost, text]


def overview(rows: Sequence[Row]) -> list[str]:
    """The rows as lines for a terminal (`overview_cells`)."""
    lines = overview_cells(rows)
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines]


def overview_cells(rows: Sequence[Row]) -> list[list[str]]:
    """The most important numbers: a header and a line for each row. Contact is that at the preload."""
    columns = {
        "pull-off [mN]": ("pull_off_force [N]", 1e3),
        "separation [nJ]": ("work_of_separation [J]", 1e9),
        "loop [nJ]": ("work [J]", 1e9),
        "contact [mm2]": (AT_PRELOAD.format("contact"), 1e6),
        "residual [%]": ("energy_residual [1]", 1e2),
        "steps": ("steps", 1.0),
        "wall [s]": ("wall [s]", 1.0),
    }
    lines = [["case", *columns, "state"]]
    for row in rows:
        found = [(row.measured[column], factor) for column, factor in columns.values()]
        cells = ["" if value is None else f"{value * factor + 0.0:.4g}" for value, factor in found]
        lines.append([row.case.name, *cells, str(row.state).splitlines()[0]])
    return lines
