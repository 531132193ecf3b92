"""`pgfmd fit-prony`: the options of the command, and where its output goes."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from pgfmd.errors import ResultError
from pgfmd.files.regular_files import write_new

from .names import named, path_option

CELSIUS_OR_KELVIN = "Temperature of the tack test, such as 25C; needed where the file has several."


def fit_prony(
    file: Annotated[
        Path,
        typer.Argument(metavar="DMA.csv", parser=named, help="Columns frequency, E', E'', and temperature if any."),
    ],
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
    out: Annotated[Path | None, path_option("--out", "-o", metavar="FILE.toml", help="Write the table there.")] = None,
    plot: Annotated[Path | None, path_option("--plot", "-p", metavar="FILE.png", help="Draw data and fit.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Overwrite the table's file.")] = False,
) -> None:
    """Fit a Prony series to a DMA measurement; prints the rheology table of a scene."""
    from pgfmd.characterisation.dma import temperature_in_kelvin
    from pgfmd.characterisation.rheology_table import fit_prony as fitted
    from pgfmd.characterisation.rheology_table import wlf_constants

    temperature = _read(temperature_in_kelvin, reference, "--reference-temperature")
    material = fitted(file, elements, temperature, _read(wlf_constants, wlf, "--wlf"), vertical)
    if out is None:
        print(material.table(), end="")
    else:
        _write(out, material.table(), force)
        for line in [*material.report(), f"{out} written"]:
            print(line)
    if plot is not None:
        from pgfmd.plots.drawing import drawing, write_picture
        from pgfmd.plots.rheology import plot_fit

        with drawing():
            write_picture(plot_fit(material), plot)
    sys.stdout.flush()
    for text in material.warnings():
        print(f"warning: {text}", file=sys.stderr)


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
