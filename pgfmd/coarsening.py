"""Whether conjugate gradients use an additional coarser grid (solver/two_grid.py), and which. No MPI.

It follows from measurements: scripts/studies/cost/two_grid.py, docs/evidence/measured.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from . import scene_objects
from .scene.precision import transform_side_about
from .schemes import registry
from .symmetry import MOST_INSTANTANEOUS

if TYPE_CHECKING:
    from .scene import Scene

FACTORS = (8, 7, 6, 5, 4)
"""Points along a side of a cell, the best first: with 4, transforms on the cells take as long as they save; with 16, more
pairs are needed."""
LEAST_SIDE = 1000
"""Points a side of the transform from which on it is clearly cheaper: below, a pair costs hardly more than what it takes to
save it."""
MOST_CELLS = 1024
"""Cells a side: each rank has them all, which on hundreds of ranks must not be more than its own points."""


@dataclass(frozen=True)
class Coarsening:
    """factor: points along a side of a cell; 0, with the reason, where there is no coarser grid."""

    factor: int
    reason: str = ""


def expected(scene: Scene) -> Coarsening:
    """The coarser grid that a run of the scene uses. A pure function of the resolved scene, its mirror symmetry left out: a
    part of the punch and the whole are solved alike."""
    solver, series, n = scene.solver, scene_objects.series_of(scene.rheology), scene.grid.n
    if solver.coarse_grid == "none":
        return Coarsening(0, 'solver.coarse_grid = "none"')
    if not registry.scheme_of(scene).coarse_grid:
        return Coarsening(0, f"the scheme {solver.scheme} does without")
    if not series.elements or series.to_creep().J_inf > MOST_INSTANTANEOUS:
        return Coarsening(0, "(nearly) elastic surfaces, whose waves are all alike soft, have not been measured")
    if not scene.adhesion.attractive:
        return Coarsening(0, "without adhesion steps are long, and as long as solves are more exact than asked for")
    if scene.punch.radius is None:
        return Coarsening(0, "a punch that fills the cell has not been measured")
    if solver.coarse_grid == "auto" and transform_side_about(scene) < LEAST_SIDE:
        return Coarsening(0, f"with transforms below {LEAST_SIDE} points a side it costs what it saves")
    # An even number of cells, as half of them may stand for all.
    for factor in FACTORS:
        if n % (2 * factor) == 0:
            if n // factor > MOST_CELLS:
                return Coarsening(0, f"it would have more than {MOST_CELLS} cells a side, all of them on each rank")
            return Coarsening(factor)
    return Coarsening(0, f"grid.n is no multiple of {', '.join(str(2 * factor) for factor in sorted(FACTORS))}")


def scene_of_cells(scene: Scene):
    """The scene on the coarser grid that its run uses; None without one."""
    factor = expected(scene).factor
    if not factor:
        return None
    return scene.model_copy(update={"grid": scene.grid.model_copy(update={"n": scene.grid.n // factor})})
