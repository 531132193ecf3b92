"""Reading a measured curve: a table of displacement and force, and time if there is one, units in its header.

    displacement (um), force (mN), time (s)
    2.1, -0.03, 0.00

Columns are separated by commas, semicolons or tabs (decimal commas are read with the latter two); lines starting with #
and columns with other names are passed over. Nothing is guessed: a column without a unit is an error, and so are a row
with more cells than the header, a time that falls, and a sign that contradicts the data.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np

from pgfmd.characterisation.dma import MeasurementError
from pgfmd.files.text import read_text
from pgfmd.results.curve import Array, Loop
from pgfmd.units import UnitError, parse_quantity

NAMES = {
    "indentation": ("indentation", "depth", "penetration"),
    "displacement": ("displacement", "position", "u", "z", "d", "x"),
    "force": ("force", "load", "normal force", "f"),
    "time": ("time", "t"),
}
"""Column names by quantity, in any case."""
DIMENSIONS = {"indentation": "length", "displacement": "length", "force": "force", "time": "time"}
EXAMPLE = "displacement (um), force (mN)"
LEAST_ROWS = 4
MOST_PROBLEMS = 5
CURES = {",": "decimal commas need semicolons between the columns"}
"""What else may be wrong with rows that are longer than the header, by the mark between their columns."""


def read_experiment(path: str | Path, positive_displacement: str = "in", positive_force: str = "compression") -> Loop:
    """A measured curve as a loop, its rows in the order of the file; split at the largest force.

    Args:
        path: the file.
        positive_displacement: "in" if displacements grow when the punch is pushed in, as the paper's do, or "out". A
            column called indentation always counts inwards.
        positive_force: "compression" or "tension".

    Raises:
        MeasurementError: naming file, line, what was expected and a cure.
        ValueError: for another word than these.
    """
    if positive_displacement not in ("in", "out") or positive_force not in ("compression", "tension"):
        raise ValueError("expected 'in' or 'out', and 'compression' or 'tension'")
    path = Path(path)
    columns = _columns(path)
    force = columns["force"] * (1.0 if positive_force == "compression" else -1.0)
    inwards = 1.0 if positive_displacement == "in" else -1.0
    indentation = columns["indentation"] if "indentation" in columns else inwards * columns["displacement"]
    _confirm(path, indentation, force)
    rows = len(force)
    turn = int(np.argmax(force))
    phase = np.where(np.arange(rows) <= turn, "approach", "retract")
    unknown = np.full(rows, np.nan)
    time = columns.get("time", unknown)
    return Loop(path.stem, time, -indentation, force, unknown, unknown, phase, np.zeros(rows, bool))


def _confirm(path: Path, indentation: Array, force: Array) -> None:
    """Whether the signs fit: force and indentation rise and fall together in a contact."""
    if len(force) < LEAST_ROWS:
        raise MeasurementError(f"{path}: expected at least {LEAST_ROWS} rows of numbers, found {len(force)}")
    moving = indentation - np.mean(indentation)
    together = float(moving @ (force - np.mean(force)))
    if together == 0.0:
        raise MeasurementError(f"{path}: expected a punch that moves and a force that changes, found neither")
    if together < 0.0:
        raise MeasurementError(
            f"{path}: expected the force to rise as the punch is pushed in, but it falls; say which way the columns "
            "count: --positive-displacement in|out, --positive-force compression|tension"
        )


def _columns(path: Path) -> dict[str, Array]:
    """The columns that are known, in SI units."""
    try:
        text = read_text(path)
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or "not a text file"
        raise MeasurementError(f"{path}: could not be read: {reason}; export the measurement as CSV") from None
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip(" \t;,")]
    lines = [(number, line) for number, line in lines if not line.lstrip().startswith("#")]
    if not lines:
        raise MeasurementError(f"{path}: expected a table with the header {EXAMPLE}, found an empty file")
    delimiter = next((mark for mark in "\t;," if mark in lines[0][1]), ",")
    rows = [(number, _cells(line, delimiter)) for number, line in lines]
    places = _places(path, *rows[0])
    _refuse_surplus(path, rows, delimiter)
    found: dict[str, list[float]] = {quantity: [] for quantity in places}
    problems = []
    for number, cells in rows[1:]:
        for quantity, (place, factor) in places.items():
            cell = cells[place] if place < len(cells) else ""
            value = _number(cell, delimiter)
            if not np.isfinite(value):
                problems.append(f"{path}, line {number}: {quantity} = '{cell}': expected a number")
            found[quantity].append(factor * value)
    if problems:
        more = [f"... and {len(problems) - MOST_PROBLEMS} more like these"] * (len(problems) > MOST_PROBLEMS)
        raise MeasurementError("\n".join([*problems[:MOST_PROBLEMS], *more, "correct or delete these lines"]))
    _refuse_falling_time(path, rows[1:], places, found)
    return {quantity: np.array(values) for quantity, values in found.items()}


def _refuse_surplus(path: Path, rows: list[tuple[int, list[str]]], delimiter: str) -> None:
    """Raises MeasurementError where a row has cells that belong to no column: those before them may be misplaced."""
    (_, header), *others = rows
    width = _width(header)
    for number, cells in others:
        if _width(cells) > width:
            cure = CURES.get(delimiter, "give every column a name in the header")
            raise MeasurementError(
                f"{path}, line {number}: expected {width} cells as in the header, found {_width(cells)} "
                f"('{delimiter.join(cells)}'); {cure}"
            )


def _width(cells: list[str]) -> int:
    """Number of cells up to the last one that is not empty."""
    return max((place for place, cell in enumerate(cells, 1) if cell), default=0)


def _refuse_falling_time(path: Path, rows: list[tuple[int, list[str]]], places: dict, found: dict) -> None:
    """Raises MeasurementError where the time of a row is before that of the row above: the order is lost."""
    times = found.get("time", [])
    for row in range(1, len(times)):
        if times[row] < times[row - 1]:
            place, (above, earlier), (number, cells) = places["time"][0], rows[row - 1], rows[row]
            raise MeasurementError(
                f"{path}, line {number}: time = '{cells[place]}': expected a time that does not fall, it was "
                f"'{earlier[place]}' in line {above}; bring the rows into the order in which they were measured, or "
                "delete the column if their order is right"
            )


def _cells(line: str, delimiter: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def _places(path: Path, number: int, header: list[str]) -> dict[str, tuple[int, float]]:
    """Place and factor to SI of the columns that are known."""
    where = f"{path}, line {number}"
    places: dict[str, tuple[int, float]] = {}
    for place, cell in enumerate(header):
        name, unit = _named(cell)
        quantity = next((known for known, names in NAMES.items() if name.lower() in names), None)
        if quantity is None:
            continue
        if quantity in places:
            raise MeasurementError(f"{where}: expected one column with {quantity}, found several; rename the others")
        places[quantity] = place, _factor(f"{where}, column '{cell}'", quantity, unit)
    if "force" not in places or not {"displacement", "indentation"} & set(places):
        found = ", ".join(header)
        raise MeasurementError(
            f"{where}: expected columns for displacement (or indentation) and force, found {found}; name columns and "
            f"units as in {EXAMPLE}"
        )
    if {"displacement", "indentation"} <= set(places):
        # A curve.csv of pgfmd has both.
        del places["displacement"]
    return places


def _named(cell: str) -> tuple[str, str]:
    """(name, unit) of a header's cell: "force (mN)", "force [mN]", "force / mN", "force_mN"; unit may be ""."""
    for pattern in (r"(.*?)\s*[(\[](.*)[)\]]", r"(.*?)\s*/\s*(.*)", r"(.*)_(\S+)"):
        if match := re.fullmatch(pattern, cell):
            return match[1].replace("_", " ").strip(), match[2].strip()
    return cell, ""


def _factor(where: str, quantity: str, unit: str) -> float:
    dimension = DIMENSIONS[quantity]
    try:
        return parse_quantity(f"1 {unit}", dimension)
    except UnitError as error:
        found = f"found '{unit}'" if unit else "found none"
        raise MeasurementError(
            f"{where}: expected a unit of {dimension}, {found} ({error.cure}); write for instance {EXAMPLE}"
        ) from None


def _number(cell: str, delimiter: str) -> float:
    try:
        return float(cell.replace(",", ".") if delimiter != "," else cell)
    except ValueError:
        return float("nan")
