"""`pgfmd analyse` and `pgfmd compare`: what result files say, and measured curves over them. Serial."""

from __future__ import annotations

from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from .names import Folder, named, path_option
from .printing import print_json
from .quantities import length, quantity


class Correct(StrEnum):
    """Which curves take up the compliance of the periodic cell."""

    experiment = "experiment"
    simulation = "simulation"
    none = "none"


class Inwards(StrEnum):
    """The sense of a measured displacement."""

    into = "in"
    out = "out"


class Pressing(StrEnum):
    """The sense of a measured force."""

    compression = "compression"
    tension = "tension"


AUTO = "auto"
"""The twin that is run for the purpose."""
LowPass = Annotated[
    str | None, typer.Option("--low-pass", metavar="LENGTH", help="Filter curves, such as 0.1um, the paper's.")
]


def analyse(
    directory: Folder,
    twin: Annotated[
        Path | None,
        path_option(
            "--twin", metavar="DIR|auto", help="Results of the quasi-static twin of the run; auto runs it beside DIR."
        ),
    ] = None,
    bearing_area: Annotated[bool, typer.Option("--bearing-area", help="Compare with a bearing-area model.")] = False,
    asperity: Annotated[
        Path | None,
        path_option("--asperity", metavar="DIR", help="Results of one isolated asperity, for that model."),
    ] = None,
    low_pass: LowPass = None,
    cycle: Annotated[
        int | None, typer.Option("--cycle", min=1, help="Measure this cycle of a programme alone.")
    ] = None,
    out: Annotated[
        Path | None,
        path_option("--out", "-o", metavar="DIR", help="Folder of what is written, if not DIR itself."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> None:
    """Measure a run: forces, works, stiffness, shares of the hysteresis. Writes analysis.json and pictures into DIR."""
    from pgfmd.analysis.summary import analyse as analysis_of
    from pgfmd.analysis.table import show

    if twin is not None and str(twin) == AUTO:
        from pgfmd.analysis.quasistatic_twin import run_twin

        # Standard output may be JSON.
        twin = run_twin(directory, out, partial(typer.echo, err=True))
    analysis = analysis_of(directory, twin, bearing_area, asperity, length(low_pass, "--low-pass"), cycle)
    paths = analysis.write(out)
    if as_json:
        print_json(analysis.record)
        return
    show(analysis.table)
    for path in paths:
        print(path)


Sources = Annotated[
    list[Path],
    typer.Argument(metavar="DIR [DIR...] [EXP.csv...]", parser=named, help="Folders of results, and measured curves."),
]
MachineStiffness = Annotated[
    str,
    typer.Option("--machine-stiffness", metavar="STIFFNESS", help="Takes F/k_M off measured curves; such as 38.1kN/m."),
]
Offset = Annotated[str, typer.Option("--offset", metavar="LENGTH|fit", help="By which measured curves are pushed in.")]
PositiveDisplacement = Annotated[
    Inwards | None,
    typer.Option(
        "--positive-displacement",
        help="Sense of measured displacements, if not that of their name: a gap or an extension outwards, others "
        "inwards.",
    ),
]
Baseline = Annotated[
    str,
    typer.Option(
        "--baseline", metavar="auto|FORCE", help="Measured force far away, taken off; as the rows show it, with auto."
    ),
]


def compare(
    sources: Sources,
    machine_stiffness: MachineStiffness = "inf",
    correct: Annotated[
        Correct, typer.Option("--correct", help="Which curves take up the compliance of the periodic cell.")
    ] = Correct.none,
    low_pass: LowPass = None,
    offset: Offset = "0 um",
    positive_displacement: PositiveDisplacement = None,
    positive_force: Annotated[
        Pressing, typer.Option("--positive-force", help="Sense of measured forces.")
    ] = Pressing.compression,
    cycle: Annotated[
        int | None,
        typer.Option("--cycle", min=1, help="Which cycle, of measured curves and of programmes with repeats."),
    ] = None,
    baseline: Baseline = "auto",
    out: Annotated[Path, path_option("--out", "-o", metavar="FILE.png", help="Name of the picture.")] = Path(
        "comparison.png"
    ),
) -> None:
    """Lay curves of runs, and measured ones, over each other: a table and a picture.

    Curves are compared as they are, unless a correction is asked for; a measured force that is not zero far away is made so.
    """
    from pgfmd.analysis.comparison import compare as comparison_of
    from pgfmd.analysis.pictures import plot_comparison
    from pgfmd.analysis.table import show
    from pgfmd.plots.drawing import drawing, write_picture

    found = comparison_of(
        *sources,
        machine_stiffness=quantity(machine_stiffness, "stiffness", "--machine-stiffness", lambda value: value > 0),
        correct=correct.value,
        low_pass=length(low_pass, "--low-pass"),
        offset="fit" if offset.strip() == "fit" else quantity(offset, "length", "--offset"),
        positive_displacement=positive_displacement.value if positive_displacement else None,
        positive_force=positive_force.value,
        cycle=cycle,
        baseline=None if baseline.strip() == "auto" else quantity(baseline, "force", "--baseline"),
    )
    with drawing():
        path = write_picture(plot_comparison(found), out)
    show(found.table)
    print(path)
