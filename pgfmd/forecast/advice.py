"""Warnings and remarks about a scene before it runs. No MPI."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from pgfmd.physics.adhesion.registry import length_of
from pgfmd.physics.drive import OVERSHOOT
from pgfmd.physics.topography import PATTERNS
from pgfmd.reference import jkr
from pgfmd.scene_objects import automatic_range, deepest_indentation, drive_of, relaxation_of
from pgfmd.schemes import registry
from pgfmd.units import handy_quantity as shown

from . import map_advice, plausibility
from .contact_advice import few_points, films, free_boundary, overlap, soft_overlap, summits
from .effort import effort_of, jump_threshold
from .estimate import depth_of, memory_of, modulus_of
from .indentation import punch_speeds

if TYPE_CHECKING:
    from pgfmd.scene import Scene

PINNING_SHARE = 0.5
"""Fraction of the automatic range below which lattice pinning spoils the result."""
FEWEST_POINTS = 8
"""Least number of grid points per wavelength."""
LONGEST_TURN = 5.0 * OVERSHOOT
"""Travel in a turn, in ranges of adhesion, from which on it influences the retraction."""
PRESSED_IN = 2.0
"""There is a warning if the start is deeper than the estimated depth at the preload by this factor."""
MANY_ROWS = 1e5
"""Number of rows of curve.csv, a hundred bytes each, above which there is a remark."""
GLASSY = 1e-2
"""The elastomer is glassy if rho/v is below this fraction of the shortest relaxation time."""
QUASI_STATIC = 1e3
"""A test is nearly quasi-static if rho/v is above this multiple of the longest retardation time."""


def warnings(scene: Scene, ranks: int = 1) -> Iterator[str]:
    """Warnings about anything that may spoil the result of a scene, or its run on `ranks` ranks."""
    for rule in (
        _range, _resolution, summits, overlap, _preload, _start, _turn, _speed, _images, films, _explicit_steps,
    ):  # fmt: skip
        yield from rule(scene)
    yield from _memory(scene, ranks)
    yield from plausibility.warnings(scene)
    yield from map_advice.warnings(scene)


def remarks(scene: Scene) -> Iterator[str]:
    """Remarks about a scene."""
    for rule in (_jumps, few_points, soft_overlap, _far_displacement, _quasi_static):
        yield from rule(scene)
    yield from registry.scheme_of(scene).remarks_on(scene)


def _range(scene: Scene) -> Iterator[str]:
    share, own = scene.adhesion.range / automatic_range(scene), automatic_range(scene)
    if not scene.adhesion.attractive or share > 0.999:
        return
    text = f"adhesion.range is {share:.2g} of the automatic range of this grid, {shown(own, 'length', 4)}: "
    if share < PINNING_SHARE:
        text += "rho too small for the grid, below half of the automatic range lattice pinning spoils the result; "
    else:
        text += "at the automatic range the mesh error is a percent or two, at half of it pinning spoils all; "
    yield text + f"use grid.n >= {math.ceil(scene.grid.n / share**2 * (1.0 - 1e-9))}, or a larger range"


def _resolution(scene: Scene) -> Iterator[str]:
    n, length = scene.grid.n, scene.grid.length
    wavelength = scene.punch.wavelength or scene.punch.shortest
    if wavelength is None:
        return
    # 1.5 mm over 150 um is a little more than 10 in binary.
    needed = math.ceil(FEWEST_POINTS * length / wavelength * (1.0 - 1e-9))
    if n < needed:
        which = ", the shortest of the face" if scene.punch.wavelength is None else ""
        yield (
            f"grid.n: only {wavelength * n / length:.3g} points a wavelength{which}, fewer than {FEWEST_POINTS} distort the "
            f"asperities; use n >= {needed}"
        )


def _start(scene: Scene) -> Iterator[str]:
    """Starts in contact beyond the preload. The contact is made instantaneously, with the modulus of short times."""
    drive, punch = scene.drive, scene.punch
    unknown = PATTERNS[punch.pattern].sampled or punch.radius is None or scene.substrate.compliance_file
    if drive.clearance >= 0.0 or unknown:
        return
    depth = _depth_at_once(scene)
    if -drive.clearance > PRESSED_IN * depth:
        yield (
            f"drive.clearance: the start, pressed in by {shown(-drive.clearance, 'length')}, is deeper than the "
            f"preload asks for, about {shown(depth, 'length', 2)} at once: the run will refuse it; raise drive.preload "
            "or start higher"
        )


def _depth_at_once(scene: Scene) -> float:
    """Approximate indentation [m] at the preload with the modulus of short times; infinite if unknown."""
    punch, adhesion, stiffening = scene.punch, scene.adhesion, relaxation_of(scene).kappa_inf
    if punch.pattern == "sphere" and adhesion.attractive:
        # Adhesion alone pulls a sphere in.
        contact = punch.curvature_radius, stiffening * modulus_of(scene), adhesion.work_of_adhesion
        radius = jkr.contact_radius_at_force(scene.drive.preload, *contact)
        return float(jkr.indentation(radius, *contact))
    if punch.pattern == "power":
        return math.inf if adhesion.attractive else depth_of(scene, stiffening)
    bow = 0.0 if punch.pattern == "sphere" else punch.outline**2 / (2.0 * punch.curvature_radius)
    return depth_of(scene, stiffening) + 2.0 * (punch.amplitude or 0.0) + bow


def _turn(scene: Scene) -> Iterator[str]:
    """Long turn times given by the scene."""
    # Of the punch, not of a machine with a spring.
    drive = replace(drive_of(scene), speed=scene.drive.speed, retract_speed=scene.drive.retract_speed)
    travels = {"goes on by": drive.overshoot}
    if not registry.scheme_of(scene).timeless:
        travels["comes back by"] = drive.rise
    what, travel = max(travels.items(), key=lambda item: item[1])
    attractive = scene.adhesion.attractive
    length = length_of(scene.adhesion)
    scale = length if attractive else max(depth_of(scene), length)
    if travel <= LONGEST_TURN * scale:
        return
    longest = drive.turn_time * OVERSHOOT * length / travel
    yield (
        f"drive.turn_time: within the turn the punch {what} {shown(travel, 'length')}, {travel / scale:.2g} "
        f"{'ranges of adhesion' if attractive else 'indentations'}: what happens there, perhaps the pull-off, does so "
        "below "
        f'the speed of the retraction; leave it out, or set at most "{longest:.2g} s"'
    )


def _preload(scene: Scene) -> Iterator[str]:
    """Preloads that a static punch in full contact would only reach at a very large indentation, if at all."""
    punch, substrate = scene.punch, scene.substrate
    if punch.radius is None or math.isfinite(substrate.thickness) or substrate.compliance_file:
        return
    deepest, depth = deepest_indentation(scene), depth_of(scene)
    if depth > deepest:
        yield (
            "drive.preload: even in full contact a static punch carries it only at an indentation of "
            f"{shown(depth, 'length')}, but an approach is given up at {shown(deepest, 'length')}; reduce the preload"
        )
    elif depth > 0.2 * punch.radius:
        yield (
            f"drive.preload: the indentation will be about {shown(depth, 'length')}, {depth / punch.radius:.2g} of the "
            "punch's radius; linear elasticity of small slopes does not hold there"
        )


def _speed(scene: Scene) -> Iterator[str]:
    series = relaxation_of(scene)
    passing = length_of(scene.adhesion) / max(punch_speeds(scene))
    if series.elements and passing < GLASSY * series.tau.min():
        yield (
            f"drive.speed, drive.retract_speed: the punch moves by rho in {passing:.2g} s, far below the shortest "
            f"relaxation time, {series.tau.min():.2g} s: bonds break before anything relaxes, as on a glass of modulus "
            "kappa_inf E*"
        )


def _images(scene: Scene) -> Iterator[str]:
    radius, length = scene.punch.radius, scene.grid.length
    if scene.substrate.boundary == "periodic" and radius is not None and length < 3.0 * radius:
        yield (
            f"grid.length is only {length / radius:.3g} punch radii: the periodic images carry part of the load; "
            f"the paper has 4.{free_boundary(scene)}"
        )


def _explicit_steps(scene: Scene) -> Iterator[str]:
    """The number of explicit steps, which is large and known exactly."""
    if not registry.scheme_of(scene).explicit:
        return
    steps = effort_of(scene).steps
    if steps > 0.8 * scene.solver.max_steps:
        allowed = scene.solver.max_steps
        yield f"solver.max_steps: about {steps:.2g} steps are to come, only {allowed} are allowed; raise it"
    if steps / scene.output.every > MANY_ROWS:
        every = 10 ** math.ceil(math.log10(steps / MANY_ROWS))
        yield f"output.every: about {steps / scene.output.every:.2g} rows are to come in curve.csv; set it to {every}"


def _memory(scene: Scene, ranks: int) -> Iterator[str]:
    needed = memory_of(scene, ranks).in_all(ranks)
    present = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    if needed > 0.9 * present:
        yield f"memory: {needed / 1e9:.3g} GB are needed in all, this machine has {present / 1e9:.3g} GB"


def _jumps(scene: Scene) -> Iterator[str]:
    series, least = relaxation_of(scene), jump_threshold(scene)
    scheme = registry.scheme_of(scene)
    if scheme.jumps and scene.adhesion.attractive and series.kappa_inf < least:
        state = "quasi-static" if scheme.timeless else "elastic"
        what = (
            f"kappa_inf = {series.kappa_inf:.4g} is below {least:.3g}" if series.elements else f"the scene is {state}"
        )
        yield (
            f"jumps: {what} (flat punches: 0.38 n at the automatic range), so the surface may jump in zero time; "
            "jumps are listed in events.csv with the energy they release"
        )


def _far_displacement(scene: Scene) -> Iterator[str]:
    if scene.substrate.boundary == "periodic" and scene.punch.radius is not None:
        yield (
            "periodic cell: the far displacement u_inf is extrapolated; for a flat punch and L = 4a it is about 11 % "
            f"off that of a free surface.{free_boundary(scene)}"
        )


def _quasi_static(scene: Scene) -> Iterator[str]:
    series = relaxation_of(scene)
    passing = length_of(scene.adhesion) / max(punch_speeds(scene))
    if series.elements and passing > QUASI_STATIC * series.to_creep().retardation_times.max():
        yield f"speed: rho/v = {passing:.2g} s is {QUASI_STATIC:.0f} longest retardation times: nearly quasi-static"
