"""The precision that a scene with `solver.precision = "auto"` is computed in, and why. No MPI.

It follows from measurements: scripts/studies/precision/run.py, docs/evidence/work_precision.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .model import Scene

from pgfmd.schemes import registry

FINEST_MIXED = 1e-5
"""The finest accuracy at which mixed precision was found to have the error of double."""
LEAST_SIDE = 256
"""Points a side of the transform from which on mixed precision is clearly cheaper: by a tenth at 256, a sixth at 512, a
quarter at 1024. The two cost the same between 128 and 192; smaller scenes keep the bits of double."""


@dataclass(frozen=True)
class Choice:
    """A precision, and the reason for it as an end of the sentence "..., because"."""

    precision: str
    reason: str


def best_precision(scene: Scene) -> Choice:
    """The precision that is best for a scene: mixed where that has the error of double and costs less, else double.

    A pure function of the resolved scene, whatever its own precision is.
    """
    solver, side, scheme = scene.solver, transform_side_about(scene), registry.scheme_of(scene)
    if scene.drive.control == "load":
        return Choice("double", "load control has no other")
    if scheme.only_double:
        return Choice("double", scheme.only_double)
    if solver.accuracy < FINEST_MIXED:
        return Choice("double", f"an accuracy below {FINEST_MIXED:g} is at the rounding of single corrections")
    if side < LEAST_SIDE:
        return Choice("double", f"mixed costs as much where transforms have fewer than {LEAST_SIDE} points a side")
    return Choice("mixed", f"it has the error of double for accuracies down to {FINEST_MIXED:g}, and costs less")


def transform_side_about(scene: Scene) -> int:
    """About how many points a side the transforms have: those of the cell, or twice those across a punch alone."""
    n, radius = scene.grid.n, scene.punch.radius
    if scene.substrate.boundary == "periodic" or radius is None:
        return n
    return round(4.0 * radius / scene.grid.length * n)
