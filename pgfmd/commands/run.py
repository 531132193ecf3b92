"""`pgfmd run`: starts a scene, goes on with it, or finds it finished. Collective: every rank takes part."""

from __future__ import annotations

import math
import time
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pgfmd.host import batch, launch
from pgfmd.host.spare_ranks import on_cores
from pgfmd.host.streams import say
from pgfmd.host.walltime import end_of_job, seconds_of
from pgfmd.physics.drive import ENDED_WELL, FORCE, PRELOAD

from .names import path_option
from .printing import command

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.output.progress_bar import ProgressBar
    from pgfmd.scene import Scene

SceneName = Annotated[str, typer.Argument(metavar="SCENE", help="A TOML file, or the name of a shipped scene.")]
Changes = Annotated[
    list[str] | None,
    typer.Argument(metavar="[KEY=VALUE]...", help='Keys to change, such as grid.n=512 "drive.speed=10 um/s".'),
]
Overrides = Annotated[
    list[str] | None,
    typer.Option("--set", "-s", metavar="KEY=VALUE", help="The same, one key at a time."),
]
LAUNCHER_NEEDS = 10.0
"""Time [s] before the end of a job at which a run has to be over: after a code other than 0, mpirun takes 5 s to
end."""
REPORTED = (
    ("pull-off force", "pull_off_force", "_N", 1e3, "mN"),
    ("work of separation", "work_of_separation", "_J", 1e9, "nJ"),
)
"""What the last lines of a run tell: words, key of `run.json`, its unit; factor to the unit that is shown."""
LOOP = ("loop", "work", "_J", 1e9, "nJ")
"""The same of a quasi-static run, for which the loop is what is lost in jumps."""
OFF = "off"
_BEGAN = time.time()
"""About when the process began: limits of time count from then."""


def run(
    scene: SceneName,
    changes: Changes = None,
    out: Annotated[Path | None, path_option("--out", "-o", metavar="DIR", help="Folder of the results.")] = None,
    overrides: Overrides = None,
    fresh: Annotated[
        bool, typer.Option("--fresh", help="Start anew; old results are kept in DIR/previous-1 ...")
    ] = False,
    allow: Annotated[
        list[str] | None,
        typer.Option("--allow", metavar="KEY", help="A key, or a section, that may have changed since the run began."),
    ] = None,
    checkpoint_every: Annotated[
        str, typer.Option(metavar="TIME", help="Time between checkpoints, or `off`: only when the run stops.")
    ] = "10min",
    walltime: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Stop before this, with a checkpoint. Slurm's and PBS's limits are known."),
    ] = None,
) -> None:
    """Run a scene, or go on with the run in DIR; on several ranks: mpirun -n 4 pgfmd run SCENE."""
    # Before MPI starts, so that every rank reports wrong options in the same way.
    every = math.inf if checkpoint_every == OFF else _time("--checkpoint-every", checkpoint_every)
    limit = math.inf if walltime is None else _BEGAN + _time("--walltime", walltime)
    whose = "" if walltime is None else f"--walltime {walltime}"
    changed = all_changes(changes, overrides)
    comm = launch.world()

    def work(comm: Intracomm) -> None:
        loaded, directory = launch.on_first(comm, lambda: _prepared(scene, changed, out, comm.size))
        from pgfmd.restart.checkpoint_policy import Timing
        from pgfmd.results.doubts import missed_preload
        from pgfmd.runner import Options, run_scene

        job_ends = _end_of_job() if comm.rank == 0 else None
        until, why = limit, whose
        if job_ends is not None and job_ends - LAUNCHER_NEEDS < until:
            until, why = job_ends - LAUNCHER_NEEDS, f"{batch.this_job()}, which ends {_moment(job_ends)}"
        options = Options(fresh, tuple(allow or ()), Timing(every, until, why))
        with _bar(comm) as bar:
            if bar is not None:
                options = replace(options, progress=bar.of)
            record = run_scene(loaded, comm, directory, bar.say if bar else say, options)
        if comm.rank == 0:
            for line in [*missed_preload(record, _asked_preload(loaded)), *_summary(record, directory)]:
                say(line)

    with launch.guarded(comm):
        on_cores(comm, work)


def _bar(comm: Intracomm) -> AbstractContextManager[ProgressBar | None]:
    """The bar that a terminal shows; without one, and on several ranks, None: there are lines every few seconds."""
    from pgfmd.output import progress_bar

    return progress_bar.ProgressBar() if comm.size == 1 and progress_bar.is_wanted() else nullcontext()


def all_changes(changes: list[str] | None, overrides: list[str] | None) -> list[str]:
    """The changes of a scene's keys on the command line, in both forms."""
    return [*(overrides or []), *(changes or [])]


def _time(option: str, text: str) -> float:
    try:
        return seconds_of(text)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint=option) from None


def _end_of_job() -> float | None:
    """When the batch job ends (time.time()); None without one, and for one that had ended before this process began."""
    ends = end_of_job()
    if ends is None or ends > _BEGAN:
        return ends
    say(
        f"warning: the time of {batch.this_job()} was over {_moment(ends)}, before this process began: it is taken to be "
        "outside of that job, and its limit is not heeded (--walltime sets one)"
    )
    return None


def _moment(seconds: float) -> str:
    """A time of time.time() as a local date."""
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(seconds))


def _prepared(source: str, overrides: list[str], out: Path | None, ranks: int) -> tuple[Any, Path]:
    """The checked scene and the folder for its results."""
    from pgfmd.scene import load_scene
    from pgfmd.scene_objects import confirm

    scene = load_scene(source, overrides)
    confirm(scene, source, ranks)
    if out is not None:
        return scene, out
    return scene, Path(scene.output.directory or Path("out", Path(source).stem)).expanduser()


def _asked_preload(scene: Scene) -> float | None:
    """The force [N] at which the first approach is to end; None if another value ends it."""
    from pgfmd.scene_objects import drive_of

    if not scene.drive.step:
        return scene.drive.preload
    first = next((phase for phase in drive_of(scene).phases if phase.ends_with == PRELOAD), None)
    forces = [ending.value for ending in first.endings if ending.quantity == FORCE] if first else []
    return forces[0] if len(forces) == 1 and first is not None and len(first.endings) == 1 else None


def _summary(record: dict, directory: Path) -> list[str]:
    """The last lines of a run."""
    from pgfmd.results.doubts import unbalanced, uncertain_loop

    lines = []
    if record["finished"] not in ENDED_WELL:
        lines.append(f"The run stopped early: {record['finished']}. What has been written is valid.")
    lines += [f"{text}." for text in record.get("unmet_ends", [])]
    if record.get("detached") is False and record["pull_off_force_N"]:
        lines.append("The punch has not come off: what is called the pull-off force is the largest tension.")
    if record["pull_off_force_N"] is None:
        measured = "no pull-off force, the run ended before the retraction"
    else:
        measured = ", ".join(_number(record, *about) for about in REPORTED)
        if record["finished"] in ENDED_WELL and record.get("unbalanced_J") is not None:
            measured += ", " + _number(record, *LOOP)
    lines.append(
        f"{measured}; {record['steps']} steps, {record['transform_pairs']} transform pairs, {record['wall_s']:.3g} s"
    )
    lines += unbalanced(record, directory) + uncertain_loop(record)
    return [*lines, f"results: {directory}    pictures: {command('pgfmd', 'plot', directory)}"]


def _number(record: dict, name: str, key: str, suffix: str, factor: float, unit: str) -> str:
    """A number of the record, with its uncertainty where there is one."""
    spread = record.get(f"{key}_uncertainty{suffix}")
    spread_text = f" ± {spread * factor:.2g}" if spread else ""
    return f"{name} {record[key + suffix] * factor + 0.0:.4g}{spread_text} {unit}"
