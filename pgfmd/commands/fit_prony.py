"""`pgfmd fit-prony`: the options of the command, and where its output goes."""

from __future__ import annotations

import sys
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from pgfmd.errors import ResultError
from pgfmd.files.regular_files import write_new

from .names import named, path_option

CELSIUS_OR_KELVIN = "Temperature of the tack test, such as 25C; needed where the file has several."


class Modulus(StrEnum):
    """What measured moduli are, where their names don't say."""

    tensile = "tensile"
    shear = "shear"


MeasuredModuli = Annotated[
    Path,
    typer.Argument(
        metavar="MODULI.csv",
        parser=named,
        help="Columns frequency, E', E'' (or G', G''), and temperature if any; or time and E.",
    ),
]
PoissonRatio = Annotated[
    float | None,
    typer.Option(
        "--poisson",
        min=-0.99,
        max=0.5,
        metavar="NU",
        help="Poisson's ratio that makes E of shear moduli; that of --into's scene, or 0.5, without it.",
    ),
]
Into = Annotated[
    Path | None, path_option("--into", "-i", metavar="SCENE.toml", help="Write modulus and series into this scene.")
]


def fit_prony(
    file: MeasuredModuli,
    elements: Annotated[
        int | None,
        typer.Option("--elements", "-n", min=1, max=40, help="Maxwell elements; as few as serve without it."),
    ] = None,
    reference: Annotated[
        str | None, typer.Option("--reference-temperature", "-t", metavar="T", help=CELSIUS_OR_KELVIN)
    ] = None,
    wlf: Annotated[
        str | None, typer.Option("--wlf", metavar="C1,C2", help="WLF constants, C2 in K; fitted without it.")
    ] = None,
    vertical: Annotated[bool, typer.Option("--vertical-shift", help="Divide moduli by T/T_ref, too.")] = False,
    modulus: Annotated[
        Modulus | None, typer.Option("--modulus", help="What the moduli are, where their names don't say: E or G.")
    ] = None,
    poisson: PoissonRatio = None,
    into: Into = None,
    out: Annotated[Path | None, path_option("--out", "-o", metavar="FILE.toml", help="Write the table there.")] = None,
    plot: Annotated[Path | None, path_option("--plot", "-p", metavar="FILE.png", help="Draw data and fit.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the table's file.")] = False,
) -> None:
    """Fit a Prony series to measured moduli, or to a relaxation; prints the rheology table of a scene."""
    from pgfmd.characterisation.dma import temperature_in_kelvin
    from pgfmd.characterisation.rheology_table import characterise, wlf_constants

    temperature = _read(temperature_in_kelvin, reference, "--reference-temperature")
    constants = _read(wlf_constants, wlf, "--wlf")
    own = None if into is None else _poisson_ratio_of(into)
    material = characterise(
        file, elements, temperature, constants, vertical, modulus.value if modulus else None, poisson,
        0.5 if own is None else own,
    )  # fmt: skip
    if into is not None:
        from pgfmd.characterisation.into_scene import write_into

        write_into(into, material)
        _say([*material.report(), f"{into}: substrate.youngs_modulus and [rheology] written"])
    if out is not None:
        _write(out, material.table(), force)
        _say([*([] if into else material.report()), f"{out} written"])
    elif into is None:
        print(material.table(), end="")
    if plot is not None:
        from pgfmd.plots.drawing import drawing, write_picture
        from pgfmd.plots.rheology import plot_fit

        with drawing():
            write_picture(plot_fit(material), plot)
    sys.stdout.flush()
    for text in material.warnings():
        print(f"warning: {text}", file=sys.stderr)


def _poisson_ratio_of(scene: Path) -> float | None:
    from pgfmd.characterisation.into_scene import poisson_ratio_of

    return poisson_ratio_of(scene)


def _say(lines: list[str]) -> None:
    for line in lines:
        print(line)


def _read(parser: Callable[[str], Any], text: str | None, option: str) -> Any:
    """The value of an option; a usage error in the parser's words."""
    try:
        return None if text is None else parser(text)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint=option) from None


def _write(path: Path, text: str, force: bool) -> None:
    try:
        write_new(path, text, force)
    except FileExistsError:
        raise ResultError(f"{path}: exists already; move it away, or overwrite it with --force") from None
    except OSError as error:
        raise ResultError(f"{path}: could not be written: {error.strerror}") from None
