"""How much faster more ranks are: whole runs, where their time goes, and a model for machines that are larger.

    python scripts/ranks.py speed                        tri-tack at n = 512, 1024, 2048 on 1, 2 and 3 ranks
    python scripts/ranks.py speed --busy --n 1024        the same beside a process on each core
    mpirun -n 2 python scripts/ranks.py shares --n 1024  where the time of a step goes
    mpirun -n 2 python scripts/ranks.py latency          what a meeting of the ranks costs, and memory's speed

`speed` runs `pgfmd run` as a process of its own, start included; the numbers of ranks take turns, and the best of several
rounds counts. Use an idle machine: ratios are what matters.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pgfmd.host import launch

TESTS = {512: ["drive.speed=1 um/s"], 1024: ["drive.speed=25 um/s"], 2048: ["drive.speed=25 um/s", "drive.preload=5 mN"]}
"""Scenes by n: some 3400, 500 and 200 pairs of transforms."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("speed", "shares", "latency"))
    parser.add_argument("--n", type=int, nargs="+", default=[512, 1024, 2048], help="grid points a side")
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 3], help="for speed: numbers of ranks")
    parser.add_argument("--rounds", type=int, default=3, help="for speed (default: %(default)s)")
    parser.add_argument("--busy", action="store_true", help="for speed: a process that computes on each core")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="further changes of the scene")
    options = parser.parse_args()
    if options.what == "speed":
        speed(options)
        return
    comm = launch.world()
    with launch.guarded(comm):
        {"shares": shares, "latency": latency}[options.what](comm, options)


def speed(options: argparse.Namespace) -> None:
    """Prints the best times of whole runs, and their ratios."""
    others = [_busy() for _ in range(os.cpu_count() or 1)] if options.busy else []
    try:
        print(f"{'n':>6} {'ranks':>6} {'best s':>8} {'over 1 rank':>12}   all rounds [s]")
        for n in options.n:
            times: dict[int, list[float]] = {ranks: [] for ranks in options.ranks}
            for _ in range(options.rounds):
                for ranks in options.ranks:
                    times[ranks].append(_run(n, ranks, options.set))
            first = min(times[options.ranks[0]])
            for ranks, taken in times.items():
                each = " ".join(f"{seconds:.2f}" for seconds in taken)
                print(f"{n:6d} {ranks:6d} {min(taken):8.2f} {min(taken) / first:12.2f}   {each}", flush=True)
    finally:
        for other in others:
            other.kill()


def _busy() -> subprocess.Popen:
    """A process that computes without an end."""
    return subprocess.Popen([sys.executable, "-c", "while True: sum(range(100000))"])


def _run(n: int, ranks: int, changes: list[str]) -> float:
    """Time [s] of a whole run, from the command to its end."""
    folder = tempfile.mkdtemp(prefix="pgfmd-ranks-")
    scene = ["tri-tack", f"grid.n={n}", *TESTS.get(n, TESTS[1024]), *changes]
    command = [sys.executable, "-P", "-m", "pgfmd.cli", "run", *scene, "--out", f"{folder}/run"]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    # Without compiled modules, a start compiles all of pgfmd's sources each time, on each rank.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    try:
        began = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
        taken = time.perf_counter() - began
        record = json.loads(Path(folder, "run", "run.json").read_text("utf-8"))
        if record["finished"] != "detached":
            raise SystemExit(f"n = {n}, {ranks} ranks: {record['finished']}")
        return taken
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def shares(comm, options: argparse.Namespace) -> None:
    """Prints where the time of a tack test's steps goes, on the slowest rank of each part. Collective."""
    from pgfmd.assemble import assemble
    from pgfmd.scene import load_scene
    from pgfmd.solver.node import Node

    def simulate(n: int) -> dict[str, float]:
        scene = load_scene("tri-tack", [f"grid.n={n}", *TESTS.get(n, TESTS[1024]), *options.set])
        began = time.perf_counter()
        simulation = assemble(scene, comm)
        node = Node.of(comm) if comm.size > 1 else None
        inside = _watched(simulation.scheme.solver.operators, node)
        start = time.perf_counter()
        before = (node.waited, node.meetings) if node else (0.0, 0)
        simulation.run()
        wall = time.perf_counter() - start
        waited, meetings = (node.waited - before[0], node.meetings - before[1]) if node else (0.0, 0)
        transforms = simulation.scheme.transform_seconds
        return {
            "assembling (s)": start - began,
            "steps (s)": wall,
            "transforms but waits (%)": 100.0 * (transforms - inside["waited"]) / wall,
            "waits within transforms (%)": 100.0 * inside["waited"] / wall,
            "waits for sums (%)": 100.0 * (waited - inside["waited"]) / wall,
            "pointwise and the rest (%)": 100.0 * (wall - transforms - (waited - inside["waited"])) / wall,
            "pairs": simulation.scheme.pairs,
            "meetings a pair": meetings / simulation.scheme.pairs,
        }

    simulate(48)
    for n in options.n:
        found = simulate(n)
        everywhere = comm.gather(found)
        if comm.rank == 0:
            print(f"n = {n}, {comm.size} rank{'s' * (comm.size > 1)}")
            for name in found:
                values = [each[name] for each in everywhere]
                print(f"  {name:32s} " + " ".join(f"{value:9.4g}" for value in values), flush=True)


def _watched(operators, node) -> dict[str, float]:
    """Counts the time that ranks wait for each other within transforms."""
    inside = {"waited": 0.0}

    def watch(operator):
        def meet(original=operator._transposition.meet):
            before = node.waited
            original()
            inside["waited"] += node.waited - before

        operator._transposition.meet = meet

    if node is not None:
        for operator in operators:
            watch(getattr(operator, "convolve", operator))
    return inside


def latency(comm, options: argparse.Namespace) -> None:
    """Prints what a meeting of all ranks costs when all come at once, and an Allreduce beside it. Collective."""
    import numpy as np

    from pgfmd.solver.node import Node

    node = Node.of(comm)
    if node.local.size < 2:
        raise SystemExit("latency: needs two ranks or more on a node")
    number, total = np.zeros(1), np.zeros(1)

    def timed(action, count: int = 2000) -> np.ndarray:
        action()
        times = []
        for _ in range(count):
            began = time.perf_counter()
            action()
            times.append(time.perf_counter() - began)
        return 1e6 * np.array(times)

    for name, action in (("meeting", node.meet), ("Barrier", comm.Barrier), ("Allreduce", lambda: comm.Allreduce(number, total))):
        taken = timed(action)
        if comm.rank == 0:
            print(f"{name:10s} median {np.median(taken):7.2f} us, mean {taken.mean():7.2f} us, largest {taken.max():8.1f} us")


if __name__ == "__main__":
    main()
