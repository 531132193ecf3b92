"""The command line. Each command loads what it needs when it starts: only `run`, `bench` and `doctor` know MPI."""

from __future__ import annotations

import errno
import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from . import __version__
from .commands import analysis as analysis_command
from .commands import bench as bench_command
from .commands import fit as fit_command
from .commands import fit_prony as fit_prony_command
from .commands import movie as movie_command
from .commands import plot as plot_command
from .commands import punch as punch_command
from .commands import report as report_command
from .commands import run as run_command
from .commands import status as status_command
from .commands import study as study_command
from .commands import watch as watch_command
from .commands.printing import command
from .commands.run import Changes, Overrides, SceneName, all_changes
from .errors import PgfmdError, Problem, ResultError, SceneError
from .host import faults, launch, streams

app = typer.Typer(
    help="Tack tests of a corrugated punch on a viscoelastic, adhesive substrate. Start with: pgfmd init tri-tack",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.add_typer(bench_command.app, name="bench")

COLLECTIVE = ("run", "bench")
"""The commands that every rank takes part in."""


def main(arguments: list[str] | None = None) -> None:
    """Entry point of `pgfmd`: ends in SystemExit with 0, or the exit code of the error."""
    streams.open_closed()
    arguments = sys.argv[1:] if arguments is None else arguments
    _, rank = launch.launched()
    if rank and not set(arguments[:1]) & set(COLLECTIVE):
        # `mpirun pgfmd plot`: once is enough.
        raise SystemExit(0)
    streams.forgive()
    faults.expect(arguments)
    # A user's choice for windows, such as a notebook's: pictures go to files.
    os.environ["MPLBACKEND"] = "agg"
    if arguments[:1] == ["run"]:
        # Before it loads what it needs: a batch system may have enough of a job early.
        launch.listen()
    try:
        code = app(arguments, prog_name="pgfmd", standalone_mode=False)
        if code == launch.INTERRUPTED:
            # Some versions of Typer make this of a Ctrl-C, without a word.
            raise KeyboardInterrupt
    except PgfmdError as error:
        if rank == 0:
            launch.complain(error)
        code = error.exit_code
    except (KeyboardInterrupt, typer.Abort) as error:
        # Typer makes the same of a Ctrl-C and of the end of a file that something read.
        if isinstance(error.__cause__, EOFError):
            code = _unexpected(error.__cause__, rank)
        else:
            if rank == 0:
                launch.complain("interrupted")
            code = launch.INTERRUPTED
    except Exception as error:
        # A usage error of typer's parser, whichever package it comes from.
        if hasattr(error, "show") and hasattr(error, "exit_code"):
            if rank == 0:
                error.show()
            code = error.exit_code
        elif _is_of_stdout(error):
            code = streams.refuse(error)
        else:
            code = _unexpected(error, rank)
    raise SystemExit(streams.finish(code or 0))


def _is_of_stdout(error: Exception) -> bool:
    """Whether it is what was printed that could not be written: the error is of no file."""
    reasons = (errno.ENOSPC, errno.EIO, errno.EPIPE, errno.EDQUOT)
    return isinstance(error, OSError) and error.filename is None and error.errno in reasons


def _unexpected(error: Exception, rank: int) -> int:
    """Tells of an error that nobody expected, on one rank; returns the exit code."""
    faults.take_turn(rank)
    launch.complain(faults.describe(error, *reversed(launch.launched())))
    return faults.exit_code(error)


def _version(wanted: bool) -> None:
    if wanted:
        print(__version__)
        raise typer.Exit()


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


@app.command()
def init(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of a shipped scene, such as tri-tack.")],
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file of this name.")] = False,
) -> None:
    """Write a commented scene, NAME.toml, into the current folder."""
    from .files.regular_files import write_new
    from .scene import shipped_text

    text = shipped_text(name)
    path = Path(f"{name}.toml")
    try:
        write_new(path, text, force)
    except FileExistsError:
        problem = Problem("NAME", name, f"no file {path} here", "move it away, or overwrite it with --force")
        raise SceneError(str(path), [problem]) from None
    except OSError as error:
        raise ResultError(f"{path}: could not be written: {error.strerror}") from None
    print(f"{path} written. Next: {command('pgfmd', 'check', path)}, then {command('pgfmd', 'run', path)}")


@app.command()
def examples() -> None:
    """List the shipped scenes, which `init` writes and every command takes by name."""
    from .scene import shipped_scenes, shipped_text
    from .scene.unresolved_scene import parse_toml

    for name in shipped_scenes():
        print(f"{name:<12} {parse_toml(shipped_text(name)).get('title', '')}")


@app.command()
def check(
    scene: SceneName,
    changes: Changes = None,
    overrides: Overrides = None,
    ranks: Annotated[int, typer.Option("--ranks", "-n", min=1, help="Number of ranks of the planned run.")] = 1,
) -> None:
    """Show what a scene means: SI values, scales, cost, warnings."""
    from .commands.check import check as check_of
    from .scene import load_scene
    from .sections import show

    found = check_of(load_scene(scene, all_changes(changes, overrides)), ranks, source_name=scene)
    notes = [("warning", "yellow", text) for text in found.warnings] + [("note", "", text) for text in found.remarks]
    show(found.title, found.sections, notes, digits=6)


app.command()(plot_command.plot)
app.command()(movie_command.movie)
app.command()(plot_command.plot_rheology)
app.command()(punch_command.show)
app.command()(punch_command.export)
app.command()(fit_prony_command.fit_prony)
app.command()(run_command.run)
app.command()(status_command.status)
app.command()(status_command.verify)
app.command()(watch_command.watch)
app.command()(analysis_command.analyse)
app.command()(analysis_command.compare)
app.command()(report_command.report)
app.command()(fit_command.fit)
app.command()(study_command.study)
app.command()(study_command.converge)


@app.command()
def doctor() -> None:
    """Check MPI, FFTW, HDF5 and the rest, and say how to cure what fails."""
    from .host.doctor import examine

    fine = True
    for finding in examine():
        print(finding, flush=True)
        fine &= finding.fine
    if not fine:
        raise typer.Exit(1)


if __name__ == "__main__":
    main()
