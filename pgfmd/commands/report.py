"""`pgfmd report`: one file about a run or a study. Serial."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .analysis import Baseline, Correct, MachineStiffness, Offset, PositiveDisplacement, Pressing
from .names import named, path_option
from .quantities import quantity

OF_MEASURED = (
    "machine_stiffness", "correct", "offset", "positive_displacement", "positive_force", "cycle", "baseline",
)  # fmt: skip
"""Options that are of no use without another curve."""


def report(
    context: typer.Context,
    source: Annotated[
        Path,
        typer.Argument(metavar="DIR|STUDY", parser=named, help="A folder that a run wrote to, or that of a study."),
    ],
    twin: Annotated[
        Path | None, path_option("--twin", metavar="DIR", help="Results of the quasi-static twin of the run.")
    ] = None,
    measured: Annotated[
        list[Path] | None, path_option("--measured", metavar="EXP.csv", help="A measured curve that is laid over.")
    ] = None,
    out: Annotated[
        Path | None, path_option("--out", "-o", metavar="FILE.html", help="The file; report.html in the folder.")
    ] = None,
    machine_stiffness: MachineStiffness = "inf",
    correct: Annotated[
        Correct, typer.Option("--correct", help="Which curves take up the compliance of the periodic cell.")
    ] = Correct.none,
    offset: Offset = "0 um",
    positive_displacement: PositiveDisplacement = None,
    positive_force: Annotated[
        Pressing, typer.Option("--positive-force", help="Which way measured forces count.")
    ] = Pressing.compression,
    cycle: Annotated[int | None, typer.Option("--cycle", min=1, help="Which of several measured cycles.")] = None,
    baseline: Baseline = "auto",
) -> None:
    """Write one HTML file about a run or a study: numbers, curves, maps, doubts, and everything to run it again.

    The options below --out are those of `pgfmd compare`, for --measured.
    """
    for name in OF_MEASURED:
        given = context.get_parameter_source(name)
        if given is not None and given.name == "COMMANDLINE" and not (measured or twin):
            raise typer.BadParameter("goes with --measured", param_hint=f"--{name.replace('_', '-')}")
    from pgfmd.reporting.report import report as report_of

    options = {
        "machine_stiffness": quantity(machine_stiffness, "stiffness", "--machine-stiffness", lambda value: value > 0),
        "correct": correct.value,
        "offset": "fit" if offset.strip() == "fit" else quantity(offset, "length", "--offset"),
        "positive_displacement": positive_displacement.value if positive_displacement else None,
        "positive_force": positive_force.value,
        "cycle": cycle,
        "baseline": None if baseline.strip() == "auto" else quantity(baseline, "force", "--baseline"),
    }
    print(report_of(source, twin, measured or (), out, **(options if measured or twin else {})))
