"""How deep a punch is pressed in at the preload, in the time that it takes, and how far it is pulled out. Estimates; no MPI.

    d = k F/(2 a E) + delta,   F = K A <max(delta - h, 0)>,   1/K = 1/K_0 + lambda/(2 pi E)

A face with heights h sinks by delta into a layer of springs, of the law's stiffness K_0 and of the elastomer's between
summits a wavelength lambda apart; punch and layer together sink into the elastomer as a flat punch does. E is the modulus of
the time in which that is done. k is the share that periodic images leave of it: Green's function of a periodic cell is
1/(pi E) (1/r - 3.900/L + 2.26 r^2/L^3 ...), the Madelung constant of a square lattice and its second moment.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pgfmd.physics.adhesion.registry import clearance_of, law_of
from pgfmd.reference import flat_punch, jkr
from pgfmd.scene_objects import deepest_indentation, machine_compliance, topography_of, travel_time

from .estimate import depth_of, modulus_of
from .resolution import mean_kappa, softness_of_film

if TYPE_CHECKING:
    from pgfmd.scene import Scene

SAMPLES = 96
"""Points across a punch at which its heights are looked at."""
MADELUNG = 3.9003
"""Potential at one charge of a square lattice of unit charges with a neutral background."""
SECOND = 2.26
"""Curvature of this potential."""
ROUNDS = 24
"""Of the search for depth and modulus together: each halves what is left, about."""
SHALLOWEST = 0.01
"""Least depth that is reckoned with, in ranges of adhesion: a sphere that is drawn in may hold the preload at none."""
LEAST_SHARE = 0.1
"""Images never carry more of the load than this share leaves."""


def images_share(scene: Scene) -> float:
    """What the periodic images leave of the indentation of a flat punch; 1 where there are none."""
    if scene.substrate.boundary != "periodic" or scene.punch.radius is None:
        return 1.0
    x = 2.0 * scene.punch.radius / scene.grid.length
    # Of two points of the punch, (4/3) a^2 is the mean square distance, weighted by its pressure.
    return max(LEAST_SHARE, 1.0 - MADELUNG / math.pi * x + SECOND / (3.0 * math.pi) * x**3)


def depth_at_preload(scene: Scene) -> float:
    """Indentation [m] at which the preload is met, with the modulus of the approach."""
    punch = scene.punch
    if punch.radius is None or scene.substrate.compliance_file:
        return depth_of(scene)
    heights = _heights(scene) if punch.pattern not in ("sphere", "power") else None
    depth = depth_of(scene)
    for _ in range(ROUNDS):
        stiffening = mean_kappa(scene, travel_time(scene, depth + scene.adhesion.range, scene.drive.preload))
        found = _depth_with(scene, stiffening, heights)
        # Deeper means slower, and so softer: half of the way in logarithms keeps that from going to and fro.
        depth = math.sqrt(depth * found)
    return min(depth, deepest_indentation(scene))


def _heights(scene: Scene) -> np.ndarray | None:
    """Heights [m] of the face above its lowest point, at a sample of its points; None for a map that can't be read any
    more."""
    x = np.linspace(-scene.punch.outline, scene.punch.outline, SAMPLES + 1)
    x, y = np.meshgrid(x, x)
    inside = np.hypot(x, y) <= scene.punch.radius
    try:
        heights = topography_of(scene.punch).heights(x[inside], y[inside])
    except (OSError, ValueError):
        # Of a run whose progress is asked for: its map may have moved.
        return None
    return heights - heights.min()


def _depth_with(scene: Scene, stiffening: float, heights: np.ndarray | None) -> float:
    """Indentation [m] with a modulus that is larger by this factor; heights: of the face, None where Hertz's is known."""
    punch, load, law = scene.punch, scene.drive.preload, law_of(scene.adhesion)
    if punch.pattern == "sphere" and law.attractive:
        contact = punch.curvature_radius, stiffening * modulus_of(scene), law.work_of_adhesion
        return max(
            float(jkr.indentation(jkr.contact_radius_at_force(load, *contact), *contact)), SHALLOWEST * law.length
        )
    if heights is None:
        return depth_of(scene, stiffening)
    modulus, area = stiffening * modulus_of(scene), math.pi * punch.outline**2
    springs = 1.0 / law.overlap_stiffness
    if punch.wavelength:
        springs += punch.wavelength / (2.0 * math.pi * modulus)
    # The depth at which the layer carries the load rises with it: bisection.
    low, high = 0.0, float(heights.max()) + load * springs / area
    for _ in range(40):
        middle = 0.5 * (low + high)
        carried = area / springs * float(np.maximum(middle - heights, 0.0).mean())
        low, high = (middle, high) if carried < load else (low, middle)
    whole = images_share(scene) * load / float(flat_punch.force(1.0, punch.outline, modulus))
    return low + whole * softness_of_film(scene, punch.outline)


def pull_off_height(scene: Scene) -> float:
    """Displacement [m] at which the punch comes off: little above zero, but for a flat punch, which has to stretch the
    elastomer as far as Kendall's force does, and a sphere, which draws a neck as JKR's. Maugis, Contact, Adhesion and
    Rupture of Elastic Solids, 2000."""
    adhesion = scene.adhesion
    if not adhesion.attractive:
        return 0.0
    return clearance_of(adhesion) + stretch(scene) + neck(scene)


def stretch(scene: Scene) -> float:
    """How far [m] a flat punch stretches the elastomer before it comes off, as that is in this time; 0 for others."""
    if scene.punch.pattern != "flat":
        return 0.0
    relaxed = math.sqrt(2.0 * math.pi * scene.adhesion.work_of_adhesion * scene.punch.outline / modulus_of(scene))
    tension = float(flat_punch.force(relaxed, scene.punch.outline, modulus_of(scene)))
    return relaxed / math.sqrt(mean_kappa(scene, travel_time(scene, relaxed, tension, inward=False)))


def neck(scene: Scene) -> float:
    """How far [m] a sphere that sticks draws the elastomer up, by JKR's theory at fixed grips; 0 for others."""
    punch, adhesion = scene.punch, scene.adhesion
    if punch.pattern != "sphere" or not adhesion.attractive:
        return 0.0
    unit = (math.pi**2 * adhesion.work_of_adhesion**2 * punch.curvature_radius / modulus_of(scene) ** 2) ** (1.0 / 3.0)
    return 0.75 * unit


def pull_off_force(scene: Scene) -> float:
    """Tension [N] at which the punch comes off a relaxed elastomer, by Kendall or JKR. Of other faces it is not known, but
    hardly more than that of a flat punch, or than the preload that made the contact: half of the smaller is taken."""
    punch, adhesion, modulus = scene.punch, scene.adhesion, modulus_of(scene)
    if not adhesion.attractive:
        return 0.0
    if punch.pattern == "sphere":
        return -jkr.load_controlled_pull_off(punch.curvature_radius, modulus, adhesion.work_of_adhesion).force
    outline = punch.radius or 0.5 * scene.grid.length
    kendall = -flat_punch.pull_off_force(outline, modulus, adhesion.work_of_adhesion)
    return kendall if punch.pattern == "flat" else 0.5 * min(kendall, scene.drive.preload)


@dataclass(frozen=True)
class Travel:
    """The way in to the preload, or out until the punch comes off. length [m]: of the punch's. time [s]; speed [m/s]: the
    punch's mean."""

    length: float
    time: float
    speed: float


def travels_of(scene: Scene, start: float | None = None) -> tuple[Travel, Travel]:
    """The ways in and out, without the turn. On a machine with a spring the punch is slower than what is driven.

    start [m]: height at which the way in begins, that of the scene if it is not given.
    """
    drive, depth = scene.drive, depth_at_preload(scene)
    into = depth + (max(drive.clearance, 0.0) if start is None else start)
    out = depth + pull_off_height(scene)
    time_in = travel_time(scene, into, drive.preload)
    if not machine_compliance(scene):
        # Speeds as given, not rounded.
        time_out = travel_time(scene, out, 0.0, inward=False)
        return Travel(into, time_in, drive.speed), Travel(out, time_out, drive.retract_speed)
    time_out = travel_time(scene, out, drive.preload + pull_off_force(scene), inward=False)
    return Travel(into, time_in, into / time_in), Travel(out, time_out, out / time_out)


def punch_speeds(scene: Scene) -> tuple[float, float]:
    """Mean speeds [m/s] of the punch on its ways in and out; on a rigid machine those of the drive."""
    if not machine_compliance(scene):
        return scene.drive.speed, scene.drive.retract_speed
    into, out = travels_of(scene)
    return into.speed, out.speed
