"""What to warn of where the grid, the law or the cell cannot do justice to a contact. No MPI.

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
"""Overlap relative to the indentation that is remarked on where the law attracts."""
SOFT_ADHESION = 0.2
"""Overlap that is warned of where the law attracts."""
SOFT_WALL = 0.01
"""Overlap that is warned of where it does not: a wall alone should be hard."""
IMAGES_OF_FILM = 0.05
"""Influence of a film's periodic images on the stiffness of a contact that is warned of."""


def summits(scene: Scene) -> Iterator[str]:
    """Summits whose height the grid cannot resolve within the range: whole cells pull at once."""
    points = summit_points(scene)
    if points >= FEW_SUMMIT_POINTS:
        return
    # The automatic range falls with the square root of the spacing: more than enough for a range of its own.
    needed = math.ceil(scene.grid.n * (FEW_SUMMIT_POINTS / points) ** (2.0 / 3.0))
    if scene.adhesion.law != "cosine":
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
    if scene.adhesion.law == "cosine" and FEW_SUMMIT_POINTS <= points < SOME_SUMMIT_POINTS:
        yield (
            f"summits: {points:.2g} grid points lie within the range of adhesion of the height of a summit; with fewer "
            f"than {SOME_SUMMIT_POINTS:.0f} the pull-off force of a single summit is wrong by 10 to 30 %"
        )


def overlap(scene: Scene) -> Iterator[str]:
    share, repulsive = overlap_share(scene), scene.adhesion.law == "repulsive"
    most = SOFT_WALL if repulsive else SOFT_ADHESION
    if share <= most:
        return
    text = (
        f"adhesion: at the preload punch and elastomer will overlap by about {100 * share:.3g} % of the indentation, "
        "as the law's stiffness follows from the static modulus and the range; indentations are too large by up to as "
        "much. "
    )
    # A little less than would just do, as it is rounded.
    shorter = f"{shown(0.95 * scene.adhesion.range * math.sqrt(most / share), 'length', 2)} or less"
    if repulsive:
        yield text + f"Set adhesion.range to {shorter}, or range_factor {1.05 * share / most:.2g} times larger"
    elif range_follows_the_grid(scene):
        yield text + f"Use grid.n >= {math.ceil(scene.grid.n * share / most)}"
    else:
        yield text + f"Set adhesion.range to {shorter}, with the finer grid that this needs"


def soft_overlap(scene: Scene) -> Iterator[str]:
    share = overlap_share(scene)
    if scene.adhesion.law == "cosine" and SOFT_OVERLAP < share <= SOFT_ADHESION:
        cure = "a finer grid, with its shorter range," if range_follows_the_grid(scene) else "a shorter adhesion.range"
        yield (
            f"overlap: at the preload punch and elastomer will overlap by about {100 * share:.3g} % of the "
            f"indentation; {cure} makes it less"
        )


def films(scene: Scene) -> Iterator[str]:
    """Films that their periodic images, or their edges, make others than a film without end."""
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
    """What a free boundary offers to a scheme that can have one."""
    if registry.scheme_of(scene).periodic_only:
        return ""
    return ' substrate.boundary = "free" has no images, needs no such correction and costs the same'
