"""Scenes with the massless limit: what is built of them, what it needs, and which ones use every kernel."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pgfmd import coarsening, parts
from pgfmd.forecast.estimate import Memory, memory_of_vectors, rough_share

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.scene import Scene
    from pgfmd.schemes.entry import Overrides

    from .controller import Controller
    from .scheme import Inertialess


def build(scene: Scene, comm: Intracomm, mirror: str) -> tuple[Inertialess, Controller]:
    """Scheme and controller of a scene. Collective."""
    # Not at the top: what a run costs is told without MPI.
    from pgfmd.assemble import STEP_SHARE, far_weights_of, newton_solver

    from .controller import Controller, StepLimits
    from .scheme import Inertialess

    solver, output = newton_solver(scene, comm, mirror), scene.output
    law, series, tolerance = solver.law, parts.series_of(scene.rheology), STEP_SHARE * scene.solver.accuracy
    weights = far_weights_of(scene, solver)
    scheme = Inertialess(
        solver, series.to_creep(), tolerance, output.energy, weights, output.near_gap, scene.solver.order
    )
    shortest = float(series.tau.min()) if series.elements else math.inf
    limits = StepLimits(tolerance, law.range, shortest, law.attractive)
    return scheme, Controller(scheme, limits, scene.drive.preload)


def memory(scene: Scene, ranks: int) -> Memory:
    """Memory of the rank with the largest share.

    State: u, w, f, two past u and w; N branches; their N images where energies are followed. Scheme: u, w, f, history a
    stage; two stages, one where elastic or of first order. Newton: heights and f, and K, r, s, t, p, y, z, of `rough` the
    size; with a coarser grid, other work vectors (two_grid.py). Weights of the far field.
    """
    elements, rough = parts.series_of(scene.rheology).elements, rough_share(scene)
    stages, periodic = scene.solver.order if elements else 1, scene.substrate.boundary == "periodic"
    more = 3.0 * rough if coarsening.expected(scene).factor else 0.0
    counts = 7 + elements * (1 + scene.output.energy), stages * 4 + 2 + 7 * rough + periodic + more
    return memory_of_vectors(scene, ranks, counts)


def warm_up(precision: str) -> tuple[Overrides, ...]:
    """Of half a punch, with a coarser grid and without, of a quarter of one, and of a whole one."""
    return ["solver.coarse_grid=always"], ["output.energy=false"], ["punch.pattern=flat"], ["rheology.model=elastic"]
