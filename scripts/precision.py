"""What mixed precision changes: errors against a reference in double, and what it saves. docs/work_precision.md.

    python scripts/precision.py                  all scenes and the cost: docs/figures/precision.csv and the tables
    python scripts/precision.py errors --only film      the scenes with this word in their names
    python scripts/precision.py cost             processor time alone, double and mixed in turns
    python scripts/precision.py page             the tables from the rows that are there

Rows that are in the CSV already are not measured again; delete it, or lines of it, to have them measured anew. Half an
hour of one core in all.

Each scene is run in double and in mixed precision at several accuracies, and in double at a finer one, the reference:
at least ten times, and the finest there is for most. Errors are those of pgfmd.benchmark.curve_errors. That of the loop's
work, and the residual of the audit, are shares of the loop, or of a tenth of the largest work on the way where the loop
is smaller. "apart" is the force curve in mixed precision against that in double.
"""

from __future__ import annotations

import argparse
import csv
import statistics
import time
from dataclasses import asdict, dataclass, fields
from functools import cache
from pathlib import Path

import numpy as np
from marked_page import fill
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.benchmark.curve_errors import Curve, errors, rms_difference
from pgfmd.benchmark.work_precision import Recorder
from pgfmd.errors import PgfmdError
from pgfmd.results.audit import LEAST_LOOP
from pgfmd.scene import load_scene, scene_from_mapping

DOCS = Path(__file__).resolve().parent.parent / "docs"
PRECISIONS = ("double", "mixed")
ALL = (0.3, 1e-2, 1e-3, 1e-4, 1e-5)
COARSE = (0.3, 1e-2, 1e-3)
SLOW = (0.1, 0.03, 0.01)
"""Of scenes whose surface jumps, which take a hundred times as many transforms."""
SPHERE = ("adhesion.law=cosine", "adhesion.range_factor=0.156", "rheology.model=single", "rheology.modulus_ratio=250",
          "rheology.relaxation_time=400 us")  # fmt: skip
OWN = {
    "wave": {
        "punch": {"pattern": "sinusoid", "wavelength": "150 um", "amplitude": "0.5 um"},
        "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495},
        "rheology": {"model": "single", "modulus_ratio": 250, "relaxation_time": "400 us"},
        "adhesion": {"work_of_adhesion": "50 mJ/m^2"},
        "drive": {"speed": "10 um/s", "preload": "2 mN"},
        "grid": {"n": 64, "length": "150 um"},
    }
}
"""Scenes that none of the shipped ones can be changed to: a wave that fills the cell."""


@dataclass(frozen=True)
class Case:
    """A scene with its overrides, the accuracies at which it is run, and that of its reference."""

    name: str
    scene: str
    overrides: tuple[str, ...]
    accuracies: tuple[float, ...] = ALL
    reference: float = 1e-6


def _geometric(elements: int, ratio: float, shortest: str = "40 us", step: float = 6.0) -> tuple[str, ...]:
    return (
        "rheology.model=geometric", f"rheology.elements={elements}", f"rheology.time_ratio={step}",
        "rheology.exponent=0.8", f"rheology.relaxation_time={shortest}", f"rheology.modulus_ratio={ratio:g}",
    )  # fmt: skip


CASES = (
    Case("tri, 10 µm/s, n = 128", "tri-tack", ("grid.n=128", "drive.speed=10 um/s")),
    Case("tri, 1 µm/s, n = 64", "tri-tack", ("grid.n=64", "drive.preload=10 mN")),
    Case("tri, 0.1 µm/s, n = 64", "tri-tack", ("grid.n=64", "drive.speed=0.1 um/s", "drive.preload=10 mN"), COARSE, 1e-4),
    Case("tri, 1 mm/s, n = 128", "tri-tack", ("grid.n=128", "drive.speed=1 mm/s")),
    Case("tri, 0.1 m/s, n = 64", "tri-tack", ("grid.n=64", "drive.speed=0.1 m/s")),
    Case("tri, first order, n = 64", "tri-tack", ("grid.n=64", "drive.speed=20 um/s", "solver.order=1"), COARSE, 1e-5),
    Case("tri, free, n = 64", "tri-tack", ("grid.n=64", "drive.speed=10 um/s", "substrate.boundary=free")),
    Case(
        "tri, film of 100 µm, n = 64", "tri-tack",
        ("grid.n=64", "drive.speed=10 um/s", "substrate.thickness=100 um"),
    ),
    Case(
        "tri, sliding film of 20 µm, n = 64", "tri-tack",
        ("grid.n=64", "drive.speed=10 um/s", "substrate.thickness=20 um", "substrate.base=sliding"),
    ),
    Case(
        "tri, free film of 100 µm, n = 64", "tri-tack",
        ("grid.n=64", "drive.speed=10 um/s", "substrate.thickness=100 um", "substrate.boundary=free"),
    ),
    Case("hex, 10 µm/s, n = 64", "hex-tack", ("grid.n=64", "drive.speed=10 um/s")),
    Case("hex, 25 µm/s, n = 256", "hex-tack", ("grid.n=256", "drive.speed=25 um/s"), (0.1, 1e-2, 1e-3), 1e-4),
    Case("flat, 10 µm/s, n = 64", "flat-punch", ("grid.n=64",)),
    Case("flat, κ∞ = 4, 0.1 µm/s, n = 64", "flat-punch", ("grid.n=64", "rheology.modulus_ratio=4", "drive.speed=0.1 um/s"), COARSE, 1e-4),
    Case("sphere, free, 10 µm/s, n = 64", "hertz", ("grid.n=64", *SPHERE, "drive.speed=10 um/s")),
    Case("sphere, elastic, repulsive, n = 64", "hertz", ("grid.n=64",)),
    Case("wave in the whole cell, n = 64", "wave", ("grid.n=64",)),
    Case("tri, κ∞ = 1.5, n = 64", "tri-tack", ("grid.n=64", "rheology.modulus_ratio=1.5", "drive.speed=100 um/s"), COARSE, 1e-4),
    Case("tri, κ∞ = 1e4, n = 64", "tri-tack", ("grid.n=64", "rheology.modulus_ratio=1e4", "drive.speed=10 um/s")),
    Case("tri, κ∞ = 1e6, n = 64", "tri-tack", ("grid.n=64", "rheology.modulus_ratio=1e6", "drive.speed=10 um/s")),
    Case("tri, κ∞ = 1e6, 1 mm/s, n = 128", "tri-tack", ("grid.n=128", "rheology.modulus_ratio=1e6", "drive.speed=1 mm/s")),
    Case("flat, κ∞ = 1e6, 1 µm/s, n = 64", "flat-punch", ("grid.n=64", "rheology.modulus_ratio=1e6", "drive.speed=1 um/s")),
    Case("tri, N = 5, κ∞ = 250, n = 64", "tri-tack", ("grid.n=64", "drive.speed=10 um/s", *_geometric(5, 250))),
    Case("hex, N = 5, κ∞ = 1e6, n = 64", "hex-tack", ("grid.n=64", "drive.speed=10 um/s", *_geometric(5, 1e6, "1 us"))),
    Case("tri, N = 20, κ∞ = 1000, n = 64", "tri-tack", ("grid.n=64", "drive.speed=10 um/s", *_geometric(20, 1e3, "1 us", 2.0))),
    Case("tri, N = 40, κ∞ = 1e6, n = 64", "tri-tack", ("grid.n=64", "drive.speed=10 um/s", *_geometric(40, 1e6, "1 ns", 2.0))),
    Case(
        "tri, dwell of 1e4 s, n = 64", "tri-tack",
        ("grid.n=64", "drive.speed=10 um/s", "drive.dwell=1e4 s"), COARSE, 1e-4,
    ),
    Case(
        "tri, start in contact, n = 64", "tri-tack",
        ("grid.n=64", "drive.speed=10 um/s", "drive.clearance=-1 um"),
    ),
    Case("tri, 10 µm/s, n = 512", "tri-tack", ("grid.n=512", "drive.speed=10 um/s"), (1e-2, 1e-3), 1e-4),
    Case("tri, elastic, n = 48", "tri-tack", ("grid.n=48", "rheology.model=elastic", "drive.preload=5 mN"), SLOW, 1e-3),
    Case("hex, elastic, n = 48", "hex-tack", ("grid.n=48", "rheology.model=elastic", "drive.preload=2 mN"), SLOW, 1e-3),
    Case("flat, elastic, n = 48", "flat-punch", ("grid.n=48", "rheology.model=elastic"), SLOW, 1e-3),
    Case("sphere, elastic, n = 48", "hertz", ("grid.n=48", *SPHERE[:2]), SLOW, 1e-3),
    Case("tri, quasistatic, n = 48", "tri-tack", ("grid.n=48", "solver.scheme=quasistatic", "drive.preload=5 mN"), SLOW, 1e-3),
    Case("hex, quasistatic, n = 48", "hex-tack", ("grid.n=48", "solver.scheme=quasistatic", "drive.preload=2 mN"), SLOW, 1e-3),
    Case(
        "hex, quasistatic, instantaneous, n = 48", "hex-tack",
        ("grid.n=48", "solver.scheme=quasistatic", "solver.modulus=instantaneous", "drive.preload=2 mN"), SLOW, 1e-3,
    ),
    Case(
        "hex, quasistatic, spring, n = 48", "hex-tack",
        ("grid.n=48", "solver.scheme=quasistatic", "drive.machine_stiffness=2 kN/m", "drive.preload=2 mN"), SLOW, 1e-3,
    ),
    Case("flat, quasistatic, n = 48", "flat-punch", ("grid.n=48", "solver.scheme=quasistatic"), SLOW, 1e-3),
    Case(
        "sphere, quasistatic, n = 48", "hertz", ("grid.n=48", *SPHERE, "solver.scheme=quasistatic"), SLOW, 1e-3,
    ),
)  # fmt: skip

COSTS = (
    ("tri", "tri-tack", ("drive.speed=10 um/s",), (32, 48, 64, 96, 128, 192, 256, 512, 1024)),
    ("hex", "hex-tack", ("drive.speed=25 um/s",), (48, 64, 128, 256)),
    ("tri, free", "tri-tack", ("drive.speed=10 um/s", "substrate.boundary=free"), (48, 64, 96, 128, 256)),
    ("tri, N = 5", "tri-tack", ("drive.speed=10 um/s", *_geometric(5, 250)), (48, 64, 128, 256)),
    ("hertz", "hertz", (), (64, 128, 256, 512)),
    ("flat, elastic", "flat-punch", ("rheology.model=elastic",), (64, 128, 256)),
)
"""Of the second table: name, scene, overrides, grids."""


@dataclass(frozen=True)
class Row:
    """A run, or (`part` = "cost") the ratio of a run in mixed precision to one in double, in the columns `pairs` and
    `seconds`. Errors are shares; residual: of the audit, relative to the work of the punch."""

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


@dataclass(frozen=True)
class Outcome:
    """A run: its curve, the net work of the punch and the largest on the way [J], the largest residual of its audit [J],
    cost, and how it ended."""

    curve: Curve
    work: float
    largest_work: float
    residual: float
    pairs: int
    steps: int
    seconds: float
    ended: str


    @property
    def at_stake(self) -> float:
        """The work [J] that errors are shares of."""
        return max(abs(self.work), LEAST_LOOP * self.largest_work)


class Working(Recorder):
    """Keeps the largest work of the punch, too."""

    largest = 0.0

    def observe(self, simulation, event) -> None:
        """Keeps a row at the start and after every step."""
        super().observe(simulation, event)
        self.largest = max(self.largest, abs(simulation.state.energies.work))


@cache
def outcome(scene: str, overrides: tuple[str, ...]) -> Outcome:
    """The run of a scene, shipped or from `OWN`, on one rank and without files; each only once."""
    loaded = scene_from_mapping(OWN[scene], overrides) if scene in OWN else load_scene(scene, overrides)
    simulation, recorder = assemble(loaded, MPI.COMM_SELF), Working()
    simulation.observers.append(recorder)
    began, ended = time.process_time(), ""
    try:
        ended = simulation.run().finished
    except PgfmdError as error:
        ended = f"failed: {' '.join(str(error).split())}"
    spent, state = time.process_time() - began, simulation.state
    curve = Curve(
        *(np.array(column) for column in (recorder.time, recorder.force, recorder.area)),
        simulation.scheme.solver.force_scale, -state.pull_off_force, state.energies.work_of_separation,
    )  # fmt: skip
    energies = state.energies.work, recorder.largest, state.energies.largest_residual
    return Outcome(curve, *energies, simulation.scheme.pairs, state.counters.steps, spent, ended)


def errors_of(case: Case, known: set, say):
    """Rows of a scene: both precisions at all accuracies against the reference."""
    for accuracy in case.accuracies:
        setting = f"{accuracy:g}"
        if all(("errors", case.name, setting, precision) in known for precision in PRECISIONS):
            continue
        reference = outcome(case.scene, (*case.overrides, f"solver.accuracy={case.reference:g}", "solver.precision=double"))
        runs = {
            precision: outcome(
                case.scene, (*case.overrides, f"solver.accuracy={accuracy:g}", f"solver.precision={precision}")
            )
            for precision in PRECISIONS
        }
        apart = rms_difference(runs["mixed"].curve, runs["double"].curve, "force") / runs["double"].curve.preload
        for precision, found in runs.items():
            off = errors(found.curve, reference.curve)
            row = Row(
                "errors", case.name, setting, precision, off.force, off.pull_off,
                abs(found.work - reference.work) / reference.at_stake, found.residual / reference.at_stake, apart, found.pairs, found.steps, found.seconds, found.ended,
            )  # fmt: skip
            say(row)
            yield row


def costs_of(name: str, scene: str, overrides: tuple[str, ...], grids, known: set, rounds: int):
    """Rows of the ratios of cost: both precisions in turns, the median of the rounds."""
    for n in grids:
        if ("cost", name, str(n), "mixed") in known:
            continue
        changes = {p: (*overrides, f"grid.n={n}", f"solver.precision={p}") for p in PRECISIONS}
        found = {p: [] for p in PRECISIONS}
        for turn in range(rounds if n < 500 else 1):
            for precision in PRECISIONS if turn % 2 else PRECISIONS[::-1]:
                found[precision].append(outcome.__wrapped__(scene, changes[precision]))
        seconds = {p: [run.seconds for run in runs] for p, runs in found.items()}
        ratios = [mixed / double for double, mixed in zip(seconds["double"], seconds["mixed"], strict=True)]
        pairs = found["mixed"][0].pairs / found["double"][0].pairs
        yield Row(
            "cost", name, str(n), "mixed", pairs=pairs, seconds=statistics.median(ratios),
            steps=statistics.median(seconds["double"]),
        )  # fmt: skip


class Table:
    """The CSV of all rows, continued if it exists."""

    columns = [field.name for field in fields(Row)]
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


GROUPS = {"viscoelastic": "", "elastic, with jumps": "rheology.model=elastic", "quasi-static": "solver.scheme=quasistatic"}
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
        lines.append(f"| {group} | {len(mine)} | {' | '.join(cells)} | {near} of {len(mine)}, {max(ratios['force']):.2f} |")
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


def all_costs(rows: list[Row]) -> str:
    """Processor time in mixed precision over that in double, by grids."""
    grids = sorted({int(row.setting) for row in rows if row.part == "cost"})
    lines = ["| scene | " + " | ".join(f"n = {n}" for n in grids) + " |", "| --- " * (len(grids) + 1) + "|"]
    for name, *_ in COSTS:
        found = {int(row.setting): f"{row.seconds:.2f}" for row in rows if (row.part, row.case) == ("cost", name)}
        lines.append(f"| {name} | " + " | ".join(found.get(n, "") for n in grids) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", nargs="*", help="errors, cost, page (default: all)")
    parser.add_argument("--only", default="", metavar="WORD", help="scenes with this word in their names")
    parser.add_argument("--rounds", type=int, default=7, help="of the cost (default: %(default)s)")
    parser.add_argument("--csv", type=Path, default=DOCS / "figures" / "precision.csv", metavar="FILE")
    options = parser.parse_args()
    parts, table = options.part or ["errors", "cost", "page"], Table(options.csv)

    def say(row: Row) -> None:
        print(
            f"{row.case:40s} {row.setting:6s} {row.precision:7s} force {row.force:8.2e} pull-off {row.pull_off:8.2e} loop "
            f"{row.loop:8.2e} residual {row.residual:8.2e} apart {row.apart:8.2e} pairs {row.pairs:9.4g} "
            f"{row.seconds:7.3g} s {row.ended}", flush=True,
        )  # fmt: skip

    for case in CASES if "errors" in parts else ():
        if options.only in case.name:
            for row in errors_of(case, table.known(), say):
                table.add(row)
            outcome.cache_clear()
    for line in COSTS if "cost" in parts else ():
        if options.only in line[0]:
            for row in costs_of(*line, table.known(), options.rounds):
                say(row)
                table.add(row)
    if "page" in parts:
        blocks = {"summary": summary, "errors": all_errors, "cost": all_costs}
        fill(DOCS / "work_precision.md", "precision", lambda name: blocks[name](table.rows))


if __name__ == "__main__":
    main()
