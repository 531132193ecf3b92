"""Scenes that fill a periodic cell: a sinusoid in full and partial contact, the paper's corrugations in full
contact."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np

from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.physics.topography import Topography
from pgfmd.plots.drawing import new_figure
from pgfmd.reference import corrugation, wavy
from pgfmd.scene import load_scene, scene_from_mapping
from tests.physics.runs import CONTACT_MODULUS, SINUSOID, WORK_OF_ADHESION, run
from tests.physics.test_viscoelastic import RANGE, SPECTRA, exact_wave, fixed_steps, wave_of, wavy_scene
from tests.physics.test_viscoelastic import run as run_recorded

from .drawing import GREY, Line, chosen, closed, convergence, order, ours, panels, triangle

MILLI, KILO = 1e3, 1e-3


def full_contact(quick: bool):
    """Full contact of a sinusoid through approach, dwell and retraction, elastic and viscoelastic."""
    figure = new_figure(7.4, 3.9)
    axes = figure.subplot_mosaic([["history", "right"], ["below", "right"]], height_ratios=(2.2, 1))
    history, below, right = (axes[name] for name in ("history", "below", "right"))
    amplitude, lines = 10e-9, []
    for index, name in enumerate(("N = 0", "N = 1", "N = 5", "N = 20")):
        series = SPECTRA[name]
        scene = wavy_scene(series, amplitude, accuracy=1e-3)
        simulation, _, rows, _ = run_recorded(scene, measure=wave_of)
        complete = np.cumprod(rows[:, 6] < 0).astype(bool)
        time, position, _, _, wave, _, _ = rows[complete].T
        _, exact = exact_wave(simulation, time, position, series, amplitude)
        scale = RANGE * simulation.scheme.solver.law.stiffness
        closed(history, time * MILLI, exact * KILO, index)
        some = chosen(time, 16)
        ours(history, time[some] * MILLI, wave[some] * KILO, index, label=name)
        later = some[1:]
        ours(below, time[later] * MILLI, np.abs(wave - exact)[later] / scale, index, ls="-", lw=0.6, ms=3)
        worst = float(np.abs(wave - exact).max() / scale)
        lines.append(Line("wave of traction: largest error, over K_0 rho", f"{name}, accuracy = 1e-3", 0.0, worst))
        if not series.elements:
            continue
        scene = wavy_scene(series, 50e-9, accuracy=1e-6)
        end, counts, errors = 10 * series.tau.min(), (25, 50, 100, 200), []
        for count in counts:
            simulation = fixed_steps(scene, end, count)
            expected = float(exact_wave(simulation, end, simulation.state.position, series, 50e-9)[1])
            errors.append(wave_of(simulation)[1] / expected - 1)
        steps = end / series.tau.min() / np.array(counts)
        convergence(right, steps, errors, index, label=name)
        lines.append(Line("order in the step", f"{name}, 200 steps to t = 10 tau_min", 2.0, order(steps, errors)))
    history.set(ylabel=r"traction wave, amplitude [kPa]")
    history.set_title("approach, dwell and retraction")
    history.legend()
    below.set(yscale="log", xlabel="time [ms]", ylabel=r"|error| / $K_0\rho$", ylim=(1e-12, 1e-3))
    triangle(right, steps[1], steps[0], 0.4 * np.abs(errors).min(), 2)
    right.set(xlabel=r"step $h/\tau_\mathrm{min}$", ylabel=r"|relative error| at $t = 10\,\tau_\mathrm{min}$")
    right.set_title("second order in the step")
    right.legend()
    return figure, lines


WAVE_NUMBER, CELL = 2 * math.pi / 100e-6, (100e-6) ** 2


def westergaard(quick: bool):
    """Partial contact of a sinusoid without adhesion: contact fraction and pressure."""
    sizes = (32, 64) if quick else (32, 64, 128, 256)
    closing = wavy.full_contact_pressure(1e-6, WAVE_NUMBER, CONTACT_MODULUS)
    figure, (left, middle, right) = panels(3)
    lines, errors, of_pressure = [], [], []
    for n in sizes:
        keys = ("solver.accuracy=1e-3", f"grid.n={n}")
        result = run(SINUSOID, *keys, f"drive.preload={1.2 * closing * CELL:.9g} N")
        _, force, pressing = result.phase("approach")
        pressure, fraction = force / CELL, pressing / n**2
        touching = (pressure > 0) & (pressure < 0.95 * closing)
        exact = wavy.contact_fraction(pressure, 1e-6, WAVE_NUMBER, CONTACT_MODULUS)
        errors.append(float(np.abs(fraction - exact)[touching].max()))
        half = run(SINUSOID, *keys, f"drive.preload={0.5 * closing * CELL:.9g} N")
        x, _ = half.simulation.points.coordinates()
        closed_pressure = wavy.pressure(x - 50e-6, half.state.preload / CELL, 1e-6, WAVE_NUMBER, CONTACT_MODULUS)
        of_pressure.append(float(np.abs(-half.preloaded - closed_pressure).mean() / closing))
    lines.append(Line("contact fraction: largest error below 0.95 p*", f"n = {n}", 0.0, errors[-1]))
    lines.append(Line("its order in the spacing", f"n = {sizes[-2]}, {n}", 1.0, -order(sizes, errors)))
    lines.append(Line("pressure at p*/2: mean error, over p*", f"n = {n}", 0.0, of_pressure[-1]))
    ratio = np.linspace(0, 1.2, 300)
    closed(left, ratio, wavy.contact_fraction(ratio * closing, 1e-6, WAVE_NUMBER, CONTACT_MODULUS))
    some = np.flatnonzero(pressure > 0)
    some = some[chosen(pressure[some], 18)]
    ours(left, pressure[some] / closing, fraction[some])
    left.set(xlabel="mean pressure $P/p^*$", ylabel="contact fraction")
    left.set_title(f"Westergaard, n = {n}")
    across = np.linspace(-50e-6, 50e-6, 801)
    exact = wavy.pressure(across - 50e-6, half.state.preload / CELL, 1e-6, WAVE_NUMBER, CONTACT_MODULUS)
    closed(middle, across * 1e6, exact / closing)
    row = slice(0, n, max(1, n // 40))
    ours(middle, x[:n][row] * 1e6, -half.preloaded[:n][row] / closing)
    middle.set(xlabel="x [µm]", ylabel="pressure / $p^*$")
    middle.set_title("pressure at $P = p^*/2$")
    convergence(right, sizes, errors, 0, label="contact fraction, largest")
    convergence(right, sizes, of_pressure, 1, label="pressure, mean")
    triangle(right, sizes[-2], sizes[-1], 3 * of_pressure[-1], -1)
    right.set(xlabel="n", ylabel="|error|", ylim=(None, 0.25))
    right.set_title("error")
    right.legend()
    return figure, lines


def johnson(quick: bool):
    """Partial contact of a sticky sinusoid against Johnson, range zero: on the way back."""
    amplitude = 2e-6
    closing = wavy.full_contact_pressure(amplitude, WAVE_NUMBER, CONTACT_MODULUS)
    figure, (left, right) = panels()
    lines, fraction = [], np.linspace(0.02, 0.97, 300)
    exact = wavy.mean_pressure(fraction, amplitude, WAVE_NUMBER, CONTACT_MODULUS, WORK_OF_ADHESION) / closing
    closed(left, exact, fraction, color="black", label="Johnson, range 0")
    alone = wavy.mean_pressure(fraction, amplitude, WAVE_NUMBER, CONTACT_MODULUS) / closing
    closed(left, alone, fraction, color=GREY, ls=(0, (2, 1.5)), lw=0.9, label="without adhesion")
    # The other branch, at nearly full contact, is the strength of the law and not of the wave.
    pull_off = float(exact[fraction < 0.5].min())
    ranges, errors = [], []
    for index, n in enumerate((64, 128) if quick else (64, 128, 256)):
        result = run_recorded(
            scene_from_mapping(
                SINUSOID,
                [
                    "adhesion.law=cosine", "adhesion.range_factor=0.06", f"grid.n={n}",
                    f"punch.amplitude={amplitude} m",
                    f"drive.preload={0.2 * closing * CELL:.9g} N",
                ],
            ),
            measure=lambda simulation: (
                np.mean(simulation.state.traction < 0), np.mean(simulation.state.traction != 0),
                simulation.state.contact_points / simulation.points.total,
            ),
        )  # fmt: skip
        simulation, state, rows, phases = result
        back = (phases == "retract") & (rows[:, 5] > 0)
        pressure, (overlapping, reached, contact) = rows[back, 2] / CELL / closing, rows[back, 3:6].T
        reach = simulation.scheme.solver.law.range * 1e6
        some = chosen(-pressure, 16)
        ours(left, pressure[some], contact[some], index, label=f"range {reach:.2f} µm")
        left.vlines(pressure[some], overlapping[some], reached[some], color=GREY, lw=0.6, zorder=0)
        ranges.append(reach)
        errors.append(state.pull_off_force / CELL / closing / pull_off - 1)
        tension = state.pull_off_force / CELL / closing
        lines.append(Line("largest tension [p*]", f"n = {n}, range {reach:.2f} µm", pull_off, tension))
    left.set(xlabel="mean pressure $P/p^*$", ylabel="contact fraction")
    left.set(xlim=(-0.15, 0.85), ylim=(0, 1))
    left.set_title("sticky wave; bars: gap from 0 to the range")
    left.legend(loc="lower right")
    convergence(right, np.round(ranges, 2), errors)
    right.set(xlabel="range [µm]", ylabel="relative distance of the largest tension")
    right.set_title("the range vanishes")
    return figure, lines


PERIODS = (26, 15)
"""Periods of the corrugation in a square cell, along x and y: 26 lambda are 15 sqrt(3) lambda to 0.07 %."""


def corrugation_energy(quick: bool):
    """Elastic energy per area of the paper's corrugations, pressed until contact is full."""
    periods, points = ((7, 4), 6) if quick else (PERIODS, 5)
    shipped = load_scene("tri-tack").punch
    wavelength, length, n = shipped.wavelength, periods[0] * shipped.wavelength, periods[0] * points
    q = 2 * math.pi / wavelength
    place = (np.arange(n) + 0.5) * length / n - 0.5 * length
    # Stretched along y by 0.07 %, so that the cell holds whole periods.
    y, x = np.meshgrid(place * periods[1] * math.sqrt(3) / periods[0], place, indexing="ij")
    figure, (left, right) = panels()
    lines = []
    for index, (short, pattern) in enumerate((("tri", "triangular"), ("hex", "hexagonal"))):
        amplitude = 1e-6
        heights = Topography(pattern, wavelength=wavelength, amplitude=amplitude).heights(x, y)
        exact = corrugation.full_contact_energy(amplitude, q, CONTACT_MODULUS)
        closing = corrugation.full_contact_pressure(short, amplitude, q, CONTACT_MODULUS)
        reaches, errors = ((0.4e-6, 0.2e-6) if quick else (0.4e-6, 0.2e-6, 0.1e-6)), []
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "heights.npy"
            np.save(path, heights)
            for reach in reaches:
                scene = _pressed(path, length, n, reach, 1.15 * closing)
                _, _, rows, _ = run_recorded(scene, measure=_energy, only_to_preload=True)
                errors.append(rows[-1, 3] / length**2 / exact - 1)
        pressure, energy = rows[:, 2] / length**2 / closing, rows[:, 3] / length**2 / exact
        some = chosen(np.maximum.accumulate(pressure), 16)
        ours(left, pressure[some], energy[some], index, label=pattern, ls="-", lw=0.6)
        own_wave = 2 * q / math.sqrt(3)
        couplings = [Cosine(WORK_OF_ADHESION, r).stiffness * 2 / (own_wave * CONTACT_MODULUS) for r in reaches]
        convergence(right, np.round(couplings, 1), errors, index, label=pattern)
        settings = f"{pattern}, z0 = 1 µm, {n} x {n}, K_0 G_0(Q) = {couplings[-1]:.0f}"
        found = energy[-1] * exact * MILLI
        lines.append(Line("energy of full contact [mJ/m^2]", settings, exact * MILLI, found))
        # The waves as they are in the cell, each flattened by the overlap, b = K_0 G_0(q): z b/(1 + b).
        spectrum, waves = np.fft.fft2(heights - heights.mean()) / n**2, 2 * math.pi * np.fft.fftfreq(n, length / n)
        waves = np.hypot(waves[:, None], waves[None, :])
        softness = waves / own_wave / couplings[-1]
        own = corrugation.spectrum_energy(spectrum / (1 + softness), waves, CONTACT_MODULUS)
        lines.append(Line("the same, stretch and overlap allowed for [mJ/m^2]", settings, own * MILLI, found))
    left.axhline(1.0, color="black", lw=1.0)
    left.axvline(1.0, color="black", lw=0.6, ls=":")
    left.set(xlabel="mean pressure / pressure of full contact", ylabel="elastic energy / closed form")
    left.set_title("the paper's corrugations, half-space")
    left.legend()
    triangle(right, couplings[-2], couplings[-1], 0.4 * abs(errors[-1]), -1)
    right.set(xlabel=r"stiffness of the overlap $K_0 G_0(Q)$", ylabel="|error| of the energy")
    right.set_title("the overlap stiffens")
    right.legend()
    return figure, lines


def _pressed(path: Path, length: float, n: int, reach: float, pressure: float):
    """A map of heights that fills the cell, pressed up to a mean pressure without adhesion."""
    return scene_from_mapping(
        {
            "punch": {
                "pattern": "file",
                "file": str(path),
                "file_size": [f"{length!r} m"] * 2,
                "file_unit": "m",
                "file_peaks": "down",
            },
            "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495},
            "rheology": {"model": "elastic"},
            "adhesion": {"law": "repulsive", "work_of_adhesion": "50 mJ/m^2", "range": f"{reach} m"},
            "drive": {"speed": "1 um/s", "preload": f"{float(pressure * length**2)!r} N"},
            "grid": {"n": n, "length": f"{length!r} m"},
        }
    )


def _energy(simulation):
    return (simulation.state.energies.elastic,)
