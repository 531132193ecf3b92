"""The two schemes: `gfmd` on its way to `inertialess`, and both against scipy's integrators."""

from __future__ import annotations

import math

import numpy as np

from tests.physics.dense import Massless, WithInertia
from tests.physics.runs import run
from tests.physics.test_gfmd import FAST, FIVE
from tests.physics.test_ode import FIVE as SMALL_FIVE
from tests.physics.test_ode import SMALL, largest_difference

from .drawing import GREY, Line, chosen, closed, convergence, order, ours, panels, triangle

CASES = {
    "tri, N = 1": ("tri-tack", False), "tri, N = 5": ("tri-tack", True), "hex, N = 1": ("hex-tack", False),
    "hex, N = 5": ("hex-tack", True),
}  # fmt: skip
MILLI = 1e3


def inertia_vanishes(quick: bool):
    """`gfmd` tends to `inertialess` as 1/omega: tri and hex, N = 1 and 5."""
    figure, (left, right) = panels()
    factors, lines = ((1, 2, 4) if quick else (1, 2, 4, 8, 16)), []
    for index, (case, (name, five)) in enumerate(CASES.items()):
        keys = (*FAST, *(FIVE if five else ()))
        truth = run(name, *keys, "solver.accuracy=1e-5")
        errors = []
        for factor in factors:
            result = run(
                name, *keys, "solver.scheme=gfmd", f"solver.gfmd.omega_tau={2 * math.pi * factor}",
                f"solver.gfmd.steps_per_tau={max(20, 10 * factor)}",
            )  # fmt: skip
            errors.append(_difference(result, truth))
            if case == "tri, N = 1" and factor in (1, 4):
                _draw_force(left, result, factors.index(factor), rf"$\omega\tau = {2 * factor}\pi$")
        if case == "tri, N = 1":
            rows = np.array([(row.time, row.force) for row in truth.rows]).T
            closed(left, rows[0] * MILLI, rows[1] * MILLI, color="black", lw=0.9, label="inertialess", zorder=0)
        convergence(right, np.array(factors), errors, index, label=case)
        settings = f"{case}, n = 32, omega tau_min = {2 * factors[-1]} pi"
        lines.append(Line("force curve, rms difference over the preload", settings, 0.0, errors[-1]))
        settings = f"{case}, the last two"
        lines.append(Line("order in 1/omega", settings, 1.0, -order(factors, errors)))
    left.set(xlabel="time [ms]", ylabel="force [mN]")
    left.set_title("tri, N = 1: a fast tack test, n = 32")
    left.legend()
    triangle(right, factors[-2], factors[-1], 0.4 * min(errors), -1)
    right.set_xticks(factors, [rf"${2 * factor}\pi$" for factor in factors])
    right.set(xlabel=r"frequency of the inertia $\omega\tau_\mathrm{min}$", ylabel="rms difference / preload")
    right.set_title("first order in $1/\\omega$")
    right.legend()
    return figure, lines


def _difference(result, truth) -> float:
    """Rms over time of the difference of the forces, relative to the preload, at the ends of the steps of `truth`.

    Steps of `result` are much shorter: between them a straight line does.
    """
    times, forces = (np.array([(row.time, row.force) for row in run.rows]).T for run in (truth, result))
    (instants, exact), (own, found) = times, forces
    within = instants <= own[-1]
    difference = np.interp(instants[within], own, found) - exact[within]
    return math.sqrt(np.trapezoid(difference**2, instants[within]) / instants[within][-1]) / result.scene.drive.preload


def _draw_force(axis, result, index: int, label: str) -> None:
    rows = np.array([(row.time, row.force) for row in result.rows]).T
    some = chosen(rows[0], 40)
    ours(axis, rows[0, some] * MILLI, rows[1, some] * MILLI, index, label=label, ms=3.2)


def against_scipy(quick: bool):
    """Both schemes against scipy's solution of the same equations, dense and in real space, n = 16."""
    figure, (left, middle, right) = panels(3)
    lines = []
    counts, accuracies = ((25, 50, 100), (1e-5, 1e-6)) if quick else ((50, 100, 200), (1e-4, 1e-5, 1e-6, 1e-7))
    for index, (case, (name, five)) in enumerate(CASES.items()):
        keys = (*SMALL, *(SMALL_FIVE if five else ()))
        truth, errors = None, []
        for steps in counts:
            result = run(name, *keys, "solver.scheme=gfmd", f"solver.gfmd.steps_per_tau={steps}")
            truth = truth or WithInertia(result.scene)
            errors.append(largest_difference(result, truth))
        convergence(middle, 1 / np.array(counts), errors, index, label=case)
        settings = f"{case}, {steps} steps per tau_min"
        lines.append(Line("gfmd: force, largest difference over the preload", settings, 0.0, errors[-1]))
        if case == "tri, N = 1":
            _draw_pair(left, result, truth, 0, "gfmd")
        truth, errors = None, []
        for accuracy in accuracies:
            result = run(name, *keys, f"solver.accuracy={accuracy}")
            truth = truth or Massless(result.scene)
            errors.append(largest_difference(result, truth))
        convergence(right, np.array(accuracies), errors, index, label=case)
        settings = f"{case}, accuracy = {accuracies[-1]:g}"
        lines.append(Line("inertialess: force, largest difference over the preload", settings, 0.0, errors[-1]))
        if case == "tri, N = 1":
            _draw_pair(left, result, truth, 1, "inertialess")
    left.set(xlabel="time [ms]", ylabel="force [mN]")
    left.set_title("tri, N = 1, n = 16; lines: scipy")
    left.legend(loc="upper left", handletextpad=0.1)
    triangle(middle, 1 / counts[-2], 1 / counts[-3], 2.5e-8, 2)
    middle.set_xticks(1 / np.array(counts), [f"1/{count}" for count in counts])
    middle.set(xlabel=r"step $\Delta t/\tau_\mathrm{min}$", ylabel="largest difference / preload")
    middle.set_title("gfmd")
    right.set_xticks(accuracies, [f"$10^{{{round(math.log10(value))}}}$" for value in accuracies])
    right.set(xlabel="solver.accuracy", ylabel="largest difference / preload")
    right.set_title("inertialess")
    for axis in (middle, right):
        axis.axhline(1e-6, color=GREY, lw=0.6, ls=":")
    right.legend()
    return figure, lines


def _draw_pair(axis, result, truth, index: int, label: str) -> None:
    """Force over time: scipy's as a line, ours as markers."""
    rows = result.rows
    instants = np.linspace(rows[0].time, rows[-1].time, 400)
    closed(axis, instants * MILLI, truth.forces(instants) * MILLI, index)
    _draw_force(axis, result, index, label)
