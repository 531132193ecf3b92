"""What a checkpoint costs: time, size and memory, for both schemes, against the state that it holds.

    source scripts/environment
    mpirun -n 2 python -m scripts.studies.restart.checkpoint_cost            # n = 2048, a few minutes
    mpirun -n 2 python -m scripts.studies.restart.checkpoint_cost --n 512

A scene is assembled and taken some steps far, until the predictor has its history; then its checkpoint is written a few
times, and read once. Prints a line a scene: size over the bytes of the state's arrays on all ranks; the shortest and
longest of the times to write, with the way to the disk; the longest as a share of ten minutes; what a rank's resident
memory grew by at most while it wrote, over its block of points (the largest of all ranks); and the time to read.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.files.packing import arrays_of, numbers_of, unpack
from pgfmd.restart.checkpoints import Checkpoints
from pgfmd.scene import load_scene

SPECTRUM = ["rheology.model=geometric", "rheology.relaxation_time=40 us", "rheology.elements=20", "rheology.time_ratio=2",
            "rheology.exponent=0.5"]  # fmt: skip
SCENES = {
    "inertialess, N = 1": [],
    "inertialess, N = 20": SPECTRUM,
    "gfmd, N = 1": ["solver.scheme=gfmd", "drive.speed=200 um/s"],
    "gfmd, N = 5": ["solver.scheme=gfmd", "drive.speed=200 um/s", *SPECTRUM, "rheology.elements=5"],
}
STEPS, WRITES, INTERVAL = 4, 5, 600.0


def resident(peak: bool = False) -> int:
    """This process's resident memory [bytes], or the most since `forget_peak`."""
    name = "VmHWM" if peak else "VmRSS"
    line = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith(name))
    return int(line.split()[1]) * 1024


def forget_peak() -> None:
    """The most resident memory counts from now on."""
    Path("/proc/self/clear_refs").write_text("5")


def measure(comm, n: int, changes: list[str], folder: Path) -> dict[str, float]:
    """Figures of one scene, the same on every rank."""
    simulation = assemble(load_scene("tri-tack", [f"grid.n={n}", *changes]), comm)
    simulation.run(attend=lambda run: run.state.counters.steps >= STEPS)
    state, checkpoints = simulation.state, Checkpoints(folder, comm)
    arrays, head = arrays_of(state), {"state": numbers_of(state)}
    held = comm.allreduce(sum(array.nbytes for array in arrays.values()))
    times, grown, saved = [], 0, None
    for _ in range(WRITES):
        forget_peak()
        before = resident()
        comm.Barrier()
        saved = checkpoints.save(head, arrays)
        times.append(comm.allreduce(saved.seconds, MPI.MAX))
        grown = max(grown, resident(peak=True) - before)
    block = simulation.points.nb**2 * 8 / comm.size
    began = time.perf_counter()
    checkpoints.restore(lambda found, read: unpack(state, found["state"], read), print)
    read = comm.allreduce(time.perf_counter() - began, MPI.MAX)
    return {
        "bytes": saved.bytes, "ratio": saved.bytes / held, "shortest": min(times), "longest": max(times),
        "blocks": comm.allreduce(grown / block, MPI.MAX), "read": read,
    }  # fmt: skip


def main() -> int:
    """Entry point."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--n", type=int, default=2048)
    parser.add_argument("--folder", type=Path, help="where to write; a temporary folder unless said otherwise")
    arguments = parser.parse_args()
    comm = MPI.COMM_WORLD
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(comm.bcast(temporary))
        if comm.rank == 0:
            print(f"tri-tack, n = {arguments.n}, {comm.size} ranks", flush=True)
        for name, changes in SCENES.items():
            found = measure(comm, arguments.n, changes, folder)
            if comm.rank == 0:
                print(
                    f"{name:20s} {found['bytes'] * 1e-6:8.1f} MB = {found['ratio']:.4f} of the state  "
                    f"written in {found['shortest']:.2f} to {found['longest']:.2f} s = "
                    f"{100 * found['longest'] / INTERVAL:.2f} % of 10 min  memory {found['blocks']:.2f} blocks a rank  "
                    f"read in {found['read']:.2f} s",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
