"""The scheme inertialess and scenes: building it, its memory, and scenes that use every kernel."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pgfmd import coarsening, scene_objects
from pgfmd.forecast.estimate import Memory, memory_of_vectors, rough_share

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.scene import Scene
    from pgfmd.schemes.base import Scheme, StepController
    from pgfmd.schemes.entry import Overrides


def build(scene: Scene, comm: Intracomm, mirror: str) -> tuple[Scheme, StepController]:
    """Scheme and controller of a scene. Collective."""
    # Not at the top, because forecasts need no MPI.
    from pgfmd.assemble import far_weights_of, newton_solver, tolerance_of

    from .controller import Controller, StepLimits
    from .scheme import Inertialess

    springs, output, machine = scene_objects.springs_of(scene), scene.output, None
    if any(springs.values()):
        # Most machines are taken for rigid.
        from pgfmd.solver.machine import Machine, with_spring

        solver = newton_solver(scene, comm, mirror, lambda convolve: with_spring(convolve, max(springs.values()), 1.0))
        machine = Machine(solver, springs, scene_objects.punch_stiffness(scene))
    else:
        solver = newton_solver(scene, comm, mirror)
    law, series, tolerance = solver.law, scene_objects.series_of(scene.rheology), tolerance_of(scene)
    weights = far_weights_of(scene, solver)
    scheme = Inertialess(
        solver, series.to_creep(), tolerance, output.energy, weights, output.near_gap, scene.solver.order, machine
    )
    shortest = float(series.tau.min()) if series.elements else math.inf
    limits = StepLimits(tolerance, law.length, shortest, law.attractive)
    return scheme, Controller(scheme, limits, scene.drive.preload)


def memory(scene: Scene, ranks: int) -> Memory:
    """Memory of the rank with the largest share.

    State: u, w, f, two past u and w; N internal variables; with the energy audit, their N displacements. Scheme: u, w, f,
    history per stage; two stages, one if elastic or of first order. Newton: heights and f, and K, r, s, t, p, y, z with
    the precision of `rough`; with a coarse grid, other work vectors (two_grid.py). Weights of the far field.
    """
    elements, rough = scene_objects.series_of(scene.rheology).elements, rough_share(scene)
    stages, periodic = scene.solver.order if elements else 1, scene.substrate.boundary == "periodic"
    more = 3.0 * rough if coarsening.expected(scene).factor else 0.0
    more += rough if more and any(scene_objects.springs_of(scene).values()) else 0.0
    counts = 7 + elements * (1 + scene.output.energy), stages * 4 + 2 + 7 * rough + periodic + more
    return memory_of_vectors(scene, ranks, counts)


def warm_up(precision: str) -> tuple[Overrides, ...]:
    """Half a punch with and without a coarse grid, a quarter, and a whole punch."""
    return ["solver.coarse_grid=always"], ["output.energy=false"], ["punch.pattern=flat"], ["rheology.model=elastic"]
