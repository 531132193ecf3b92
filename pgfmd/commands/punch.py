"""`pgfmd show` and `pgfmd export`: the punch of a scene as a picture, as a solid and as a height map. Serial."""

from __future__ import annotations

import math
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from .names import named, path_option
from .quantities import length
from .run import Changes, Overrides, SceneName, all_changes


class Peaks(StrEnum):
    """The sense of the heights of a map."""

    down = "down"
    up = "up"


def show(
    scene: SceneName,
    changes: Changes = None,
    overrides: Overrides = None,
    out: Annotated[
        Path | None, path_option("--out", "-o", metavar="FILE", help="Name of the picture, .png, .pdf or .svg.")
    ] = None,
) -> None:
    """Draw the face of a scene's punch: a map, a profile through the first contact, the histogram of heights."""
    from pgfmd.plots.drawing import write_picture
    from pgfmd.plots.punch import plot_punch
    from pgfmd.scene import load_scene
    from pgfmd.scene_objects import confirm

    loaded = load_scene(scene, all_changes(changes, overrides))
    confirm(loaded, scene)
    out = out or Path(f"{Path(scene).stem}-punch.png")
    print(write_picture(plot_punch(loaded), out))


def export(
    scene: SceneName,
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            parser=named,
            help="punch.stl is a solid in mm; .npy, .npz, .xyz, .x3p and .nc are the heights of the face in m.",
        ),
    ],
    changes: Changes = None,
    overrides: Overrides = None,
    height: Annotated[
        str | None,
        typer.Option(
            "--height", metavar="LENGTH", help="Of the solid, from its back to its highest points, such as 2mm."
        ),
    ] = None,
    magnify: Annotated[
        float, typer.Option("--magnify", metavar="FACTOR", help="By how much the solid is larger than the punch.")
    ] = 1.0,
    peaks: Annotated[
        Peaks | None,
        typer.Option(
            "--peaks", help="Of a map: whether low (as in scenes) or high places touch first; up for .x3p, .nc."
        ),
    ] = None,
    cut: Annotated[bool, typer.Option("--cut", help="Leave out the heights of a map beyond the outline.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file of this name.")] = False,
) -> None:
    """Write the punch of a scene as a solid to be printed, or its face as a height map."""
    from pgfmd.punch.export import export_punch
    from pgfmd.scene import load_scene
    from pgfmd.scene_objects import confirm

    if not (math.isfinite(magnify) and magnify > 0.0):
        raise typer.BadParameter("expected a number above 0", param_hint="--magnify")
    loaded = load_scene(scene, all_changes(changes, overrides))
    confirm(loaded, scene)
    done = export_punch(
        loaded,
        file,
        height=length(height, "--height"),
        magnify=magnify,
        peaks=peaks.value if peaks else None,
        cut=cut,
        force=force,
    )
    print(f"{done.path} written: {done.text}")
    if done.reading:
        print("read it back by these keys of [punch]:", *done.reading, sep="\n  ")
