"""The rows of run.py, and the file that they are kept in."""

from __future__ import annotations

import csv
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

from ..pages import FIGURES
from .scenes import CASES

TABLE = FIGURES / "forecast.csv"


@dataclass(frozen=True)
class Row:
    """What a run took. depth, lift [m]: where the preload was met below the surface, and where the run ended above it;
    *_in: up to the preload. seconds: of the processor."""

    part: str
    size: str
    scene: str
    changes: str
    finished: str
    steps: int
    steps_in: int
    pairs: int
    pairs_in: int
    rejected: int
    newton: int
    jumps: int
    depth: float
    lift: float
    seconds: float


def rows_of(path: Path) -> list[Row]:
    """The rows of a table; none where there is none."""
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        kinds = {field.name: {"int": int, "float": float}.get(field.type, str) for field in fields(Row)}
        return [Row(**{name: kinds[name](value) for name, value in line.items()}) for line in csv.DictReader(file)]


def write(path: Path, rows: list[Row]) -> None:
    """Writes the table in the order of the cases."""
    places = {(case.scene, "; ".join(case.changes)): place for place, case in enumerate(CASES)}
    known = [row for row in rows if (row.scene, row.changes) in places]
    known.sort(key=lambda row: places[row.scene, row.changes])
    known = [
        replace(row, part=case.part, size=case.size)
        for row in known
        for case in [CASES[places[row.scene, row.changes]]]
    ]
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, [field.name for field in fields(Row)], lineterminator="\n")
        table.writeheader()
        table.writerows(asdict(row) for row in known)
