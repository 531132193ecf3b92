"""Warnings about contacts that grid, law or cell do not represent well. No MPI.

Each rule is a generator of texts for `advice.warnings` or `advice.remarks`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

from pgfmd.schemes import registry
from pgfmd.units import handy_quantity as shown

from .resolution import image_stiffness, overlap_share, range_follows_the_grid, summit_points

if TYPE_CHECKING:
    from pgfmd.scene import Scene

FEW_SUMMIT_POINTS = 12.0
"""Grid points of a summit within the range below which pull-off forces are wrong by more than a third (docs:
resolution)."""
SOME_SUMMIT_POINTS = 50.0
"""Grid points of a summit within the range below which pull-off forces are wrong by more than a tenth."""
SOFT_OVERLAP = 0.05
"""Overlap relative to the indentation above which there is a remark, for attractive laws."""
SOFT_ADHESION = 0.2
"""Overlap relative to the indentation above which there is a warning, for attractive laws."""
SOFT_WALL = 0.01
"""The same for repulsive laws, which represent a hard wall."""
IMAGES_OF_FILM = 0.05
"""Influence of a film's periodic images on the contact stiffness above which there is a warning."""


def summits(scene: Scene) -> Iterator[str]:
    """Summits that the grid does not resolve within the range of adhesion: whole grid cells snap."""
    points = summit_points(scene)
    if points >= FEW_SUMMIT_POINTS:
        return
    # The automatic range decreases with the square root of the spacing; this is enough for any range.
    needed = math.ceil(scene.grid.n * (FEW_SUMMIT_POINTS / points) ** (2.0 / 3.0))
    if not scene.adhesion.attractive:
        yield (
            f"grid.n: only {points:.2g} grid points of the punch reach below the surface at the preload, too few for "
            f"its shape to count; use n >= {needed}, or a larger preload"
        )
        return
    times = 2.0 * math.pi / points
    wrong = f"up to {times:.2g} times too large" if times > 2.0 else "wrong by more than a third"
    yield (
        f"grid.n, adhesion.range: only {points:.2g} grid points lie within the range of adhesion, "
        f"{shown(scene.adhesion.range, 'length')}, of the height of a summit: whole cells of the grid snap, and "
        f"pull-off forces are {wrong}; use n >= {needed}, or a larger range"
    )


def few_points(scene: Scene) -> Iterator[str]:
    points = summit_points(scene)
    if scene.adhesion.attractive and FEW_SUMMIT_POINTS <= points < SOME_SUMMIT_POINTS:
        yield (
            f"summits: {points:.2g} grid points lie within the range of adhesion of the height of a summit; with fewer "
            f"than {SOME_SUMMIT_POINTS:.0f} the pull-off force of a single summit is wrong by 10 to 30 %"
        )


def overlap(scene: Scene) -> Iterator[str]:
    share, attractive = overlap_share(scene), scene.adhesion.attractive
    most = SOFT_ADHESION if attractive else SOFT_WALL
    if share <= most:
        return
    follows = "follows from the static modulus and the range"
    if scene.adhesion.overlap_stiffness is not None:
        follows = "of overlaps is given"
    text = (
        f"adhesion: at the preload punch and elastomer will overlap by about {100 * share:.3g} % of the indentation, "
        f"as the law's stiffness {follows}; indentations are too large by up to as "
        "much. "
    )
    # Slightly less than necessary, because of rounding.
    shorter = f"{shown(0.95 * scene.adhesion.range * math.sqrt(most / share), 'length', 2)} or less"
    if scene.adhesion.overlap_stiffness is not None:
        stiffer = shown(1.05 * scene.adhesion.overlap_stiffness * share / most, "stiffness per area", 2)
        yield text + f"Raise adhesion.overlap_stiffness to {stiffer}"
    elif not attractive:
        yield text + f"Set adhesion.range to {shorter}, or range_factor {1.05 * share / most:.2g} times larger"
    elif range_follows_the_grid(scene):
        yield text + f"Use grid.n >= {math.ceil(scene.grid.n * share / most)}"
    else:
        yield text + f"Set adhesion.range to {shorter}, with the finer grid that this needs"


def soft_overlap(scene: Scene) -> Iterator[str]:
    share = overlap_share(scene)
    if scene.adhesion.attractive and SOFT_OVERLAP < share <= SOFT_ADHESION:
        cure = "a finer grid, with its shorter range," if range_follows_the_grid(scene) else "a shorter adhesion.range"
        yield (
            f"overlap: at the preload punch and elastomer will overlap by about {100 * share:.3g} % of the "
            f"indentation; {cure} makes it less"
        )


def films(scene: Scene) -> Iterator[str]:
    """Films that differ from an infinite film because of periodic images or a coarse grid."""
    substrate, radius, spacing = scene.substrate, scene.punch.radius, scene.grid.length / scene.grid.n
    if not math.isfinite(substrate.thickness):
        return
    if substrate.thickness < spacing:
        yield (
            f"substrate.thickness: the film is thinner than the grid's spacing, {shown(spacing, 'length')}, and "
            "stresses at the edge of a contact fall off within its thickness; use grid.n >= "
            f"{math.ceil(scene.grid.length / substrate.thickness)}"
        )
    if substrate.boundary != "periodic" or radius is None:
        return
    share = image_stiffness(scene)
    if abs(share - 1.0) > IMAGES_OF_FILM:
        yield (
            f"substrate.thickness, grid.length: in a periodic cell the film is about {share:.2g} times as stiff under "
            "the punch as one that goes on without other punches, as their images press it too and it cannot escape "
            "to the sides; compare thickness and cell, "
            f"{substrate.thickness / scene.grid.length:.2g}.{free_boundary(scene)}"
        )


def free_boundary(scene: Scene) -> str:
    """Advice to use a free boundary, for schemes that support it."""
    if registry.scheme_of(scene).periodic_only:
        return ""
    return ' substrate.boundary = "free" has no images, needs no such correction and costs the same'
