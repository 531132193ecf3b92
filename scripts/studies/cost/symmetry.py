"""What it saves to step a half or a quarter of a symmetric punch: processor time of a pair, and of whole tests.

    python -m scripts.studies.cost.symmetry pair [--n 512 1024]
    python -m scripts.studies.cost.symmetry test [--scene tri-tack] [--n 512] [--accuracy 1e-2] [--precision double]

Prints tables. Everything is done in turns, on one rank, and the best of several counts: so ratios are right on a machine
that is shared. Differences of a test are those to the run on the whole punch: of the force, root mean square over the
times of its steps, relative to the preload, and of the pull-off force.
"""

from __future__ import annotations

import argparse
import math
import time

import numpy as np
from mpi4py import MPI

from pgfmd.assemble import assemble, convolution_of
from pgfmd.output.recorder import Recorder
from pgfmd.runner import warm_up
from pgfmd.scene import load_scene
from pgfmd.symmetry import points_of

PARTS = {"": "whole", "x": "half", "xy": "quarter"}
ROUNDS, PERIOD = 15, 0.1
"""Rounds of turns, and about the time [s] that each takes in one of them."""


def seconds(action, count: int) -> float:
    """Processor time [s] of an action that is done so many times, each."""
    began = time.process_time()
    for _ in range(count):
        action()
    return (time.process_time() - began) / count


def pair_times(n: int) -> dict[tuple[str, str], float]:
    """Time [s] of a pair on each part of a flat punch, which has both symmetries, in double and in single precision."""
    scene, actions = load_scene("flat-punch", [f"grid.n={n}"]), {}
    for dtype in (np.float64, np.float32):
        for mirror in PARTS:
            points = points_of(scene, mirror, MPI.COMM_SELF)
            convolve, result = convolution_of(scene, points, dtype=dtype), points.zeros(dtype)
            traction = np.random.default_rng(1).standard_normal(points.size).astype(dtype)
            actions[np.dtype(dtype).name, mirror] = lambda c=convolve, t=traction, r=result: c(t, r)
    best = {}
    for turn in range(ROUNDS + 1):
        for key, action in actions.items():
            count = max(1, int(PERIOD / best[key])) if turn else 1
            best[key] = min(best.get(key, math.inf), seconds(action, count))
    return best


def print_pairs(sizes: list[int]) -> None:
    """The table of pairs."""
    print("| n | precision | whole | half | quarter | half / whole | quarter / whole |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for n in sizes:
        best = pair_times(n)
        for kind, name in (("float64", "double"), ("float32", "single")):
            whole, half, quarter = (best[kind, mirror] for mirror in PARTS)
            times = " | ".join(f"{value * 1e3:.2f} ms" for value in (whole, half, quarter))
            print(f"| {n} | {name} | {times} | {half / whole:.2f} | {quarter / whole:.2f} |", flush=True)


def print_tests(scene: str, n: int, accuracy: str, precision: str) -> None:
    """The table of a test on the whole punch, and on a part of it."""
    print(f"{scene}, n = {n}, accuracy {accuracy}, {precision}\n")
    print("| points | pairs | steps | processor time | pull-off force | its difference | of the force curve |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    warm_up("inertialess", precision)
    keys, known = [f"grid.n={n}", f"solver.accuracy={accuracy}", f"solver.precision={precision}"], None
    first = None
    for symmetry in ("none", "auto"):
        made, forces = load_scene(scene, [*keys, f"solver.symmetry={symmetry}"]), Recorder()
        simulation = assemble(made, MPI.COMM_SELF)
        simulation.observers.append(forces)
        began = time.process_time()
        state = simulation.run()
        took = time.process_time() - began
        rows = np.column_stack([forces.curve.column(name) for name in ("time", "force")])
        known = rows if known is None else known
        away = np.interp(known[:, 0], *rows.T) - known[:, 1]
        pull_off = abs(state.pull_off_force)
        first = pull_off if first is None else first
        print(
            f"| {PARTS[simulation.points.mirror]} | {state.counters.transform_pairs} | {state.counters.steps} | "
            f"{took:.2f} s | "
            f"{pull_off * 1e3:.6g} mN | {abs(pull_off / first - 1):.1e} | "
            f"{math.sqrt(np.mean(away**2)) / simulation.drive.preload:.1e} |",
            flush=True,
        )


def main() -> None:
    """The tables asked for."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    kinds = options.add_subparsers(dest="kind", required=True)
    kinds.add_parser("pair").add_argument("--n", type=int, nargs="+", default=[512, 1024])
    test = kinds.add_parser("test")
    test.add_argument("--scene", default="tri-tack")
    test.add_argument("--n", type=int, default=512)
    test.add_argument("--accuracy", default="1e-2")
    test.add_argument("--precision", default="double")
    chosen = options.parse_args()
    if chosen.kind == "pair":
        print_pairs(chosen.n)
    else:
        print_tests(chosen.scene, chosen.n, chosen.accuracy, chosen.precision)


if __name__ == "__main__":
    main()
