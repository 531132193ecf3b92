"""What a tack test costs: transforms, steps, iterations, and how much of the time is spent where.

    python -m scripts.studies.cost.tack_test                       tri-tack, n = 512, 1 um/s, 40 mN, default accuracy, with its errors
    python -m scripts.studies.cost.tack_test --n 1024 --no-reference
    mpirun -n 2 python -m scripts.studies.cost.tack_test --n 1024

Errors are those against the same scene at --reference-accuracy: of the force curve, rms over time relative to the
preload, and of the pull-off force. Counters and ratios come from one run; nothing is written.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from pgfmd.host import launch


def measured(comm, scene_name: str, overrides: list[str]) -> tuple[dict[str, float], np.ndarray, float]:
    """(counters and shares, rows (time s, displacement m, force N), preload N) of one run. Collective."""
    from pgfmd.assemble import assemble
    from pgfmd.output.recorder import Recorder
    from pgfmd.scene import load_scene

    scene = load_scene(scene_name, overrides)
    simulation = assemble(scene, comm)
    recorder = Recorder()
    simulation.observers.append(recorder)
    start = time.perf_counter()
    state = simulation.run()
    wall = max(comm.allgather(time.perf_counter() - start))
    inside = max(comm.allgather(simulation.scheme.transform_seconds))
    counters, energies = state.counters, state.energies
    numbers = {
        "transform pairs": simulation.scheme.pairs,
        "steps": counters.steps,
        "rejected steps": counters.rejected_steps,
        "Newton iterations": counters.newton_iterations,
        "jumps": counters.jumps,
        "pairs per step": simulation.scheme.pairs / counters.steps,
        "wall time (s)": wall,
        "time per pair (ms)": 1e3 * inside / simulation.scheme.pairs,
        "share of the transforms (%)": 100.0 * inside / wall,
        "share outside the transforms (%)": 100.0 * (1.0 - inside / wall),
        "energy residual (% of the work)": 100.0 * energies.largest_residual / abs(energies.work),
        "pull-off force (mN)": -1e3 * state.pull_off_force,
    }
    return (
        numbers,
        np.column_stack([recorder.curve.column(name) for name in ("time", "displacement", "force")]),
        scene.drive.preload,
    )


def force_error(rows: np.ndarray, reference: np.ndarray, preload: float) -> float:
    """Rms difference of the forces, relative to the preload, over the time that both runs have."""
    ours, theirs = rows[:, [0, 2]].T, reference[:, [0, 2]].T
    first, last = max(ours[0, 0], theirs[0, 0]), min(ours[0, -1], theirs[0, -1])
    instants = np.linspace(first, last, 20_001)
    difference = np.interp(instants, *ours) - np.interp(instants, *theirs)
    return float(np.sqrt(np.mean(difference**2)) / preload)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", default="tri-tack", help="a shipped scene or a file (default: %(default)s)")
    parser.add_argument("--n", type=int, default=512, help="grid points a side (default: %(default)s)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="further changes of the scene")
    parser.add_argument("--reference-accuracy", type=float, default=5e-4, help="default: %(default)s")
    parser.add_argument("--no-reference", action="store_true", help="leave the errors out, which cost most of the time")
    options = parser.parse_args()
    comm = launch.world()
    with launch.guarded(comm):
        report(comm, options)


def report(comm, options: argparse.Namespace) -> None:
    """Runs the scene, and its reference, and prints the table on rank 0. Collective."""
    # Kernels are compiled, or read from their cache, before anything is timed.
    measured(comm, options.scene, ["grid.n=48"])
    overrides = [f"grid.n={options.n}", *options.set]
    numbers, rows, preload = measured(comm, options.scene, overrides)
    if not options.no_reference:
        finer = [*overrides, f"solver.accuracy={options.reference_accuracy}"]
        best, truth, _ = measured(comm, options.scene, finer)
        numbers["force curve, rms error (% of the preload)"] = 100.0 * force_error(rows, truth, preload)
        exact = best["pull-off force (mN)"]
        numbers["pull-off force, error (%)"] = 100.0 * abs(numbers["pull-off force (mN)"] / exact - 1.0)
        numbers["reference: transform pairs"] = best["transform pairs"]
        numbers["reference: steps"] = best["steps"]
    if comm.rank == 0:
        print(f"{options.scene}, {', '.join(overrides)}, {comm.size} rank{'s' * (comm.size > 1)}")
        for name, value in numbers.items():
            print(f"{name:45s} {value:>12,d}" if isinstance(value, int) else f"{name:45s} {value:>12.4g}")


if __name__ == "__main__":
    main()
