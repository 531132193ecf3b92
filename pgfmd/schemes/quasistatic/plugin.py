"""Scenes without time: what is built of them, what it needs, and which ones use every kernel."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pgfmd import parts
from pgfmd.forecast.estimate import Memory, memory_of_vectors, rough_share

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.scene import Scene
    from pgfmd.schemes.entry import Overrides

    from .controller import LoadSteps
    from .scheme import Quasistatic


def build(scene: Scene, comm: Intracomm, mirror: str) -> tuple[Quasistatic, LoadSteps]:
    """Scheme and controller of a scene. Collective."""
    # Not at the top: what a run costs is told without MPI.
    from pgfmd.assemble import STEP_SHARE, far_weights_of, newton_solver

    from .controller import LoadSteps
    from .machine import sprung
    from .scheme import Quasistatic

    compliance, spring = parts.quasistatic_compliance(scene), parts.machine_compliance(scene)
    solver = newton_solver(scene, comm, mirror, lambda convolve: sprung(convolve, spring, compliance))
    law, tolerance = solver.law, STEP_SHARE * scene.solver.accuracy
    stiffness = parts.punch_stiffness(scene) / compliance
    dead = scene.drive.control == "load"
    weights, near = far_weights_of(scene, solver), scene.output.near_gap
    scheme = Quasistatic(solver, compliance, tolerance, weights, near, spring, stiffness, dead)
    return scheme, LoadSteps(scheme, tolerance, law.range, scene.drive.preload, law.attractive)


def memory(scene: Scene, ranks: int) -> Memory:
    """Memory of the rank with the largest share.

    State: u, w, f, two past u and w; the softest mode and its dual, and as they were before the step. Scheme: u, w, and
    zeros for the history; Newton's vectors.
    """
    rough, periodic = rough_share(scene), scene.substrate.boundary == "periodic"
    return memory_of_vectors(scene, ranks, (7 + 2 * rough, 3 + 2 + 9 * rough + periodic))


def warm_up(precision: str) -> tuple[Overrides, ...]:
    """Of a machine with a spring, which single precision has none of."""
    return ([] if precision == "single" else ["drive.machine_stiffness=1 kN/m"],)
