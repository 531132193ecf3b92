"""`pgfmd study` and `pgfmd converge`: the options of the commands. Serial: they start processes that are not."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pgfmd.host.streams import say

from .names import named, path_option
from .printing import command
from .run import Changes, Overrides, SceneName, all_changes

if TYPE_CHECKING:
    from pgfmd.studies.campaign import Campaign
    from pgfmd.studies.table import StudyTable

Out = Annotated[Path | None, path_option("--out", "-o", metavar="DIR", help="Folder of the folders of the cases.")]
Ranks = Annotated[int | None, typer.Option("--ranks", "-n", min=1, help="Ranks of each job.")]
Retry = Annotated[bool, typer.Option("--retry", help="Go on with failed cases, too.")]
Fresh = Annotated[bool, typer.Option("--fresh", help="Start changed and damaged cases anew; keeps the old.")]
Allow = Annotated[
    list[str] | None, typer.Option("--allow", metavar="KEY", help="A key that may have changed since a run began.")
]
Every = Annotated[
    str | None, typer.Option("--checkpoint-every", metavar="TIME", help="Time between checkpoints, or `off`.")
]


class Refinement(StrEnum):
    """What `pgfmd converge` refines."""

    rho = "rho"
    n = "n"
    accuracy = "accuracy"


class Quantity(StrEnum):
    """What `pgfmd converge` extrapolates."""

    loop = "loop"
    work = "work"
    pull_off = "pull-off"


def study(
    file: Annotated[Path, typer.Argument(metavar="FILE.toml", parser=named, help="The study: docs/how-to/studies.md.")],
    out: Out = None,
    ranks: Ranks = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", "-j", min=1, help="Jobs side by side; with --slurm, tasks at once.")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="CASE", help="Only cases of this name; * stands for anything.")
    ] = None,
    retry: Retry = False,
    fresh: Fresh = False,
    allow: Allow = None,
    checkpoint_every: Every = None,
    twins: Annotated[bool, typer.Option("--twins", help="Run the quasi-static twins of the cases too.")] = False,
    collect: Annotated[bool, typer.Option("--collect", help="Only write the table and the figures.")] = False,
    slurm: Annotated[bool, typer.Option("--slurm", help="Submit an array of Slurm jobs.")] = False,
    sbatch_options: Annotated[
        str, typer.Option("--sbatch-options", metavar="TEXT", help='For sbatch, such as "--time=4:00:00".')
    ] = "",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Start nothing, show what is to be done. With --slurm, writes its files.")
    ] = False,
) -> None:
    """Run a grid of scenes, one folder a case, or go on with it; then its table and figures."""
    from pgfmd.studies.study import planned

    if collect and (slurm or dry_run):
        raise typer.BadParameter("goes with neither --slurm nor --dry-run", param_hint="--collect")
    if sbatch_options and not slurm:
        raise typer.BadParameter("needs --slurm", param_hint="--sbatch-options")
    _require_time(checkpoint_every)
    plan = planned(
        file, None, None, out, ranks, None if slurm else jobs, checkpoint_every, twins,
        retry=retry, fresh=fresh, allow=allow or (), say=say,
    )  # fmt: skip
    chosen = plan.campaign.only(only or [])
    if collect:
        show(plan.table())
    elif slurm:
        from pgfmd.studies.slurm_array import submit

        submit(chosen, plan.ranks, jobs, file.stem, sbatch_options, dry_run)
    elif dry_run:
        show_agenda(chosen)
    else:
        table, problem = plan.run(only or [])
        show(table)
        if problem is not None:
            raise problem


def converge(
    scene: SceneName,
    changes: Changes = None,
    overrides: Overrides = None,
    axis: Annotated[Refinement, typer.Option("--axis", help="What is refined.")] = Refinement.rho,
    levels: Annotated[int, typer.Option("--levels", min=2, help="Number of levels, the scene's own included.")] = 4,
    start: Annotated[
        str | None, typer.Option("--from", metavar="N", help="n, or the accuracy, of the coarsest level; the scene's.")
    ] = None,
    factor: Annotated[
        float | None, typer.Option(metavar="F", help="Refinement from level to level: 2; of the accuracy sqrt(10).")
    ] = None,
    largest_n: Annotated[int | None, typer.Option("--largest-n", metavar="N", help="No finer grid than this.")] = None,
    quantity: Annotated[Quantity, typer.Option("--quantity", "-q", help="What is extrapolated.")] = Quantity.loop,
    power: Annotated[
        float | None, typer.Option(metavar="P", help="Power of the error, where it is known; 1/3 of loops with rho.")
    ] = None,
    out: Out = None,
    ranks: Annotated[int, typer.Option("--ranks", "-n", min=1, help="Ranks of each job.")] = 1,
    retry: Retry = False,
    fresh: Fresh = False,
    allow: Allow = None,
    checkpoint_every: Annotated[
        str, typer.Option("--checkpoint-every", metavar="TIME", help="Time between checkpoints, or `off`.")
    ] = "10min",
) -> None:
    """Run a scene on finer and finer levels, fit a power law, and extrapolate; goes on where it was stopped."""
    from pgfmd.studies.extrapolation import extrapolate, report, write
    from pgfmd.studies.refinement import FEWEST
    from pgfmd.studies.study import refined

    if power is not None and not power > 0.0:
        raise typer.BadParameter("must be above 0", param_hint="--power")
    _require_time(checkpoint_every)
    out = out or Path("out", f"converge-{Path(scene).stem}-{axis.value}")
    ladder, plan = refined(
        scene, all_changes(changes, overrides), axis.value, levels, start, factor, largest_n, ranks or 1, out,
        checkpoint_every or "10min", retry=retry, fresh=fresh, allow=allow or (), say=say,
    )  # fmt: skip
    for line in ladder.lines():
        say(line)
    table, problem = plan.run()
    show(table)
    if problem is None or sum(row.state.complete for row in table.rows) >= FEWEST:
        found = extrapolate(ladder, table.rows, quantity.value, power)
        for line in [*report(found), " ".join(map(str, write(out, found, table.title)))]:
            say(line)
    if problem is not None:
        raise problem


def _require_time(every: str | None) -> None:
    """A usage error for a text that is no time between checkpoints."""
    from pgfmd.host.walltime import seconds_of
    from pgfmd.studies.study import OFF

    try:
        _ = every in (None, OFF) or seconds_of(every)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--checkpoint-every") from None


def show(table: StudyTable) -> None:
    """Writes the table and the figures of a study, and prints the table."""
    from pgfmd.studies.study import write

    paths = write(table)
    for line in [*str(table).splitlines(), *(f"note: {text}" for text in table.remarks)]:
        say(line)
    say(" ".join(map(str, paths)))


def show_agenda(campaign: Campaign) -> None:
    """Prints every case, how it stands, and whether a job is to be started for it."""
    states = campaign.states()
    chosen = {case.name for case in campaign.agenda(states)}
    for case in campaign.cases:
        mark = "to run" if case.name in chosen else "left"
        say(f"{mark:6}  {case.name}: {states[case.name]}")
        say(f"        {command('pgfmd', 'run', *campaign.arguments(case), '--out', campaign.folder(case))}")
