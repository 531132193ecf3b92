"""The contact radius of a sticky sphere over whole loops, against JKR, Maugis and rings; what counts as contact."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.reference import jkr, maugis
from pgfmd.reference.cohesive_sphere import Equilibrium, equilibrium
from tests.physics.contact import ABOUT, SPHERE, TENSION, Path, range_at, sphere_loop
from tests.physics.runs import CONTACT_MODULUS, WORK_OF_ADHESION

from .drawing import GREY, Line, chosen, closed, convergence, number, order, ours, panels, triangle

MILLI, MICRO = 1e3, 1e6
UNLOADING, LOADING = ("turn", "retract"), ("approach",)

LOOPS = {
    0.5: (128, 480e-6, 1e-3),
    1.0: (192, 420e-6, 1e-3),
    1.8: (448, 420e-6, 1.6e-3),
    2.5: (340, 330e-6, 0.1e-3),
}
"""Tabor number -> points across the cell, radius [m] of the punch, preload [N]. The spacing is 0.03 to 0.2 of
a cohesive zone rho^2 E*/w: the automatic range has 0.2, and pins the rim a little."""
QUICK = {0.5: (48, 480e-6, 1e-3), 1.0: (96, 420e-6, 1e-3)}


@cache
def _loop(tabor: float, quick: bool, *overrides: str) -> Path:
    n, outline, preload = (QUICK if quick else LOOPS)[tabor]
    return sphere_loop(tabor, n, *overrides, outline=outline, preload=preload)


@cache
def _rings(tabor: float) -> tuple[Equilibrium, ...]:
    """Equilibria of the same law by rings, from small contacts to large ones."""
    law = Cosine(WORK_OF_ADHESION, range_at(tabor))
    radii = np.linspace(110e-6, 345e-6, 18)
    return tuple(equilibrium(float(a), law.contact_gap, SPHERE, CONTACT_MODULUS, law) for a in radii)


def _ring_curve(tabor: float) -> np.ndarray:
    """Indentation [m], force [N] and contact radius [m] (3, k) by rings, on the branch stable at a given height."""
    gap = 0.5 * range_at(tabor)
    curve = np.array([(one.indentation, one.force, one.radius_within(gap)) for one in _rings(tabor)]).T
    return curve[:, int(np.argmin(curve[0])) :]


def _strength(tabor: float) -> float:
    """Largest traction [Pa] of the law: a Dugdale stress of equal strength and work reaches to 2/pi of the range."""
    return Cosine(WORK_OF_ADHESION, range_at(tabor)).strength


def _held(path: Path, phases: tuple[str, ...], tabor: float) -> np.ndarray:
    """The steps of these phases where rings have a stable state."""
    depth, _, _ = _ring_curve(tabor)
    return np.flatnonzero(
        path.within(*phases) & (path.contact > 0) & (path.depth > depth[0]) & (path.depth < depth[-1])
    )


def loops(quick: bool):
    """Contact radius against force over whole loops, with JKR and Maugis's two radii."""
    figure, axes = panels()
    tabors = tuple(QUICK) if quick else (1.0, 1.8)
    for axis, tabor in zip(axes, tabors, strict=True):
        _draw_loop(axis, _loop(tabor, quick), tabor)
    lines = [line for tabor in (QUICK if quick else LOOPS) for line in _compared(_loop(tabor, quick), tabor)]
    return figure, lines + _images(quick)


def errors(quick: bool):
    """Error of the contact radius over whole loops, and how it vanishes with the range; the same law by rings."""
    figure, (left, right) = panels()
    for index, tabor in enumerate(QUICK if quick else LOOPS):
        path = _loop(tabor, quick)
        depth, force, radius = _ring_curve(tabor)
        for marker, phases, label in (("o", LOADING, None), ("s", UNLOADING, f"Tabor number {tabor:g}")):
            some = _held(path, phases, tabor)
            some = some[np.argsort(path.depth[some])]
            some = some[chosen(path.depth[some], 14)]
            reference = jkr.contact_radius_at_indentation(path.depth[some], *ABOUT)
            error = 100 * (path.radius()[some] / reference - 1)
            ours(left, path.force[some] / TENSION, error, index, marker=marker, ms=3.2, label=label)
        by_rings = 100 * (radius / jkr.contact_radius_at_indentation(depth, *ABOUT) - 1)
        seen = by_rings < 32
        closed(left, force[seen] / TENSION, by_rings[seen], index, lw=0.9)
    left.axhline(0.0, color="black", lw=0.8)
    left.set(xlabel=r"force [$\pi w R$]", ylabel="radius against JKR [%]", ylim=(-1, 30))
    left.set_title("same height; lines: the same law on rings")
    left.legend()
    return figure, _vanishing_range(right, quick)


def _draw_loop(axis, path: Path, tabor: float) -> None:
    radii = np.linspace(110e-6, 340e-6, 300)
    closed(axis, jkr.force(radii, *ABOUT) / TENSION, radii * MICRO, color="black", label="JKR")
    angles = np.arctan(np.geomspace(1e-4, 1e2, 800))
    states = maugis.states(angles, *ABOUT, _strength(tabor))
    for name, style, label in (("contact_radius", ":", "Maugis, $a$"), ("outer_radius", "--", "Maugis, $c$")):
        radius = getattr(states, name)
        seen = (radius > 110e-6) & (radius < 340e-6)
        closed(axis, states.force[seen] / TENSION, radius[seen] * MICRO, 3, ls=style, label=label)
    for index, (phases, area, label) in enumerate(
        ((LOADING, "contact", "loading"), (UNLOADING, "contact", "unloading"), (UNLOADING, "overlap", "gap < 0"))
    ):
        some = np.flatnonzero(path.within(*phases) & (path.radius(area) > 90e-6) & (path.force < 1.1 * 1e-3))
        order_of = np.argsort(path.depth[some])
        few = some[order_of[chosen(path.depth[some][order_of], 16)]]
        ours(axis, path.force[few] / TENSION, path.radius(area)[few] * MICRO, index, label=label, ms=3.5)
    axis.set(xlabel=r"force [$\pi w R$]", ylabel="radius [µm]", ylim=(80, 360))
    axis.set_title(f"Tabor number {tabor:g}")
    axis.legend()


def _nearest_to(path: Path, phases: tuple[str, ...], force: float) -> int:
    """The step of these phases with a force [N] nearest to the given one."""
    some = np.flatnonzero(path.within(*phases) & (path.contact > 0))
    return int(some[np.argmin(np.abs(path.force[some] - force))])


def _compared(path: Path, tabor: float) -> list[Line]:
    """Rows of the table: near no force on the way back, at the largest tension, and the whole loop against rings."""
    n, text = path.scene.grid.n, f"Tabor number {tabor:g}, n = "
    depth, _, radius = _ring_curve(tabor)
    lines, at_rest = [], _nearest_to(path, UNLOADING, 0.0)
    found, shown = path.radius()[at_rest], f"{text}{n}, {number(path.force[at_rest] * MILLI)} mN"
    references = {
        "JKR, same force": jkr.contact_radius_at_force(path.force[at_rest], *ABOUT),
        "JKR, same height": jkr.contact_radius_at_indentation(path.depth[at_rest], *ABOUT),
        "Maugis's c, same height": maugis.state_at(
            *ABOUT, _strength(tabor), indentation=path.depth[at_rest]
        ).outer_radius,
        "rings, same height": np.interp(path.depth[at_rest], depth, radius),
    }
    for name, value in references.items():
        lines.append(Line(f"contact radius [µm]; {name}", shown, float(value) * MICRO, found * MICRO))
    far = int(np.argmin(np.where(path.within(*UNLOADING), path.force, 0.0)))
    tension = number(path.force[far] / TENSION)
    value = jkr.contact_radius_at_indentation(path.depth[far], *ABOUT)
    settings = f"{text}{n}, largest tension {tension} pi w R"
    lines.append(Line("contact radius [µm]; JKR, same height", settings, value * MICRO, path.radius()[far] * MICRO))
    for phases, name in ((LOADING, "loading"), (UNLOADING, "unloading")):
        some = _held(path, phases, tabor)
        apart = path.radius()[some] / np.interp(path.depth[some], depth, radius) - 1
        what = f"radius against rings, {name}: root mean square"
        lines.append(Line(what, f"{text}{n}", 0.0, float(np.sqrt(np.mean(apart**2)))))
    return lines


def _images(quick: bool) -> list[Line]:
    """What the images of a periodic cell of four punch radii do to the radius on the way back, at Tabor number 1."""
    tabor = 1.0
    depth, force, radius = _ring_curve(tabor)
    # From the largest tension on, force and height grow with the radius.
    last = int(np.argmin(force))
    lines = []
    for boundary in ("free", "periodic"):
        path = _loop(tabor, quick, *(() if boundary == "free" else ("substrate.boundary=periodic",)))
        some = _held(path, UNLOADING, tabor)
        some = some[(path.radius()[some] > radius[last]) & (path.force[some] > 0.98 * force[last])]
        settings = f"Tabor number {tabor:g}, n = {path.scene.grid.n}, {boundary}"
        for name, given, curve in (("force", path.force, force), ("height", path.depth, depth)):
            apart = path.radius()[some] / np.interp(given[some], curve[last:], radius[last:]) - 1
            what = f"radius against rings, same {name}: root mean square"
            lines.append(Line(what, settings, 0.0, float(np.sqrt(np.mean(apart**2)))))
    return lines


def _at_rest(tabor: float, rings_per_zone: int) -> tuple[float, Equilibrium]:
    """Contact radius [m] and equilibrium without a force, by rings, to 1 % of pi w R."""
    law, radius = Cosine(WORK_OF_ADHESION, range_at(tabor)), 300e-6
    for _ in range(8):
        found = equilibrium(radius, law.contact_gap, SPHERE, CONTACT_MODULUS, law, rings_per_zone)
        if abs(found.force) < 0.01 * TENSION:
            return radius, found
        # JKR's slope at no force is near enough to come there in two or three steps.
        radius -= found.force / (jkr.force(301e-6, *ABOUT) - jkr.force(300e-6, *ABOUT)) * 1e-6
    raise ArithmeticError(f"no equilibrium without a force at Tabor number {tabor:g}")


def _vanishing_range(axis, quick: bool) -> list[Line]:
    """By rings, ever shorter ranges, without a force; beside it pgfmd on the way back near no force."""
    tabors = np.array([0.5, 1.0, 2.0] if quick else [0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0])
    same_force, same_height, overlap = [], [], []
    for tabor in tabors:
        radius, found = _at_rest(tabor, 32 if quick else 64)
        height = float(jkr.contact_radius_at_indentation(found.indentation, *ABOUT))
        same_force.append(radius / float(jkr.contact_radius_at_force(found.force, *ABOUT)) - 1)
        same_height.append(radius / height - 1)
        overlap.append(1 - found.radius_within(0.0) / height)
    ranges = np.array([range_at(tabor) for tabor in tabors]) * MICRO
    closed(axis, ranges, same_force, 0, label="same force")
    closed(axis, ranges, same_height, 1, label="same height")
    closed(axis, ranges, overlap, color=GREY, label="gap < 0, too small")
    ran, errors = [], []
    for tabor in QUICK if quick else LOOPS:
        path = _loop(tabor, quick)
        at = _nearest_to(path, UNLOADING, 0.0)
        ran.append(range_at(tabor) * MICRO)
        by_force = jkr.contact_radius_at_force(path.force[at], *ABOUT)
        by_height = jkr.contact_radius_at_indentation(path.depth[at], *ABOUT)
        errors.append([path.radius()[at] / by_force - 1, path.radius()[at] / by_height - 1])
    for index, column in enumerate(np.array(errors).T):
        convergence(axis, ran, column, index, ls="none", label=None if index else "pgfmd")
    axis.set_xticks(ran, [f"{reach:.2g}" for reach in ran])
    limit = 1 - float(jkr.compressed_radius(height, *ABOUT)) / height
    axis.axhline(limit, color=GREY, lw=0.8, ls=":")
    triangle(axis, 1.2, 2.4, 0.018, 1.5)
    axis.set(xlabel="range [µm]", ylabel="|error| of the radius near no force")
    axis.set_title("the range vanishes")
    axis.legend(loc="lower right")
    ends, what = [-3, -1], "order of the radius in the range"
    settings = f"rings, no force, Tabor numbers {tabors[-3]:g} to {tabors[-1]:g}"
    shortest = f"rings, no force, Tabor number {tabors[-1]:g}"
    return [
        Line(f"{what}; same force", settings, math.nan, order(ranges[ends], np.take(same_force, ends))),
        Line(f"{what}; same height", settings, math.nan, order(ranges[ends], np.take(same_height, ends))),
        Line("contact radius [µm]; JKR, same height", shortest, height * MICRO, radius * MICRO),
        Line("radius of gap < 0 over JKR's radius; its pressed part", shortest, 1 - limit, 1 - overlap[-1]),
    ]


FORCES = (1.456e-3, 0.056e-3, -1.073e-3)
"""Forces [N] of the table of what counts as contact; the largest tension comes last."""
COUNTS = (("gap < 0", "overlap"), ("gap < range/2", "contact"), ("gap < range", "near"))


def definition(quick: bool):
    """What counts as contact: three radii of the same states of a sphere on the way back, and JKR's."""
    tabor = 1.0 if quick else 1.8
    path = _loop(tabor, quick)
    figure, (left, right) = panels()
    back = np.flatnonzero(path.within(*UNLOADING) & (path.overlap > 0))
    reference = jkr.contact_radius_at_indentation(path.depth[back], *ABOUT)
    back, reference = back[np.isfinite(reference)], reference[np.isfinite(reference)]
    closed(left, path.depth[back] * MICRO, reference * MICRO, color="black", label="JKR")
    closed(
        left, path.depth[back] * MICRO, jkr.compressed_radius(reference, *ABOUT) * MICRO, color="black", ls=":",
        label="its pressed part",
    )  # fmt: skip
    few = chosen(-path.depth[back], 16)
    for index, (label, area) in enumerate(COUNTS):
        radius = path.radius(area)[back]
        ours(left, path.depth[back][few] * MICRO, radius[few] * MICRO, index, label=label, ms=3.5)
        ours(right, path.depth[back][few] * MICRO, 100 * (radius / reference - 1)[few], index, ls="-", lw=0.7, ms=3.5)
    left.set(xlabel="indentation [µm]", ylabel="radius [µm]", ylim=(0, None))
    left.set_title(f"sticky sphere on the way back, Tabor number {tabor:g}")
    left.legend(loc="lower right")
    right.axhline(0.0, color="black", lw=0.8)
    right.set(xlabel="indentation [µm]", ylabel="against JKR's radius [%]", ylim=(-80, 20))
    right.set_title("error")
    return figure, _rows(path)


def _rows(path: Path) -> list[Line]:
    """Radii at the forces of the table; at the largest tension JKR's is that of the same height."""
    lines = []
    tension = int(np.argmin(np.where(path.within(*UNLOADING), path.force, 0.0)))
    for force in (*FORCES, None):
        if force is None:
            radii = [path.radius(area)[tension] for _, area in COUNTS]
            closed_form = float(jkr.contact_radius_at_indentation(path.depth[tension], *ABOUT))
            settings = f"{number(path.force[tension] * MILLI, 4)} mN (largest tension)"
        else:
            some = np.flatnonzero(path.within(*UNLOADING))
            some = some[np.argsort(path.force[some])]
            stable = some[path.depth[some] > path.depth[tension]]
            if force > path.force[stable].max():
                continue
            radii = [float(np.interp(force, path.force[stable], path.radius(area)[stable])) for _, area in COUNTS]
            closed_form = float(jkr.contact_radius_at_force(force, *ABOUT))
            settings = f"{number(force * MILLI, 4)} mN"
        for (label, _), radius in zip(COUNTS, radii, strict=True):
            lines.append(Line(f"radius of {label} [µm]", settings, closed_form * MICRO, radius * MICRO))
    return lines
