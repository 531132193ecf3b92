"""A smooth flat punch: stiffness, Kendall's pull-off, work of separation, films on a rigid base."""

from __future__ import annotations

import math

import numpy as np

from pgfmd.physics.film import Film
from pgfmd.reference import film, flat_punch
from tests.physics.runs import CONTACT_MODULUS, RADIUS, RIGID, WORK_OF_ADHESION, pull, run

from .drawing import Line, chosen, closed, convergence, order, ours, panels, triangle

MILLI, MICRO, NANO = 1e3, 1e6, 1e9
PRESSED = (*RIGID, "solver.accuracy=1e-3", "drive.preload=1 mN")
KENDALL = flat_punch.pull_off_force(RADIUS, CONTACT_MODULUS, WORK_OF_ADHESION)
WORK = flat_punch.work_of_separation(RADIUS, WORK_OF_ADHESION)
SLOW, FAST = 1e-8, 10.0
"""Speeds [m/s] at which the punch moves by its range in 4e5 and in 4e-4 relaxation times."""


def stiffness(quick: bool):
    """Stiffness 2 a E* of a flat punch pressed on a half-space, without adhesion, and the pressure under it."""
    sizes = (32, 64) if quick else (32, 64, 128, 256)
    figure, (left, right) = panels()
    lines, deficits, by_area = [], [], []
    for n in sizes:
        result = run("flat-punch", *PRESSED, f"grid.n={n}")
        points = result.simulation.points
        covered = math.sqrt(points.total / math.pi) * result.spacing
        found = result.contact_stiffness()
        deficits.append(found / (2 * RADIUS * CONTACT_MODULUS) - 1)
        by_area.append(found / (2 * covered * CONTACT_MODULUS) - 1)
        lines.append(Line("stiffness [N/m]", f"n = {n}", 2 * RADIUS * CONTACT_MODULUS, found))
    settings = f"n = {sizes[-2]}, {sizes[-1]}, radius of equal area"
    lines.append(Line("order in the spacing", settings, 1.0, -order(sizes, by_area)))
    x, y = points.coordinates()
    distance, depth = np.hypot(x, y), -result.preload_position
    sorted_points = np.argsort(distance)
    some = sorted_points[chosen(distance[sorted_points], 30)]
    line = np.linspace(0.0, 0.995, 400) * RADIUS
    closed(left, line * MICRO, flat_punch.pressure(line, depth, RADIUS, CONTACT_MODULUS) / 1e3, label="closed form")
    ours(left, distance[some] * MICRO, -result.preloaded[some] / 1e3, label=f"n = {sizes[-1]}")
    left.set(xlabel="distance from the axis [µm]", ylabel="pressure [kPa]")
    left.set_title(f"flat punch under 1 mN, stiffness {lines[-2].shown_error}")
    left.legend()
    convergence(right, sizes, deficits, 0, label=r"against $2aE^*$")
    convergence(right, sizes, by_area, 1, label="$a$ of the grid's area")
    triangle(right, sizes[-2], sizes[-1], 0.5 * min(np.abs(by_area + deficits)), -1)
    right.set(xlabel="n", ylabel="|error| of the stiffness")
    right.set_title("first order in the spacing: stiffness of the overlap")
    right.legend()
    return figure, lines


def kendall(quick: bool):
    """Pull-off of a flat punch from an elastic half-space: Kendall's force, and the energy that the jump releases."""
    sizes = (32, 64) if quick else (32, 64, 128, 256)
    figure, (left, right) = panels()
    lines = []
    depth = np.array([flat_punch.pull_off_indentation(RADIUS, CONTACT_MODULUS, WORK_OF_ADHESION), 1.5e-6])
    force = flat_punch.force(depth, RADIUS, CONTACT_MODULUS)
    closed(left, depth * MICRO, force * MILLI, color="black", label="Kendall")
    left.plot([depth[0] * MICRO] * 2, [KENDALL * MILLI, 0.0], color="black", lw=0.8, ls=":")
    for index, factor in enumerate((0.05, 0.156)):
        errors, ranges = [], []
        for n in sizes:
            result = run("flat-punch", "rheology.model=elastic", f"grid.n={n}", f"adhesion.range_factor={factor}")
            ranges.append(result.scene.adhesion.range * MICRO)
            errors.append(result.state.pull_off_force / KENDALL - 1)
            settings = f"n = {n}, range_factor = {factor}, range {ranges[-1]:.2f} µm"
            lines.append(Line("pull-off force [mN]", settings, KENDALL * MILLI, result.state.pull_off_force * MILLI))
        released = max(row.released for row in result.jumps if row.phase == "retract")
        lines.append(Line("released in the last jump [nJ]", settings, 0.5 * WORK * NANO, released * NANO))
        lines.append(Line("work of separation [nJ]", settings, WORK * NANO, result.work_of_separation() * NANO))
        settings = f"range_factor = {factor}, n = {sizes[0]} to {sizes[-1]}"
        fitted = np.polyfit(np.log(ranges), np.log(np.abs(errors)), 1)[0]
        lines.append(Line("order of the pull-off in the range", settings, math.nan, float(fitted)))
        deep, force, _ = result.phase("retract")
        some = np.flatnonzero((deep < 1.5e-6) & (deep > -9e-6))
        some = some[chosen(-deep[some], 25)]
        ours(left, deep[some] * MICRO, force[some] * MILLI, index, label=f"range {ranges[-1]:.2f} µm", ms=3.5)
        convergence(right, np.round(ranges, 2), errors, index, label=f"range_factor {factor}")
    left.set(xlabel="indentation [µm]", ylabel="force [mN]")
    left.set_title("retraction, elastic")
    left.legend(loc="upper left")
    triangle(right, 1.5, 2.5, 0.015, 2)
    right.set_xticks([0.75, 1, 1.5, 2, 3], ["0.75", "1", "1.5", "2", "3"])
    right.set(xlabel="range [µm]", ylabel="relative distance from Kendall's force")
    right.set_title("the range vanishes")
    right.legend()
    return figure, lines


def separation(quick: bool):
    """Work of separation of a viscoelastic flat punch against speed: 2 gamma A at both ends."""
    sizes = (32,) if quick else (64, 128)
    speeds = np.geomspace(SLOW, FAST, 4 if quick else 10)
    figure, (left, right) = panels()
    lines = []
    for index, n in enumerate(sizes):
        runs = [pull(n, 4, speed) for speed in speeds]
        works = np.array([one.work_of_separation() for one in runs]) * NANO
        ours(left, speeds, works, index, ls="-", lw=0.8, label=f"n = {n}")
        residuals = [one.state.energies.largest_residual / one.state.energies.work for one in runs]
        ours(right, speeds, residuals, index, ls="-", lw=0.8, label=f"n = {n}")
        for which, speed in ((0, SLOW), (-1, FAST)):
            lines.append(Line("work of separation [nJ]", f"n = {n}, {speed:g} m/s", WORK * NANO, works[which]))
        lines.append(Line("energy residual, over the work of the loop: largest", f"n = {n}", 0.0, max(residuals)))
    left.axhline(WORK * NANO, color="black", lw=1.0, label=r"$2\gamma A$")
    left.set(xscale="log", xlabel="speed of the retraction [m/s]", ylabel="work of separation [nJ]", ylim=(0, None))
    left.set_title(r"flat punch, $\kappa_\infty = 4$, $\tau$ = 400 µs")
    left.legend()
    right.set(xscale="log", yscale="log", xlabel="speed of the retraction [m/s]", ylabel="energy residual / work")
    right.set_title("energy audit")
    right.legend()
    return figure, lines


def film_stiffness(base: str, poisson_ratio: float, thickness: float) -> float:
    """Stiffness of a flat punch on a film of `thickness` (in radii) over that on a half-space: dual integral equations.

    phi(t) - (1/pi) int_0^1 [K(t - s) + K(t + s)] phi(s) ds = 1, K(u) = int_0^inf (1 - R(q h)) cos(q u) dq: the
    stiffness is the mean of phi (N. N. Lebedev, I. S. Ufliand, J. Appl. Math. Mech. 22 (1958) 442). R from the stresses
    in the film.
    """
    x, of_x = np.polynomial.legendre.leggauss(160)
    x, of_x = 20.0 * (1.0 + x), 20.0 * of_x
    half_space = np.array([film.half_space(q, 1.0, poisson_ratio) for q in x])
    deficit = 1.0 - np.array([film.compliance(q, 1.0, 1.0, poisson_ratio, base) for q in x]) / half_space
    t, of_t = np.polynomial.legendre.leggauss(24)
    t, of_t = 0.5 * (1.0 + t), 0.5 * of_t
    waves = np.cos(np.outer(t / thickness, x))
    # cos(t - s) + cos(t + s) = 2 cos t cos s
    kernel = 2.0 / (math.pi * thickness) * (waves * (of_x * deficit)) @ waves.T
    return float(of_t @ np.linalg.solve(np.eye(t.size) - kernel * of_t, np.ones(t.size)))


def film_figure(quick: bool):
    """Films on a bonded or sliding base: compliance of a wave, stiffness of a flat punch."""
    n, poisson, modulus = (32 if quick else 128), 0.495, 2e6
    figure, (left, right) = panels()
    lines = []
    x, some = np.geomspace(0.03, 20, 200), np.geomspace(0.03, 20, 14)
    common = (*PRESSED, f"grid.n={n}")
    on_half_space = run("flat-punch", *common).contact_stiffness()
    thick = (5.3, 10.0) if quick else (2.0, 3.0, 5.3, 10.0, 20.0, 40.0)
    for index, base in enumerate(("bonded", "sliding")):
        exact, checked = (
            np.array([film.compliance(q, 1.0, 1.0, poisson, base) / film.half_space(q, 1.0, poisson) for q in at])
            for at in (x, some)
        )
        closed(left, x, exact, index, label=base)
        half_space = np.array([film.half_space(q, modulus, poisson) for q in some])
        found = Film(modulus, poisson, 1.0, base)(some, 0.0) / half_space
        ours(left, some, found, index)
        worst = float(np.abs(found / checked - 1).max())
        lines.append(Line("compliance: largest relative error, q h from 0.03 to 20", base, 0.0, worst))
        wide = np.geomspace(thick[0], thick[-1], 40)
        closed(right, wide, [film_stiffness(base, poisson, h) - 1 for h in wide], index, label=base)
        for h in thick:
            keys = (f"substrate.thickness={h * RADIUS:.9g} m", f"substrate.base={base}")
            ratio = run("flat-punch", *common, *keys).contact_stiffness() / on_half_space
            ours(right, [h], [ratio - 1], index)
            expected = film_stiffness(base, poisson, h)
            lines.append(Line("stiffness / half-space", f"n = {n}, {base}, h = {h:g} a", expected, ratio))
    left.set(xscale="log", yscale="log", xlabel="$qh$", ylabel="compliance / half-space")
    left.set_title("one wave")
    left.legend()
    right.set(xscale="log", yscale="log", xlabel="thickness of the film $h/a$", ylabel="stiffness / half-space $-$ 1")
    right.set_title(f"flat punch, n = {n}")
    right.minorticks_off()
    right.set_xticks(thick, [f"{value:g}" for value in thick])
    right.legend()
    return figure, lines
