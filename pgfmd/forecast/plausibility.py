"""Numbers of a scene that make no sense together, as a wrong unit leaves them: 4 m for 4 um. No MPI.

Such a scene can be computed, and its result looks like any other. So what is far beyond the assumptions of the model,
linear elasticity with small slopes without inertia, is warned of, with the value in the unit that a person would use.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pgfmd.physics.adhesion.registry import clearance_of, range_by_rule
from pgfmd.physics.map_survey import relief_and_slope
from pgfmd.scene.model import SECTIONS, unused_keys
from pgfmd.scene_objects import topography_of, travel_time
from pgfmd.schemes import registry
from pgfmd.units import handy_quantity as shown

if TYPE_CHECKING:
    from pgfmd.scene import Scene
    from pgfmd.scene.model import Grid, Punch

STEEPEST = 1.0
"""Slope of a face, 45 degrees, beyond which nothing is left of small slopes."""
LARGE_SHARE = 0.2
"""Share of the punch's radius that lengths of the adhesion stay far below: the range, and gamma/E*."""
DENSITY = 1e3
"""Density [kg/m^3] of any elastomer, for its speed of sound."""
ATOM = 1e-10
"""Length [m] below which there is no continuum."""
SAMPLES = 2**14
"""At how many points a pattern is looked at."""
DIFFERENCE = 1e-3
"""Step of the differences that slopes are made of, in wavelengths or radii."""
WHOLE = 1e-6
"""Relative misfit of a map's size and the cell that rounding explains."""


@dataclass(frozen=True)
class Face:
    """The punch's lower face: relief [m], from its highest to its lowest point, and the steepest slope. size [m]: (x,
    y) of its map, if it has one."""

    relief: float
    slope: float
    size: tuple[float, float] | None = None


def warnings(scene: Scene) -> Iterator[str]:
    """What can't be meant in a scene whose files are there."""
    rules = (
        _face, _map_fits_the_cell, _range, _tightness, _speed, _pressure, _clearance, _spacing, _shares, _unread,
    )  # fmt: skip
    for rule in rules:
        yield from rule(scene)


def face_of(scene: Scene) -> Face:
    """Relief and slope of the scene's punch. Raises ValueError, OSError for a map that can't be used."""
    stamp = None
    if scene.punch.file is not None:
        found = os.stat(scene.punch.file)
        stamp = found.st_mtime_ns, found.st_size
    return _face_of(scene.punch, scene.grid, stamp)


@functools.lru_cache(maxsize=1)
def _face_of(punch: Punch, grid: Grid, stamp: tuple[int, int] | None) -> Face:
    """stamp: time and size of the file, which show that it was rewritten."""
    return _map_face(punch, grid) if punch.pattern == "file" else _pattern_face(punch, grid)


def _map_face(punch: Punch, grid: Grid) -> Face:
    face = topography_of(punch)
    return Face(*relief_and_slope(face, grid.length / grid.n), face.map.size)


def _pattern_face(punch: Punch, grid: Grid) -> Face:
    """From points that are spread over the outline without a period of their own (Roberts' R2 sequence), its centre and
    its rim."""
    reach = punch.radius if punch.radius is not None else 0.5 * grid.length
    share = np.array([[0.7548776662466927], [0.5698402909980532]]) * np.arange(1, SAMPLES + 1) % 1.0
    x, y = reach * (2.0 * share - 1.0)
    if punch.radius is not None:
        inside = np.hypot(x, y) <= reach
        x, y = x[inside], y[inside]
    x, y = np.append(x, [0.0, reach, -reach, 0.0, 0.0]), np.append(y, [0.0, 0.0, 0.0, reach, -reach])
    step = DIFFERENCE * min(reach, punch.wavelength or punch.shortest or math.inf)
    moved = np.stack([x, x + step, x - step, x, x]), np.stack([y, y, y, y + step, y - step])
    here, right, left, above, below = topography_of(punch).heights(*moved)
    slope = np.hypot(right - left, above - below).max() / (2.0 * step)
    return Face(float(np.ptp(here)), float(slope))


def _scale(scene: Scene) -> tuple[float, str]:
    """The length [m] that others are compared with, and what it is."""
    if scene.punch.radius is not None:
        return scene.punch.radius, "the punch's radius"
    return 0.5 * scene.grid.length, "half of the cell"


def _face(scene: Scene) -> Iterator[str]:
    punch, face, (scale, what) = scene.punch, face_of(scene), _scale(scene)
    relief = shown(face.relief, "length")
    keys = {"punch.file": punch.file, "punch.amplitude": punch.amplitude, "punch.layer_step": punch.layer_step}
    keys |= {"punch.rms_height": punch.rms_height, "punch.rms_slope": punch.rms_slope}
    where = next((key for key, value in keys.items() if value), "punch.curvature_radius")
    if face.slope > STEEPEST or face.relief > scale:
        unit = "look at the units of [punch]"
        if punch.pattern == "file":
            unit = f"a map's heights are read in {punch.file_unit or 'metres, unless file or scene say otherwise'}"
        yield (
            f"{where}: from its lowest to its highest point the face rises by {relief}, "
            f"{face.relief / scale:.2g} times {what}, and its steepest slope is {face.slope:.2g} (1 is 45 degrees); "
            f"linear elasticity of small slopes does not hold there: {unit}"
        )
    elif 0.0 < face.relief < ATOM:
        yield f"{where}: from its lowest to its highest point the face rises by {relief}, less than an atom: it is flat"


def _map_fits_the_cell(scene: Scene) -> Iterator[str]:
    """A map that fills the cell is repeated over the plane, the cell as well."""
    punch, length = scene.punch, scene.grid.length
    if punch.pattern != "file" or punch.radius is not None:
        return
    size = face_of(scene).size
    if size is None:
        return
    if any(abs(length / side - max(round(length / side), 1)) > WHOLE * length / side for side in size):
        sides = " x ".join(shown(side, "length") for side in size)
        yield (
            f"punch.file: the map, {sides}, does not fit into the cell, {shown(length, 'length')}, a whole number "
            "of times: the face has a step at the border of the cell; "
            "set grid.length to the map's size, or give punch.radius"
        )


def _range(scene: Scene) -> Iterator[str]:
    adhesion, (scale, what), thickness = scene.adhesion, _scale(scene), scene.substrate.thickness
    if thickness < scale:
        scale, what = thickness, "the film's thickness"
    if adhesion.range <= LARGE_SHARE * scale:
        return
    modulus = scene.substrate.contact_modulus
    own = range_by_rule(adhesion, modulus, adhesion.range_factor, adhesion.q_ref)
    cure = "look at its unit"
    if math.isclose(own, adhesion.range, rel_tol=1e-9):
        cure = (
            f"it follows from work_of_adhesion = {shown(adhesion.work_of_adhesion, 'energy per area')}, "
            f"E* = {shown(modulus, 'modulus')} and the grid: look at their units"
        )
    yield (
        f"adhesion.range is {shown(adhesion.range, 'length')}, {adhesion.range / scale:.2g} times {what}: the "
        f"whole contact lies within it; {cure}"
    )


def _tightness(scene: Scene) -> Iterator[str]:
    """gamma/E*, about how far adhesion pulls the surface out."""
    adhesion, (scale, what) = scene.adhesion, _scale(scene)
    modulus = scene.substrate.contact_modulus
    length = adhesion.work_of_adhesion / modulus
    if adhesion.attractive and length > LARGE_SHARE * scale:
        yield (
            f"adhesion.work_of_adhesion: gamma/E* = {shown(adhesion.work_of_adhesion, 'energy per area')} / "
            f"{shown(modulus, 'modulus')} = {shown(length, 'length')} is {length / scale:.2g} times "
            f"{what}: adhesion would draw the surface out as far; look at the units of both"
        )


def _speed(scene: Scene) -> Iterator[str]:
    """Speeds beyond that of sound: inertia would count. Where time does not count, speeds do not."""
    drive = scene.drive
    sound = math.sqrt(scene.substrate.contact_modulus / DENSITY)
    if registry.scheme_of(scene).timeless:
        return
    for key, speed in (("drive.speed", drive.speed), ("drive.retract_speed", drive.retract_speed)):
        if speed > sound and not (key == "drive.retract_speed" and speed == drive.speed):
            yield (
                f"{key} = {shown(speed, 'speed')} is beyond the speed of sound in the relaxed elastomer, about "
                f"{shown(sound, 'speed', 2)}: inertia, which is left out, would count; look at its unit"
            )


def _pressure(scene: Scene) -> Iterator[str]:
    """Preloads that press the elastomer together, wherever they are not warned of by their indentation."""
    punch, substrate, modulus = scene.punch, scene.substrate, scene.substrate.contact_modulus
    if punch.radius is not None and not math.isfinite(substrate.thickness) and not substrate.compliance_file:
        return
    area = math.pi * punch.radius**2 if punch.radius is not None else scene.grid.length**2
    pressure = scene.drive.preload / area
    if pressure > modulus:
        yield (
            f"drive.preload = {shown(scene.drive.preload, 'force')} is a mean pressure of "
            f"{shown(pressure, 'modulus')} under the punch, above E* = {shown(modulus, 'modulus')}: "
            "linear elasticity does not hold there; look at its unit"
        )


def _clearance(scene: Scene) -> Iterator[str]:
    clearance, (scale, what) = scene.drive.clearance, _scale(scene)
    if clearance > max(scale, clearance_of(scene.adhesion)):
        yield (
            f"drive.clearance: the punch starts {shown(clearance, 'length')} above the surface, "
            f"{clearance / scale:.2g} times {what}, and takes {shown(travel_time(scene, clearance, 0.0), 'time')} to come "
            "down; look at its unit"
        )


def _spacing(scene: Scene) -> Iterator[str]:
    spacing = scene.grid.length / scene.grid.n
    if spacing < ATOM:
        yield (
            f"grid.length: points of the grid are {shown(spacing, 'length')} apart, less than an atom, where no "
            "continuum is left; look at its unit"
        )


def _shares(scene: Scene) -> Iterator[str]:
    """Weights that may be shares of the instantaneous modulus, where the scene does not say of which they are."""
    rheology = scene.rheology
    total = sum(rheology.kappa or ())
    if rheology.model != "prony" or rheology.reference is not None or not 0.0 < total < 1.0:
        return
    yield (
        f"rheology.kappa has a sum of {total:.4g}, so that the elastomer is only {1.0 + total:.4g} times as stiff at once "
        "as when relaxed: if these are g_i of Abaqus or alpha_i of Ansys, shares of the instantaneous modulus, set "
        'rheology.reference = "instantaneous", with that modulus as substrate.youngs_modulus; else set it to "relaxed"'
    )


def _unread(scene: Scene) -> Iterator[str]:
    """Keys that ask for what the scheme does not do."""
    scheme = registry.scheme_of(scene)
    reasons = dict(scheme.unread)
    for section in registry.sections():
        for name in unused_keys(scene, section):
            reasons[f"{section}.{name}"] = f'only the scheme "{registry.reader_of(section)}" reads it'
    for dotted, why in sorted(reasons.items()):
        section, _, name = dotted.rpartition(".")
        if getattr(scene.section(section), name) != SECTIONS[section].model_fields[name].default:
            yield f'{dotted} has no effect with solver.scheme = "{scheme.name}", as {why}: leave it out'
