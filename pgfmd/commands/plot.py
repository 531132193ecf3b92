"""`pgfmd plot` and `pgfmd plot-rheology`: pictures of runs, of several together, of studies, and of an elastomer. Serial."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from pgfmd.errors import Problem, SceneError

from .names import named, path_option
from .quantities import gap, quantity
from .run import Changes, Overrides, SceneName, all_changes


class Form(StrEnum):
    """Formats of pictures."""

    png = "png"
    pdf = "pdf"
    svg = "svg"


class Width(StrEnum):
    """Widths of pictures."""

    single = "single"
    double = "double"


class Log(StrEnum):
    """Axes with a logarithmic scale."""

    x = "x"
    y = "y"
    xy = "xy"


WIDTH_HELP = "For a column (89 mm) or a page (183 mm) of a journal; each picture's own without it."


def plot(
    sources: Annotated[
        list[Path],
        typer.Argument(
            metavar="DIR|STUDY...", parser=named, help="Folders that runs wrote to, or the folder of a study."
        ),
    ],
    out: Annotated[Path | None, path_option("--out", "-o", metavar="DIR", help="Folder of the pictures.")] = None,
    x: Annotated[str, typer.Option("--x", metavar="NAME", help="Across: a column, or a key such as speed.")] = "",
    y: Annotated[str, typer.Option("--y", metavar="NAME", help="Upward: a column, or a number such as pull-off.")] = "",
    log: Annotated[Log | None, typer.Option("--log", help="Axes with a logarithmic scale.")] = None,
    form: Annotated[Form, typer.Option("--format", help="Of the files.")] = Form.png,
    width: Annotated[Width | None, typer.Option("--width", help=WIDTH_HELP)] = None,
    greys: Annotated[
        int, typer.Option("--greys", min=3, max=4, help="Of the maps of contact: 3 are the paper's, without overlap.")
    ] = 4,
    contact_gap: Annotated[
        str | None, typer.Option("--contact-gap", metavar="GAP", help="Maps show contact below it; the run's own.")
    ] = None,
    near_gap: Annotated[
        str | None,
        typer.Option(
            "--near-gap", "--gap", metavar="GAP|range", help="Maps show what is near below it; the run's own."
        ),
    ] = None,
    stress_limit: Annotated[
        str | None, typer.Option("--stress-limit", metavar="STRESS", help="End of the scale of maps of stress.")
    ] = None,
) -> None:
    """Draw curves, maps and energies of a run; or several runs in one picture.

    Of one folder: every picture that it has data for. Of several, or with --x or --y: these in one picture.
    """
    from pgfmd.plots.folder import plot_against, plot_results
    from pgfmd.plots.maps import RANGE
    from pgfmd.results.reading import runs_in

    near = RANGE if near_gap == RANGE else gap(near_gap, "--near-gap")
    contact, wide = gap(contact_gap, "--contact-gap"), width.value if width else None
    limit = None
    if stress_limit is not None:
        limit = quantity(stress_limit, "modulus", "--stress-limit", lambda value: 0 < value < math.inf)
    alone = len(sources) == 1 and not (x or y) and runs_in(sources[0]) == [sources[0]]
    if alone:
        paths = plot_results(sources[0], out, greys, contact, near, form.value, wide, limit)
    else:
        folder = out or (sources[0] if len(sources) == 1 else Path("."))
        try:
            paths = plot_against(sources, folder, x, y, log.value if log else "", form.value, wide)
        except ValueError as error:
            raise typer.BadParameter(str(error), param_hint="--x, --y") from None
    for path in paths:
        print(path)


def plot_rheology(
    scene: SceneName,
    changes: Changes = None,
    overrides: Overrides = None,
    out: Annotated[Path | None, path_option("--out", "-o", metavar="FILE.png", help="Name of the picture.")] = None,
    width: Annotated[Width | None, typer.Option("--width", help=WIDTH_HELP)] = None,
) -> None:
    """Draw modulus and creep of a scene's elastomer, and what the paper's auxiliary masses make of them."""
    from pgfmd.plots.drawing import drawing, write_picture
    from pgfmd.plots.rheology import plot_rheology as drawn
    from pgfmd.scene import load_scene

    loaded = load_scene(scene, all_changes(changes, overrides))
    out = out or Path(f"{Path(scene).stem}-rheology.png")
    with drawing(width.value if width else None):
        try:
            figure = drawn(loaded)
        except ValueError:
            cure = "give it a relaxation, such as rheology.model=single"
            problem = Problem("rheology.model", loaded.rheology.model, "a modulus that relaxes", cure)
            raise SceneError(scene, [problem]) from None
        print(write_picture(figure, out))
