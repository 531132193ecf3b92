"""Writing the punch of a scene to a file: as a solid for a printer, or its face as a height map. No MPI."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.files.regular_files import write_new
from pgfmd.files.surface_files import MAP_FORMATS, HeightMapFile, stl_bytes
from pgfmd.scene import Scene
from pgfmd.scene_objects import topography_of
from pgfmd.units import handy_quantity

from .face import face_on_grid
from .solid import ExportError, solid_of

SOLID = ".stl"
SUFFIXES = (SOLID, *MAP_FORMATS)
OF_INSTRUMENTS = (".x3p", ".nc")
"""Formats of maps whose readers take high places for peaks, as instruments have them."""


@dataclass(frozen=True)
class Exported:
    """path: the file written. text: what it holds, in a sentence. reading: keys of [punch] that read it back, as lines of TOML;
    empty for a solid."""

    path: Path
    text: str
    reading: tuple[str, ...] = ()


def export_punch(
    scene: Scene | str | Path | Mapping[str, Any],
    path: str | Path,
    *,
    height: float | None = None,
    magnify: float = 1.0,
    peaks: str | None = None,
    cut: bool = False,
    force: bool = False,
) -> Exported:
    """Writes the punch of a scene; the ending of the name says how.

    Args:
        scene: a Scene, or what one is made from.
        path: .stl for a closed surface of triangles in mm, face up; .npy, .npz, .xyz, .x3p or .nc for the heights of the face at
            the points of the grid [m], with one more around the outline.
        height: [m] of the solid, from its back to its highest points; half of its width unless it is given.
        magnify: by how much the solid is larger than the punch.
        peaks: of a map: "down" as in scenes, where lower heights touch first, or "up" as instruments have it; unless it is given
            "up" for .x3p and .nc, "down" for the others.
        cut: leave out the heights of a map beyond the outline, where the face goes on as its formula does, but for one more point
            around it, without which the map could not be read back.
        force: overwrite a file of this name.

    Raises:
        SceneError: if the scene can't be. ExportError: for another ending, an option that the format has no use for, a solid that
        can't be. ResultError: if the file can't be written.
    """
    path, scene = Path(path), scene if isinstance(scene, Scene) else Scene(scene)
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise ExportError(f"{path}: expected a name that ends in {', '.join(SUFFIXES)}, which says the format")
    if peaks not in (None, "down", "up"):
        raise ExportError(f"peaks = {peaks!r}: expected 'down' or 'up'")
    if not (math.isfinite(magnify) and magnify > 0.0):
        raise ExportError(f"magnify = {magnify!r}: expected a positive number")
    if suffix == SOLID and (peaks is not None or cut):
        raise ExportError(f"{path}: peaks and cut are for maps of heights; a solid has its face up, within the outline")
    if suffix != SOLID and (height is not None or magnify != 1.0):
        raise ExportError(f"{path}: height and magnify are for a solid (.stl); a map has the heights of the scene")
    if scene.punch.file and path.exists() and path.samefile(scene.punch.file):
        raise ExportError(f"{path}: is the map that the scene's face is read from; choose another name")
    if suffix == SOLID:
        content, done = _solid(scene, path, height, magnify)
    else:
        content, done = _map(scene, path, peaks or ("up" if suffix in OF_INSTRUMENTS else "down"), cut)
    try:
        write_new(path, content, force)
    except FileExistsError:
        raise ResultError(f"{path}: exists already; move it away, or overwrite it with --force") from None
    except OSError as error:
        raise ResultError(f"{path}: could not be written: {error.strerror}") from None
    return done


def _solid(scene: Scene, path: Path, height: float | None, magnify: float) -> tuple[bytes, Exported]:
    solid = solid_of(scene, height, magnify)
    sides = " x ".join(f"{1e3 * side:.4g}" for side in solid.size)
    larger = f", {magnify:g} times the punch" if magnify != 1.0 else ""
    text = f"{len(solid.triangles)} triangles, {sides} mm{larger}, on its back, face up"
    if scene.punch.pattern == "file" and topography_of(scene.punch).map.facts.peaks.word == "up":
        # x and y of a scene are those of the map, but what is turned face down has one of them mirrored.
        text += (
            "; the mirror image of what the map was measured on, as its peaks are up: turn its rows over to print that"
        )
    return stl_bytes(solid.corners(), scene.title or f"{scene.punch.pattern} punch"), Exported(path, text)


def _map(scene: Scene, path: Path, peaks: str, cut: bool) -> tuple[bytes, Exported]:
    face = face_on_grid(scene, margin=1)
    z = face.cut_around() if cut else face.z
    title = f"{scene.title or scene.punch.pattern}: heights of the lower face of a punch, m, peaks {peaks}"
    periodic = face.radius is None
    pixel = face.spacing
    first = float(face.x[0]), float(face.y[0])
    surface = HeightMapFile(z if peaks == "down" else 0.0 - z, (pixel, pixel), first, title, periodic, peaks)
    size_x, size_y = surface.size
    suffix = path.suffix.lower()
    lines = ['pattern = "file"', f'file = "{path.name}"']
    if suffix == ".npy":
        lines += [f'file_size = ["{size_x!r} m", "{size_y!r} m"]', 'file_unit = "m"']
    # An instrument's file says nothing, and its peaks are taken to be up.
    if suffix in (".npy", ".xyz") or (suffix == ".x3p" and peaks != "up"):
        lines.append(f'file_peaks = "{peaks}"')
    lines += [f'radius = "{face.radius!r} m"'] if face.radius is not None else []
    span = handy_quantity(float(np.ptp(z[face.inside])), "length")
    text = (
        f"{z.shape[1]} x {z.shape[0]} heights over {handy_quantity(size_x, 'length', 4)}, range {span}, peaks {peaks}"
    )
    return MAP_FORMATS[path.suffix.lower()](surface), Exported(path, text, tuple(lines))
