"""Description of a height map, and warnings about it before a run. No MPI."""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

from pgfmd.maps.preparing import MapFacts
from pgfmd.maps.raw import unit_of
from pgfmd.physics.map_survey import Place, Survey, survey
from pgfmd.physics.topography import Topography
from pgfmd.scene_objects import topography_of
from pgfmd.units import handy_quantity as shown

if TYPE_CHECKING:
    from pgfmd.scene import Scene
    from pgfmd.scene.model import Punch

ATOM = 1e-10
"""Rise [m] of a tilt that is negligible."""
SQUARE = 0.01
"""Relative difference of the sides of a pixel that is negligible."""
SAME_SIZE = 0.005
"""Relative difference of two sizes of a map that is negligible."""
SAME_UNIT = 1e-6
"""Relative difference of two units that is negligible."""
LIFTED = 0.25
"""Lift of a place by the tilt, in ranges of adhesion, from which on the tilt decides where contact begins."""
BENT, TERRACE = 0.05, 0.1
"""Largest bending of heights within a pixel, and largest step between levels, in ranges of adhesion, without a warning."""
MANY_FILLED = 0.05
"""Share of the pixels under the punch that may be filled without a warning."""
WHO = {"key": "by the scene", "file": "by the file", "": "by default"}

Fact = tuple[str, float | int | str, str, str]
"""A line of a report: name, value, SI unit, and note."""


def seen(scene: Scene) -> tuple[Topography, Survey]:
    """The face of a scene with the pattern "file", and what it is like. Raises ValueError, OSError."""
    assert scene.punch.file is not None, 'the pattern is "file"'
    found = os.stat(scene.punch.file)
    return _seen(
        scene.punch, scene.grid.length / scene.grid.n, scene.adhesion.range, (found.st_mtime_ns, found.st_size)
    )


@functools.lru_cache(maxsize=1)
def _seen(punch: Punch, spacing: float, reach: float, stamp: tuple[int, int]) -> tuple[Topography, Survey]:
    """stamp: time and size of the file, which show that it was rewritten."""
    face = topography_of(punch)
    return face, survey(face, spacing, reach)


def facts_of(scene: Scene) -> Iterator[Fact]:
    """Lines about the map of a scene, none for another punch. Height range and slope are printed for any face."""
    if scene.punch.pattern != "file":
        return
    face, found = seen(scene)
    facts, (rows, columns) = face.map.facts, face.map.heights.shape
    yield (
        "height map",
        f"{columns} x {rows}",
        "",
        f"pixels of {_sides(face.map.pixel)}, {_sides(facts.size)} in all; read as {facts.kind}",
    )
    yield "heights are in", facts.unit.word, "", WHO[facts.unit.by]
    yield "peaks", facts.peaks.word, "", f"{_which_touches(facts.peaks.word)}, {WHO[facts.peaks.by]}"
    if facts.missing:
        yield (
            "missing pixels",
            facts.missing,
            "",
            f"of {facts.under} under the punch, filled from those around{_codes(facts)}",
        )
    yield "rms height", found.rms, "m", "under the punch, about the mean"
    yield "tilt", float(f"{math.hypot(*facts.tilt):.3g}"), "", _tilt(scene, facts)
    yield (
        "first contact",
        "at the rim" if found.first.at_rim else "inside",
        "",
        f"at {_where(found.first)} from the axis",
    )
    if found.others:
        yield "next places", len(found.others), "", "; ".join(map(_next, found.others))


def head(scene: Scene) -> list[str]:
    """The same as lines for the head of a run."""
    if scene.punch.pattern != "file":
        return []
    face, found = seen(scene)
    facts, lines = face.map.facts, {name: (value, note) for name, value, _, note in facts_of(scene)}
    start = (
        f"map: {lines['height map'][0]} {lines['height map'][1]}; heights in {facts.unit.word} {WHO[facts.unit.by]}, "
        f"peaks {facts.peaks.word} {WHO[facts.peaks.by]}"
    )
    middle = (
        f"map: under the punch range {shown(found.relief, 'length')}, rms {shown(found.rms, 'length')}, steepest slope "
        f"{found.slope:.2g}, tilt {lines['tilt'][1]}"
    )
    end = f"map: first contact {lines['first contact'][0]} {lines['first contact'][1]}"
    if found.others:
        end += f"; next places {lines['next places'][1]}"
    if facts.missing:
        middle += f"; {facts.missing} missing pixels {lines['missing pixels'][1]}"
    return [start, middle, end]


def _sides(lengths: tuple[float, float]) -> str:
    return " x ".join(shown(side, "length") for side in lengths)


def _which_touches(peaks: str) -> str:
    return "the largest heights touch first" if peaks == "up" else "the lowest heights touch first"


def _codes(facts: MapFacts) -> str:
    numbers = ", ".join(f"{code.number:.9g}" for code in facts.codes)
    return f"; {numbers} taken for missing" if numbers else ""


def _tilt(scene: Scene, facts: MapFacts) -> str:
    degrees = math.degrees(math.atan(math.hypot(*facts.tilt)))
    rise = math.hypot(*facts.tilt) * (2.0 * scene.punch.radius if scene.punch.radius else min(facts.size))
    if rise < ATOM:
        return "none to speak of"
    text = f"{degrees:.2g} degrees, {shown(rise, 'length')} from side to side"
    kept = {"none": "", "tilt": "; taken off", "curvature": "; taken off, with the curvature"}
    return text + kept[scene.punch.file_detrend]


def _where(place: Place) -> str:
    return f"x = {shown(place.x, 'length')}, y = {shown(place.y, 'length')}"


def _next(place: Place) -> str:
    rim = ", at the rim" if place.at_rim else ""
    return f"{shown(place.height, 'length')} higher, {shown(place.distance, 'length')} away{rim}"


def warnings(scene: Scene) -> Iterator[str]:
    """What may not be meant in the map of a scene."""
    if scene.punch.pattern != "file":
        return
    face, found = seen(scene)
    yield from _contradictions(scene, face.map.facts)
    yield from _pixels(scene, face, found)
    yield from _first_contact(scene, found)
    yield from _numbers(face.map.facts, found)


def _contradictions(scene: Scene, facts: MapFacts) -> Iterator[str]:
    """Keys that say another thing than the file."""
    if facts.file_size is not None and any(
        abs(own - used) > SAME_SIZE * used for own, used in zip(facts.file_size, facts.size, strict=True)
    ):
        text = f"punch.file_size is {_sides(facts.size)}, but by the file the map is {_sides(facts.file_size)}"
        rows, columns = facts.shape
        inner = facts.file_size[0] * (1.0 - 1.0 / columns), facts.file_size[1] * (1.0 - 1.0 / rows)
        if all(abs(own - used) < SAME_SIZE * used for own, used in zip(inner, facts.size, strict=True)):
            text += ": a size reaches half a pixel beyond the first and the last one"
        yield f"{text}; leave the key out to use that of the file"
    own = facts.file_unit
    if own and facts.unit.by == "key" and abs(unit_of(facts.unit.word).metres / own.metres - 1.0) > SAME_UNIT:
        yield (
            f'punch.file_unit is "{facts.unit.word}", but by the file heights are in {own.name}; leave the key out to use that of '
            "the file"
        )
    if facts.file_peaks and facts.file_peaks != facts.peaks.word:
        yield (
            f'punch.file_peaks is "{facts.peaks.word}", but by the file they are {facts.file_peaks}, so that '
            f"{_which_touches(facts.file_peaks)}; leave the key out to use that of the file"
        )
    for note in facts.notes:
        yield f"punch.file: {note}"


def _pixels(scene: Scene, face: Topography, found: Survey) -> Iterator[str]:
    spacing, reach, pixel = scene.grid.length / scene.grid.n, scene.adhesion.range, face.map.pixel
    if abs(pixel[0] / pixel[1] - 1.0) > SQUARE:
        yield (
            f"punch.file: pixels are not square, {_sides(pixel)}: is the map's size (x, y) right, and is it stored as z[iy, ix], "
            "a row for each y? A map of [ix, iy] has to be transposed"
        )
    if max(pixel) > spacing * (1.0 + SQUARE):
        yield (
            f"punch.file: pixels of {_sides(pixel)} are coarser than the grid's spacing, {shown(spacing, 'length')}: between "
            "them the face is interpolated, and what is finer than a pixel is not there"
        )
    if found.sag > BENT * reach:
        yield (
            f"punch.file: around the first contact heights bend by {shown(found.sag, 'length')} within a pixel, "
            f"{found.sag / reach:.2g} of the range of adhesion, {shown(reach, 'length')}: the pixels are too coarse, or noisy, for this "
            "range, and contact begins on single pixels; smooth the map, measure it finer, or choose a larger range"
        )
    if found.step > TERRACE * reach:
        yield (
            f"punch.file: heights come in steps of {shown(found.step, 'length')}, {found.step / reach:.2g} of the range of "
            f"adhesion, {shown(reach, 'length')}: terraces of that height touch; smooth the map, or choose a larger range"
        )


def _first_contact(scene: Scene, found: Survey) -> Iterator[str]:
    reach = scene.adhesion.range
    if found.lift > LIFTED * reach:
        slope = math.hypot(*found.tilt)
        yield (
            f"punch.file: the tilt of the heights under the punch, {math.degrees(math.atan(slope)):.2g} degrees, decides where "
            f"contact begins: what would touch first without it is {shown(found.lift, 'length')} higher now, and the range of "
            f'adhesion is {shown(reach, "length")}; set file_detrend = "tilt" if the stage was tilted, not the face'
        )


def _numbers(facts: MapFacts, found: Survey) -> Iterator[str]:
    """Heights that may be none."""
    if facts.missing > MANY_FILLED * facts.under:
        yield (
            f"punch.file_missing: {facts.missing} of {facts.under} pixels under the punch have no height and are made up "
            "from those around: what touches there is not known"
        )
    if found.spikes:
        first, many = found.spikes[0], len(found.spikes)
        direction = "out of the face, towards the elastomer" if first.height < 0.0 else "into the face"
        what = "a single pixel sticks" if many == 1 else f"{many} single pixels stick"
        yield (
            f"punch.file: {what} out of those around by many times what these differ, the furthest by "
            f"{shown(abs(first.height), 'length')} {direction}, at {_where(first)}: heights, or faults of the measurement? Correct them, "
            'or name their number as missing, such as file_missing_value = [0], with file_missing = "fill"'
        )
    if found.clipped:
        yield (
            f"punch.file: {found.clipped.pixels} pixels under the punch hold the very same extreme height, "
            f"{shown(found.clipped.number, 'length')}: the measurement may have been at the end of its range there, or the pixels "
            'be missing; name their number in the file as missing if so (file_missing_value, file_missing = "fill")'
        )
    if facts.suspect:
        yield (
            f"punch.file: {facts.suspect.pixels} pixels hold the number {facts.suspect.number:.9g}, far more than hold any other, "
            "and it is not what is around them: pixels without a signal? If so, set "
            f'file_missing_value = [{facts.suspect.number:.9g}] and file_missing = "fill"'
        )
    if not facts.unit.by:
        yield (
            f"punch.file_unit: neither scene nor file says the unit of the heights; they are taken for metres, a range of "
            f'{shown(found.relief, "length")}; set file_unit = "m" if so'
        )
