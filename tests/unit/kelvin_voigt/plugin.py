"""Scenes with a spring beside a dashpot. `solver.accuracy` is the step, as a share of the longest that is stable."""

from pgfmd import scene_objects
from pgfmd.forecast.effort import effort_of_steps
from pgfmd.forecast.estimate import memory_of_vectors, pair_cost
from pgfmd.forecast.progress import time_left
from pgfmd.schemes.gfmd.inertia import contact_stiffness


def build(scene, comm, mirror):
    from pgfmd.assemble import convolution_of, heights_of
    from pgfmd.schemes.gfmd.controller import FixedSteps
    from pgfmd.solver.far_field import far_weights
    from pgfmd.symmetry import points_of

    from .scheme import KelvinVoigt

    points = points_of(scene, mirror, comm)
    weights = far_weights(scene_objects.compliance_of(scene), points)
    scheme = KelvinVoigt(
        points, convolution_of(scene, points), heights_of(scene, points), scene_objects.law_of(scene.adhesion), _tau(scene),
        weights, scene.output.near_gap,
    )  # fmt: skip
    return scheme, FixedSteps(scheme, _step(scene))


def memory(scene, ranks):
    return memory_of_vectors(scene, ranks, (3, 3))


def effort(scene):
    return effort_of_steps(scene, _step(scene), 1.0, pair_cost(scene))


def steps_left(scene, moment, way):
    return time_left(scene, moment, way) / _step(scene), ""


def numerics(scene):
    return {"accuracy": scene.solver.accuracy, "dt_s": _step(scene)}


def warm_up(precision):
    return (["solver.max_steps=3"],)


def _tau(scene):
    series = scene_objects.series_of(scene.rheology)
    return float((series.kappa * series.tau).sum())


def _step(scene):
    """Stable below 2 tau/(1 + K_0 max G0): the surface gives way at once to what pulls it."""
    law = scene_objects.law_of(scene.adhesion)
    stiffness = contact_stiffness(scene_objects.compliance_of(scene), law, scene.grid.n, scene.grid.length)
    return 2.0 * scene.solver.accuracy * _tau(scene) / (1.0 + stiffness)
