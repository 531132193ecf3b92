"""Estimates of the influence of grid, law and cell: points of a summit, overlap, images of a film. No MPI.

They are from closed forms, for warnings. Their reliability is documented in docs: resolution.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from pgfmd.physics.adhesion.registry import law_of, range_by_rule
from pgfmd.physics.film import Film
from pgfmd.physics.topography import PATTERNS, layered
from pgfmd.reference import hertz
from pgfmd.scene_objects import BONDED, compliance_of, relaxation_of, topography_of, travel_time
from pgfmd.solver.grid import Grid

from .estimate import depth_of, modulus_of

if TYPE_CHECKING:
    from pgfmd.scene import Scene
    from pgfmd.scene.model import Punch

MOST_POINTS = 2**20
"""Most points of a height map that are examined."""
BAND = 64
"""Number of adjacent rows that are examined, if there are more points than that."""
LOWEST = 64
"""Number of summits of a height map, or of a random face, that are used: those that touch first."""
SUMMITS_A_CELL = {"triangular": 1, "hexagonal": 2}
"""Summits in a unit cell of the lattice, sqrt(3)/2 wavelength^2."""
WAVES = 96
"""Waves per side and direction in the sum over a cell, which converges with the third power."""


def summit_points(scene: Scene) -> float:
    """Number of grid points around a summit whose height above it is below the range of adhesion; infinite without
    curved summits. It is 2 pi R rho/h^2 for a radius R of curvature.

    They carry the attraction of a summit at first touch. Without attraction, for a sphere or a power law only: points
    whose height is below the indentation at the preload.
    """
    punch, law, spacing = scene.punch, law_of(scene.adhesion), scene.grid.length / scene.grid.n
    if not law.attractive and punch.pattern not in ("sphere", "power"):
        return math.inf
    height = law.length if law.attractive else depth_of(scene)
    if PATTERNS[punch.pattern].sampled:
        rise = _rise_of_map(scene)
        return math.pi * height / rise if rise > 0.0 else math.inf
    raw = _before_layers(height, punch.layer_step, topography_of(punch).layer_smoothing)
    if punch.pattern == "power":
        radius = punch.curvature_radius * (punch.exponent * raw / punch.curvature_radius) ** (1.0 / punch.exponent)
        return math.pi * (radius / spacing) ** 2
    return 2.0 * math.pi * summit_radius(punch) * raw / spacing**2


def summit_radius(punch: Punch) -> float:
    """Radius of curvature [m] of a summit, including that of the whole punch."""
    radius = topography_of(punch).summit_radius
    curvature = 0.0 if math.isinf(radius) else 1.0 / radius
    if punch.pattern not in ("sphere", "power") and math.isfinite(punch.curvature_radius):
        curvature += 1.0 / punch.curvature_radius
    return 1.0 / curvature if curvature else math.inf


def _before_layers(height: float, layer_step: float, smoothing: float) -> float:
    """The height [m] that printing in layers turns into `height`."""
    if layer_step == 0.0:
        return height
    raw = np.linspace(0.0, height + layer_step, 4097)
    return float(raw[np.searchsorted(layered(raw, layer_step, smoothing), height)])


def _rise_of_map(scene: Scene) -> float:
    """Mean height [m] of the four neighbours of a summit above it: h^2/(2R) for a round summit.

    The median over the lowest summits of a height map, or of a random face, on the scene's grid, 0 without summits.
    """
    grid, radius = Grid(scene.grid.n, scene.grid.length), scene.punch.radius
    start, count = grid.block(radius)
    topography = topography_of(scene.punch)

    def heights(rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        x, y = np.meshgrid(grid.coordinate(start + columns), grid.coordinate(start + rows))
        height = topography.heights(x, y)
        if radius is not None:
            height[np.hypot(x, y) > radius * (1.0 + 1e-12)] = math.inf
        return height

    bands = _bands(count, heights)
    found = [_summits(band) for band in np.split(heights(np.concatenate(bands), np.arange(count)), len(bands))]
    rise, level = (np.concatenate(parts) for parts in zip(*found, strict=True))
    if not rise.size:
        return 0.0
    return float(np.median(rise[np.argsort(level, kind="stable")[:LOWEST]]))


def _bands(count: int, heights: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> list[np.ndarray]:
    """Rows of a block of `count` by `count` points to examine: all of a small block; bands of equal width of a large
    one, one around the lowest point of a coarser grid, the others distributed evenly."""
    if count**2 <= MOST_POINTS or count <= BAND:
        return [np.arange(count)]
    every = np.arange(0, count, math.ceil(count / math.sqrt(MOST_POINTS)))
    lowest = every[int(heights(every, every).min(axis=1).argmin())]
    middles = np.linspace(0, count, MOST_POINTS // (BAND * count) + 2)[1:-1]
    firsts = np.clip(np.append(middles, lowest).astype(int) - BAND // 2, 0, count - BAND)
    return [np.arange(first, first + BAND) for first in np.unique(firsts)]


def _summits(height: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of the points that are no higher than their eight neighbours: the mean rise to the nearest four [m], and the
    heights [m]; those on the rim (a neighbour is infinite) left out."""
    rows, columns = height.shape
    if min(rows, columns) < 3:
        return np.zeros(0), np.zeros(0)
    middle = height[1:-1, 1:-1]
    around = {
        (i, j): height[1 + i : rows - 1 + i, 1 + j : columns - 1 + j]
        for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)
    }  # fmt: skip
    lowest = np.isfinite(middle)
    for other in around.values():
        lowest &= (middle <= other) & np.isfinite(other)
    nearest = sum(around[place][lowest] for place in ((-1, 0), (1, 0), (0, -1), (0, 1)))
    return 0.25 * nearest - middle[lowest], middle[lowest]


def overlap_share(scene: Scene) -> float:
    """Estimated overlap of punch and elastomer at the preload, relative to the indentation; 0 if there is none.

    It is the mean pressure divided by the stiffness of overlaps, as for an elastomer covered with springs. The contact is
    that of Hertz, for the punch or one of its summits, or that of a flat punch; the modulus is that at the duration of the
    approach.
    """
    punch, law, load = scene.punch, law_of(scene.adhesion), scene.drive.preload
    if punch.pattern in ("sphere", "power"):
        radius, limit = punch.curvature_radius, punch.radius
    elif punch.pattern in SUMMITS_A_CELL and punch.radius is not None:
        cell = 0.5 * math.sqrt(3.0) * punch.wavelength**2
        load /= max(1.0, SUMMITS_A_CELL[punch.pattern] * math.pi * punch.radius**2 / cell)
        radius, limit = summit_radius(punch), 0.5 * punch.wavelength
    else:
        radius, limit = math.inf, punch.radius
    if limit is None or radius == 0.0:
        return 0.0
    modulus = modulus_of(scene)
    for _ in range(20):
        depth = load / (2.0 * limit * modulus)
        if math.isfinite(radius):
            depth = max(depth, float(hertz.indentation(load, radius, modulus)))
        size = min(limit, math.sqrt(radius * depth))
        overlap = load / (math.pi * size**2) / law.overlap_stiffness
        # The punch moves by indentation and overlap.
        modulus = modulus_of(scene) * mean_kappa(scene, travel_time(scene, depth + overlap, scene.drive.preload))
    return overlap / (depth * softness_of_film(scene, size))


def range_follows_the_grid(scene: Scene) -> bool:
    """Whether the range of adhesion is automatic, so that it is shorter on a finer grid."""
    adhesion, grid, modulus = scene.adhesion, scene.grid, scene.substrate.contact_modulus
    q_ref = 2.0 * math.pi * grid.n / grid.length
    own = range_by_rule(adhesion, modulus, adhesion.range_factor, q_ref)
    return math.isclose(own, adhesion.range, rel_tol=1e-9)


def softness_of_film(scene: Scene, size: float) -> float:
    """G0 of the scene's film relative to that of a half-space, for a contact of this radius [m]: q = 1/a."""
    substrate = scene.substrate
    if math.isinf(substrate.thickness):
        return 1.0
    film = Film(substrate.youngs_modulus, substrate.poisson_ratio, substrate.thickness, substrate.base or BONDED)
    return float(film(1.0 / size, 0.0)) * substrate.contact_modulus / (2.0 * size)


def mean_kappa(scene: Scene, time: float) -> float:
    """E/E(0) for an indentation of this duration [s]: the mean of the relaxation function."""
    series = relaxation_of(scene)
    if not series.elements:
        return 1.0
    x = time / series.tau
    return 1.0 + float((series.kappa * -np.expm1(-x) / x).sum())


def image_stiffness(scene: Scene) -> float:
    """Stiffness of a film under the scene's punch in a periodic cell, relative to that of an infinite film.

    For a uniform pressure p on a disc of the contact's radius a, with the spectrum 2 pi a p J_1(qa)/q, the mean
    displacement of the disc is the sum (periodic) or the integral (infinite) of G0 times the square of the spectrum.
    """
    film, punch, length = compliance_of(scene), scene.punch, scene.grid.length
    radius = punch.radius
    if punch.pattern in ("sphere", "power"):
        radius = min(punch.outline, math.sqrt(punch.curvature_radius * depth_of(scene)))

    # Not at the top, because only checks of scenes with images need them.
    from scipy.integrate import simpson
    from scipy.special import j1

    def shape(q: np.ndarray) -> np.ndarray:
        x = np.maximum(q * radius, 1e-9)
        return (2.0 * j1(x) / x) ** 2

    index = 2.0 * math.pi / length * np.arange(-WAVES, WAVES + 1)
    qx, qy = np.meshgrid(index, index)
    q = np.hypot(qx, qy)
    inside = q <= index[-1]
    periodic = (film(qx, qy) * shape(q))[inside].sum() / length**2
    q = np.linspace(0.0, index[-1], 64 * WAVES + 1)[1:]
    alone = simpson(film(q, np.zeros_like(q)) * shape(q) * q, x=q) / (2.0 * math.pi)
    return float(alone / periodic)
