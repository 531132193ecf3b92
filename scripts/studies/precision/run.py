"""What mixed precision changes: errors against a reference in double, and what it saves. docs/evidence/work_precision.md.

    python -m scripts.studies.precision.run                  all scenes and the cost: docs/figures/precision.csv and the tables
    python -m scripts.studies.precision.run errors --only film      the scenes with this word in their names
    python -m scripts.studies.precision.run scatter          how much is chance where the surface jumps
    python -m scripts.studies.precision.run cost             processor time alone, double and mixed in turns
    python -m scripts.studies.precision.run page             the tables from the rows that are there

Rows that are in the CSV already are not measured again; delete it, or lines of it, to have them measured anew. A quarter
of an hour of one core in all.

Each scene is run in double and in mixed precision at several accuracies, and in double at a finer one, the reference:
at least ten times, and the finest there is for most. Errors are those of pgfmd.benchmark.curve_errors. That of the loop's
work, and the residual of the audit, are shares of the loop, or of a tenth of the largest work on the way where the loop
is smaller. "apart" is the force curve in mixed precision against that in double.
"""

from __future__ import annotations

import argparse
import statistics
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.benchmark.curve_errors import errors, rms_difference
from pgfmd.errors import PgfmdError
from pgfmd.output.recorder import Recorder
from pgfmd.results.curve import Loop
from pgfmd.results.uncertainty import LEAST_LOOP
from pgfmd.scene import load_scene, scene_from_mapping

from ..pages import FIGURES, fill, page_named
from .report import Row, Table, all_costs, all_errors, all_scatters, summary
from .scenes import CASES, COSTS, OWN, PRECISIONS, SCATTERS, SPREAD, Case


@dataclass(frozen=True)
class Outcome:
    """A run: its curve, the force that errors are shares of [N], the net work of the punch and the largest on the way
    [J], the largest residual of its audit [J], cost, and how it ended."""

    curve: Loop
    preload: float
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


@cache
def outcome(scene: str, overrides: tuple[str, ...]) -> Outcome:
    """The run of a scene, shipped or from `OWN`, on one rank and without files; each only once."""
    loaded = scene_from_mapping(OWN[scene], overrides) if scene in OWN else load_scene(scene, overrides)
    simulation, recorder = assemble(loaded, MPI.COMM_SELF), Recorder()
    simulation.observers.append(recorder)
    began, ended = time.process_time(), ""
    try:
        ended = simulation.run().finished
    except PgfmdError as error:
        ended = f"failed: {' '.join(str(error).split())}"
    spent, state = time.process_time() - began, simulation.state
    curve, preload = recorder.loop(simulation), simulation.scheme.solver.force_scale
    largest = float(np.abs(recorder.energy.column("work")).max())
    energies = state.energies.work, largest, state.energies.largest_residual
    return Outcome(curve, preload, *energies, simulation.scheme.pairs, state.counters.steps, spent, ended)


def errors_of(case: Case, known: set, say):
    """Rows of a scene: both precisions at all accuracies against the reference."""
    yield from compared(case, "errors", case.accuracies, case.reference, known, say)


def scattered(name: str, centre: float, reference: float, count: int, known: set, say):
    """Rows of a scene whose surface jumps, at accuracies that hardly differ: how much of an error is chance."""
    case = next(case for case in CASES if case.name == name)
    accuracies = centre * np.geomspace(1.0 / SPREAD, SPREAD, count)
    yield from compared(case, "scatter", accuracies, reference, known, say)


def compared(case: Case, part: str, accuracies, finest: float, known: set, say):
    """Rows of both precisions at all accuracies, against double at the finest."""
    for accuracy in accuracies:
        setting = f"{accuracy:.4g}"
        if all((part, case.name, setting, precision) in known for precision in PRECISIONS):
            continue
        reference = outcome(case.scene, (*case.overrides, f"solver.accuracy={finest:g}", "solver.precision=double"))
        runs = {
            precision: outcome(
                case.scene, (*case.overrides, f"solver.accuracy={setting}", f"solver.precision={precision}")
            )
            for precision in PRECISIONS
        }
        apart = rms_difference(runs["mixed"].curve, runs["double"].curve, "force") / runs["double"].preload
        for precision, found in runs.items():
            off = errors(found.curve, reference.curve, reference.preload)
            row = Row(
                part, case.name, setting, precision, off.force, off.pull_off,
                abs(found.work - reference.work) / reference.at_stake, found.residual / reference.at_stake, apart,
                found.pairs, found.steps, found.seconds, found.ended,
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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", nargs="*", help="errors, scatter, cost, page (default: all)")
    parser.add_argument("--only", default="", metavar="WORD", help="scenes with this word in their names")
    parser.add_argument("--rounds", type=int, default=7, help="of the cost (default: %(default)s)")
    parser.add_argument("--csv", type=Path, default=FIGURES / "precision.csv", metavar="FILE")
    options = parser.parse_args()
    parts, table = options.part or ["errors", "scatter", "cost", "page"], Table(options.csv)

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
    for line in SCATTERS if "scatter" in parts else ():
        for row in scattered(*line, table.known(), say):
            table.add(row)
    for line in COSTS if "cost" in parts else ():
        if options.only in line[0]:
            for row in costs_of(*line, table.known(), options.rounds):
                say(row)
                table.add(row)
    if "page" in parts:
        blocks = {"summary": summary, "errors": all_errors, "scatter": all_scatters, "cost": all_costs}
        fill(page_named("work_precision.md"), "precision", lambda name: blocks[name](table.rows))


if __name__ == "__main__":
    main()
