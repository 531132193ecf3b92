"""`pgfmd bench`: how fast this machine is. Collective: every rank takes part."""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pgfmd.errors import ResultError
from pgfmd.host import launch

from .printing import print_json

if TYPE_CHECKING:
    from pgfmd.forecast.machine_profile import Profile

app = typer.Typer(invoke_without_command=True)


class Effort(StrEnum):
    """Effort of FFTW's planner."""

    estimate = "estimate"
    measure = "measure"


@app.callback()
def bench(context: typer.Context) -> None:
    """Measure how fast this machine is. Without a command: what errors either scheme makes for its cost, in less than a
    minute."""
    if context.invoked_subcommand is not None:
        return
    comm = launch.world()
    with launch.guarded(comm):
        from pgfmd.benchmark import bench

        rows = bench.work_precision(comm, _say if comm.rank == 0 else _be_silent)
        if comm.rank == 0:
            for line in bench.comparison(rows):
                _say(line)


def _say(line: str) -> None:
    print(line, flush=True)


def _be_silent(line: str) -> None:
    pass


@app.command()
def transform(
    n: Annotated[int, typer.Option("--n", min=4, help="Points a side.")] = 2048,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    effort: Annotated[Effort, typer.Option(help="Effort of FFTW's planner, for both sides.")] = Effort.estimate,
) -> None:
    """Time a pair of transforms: mpi4py-fft's own on the whole plane, and the fused one under a punch half as wide."""
    comm = launch.world()
    with launch.guarded(comm):
        from pgfmd.benchmark import bench

        record = bench.transform(comm, n, effort.value)
        if comm.rank == 0:
            if as_json:
                print_json(record, indent=None)
            else:
                for name, value in record.items():
                    print(f"{name}: {value:.4g}" if isinstance(value, float) else f"{name}: {value}")


TESTS = (100, 1000, 10_000)
"""Pairs of transforms of a short, a usual and a long test."""


@app.command()
def ranks(
    n: Annotated[
        list[int] | None, typer.Argument(metavar="[N]...", min=64, help="Points a side, 256 512 1024 2048.")
    ] = None,
    most: Annotated[int | None, typer.Option("--most", min=1, help="Most ranks that are tried; all cores.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Measure how many ranks this machine deserves, in about a minute, and keep that for `pgfmd check`. It starts its own
    ranks."""
    from pgfmd.benchmark.ranks import SIZES, counts_to_measure, survey
    from pgfmd.forecast import machine_profile
    from pgfmd.host.processes import cores, load
    from pgfmd.host.ranks import Trouble, launcher

    if launch.launched()[0] > 1:
        raise launch.LaunchError("bench ranks: start it without mpirun, it starts its own ranks")
    if load():
        launch.complain(
            "warning: this machine is busy, and what is measured now will be too slow; measure it when it is idle"
        )
    sizes = sorted(set(n or SIZES))
    counts = counts_to_measure(min(most or cores(), cores())) if launcher() else [1]
    try:
        profile, records = survey(sizes, counts, launch.complain)
    except Trouble as trouble:
        raise launch.LaunchError(f"bench ranks: {trouble}; {trouble.cure}") from None
    if as_json:
        print_json({"start_s": profile.start, "pairs": records})
    else:
        _show_ranks(profile, records, counts)
    if not launcher():
        launch.complain("note: neither mpirun nor mpiexec is on PATH: measured on one rank only")
    try:
        launch.complain(f"kept for `pgfmd check`: {machine_profile.write(profile)}")
    except machine_profile.NoProfile as problem:
        raise ResultError(str(problem)) from None


def _show_ranks(profile: Profile, records: list[dict[str, Any]], counts: list[int]) -> None:
    """Prints what was measured, what the model makes of it, and how many ranks tests of several lengths deserve."""
    from pgfmd.benchmark.ranks import TINY, forced, usual
    from pgfmd.forecast.scaling import total_seconds

    print(f"{profile.machine}; {profile.cores} for this process")
    print(f"\n{'ranks':>6} {'start s':>8} {'work side by side takes longer by, in double':>46} {'mixed precision':>16}")
    for count in counts:
        longer = [100 * (profile.costs[kind].crowd(count) - 1) for kind in ("double whole", "mixed half")]
        print(f"{count:6d} {profile.start[count]:8.2f} {longer[0]:44.0f} % {longer[1]:14.0f} %")
    print(
        f"\n{'points':>15} {'n':>6} {'ranks':>6} {'pair ms':>9} {'model ms':>9}   a pair of transforms with all that goes with it"
    )
    for record in sorted(
        records, key=lambda record: (record["precision"], record["mirror"], record["n"], record["ranks"])
    ):
        if record["n"] != TINY:
            problem = forced(record["n"], record["precision"], record["mirror"])
            expected = total_seconds(problem, record["ranks"], profile.costs[problem.kind], sums=record["sums"])
            numbers = f"{1e3 * record['pair']:9.3g} {1e3 * expected:9.3g}"
            print(f"{problem.kind:>15} {record['n']:6d} {record['ranks']:6d} {numbers}")
    print(
        f"\n{'':>15} ranks that tri-tack deserves with so many pairs, as a run steps it by default, and its time on them"
    )
    print(f"{'points':>15} {'n':>6} " + " ".join(f"{pairs:>16d}" for pairs in TESTS))
    for n in profile.costs["double whole"].sizes:
        problem, cells = usual(n), []
        for pairs in TESTS:
            best = profile.best_ranks(problem, pairs)
            cells.append(f"{best:4d} {profile.run_seconds(problem, pairs, best):9.3g} s")
        print(f"{problem.kind:>15} {n:6d} " + " ".join(f"{cell:>16}" for cell in cells))
