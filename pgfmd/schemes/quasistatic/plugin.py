"""The scheme quasistatic and scenes: building it, its memory, and scenes that use every kernel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pgfmd import scene_objects
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
    from pgfmd.solver.machine import with_spring

    from .controller import LoadSteps
    from .scheme import Quasistatic

    compliance, spring = scene_objects.quasistatic_compliance(scene), scene_objects.machine_compliance(scene)
    solver = newton_solver(scene, comm, mirror, lambda convolve: with_spring(convolve, spring, compliance))
    law, tolerance = solver.law, tolerance_of(scene)
    stiffness = scene_objects.punch_stiffness(scene) / compliance
    dead = scene.drive.control == "load"
    weights, near = far_weights_of(scene, solver), scene.output.near_gap
    scheme = Quasistatic(solver, compliance, tolerance, weights, near, spring, stiffness, dead)
    return scheme, LoadSteps(scheme, tolerance, law.length, scene.drive.preload, law.attractive)


def memory(scene: Scene, ranks: int) -> Memory:
    """Memory of the rank with the largest share.

    State: u, w, f, two past u and w; the softest mode and its dual, now and before the step. Scheme: u, w, and zeros
    for the history; vectors of Newton's method.
    """
    rough, periodic = rough_share(scene), scene.substrate.boundary == "periodic"
    return memory_of_vectors(scene, ranks, (7 + 2 * rough, 3 + 2 + 9 * rough + periodic))


def warm_up(precision: str) -> tuple[Overrides, ...]:
    """Scenes with and without a machine's spring, which single precision does not support."""
    return ([] if precision == "single" else ["drive.machine_stiffness=1 kN/m"],)
