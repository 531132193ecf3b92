"""What ranks cost and bring on this machine: measured by tack tests on 1, 2, ... ranks, each started as a process of its own.

    python -m pgfmd.benchmark.ranks 512 1024            what the ranks that run this measure, as JSON; also under mpirun

`survey` starts these, and makes a profile of what they have found (forecast/machine_profile.py).
"""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import datetime
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from pgfmd.forecast.machine_profile import Profile, identity
from pgfmd.forecast.run_times import problem_of
from pgfmd.forecast.scaling import KINDS, Costs, Problem, nodes_of, pair_seconds, traffic_of_pair
from pgfmd.host.processes import cores
from pgfmd.host.ranks import launcher, on_ranks

from .timing import Watch

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.solver.simulation import Simulation

SCENE = ("tri-tack", "drive.speed=25 um/s", "drive.preload=5 mN", "solver.scheme=inertialess")
"""The test whose steps are timed: as a run would make them, and with other precisions and parts of the punch."""
MIRRORS = ("", "x", "xy")
"""Of each precision the whole punch, half and a quarter are stepped by one rank: an image of the half, or quarter, makes
another punch of it, whose steps cost as much."""
WITNESSES = {"double": "", "mixed": "x"}
"""What is measured on several ranks, too: what they lose to each other is taken to be that of all parts of the punch."""
TINY = 32
"""Points a side of a test that is all overhead."""
SIZES = (256, 512, 1024, 2048)
"""Default numbers of points a side that are measured."""
SECONDS = 0.5
"""That the steps of a size and kind are timed, about."""
FEWEST = 12
"""Pairs that are timed, at least."""
ROWS = 16384
"""Rows whose sums are timed."""
PATIENCE = 600.0
"""Seconds that one number of ranks may take."""


def counts_to_measure(most: int) -> list[int]:
    """Numbers of ranks for measurements on a machine with a number of cores: 1, 2, 4, ... and all of them."""
    return sorted({1, most} | {2**power for power in range(1, most.bit_length()) if 2**power <= most})


def survey(
    sizes: Sequence[int], counts: Sequence[int], say: Callable[[str], None] = lambda line: None
) -> tuple[Profile, list[dict]]:
    """The profile of this machine, and what was measured: a record for each number of ranks and size. counts: numbers of
    ranks, one first. Trouble where ranks can't be started."""
    path, records, start = launcher(), [], {}
    for count in counts:
        say(f"measuring on {count} rank{'s' * (count > 1)} ...")
        arguments = ["-m", "pgfmd.benchmark.ranks", *map(str, sorted({TINY, *sizes}))]
        records += json.loads(on_ranks(path if count > 1 else None, arguments, count, PATIENCE))
        start[count] = min(_start_seconds(path if count > 1 else None, count) for _ in range(3))
    # Ranks that share a core tell nothing of those that don't.
    usable = [record for record in records if record["ranks"] <= cores()]
    profile = Profile(identity(), cores(), f"{datetime.now():%Y-%m-%d %H:%M}", start, fitted(usable))
    return profile, records


def _start_seconds(path: str | None, count: int) -> float:
    """Seconds of a whole run that hardly has a step."""
    with tempfile.TemporaryDirectory(prefix="pgfmd-bench-") as folder:
        scene = [*SCENE, f"grid.n={TINY}", "solver.max_steps=1", "output.snapshots=[]"]
        began = time.perf_counter()
        on_ranks(path, ["-m", "pgfmd.cli", "run", *scene, "--out", folder], count)
        return time.perf_counter() - began


def fitted(records: Sequence[dict]) -> dict[str, Costs]:
    """The costs of work and of meetings by the kind of a problem, out of what was measured on 1, 2, ... ranks."""
    found: dict[str, Any] = {}
    for precision, witness in WITNESSES.items():
        mine = [record for record in records if record["precision"] == precision]
        several = [record for record in mine if record["ranks"] > 1]
        alone = {mirror: [r for r in mine if r["ranks"] == 1 and r["mirror"] == mirror] for mirror in MIRRORS}
        costs = {mirror: _fitted(measured, several) for mirror, measured in alone.items()}
        shared = _shared(costs[witness], several)
        found |= {_kind(precision, mirror): replace(each, shared=shared) for mirror, each in costs.items()}
    return found


def _kind(precision: str, mirror: str) -> str:
    return Problem(0, 0, np.zeros(1), mirror, precision).kind


def _fitted(alone: Sequence[dict], several: Sequence[dict]) -> Costs:
    """Costs of one kind, but for the bytes in others' memory. alone, several: measured on one rank and on more."""
    by_size = {record["n"]: record for record in alone}
    tiny, sizes = by_size[TINY], sorted(by_size.keys() - {TINY})

    def each(part: str, over: str, few: int = 0) -> tuple[float, ...]:
        # Beyond what a tiny test takes, which is overhead but for a few points.
        return tuple(max(by_size[n][part] - tiny[part], 0.0) / (by_size[n][over] - few) for n in sizes)

    point = each("pass", "points", tiny["points"])
    most = max((record["ranks"] for record in several), default=1)
    crowding = {1: 1.0} | {
        count: max(1.0, statistics.median(r["crowding"] for r in several if r["ranks"] == count and r["n"] in sizes))
        for count in sorted({record["ranks"] for record in several})
    }
    meetings = {record["ranks"]: record["meeting"] for record in several}
    looks = [(meetings[b] - meetings[a]) / (b - a) for a, b in pairwise(sorted(meetings))]
    return Costs(
        sizes=tuple(sizes), row=each("rows", "row_count"), column=each("columns", "column_count"),
        points=tuple(by_size[n]["points"] for n in sizes), point=point,
        pair_overhead=tiny["rows"] + tiny["columns"],
        sum_overhead=max(tiny["pass"] - tiny["points"] * point[0], 0.0), adding=tiny["adding"],
        crowding=tuple(float(np.interp(k, list(crowding), list(crowding.values()))) for k in range(1, most + 1)),
        meeting=meetings.get(min(meetings, default=0), 0.0), look=max(0.0, statistics.median(looks)) if looks else 0.0,
    )  # fmt: skip


def _shared(costs: Costs, several: Sequence[dict]) -> float:
    """What a byte in the memory of another rank costs [s]: what the transforms of few ranks take beyond all else."""
    more = passed = 0.0
    fewest = min((record["ranks"] for record in several), default=0)
    for record in several:
        if record["n"] not in costs.sizes or record["ranks"] != fewest:
            continue
        problem = forced(record["n"], record["precision"], record["mirror"])
        parts = pair_seconds(problem, fewest, costs)
        excess = record["rows"] + record["columns"] - parts["rows"] - parts["columns"] - costs.pair_overhead
        shared = traffic_of_pair(problem, nodes_of(fewest, fewest), 0).shared
        # Least squares: large grids, which pass most, count most.
        more, passed = more + excess * shared, passed + shared**2
    return max(0.0, more / passed) if passed else 0.0


def usual(n: int, changes: Sequence[str] = ()) -> Problem:
    """What a run of the timed test shares out, with the precision and the part of the punch that it chooses."""
    from pgfmd.scene import load_scene

    return problem_of(load_scene(SCENE[0], [*SCENE[1:], f"grid.n={n}", *changes]))


def forced(n: int, precision: str, mirror: str) -> Problem:
    """The same of a given precision, and part of the punch."""
    return problem_of(_scene(n, precision), mirror)


def _scene(n: int, precision: str):
    from pgfmd.scene import load_scene

    return load_scene(SCENE[0], [*SCENE[1:], f"grid.n={n}", f"solver.precision={precision}"])


# What the ranks do ---------------------------------------------------------------------------------------------------
def measure(comm: Intracomm, sizes: Sequence[int]) -> list[dict]:
    """A record for each size and kind, on these ranks: seconds a pair, in all and by parts (of the first rank), and counts.
    Collective."""
    # Plans and pages of the first time don't count.
    _steps(comm, TINY, "double", "")
    common, found = {"ranks": comm.size, "adding": _adding(), "meeting": _meeting(comm)}, []
    for precision, witness in WITNESSES.items():
        for mirror in MIRRORS if comm.size == 1 else (witness,):
            for n in sizes:
                crowding = {"crowding": _crowding(comm, n, precision, mirror)}
                found.append(common | _steps(comm, n, precision, mirror) | crowding)
    return found


def _steps(comm: Intracomm, n: int, precision: str, mirror: str) -> dict:
    """Times the steps of a test, from its third step on."""
    from pgfmd.assemble import assemble

    simulation = assemble(_scene(n, precision), comm, mirror)
    watch, points = Watch(simulation), simulation.points
    wanted, began = _pairs_for(simulation), {}

    def attend(run: Simulation) -> bool:
        if run.state.counters.steps == 2:
            began.update(watch.now())
        return bool(began) and run.scheme.pairs - began["pairs"] >= wanted

    simulation.run(attend=attend)
    ended = watch.now()
    spent = {name: ended[name] - began[name] for name in ended}
    pairs, transforms = spent.pop("pairs"), spent.pop("transforms")
    each, problem = {name: value / pairs for name, value in spent.items()}, forced(n, precision, mirror)
    about = {
        "n": n, "precision": precision, "mirror": mirror, "row_count": problem.rows, "column_count": problem.columns,
        "points": points.total // points.images, "pairs": pairs,
    }  # fmt: skip
    return about | each | watch.usual() | {"pass": (spent["pair"] - transforms) / spent["sums"]}


def _pairs_for(simulation: Simulation) -> int:
    """How many pairs take about `SECONDS`, the same on every rank: the work beside a pair takes as long as it."""
    solver: Any = simulation.scheme.solver
    operator, points = solver.rough, simulation.points
    load, surface = points.zeros(operator.dtype) + operator.dtype.type(1), points.zeros(operator.dtype)
    operator(load, surface)
    began = time.perf_counter()
    operator(load, surface)
    taken = points.comm.bcast(time.perf_counter() - began)
    return max(FEWEST, round(SECONDS / (2.0 * taken)))


def _crowding(comm: Intracomm, n: int, precision: str, mirror: str) -> float:
    """By which factor a pair takes longer where all ranks do one, each for itself, than where one does: the better of
    some rounds, of the slowest rank."""
    if comm.size == 1:
        return 1.0
    from mpi4py import MPI

    from pgfmd.assemble import convolution_of
    from pgfmd.symmetry import points_of

    scene, dtype = _scene(n, precision), np.dtype(np.float64 if precision == "double" else np.float32)
    points = points_of(scene, mirror, MPI.COMM_SELF)
    operator = convolution_of(scene, points, dtype=dtype)
    load, surface = points.zeros(dtype) + dtype.type(1), points.zeros(dtype)

    def seconds() -> float:
        began, count = time.process_time(), 0
        while count < 2 or time.process_time() - began < 0.02:
            operator(load, surface)
            count += 1
        return (time.process_time() - began) / count

    best = {"alone": np.inf, "together": np.inf}
    for _ in range(5):
        # In turns, as other load comes and goes.
        for name in best:
            comm.Barrier()
            taken = seconds() if comm.rank == 0 or name == "together" else 0.0
            best[name] = min(best[name], max(comm.allgather(taken)))
    return best["together"] / best["alone"]


def _meeting(comm: Intracomm) -> float:
    """Seconds of a meeting to which all ranks of the node come at once, the median of many."""
    if comm.size == 1:
        return 0.0
    from pgfmd.solver.node import Node

    node, times = Node.of(comm), []
    if node.local.size == 1:
        return 0.0
    for _ in range(1000):
        began = time.perf_counter()
        node.meet()
        times.append(time.perf_counter() - began)
    return statistics.median(times)


def _adding() -> float:
    """Seconds for each row of a sum over all rows, as an iteration of conjugate gradients makes it."""

    def seconds(rows: np.ndarray) -> float:
        times = []
        for _ in range(20):
            began = time.perf_counter()
            rows[:3].sum(axis=1)
            rows[3:].max(axis=1)
            times.append(time.perf_counter() - began)
        return min(times)

    few = 16
    return max(0.0, seconds(np.ones((KINDS, ROWS))) - seconds(np.ones((KINDS, few)))) / (ROWS - few)


def main() -> None:
    """Measures the sizes that the command line names, and prints the records from one rank."""
    from pgfmd.host import launch

    comm = launch.world()
    with launch.guarded(comm):
        records = measure(comm, [int(size) for size in sys.argv[1:]])
        if comm.rank == 0:
            print(json.dumps(records))


if __name__ == "__main__":
    main()
