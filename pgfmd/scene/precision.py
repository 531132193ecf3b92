"""The choice of precision for `solver.precision = "auto"`, with its reason. No MPI.

It is based on measurements: scripts/studies/precision/run.py, docs/evidence/work_precision.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .model import Scene

from pgfmd.schemes import registry

FINEST_MIXED = 1e-5
"""The finest accuracy at which mixed precision has the same error as double."""
LEAST_SIDE = 256
"""Smallest number of points per side of the transform for mixed precision. It saves a tenth of the time at 256, a sixth
at 512, and a quarter at 1024; between 128 and 192 both cost the same."""


SOFTEST = 1e-2
"""Stiffness of a machine's spring relative to that of the punch in contact, below which single corrections lose too much of the
surface in the elongation of the spring."""


def is_soft(machine: float, contact_modulus: float, radius: float | None, length: float) -> bool:
    """Whether a machine's spring asks for double precision. Stiffness [N/m], modulus [Pa], radius of the punch and side of
    the cell [m]."""
    return machine < SOFTEST * 2.0 * (radius or 0.5 * length) * contact_modulus


@dataclass(frozen=True)
class Choice:
    """A precision and its reason, as the end of the sentence "..., because"."""

    precision: str
    reason: str


def best_precision(scene: Scene) -> Choice:
    """The best precision for a scene: mixed if it is as accurate as double and costs less, else double.

    Depends only on the resolved scene, not on its own precision.
    """
    solver, side, scheme = scene.solver, transform_side_about(scene), registry.scheme_of(scene)
    if scene.drive.controls_load:
        return Choice("double", "load control has no other")
    if is_soft(scene.drive.machine_stiffness, scene.substrate.contact_modulus, scene.punch.radius, scene.grid.length):
        return Choice("double", "the machine's spring is so soft that it nearly controls the load")
    if scheme.only_double:
        return Choice("double", scheme.only_double)
    if solver.accuracy < FINEST_MIXED:
        return Choice("double", f"an accuracy below {FINEST_MIXED:g} is at the rounding of single corrections")
    if side < LEAST_SIDE:
        return Choice("double", f"mixed costs as much where transforms have fewer than {LEAST_SIDE} points a side")
    return Choice("mixed", f"it has the error of double for accuracies down to {FINEST_MIXED:g}, and costs less")


def transform_side_about(scene: Scene) -> int:
    """Approximate number of points per side of the transforms: those of the cell, or twice those across a free
    punch."""
    n, radius = scene.grid.n, scene.punch.radius
    if scene.substrate.boundary == "periodic" or radius is None:
        return n
    return round(4.0 * radius / scene.grid.length * n)
