"""Runs the shipped scenes and their common variations, compares steps and pairs of transforms with the forecast, and fits its numbers.

    python -m scripts.studies.forecast.run all            runs, fit and page of the reduced set: three minutes on two idle cores
    python -m scripts.studies.forecast.run all --again    the same, after the solvers have changed: rows that are there are run anew
    python -m scripts.studies.forecast.run run --full     the large grids and long paths too: an hour
    python -m scripts.studies.forecast.run fit            the numbers of pgfmd/forecast/effort_constants.py from the table
    python -m scripts.studies.forecast.run page           docs/explanation/forecast.md from the table and the numbers

The table is docs/figures/forecast.csv, a row as soon as its run is done; a script that is stopped goes on from there.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context

from ..pages import ROOT
from .scenes import CASES, FULL, REDUCED, Case
from .table import TABLE, Row, rows_of, write

LONGEST = 600.0
"""Processor time [s] after which a run is given up; it has no row."""


def measured(case: Case) -> Row | None:
    """The row of a case; None where it takes too long, or fails."""
    from mpi4py import MPI

    from pgfmd.assemble import assemble
    from pgfmd.errors import RunError
    from pgfmd.scene import load_scene
    from pgfmd.solver.simulation import Observer

    class Preload(Observer):
        """An observer that notes what it took to come to the preload."""

        def __init__(self):
            self.steps = self.pairs = 0
            self.depth = 0.0

        def observe(self, simulation, event) -> None:
            """Notes the counters at the preload."""
            if event.kind == "preload":
                state = simulation.state
                self.steps, self.pairs, self.depth = (
                    state.counters.steps,
                    simulation.scheme.pairs,
                    -state.punch_displacement,
                )

    scene = load_scene(case.scene, list(case.changes))
    simulation, preload = assemble(scene, MPI.COMM_SELF), Preload()
    simulation.observers.append(preload)
    began = time.process_time()
    try:
        state = simulation.run(attend=lambda _: time.process_time() - began > LONGEST)
    except RunError as error:
        print(f"failed: {case.label}: {error}", flush=True)
        return None
    counters, seconds = state.counters, time.process_time() - began
    return Row(
        case.part, case.size, case.scene, "; ".join(case.changes), state.finished, counters.steps, preload.steps,
        simulation.scheme.pairs, preload.pairs, counters.rejected_steps, counters.newton_iterations, counters.jumps,
        preload.depth, state.punch_displacement, round(seconds, 3),
    )  # fmt: skip


def run(sizes: tuple[str, ...], workers: int, again: bool) -> None:
    """Runs the cases of these sizes that have no row yet, or all of them; a row is kept as soon as its run is done."""
    cases = [case for case in CASES if case.size in sizes]
    names = {(case.scene, "; ".join(case.changes)) for case in cases}
    rows = [row for row in rows_of(TABLE) if not (again and (row.scene, row.changes) in names)]
    have = {(row.scene, row.changes) for row in rows}
    todo = [case for case in cases if (case.scene, "; ".join(case.changes)) not in have]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        jobs = {pool.submit(measured, case): case for case in todo}
        for count, job in enumerate(as_completed(jobs), 1):
            row = job.result()
            print(
                f"{count}/{len(todo)} {jobs[job].label}: {f'{row.pairs} pairs, {row.seconds} s' if row else 'no row'}",
                flush=True,
            )
            if row and row.finished:
                rows.append(row)
                write(TABLE, rows)


def main() -> None:
    """Does what is asked for, in this order."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("what", choices=["all", "run", "fit", "page"])
    options.add_argument("--full", action="store_true", help="the large grids and long paths too")
    options.add_argument("--again", action="store_true", help="what has a row already as well")
    options.add_argument("--workers", type=int, default=os.cpu_count(), help="runs side by side (default %(default)s)")
    chosen = options.parse_args()
    if chosen.what in ("all", "run"):
        run((REDUCED, FULL) if chosen.full else (REDUCED,), chosen.workers, chosen.again)
    if chosen.what in ("all", "fit"):
        subprocess.run([sys.executable, "-m", "scripts.studies.forecast.fit"], cwd=ROOT, check=True)
    if chosen.what in ("all", "page"):
        # A process of its own: it has to read the numbers that have just been written.
        subprocess.run([sys.executable, "-m", "scripts.studies.forecast.page"], cwd=ROOT, check=True)


if __name__ == "__main__":
    main()
