"""What to warn of where the grid, the law or the cell cannot do justice to a contact. No MPI.

Each rule is a generator of texts for `advice.warnings` or `advice.remarks`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from .resolution import image_stiffness, overlap_share, summit_points

FEW_SUMMIT_POINTS = 12.0
"""Grid points of a summit within the range below which pull-off forces are wrong by more than a third (docs:
resolution)."""
SOME_SUMMIT_POINTS = 50.0
"""Grid points of a summit within the range below which pull-off forces are wrong by more than a tenth."""
SOFT_OVERLAP = 0.05
"""Overlap, relative to the indentation, from which on it is remarked."""
SOFT_WALL = 0.01
"""Overlap, relative to the indentation, that is warned of without attraction: a wall should be hard."""
SOFT_ADHESION = 0.2
"""Overlap, relative to the indentation, that is warned of with attraction."""
IMAGES_OF_FILM = 0.05
"""Influence of a film's periodic images on the stiffness of a contact that is warned of."""


def summits(scene) -> Iterator[str]:
    """Summits whose height the grid cannot resolve within the range: whole cells pull at once."""
    points = summit_points(scene)
    if points >= FEW_SUMMIT_POINTS:
        return
    # The automatic range falls with the square root of the spacing: more than enough for a range of its own.
    needed = math.ceil(scene.grid.n * (FEW_SUMMIT_POINTS / points) ** (2.0 / 3.0))
    if scene.adhesion.law != "cosine":
        yield (
            f"grid.n: only {points:.2g} grid points of the punch reach below the surface at the preload, too few for its "
            f"shape to count; use n >= {needed}, or a larger preload"
        )
        return
    times = 2.0 * math.pi / points
    wrong = f"up to {times:.2g} times too large" if times > 2.0 else "wrong by more than a third"
    yield (
        f"grid.n, adhesion.range: only {points:.2g} grid points lie within the range of adhesion, "
        f"{scene.adhesion.range * 1e6:.3g} um, of the height of a summit: whole cells of the grid snap, and pull-off forces "
        f"are {wrong}; use n >= {needed}, or a larger range"
    )


def few_points(scene) -> Iterator[str]:
    points = summit_points(scene)
    if scene.adhesion.law == "cosine" and FEW_SUMMIT_POINTS <= points < SOME_SUMMIT_POINTS:
        yield (
            f"summits: {points:.2g} grid points lie within the range of adhesion of the height of a summit; with fewer than "
            f"{SOME_SUMMIT_POINTS:.0f} the pull-off force of a single summit is wrong by 10 to 30 %"
        )


def overlap(scene) -> Iterator[str]:
    share, repulsive = overlap_share(scene), scene.adhesion.law == "repulsive"
    most = SOFT_WALL if repulsive else SOFT_ADHESION
    if share <= most:
        return
    text = (
        f"adhesion: at the preload punch and elastomer will overlap by about {100 * share:.0f} % of the indentation, as "
        "the law's stiffness follows from the static modulus and the range; indentations are too large by up to as much. "
    )
    reach = scene.adhesion.range * math.sqrt(most / share)
    if repulsive:
        yield text + f"Set adhesion.range to {reach * 1e6:.2g} um or less, or range_factor {share / most:.2g} times larger"
    else:
        yield text + f"Use grid.n >= {math.ceil(scene.grid.n * share / most)}, or a smaller preload"


def soft_overlap(scene) -> Iterator[str]:
    share = overlap_share(scene)
    if scene.adhesion.law == "cosine" and SOFT_OVERLAP < share <= SOFT_ADHESION:
        yield (
            f"overlap: at the preload punch and elastomer will overlap by about {100 * share:.0f} % of the indentation; a "
            "finer grid, with its shorter range, makes it less"
        )


def films(scene) -> Iterator[str]:
    """Films that their periodic images, or their edges, make others than a film without end."""
    substrate, radius, spacing = scene.substrate, scene.punch.radius, scene.grid.length / scene.grid.n
    if not math.isfinite(substrate.thickness):
        return
    if substrate.thickness < spacing:
        yield (
            f"substrate.thickness: the film is thinner than the grid's spacing, {spacing * 1e6:.3g} um, and stresses at the "
            f"edge of a contact fall off within its thickness; use grid.n >= "
            f"{math.ceil(scene.grid.length / substrate.thickness)}"
        )
    if substrate.boundary != "periodic" or radius is None:
        return
    share = image_stiffness(scene)
    if abs(share - 1.0) > IMAGES_OF_FILM:
        yield (
            f"substrate.thickness, grid.length: in a periodic cell the film is about {share:.2g} times as stiff under the "
            "punch as one that goes on without other punches, as their images press it too and it cannot escape to the "
            f"sides; compare thickness and cell, {substrate.thickness / scene.grid.length:.2g}.{free_boundary(scene)}"
        )


def free_boundary(scene) -> str:
    """What a free boundary offers to a scheme that can have one."""
    if scene.solver.scheme == "gfmd":
        return ""
    return ' substrate.boundary = "free" has no images, needs no such correction and costs the same'
