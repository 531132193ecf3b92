"""`pgfmd fit`: the options of the command. Serial: it starts runs that are not."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from pgfmd.host.streams import say

from .analysis import Baseline, Correct, LowPass, MachineStiffness, Offset, PositiveDisplacement, Pressing
from .names import named, path_option
from .printing import command
from .quantities import length, quantity
from .run import Changes, Overrides, SceneName, all_changes

Experiment = Annotated[
    Path, typer.Argument(metavar="EXP.csv", parser=named, help="A measured curve, as `pgfmd compare` reads it.")
]
Free = Annotated[
    str, typer.Option("--free", metavar="KEY[,KEY...]", help="Keys of the scene whose numbers are fitted.")
]
Bounds = Annotated[
    list[str] | None,
    typer.Option(
        "--bounds",
        metavar="KEY=LOW:HIGH",
        help="Where a number may lie, such as adhesion.range=0.1um:1um; else 1/100 to 100 times its start.",
    ),
]
Coarsest = Annotated[
    int | None,
    typer.Option("--from", metavar="N", min=4, help="grid.n of the coarsest level; the scene's own for one level."),
]
MostRuns = Annotated[int, typer.Option("--most-runs", min=1, help="Runs, after which it gives up.")]
Corrected = Annotated[
    Correct, typer.Option("--correct", help="Which curves take up the compliance of the periodic cell.")
]
PositiveForce = Annotated[Pressing, typer.Option("--positive-force", help="Sense of the experiment's force.")]
Cycle = Annotated[int | None, typer.Option("--cycle", min=1, help="Which of several measured cycles.")]
Out = Annotated[Path | None, path_option("--out", "-o", metavar="DIR", help="Folder of the runs and of what is found.")]
Ranks = Annotated[int, typer.Option("--ranks", "-n", min=1, help="Ranks of each run.")]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=1, help="Runs side by side, at most twice the number of keys.")]
Every = Annotated[str, typer.Option("--checkpoint-every", metavar="TIME", help="Time between checkpoints, or `off`.")]


def fit(
    scene: SceneName,
    experiment: Experiment,
    changes: Changes = None,
    overrides: Overrides = None,
    free: Free = "",
    bounds: Bounds = None,
    coarsest: Coarsest = None,
    most_runs: MostRuns = 200,
    machine_stiffness: MachineStiffness = "inf",
    correct: Corrected = Correct.none,
    low_pass: LowPass = None,
    offset: Offset = "0 um",
    positive_displacement: PositiveDisplacement = None,
    positive_force: PositiveForce = Pressing.compression,
    cycle: Cycle = None,
    baseline: Baseline = "auto",
    out: Out = None,
    ranks: Ranks = 1,
    jobs: Jobs = 1,
    checkpoint_every: Every = "10min",
) -> None:
    """Fit numbers of a scene to a measured curve, by least squares over runs; goes on where it was stopped."""
    from pgfmd.analysis.experiment import read_experiment
    from pgfmd.analysis.table import show
    from pgfmd.fitting.fit import fit as fitted
    from pgfmd.fitting.fit import levels_of
    from pgfmd.fitting.misfit import Corrections, Misfit
    from pgfmd.fitting.parameters import parameters_of
    from pgfmd.fitting.runs import NotConverged, Runs
    from pgfmd.scene import load_scene
    from pgfmd.studies.study import launch_alone

    launch_alone()
    given = all_changes(changes, overrides)
    loaded, levels = load_scene(scene, given), levels_of(scene, given, coarsest)
    keys = [key.strip() for key in free.split(",") if key.strip()]
    parameters = parameters_of(loaded, keys, _by_key(bounds or []))
    measured = read_experiment(
        experiment,
        positive_displacement.value if positive_displacement else None,
        positive_force.value,
        cycle,
        None if baseline.strip() == "auto" else quantity(baseline, "force", "--baseline"),
    )
    moved = None if offset.strip() == "fit" else quantity(offset, "length", "--offset")
    k_machine = quantity(machine_stiffness, "stiffness", "--machine-stiffness", lambda value: value > 0)
    corrections = Corrections(correct.value, k_machine, length(low_pass, "--low-pass"), moved)
    misfit = Misfit(measured, corrections)
    out = out or Path("out", f"fit-{Path(scene).stem}-{experiment.stem}")
    runs = Runs(scene, tuple(given), parameters, misfit, out, ranks, jobs, checkpoint_every, most_runs, say)
    found = fitted(runs, levels, say)
    paths = found.write()
    show(found.table())
    say("the fitted scene: " + command("pgfmd", "run", paths[2]))
    say(" ".join(map(str, paths)))
    if not found.converged:
        raise NotConverged(f"the fit did not come to its end ({found.why}): start again from {paths[2]}")


def _by_key(bounds: list[str]) -> dict[str, str]:
    """LOW:HIGH of each key, of texts KEY=LOW:HIGH."""
    from pgfmd.fitting.parameters import FitError

    found = {}
    for text in bounds:
        key, equals, values = text.partition("=")
        if not equals:
            raise FitError(f"--bounds {text}: expected KEY=LOW:HIGH")
        found[key.strip()] = values.strip()
    return found
