"""The coarse approaches that are run ahead where snapshots are wanted before the preload: their scenes, and what they tell
of the run's own approach. No MPI.

When such a snapshot is due is known only once the preload has been met. Where the punch meets the surface, and where the
preload, hardly depends on the grid but on the range of adhesion rho, which follows the grid: both places move by about as
much as it, in proportion. So two approaches on one coarse grid, with two ranges, give them for the run's own range:

    d(rho) = d(r_1) - (d(r_2) - d(r_1)) (r_1 - rho)/(r_2 - r_1)

That is good to a percent or two of the time to the preload; to five where that takes the punch over two or three ranges only
(hex-tack, 2 mN), as it is not quite in proportion. Finer or sharper approaches were no better.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from . import parts
from .errors import SceneError
from .physics.adhesion.registry import clearance_of
from .scene.precision import best_precision
from .schemes import registry

if TYPE_CHECKING:
    from .scene import Scene

ACCURACY = 0.03
"""Of the coarse approaches: the cheapest one, as longer steps meet more negative curvature."""
COARSEST = 4
"""The grid is coarser by at most this factor, a power of two ..."""
LEAST_N = 256
"""... but has at least so many points a side, ..."""
LEAST_POINTS = 8.0
"""... and so many a wavelength."""
OTHER_RANGE = math.sqrt(2.0)
"""The longer of the two ranges, relative to the shorter one, which is the shortest that the coarse grid carries."""


@dataclass(frozen=True)
class Met:
    """Positions of the machine [m] at the first contact and at the preload; range [m] of adhesion."""

    range: float
    contact: float
    preload: float


def fractions_ahead(scene: Scene) -> list[float]:
    """Which snapshots of the scene are wanted before the preload, as fractions of the time to it."""
    return [value for value, relative in scene.output.snapshot_times if relative and value < 1.0]


def coarse_scenes(scene: Scene) -> list[Scene]:
    """The scenes that are run to the preload to tell where it is: two ranges on a coarse grid; one where that grid carries
    the scene's own range. None where no snapshot asks for it."""
    if not fractions_ahead(scene):
        return []
    factor = COARSEST
    while factor > 1:
        n = 2 * round(scene.grid.n / factor / 2)
        wavelength = scene.punch.wavelength or math.inf
        if n >= LEAST_N and wavelength * n >= LEAST_POINTS * scene.grid.length:
            found = _on(scene, n)
            if found:
                return found
        factor //= 2
    return [_with(scene, scene.grid.n, scene.adhesion.range)]


def _on(scene: Scene, n: int) -> list:
    """The scenes on a grid of n points a side; none where the substrate does not allow that."""
    shortest = scene.adhesion.range
    if scene.adhesion.attractive:
        # The automatic range goes with the root of the spacing. A range that is longer than that needs no other.
        spare = scene.adhesion.range / parts.automatic_range(scene)
        shortest *= max(1.0, math.sqrt(scene.grid.n / n) / max(1.0, spare))
    ranges = [shortest] if shortest == scene.adhesion.range else [shortest, OTHER_RANGE * shortest]
    found = [_with(scene, n, reach) for reach in ranges]
    try:
        for coarse in found:
            parts.confirm(coarse, "a coarse approach")
    except SceneError:
        return []
    return found


def _with(scene: Scene, n: int, reach: float):
    """The scene on n points a side with another range, starting as far out of reach as it does; no faster than explicit
    steps allow, and with nothing written."""
    own = registry.scheme_of(scene)
    scheme = own.ahead or own.name
    accuracy = max(ACCURACY, scene.solver.accuracy) if own.has_accuracy else ACCURACY
    adhesion, clearance = scene.adhesion.model_copy(update={"range": reach}), scene.drive.clearance
    if adhesion.attractive:
        clearance += clearance_of(adhesion) - clearance_of(scene.adhesion)
    coarse = scene.model_copy(
        update={
            "grid": scene.grid.model_copy(update={"n": n}),
            "adhesion": adhesion,
            "drive": scene.drive.model_copy(update={"clearance": clearance}),
            "solver": scene.solver.model_copy(update={"scheme": scheme, "accuracy": accuracy}),
            "output": scene.output.model_copy(
                update={"energy": False, "surface": False, "patches": False, "snapshots": ()}
            ),
        }
    )  # fmt: skip
    if scene.solver.precision == "single":
        return coarse
    return coarse.model_copy(
        update={"solver": coarse.solver.model_copy(update={"precision": best_precision(coarse).precision})}
    )


def met_by(scene: Scene, coarse: list[Met]) -> Met:
    """Where the scene will meet the surface and the preload, from the coarse approaches."""
    first = coarse[0]
    if len(coarse) == 1:
        return Met(scene.adhesion.range, min(first.contact, scene.drive.clearance), first.preload)
    other, own = coarse[1], scene.adhesion.range
    away = (first.range - own) / (other.range - first.range)
    contact, preload = (
        one - (two - one) * away for one, two in ((first.contact, other.contact), (first.preload, other.preload))
    )
    # A start within reach is the first contact at once.
    contact = min(contact, scene.drive.clearance)
    return Met(own, contact, min(preload, contact))


def moments(scene: Scene, met: Met) -> list[tuple[float, str]]:
    """Times [s] and labels of the snapshots that are wanted before the preload."""
    start, speed = scene.drive.clearance, parts.drive_of(scene).phases[0].fastest
    contact, preload = ((start - place) / speed for place in (met.contact, met.preload))
    return [(contact + value * (preload - contact), f"{value:g} t_pl") for value in fractions_ahead(scene)]
