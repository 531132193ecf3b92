"""Whether tack tests end well wherever their parameters lie: a table of runs over wide ranges.

    python -m scripts.studies.stability.run                          every axis around tri-tack, hex-tack, flat-punch; n = 64
    python -m scripts.studies.stability.run --quick                  n = 32, and only the ends of every axis
    python -m scripts.studies.stability.run --axis speed --n 128     one axis
    python -m scripts.studies.stability.run --set solver.accuracy=1e-2 --csv table.csv

A case is `ok` when it ended detached, with a force of zero to rounding and, at accuracy 1e-3 or finer, an energy audit that closes
to 2 % of the work of the whole loop (where nothing can dissipate, and that is zero: of the largest work on the way);
`refused` when the scene was rejected beforehand; `stopped` when the run ended with the message that the preload is out
of reach, at the depth where an approach is given up; `FAILED` otherwise, a hang included. Exit code 1 where any case
failed.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import signal
import sys
import time
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from pgfmd.errors import PgfmdError
from pgfmd.host import launch
from pgfmd.physics.drive import DETACHED
from pgfmd.solver.simulation import STOPPED_PRELOAD

LARGEST_RESIDUAL = 0.02
"""Of the energy audit, relative to the work of the loop, at accuracy FINE or finer."""
FINE = 1e-3
ROUNDING = 1e-12
"""Largest force of a punch that is free, relative to the largest of the run: on a spring it is a difference of loads."""
ACCURACY = "solver.accuracy=1e-3"
ELASTIC, SINGLE, MIXED = "rheology.model=elastic", "solver.precision=single", "solver.precision=mixed"
RATIO = "rheology.modulus_ratio="
TWELVE_DECADES = {
    count: (
        "rheology.model=geometric", f"rheology.elements={count}", "rheology.relaxation_time=1e-9 s",
        f"rheology.time_ratio={10 ** (12 / (count - 1)):.6g}", "rheology.exponent=0.5", "rheology.modulus_ratio=1000",
    )
    for count in (2, 5, 13, 40)
}  # fmt: skip
"""Spectra from 1 ns to 1000 s."""
PAPER = (
    "rheology.model=geometric", "rheology.elements=5", "rheology.time_ratio=6", "rheology.exponent=0.8",
    "rheology.relaxation_time=40 us",
)  # fmt: skip


def range_times(factor: float) -> str:
    """The override that multiplies the automatic range of adhesion by a factor."""
    return f"adhesion.range_factor={0.156 / factor**2:.6g}"


def each(key: str, *values) -> list[tuple[str, ...]]:
    """One case for every value of a key."""
    return [(f"{key}={value}",) for value in values]


SOFT, LOAD = "drive.machine_stiffness=1 kN/m", "drive.control=load"
TABLE = ("adhesion.law=table", "adhesion.file=scripts/studies/laws/law.txt", "adhesion.range=auto")
STILL = "solver.scheme=quasistatic", "solver.accuracy=1e-2"
LAWS: list[tuple[str, ...]] = [*each("adhesion.law", "dugdale", "exponential", "lennard-jones"), TABLE]
TRI, HEX, FLAT = "tri-tack", "hex-tack", "flat-punch"
AXES: dict[str, dict[str, list[tuple[str, ...]]]] = {
    "modulus ratio": {
        TRI: [(ELASTIC,), *each("rheology.modulus_ratio", 1.000001, 1.5, 8, 250, 1000, 1e6)],
        HEX: [(ELASTIC,), *each("rheology.modulus_ratio", 8, 1e6)],
        FLAT: [(ELASTIC,), *each("rheology.modulus_ratio", 8, 1e6)],
    },
    "elements": {
        TRI: [PAPER, *TWELVE_DECADES.values()],
        HEX: [TWELVE_DECADES[40]],
        FLAT: [TWELVE_DECADES[40]],
    },
    "speed": {
        TRI: each("drive.speed", *(f"1e{power} um/s" for power in range(-3, 6))),
        HEX: each("drive.speed", "1e-3 um/s", "1e5 um/s"),
        FLAT: each("drive.speed", "1e-3 um/s", "1e5 um/s"),
    },
    "range": {
        TRI: [(range_times(factor),) for factor in (0.1, 0.3, 3, 10, 100)],
        HEX: [(range_times(factor),) for factor in (0.1, 100)],
        FLAT: [(range_times(factor),) for factor in (0.1, 100)],
    },
    "preload": {
        TRI: each("drive.preload", "0.01 mN", "1 mN", "0.2 N", "1 N"),
        HEX: each("drive.preload", "0.01 mN", "1 N"),
        FLAT: each("drive.preload", "0.01 mN", "1 N"),
    },
    "grid": {
        TRI: each("grid.n", 16, 23, 31, 45, 61, 90, 97, 128, 509),
        HEX: each("grid.n", 16, 37),
        FLAT: each("grid.n", 16, 19, 1024),
    },
    "precision": {
        TRI: [
            (SINGLE,), (SINGLE, "solver.accuracy=0.3"), (SINGLE, "solver.accuracy=1e-4"), (SINGLE, RATIO + "1e6"),
            (SINGLE, RATIO + "1000", "solver.accuracy=1e-2"), (SINGLE, RATIO + "8"), (SINGLE, "drive.speed=1e5 um/s"),
            (SINGLE, *TWELVE_DECADES[40], "solver.accuracy=1e-2"), (SINGLE, "adhesion.law=repulsive"),
            (SINGLE, "drive.dwell=1e4 s"), (MIXED,), (MIXED, ELASTIC), (MIXED, "solver.accuracy=1e-6"),
            (MIXED, RATIO + "1e6"), (MIXED, "drive.speed=1e5 um/s"),
        ],
        HEX: [(SINGLE,), (MIXED,)],
        FLAT: [(SINGLE, RATIO + "8"), (MIXED,)],
    },
    "dwell": {TRI: each("drive.dwell", "1 ms", "1e4 s"), HEX: each("drive.dwell", "1e4 s"), FLAT: []},
    "accuracy": {
        TRI: each("solver.accuracy", 0.3, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6),
        HEX: each("solver.accuracy", 0.3, 1e-6),
        FLAT: each("solver.accuracy", 0.3, 1e-6),
    },
    "jitter": {TRI: each("punch.height_jitter", "1 nm", "50 nm", "1 um"), HEX: each("punch.height_jitter", "50 nm")},
    "scene": {
        TRI: [
            ("substrate.boundary=free",), ("substrate.thickness=70 um",), ("substrate.prestrain=[1.0,2.0]",),
            ("substrate.thickness=70 um", "substrate.base=sliding"), ("adhesion.law=repulsive",),
            ("adhesion.law=repulsive", ELASTIC), ("punch.curvature_radius=50 mm", "punch.layer_step=0.2 um"),
        ],
    },
    "corners": {
        TRI: [
            (ELASTIC, "solver.accuracy=1e-6", "grid.n=32"), (ELASTIC, "solver.accuracy=0.3"),
            (ELASTIC, range_times(0.1)), (ELASTIC, range_times(100)),
            (ELASTIC, "drive.preload=1 N"), (ELASTIC, "punch.height_jitter=50 nm"),
            (RATIO + "1e6", "drive.speed=1e5 um/s", range_times(0.1)),
            (RATIO + "1e6", "drive.speed=1e-3 um/s", range_times(0.1)),
            (RATIO + "1e6", "drive.speed=1e5 um/s", "solver.accuracy=0.3"),
            (RATIO + "1.5", "drive.speed=1e5 um/s", "drive.preload=0.01 mN"),
            (RATIO + "1.5", "drive.speed=1e-3 um/s", "drive.preload=1 N"),
            (RATIO + "8", "drive.dwell=1e4 s", "drive.preload=1 N", "drive.speed=1e3 um/s"),
            (*TWELVE_DECADES[40], "drive.speed=1e5 um/s", "drive.dwell=1e4 s"),
            (*TWELVE_DECADES[40], "drive.speed=1e-3 um/s", range_times(0.1)),
            (*TWELVE_DECADES[40], "solver.accuracy=1e-5", "substrate.boundary=free"),
        ],
        HEX: [(ELASTIC, "drive.preload=1 N"), (RATIO + "1e6", "drive.speed=1e5 um/s", range_times(0.1))],
        FLAT: [(ELASTIC, "solver.accuracy=1e-6"), (RATIO + "1.5", "drive.speed=1e5 um/s")],
    },
}  # fmt: skip
AXES |= {
    "machine": {
        TRI: [
            *each("drive.machine_stiffness", "38.1 kN/m", "3 kN/m", "100 N/m"),
            ("drive.machine_stiffness=1 N/m", "drive.speed=1 mm/s"), (SOFT, ELASTIC), (SOFT, RATIO + "8"),
            (SOFT, RATIO + "1e6"), (SOFT, "drive.speed=1e-2 um/s"), (SOFT, "drive.speed=1e4 um/s"), (SOFT, MIXED),
            (SOFT, "drive.dwell=1e4 s"), (SOFT, "substrate.boundary=free"), (SOFT, "solver.accuracy=0.3"),
            (SOFT, "drive.preload=0.01 mN"), (SOFT, "drive.preload=1 N"), (SOFT, "punch.height_jitter=50 nm"),
        ],
        HEX: [*each("drive.machine_stiffness", "38.1 kN/m", "100 N/m"), (SOFT, ELASTIC)],
        FLAT: [*each("drive.machine_stiffness", "38.1 kN/m", "100 N/m"), (SOFT, ELASTIC)],
    },
    "controlled force": {
        TRI: [
            (LOAD,), (LOAD, ELASTIC), (LOAD, RATIO + "8"), (LOAD, RATIO + "1e6"), (LOAD, "drive.speed=1e-2 um/s"),
            (LOAD, "drive.speed=1e4 um/s"), (LOAD, "drive.dwell=1 s"), (LOAD, "drive.dwell=1e4 s"), (LOAD, "substrate.boundary=free"),
            (LOAD, "substrate.thickness=70 um"), (LOAD, "solver.accuracy=0.3"), (LOAD, "drive.preload=0.01 mN"),
            (LOAD, "drive.preload=1 N"), (LOAD, "adhesion.law=repulsive"), (LOAD, *TWELVE_DECADES[13]),
        ],
        HEX: [(LOAD,), (LOAD, ELASTIC), (LOAD, "drive.dwell=1 s")],
        FLAT: [(LOAD,), (LOAD, ELASTIC), (LOAD, "drive.dwell=1 s")],
    },
    "adhesion": {
        TRI: [
            *LAWS, *((*law, *STILL) for law in LAWS), *((*law, LOAD) for law in LAWS), *((*law, SOFT) for law in LAWS),
            *((*law, "drive.speed=1e4 um/s") for law in LAWS), *((*law, "drive.speed=1e-2 um/s") for law in LAWS),
            ("adhesion.law=dugdale", "adhesion.smoothing=0.02"), ("adhesion.law=dugdale", "adhesion.smoothing=1"),
            ("adhesion.law=dugdale", "adhesion.overlap_stiffness=1e13 Pa/m"), ("adhesion.law=lennard-jones", MIXED),
            ("adhesion.law=lennard-jones", "substrate.boundary=free"),
        ],
        HEX: LAWS,
        FLAT: [*LAWS, ("adhesion.law=lennard-jones", LOAD)],
    },
}  # fmt: skip


@dataclass
class Result:
    """One line of the table; numbers are nan where the run did not get so far."""

    axis: str
    scene: str
    settings: str
    finished: str = ""
    steps: int = 0
    rejected: int = 0
    pairs: int = 0
    jumps: int = 0
    pull_off_force: float = math.nan
    final_force: float = math.nan
    loop_work: float = math.nan
    residual: float = math.nan
    seconds: float = math.nan
    verdict: str = "FAILED"

    def line(self) -> str:
        """The result as a line of the table; pull-off force in mN, final force in preloads, work in nJ."""
        return (
            f"{self.verdict:8s}{self.scene:11s}{self.settings or '(as shipped)':60s} {self.finished:12s}"
            f"{self.steps:7d}{self.rejected:6d}{self.pairs:8d}{self.jumps:5d}{1e3 * self.pull_off_force:11.4g}"
            f"{self.final_force:8.1g}{1e9 * self.loop_work:11.4g}{100 * self.residual:9.3f}{self.seconds:7.1f}"
        )


HEADER = (
    f"{'verdict':8s}{'scene':11s}{'settings':60s} {'finished':12s}{'steps':>7s}{'rej.':>6s}{'pairs':>8s}{'jumps':>5s}"
    f"{'F_po mN':>11s}{'F_end':>8s}{'work nJ':>11s}{'resid. %':>9s}{'s':>7s}"
)


class Hang(Exception):
    """The time limit of a case is over."""


def _out_of_time(*_) -> None:
    raise Hang


def run_case(axis: str, scene_name: str, overrides: list[str], settings: str, limit: int) -> Result:
    """Runs one case for at most `limit` seconds."""
    from pgfmd.assemble import assemble
    from pgfmd.output.recorder import Recorder
    from pgfmd.scene import load_scene
    from pgfmd.scene_objects import confirm

    result, simulation, start = Result(axis, scene_name, settings), None, time.perf_counter()
    signal.signal(signal.SIGALRM, _out_of_time)
    signal.alarm(limit)
    try:
        scene = load_scene(scene_name, overrides)
        confirm(scene, scene_name)
        result.finished = "not finished"
        simulation = assemble(scene, MPI.COMM_SELF)
        recorder = Recorder()
        simulation.observers.append(recorder)
        result.finished = simulation.run().finished
        energies = simulation.state.energies
        loop = (
            abs(energies.work)
            if energies.viscous or energies.released
            else np.abs(recorder.energy.column("work")).max()
        )
        result.residual = energies.largest_residual / loop if loop else 0.0
        result.verdict = verdict(simulation.state, result.residual, scene.solver.accuracy)
    except Hang:
        result.finished = "time limit"
    except PgfmdError as error:
        result.verdict = "FAILED" if simulation else "refused"
        result.finished = " ".join(str(error).split())[:200]
    except Exception as error:
        result.finished = f"{type(error).__name__}: {error}"[:200]
    finally:
        signal.alarm(0)
    result.seconds = time.perf_counter() - start
    if simulation is not None:
        fill(result, simulation, scene.drive.preload)
    return result


def fill(result: Result, simulation, preload: float) -> None:
    """Takes the numbers from the simulation's state, wherever it ended."""
    state = simulation.state
    counters, energies = state.counters, state.energies
    result.steps, result.rejected, result.jumps = counters.steps, counters.rejected_steps, counters.jumps
    result.pairs = simulation.scheme.pairs
    result.pull_off_force, result.final_force = state.pull_off_force, state.force / preload
    result.loop_work = energies.work


def verdict(state, residual: float, accuracy: float) -> str:
    """Whether a run ended as it should; residual: of the energy audit, relative to the loop."""
    numbers = (state.force, state.pull_off_force, state.energies.work, state.energies.largest_residual)
    sound = all(map(math.isfinite, numbers)) and (accuracy > FINE * (1 + 1e-9) or residual <= LARGEST_RESIDUAL)
    if sound and state.finished == STOPPED_PRELOAD:
        return "stopped"
    free = abs(state.force) <= ROUNDING * state.largest_force
    return "ok" if sound and state.finished == DETACHED and free else "FAILED"


def selected(options: argparse.Namespace):
    """(axis, scene, overrides of the case) of all cases that were asked for."""
    for axis, scenes in AXES.items():
        if options.axis and options.axis not in axis:
            continue
        for scene, cases in scenes.items():
            ends = cases if len(cases) < 3 or not options.quick else [cases[0], cases[-1]]
            for case in ends:
                yield axis, scene, case


def write(path: str, results: list[Result]) -> None:
    """Writes the table; rows of axes that were not run are kept."""
    rows: list[dict] = [vars(result) for result in results]
    if os.path.exists(path):
        with open(path, newline="", encoding="utf-8") as file:
            rows += [row for row in csv.DictReader(file) if row["axis"] not in {result.axis for result in results}]
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(vars(results[0])))
        writer.writeheader()
        writer.writerows(sorted(rows, key=lambda row: list(AXES).index(row["axis"])))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--axis", default="", help="only axes with this in their name: " + ", ".join(AXES))
    parser.add_argument("--quick", action="store_true", help="n = 32, and only the first and last case of an axis")
    parser.add_argument("--n", type=int, help="grid points a side (default: 64)")
    parser.add_argument("--accuracy", type=float, help="accuracy where a case does not set it (default: 1e-3)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="change of all cases")
    parser.add_argument("--limit", type=int, default=300, help="seconds after which a case is hung (%(default)s)")
    parser.add_argument("--csv", metavar="FILE", help="also write the table as CSV, in SI units")
    options = parser.parse_args()
    launch.world()
    n = options.n or (32 if options.quick else 64)
    common = [f"grid.n={n}", f"solver.accuracy={options.accuracy or FINE:g}", *options.set]
    # Kernels are compiled before anything is timed.
    run_case("", TRI, ["grid.n=16"], "", 600)
    print(f"n = {n}; all cases: {' '.join(common)}\n{HEADER}")
    results = []
    for axis, scene, case in selected(options):
        if not results or results[-1].axis != axis:
            print(f"-- {axis}")
        results.append(run_case(axis, scene, [*common, *case], " ".join(case), options.limit))
        print(results[-1].line(), flush=True)
    failed = sum(result.verdict == "FAILED" for result in results)
    print(f"{len(results)} cases, {failed} failed")
    if options.csv:
        write(options.csv, results)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
