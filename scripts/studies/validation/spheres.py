"""Round indenters: Hertz, power laws, Lee and Radok's viscoelastic sphere, JKR, Maugis."""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from pgfmd.reference import hertz, jkr, maugis, power_law, tabor, ting
from pgfmd.scene import scene_from_mapping
from tests.physics.runs import CONTACT_MODULUS, WORK_OF_ADHESION, Run, radius_of_traction, run
from tests.physics.test_viscoelastic import SPHERE_SPECTRA, rheology
from tests.physics.test_viscoelastic import run as run_recorded

from .drawing import GREY, Line, chosen, closed, convergence, order, ours, panels, triangle

SPHERE = 10e-3
"""Radius [m] of the sphere of the scene `hertz`."""
TENSION = math.pi * WORK_OF_ADHESION * SPHERE
"""pi w R [N], the unit of adhesive forces on it."""
MILLI, MICRO = 1e3, 1e6


def _apex(result: Run, size: float, exponent: float = 2.0) -> float:
    """How far [m] the axis of the punch, between four grid points, is ahead of them: they are z = 0 in a run."""
    return float(power_law.height(result.spacing / np.sqrt(2), size, exponent))


def hertz_figure(quick: bool):
    """Force and contact radius of an elastic sphere without adhesion."""
    figure, (left, right) = panels()
    sizes = (32, 64, 128) if quick else (32, 64, 128, 256)
    lines, errors = [], {1: [], 4: []}
    for n in sizes:
        for factor in errors:
            result = run("hertz", f"grid.n={n}", f"adhesion.range_factor={factor}", "solver.accuracy=1e-3")
            depth = -result.preload_position + _apex(result, SPHERE)
            exact = hertz.force(depth, SPHERE, CONTACT_MODULUS)
            errors[factor].append(result.state.preload / exact - 1)
            if n == sizes[-1]:
                settings = f"n = {n}, range_factor = {factor}"
                lines.append(Line("force at the preload [mN]", settings, exact * MILLI, result.state.preload * MILLI))
                radius = hertz.contact_radius(depth, SPHERE) * MICRO
                lines.append(Line("contact radius [µm]", settings, radius, radius_of_traction(result) * MICRO))
    deep = np.linspace(0.0, depth, 200)
    closed(left, deep * MICRO, hertz.force(deep, SPHERE, CONTACT_MODULUS) * MILLI)
    for index, phase in enumerate(("approach", "retract")):
        depth, force, _ = result.phase(phase)
        depth = depth + _apex(result, SPHERE)
        depth, force = (depth, force) if phase == "approach" else (depth[::-1], force[::-1])
        touching = depth > 0
        some = chosen(depth[touching], 15)
        ours(left, depth[touching][some] * MICRO, force[touching][some] * MILLI, index, label=phase)
    order_found = -order(sizes, errors[1])
    lines.append(Line("order of the force in the spacing", f"n = {sizes[-2]}, {n}, range_factor = 1", 1.0, order_found))
    shown = next(line.shown_error for line in reversed(lines) if line.what.startswith("force"))
    left.set(xlabel="indentation [µm]", ylabel="force [mN]")
    left.set_title(f"Hertz, n = {sizes[-1]}, range_factor 4: {shown} at the preload")
    left.legend()
    for index, (factor, found) in enumerate(errors.items()):
        convergence(right, sizes, found, index, label=f"range_factor {factor}")
    triangle(right, sizes[-2], sizes[-1], 0.8 * min(np.abs(errors[4])), -1)
    right.set(xlabel="n", ylabel="|error| of the force at the preload")
    right.set_title("first order in the spacing: stiffness of the overlap")
    right.legend()
    return figure, lines


POWERS = ((1.5, 40e-3, 4e-3), (2, 10e-3, 3e-3), (3, 3e-3, 0.9e-3), (4, 2e-3, 0.22e-3))
"""Exponents, sizes R [m] and preloads [N] of power-law indenters: contact radii to some 200 um."""


def power_figure(quick: bool):
    """Force of power-law indenters against their depth."""
    n = 64 if quick else 256
    figure, (left, right) = panels()
    lines = []
    for index, (exponent, size, preload) in enumerate(POWERS):
        result = run(
            "hertz", "punch.pattern=power", f"punch.exponent={exponent}", f"punch.curvature_radius={size} m",
            f"grid.n={n}", f"drive.preload={preload} N", "solver.accuracy=3e-3",
        )  # fmt: skip
        depth, force, _ = result.phase("approach")
        apex = _apex(result, size, exponent)
        radii = np.linspace(20e-6, 300e-6, 4000)
        deep = power_law.indentation(radii, size, exponent)
        exact = power_law.force(radii, size, exponent, CONTACT_MODULUS)
        drawn = (exact > 2e-6) & (exact < 1.05 * force[-1])
        closed(left, deep[drawn] * MICRO, exact[drawn] * MILLI, index)
        reached = np.interp(depth + apex, deep, radii)
        some = np.flatnonzero(reached > 80e-6)
        some = some[chosen(reached[some], 12)]
        ours(left, (depth[some] + apex) * MICRO, force[some] * MILLI, index, label=f"p = {exponent}")
        expected = power_law.force(reached[some], size, exponent, CONTACT_MODULUS)
        ours(right, reached[some] * MICRO, 100 * (force[some] / expected - 1), index, ls="-", lw=0.8)
        settings = f"n = {n}, p = {exponent}, contact radius {reached[-1] * MICRO:.0f} µm"
        lines.append(Line("force [mN]", settings, float(expected[-1]) * MILLI, force[-1] * MILLI))
    left.set(xscale="log", yscale="log", xlabel="indentation [µm]", ylabel="force [mN]")
    left.set_title(f"power laws, n = {n}")
    left.legend()
    right.axhline(0.0, color=GREY, lw=0.6)
    right.set(xlabel="contact radius [µm]", ylabel="error of the force [%]")
    right.set_title("error")
    return figure, lines


def lee_radok(quick: bool):
    """Viscoelastic sphere on approach, N = 1 and 5: Lee and Radok, Ting."""
    n, speed, radius, spread = (64 if quick else 128), 1e-3, 1e-3, 150e-6
    end = spread**2 / radius / speed
    figure, (left, right) = panels()
    lines = []
    for index, series in enumerate(SPHERE_SPECTRA.values()):
        preload = float(ting.force(end, speed, radius, CONTACT_MODULUS, series))
        scene = scene_from_mapping(
            {
                "punch": {"pattern": "sphere", "radius": "200 um", "curvature_radius": f"{radius} m"},
                "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495, "boundary": "free"},
                "rheology": rheology(series),
                "adhesion": {"law": "repulsive", "work_of_adhesion": "50 mJ/m^2", "range_factor": 16.0},
                "drive": {"speed": f"{speed} m/s", "preload": f"{preload} N", "clearance": "0 m"},
                "grid": {"n": n, "length": "0.8 mm"},
            }
        )
        simulation, _, rows, _ = run_recorded(scene, only_to_preload=True)
        time, _, force = rows.T
        # The axis lies between grid points: the tip is that much ahead of the lowest of them.
        time = time + (simulation.points.grid.spacing / 2) ** 2 / radius / speed
        exact = ting.force(time, speed, radius, CONTACT_MODULUS, series)
        label = f"N = {series.elements}"
        closed(left, time * MILLI, exact * MILLI, index)
        relaxed = hertz.force(speed * time, radius, CONTACT_MODULUS)
        some = chosen(time, 14)
        ours(left, time[some] * MILLI, force[some] * MILLI, index, label=label)
        later = chosen(time[time > 0.1 * end], 14) + np.searchsorted(time, 0.1 * end)
        ours(right, time[later] * MILLI, 100 * (force[later] / exact[later] - 1), index, ls="-", lw=0.8)
        settings = f"n = {n}, {label}, E(inf)/E(0) = {series.kappa_inf:.0f}"
        lines.append(Line("force at a contact radius of 150 µm [mN]", settings, exact[-1] * MILLI, force[-1] * MILLI))
        worst = np.abs(force / exact - 1)[time > 0.2 * end].max()
        lines.append(Line("largest relative error from a fifth of the approach on", settings, 0.0, float(worst)))
    closed(left, time * MILLI, relaxed * MILLI, color=GREY, ls=(0, (2, 1.5)), label="Hertz, relaxed")
    left.set(xlabel="time [ms]", ylabel="force [mN]")
    left.set_title("viscoelastic sphere, 1 mm/s, R = 1 mm")
    left.legend()
    right.axhline(0.0, color=GREY, lw=0.6)
    right.set(xlabel="time [ms]", ylabel="error of the force [%]")
    right.set_title("error")
    return figure, lines


@cache
def _sticky(n: int, range_factor: float) -> Run:
    """Sphere with the cosine law. Ranges are long for the grid (0.156 is usual): no contact line is pinned by it."""
    return run(
        "hertz", f"grid.n={n}", "adhesion.law=cosine", f"adhesion.range_factor={range_factor}", "drive.preload=0.2 mN"
    )


def _tabor(result: Run) -> float:
    return tabor.asperity(SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION, result.scene.adhesion.range)


def jkr_figure(quick: bool):
    """Retraction of a sticky sphere in ever shorter ranges against JKR, range zero."""
    sizes = (64, 128) if quick else (64, 128, 256)
    figure, (left, right) = panels()
    limit = jkr.displacement_controlled_pull_off(SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION)
    lines, excess, late, ranges = [], [], [], []
    radii = np.linspace(limit.contact_radius, 300e-6, 600)
    deep = jkr.indentation(radii, SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION)
    pull = jkr.force(radii, SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION) / TENSION
    below = pull < 0.2
    closed(left, deep[below] * MICRO, pull[below], color="black", label="JKR, range 0")
    for index, n in enumerate(sizes):
        result = _sticky(n, 0.04)
        depth, force, _ = result.phase("retract")
        shown = (force / TENSION < 0.2) & (depth > 1.5 * limit.indentation)
        some = np.flatnonzero(shown)[chosen(-depth[shown], 22)]
        label = f"Tabor number {_tabor(result):.2f}"
        ours(left, depth[some] * MICRO, force[some] / TENSION, index, label=label, ms=3.5)
        last = result.before_last_jump()
        ranges.append(result.scene.adhesion.range)
        excess.append(-result.state.pull_off_force / TENSION - 1.5)
        late.append(last.position / -limit.indentation - 1)
        settings, height = f"n = {n}, {label}", -limit.indentation * MICRO
        lines.append(Line("pull-off force [pi w R]", settings, -1.5, result.state.pull_off_force / TENSION))
        lines.append(Line("height of the punch at the snap-off [µm]", settings, height, last.position * MICRO))
    settings = f"n = {sizes[-2]}, {sizes[-1]}"
    lines.append(Line("order of the pull-off in the range", settings, math.nan, order(ranges, excess)))
    left.set(xlabel="indentation [µm]", ylabel=r"force [$\pi w R$]")
    left.set_title("retraction of a sticky sphere")
    left.legend(loc="upper center")
    ranges = np.array(ranges) * MICRO
    convergence(right, ranges, np.array(excess) / 1.5, 0, label="pull-off force")
    convergence(right, ranges, late, 1, label="snap-off displacement")
    triangle(right, ranges[1], ranges[0], 0.03, 1)
    right.set(xlabel="range [µm]", ylabel="relative distance from JKR")
    right.set_title("the range vanishes")
    right.legend()
    return figure, lines


def maugis_figure(quick: bool):
    """Pull-off force of a sticky sphere between DMT and JKR: Maugis's transition."""
    # Beyond a range of 7 um the outline of the punch cuts off what attracts.
    sizes = (64, 128) if quick else (64, 128, 256)
    cases = [_sticky(64, 0.01), _sticky(64, 0.02), *(_sticky(n, 0.04) for n in sizes)]
    figure, (left, right) = panels()
    transition = np.geomspace(0.02, 20, 200)
    exact = [maugis.pull_off_force(1 / math.pi, 1.0, value) for value in transition]
    closed(left, transition, exact, color="black", label="Maugis")
    for value, name in ((-2.0, "DMT"), (-1.5, "JKR")):
        left.axhline(value, color=GREY, lw=0.6)
        left.annotate(name, (0.02, value), xytext=(0, 3), textcoords="offset points", fontsize=7.5, color=GREY)
    lines, points = [], {"w/rho": [], "pi w/(2 rho)": []}
    for result in cases:
        found = result.state.pull_off_force / TENSION
        for strength, factor in (("w/rho", 1.0), ("pi w/(2 rho)", math.pi / 2)):
            stress = factor * WORK_OF_ADHESION / result.scene.adhesion.range
            value = maugis.transition_parameter(SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION, stress)
            expected = maugis.pull_off_force(1 / math.pi, 1.0, value)
            points[strength].append((value, found, 100 * (found / expected - 1)))
            if strength == "w/rho":
                reach = result.scene.adhesion.range * MICRO
                settings = f"n = {result.scene.grid.n}, range {reach:.2f} µm, lambda = {value:.2f}"
                lines.append(Line("pull-off force, equal range [pi w R]", settings, expected, found))
    for index, rows in enumerate(points.values()):
        value, found, error = np.array(rows).T
        name = ("equal range", "equal strength")[index]
        ours(left, value, found, index, label=name)
        ours(right, value, error, index, label=name)
    left.set(xscale="log", xlabel=r"transition parameter $\lambda$", ylabel=r"pull-off force [$\pi w R$]")
    left.set_title("cosine law, placed by range or by strength")
    left.legend(loc="center left")
    right.axhline(0.0, color=GREY, lw=0.6)
    right.set(xscale="log", xlabel=r"transition parameter $\lambda$", ylabel="distance from Maugis [%]")
    right.minorticks_off()
    right.set_xticks([0.3, 0.5, 1.0, 2.0], ["0.3", "0.5", "1", "2"])
    right.set_title("a cosine is no Dugdale stress")
    right.legend()
    return figure, lines
