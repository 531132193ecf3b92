"""Viscoelastic contact: a mode, a sinusoid and Lee-Radok's sphere in closed form; tack tests against tighter runs."""

import itertools
import math

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.output.recorder import Recorder
from pgfmd.physics.drive import Phase
from pgfmd.physics.rheology import PronySeries
from pgfmd.reference import prony, sinusoid, ting
from pgfmd.scene import load_scene, scene_from_mapping
from pgfmd.schemes.inertialess.retardation import SDIRK2, step_weights

MODULUS, POISSON = 2e6, 0.495
CONTACT_MODULUS = MODULUS / (1 - POISSON**2)

SPECTRA = {
    "N = 0": PronySeries.elastic(),
    "N = 1": PronySeries.single(250, 4e-4),
    "N = 5": PronySeries.geometric(250, 40e-6, 5, 6, 0.8),
    "N = 20": PronySeries.geometric(1000, 1e-6, 20, 2.5, 0.5),
}
MODEL_3 = [
    "rheology.model=geometric", "rheology.modulus_ratio=250", "rheology.relaxation_time=40 us", "rheology.elements=5",
    "rheology.time_ratio=6", "rheology.exponent=0.8",
]  # fmt: skip


def rheology(series):
    """A scene's [rheology]."""
    if not series.elements:
        return {"model": "elastic"}
    return {"model": "prony", "kappa": list(series.kappa), "tau": [f"{tau!r} s" for tau in series.tau.tolist()]}


def run(scene, measure=None, only_to_preload=False):
    """Simulation, final state, rows of time, position, force and what is measured, and the phase of each row."""
    simulation, recorder = assemble(scene, MPI.COMM_SELF), Recorder(measure)
    simulation.observers.append(recorder)
    state = simulation.run(only_to_preload)
    rows = recorder.rows("time", "displacement", "force")
    rows = np.hstack([rows, np.array(recorder.measured)]) if measure else rows
    return simulation, state, rows, recorder.curve.column("phase").astype(str)


# One mode ------------------------------------------------------------------------------------------------------------
def stepped(series, end, steps, traction=None, displacement=None):
    """w and f at the end of a history of f or of w = u/G0, from rest; by the weights alone."""
    creep = series.to_creep()
    h = end / steps
    weights = step_weights(creep, SDIRK2, h)
    phi = np.zeros(creep.elements)
    for step in range(steps):
        f, w = np.zeros(SDIRK2.stages), np.zeros(SDIRK2.stages)
        for i, node in enumerate(SDIRK2.nodes):
            time = (step + node) * h
            history = weights.internal_weight[i] @ phi + weights.stage_weight[i, :i] @ f[:i]
            f[i] = traction(time) if traction else (displacement(time) - history) / weights.compliance[i]
            w[i] = weights.compliance[i] * f[i] + history
        phi = weights.decay * phi + weights.gain @ f
    return w[-1], f[-1]


ONE_MODE = {
    "creep": (
        lambda s, t, n: stepped(s, t, n, traction=lambda _: 3.0)[0],
        lambda s, t: prony.creep(t, 3.0, 1.0, s.to_creep()),
    ),
    "relaxation": (
        lambda s, t, n: stepped(s, t, n, displacement=lambda _: 3.0)[1],
        lambda s, t: prony.relaxation(t, 3.0, 1.0, s),
    ),
    "traction ramp": (
        lambda s, t, n: stepped(s, t, n, traction=lambda x: 3.0 * x)[0],
        lambda s, t: prony.traction_ramp(t, 3.0, 1.0, s.to_creep()),
    ),
    "displacement ramp": (
        lambda s, t, n: stepped(s, t, n, displacement=lambda x: 3.0 * x)[1],
        lambda s, t: prony.displacement_ramp(t, 3.0, 1.0, s),
    ),
}


@pytest.mark.parametrize("response", ONE_MODE)
@pytest.mark.parametrize("name", ["N = 1", "N = 5", "N = 20"])
def test_one_mode_converges_to_second_order(name, response):
    series = SPECTRA[name]
    numeric, exact = ONE_MODE[response]
    # Steps that resolve the fastest element; its transient is over in the end, or not.
    for end in (2.0 * series.tau.min(), 20.0 * series.tau.min()):
        counts = [int(4 * 2**k * end / series.tau.min()) for k in (1, 2, 3)]
        errors = [abs(numeric(series, end, count) - exact(series, end)) for count in counts]
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        np.testing.assert_allclose(orders, 2.0, atol=0.25)
        assert errors[-1] < 1e-3 * abs(exact(series, end))


@pytest.mark.parametrize("response", ONE_MODE)
@pytest.mark.parametrize("name", ["N = 1", "N = 5", "N = 20"])
def test_one_mode_with_steps_far_beyond_the_fastest_element(name, response):
    """Elements much faster than the step just follow: the error is that of the slow ones."""
    series = SPECTRA[name]
    numeric, exact = ONE_MODE[response]
    end = 30 * series.tau.max()
    errors = [abs(numeric(series, end, count) / exact(series, end) - 1) for count in (100, 400)]
    assert errors[0] < 2e-3 and errors[1] < max(0.3 * errors[0], 1e-12)


def test_one_elastic_mode_is_exact():
    for response in ONE_MODE.values():
        numeric, exact = response
        assert numeric(SPECTRA["N = 0"], 1.7, 3) == pytest.approx(float(exact(SPECTRA["N = 0"], 1.7)), rel=1e-15)


# A sinusoid in full contact ------------------------------------------------------------------------------------------
WAVELENGTH, RANGE = 50e-6, 0.5e-6
WAVE_NUMBER = 2 * math.pi / WAVELENGTH


def wavy_scene(series, amplitude=10e-9, accuracy=1e-2, speed=1e-4, n=16, depth=0.3e-6, dwell=5e-3):
    """Started pressed in, everywhere in contact; the approach goes 0.2 um deeper."""
    stiffness = 0.05 * math.pi**2 / (2 * RANGE**2)
    preload = stiffness * (depth + 0.2e-6 - amplitude) * (2 * WAVELENGTH) ** 2
    return scene_from_mapping(
        {
            "punch": {"pattern": "sinusoid", "wavelength": f"{WAVELENGTH} m", "amplitude": f"{amplitude} m"},
            "substrate": {"youngs_modulus": f"{MODULUS} Pa", "poisson_ratio": POISSON},
            "rheology": rheology(series),
            "adhesion": {"work_of_adhesion": "50 mJ/m^2", "range": f"{RANGE} m"},
            "drive": {
                "speed": f"{speed} m/s", "preload": f"{preload} N", "dwell": f"{dwell} s", "clearance": f"{-depth} m",
                "turn_time": "1 ms",
            },
            "grid": {"n": n, "length": f"{2 * WAVELENGTH} m"},
            "solver": {"accuracy": accuracy},
        }
    )  # fmt: skip


def wave_of(simulation):
    """Mean and cos(qx) amplitude of the traction, what is left besides [Pa], and the largest gap [m]."""
    points, f = simulation.points, simulation.state.traction
    x, _ = points.coordinates()
    wave = np.cos(WAVE_NUMBER * x)
    mean, amplitude = f.mean(), 2 * (f * wave).mean()
    gap = simulation.state.position + simulation.scheme.solver.height - simulation.state.surface_displacement
    return mean, amplitude, np.abs(f - mean - amplitude * wave).max(), gap.max()


def exact_wave(simulation, time, position, series, amplitude):
    """The closed form; the punch's lowest grid point, not its lowest line, is what the position counts from."""
    x, _ = simulation.points.coordinates()
    shift = (amplitude * (1 + np.cos(WAVE_NUMBER * x))).min()
    return sinusoid.full_contact_sinusoid(
        time, np.asarray(position) - shift, amplitude, WAVE_NUMBER, CONTACT_MODULUS, simulation.scheme.solver.law.stiffness,
        series.to_creep(),
    )  # fmt: skip


@pytest.mark.timeout(15, method="signal")
@pytest.mark.parametrize("name", SPECTRA)
def test_sinusoid_in_full_contact_through_approach_dwell_and_retraction(name):
    series, amplitude = SPECTRA[name], 10e-9
    scene = wavy_scene(series, amplitude)
    simulation, state, rows, phases = run(scene, measure=wave_of)
    time, position, force, mean, wave, rest, largest_gap = rows.T
    # The law is linear, and the closed form holds, until the first gap opens.
    complete = np.cumprod(largest_gap < 0).astype(bool)
    assert set(phases[complete]) == {"approach", "turn", "dwell", "retract"} and complete.sum() > 20
    expected_mean, expected_wave = exact_wave(simulation, time[complete], position[complete], series, amplitude)
    area = scene.grid.length**2
    np.testing.assert_allclose(mean[complete], expected_mean, rtol=1e-6)
    np.testing.assert_allclose(force[complete], -expected_mean * area, rtol=1e-6)
    # Exact in space: no other wave is excited.
    assert rest[complete].max() < 1e-6 * np.abs(expected_mean).max()
    # In time: the tolerance is 0.005 ranges, of which stiffness makes a traction.
    allowed = 0.5 * scene.solver.accuracy * RANGE * simulation.scheme.solver.law.stiffness
    assert np.abs(wave[complete] - expected_wave).max() < allowed
    if not series.elements:
        np.testing.assert_allclose(wave[complete], expected_wave, rtol=1e-5)
    assert state.finished == "detached"


def fixed_steps(scene, end, steps):
    """The scheme by itself: constant steps, no controller. The simulation at the end."""
    simulation = assemble(scene, MPI.COMM_SELF)
    state, scheme = simulation.state, simulation.scheme
    state.force = scheme.start(state)
    phase = Phase("approach", -scene.drive.speed, -scene.drive.speed)
    for _ in range(steps):
        trial = scheme.try_step(state, phase, end / steps)
        assert trial.converged
        scheme.accept(state, trial)
    return simulation


@pytest.mark.timeout(15, method="signal")
@pytest.mark.parametrize("name", SPECTRA)
def test_sinusoid_with_fixed_steps_is_second_order_in_time(name):
    series, amplitude = SPECTRA[name], 50e-9
    scene = wavy_scene(series, amplitude, accuracy=1e-6)
    end = 10 * series.tau.min() if series.elements else 1e-3
    errors = []
    for steps in (50, 100, 200):
        simulation = fixed_steps(scene, end, steps)
        state = simulation.state
        assert state.time == pytest.approx(end, rel=1e-12)
        mean, wave, _, largest_gap = wave_of(simulation)
        assert largest_gap < 0
        expected_mean, expected_wave = exact_wave(simulation, end, state.position, series, amplitude)
        assert mean == pytest.approx(float(expected_mean), rel=1e-8)
        errors.append(abs(wave / float(expected_wave) - 1))
    if series.elements:
        np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2.0, atol=0.2)
        assert errors[-1] < 2e-4
    else:
        assert max(errors) < 1e-9


@pytest.mark.parametrize("n", [5, 8, 13, 32])
def test_sinusoid_is_exact_on_any_grid(n):
    """Time steps alone make the error: the same one on every grid."""
    series, amplitude = SPECTRA["N = 1"], 50e-9
    simulation = fixed_steps(wavy_scene(series, amplitude, accuracy=1e-6, n=n), 4e-3, 100)
    _, wave, _, _ = wave_of(simulation)
    _, expected = exact_wave(simulation, 4e-3, simulation.state.position, series, amplitude)
    reference = fixed_steps(wavy_scene(series, amplitude, accuracy=1e-6, n=16), 4e-3, 100)
    assert wave == pytest.approx(wave_of(reference)[1], rel=1e-8)
    assert wave == pytest.approx(float(expected), rel=1e-4)


@pytest.mark.parametrize("name", ["N = 1", "N = 5", "N = 20"])
def test_error_of_the_sinusoid_falls_with_the_accuracy(name):
    # Waves of two ranges, pushed in so far that contact stays complete though they level out by more than one range.
    series, amplitude, errors, audit = SPECTRA[name], 1e-6, [], []
    for accuracy in (1e-2, 1e-3, 1e-4):
        scene = wavy_scene(series, amplitude, accuracy, speed=1e-5, depth=2.2e-6)
        simulation, state, rows, _ = run(scene, measure=wave_of, only_to_preload=True)
        time, position, _, _, wave, _, largest_gap = rows.T
        assert np.all(largest_gap < 0)
        _, expected = exact_wave(simulation, time, position, series, amplitude)
        errors.append(np.abs(wave - expected).max() / (RANGE * simulation.scheme.solver.law.stiffness))
        # The audit counts from the first state, which is in contact already.
        audit.append(state.energies.largest_residual / state.energies.viscous)
    assert errors[0] < 5e-3
    assert all(fine < 0.5 * coarse for coarse, fine in itertools.pairwise(errors))
    assert audit[0] < 0.01 and all(fine < 0.5 * coarse for coarse, fine in itertools.pairwise(audit))


# A sphere, while its contact grows -----------------------------------------------------------------------------------
SPHERE_SPECTRA = {"single": PronySeries.single(20, 3e-3), "geometric": PronySeries.geometric(50, 1e-4, 5, 4, 0.6)}


@pytest.mark.parametrize("name", SPHERE_SPECTRA)
def test_sphere_follows_lee_and_radok_on_approach(name):
    """Contact radius 150 um, 24 cells; an overlap 16 times stiffer than the shortest wave the grid carries."""
    series, speed, radius, spread = SPHERE_SPECTRA[name], 1e-3, 1e-3, 150e-6
    end = spread**2 / radius / speed
    preload = float(ting.force(end, speed, radius, CONTACT_MODULUS, series))
    scene = scene_from_mapping(
        {
            "punch": {"pattern": "sphere", "radius": "200 um", "curvature_radius": f"{radius} m"},
            "substrate": {"youngs_modulus": f"{MODULUS} Pa", "poisson_ratio": POISSON, "boundary": "free"},
            "rheology": rheology(series),
            "adhesion": {"law": "repulsive", "work_of_adhesion": "50 mJ/m^2", "range_factor": 16.0},
            "drive": {"speed": f"{speed} m/s", "preload": f"{preload} N", "clearance": "0 m"},
            "grid": {"n": 128, "length": "0.8 mm"},
        }
    )
    simulation, state, rows, _ = run(scene, only_to_preload=True)
    time, _, force = rows.T
    # The axis lies between grid points: the tip is that much ahead of the lowest of them.
    ahead = (simulation.points.grid.spacing / 2) ** 2 / radius / speed
    expected = ting.force(time + ahead, speed, radius, CONTACT_MODULUS, series)
    developed = time > 0.2 * end
    error = force[developed] / expected[developed] - 1
    assert np.abs(error).max() < 0.01
    assert abs(error[-1]) < 0.002
    radius_found = math.sqrt(state.contact_points * simulation.points.grid.cell_area / math.pi)
    assert radius_found == pytest.approx(float(ting.contact_radius(time[-1] + ahead, speed, radius)), rel=0.02)
    # A relaxed sphere would carry far less: the test sees the rheology.
    assert force[-1] > 2 * 4 / 3 * CONTACT_MODULUS * math.sqrt(radius) * (speed * end) ** 1.5


# Tack tests ----------------------------------------------------------------------------------------------------------
TACKS = {"triangular": ("tri-tack", []), "hexagonal": ("hex-tack", []), "triangular, model 3": ("tri-tack", MODEL_3)}


@pytest.mark.parametrize("name", TACKS)
def test_tack_test_converges_with_the_accuracy(name):
    source, overrides = TACKS[name]
    results = {}
    for accuracy in (1e-1, 1e-2, 1e-3, 3e-5):
        scene = load_scene(source, ["grid.n=96", f"solver.accuracy={accuracy}", *overrides])
        _, state, rows, _ = run(scene)
        assert state.finished == "detached" and state.counters.jumps == 0
        results[accuracy] = state, rows
    tight, tight_rows = results[3e-5]
    # Evenly in time, interpolation between steps included: what a plot shows.
    time = np.linspace(0, tight_rows[-1, 0], 20_001)
    force = np.interp(time, tight_rows[:, 0], tight_rows[:, 2])
    rms, audit = {}, {}
    for accuracy, (state, rows) in results.items():
        found = np.interp(time, rows[:, 0], rows[:, 2], right=0.0)
        rms[accuracy] = math.sqrt(np.mean((found - force) ** 2)) / tight.preload
        audit[accuracy] = state.energies.largest_residual / state.energies.work
    # Measured at the default: 0.03 to 0.1 % of the preload, pull-off within 0.8 %.
    default, _ = results[1e-2]
    assert rms[1e-2] < 2e-3
    assert rms[1e-3] < 0.3 * rms[1e-2] < 0.3 * rms[1e-1]
    assert default.pull_off_force == pytest.approx(tight.pull_off_force, rel=0.01)
    assert results[1e-3][0].pull_off_force == pytest.approx(tight.pull_off_force, rel=0.003)
    assert default.snap_in_force == pytest.approx(tight.snap_in_force, rel=0.01)
    assert default.preload_time == pytest.approx(tight.preload_time, rel=1e-3)
    assert audit[1e-2] < 0.05
    assert audit[3e-5] < audit[1e-3] < 0.3 * audit[1e-2] and audit[1e-2] < 0.3 * audit[1e-1]
