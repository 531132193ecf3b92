"""From the table of a measured curve to its rows: displacement inwards, force in compression, in SI units.

Names determine the sense of a column: an indentation or depth grows inwards, and a gap or an extension outwards. A
displacement or a position of a piezo grows inwards by default. Approach and retraction may be in the same columns, one
after the other, or in columns of their own. Nothing is guessed: a column without a unit is an error, and so are two
columns of which only one can be meant.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import MeasurementError
from pgfmd.files.column_names import Column, Vocabulary
from pgfmd.files.numerals import is_missing, is_numeral
from pgfmd.files.text_lines import cells_of
from pgfmd.files.text_table import TextTable, read_table
from pgfmd.results.curve import Array

EXAMPLE = "displacement (um), force (mN)"
NAMES = {
    "indentation": ("indentation", "depth", "penetration", "indentation depth", "penetration depth", "eindringtiefe"),
    "displacement": (
        "displacement", "position", "u", "z", "d", "x", "weg", "standardweg", "traverse", "stage position", "disp",
        "punch displacement", "vertical displacement", "z displacement", "z position", "axial displacement",
    ),
    "piezo": (
        "piezo", "z piezo", "piezo displacement", "piezo position", "z sensor", "z-sensor", "zsensor", "z-sense", "z sense",
        "zsnsr", "calc ramp", "ramp", "z scanner",
    ),
    "extension": (
        "extension", "crosshead extension", "crosshead", "crosshead displacement", "tensile extension", "dehnweg",
        "tensile displacement",
    ),
    "gap": (
        "gap", "gap height", "spalt", "separation", "distance", "abstand", "tip-sample separation", "tip sample separation",
        "sep", "height", "height (measured)", "height (smoothed)", "measured height", "measured gap",
    ),
    "force": (
        "force", "load", "normal force", "f", "F", "fn", "F_N", "fz", "F_z", "normal load", "kraft", "normalkraft", "standardkraft",
        "prüfkraft", "axial force", "last", "vertical deflection", "vdeflection", "deflection", "defl", "load cell",
    ),
    "time": ("time", "t", "zeit", "test time", "elapsed time", "total time", "prüfzeit"),
    "cycle": ("cycle", "cycle number", "cycle count", "zyklus", "loop"),
    "segment": ("segment", "phase", "stage", "branch", "direction", "step name", "segment name", "abschnitt"),
}  # fmt: skip
"""Column names by quantity; the vertical deflection of a cantilever where it is given as a force."""
INWARDS = {"indentation": True, "displacement": True, "piezo": True, "extension": False, "gap": False}
"""Whether a column grows when the punch goes in, by default."""
PARTS = {
    "approach": ("approach", "extend", "ext", "ex", "loading", "trace", "forward", "advance", "annäherung", "belastung"),
    "retract": (
        "retract", "retraction", "withdraw", "rt", "ret", "unloading", "retrace", "backward", "rückzug", "entlastung",
        "retreat", "withdrawal", "unload",
    ),
}  # fmt: skip
"""Words for the branch, in titles of columns and in a column of segments."""
DIMENSIONS = {"force": "force", "time": "time"}
VOCABULARY = Vocabulary(NAMES, PARTS)


@dataclass
class Rows:
    """Rows of a measured curve, in the order of the file: indentation [m], growing inwards; force [N], positive in
    compression; time [s], NaN where it is not known; lines of the file, or numbers of rows; senses: the assumed senses
    of the columns, for messages; cycle: numbers of cycles in the file, None without any; remarks: corrections, in
    words."""

    path: Path
    indentation: Array
    force: Array
    time: Array
    lines: NDArray[np.int64]
    senses: str = ""
    cycle: Array | None = None
    remarks: list[str] = field(default_factory=list)

    def of(self, rows: slice | NDArray) -> Rows:
        """Some of the rows, in another order if the indices say so."""
        cycle = None if self.cycle is None else self.cycle[rows]
        parts = (self.indentation[rows], self.force[rows], self.time[rows], self.lines[rows])
        return Rows(self.path, *parts, self.senses, cycle, self.remarks)

    def taken(self, place: str, positive_displacement: str | None, positive_force: str) -> Rows:
        """The same rows, with indentation inwards and force in compression. place: the key of INWARDS of the position.
        positive_displacement: "in" or "out", None for the sense given by the name. positive_force: "compression" or
        "tension"."""
        inwards = INWARDS[place] if positive_displacement is None else positive_displacement == "in"
        direction, pressing = (1.0 if inwards else -1.0), (1.0 if positive_force == "compression" else -1.0)
        senses = f"the {place} is taken to grow {'inwards' if inwards else 'outwards'}, the force in {positive_force}"
        return replace(self, indentation=direction * self.indentation, force=pressing * self.force, senses=senses)


def rows_of(path: str | Path, positive_displacement: str | None, positive_force: str) -> Rows:
    """The rows of a file. positive_displacement: "in" or "out", None for the sense given by the name of the column;
    positive_force:
    "compression" or "tension". Raises MeasurementError."""
    table = read_table(path, VOCABULARY, EXAMPLE)
    columns = _with_parts(table)
    parts = [part for part in PARTS if any(column.part == part for column in columns)]
    if not parts:
        rows, place = _branch(table, columns, "")
        rows = rows.taken(place, positive_displacement, positive_force)
        labels = [VOCABULARY.part(text) for text in _texts(table, "segment", rows.lines)]
    else:
        found = [_branch(table, [c for c in columns if c.part in (part, "")], part) for part in parts]
        rows = _joined([branch for branch, _ in found]).taken(found[0][1], positive_displacement, positive_force)
        labels = [part for part, (branch, _) in zip(parts, found, strict=True) for _ in branch.force]
    rows.remarks[:0] = table.notes
    return _in_order(rows, np.array(labels)) if labels else rows


def _with_parts(table: TextTable) -> list[Column]:
    """The columns. If names occur twice, each gets the branch named in the line above."""
    columns = list(table.columns)
    twice = len({column.quantity for column in columns}) < len(columns) and not any(column.part for column in columns)
    if not (twice and table.preamble):
        return columns
    above = [VOCABULARY.part(cell) for cell in cells_of(table.preamble[-1], table.delimiter)]
    if set(above) - {""} != set(PARTS):
        return columns
    part, parts = "", []
    for place in range(len(table.header)):
        part = (above[place] if place < len(above) else "") or part
        parts.append(part)
    return [Column(c.quantity, c.unit, parts[c.place], c.place, c.title) for c in columns]


def _branch(table: TextTable, columns: list[Column], part: str) -> tuple[Rows, str]:
    """The rows of one branch, or of all, as in the file, and the quantity of the position. A shorter branch ends before
    the other one."""
    chosen = _chosen(table, columns, part)
    place = next(quantity for quantity in INWARDS if quantity in chosen)
    factors = {q: table.factor(c, DIMENSIONS.get(q, "length"), EXAMPLE) for q, c in chosen.items() if q != "cycle"}
    numbers = table.numbers(chosen)
    if "time" in numbers and not np.isfinite(numbers["time"]).any():
        del numbers["time"]
    cells = {quantity: table.cells(column.place) for quantity, column in chosen.items() if quantity in numbers}
    rows = np.arange(len(table.rows))
    if part:
        empty = [all(is_missing(cells[q][row].text) for q in (place, "force")) for row in rows]
        rows = rows[~np.array(empty)]
    problems = [
        f"line {cells[q][row].line}: {q} = '{cells[q][row].text}': expected a number"
        for row in rows for q in cells if not np.isfinite(numbers[q][row])
    ]  # fmt: skip
    if problems:
        raise table.refuse(problems)
    unknown = np.full(len(rows), np.nan)
    time = numbers["time"][rows] * factors["time"] if "time" in numbers and not part else unknown
    lines = np.array([table.rows[row][0] for row in rows])
    remarks: list[str] = []
    if "time" in numbers and not part and _time_falls(table, chosen["time"], time, lines):
        remarks.append(f"{table.path.name}: its time begins anew in each block, and was not used")
        time = unknown
    cycle = numbers["cycle"][rows] if "cycle" in numbers else None
    found = Rows(
        table.path, numbers[place][rows] * factors[place], numbers["force"][rows] * factors["force"], time, lines
    )
    return replace(found, cycle=cycle, remarks=remarks), place


def _chosen(table: TextTable, columns: list[Column], part: str) -> dict[str, Column]:
    """The columns that are used, by quantity: force, position, and time and cycle if there are any."""
    found: dict[str, list[Column]] = {}
    for column in columns:
        found.setdefault(column.quantity, []).append(column)
    places = ["indentation"] if "indentation" in found else [quantity for quantity in INWARDS if quantity in found]
    if "force" not in found or not places:
        raise MeasurementError(
            f"{table.where}: expected columns for displacement (or indentation, gap, extension, piezo) and force, found "
            f"{table.titles}; name columns and units as in {EXAMPLE}"
        )
    if len(places) > 1:
        titles = " and ".join(f"'{found[place][0].title}'" for place in places)
        raise MeasurementError(
            f"{table.where}: expected one column that says the position, found {titles}; rename the one that is not to be used"
        )
    chosen = {}
    for quantity in (places[0], "force", *({"time", "cycle"} & found.keys())):
        several = found[quantity]
        if len(several) > 1:
            titles = " and ".join(f"'{column.title}'" for column in several)
            raise MeasurementError(
                f"{table.where}: expected one column with {quantity}, found several ({titles}); rename those that are not to "
                "be used; if approach and retraction stand side by side, begin their titles with these words, or put the "
                "rows of the retraction below those of the approach"
            )
        chosen[quantity] = several[0]
    if "time" in chosen and not any(is_numeral(cell.text) for cell in table.cells(chosen["time"].place)):
        # Times of day: the rows are in their order.
        del chosen["time"]
    return chosen


def _time_falls(table: TextTable, column: Column, time: Array, lines: NDArray) -> bool:
    """Whether the time starts again in repeated blocks. Raises MeasurementError if it decreases elsewhere, because then
    the order of rows is wrong."""
    falls = np.flatnonzero(np.diff(time) < 0)
    for row in falls:
        if not any(lines[row] < line < lines[row + 1] for line in table.repeated):
            texts = {cell.line: cell.text for cell in table.cells(column.place)}
            raise MeasurementError(
                f"{table.path}, line {lines[row + 1]}: time = '{texts[lines[row + 1]]}': expected a time that does not fall, "
                f"it was '{texts[lines[row]]}' in line {lines[row]}; bring the rows into the order in which they were "
                "measured, or delete the column if their order is right"
            )
    return bool(falls.size)


def _joined(branches: list[Rows]) -> Rows:
    """Branches one after the other."""
    indentation, force, time, lines = (
        np.concatenate([getattr(b, name) for b in branches]) for name in ("indentation", "force", "time", "lines")
    )
    remarks = [text for branch in branches for text in branch.remarks]
    return Rows(branches[0].path, indentation, force, time, lines, remarks=remarks)


def _texts(table: TextTable, quantity: str, lines: NDArray) -> list[str]:
    """The cells of the only column of a quantity in some lines; [] if there is none, or several."""
    if len(table.found(quantity)) != 1:
        return []
    texts = {cell.line: cell.text for cell in table.cells(table.found(quantity)[0].place)}
    return [texts[line] for line in lines]


def _in_order(rows: Rows, parts: NDArray) -> Rows:
    """Rows with named branches. A branch in reverse order is reversed."""
    edges = np.flatnonzero(parts[1:] != parts[:-1]) + 1
    order = []
    for run in np.split(np.arange(len(parts)), edges):
        direction = rows.indentation[run[-1]] - rows.indentation[run[0]]
        wanted = {"approach": 1.0, "retract": -1.0}.get(str(parts[run[0]]), 0.0)
        if direction * wanted < 0.0:
            rows.remarks.append(
                f"{rows.path.name}: the rows of the {parts[run[0]]} run against its way (lines {rows.lines[run[0]]} to "
                f"{rows.lines[run[-1]]}) and were turned round"
            )
            run = run[::-1]
        order.append(run)
    return rows.of(np.concatenate(order))
