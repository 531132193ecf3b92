"""The rows of precision.py as a CSV file, and the tables that are made of them. Part of precision.py."""

from __future__ import annotations

import csv
import statistics
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from .scenes import CASES, COSTS, PRECISIONS, SCATTERS, SPHERE, SPREAD, Case


@dataclass(frozen=True)
class Row:
    """A run; or, where `part` is "cost", the ratio of one in mixed precision to one in double, in `pairs` and `seconds`,
    with the seconds in double in `steps`. Errors and residuals of the audit are shares (precision.py)."""

    part: str
    case: str
    setting: str
    precision: str
    force: float = 0.0
    pull_off: float = 0.0
    loop: float = 0.0
    residual: float = 0.0
    apart: float = 0.0
    pairs: float = 0.0
    steps: float = 0.0
    seconds: float = 0.0
    ended: str = ""


class Table:
    """The CSV of all rows, continued if it exists."""

    columns = tuple(field.name for field in fields(Row))
    texts = ("part", "case", "setting", "precision", "ended")

    def __init__(self, path: Path):
        self.path, self.rows = path, []
        if path.exists():
            with open(path, newline="", encoding="utf-8") as file:
                for row in csv.DictReader(file):
                    self.rows.append(Row(**{k: v if k in self.texts else float(v) for k, v in row.items()}))
        else:
            path.write_text(",".join(self.columns) + "\n", encoding="utf-8")

    def known(self) -> set[tuple[str, str, str, str]]:
        """What names a row, of all rows."""
        return {(row.part, row.case, row.setting, row.precision) for row in self.rows}

    def add(self, row: Row) -> None:
        """Appends a row."""
        self.rows.append(row)
        with open(self.path, "a", newline="", encoding="utf-8") as file:
            short = {name: f"{v:.4g}" if isinstance(v, float) else v for name, v in asdict(row).items()}
            csv.DictWriter(file, self.columns, lineterminator="\n").writerow(short)


GROUPS = {
    "viscoelastic": "",
    "elastic, with jumps": "rheology.model=elastic",
    "quasi-static": "solver.scheme=quasistatic",
}
"""Lines of the summary, and the override that makes a scene belong there."""
MEASURES = {"force": "force curve", "pull_off": "pull-off force", "loop": "loop", "residual": "audit"}


def group_of(case: Case) -> str:
    """The line of the summary that a scene belongs to."""
    if case.scene == "hertz" and SPHERE[2] not in case.overrides:
        # It is elastic unless it is told otherwise.
        return "elastic, with jumps"
    return next((name for name, word in reversed(GROUPS.items()) if word in case.overrides), "viscoelastic")


def pairs_of_rows(rows: list[Row]) -> list[tuple[Case, Row, Row]]:
    """(scene, row in double, row in mixed precision) of every setting, in the order of the scenes."""
    found = {(row.case, row.setting, row.precision): row for row in rows if row.part == "errors"}
    return [
        (case, *(found[case.name, f"{accuracy:g}", precision] for precision in PRECISIONS))
        for case in CASES for accuracy in case.accuracies if (case.name, f"{accuracy:g}", "mixed") in found
    ]  # fmt: skip


def summary(rows: list[Row]) -> str:
    """Ratios of the errors in mixed precision to those in double, by kinds of scenes."""
    lines = [
        "| scenes | runs | " + " | ".join(MEASURES.values()) + " | pairs | force curve within 10 %, and at worst |",
        "| --- " * (len(MEASURES) + 4) + "|",
    ]
    for group in GROUPS:
        mine = [(double, mixed) for case, double, mixed in pairs_of_rows(rows) if group_of(case) == group]
        if not mine:
            continue
        ratios = {
            name: [getattr(b, name) / getattr(a, name) for a, b in mine if getattr(a, name) and getattr(b, name)]
            for name in (*MEASURES, "pairs")
        }
        cells = [f"{statistics.geometric_mean(ratios[name]):.2f}" for name in ratios]
        near = sum(abs(ratio - 1.0) < 0.1 for ratio in ratios["force"])
        lines.append(
            f"| {group} | {len(mine)} | {' | '.join(cells)} | {near} of {len(mine)}, {max(ratios['force']):.2f} |"
        )
    return "\n".join(lines)


def all_errors(rows: list[Row]) -> str:
    """Every setting, as double / mixed."""
    lines = [
        "| scene | accuracy | force curve [%] | pull-off force [%] | loop [%] | audit [%] | mixed from double, force [%] | pairs |",
        "| --- " * 8 + "|",
    ]
    for case, double, mixed in pairs_of_rows(rows):
        cells = [f"{100 * getattr(double, name):.2g} / {100 * getattr(mixed, name):.2g}" for name in MEASURES]
        pairs = f"{double.pairs:.0f} / {mixed.pairs:.0f}"
        lines.append(f"| {case.name} | {mixed.setting} | {' | '.join(cells)} | {100 * mixed.apart:.1g} | {pairs} |")
    return "\n".join(lines)


def all_scatters(rows: list[Row]) -> str:
    """Geometric means, and the smallest and largest, over accuracies that hardly differ: double / mixed."""
    lines = ["| scene | accuracy | runs | force curve [%] | from, to [%] | audit [%] | pairs |", "| --- " * 7 + "|"]
    for name, centre, _, count in SCATTERS:
        found = {
            precision: [
                row for row in rows if (row.part, row.case, row.precision) == ("scatter", name, precision)
                and centre / SPREAD < 1.001 * float(row.setting) < 1.002 * SPREAD * centre
            ]
            for precision in PRECISIONS
        }  # fmt: skip
        if not all(found.values()):
            continue
        forces = [[100.0 * row.force for row in runs] for runs in found.values()]
        audits = [[100.0 * row.residual for row in runs] for runs in found.values()]
        cells = [
            " / ".join(f"{statistics.geometric_mean(values):.2g}" for values in forces),
            " / ".join(f"{min(values):.2g}, {max(values):.2g}" for values in forces),
            " / ".join(f"{statistics.geometric_mean(values):.2g}" for values in audits),
            " / ".join(f"{statistics.mean(row.pairs for row in runs):.0f}" for runs in found.values()),
        ]
        lines.append(f"| {name} | {centre:g} | {count} | {' | '.join(cells)} |")
    return "\n".join(lines)


def all_costs(rows: list[Row]) -> str:
    """Processor time in mixed precision over that in double, by grids."""
    grids = sorted({int(row.setting) for row in rows if row.part == "cost"})
    lines = ["| scene | " + " | ".join(f"n = {n}" for n in grids) + " |", "| --- " * (len(grids) + 1) + "|"]
    for name, *_ in COSTS:
        found = {int(row.setting): f"{row.seconds:.2f}" for row in rows if (row.part, row.case) == ("cost", name)}
        lines.append(f"| {name} | " + " | ".join(found.get(n, "") for n in grids) + " |")
    return "\n".join(lines)
