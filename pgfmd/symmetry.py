"""Whether a scene is its own mirror image, and is stepped on a half or a quarter of its points. No MPI.

The axes are x -> -x, and y -> -y as well. Periodic cells, free surfaces, films and prestrains are symmetric in both; so
it is the punch's face that decides, by its heights at points and at their images: they must have the same bits. What can't
tell left from right stays symmetric where its way is unique, as that of a viscoelastic surface is. An elastic one that
loses its stability may go on lopsided; scenes that allow that are stepped whole.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import takewhile
from types import SimpleNamespace
from typing import TYPE_CHECKING, cast

import numpy as np

from . import parts
from .schemes import registry
from .solver.grid import Grid, PunchPoints

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from .physics.topography import Topography
    from .scene import Scene

FEW = 1 << 13
"""Points that are looked at at a time: formulas of heights need many arrays."""
MOST_INSTANTANEOUS = 0.5
"""Largest share of the compliance that may be instantaneous; with more, a surface snaps as an elastic one does."""
AXES = ("x", "xy")
"""The symmetries that are made use of, the one that takes the other for granted last."""
SAMPLE = 1 << 15
"""Points that are looked at to tell before a run whether it will be symmetric."""


@dataclass(frozen=True)
class Symmetry:
    """mirror: the axes made use of, as PunchPoints takes them; empty, with the reason, where the whole is stepped."""

    mirror: str
    reason: str = ""


def obstacle(scene: Scene) -> str:
    """Why a scene is stepped whole, whatever its face; empty where nothing speaks against a part of it."""
    solver, series = scene.solver, parts.series_of(scene.rheology)
    if solver.symmetry == "none":
        return 'solver.symmetry = "none"'
    whole_only = registry.scheme_of(scene).whole_only
    if whole_only:
        return whole_only
    if not series.elements or series.to_creep().J_inf > MOST_INSTANTANEOUS:
        return "a (nearly) elastic surface that snaps may become lopsided"
    if scene.grid.n % 2:
        return "grid.n is odd"
    return ""


def has_images(topography: Topography, points: PunchPoints, places: np.ndarray | None = None) -> bool:
    """Whether the heights at local points are those at their mirror images, to the last bit.

    points: PunchPoints with a mirror, of which the last axis is looked at. places: ranges of points, (first, last); all
    by default.
    """
    # Where there is no symmetry, the first few tell.
    starts = range(0, points.size, FEW) if places is None else places
    for start in starts:
        x, y = points.coordinates(start, start + FEW)
        image = (-x, y) if points.mirror == "x" else (x, -y)
        if not np.array_equal(topography.heights(x, y), topography.heights(*image)):
            return False
    return True


def largest(holds: Callable[[str], bool]) -> str:
    """The last of AXES that holds, as all before it do; empty where none does."""
    return max(takewhile(holds, AXES), key=len, default="")


@lru_cache(maxsize=16)
def expected(scene: Scene) -> Symmetry:
    """The symmetry that a run of the scene will make use of, from a sample of its points."""
    reason = obstacle(scene)
    if reason:
        return Symmetry("", reason)
    topography = parts.topography_of(scene.punch)

    def holds(axes: str) -> bool:
        points = points_of(scene, axes)
        places = np.unique(np.linspace(0, max(0, points.size - FEW), SAMPLE // FEW).astype(int))
        return has_images(topography, points, places)

    found = largest(holds)
    return Symmetry(found, "" if found else "the punch's face is not its own mirror image in x")


ALONE = cast("Intracomm", SimpleNamespace(size=1, rank=0))
"""What a grid asks of a communicator, told of a single rank."""


def points_of(scene: Scene, mirror: str, comm: Intracomm = ALONE) -> PunchPoints:
    """The points under the punch that are stepped with this mirror, by default as a single rank would own them."""
    return PunchPoints(Grid(scene.grid.n, scene.grid.length), scene.punch.radius, comm, mirror=mirror)
