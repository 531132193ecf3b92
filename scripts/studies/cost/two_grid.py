"""What a coarser grid beside the points saves: pairs of transforms and processor time of whole tests, and their errors.

    python -m scripts.studies.cost.two_grid [--scene tri-tack hex-tack] [--n 512 1024] [--set drive.speed="25 um/s"]
    python -m scripts.studies.cost.two_grid --reference-accuracy 5e-4 --n 512
    python -m scripts.studies.cost.two_grid --factor 4 8 16

Prints a table: each test without a coarser grid, and with cells of 8 x 8 points, or of those asked for; one after the other,
on one rank, so that ratios are right on a machine that is shared. Errors are those against a run without a coarser grid at
the reference accuracy, otherwise differences to the run without: of the force curve, root mean square relative to the
preload, and of the pull-off force.
"""

from __future__ import annotations

import argparse
import time

from mpi4py import MPI

from pgfmd import coarsening
from pgfmd.assemble import assemble
from pgfmd.benchmark.curve_errors import errors
from pgfmd.output.recorder import Recorder
from pgfmd.runner import warm_up
from pgfmd.scene import load_scene


def test(scene: str, changes: list[str], factor: int):
    """(curve, simulation, processor time [s]) of a test with cells of factor x factor points, or without any if 0."""
    factors, coarsening.FACTORS = coarsening.FACTORS, (factor,)
    made = load_scene(scene, [*changes, f"solver.coarse_grid={'always' if factor else 'none'}"])
    simulation, recorder = assemble(made, MPI.COMM_SELF), Recorder()
    coarsening.FACTORS = factors
    simulation.observers.append(recorder)
    began = time.process_time()
    simulation.run()
    took = time.process_time() - began
    return recorder.loop(simulation), simulation, took


def print_rows(scene: str, n: int, changes: list[str], factors: list[int], accuracy: str | None) -> None:
    """The rows of one test."""
    changes = [f"grid.n={n}", *changes]
    reference = test(scene, [*changes, f"solver.accuracy={accuracy}"], 0)[0] if accuracy else None
    first = None
    for factor in (0, *factors):
        curve, simulation, took = test(scene, changes, factor)
        reference = curve if reference is None else reference
        first = took if first is None else first
        state, away = simulation.state, errors(curve, reference, simulation.drive.preload)
        coarse = simulation.scheme.solver.cg.coarse_pairs if factor else ""
        print(
            f"| {scene.removesuffix('-tack')}, n = {n} | {f'{factor} x {factor}' if factor else 'none'} | "
            f"{simulation.scheme.pairs} | {coarse} | {state.counters.steps} ({state.counters.rejected_steps}) | "
            f"{took:.1f} s | {took / first:.2f} | {away.force:.1e} | {away.pull_off:.1e} |",
            flush=True,
        )


def main() -> None:
    """The table asked for."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scene", nargs="+", default=["tri-tack", "hex-tack"])
    options.add_argument("--n", type=int, nargs="+", default=[512, 1024])
    options.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    options.add_argument("--factor", type=int, nargs="+", default=[coarsening.FACTORS[0]])
    options.add_argument("--reference-accuracy")
    chosen = options.parse_args()
    warm_up("inertialess", "double")
    warm_up("inertialess", "mixed")
    print(
        "| test | cells | pairs | on cells | steps (rejected) | processor time | ratio | force curve | pull-off force |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for n in chosen.n:
        for scene in chosen.scene:
            print_rows(scene, n, chosen.set, chosen.factor, chosen.reference_accuracy)


if __name__ == "__main__":
    main()
