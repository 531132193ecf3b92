"""From a scene to a simulation: the one place, besides the command line, that knows all parts."""

from __future__ import annotations

import math

import numpy as np
import scipy.fft

from pgfmd.cohesion import LAWS, CohesiveLaw
from pgfmd.controller import Controller, StepLimits
from pgfmd.drive import Drive
from pgfmd.far_field import far_weights
from pgfmd.film import Film
from pgfmd.free_kernel import FreeFilm, FreeHalfSpace
from pgfmd.grid import Grid, PunchPoints
from pgfmd.halfspace import HalfSpace, TabulatedCompliance
from pgfmd.newton import NewtonSolver
from pgfmd.rheology import PronySeries
from pgfmd.schemes import SCHEMES
from pgfmd.simulation import Simulation
from pgfmd.topography import Topography
from pgfmd.transform import Convolution, free_multiplier, periodic_multiplier

STEP_SHARE = 0.7
"""Tolerance of a step's error, in ranges of adhesion, for a `solver.accuracy` of 1."""


def compliance_of(scene):
    """The static compliance G0 of the scene's substrate (halfspace.py, film.py, free_kernel.py)."""
    substrate = scene.substrate
    film = math.isfinite(substrate.thickness)
    if film:
        kind = FreeFilm if substrate.boundary == "free" else Film
        return kind(substrate.youngs_modulus, substrate.poisson_ratio, substrate.thickness, substrate.base)
    if substrate.compliance_file:
        return TabulatedCompliance.from_file(substrate.compliance_file)
    kind = FreeHalfSpace if substrate.boundary == "free" else HalfSpace
    return kind(substrate.contact_modulus, substrate.prestrain)


def series_of(rheology) -> PronySeries:
    """The relaxation spectrum of a scene's [rheology]."""
    if rheology.model == "elastic":
        return PronySeries.elastic()
    if rheology.model == "single":
        return PronySeries.single(rheology.modulus_ratio, rheology.relaxation_time)
    if rheology.model == "geometric":
        return PronySeries.geometric(
            rheology.modulus_ratio, rheology.relaxation_time, rheology.elements, rheology.time_ratio, rheology.exponent
        )
    return PronySeries(np.array(rheology.kappa), np.array(rheology.tau))


def topography_of(punch) -> Topography:
    """The lower face of a scene's [punch]."""
    names = (
        "pattern", "radius", "wavelength", "amplitude", "curvature_radius", "exponent", "layer_step", "height_jitter",
        "seed", "file", "file_size",
    )  # fmt: skip
    given = {name: getattr(punch, name) for name in names}
    return Topography(**{name: value for name, value in given.items() if value is not None})


def drive_of(drive) -> Drive:
    """The loading programme of a scene's [drive]."""
    return Drive(drive.speed, drive.preload, drive.retract_speed, drive.turn_time, drive.dwell, drive.clearance)


def law_of(adhesion) -> CohesiveLaw:
    """The cohesive law of a scene's [adhesion]."""
    return CohesiveLaw(adhesion.work_of_adhesion, adhesion.range, LAWS[adhesion.law])


def deepest_indentation(scene) -> float:
    """Indentation [m] at which an approach is given up: there linear elasticity of small slopes has long lost its meaning."""
    lengths = [scene.punch.radius or 0.5 * scene.grid.length, scene.substrate.thickness]
    return min(lengths)


def transform_size(scene, points: PunchPoints, whole_cell: bool = False) -> int:
    """Points a side of the transform: the cell's, or for a free surface enough for the kernel not to wrap around."""
    if scene.substrate.boundary == "periodic":
        return points.grid.n
    reach = points.grid.n if whole_cell else points.nb
    return scipy.fft.next_fast_len(points.nb + reach - 1, real=True)


def convolution_of(scene, points: PunchPoints, whole_cell: bool = False) -> Convolution:
    """The operator G0 on the scene's grid; `whole_cell`: fit for `Convolution.whole_cell` too."""
    compliance = compliance_of(scene)
    if scene.substrate.boundary == "periodic":
        make = periodic_multiplier(compliance, scene.grid.length)
    else:
        make = free_multiplier(compliance, points.grid.spacing)
    return Convolution(points, transform_size(scene, points, whole_cell), make)


def heights_of(scene, points: PunchPoints) -> np.ndarray:
    """Height z [m] of the punch's lower face at the local points, its minimum over all ranks zero."""
    x, y = points.coordinates()
    raw = topography_of(scene.punch).heights(x, y)
    lowest = -points.maximum_of(-raw.min() if raw.size else -math.inf)
    return np.ascontiguousarray(raw - lowest)


def assemble(scene, comm) -> Simulation:
    """A simulation of the scene on a communicator, without observers. Collective."""
    points = PunchPoints(Grid(scene.grid.n, scene.grid.length), scene.punch.radius, comm)
    law = law_of(scene.adhesion)
    solver = NewtonSolver(points, convolution_of(scene, points), heights_of(scene, points), law, scene.drive.preload)
    series = series_of(scene.rheology)
    tolerance = STEP_SHARE * scene.solver.accuracy
    scheme = SCHEMES[scene.solver.scheme](solver, series.to_creep(), tolerance, scene.output.energy)
    shortest = float(series.tau.min()) if series.elements else math.inf
    controller = Controller(scheme, StepLimits(tolerance, law.range, shortest), scene.drive.preload)
    periodic = scene.substrate.boundary == "periodic"
    weights = far_weights(compliance_of(scene), points) if periodic else np.zeros(0)
    return Simulation(
        scheme, controller, drive_of(scene.drive), weights, deepest_indentation(scene), scene.solver.max_steps
    )
