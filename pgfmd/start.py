"""A run into a folder, started from Python: in this process, on a communicator, or on ranks that are started for it."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import PgfmdError, RunError, Stopped
from .host.launch import communicator
from .host.walltime import seconds_of
from .results import Results, load
from .scene import Scene

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

OFF = "off"


def run(
    scene: Scene | str | Path | Mapping[str, Any],
    directory: str | Path,
    *,
    ranks: int = 1,
    comm: Intracomm | None = None,
    fresh: bool = False,
    allow: Sequence[str] = (),
    checkpoint_every: str = "10min",
    say: Callable[[str], None] = print,
) -> Results:
    """Runs a scene into a folder, or goes on with the run that is there; returns its results. As `pgfmd run`.

    Args:
        scene: a Scene, or what one is made from.
        directory: of the results. With several ranks, their output goes to the file DIRECTORY.log.
        ranks: MPI ranks; more than one are started by `mpirun`.
        comm: instead of `ranks`, in a program that runs under mpirun: the communicator of all that take part.
        fresh: begin anew, and keep old results aside.
        allow: keys, or sections, that may have changed since the run began.
        checkpoint_every: time between checkpoints, or "off": only when the run stops.
        say: called with lines of progress.

    Ctrl-C leaves a checkpoint where several ranks were started; the same call goes on from there.

    Raises:
        SceneError: if the scene can't be; ResultError: if the folder can't be used; RunError: if a step can't be solved;
        LaunchError: if MPI can't be had, or several processes were started, and no `comm` is given.
    """
    if comm is not None and ranks != 1:
        raise ValueError("run: ranks starts processes of its own, comm names those that are there; give one of them")
    scene = scene if isinstance(scene, Scene) else Scene(scene)
    if comm is None and ranks > 1:
        _on_ranks(scene, Path(directory), ranks, fresh, allow, checkpoint_every, say)
    else:
        from .restart.checkpoint_policy import Timing
        from .runner import Options, run_scene

        every = math.inf if checkpoint_every == OFF else seconds_of(checkpoint_every)
        options = Options(fresh, tuple(allow), Timing(every))
        run_scene(scene, communicator(comm, "run"), directory, say, options)
    return load(directory)


def _on_ranks(
    scene: Scene, directory: Path, ranks: int, fresh: bool, allow: Sequence[str], every: str, say: Callable[[str], None]
) -> None:
    """The same by `pgfmd run` under mpirun."""
    from .studies.pool import Ending, Pool, Task

    # A program under mpirun has to say what its processes are to do.
    communicator(None, "run")
    endings: list[Ending] = []
    with tempfile.TemporaryDirectory(prefix="pgfmd-") as folder:
        file = Path(folder) / "scene.toml"
        file.write_text(scene.to_toml(), encoding="utf-8")
        arguments = [str(file), "--out", str(directory), "--checkpoint-every", every, *["--fresh"] * fresh]
        arguments += [word for key in allow for word in ("--allow", key)]
        log = directory.with_name(f"{directory.name}.log")
        pool = Pool(ranks, say=say)
        pool.run([Task(str(directory), tuple(arguments), directory, log)], lambda task, ending: endings.append(ending))
    ending = endings[0]
    if pool.stopped:
        raise KeyboardInterrupt(f"stopped by {pool.stopped}, with a checkpoint in {directory}: the same call goes on")
    if ending.code:
        error = (
            RunError(ending.why) if ending.code in (RunError.exit_code, Stopped.exit_code) else PgfmdError(ending.why)
        )
        error.exit_code = ending.code
        raise error
