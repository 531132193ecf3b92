"""What a scene has to say about its height map before it is run, as a guess would give a wrong result. No MPI."""

from __future__ import annotations

from collections.abc import Iterator

from .errors import MISSING, Problem
from .maps.raw import unit_of
from .physics.map_survey import relief_and_slope
from .physics.topography import Topography
from .units import handy_quantity as shown

STEEPEST = 1.0
"""Slope of a face, 45 degrees, from which on heights without a unit are not taken for metres."""
UNITS = ("mm", "um", "nm")
"""Units of heights that are likely, and the slope that faces have in them, at most."""
USUAL_SLOPE = 0.7


def refusals(face: Topography, spacing: float) -> Iterator[Problem]:
    """What is to be set right in a scene with this face of the pattern "file", on a grid of a spacing [m].

    Raises ValueError, OSError for a map that can't be used at all.
    """
    facts = face.map.facts
    yield from facts.problems
    if facts.unit.by or any(problem.key == "punch.file_unit" for problem in facts.problems):
        return
    relief, slope = relief_and_slope(face, spacing)
    scale = 0.5 * min(facts.size) if face.radius is None else face.radius
    if slope <= STEEPEST and relief <= scale:
        return
    likely = next((unit for unit in UNITS if slope * unit_of(unit).metres <= USUAL_SLOPE), UNITS[-1])
    expected = (
        "the unit of the heights, as the file does not say it: in metres the face would rise by "
        f"{shown(relief, 'length')}, with slopes of up to {slope:.3g} (1 is 45 degrees)"
    )
    cure = (
        f'add file_unit = "{likely}", or what it is, to [punch]; in {likely} the steepest slope would be '
        f"{slope * unit_of(likely).metres:.3g}"
    )
    yield Problem("punch.file_unit", MISSING, expected, cure)
