"""How much faster more ranks are: whole runs, where their time goes, and a model for machines that are larger.

    python -m scripts.studies.ranks.run speed                        tri-tack at n = 512, 1024, 2048 on 1, 2 and 3 ranks
    python -m scripts.studies.ranks.run speed --busy --n 1024        the same beside a process on each core
    python -m scripts.studies.ranks.run shares --ranks 1 2           where the time of whole runs goes
    python -m scripts.studies.ranks.run model                        what ranks pass to each other, and a model of the time on many cores
    mpirun -n 2 python -m scripts.studies.ranks.run latency          what a synchronisation of the ranks costs

`speed` runs `pgfmd run` as a process of its own, start included; the numbers of ranks take turns, and the best of several
rounds counts. Scenes are stepped as runs choose by default, on a half of their points and in mixed precision; to compare with
the whole punch in double precision, add `--set solver.symmetry=none --set solver.precision=double`. `--page` writes the tables
of `speed`, `shares` and `model` into docs/evidence/ranks.md. Use an idle machine.
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
from itertools import pairwise
from pathlib import Path

from pgfmd.host import launch
from pgfmd.physics.drive import DETACHED

from ..pages import ROOT, fill, page_named
from .model import arguments, blocks, busy, table

PAGE = page_named("ranks.md")
SLOW, FAST = "drive.speed=1 um/s", "drive.speed=25 um/s"
TESTS = {256: [SLOW], 512: [SLOW], 1024: [FAST], 2048: [FAST, "drive.preload=5 mN"]}
"""Scenes by n: some 2300, 3400, 500 and 200 pairs of transforms."""
WHOLE_TESTS = {1024: [SLOW], 2048: [SLOW]}
"""With `--whole`, `speed` measures these as well, the shipped programme on large grids: some 5000 and 8000 pairs."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("speed", "shares", "model", "latency"))
    parser.add_argument("--n", type=int, nargs="+", default=[512, 1024, 2048], help="grid points a side")
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 3], help="numbers of ranks")
    parser.add_argument("--rounds", type=int, default=3, help="for speed (default: %(default)s)")
    parser.add_argument(
        "--whole", action="store_true", help="for speed: the whole programme on large grids, too (minutes)"
    )
    parser.add_argument("--busy", action="store_true", help="for speed: a process that computes on each core")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="further changes of the scene")
    parser.add_argument("--page", action="store_true", help="write the tables into docs/evidence/ranks.md")
    arguments(parser.add_argument_group("assumptions of the model"))
    options = parser.parse_args()
    # Before the runs of its own.
    options.load = busy()
    if options.what != "latency":
        {"speed": speed, "shares": shares, "model": model}[options.what](options)
        return
    comm = launch.world()
    with launch.guarded(comm):
        latency(comm)


def speed(options: argparse.Namespace) -> None:
    """Prints the best times of whole runs, and their ratios."""
    others = [_busy() for _ in range(os.cpu_count() or 1)] if options.busy else []
    rows = []
    try:
        print(f"{'n':>6} {'ranks':>6} {'best s':>8} {'over 1 rank':>12}   all rounds [s]")
        for n, test in tests_of(options):
            times: dict[int, list[float]] = {ranks: [] for ranks in options.ranks}
            for _ in range(options.rounds):
                for ranks in options.ranks:
                    times[ranks].append(_run(n, ranks, [*test, *options.set]))
            first = min(times[options.ranks[0]])
            for ranks, taken in times.items():
                each = " ".join(f"{seconds:.2f}" for seconds in taken)
                print(f"{n:6d} {ranks:6d} {min(taken):8.2f} {min(taken) / first:12.2f}   {each}", flush=True)
            best = [min(taken) for taken in times.values()]
            ratios = [f"{later / earlier:.2f}" for earlier, later in pairwise(best)]
            words = ", ".join(change.partition(".")[2].replace("=", " ").replace(" um", " µm") for change in test)
            rows.append(
                [f"n = {n}, {words}", stepped(n, options.set), *(f"{seconds:.2f} s" for seconds in best), *ratios]
            )
    finally:
        for other in others:
            other.kill()
    if options.page and not options.busy:
        head = ["tri-tack", "points", *(f"{ranks} rank{'s' * (ranks > 1)}" for ranks in options.ranks)]
        head += [f"{later} over {earlier}" for earlier, later in pairwise(options.ranks)]
        about = f"The best of {options.rounds} rounds, on {os.cpu_count()} cores{changed(options.set)}."
        fill(PAGE, "speed", lambda name: "\n\n".join(filter(None, (about, table(head, rows), options.load))))


def tests_of(options: argparse.Namespace) -> list[tuple[int, list[str]]]:
    """Sizes and changes of the tests that `speed` measures."""
    tests = [(n, TESTS.get(n, TESTS[1024])) for n in options.n]
    return tests + [(n, WHOLE_TESTS[n]) for n in options.n if options.whole and n in WHOLE_TESTS]


def scene_of(n: int, changes: list[str]) -> list[str]:
    """The test of a size, as the command line has it."""
    return ["tri-tack", f"grid.n={n}", *TESTS.get(n, TESTS[1024]), *changes]


def stepped(n: int, changes: list[str]) -> str:
    """Precision and part of the punch that a run of the test steps, as "mixed half"."""
    from pgfmd.forecast.run_times import problem_of
    from pgfmd.scene import load_scene

    test = scene_of(n, changes)
    return problem_of(load_scene(test[0], test[1:])).kind


def changed(changes: list[str]) -> str:
    """What else was changed in the scene, as the end of a sentence."""
    return f", with {', '.join(changes)}" if changes else ""


def _busy() -> subprocess.Popen:
    """A process that computes without an end."""
    return subprocess.Popen([sys.executable, "-c", "while True: sum(range(100000))"])


def _run(n: int, ranks: int, changes: list[str]) -> float:
    """Time [s] of a whole run with these changes, from the command to its end."""
    folder = tempfile.mkdtemp(prefix="pgfmd-ranks-")
    command = [
        sys.executable,
        "-P",
        "-m",
        "pgfmd.cli",
        "run",
        "tri-tack",
        f"grid.n={n}",
        *changes,
        "--out",
        f"{folder}/run",
    ]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    # Without compiled modules, a start compiles all of pgfmd's sources each time, on each rank.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    try:
        began = time.perf_counter()
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
        taken = time.perf_counter() - began
        record = json.loads(Path(folder, "run", "run.json").read_text("utf-8"))
        if record["finished"] != DETACHED:
            raise SystemExit(f"n = {n}, {ranks} ranks: {record['finished']}")
        return taken
    finally:
        shutil.rmtree(folder, ignore_errors=True)


BEFORE = {
    "start: launch and imports": (1.7, 1.5), "start: kernels": (0.0, 1.2), "transforms of columns": (6.5, 3.2),
    "transforms of rows": (2.8, 1.5), "transposes": (0.0, 1.6), "waits for sums": (0.0, 0.95),
    "curve, snapshots, checkpoints": (1.1, 0.8), "pointwise and the rest": (3.5, 1.15), "whole": (15.6, 11.9),
}  # fmt: skip
"""Seconds of the first rank, on 1 and 2 ranks, of the test at n = 2048 with pgfmd 0.1, on an idle machine of the same kind."""


def shares(options: argparse.Namespace) -> None:
    """Prints where the time of whole runs goes, in seconds of the first rank; fills the page if asked to."""
    from .shares import PARTS

    tables = []
    for n in options.n:
        found = {ranks: _profile(n, ranks, options.set) for ranks in options.ranks}
        head = [
            f"n = {n}, {stepped(n, options.set)} points, {found[options.ranks[0]]['pairs']} pairs",
            *(f"{k} rank{'s' * (k > 1)} (s)" for k in found),
        ]
        head, rows = [*head, *(f"{k} (%)" for k in found)], []
        for part in (*PARTS, "whole"):
            seconds = [each[part] for each in found.values()]
            percent = [100.0 * each[part] / each["whole"] for each in found.values()]
            rows.append([part, *(f"{value:.2f}" for value in seconds), *(f"{value:.1f}" for value in percent)])
        rows += [
            [count, *(f"{each[count]:.2f}" for each in found.values()), *("" for _ in found)]
            for count in ("sums per pair", "synchronisations per pair")
        ]
        tables.append(table(head, rows))
        print(f"\n{tables[-1]}", flush=True)
    if options.page:
        rows = [[part, *(f"{value:.2f}" for value in values)] for part, values in BEFORE.items()]
        blocks = {
            "after": "\n\n".join(filter(None, [*tables, options.load])),
            "before": table(["n = 2048, 220 pairs", "1 rank (s)", "2 ranks (s)"], rows),
        }
        fill(PAGE, "shares", blocks.__getitem__)


def _profile(n: int, ranks: int, changes: list[str]) -> dict[str, float]:
    """Where the time of a run's first rank goes (shares.py)."""
    command = [
        sys.executable,
        "-m",
        "scripts.studies.ranks.shares",
        f"{time.time():.6f}",
        *scene_of(n, changes),
    ]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    return json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout)[0]


def model(options: argparse.Namespace) -> None:
    """Measures this machine, and prints what the model makes of it; fills the page if asked to."""
    found = blocks(options)
    found["measured"] = "\n\n".join(filter(None, (found["measured"], options.load)))
    for name, text in found.items():
        print(f"\n{name}\n\n{text}", flush=True)
    if options.page:
        fill(PAGE, "model", found.__getitem__)


def latency(comm) -> None:
    """Prints the time of a synchronisation of all ranks that arrive at the same time, and of an Allreduce. Collective."""
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

    for name, action in (
        ("meeting", node.meet),
        ("Barrier", comm.Barrier),
        ("Allreduce", lambda: comm.Allreduce(number, total)),
    ):
        taken = timed(action)
        if comm.rank == 0:
            print(
                f"{name:10s} median {np.median(taken):7.2f} us, mean {taken.mean():7.2f} us, largest {taken.max():8.1f} us"
            )


if __name__ == "__main__":
    main()
