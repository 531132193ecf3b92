#!/usr/bin/env python
"""Cost and accuracy of quasi-static runs, against the path of the elastic scene by the default scheme.

    .venv/bin/python scripts/quasistatic_cost.py [--scene hex-tack] [--preload "5 mN"] [--n 64 128] [--accuracy 0.1 0.03 0.01]

Prints a table: steps, jumps, pairs of transforms, closed loop, energy released, residual of the audit, pull-off force.
"""

from __future__ import annotations

import argparse
import time

from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.scene import load_scene


def row(label: str, scene: str, n: int, changes: list[str]) -> str:
    """One run as a line of the table."""
    began = time.perf_counter()
    simulation = assemble(load_scene(scene, [f"grid.n={n}", *changes]), MPI.COMM_SELF)
    state = simulation.run()
    energies, counters = state.energies, state.counters
    residual = energies.residual / energies.work if energies.work else 0.0
    return (
        f"| {n} | {label} | {counters.steps} | {counters.jumps} | {counters.transform_pairs} | "
        f"{energies.work * 1e9:.4f} | {energies.released * 1e9:.4f} | {100 * residual:.1f} | "
        f"{-state.pull_off_force * 1e3:.4f} | {time.perf_counter() - began:.1f} |"
    )


def main() -> None:
    """The table, a line as soon as its run is done."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scene", default="hex-tack")
    options.add_argument("--preload", default="5 mN")
    options.add_argument("--n", type=int, nargs="+", default=[64, 128])
    options.add_argument("--accuracy", nargs="+", default=["0.1", "0.03", "0.01"])
    chosen = options.parse_args()
    print(f"{chosen.scene}, preload {chosen.preload}")
    print("| n | scheme, accuracy | steps | jumps | pairs | loop (nJ) | released (nJ) | residual (%) | pull-off (mN) | s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for n in chosen.n:
        for accuracy in chosen.accuracy:
            changes = [f"drive.preload={chosen.preload}", f"solver.accuracy={accuracy}"]
            for label, scheme in (("quasistatic", ["solver.scheme=quasistatic"]), ("elastic", ["rheology.model=elastic"])):
                print(row(f"{label}, {accuracy}", chosen.scene, n, [*changes, *scheme]), flush=True)


if __name__ == "__main__":
    main()
