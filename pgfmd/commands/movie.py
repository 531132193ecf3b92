"""`pgfmd movie`: the snapshots of a run as a movie. Serial."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from pgfmd.host.streams import complain

from .names import Folder, path_option
from .quantities import quantity


class Field(StrEnum):
    """What a movie shows."""

    gap = "gap"
    traction = "traction"
    displacement = "displacement"
    contact = "contact"


class Even(StrEnum):
    """In what frames are evenly spaced."""

    time = "time"
    displacement = "displacement"


def movie(
    folder: Folder,
    field: Annotated[Field, typer.Option("--field", "-f", help="What the map shows.")] = Field.gap,
    out: Annotated[
        Path | None,
        path_option("--out", "-o", metavar="FILE", help="Name of the movie, .mp4 or .gif; movie-FIELD.mp4 in DIR."),
    ] = None,
    even: Annotated[
        Even, typer.Option("--even", help="What advances by the same amount from frame to frame.")
    ] = Even.time,
    frames: Annotated[int, typer.Option("--frames", "-n", min=1, help="How many frames there are.")] = 100,
    rate: Annotated[float, typer.Option("--rate", min=1.0, max=100.0, help="Frames a second.")] = 20.0,
    limit: Annotated[
        str | None,
        typer.Option("--limit", metavar="LENGTH|STRESS", help="End of the scale of colours; one for all snapshots."),
    ] = None,
) -> None:
    """Make a movie of the snapshots of a run: a map, and a marker that runs along the force curve.

    MP4 by ffmpeg where it is there, else an animated GIF.
    """
    from pgfmd.plots.field_colours import COLOURINGS
    from pgfmd.plots.movie import movie as made_of
    from pgfmd.plots.video_files import FORMATS

    if out is not None and out.suffix.lower() not in FORMATS:
        raise typer.BadParameter(f"{out}: expected a name that ends in {' or '.join(FORMATS)}", param_hint="--out")
    dimension, end = COLOURINGS[field.value][1], None
    if limit is not None:
        if not dimension:
            raise typer.BadParameter(f"{field.value} has no scale of colours", param_hint="--limit")
        end = quantity(limit, dimension, "--limit", lambda value: 0 < value < math.inf)
    made = made_of(folder, out, field.value, even.value, frames, rate, end)
    for remark in made.remarks:
        complain(f"note: {remark}")
    print(made.path)
