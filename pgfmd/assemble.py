"""From a scene to a simulation: the nouns of parts.py put on a grid that is shared out over the ranks."""

from __future__ import annotations

import math

import numpy as np

from pgfmd import parts
from pgfmd.controller import Controller, StepLimits
from pgfmd.far_field import far_weights
from pgfmd.grid import Grid, PunchPoints
from pgfmd.newton import NewtonSolver
from pgfmd.schemes import SCHEMES
from pgfmd.simulation import Simulation
from pgfmd.transform import Convolution, free_multiplier, periodic_multiplier

STEP_SHARE = 0.7
"""Tolerance of a step's error, in ranges of adhesion, for a `solver.accuracy` of 1. On tri-tack at n = 512 the default
accuracy then gives the pull-off force to 0.1 %, for 8 % fewer transforms than 0.5; 1.0 gives it to 0.5 %."""


def convolution_of(scene, points: PunchPoints, whole_cell: bool = False) -> Convolution:
    """The operator G0 on the scene's grid; `whole_cell`: fit for `Convolution.whole_cell` too."""
    compliance = parts.compliance_of(scene)
    if scene.substrate.boundary == "periodic":
        make = periodic_multiplier(compliance, scene.grid.length)
    else:
        make = free_multiplier(compliance, points.grid.spacing)
    return Convolution(points, parts.transform_side(scene, points.nb, whole_cell), make)


def heights_of(scene, points: PunchPoints) -> np.ndarray:
    """Height z [m] of the punch's lower face at the local points, its minimum over all ranks zero."""
    x, y = points.coordinates()
    raw = parts.topography_of(scene.punch).heights(x, y)
    lowest = -points.maximum_of(-raw.min() if raw.size else -math.inf)
    return np.ascontiguousarray(raw - lowest)


def assemble(scene, comm) -> Simulation:
    """A simulation of the scene on a communicator, without observers. Collective."""
    points = PunchPoints(Grid(scene.grid.n, scene.grid.length), scene.punch.radius, comm)
    law = parts.law_of(scene.adhesion)
    convolve, height = convolution_of(scene, points), heights_of(scene, points)
    solver = NewtonSolver(points, convolve, height, law, scene.drive.preload)
    series = parts.series_of(scene.rheology)
    tolerance = STEP_SHARE * scene.solver.accuracy
    scheme = SCHEMES[scene.solver.scheme](solver, series.to_creep(), tolerance, scene.output.energy)
    shortest = float(series.tau.min()) if series.elements else math.inf
    controller = Controller(scheme, StepLimits(tolerance, law.range, shortest, law.attractive), scene.drive.preload)
    periodic = scene.substrate.boundary == "periodic"
    weights = far_weights(parts.compliance_of(scene), points) if periodic else np.zeros(0)
    deepest = parts.deepest_indentation(scene)
    return Simulation(scheme, controller, parts.drive_of(scene.drive), weights, deepest, scene.solver.max_steps)
