"""`pgfmd bench`: how fast this machine is. Collective: every rank takes part."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from pgfmd.host import launch

from .printing import print_json

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
