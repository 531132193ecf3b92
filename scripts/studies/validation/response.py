"""One Fourier mode: creep and relaxation, and what the paper's auxiliary mass and damping make of them."""

from __future__ import annotations

import math

import numpy as np
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.physics.drive import Phase
from pgfmd.physics.rheology import PronySeries
from pgfmd.reference import prony
from pgfmd.scene import scene_from_mapping
from tests.physics.test_viscoelastic import SPECTRA, rheology, stepped

from .drawing import GREY, Line, closed, convergence, order, ours, panels, triangle

MODEL_1 = PronySeries.single(250, 400e-6)
"""The paper's first rheology."""


def prony_mode(quick: bool):
    """Creep and relaxation of a mode, N = 1, 5, 20, by the implicit steps of `inertialess`."""
    figure, (left, right) = panels()
    lines = []
    for index, name in enumerate(("N = 1", "N = 5", "N = 20")):
        series, shortest = SPECTRA[name], SPECTRA[name].tau.min()
        creep = series.to_creep()
        times = np.geomspace(0.05, 20.0 * creep.retardation_times.max() / shortest, 240) * shortest
        closed(left, times / shortest, prony.creep(times, 1.0, 1.0, creep), index)
        closed(left, times / shortest, prony.relaxation(times, 1.0, 1.0, series), index, ls=(0, (4, 1.5)))
        some = times[:: 40 if quick else 20]
        creeping = [stepped(series, t, 200, traction=lambda _: 1.0)[0] for t in some]
        relaxing = [stepped(series, t, 200, displacement=lambda _: 1.0)[1] for t in some]
        ours(left, some / shortest, creeping, index)
        ours(left, some / shortest, relaxing, index, label=name)
        end, counts = 2.0 * shortest, (16, 32, 64, 128)
        for what, kind, exact in (
            ("creep", {"traction": lambda _: 1.0}, prony.creep(end, 1.0, 1.0, creep)),
            ("relaxation", {"displacement": lambda _: 1.0}, prony.relaxation(end, 1.0, 1.0, series)),
        ):
            place = 0 if what == "creep" else 1
            found = [stepped(series, end, count, **kind)[place] for count in counts]
            errors = np.array(found) / exact - 1
            steps = end / shortest / np.array(counts)
            style = {"ls": "-" if place == 0 else (0, (4, 1.5)), "lw": 0.8}
            convergence(right, steps, errors, index, **style)
            settings = f"{name}, 128 steps"
            lines.append(Line(f"{what} at t = 2 tau_min / static", settings, float(exact), float(found[-1])))
            lines.append(Line(f"{what}: order in the step", name, 2.0, order(steps, errors)))
    triangle(right, 0.031, 0.0625, 3e-9, 2)
    left.set(xscale="log", yscale="log", xlabel=r"time $t/\tau_\mathrm{min}$", ylabel="response / static response")
    left.set_title("creep (full lines, rising), relaxation (dashed, falling)")
    left.legend()
    right.set(xlabel=r"step $h/\tau_\mathrm{min}$", ylabel=r"|relative error| at $t = 2\,\tau_\mathrm{min}$")
    right.set_title("second order in the step")
    return figure, lines


def _at_rest(series: PronySeries, steps_per_tau: float, n: int):
    """A gfmd cell of half-space, the punch out of reach: scheme, state, phase of the longest wave, and its
    compliance."""
    scene = scene_from_mapping(
        {
            "punch": {"pattern": "sinusoid", "wavelength": "100 um", "amplitude": "1 nm"},
            "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495},
            "rheology": rheology(series),
            "adhesion": {"work_of_adhesion": "50 mJ/m^2", "range": "1 um"},
            "drive": {"speed": "1 um/s", "preload": "1 mN", "clearance": "1 mm"},
            "grid": {"n": n, "length": "100 um"},
            "solver": {"scheme": "gfmd", "gfmd": {"steps_per_tau": steps_per_tau}},
        }
    )
    simulation = assemble(scene, MPI.COMM_SELF)
    scheme, state = simulation.scheme, simulation.state
    scheme.start(state)
    x, _ = scheme.points.coordinates()
    longest = 2.0 * math.pi / scene.grid.length
    return scheme, state, longest * x, 2.0 / (longest * scene.substrate.contact_modulus)


HELD = Phase("dwell", 0.0, 0.0)


def _creep_of_gfmd(series: PronySeries, steps_per_tau: int, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """k_0 u/f_0 by the scheme after a step of traction, and the times of the ends of steps that are next to `times`."""
    scheme, state, phase, compliance = _at_rest(series, steps_per_tau, 8)
    step = scheme.inertia.step
    wanted = np.unique(np.round(times / step).astype(int))
    found = []
    for count in range(1, wanted[-1] + 1):
        # The mean of what is before and after it is the traction at the moment of the step.
        state.traction[:] = (0.5 if count == 1 else 1.0) * np.cos(phase)
        scheme.step(state, HELD, step)
        if count in wanted:
            found.append(2.0 * float(np.mean(state.surface_displacement * np.cos(phase))) / compliance)
    return wanted * step, np.array(found)


def _modulus_of_gfmd(series: PronySeries, omegas: np.ndarray, steps_per_tau: int) -> np.ndarray:
    """Complex modulus by the scheme: each frequency drives a wave of its own, as all of them answer alike.

    Waits until creep is over, then takes two periods of the slowest frequency by least squares.
    """
    modes = np.arange(1, omegas.size + 1)
    scheme, state, phase, compliance = _at_rest(series, steps_per_tau, 2 * omegas.size + 2)
    n, step = scheme.points.grid.n, scheme.inertia.step
    row = slice(0, n)
    waves = np.cos(np.outer(modes, phase))
    rest = int(25 * series.to_creep().retardation_times.max() / step)
    window = int(2 * 2.0 * math.pi / omegas[0] / step)
    answers, time = np.zeros((window, omegas.size)), 0.0
    for count in range(rest + window):
        state.traction[:] = np.cos(omegas * time) @ waves
        scheme.step(state, HELD, step)
        time += step
        if count >= rest:
            answers[count - rest] = 2.0 / n * (waves[:, row] @ state.surface_displacement[row])
    instants = (rest + 1 + np.arange(window)) * step
    found = []
    for omega, mode, answer in zip(omegas, modes, answers.T, strict=True):
        basis = np.stack([np.cos(omega * instants), np.sin(omega * instants)], axis=1)
        (real, imaginary), *_ = np.linalg.lstsq(basis, answer, rcond=None)
        found.append(compliance / mode / (real - 1j * imaginary))
    return np.array(found)


def gfmd_mode(quick: bool):
    """Creep and modulus of the scheme `gfmd` with its inertia, against the closed response of its equations."""
    figure, (left, right) = panels()
    lines = []
    for index, name in enumerate(("N = 1", "N = 5")):
        series = SPECTRA[name]
        shortest = series.tau.min()
        frequency = 2.0 * math.pi / shortest
        times = np.geomspace(0.05, 1000.0, 300) * shortest
        closed(left, times / shortest, prony.gfmd_creep(times, series, frequency), index)
        closed(left, times / shortest, series.creep(times), index, color=GREY, ls=(0, (2, 1.5)), lw=0.9)
        found_times, found = _creep_of_gfmd(series, 20, np.geomspace(0.1, 1000.0 if not quick else 50.0, 25) * shortest)
        ours(left, found_times / shortest, found, index, label=name)
        errors = []
        for steps in (20, 40, 80):
            at, creep = _creep_of_gfmd(series, steps, np.array([0.5 * shortest]))
            exact = prony.gfmd_creep(at, series, frequency)
            errors.append(float(creep[0] / exact[0] - 1))
        settings = f"{name}, 80 steps per tau_min"
        lines.append(Line("creep k0 u/f at t = tau_min/2", settings, float(exact[0]), float(creep[0])))
        lines.append(Line("order of its error in the step", name, 2.0, order((1 / 20, 1 / 40, 1 / 80), errors)))
    series, frequency = MODEL_1, 2.0 * math.pi / MODEL_1.tau[0]
    omega = np.geomspace(0.02, 20.0, 300) / series.tau[0]
    implemented = prony.gfmd_modulus(omega, series, frequency)
    for part, index, label in ((np.real, 0, "storage"), (np.imag, 1, "loss")):
        # Beyond its own frequency the inertia makes the storage modulus negative.
        positive = np.where(part(implemented) > 0, part(implemented), np.nan)
        closed(right, omega * series.tau[0], positive, index, label=label)
        closed(right, omega * series.tau[0], part(series.kappa_of(omega)), index, color=GREY, ls=(0, (2, 1.5)), lw=0.9)
    omegas = np.geomspace(0.02 if not quick else 0.2, 5.0, 8) / series.tau[0]
    found = _modulus_of_gfmd(series, omegas, 40)
    ours(right, omegas * series.tau[0], found.real, 0)
    ours(right, omegas * series.tau[0], found.imag, 1)
    exact = prony.gfmd_modulus(omegas, series, frequency)
    worst = int(np.argmax(np.abs(found / exact - 1)))
    at = f"model 1, 40 steps per tau, omega tau = {omegas[worst] * series.tau[0]:.2g}, the worst of {omegas.size}"
    lines.append(Line("magnitude of the modulus / E(0)", at, float(np.abs(exact[worst])), float(np.abs(found[worst]))))
    extra = (found[0].imag - series.loss(omegas[0])) / (omegas[0] * series.kappa[0] * series.tau[0])
    ideal = 2.0 * series.kappa_inf / (frequency * series.kappa[0] * series.tau[0])
    settings = f"model 1, omega_G tau = 2 pi, omega tau = {omegas[0] * series.tau[0]:.2g}"
    lines.append(Line("viscosity added by the damping, over kappa_1 tau_1", settings, ideal, float(extra)))
    left.set(xscale="log", yscale="log", xlabel=r"time $t/\tau_\mathrm{min}$", ylabel=r"creep $k_0 u/f$")
    left.set_title(r"creep, $\omega_G\tau_\mathrm{min} = 2\pi$ (dotted: without inertia)")
    left.legend()
    right.set(xscale="log", yscale="log", xlabel=r"frequency $\omega\tau$", ylabel=r"modulus / $E(0)$")
    right.set_title(r"model 1 (dotted: without inertia)")
    right.legend()
    return figure, lines
