"""How well the loop of a quasi-static run is known: accuracies, grids, moduli, and heights that differ by a nanometre.

    python -m scripts.studies.accuracy.loops             runs what is missing in docs/figures/loops.csv, 25 minutes
    python -m scripts.studies.accuracy.loops --solves    tighter solves at the same steps: what widens the loop (prints)
    python -m scripts.studies.accuracy.loops --page      fills both tables into docs/how-to/quasistatic.md as well

A row of the CSV is a run. The error of a loop is its difference from that of the finest accuracy of the same scene, grid,
modulus and seed; seed 0 is the punch as it is, others have heights that differ by a nanometre (punch.height_jitter).
Delete rows, or the file, to have them measured anew.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.results.uncertainty import of_loop
from pgfmd.scene import load_scene
from pgfmd.schemes.quasistatic import scheme as quasistatic

from ..pages import FIGURES, fill, page_named

OUT = FIGURES / "loops.csv"
SCENES = ("tri-tack", "hex-tack")
JITTER = "1 nm"
LOOSE = (0.1, 0.03, 0.01)
"""Accuracies that are compared with the finest one of a group."""
GROUPS = (
    # n, modulus, seeds, finest accuracy
    (64, "relaxed", (0,), 0.001),
    (64, "relaxed", (1, 2, 3, 4), 0.003),
    (64, "instantaneous", (0,), 0.003),
    (128, "relaxed", (0, 1), 0.003),
)
"""Runs of both scenes: all accuracies of LOOSE, 0.003, and the finest."""
SOLVES = (0.25, 0.05, 0.01)
"""Tolerances of the solves, as fractions of that of a step; the first is the scheme's."""


@dataclass(frozen=True)
class Run:
    """A run: what was asked, its cost, and its loop with all that is known about its uncertainty; energies [J]."""

    scene: str
    n: int
    modulus: str
    seed: int
    accuracy: float
    steps: int
    jumps: int
    pairs: int
    seconds: float
    loop: float
    released: float
    unbalanced: float
    jump_places: float
    residual: float
    stored: float

    @property
    def asked(self) -> tuple:
        """What tells the run apart."""
        return self.scene, self.n, self.modulus, self.seed, self.accuracy

    @property
    def group(self) -> tuple:
        """What the runs at all accuracies have in common."""
        return self.asked[:-1]

    @property
    def uncertainty(self) -> float:
        """Uncertainty of the loop [J], as in `run.json`."""
        return of_loop(self.unbalanced, self.jump_places**2, self.residual)


def measured(scene: str, n: int, modulus: str, seed: int, accuracy: float) -> Run:
    """Runs it in memory."""
    changes = [f"grid.n={n}", "solver.scheme=quasistatic", f"solver.modulus={modulus}", f"solver.accuracy={accuracy}"]
    changes += [f"punch.height_jitter={JITTER}", f"punch.seed={seed}"] if seed else []
    simulation = assemble(load_scene(scene, changes), MPI.COMM_SELF)
    stored = 0.0
    accept = simulation.scheme.accept

    def watched(state, trial):
        nonlocal stored
        accept(state, trial)
        stored = max(stored, state.energies.elastic)

    simulation.scheme.accept = watched
    began = time.perf_counter()
    state = simulation.run()
    energies, counters = state.energies, state.counters
    assert energies.unbalanced is not None and energies.jump_variance is not None
    return Run(
        scene, n, modulus, seed, accuracy, counters.steps, counters.jumps, counters.transform_pairs,
        round(time.perf_counter() - began, 2), energies.work, energies.released, energies.unbalanced,
        energies.jump_variance**0.5, energies.largest_residual, stored,
    )  # fmt: skip


def wanted() -> Iterator[tuple]:
    """What is to be run, the quick runs first."""
    for n, modulus, seeds, finest in GROUPS:
        for accuracy in sorted({*LOOSE, 0.003, finest}, reverse=True):
            for seed in seeds:
                for scene in SCENES:
                    yield scene, n, modulus, seed, accuracy


def read(path: Path = OUT) -> list[Run]:
    """The runs of the CSV."""
    if not path.exists():
        return []
    kinds = {"str": str, "int": int, "float": float}
    with path.open(newline="", encoding="utf-8") as rows:
        return [
            Run(**{entry.name: kinds[entry.type](row[entry.name]) for entry in fields(Run)})
            for row in csv.DictReader(rows)
        ]


def run_missing() -> list[Run]:
    """All runs; those that the CSV lacks are run, and written at once."""
    found = read()
    known = {run.asked for run in found}
    for asked in wanted():
        if asked in known:
            continue
        run = measured(*asked)
        found.append(run)
        new = not OUT.exists()
        with OUT.open("a", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, [entry.name for entry in fields(Run)], lineterminator="\n")
            if new:
                writer.writeheader()
            writer.writerow(asdict(run))
        print(*asked, f"loop {run.loop * 1e9:.4f} ± {run.uncertainty * 1e9:.4f} nJ, {run.seconds} s", flush=True)
    return found


def errors_of(runs: Iterable[Run]) -> list[tuple[Run, float]]:
    """Each run that has a finer one, with the error [J] of its loop."""
    groups: dict[tuple, list[Run]] = {}
    for run in runs:
        groups.setdefault(run.group, []).append(run)
    found = []
    for group in groups.values():
        finest = min(group, key=lambda run: run.accuracy)
        found += [(run, run.loop - finest.loop) for run in group if run.accuracy >= 3.0 * finest.accuracy]
    return found


def table(runs: list[Run]) -> str:
    """A row for each scene, grid, modulus and accuracy, with all seeds together; percent of the loop, where it is not zero
    within its uncertainty."""
    lines = [
        "| scene, n | accuracy | runs | pairs | loop (nJ) | scatter (%) | error (%) | uncertainty (%): equilibria, jumps | error over it |",
        "| --- |" + " --- |" * 8,
    ]
    errors = {run.asked: error for run, error in errors_of(runs)}
    rows: dict[tuple, list[Run]] = {}
    for run in runs:
        rows.setdefault((run.scene, run.n, run.modulus, run.accuracy), []).append(run)
    for (scene, n, modulus, accuracy), group in sorted(rows.items(), key=_order):
        loops, pairs = np.array([run.loop for run in group]), np.mean([run.pairs for run in group])
        mean, doubt = float(loops.mean()), float(np.mean([run.uncertainty for run in group]))
        off = [errors[run.asked] for run in group if run.asked in errors]
        ratios = sorted(abs(errors[run.asked]) / run.uncertainty for run in group if run.asked in errors)
        told, percents = f"{mean * 1e9:.3f} ± {doubt * 1e9:.3f}", [""] * 3
        if doubt < abs(mean):
            share = {
                name: 100 * np.mean([getattr(run, name) for run in group]) / mean
                for name in ("unbalanced", "jump_places")
            }
            percents = [
                f"{100 * loops.std(ddof=1) / mean:.1f}" if len(group) > 1 else "",
                f"{100 * np.mean(off) / mean:.1f}" if off else "",
                f"{100 * doubt / mean:.1f}: {share['unbalanced']:.1f}, {share['jump_places']:.1f}",
            ]
            told = f"{mean * 1e9:.4f}"
        name = f"{scene.removesuffix('-tack')}, {n}" + (", inst." if modulus != "relaxed" else "")
        lines.append(
            f"| {name} | {accuracy:g} | {len(group)} | {pairs:.0f} | {told} | {' | '.join(percents)} | {_span(ratios)} |"
        )
    return "\n".join(lines)


def _order(row: tuple[tuple, list[Run]]) -> tuple:
    """By modulus and scene, then by grid, the coarsest accuracy first."""
    scene, n, modulus, accuracy = row[0]
    return modulus != "relaxed", SCENES.index(scene), n, -accuracy


def _span(ratios: list[float]) -> str:
    """Smallest and largest of sorted numbers."""
    if not ratios:
        return ""
    return f"{ratios[0]:.2f} to {ratios[-1]:.2f}" if len(ratios) > 1 else f"{ratios[0]:.2f}"


def solves() -> str:
    """The same steps with tighter solves, n = 64: a table."""
    lines = [
        "| scene | accuracy | tolerance of solves, in that of a step | steps | jumps | pairs | loop (nJ) | uncertainty (nJ) | equilibria (nJ) |",
        "| --- |" + " --- |" * 8,
    ]
    for scene in SCENES:
        for accuracy in (0.1, 0.03, 0.01):
            for share in SOLVES:
                quasistatic.SHARPNESS = share
                run = measured(scene, 64, "relaxed", 0, accuracy)
                lines.append(
                    f"| {scene} | {accuracy} | {share} | {run.steps} | {run.jumps} | {run.pairs} | "
                    f"{run.loop * 1e9:.3f} | {run.uncertainty * 1e9:.3f} | {run.unbalanced * 1e9:.3f} |"
                )
                print(lines[-1], flush=True)
    quasistatic.SHARPNESS = SOLVES[0]
    return "\n".join(lines)


def main() -> None:
    """The table, and the page."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--page", action="store_true")
    options.add_argument("--solves", action="store_true")
    chosen = options.parse_args()
    if chosen.solves:
        solves()
        return
    text = table(run_missing())
    print(text)
    if chosen.page:
        tables = {"table": text, "solves": solves()}
        fill(page_named("quasistatic.md"), "loops", tables.__getitem__)


if __name__ == "__main__":
    main()
