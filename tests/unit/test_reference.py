"""The closed forms, each against something that doesn't share its formula: quadrature, scans, an ODE, a transform."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.linalg import expm
from scipy.special import gammainc

from pgfmd.physics.rheology import PronySeries
from pgfmd.reference import (
    corrugation,
    film,
    flat_punch,
    hertz,
    jkr,
    maugis,
    power_law,
    prony,
    sinusoid,
    tabor,
    ting,
    wavy,
)

RADIUS, MODULUS, ADHESION = 1.5e-4, 2.6e6, 0.05
SERIES = PronySeries([3.0, 0.5, 40.0], [2.0, 0.1, 1e-3])


def integral_over_disc(pressure, contact_radius):
    """2 pi int_0^a p r dr with r = a sin(theta), which takes the root singularities of the edge away."""
    value, _ = quad(
        lambda angle: pressure(contact_radius * np.sin(angle)) * np.sin(angle) * np.cos(angle),
        0,
        np.pi / 2,
        epsabs=0,
        epsrel=1e-12,
    )
    return 2 * np.pi * contact_radius**2 * value


def test_hertz_pressure_force_and_energy_belong_together():
    delta = 2e-6
    a = float(hertz.contact_radius(delta, RADIUS))
    load = float(hertz.force(delta, RADIUS, MODULUS))
    total = integral_over_disc(lambda r: hertz.pressure(r, delta, RADIUS, MODULUS), a)
    assert total == pytest.approx(load, rel=1e-11, abs=0)
    assert float(hertz.indentation(load, RADIUS, MODULUS)) == pytest.approx(delta, rel=1e-14, abs=0)
    work = quad(lambda d: float(hertz.force(d, RADIUS, MODULUS)), 0, delta, epsabs=0, epsrel=1e-12)[0]
    assert float(hertz.elastic_energy(delta, RADIUS, MODULUS)) == pytest.approx(work, rel=1e-11, abs=0)
    assert hertz.pressure(1.01 * a, delta, RADIUS, MODULUS) == 0
    assert hertz.force(-delta, RADIUS, MODULUS) == 0


def test_hertz_displacement_under_its_pressure_is_the_paraboloid():
    """At the centre of a pressure p(r) a half-space moves by (2/E*) int p dr."""
    delta = 2e-6
    a = float(hertz.contact_radius(delta, RADIUS))
    integral = quad(
        lambda angle: float(hertz.pressure(a * np.sin(angle), delta, RADIUS, MODULUS)) * a * np.cos(angle), 0, np.pi / 2
    )[0]
    assert 2 / MODULUS * integral == pytest.approx(delta, rel=1e-10, abs=0)


def test_jkr_pressure_carries_the_force():
    for a in (8e-6, 1.7e-5, 4e-5):
        total = integral_over_disc(lambda r, a=a: float(jkr.pressure(r, a, RADIUS, MODULUS, ADHESION)), a)
        assert total == pytest.approx(float(jkr.force(a, RADIUS, MODULUS, ADHESION)), rel=1e-9, abs=0)


def test_jkr_instabilities_are_the_extrema_of_the_curve():
    a = np.linspace(1e-7, 4e-5, 400_001)
    force = jkr.force(a, RADIUS, MODULUS, ADHESION)
    indentation = jkr.indentation(a, RADIUS, MODULUS, ADHESION)
    under_load = jkr.load_controlled_pull_off(RADIUS, MODULUS, ADHESION)
    fixed_grips = jkr.displacement_controlled_pull_off(RADIUS, MODULUS, ADHESION)
    assert under_load.force == pytest.approx(force.min(), rel=1e-9, abs=0)
    assert under_load.contact_radius == pytest.approx(a[np.argmin(force)], rel=1e-5, abs=0)
    assert under_load.indentation == pytest.approx(indentation[np.argmin(force)], rel=1e-4, abs=0)
    assert fixed_grips.indentation == pytest.approx(indentation.min(), rel=1e-9, abs=0)
    assert fixed_grips.contact_radius == pytest.approx(a[np.argmin(indentation)], rel=1e-4, abs=0)
    assert fixed_grips.force == pytest.approx(force[np.argmin(indentation)], rel=1e-4, abs=0)
    assert under_load.force == pytest.approx(-1.5 * np.pi * ADHESION * RADIUS, rel=1e-15, abs=0)
    assert fixed_grips.force == pytest.approx(-5 / 6 * np.pi * ADHESION * RADIUS, rel=1e-15, abs=0)
    for point in (under_load, fixed_grips):
        expected = jkr.force(point.contact_radius, RADIUS, MODULUS, ADHESION)
        assert point.force == pytest.approx(float(expected), rel=1e-13, abs=0)
        expected = jkr.indentation(point.contact_radius, RADIUS, MODULUS, ADHESION)
        assert point.indentation == pytest.approx(float(expected), rel=1e-13, abs=0)


def test_jkr_inverse_functions():
    under_load = jkr.load_controlled_pull_off(RADIUS, MODULUS, ADHESION)
    a = under_load.contact_radius * np.array([1.001, 1.5, 3, 20])
    force = jkr.force(a, RADIUS, MODULUS, ADHESION)
    np.testing.assert_allclose(jkr.contact_radius_at_force(force, RADIUS, MODULUS, ADHESION), a, rtol=1e-11)
    fixed_grips = jkr.displacement_controlled_pull_off(RADIUS, MODULUS, ADHESION)
    a = fixed_grips.contact_radius * np.array([1.001, 1.5, 3, 20])
    indentation = jkr.indentation(a, RADIUS, MODULUS, ADHESION)
    found = jkr.contact_radius_at_indentation(indentation, RADIUS, MODULUS, ADHESION)
    np.testing.assert_allclose(found, a, rtol=1e-11)
    assert np.isnan(jkr.contact_radius_at_force(1.001 * under_load.force, RADIUS, MODULUS, ADHESION))
    assert np.isnan(jkr.contact_radius_at_indentation(1.001 * fixed_grips.indentation, RADIUS, MODULUS, ADHESION))
    without = jkr.contact_radius_at_indentation(1e-6, RADIUS, MODULUS, 0.0)
    assert float(without) == pytest.approx(float(hertz.contact_radius(1e-6, RADIUS)), rel=1e-13, abs=0)


def test_jkr_is_an_energy_minimum():
    """Along the equilibrium curve F d(delta) = dU, with U the elastic energy minus w pi a^2."""
    a = 2.3e-5

    def elastic(x):
        strain = np.sqrt(2 * np.pi * ADHESION * x / MODULUS)
        hertz_depth = x**2 / RADIUS
        # Hertz plus a flat punch of the same radius pulled by `strain`: the work of superposing the two.
        return (
            8 / 15 * MODULUS * np.sqrt(RADIUS) * hertz_depth**2.5
            - 4 / 3 * MODULUS * x**3 / RADIUS * strain
            + MODULUS * x * strain**2
        )

    step = 1e-9
    change = elastic(a + step) - elastic(a - step) - ADHESION * np.pi * ((a + step) ** 2 - (a - step) ** 2)
    rise = jkr.indentation(a + step, RADIUS, MODULUS, ADHESION) - jkr.indentation(a - step, RADIUS, MODULUS, ADHESION)
    assert change / rise == pytest.approx(float(jkr.force(a, RADIUS, MODULUS, ADHESION)), rel=1e-6, abs=0)


def test_maugis_joins_dmt_and_jkr():
    unit = np.pi * ADHESION * RADIUS
    assert maugis.pull_off_force(RADIUS, ADHESION, 1e-4) == pytest.approx(-2 * unit, rel=1e-3, abs=0)
    assert maugis.pull_off_force(RADIUS, ADHESION, 20.0) == pytest.approx(-1.5 * unit, rel=3e-3, abs=0)
    transitions = np.logspace(-3, 1, 30)
    forces = [maugis.pull_off_force(RADIUS, ADHESION, x) / unit for x in transitions]
    assert np.all(np.diff(forces) > 0)
    assert -2 < forces[0] < forces[-1] < -1.5


@pytest.mark.parametrize("transition", [0.1, 0.3, 0.7, 1.5, 3.0])
def test_maugis_pull_off_agrees_with_the_published_fit(transition):
    """R. W. Carpick, D. F. Ogletree, M. Salmeron, J. Colloid Interface Sci. 211 (1999) 395: good to 2 % (at 0.3)."""
    power = 4.04 * transition**1.4
    fit = -7 / 4 + (power - 1) / (power + 1) / 4
    found = maugis.pull_off_force(RADIUS, ADHESION, transition) / (np.pi * ADHESION * RADIUS)
    assert found == pytest.approx(fit, rel=0.02, abs=0)


@pytest.mark.parametrize("transition", [0.02, 0.1, 1.0])
def test_maugis_point_contact_is_a_uniformly_pulled_disc(transition):
    """a = 0: sigma_0 on a disc of radius c, and a gap w/sigma_0 = c^2/2R + 2 sigma_0 c (1 - 2/pi)/E* at its edge."""
    strength = transition / 2 * np.cbrt(np.pi * ADHESION * (4 / 3 * MODULUS) ** 2 / RADIUS)
    lift = 2 * strength * (1 - 2 / np.pi) / MODULUS
    c = RADIUS * (np.sqrt(lift**2 + 2 * ADHESION / (strength * RADIUS)) - lift)
    _, force, _ = maugis.curve(np.pi / 2 - 1e-9, transition)
    assert float(force) * np.pi * ADHESION * RADIUS == pytest.approx(-strength * np.pi * c**2, rel=1e-6, abs=0)


def test_maugis_curve_satisfies_its_equation_and_tends_to_jkr():
    theta = np.array([0.02, 0.05, 0.2, 1.0, 1.5])
    transition = 0.7
    a, _, _ = maugis.curve(theta, transition)
    m = 1 / np.cos(theta)
    root = np.sqrt(m**2 - 1)
    balance = transition * a**2 / 2 * (root + (m**2 - 2) * theta)
    balance += 4 * transition**2 * a / 3 * (root * theta - m + 1)
    np.testing.assert_allclose(balance, 1, rtol=1e-9)
    a, force, indentation = maugis.curve(np.array([0.009, 0.012]), 200.0)
    np.testing.assert_allclose(force, a**3 - a * np.sqrt(6 * a), rtol=0.02)
    np.testing.assert_allclose(indentation, a**2 - 2 / 3 * np.sqrt(6 * a), rtol=0.02)


def test_maugis_transition_parameter_is_the_tabor_number_in_other_units():
    found = maugis.transition_parameter(RADIUS, MODULUS, ADHESION, tabor.theoretical_strength(ADHESION, 2e-7))
    mu = tabor.asperity(RADIUS, MODULUS, ADHESION, 2e-7)
    assert found == pytest.approx(mu * np.pi * (9 / (16 * np.pi)) ** (1 / 3), rel=1e-13, abs=0)
    for bad in (0.0, 51.0):
        with pytest.raises(ValueError, match="transition must lie"):
            maugis.pull_off_force(RADIUS, ADHESION, bad)


def test_flat_punch_pressure_displacement_and_break():
    a, delta = 3.75e-4, 1e-6
    total = integral_over_disc(lambda r: float(flat_punch.pressure(r, delta, a, MODULUS)), a)
    load = float(flat_punch.force(delta, a, MODULUS))
    assert total == pytest.approx(load, rel=1e-9, abs=0)
    far = 1e3 * a
    assert float(flat_punch.surface_displacement(far, delta, a)) == pytest.approx(
        load / (np.pi * MODULUS * far), rel=1e-6, abs=0
    )
    np.testing.assert_array_equal(flat_punch.surface_displacement([0, a / 2, a], delta, a), delta)
    assert flat_punch.pressure(1.01 * a, delta, a, MODULUS) == 0
    force = flat_punch.pull_off_force(a, MODULUS, ADHESION)
    assert force == pytest.approx(
        float(flat_punch.force(flat_punch.pull_off_indentation(a, MODULUS, ADHESION), a, MODULUS)), rel=1e-14, abs=0
    )
    assert force**2 / (4 * a * MODULUS) == pytest.approx(flat_punch.work_of_separation(a, ADHESION), rel=1e-14, abs=0)
    assert flat_punch.effective_work_of_adhesion(force, a, MODULUS) == pytest.approx(ADHESION, rel=1e-14, abs=0)


def test_kendall_is_griffiths_condition():
    """At the break dU/da at fixed displacement equals w dA/da: -(d/da)(a E* delta^2) + 2 pi a w = 0."""
    a = 3.75e-4
    delta = flat_punch.pull_off_indentation(a, MODULUS, ADHESION)
    step = 1e-8
    release = MODULUS * delta**2 * ((a + step) - (a - step)) / (2 * step)
    assert release == pytest.approx(2 * np.pi * a * ADHESION, rel=1e-7, abs=0)


@pytest.mark.parametrize("exponent", [1.0, 2.0, 3.7, 8.0])
def test_power_law_indenters_against_sneddons_integrals(exponent):
    """delta = int_0^1 f'(x)/sqrt(1 - x^2) dx, F = 2 E* a int_0^1 x^2 f'(x)/sqrt(1 - x^2) dx, f(x) = z(a x)."""
    a = 2e-5

    def slope(x):
        return RADIUS * (a / RADIUS) ** exponent * x ** (exponent - 1)

    depth = quad(lambda t: slope(np.sin(t)), 0, np.pi / 2, epsabs=0, epsrel=1e-12)[0]
    load = quad(lambda t: np.sin(t) ** 2 * slope(np.sin(t)), 0, np.pi / 2, epsabs=0, epsrel=1e-12)[0]
    assert float(power_law.indentation(a, RADIUS, exponent)) == pytest.approx(depth, rel=1e-10, abs=0)
    assert float(power_law.force(a, RADIUS, exponent, MODULUS)) == pytest.approx(
        2 * MODULUS * a * load, rel=1e-10, abs=0
    )
    assert slope(1.0) == pytest.approx(
        a
        * (power_law.height(a * 1.00001, RADIUS, exponent) - power_law.height(a * 0.99999, RADIUS, exponent))
        / (2e-5 * a),
        rel=1e-8,
        abs=0,
    )


@pytest.mark.parametrize("exponent", [1.0, 2.0, 3.7, 8.0])
def test_power_law_pull_off_is_the_minimum_of_the_curve(exponent):
    a = np.logspace(-8, -2, 600_001)
    lowest = power_law.force(a, RADIUS, exponent, MODULUS, ADHESION).min()
    found = power_law.pull_off_force(RADIUS, exponent, MODULUS, ADHESION)
    assert found == pytest.approx(lowest, rel=1e-8, abs=0)


def test_parabolic_power_law_is_jkr():
    a = np.array([1e-5, 3e-5])
    np.testing.assert_allclose(
        power_law.force(a, RADIUS, 2, MODULUS, ADHESION), jkr.force(a, RADIUS, MODULUS, ADHESION), rtol=1e-12
    )
    np.testing.assert_allclose(
        power_law.indentation(a, RADIUS, 2, MODULUS, ADHESION),
        jkr.indentation(a, RADIUS, MODULUS, ADHESION),
        rtol=1e-12,
    )
    with pytest.raises(ValueError, match="exponent must be > 1/2"):
        power_law.pull_off_force(RADIUS, 0.5, MODULUS, ADHESION)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_westergaard_pressure_lifts_the_surface_onto_the_wave(share):
    """u_q = 2 p_q/(q E*) by transform: inside the contact u + z is constant, outside there is a gap."""
    amplitude, length, n = 1e-6, 1e-4, 1 << 16
    q = 2 * np.pi / length
    mean = share * wavy.full_contact_pressure(amplitude, q, MODULUS)
    x = (np.arange(n) + 0.5) * length / n - length / 2
    pressure = wavy.pressure(x, mean, amplitude, q, MODULUS)
    assert pressure.mean() == pytest.approx(mean, rel=1e-6, abs=0)
    waves = 2 * np.pi * np.fft.rfftfreq(n, length / n)
    compliance = np.divide(2, waves * MODULUS, out=np.zeros_like(waves), where=waves > 0)
    pushed = np.fft.irfft(compliance * np.fft.rfft(pressure), n)
    gap = pushed + amplitude * (1 - np.cos(q * x))
    gap -= gap[n // 2]
    half = float(wavy.contact_fraction(mean, amplitude, q, MODULUS)) * length / 2
    inside = np.abs(x) < half
    assert np.abs(gap[inside]).max() < 1e-6 * amplitude
    assert np.all(gap[np.abs(x) > 1.01 * half] > 0)
    assert float(wavy.mean_pressure(2 * half / length, amplitude, q, MODULUS)) == pytest.approx(mean, rel=1e-12, abs=0)


def test_westergaard_full_contact_is_one_wave():
    q, amplitude = 2e4, 1e-6
    closing = wavy.full_contact_pressure(amplitude, q, MODULUS)
    x = np.linspace(-np.pi / q, np.pi / q, 9)
    np.testing.assert_allclose(
        wavy.pressure(x, 2 * closing, amplitude, q, MODULUS), closing * (2 + np.cos(q * x)), rtol=1e-13
    )
    just_open = wavy.pressure(x, closing * (1 - 1e-13), amplitude, q, MODULUS)
    np.testing.assert_allclose(just_open, closing * (1 + np.cos(q * x)), rtol=0, atol=1e-5 * closing)
    np.testing.assert_array_equal(wavy.pressure(x, -1.0, amplitude, q, MODULUS), 0)


def test_adhesive_wave_with_narrow_contacts_is_a_row_of_isolated_cylinders():
    """Line contact (JKR of a cylinder): load per length pi E* b^2/(4 R) - sqrt(2 pi E* w b), 1/R = A q^2."""
    amplitude, q = 1e-6, 2e4
    length = 2 * np.pi / q
    fraction = 1e-3
    half = fraction * length / 2
    line_load = np.pi * MODULUS * half**2 * amplitude * q**2 / 4 - np.sqrt(2 * np.pi * MODULUS * ADHESION * half)
    found = float(wavy.mean_pressure(fraction, amplitude, q, MODULUS, ADHESION)) * length
    assert found == pytest.approx(line_load, rel=1e-5, abs=0)


def test_one_mode_responses_are_integrals_of_each_other():
    compliance = 2 / (4e4 * MODULUS)
    creep = SERIES.to_creep()
    for time in (1e-3, 0.3, 5.0):
        breaks = time * np.logspace(-6, 0, 25)
        nodes, weights = np.polynomial.legendre.leggauss(20)
        edges = np.concatenate([[0], breaks])
        centre, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
        points = (centre[:, None] + half[:, None] * nodes).ravel()
        measure = (half[:, None] * weights).ravel()
        rise = measure @ prony.creep(points, 7.0, compliance, creep)
        assert float(prony.traction_ramp(time, 7.0, compliance, creep)) == pytest.approx(rise, rel=1e-11, abs=0)
        rise = measure @ prony.relaxation(points, 1e-6, compliance, SERIES)
        assert float(prony.displacement_ramp(time, 1e-6, compliance, SERIES)) == pytest.approx(rise, rel=1e-11, abs=0)


def test_one_mode_response_solves_the_papers_maxwell_equations():
    """kappa_inf u - sum kappa_n u_n = G0 f, tau_n du_n/dt = u - u_n, for a traction step, by matrix exponential."""
    compliance, traction = 1e-11, 5e3
    matrix = (np.outer(np.ones(3), SERIES.kappa) / SERIES.kappa_inf - np.eye(3)) / SERIES.tau[:, None]
    static = compliance * traction
    drive = static / SERIES.kappa_inf / SERIES.tau
    for time in (1e-4, 0.02, 3.0, 100.0):
        augmented = np.zeros((4, 4))
        augmented[:3, :3], augmented[:3, 3] = matrix, drive
        inner = expm(augmented * time)[:3, 3]
        expected = (static + SERIES.kappa @ inner) / SERIES.kappa_inf
        assert float(prony.creep(time, traction, compliance, SERIES.to_creep())) == pytest.approx(
            expected, rel=1e-11, abs=0
        )


def test_dissipation_of_a_cycle_is_the_area_of_its_loop():
    compliance, size, omega = 1e-11, 1e-6, 3.0
    phase = np.linspace(0, 2 * np.pi, 4001)[:-1]
    modulus = complex(SERIES.kappa_of(omega)) / compliance
    traction = np.real(modulus * size * np.exp(1j * phase))
    rate = -size * np.sin(phase)
    loop = 0.5 * np.mean(traction * rate) * 2 * np.pi
    assert float(prony.dissipation_per_cycle(size, omega, compliance, SERIES)) == pytest.approx(loop, rel=1e-12, abs=0)


def test_gfmd_modulus_adds_a_dashpot_at_low_frequency():
    series = PronySeries.single(250, 4e-4)
    frequency = 2 * np.pi / 4e-4
    viscosity = float(prony.gfmd_modulus(1e-6, series, frequency).imag) / 1e-6
    assert viscosity == pytest.approx(249 * 4e-4 + 2 * 250 / frequency, rel=1e-12, abs=0)
    at_resonance = complex(prony.gfmd_modulus(frequency, series, frequency))
    assert at_resonance == pytest.approx(complex(series.kappa_of(frequency)) - 250 + 500j, rel=1e-13, abs=0)


SINE = {"amplitude": 2e-7, "wave_number": 4e4, "contact_modulus": MODULUS, "stiffness": 3e12}


def papers_equations(series, frequency):
    """(A, b) of y' = A y + b for y = (u, u'/omega_G, u_1, ... u_N), a force f_0 = k_0 switched on at time 0."""
    count, stiff = series.elements, frequency / series.kappa_inf
    matrix, drive = np.zeros((count + 2, count + 2)), np.zeros(count + 2)
    matrix[0, 1], matrix[1, 0], matrix[1, 1] = frequency, -frequency, -2 * frequency
    matrix[1, 2:], drive[1] = stiff * series.kappa, stiff
    matrix[2:, 0], matrix[2:, 2:] = 1 / series.tau, -np.diag(1 / series.tau)
    return matrix, drive


FORTY = PronySeries(np.full(40, (1e6 - 1) / 40), np.logspace(6, -6, 40))
FIVE = PronySeries.geometric(250, 40e-6, elements=5, time_ratio=6, exponent=0.8)


@pytest.mark.parametrize("phase", [0.1, 2 * np.pi, 8 * np.pi])
@pytest.mark.parametrize(
    "series", [PronySeries.single(250, 4e-4), FIVE, FORTY], ids=["N = 1", "N = 5", "N = 40, twelve decades"]
)
def test_gfmd_creep_solves_the_papers_equations_of_motion(series, phase):
    frequency = phase / series.tau[-1]
    matrix, drive = papers_equations(series, frequency)
    time = np.geomspace(0.1 / frequency, 3 * series.to_creep().retardation_times[0], 40)
    precise = {"jac": matrix, "rtol": 1e-8, "atol": 1e-15}
    rest = np.zeros(drive.size)
    motion = solve_ivp(lambda _, y: matrix @ y + drive, (0, time[-1]), rest, "Radau", time, **precise)
    np.testing.assert_allclose(prony.gfmd_creep(time, series, frequency), motion.y[0], rtol=1e-6)


@pytest.mark.parametrize("phase", [0.3, 1.0, 2 * np.pi, 100.0])
def test_gfmd_creep_agrees_with_the_matrix_exponential(phase):
    frequency = phase / FIVE.tau[-1]
    matrix, drive = papers_equations(FIVE, frequency)
    augmented = np.zeros((8, 8))
    augmented[:7, :7], augmented[:7, 7] = matrix, drive
    for time in (2 / frequency, 1e-4, 3e-3, 0.2, 5.0):
        expected = expm(augmented * time)[0, 7]
        assert float(prony.gfmd_creep(time, FIVE, frequency)) == pytest.approx(expected, rel=1e-11, abs=0)


def test_gfmd_creep_of_an_elastic_mode_is_the_critically_damped_oscillator():
    """1 - (1 + x) exp(-x), which is the incomplete gamma function P(2, x): a double pole."""
    time = np.logspace(-9, 9, 200)
    np.testing.assert_allclose(prony.gfmd_creep(time, PronySeries.elastic(), 3.0), gammainc(2, 3 * time), rtol=1e-12)


def test_gfmd_creep_limits():
    np.testing.assert_array_equal(prony.gfmd_creep([[-1.0, 0.0]], FIVE, 1e5), [[0, 0]])
    time = np.logspace(-6, 8, 50)
    # The auxiliary damper slows everything by the share that it adds to the dashpots: 2 kappa_inf/omega_G.
    np.testing.assert_allclose(prony.gfmd_creep(time, FORTY, 1e18), FORTY.creep(time), rtol=1e-11)
    coarse = abs(prony.gfmd_creep(1.0, FORTY, 1e10) / FORTY.creep(1.0) - 1)
    fine = abs(prony.gfmd_creep(1.0, FORTY, 1e11) / FORTY.creep(1.0) - 1)
    assert 9 < coarse / fine < 11 and coarse > 1e-12
    with pytest.raises(ValueError, match="gfmd_frequency must be finite and > 0"):
        prony.gfmd_creep(1.0, FIVE, 0.0)


def test_full_contact_sinusoid_solves_its_ordinary_differential_equation():
    """lambda_m dphi_m/dt = f - phi_m, f = K0 (A - G0 (J_inf f + sum J_m phi_m)), phi_m(0) = 0, by eigenvectors."""
    creep = SERIES.to_creep()
    coupling = 2 * SINE["stiffness"] / (SINE["wave_number"] * SINE["contact_modulus"])
    time = np.array([0.0, 1e-6, 1e-4, 2e-3, 0.05, 1.0, 40.0])
    position = -1e-6 + 1e-7 * np.sin(time)
    mean, wave = sinusoid.full_contact_sinusoid(time, position, creep=creep, **SINE)
    scale = 1 / (1 + coupling * creep.J_inf)
    matrix = (-coupling * scale * np.outer(np.ones(3), creep.J) - np.eye(3)) / creep.retardation_times[:, None]
    settled = np.linalg.solve(-matrix, scale * SINE["stiffness"] * SINE["amplitude"] / creep.retardation_times)
    rates, vectors = np.linalg.eig(matrix)
    assert np.all(rates < 0)
    for t, found in zip(time, wave, strict=True):
        memory = -vectors @ (np.expm1(rates * t) * np.linalg.solve(vectors, settled))
        expected = scale * (SINE["stiffness"] * SINE["amplitude"] - coupling * creep.J @ memory)
        assert found == pytest.approx(expected, rel=1e-11, abs=0)
    np.testing.assert_allclose(mean, SINE["stiffness"] * (position + SINE["amplitude"]), rtol=1e-15)
    assert wave[0] > 2 * wave[-1]


def test_full_contact_sinusoid_limits():
    creep = SERIES.to_creep()
    stiffness, amplitude = SINE["stiffness"], SINE["amplitude"]
    coupling = 2 * stiffness / (SINE["wave_number"] * SINE["contact_modulus"])
    _, settled = sinusoid.full_contact_sinusoid(0.0, -1e-6, creep=creep, start="equilibrium", **SINE)
    assert float(settled) == pytest.approx(stiffness * amplitude / (1 + coupling), rel=1e-14, abs=0)
    _, late = sinusoid.full_contact_sinusoid(1e4, -1e-6, creep=creep, **SINE)
    assert float(late) == pytest.approx(float(settled), rel=1e-13, abs=0)
    _, first = sinusoid.full_contact_sinusoid(0.0, -1e-6, creep=creep, **SINE)
    expected = stiffness * amplitude / (1 + coupling / SERIES.kappa_inf)
    assert float(first) == pytest.approx(expected, rel=1e-12, abs=0)
    # Rigid adhesion (K0 -> inf) prescribes the displacement: the wave relaxes like the material.
    rigid = sinusoid.contact_relaxation(1e12, creep)
    np.testing.assert_allclose(rigid.kappa, SERIES.kappa, rtol=1e-9)
    # One that is very soft prescribes the traction, and nothing relaxes.
    soft = sinusoid.contact_relaxation(1e-9, creep)
    assert soft.kappa_inf - 1 == pytest.approx(1e-9 * (1 - creep.J_inf), rel=1e-6, abs=0)


def test_full_contact_sinusoid_refuses_what_is_not_linear():
    creep = SERIES.to_creep()
    with pytest.raises(ValueError, match="not negative everywhere"):
        sinusoid.full_contact_sinusoid([0.0, 1.0], [-1e-6, -2e-7], creep=creep, **SINE)
    with pytest.raises(ValueError, match="start must be"):
        sinusoid.full_contact_sinusoid(0.0, -1e-6, creep=creep, start="cold", **SINE)
    with pytest.raises(ValueError, match="time must be"):
        sinusoid.full_contact_sinusoid(-1.0, -1e-6, creep=creep, **SINE)


def test_viscoelastic_hertz_against_quadrature():
    """int_0^t exp(-(t - s)/tau) (3/2) sqrt(s) ds with s = t y^2, over panels that resolve the fastest element."""
    velocity = 1e-6
    nodes, weights = np.polynomial.legendre.leggauss(30)
    for time in (1e-5, 9e-4, 1.1e-3, 0.1, 2.0, 30.0):
        edges = np.concatenate([[0.0], 1 - np.logspace(-9, 0, 60)[::-1], [1.0]])
        centre, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
        y = (centre[:, None] + half[:, None] * nodes).ravel()
        measure = (half[:, None] * weights).ravel()
        memory = 3 * time**1.5 * (measure @ (y**2 * SERIES.relaxation(time * (1 - y**2))[...]))
        expected = 4 / 3 * MODULUS * np.sqrt(RADIUS) * velocity**1.5 * memory
        assert float(ting.force(time, velocity, RADIUS, MODULUS, SERIES)) == pytest.approx(expected, rel=1e-11, abs=0)


def test_viscoelastic_hertz_limits_and_dwell():
    velocity = 1e-6
    elastic = ting.force([0.5, 2.0, 9.0], velocity, RADIUS, MODULUS, PronySeries.elastic(), approach_time=3.0)
    np.testing.assert_allclose(elastic, hertz.force([0.5e-6, 2e-6, 3e-6], RADIUS, MODULUS), rtol=1e-14)
    fast = float(ting.force(1e-9, velocity, RADIUS, MODULUS, SERIES))
    assert fast == pytest.approx(SERIES.kappa_inf * float(hertz.force(1e-15, RADIUS, MODULUS)), rel=1e-6, abs=0)
    held = ting.force([3.0, 3.0 + 1e-9, 3e2], velocity, RADIUS, MODULUS, SERIES, approach_time=3.0)
    assert held[1] == pytest.approx(held[0], rel=1e-6, abs=0)
    assert held[2] == pytest.approx(float(hertz.force(3e-6, RADIUS, MODULUS)), rel=1e-13, abs=0)
    assert held[0] > 1.2 * held[2]
    assert ting.force(-1.0, velocity, RADIUS, MODULUS, SERIES) == 0
    assert float(ting.contact_radius(9.0, velocity, RADIUS, approach_time=3.0)) == pytest.approx(
        np.sqrt(3e-6 * RADIUS), rel=1e-14, abs=0
    )


def test_dwell_relaxes_every_element_from_where_the_approach_left_it():
    """Superposition: approach, then the same approach with the opposite sign, in d(delta^(3/2))/ds."""
    velocity, stop = 1e-6, 0.4
    for time in (0.41, 0.7, 5.0):
        memory = quad(
            lambda y, t=time: 3 * y**2 * float(SERIES.relaxation(t - stop * y**2)), 0, 1, epsrel=1e-12, limit=500
        )[0]
        expected = 4 / 3 * MODULUS * np.sqrt(RADIUS) * (velocity * stop) ** 1.5 * memory
        found = float(ting.force(time, velocity, RADIUS, MODULUS, SERIES, approach_time=stop))
        assert found == pytest.approx(expected, rel=1e-10, abs=0)


@pytest.mark.parametrize("poisson_ratio", [0.0, 0.3, 0.495])
def test_film_limits(poisson_ratio):
    thickness, modulus = 2e-3, 2e6
    for base in ("bonded", "sliding"):
        thick = film.compliance(40 / thickness, thickness, modulus, poisson_ratio, base)
        assert thick == pytest.approx(film.half_space(40 / thickness, modulus, poisson_ratio), rel=1e-12, abs=0)
    # Corrections are of order (q h)^2 (bonded: over 1 - 2 nu).
    q = 1e-3 / thickness
    bonded = film.compliance(q, thickness, modulus, poisson_ratio, "bonded")
    sliding = film.compliance(q, thickness, modulus, poisson_ratio, "sliding")
    assert bonded == pytest.approx(film.oedometric(thickness, modulus, poisson_ratio), rel=1e-4, abs=0)
    assert sliding == pytest.approx(film.sliding_long_wave(thickness, modulus, poisson_ratio), rel=2e-6, abs=0)


@pytest.mark.parametrize("depth", [0.3, 2.0, 17.0])
@pytest.mark.parametrize("poisson_ratio", [0.2, 0.495, 0.5])
def test_film_agrees_with_hyperbolic_closed_forms(depth, poisson_ratio):
    nu = poisson_ratio
    sinh, cosh = np.sinh(2 * depth), np.cosh(2 * depth)
    half_space = film.half_space(depth, 1.0, nu)
    sliding = (cosh - 1) / (sinh + 2 * depth)
    bonded = ((3 - 4 * nu) * sinh - 2 * depth) / ((3 - 4 * nu) * cosh + 2 * depth**2 + 5 - 12 * nu + 8 * nu**2)
    assert film.compliance(depth, 1.0, 1.0, nu, "sliding") == pytest.approx(half_space * sliding, rel=1e-12, abs=0)
    assert film.compliance(depth, 1.0, 1.0, nu, "bonded") == pytest.approx(half_space * bonded, rel=1e-12, abs=0)


def test_incompressible_bonded_film_is_lubrication():
    found = film.compliance(0.03, 1.0, 2e6, 0.5, "bonded")
    assert found == pytest.approx(film.incompressible_bonded_long_wave(0.03, 1.0, 2e6), rel=1e-2, abs=0)
    with pytest.raises(ValueError, match="base must be"):
        film.compliance(1.0, 1.0, 1.0, 0.3, "glued")
    with pytest.raises(ValueError, match="use oedometric"):
        film.compliance(0.0, 1.0, 1.0, 0.3, "bonded")


def papers_pattern(pattern, x, y, q):
    """z/z0 as the paper writes it, at points x, y (m)."""
    y = y + np.sqrt(3) / 4 * 2 * np.pi / q
    height = 4 / 9 * (3 / 2 + 2 * np.cos(q * x) * np.cos(q * y / np.sqrt(3)) + np.cos(2 * q * y / np.sqrt(3)))
    return height if pattern == "hex" else 2 - height


def cell_of(pattern, q, n=120):
    """The pattern on one rectangular period, l by sqrt(3) l, on a grid that holds every summit and saddle."""
    length = 2 * np.pi / q
    x, y = np.arange(n) * length / n, np.arange(n) * np.sqrt(3) * length / n
    waves_x, waves_y = 2 * np.pi * np.fft.fftfreq(n, length / n), 2 * np.pi * np.fft.fftfreq(n, np.sqrt(3) * length / n)
    return papers_pattern(pattern, x[None, :], y[:, None], q), waves_x[None, :], waves_y[:, None]


@pytest.mark.parametrize(("pattern", "summits"), [("tri", 2), ("hex", 4)])
def test_corrugation_summits_and_saddles_of_the_papers_formula(pattern, summits):
    """The gradient vanishes at summits (z = 0), saddles and tops; curvatures from exact spectral derivatives."""
    q, z0 = 4.2e4, 5e-6
    height, kx, ky = cell_of(pattern, q)
    height = height * z0
    spectrum = np.fft.fft2(height)
    first = [np.fft.ifft2(1j * k * spectrum).real for k in (kx, ky)]
    xx, yy, xy = (np.fft.ifft2(-k * spectrum).real for k in (kx * kx, ky * ky, kx * ky))
    flat = np.hypot(*first) < 1e-9 * q * z0
    touching = flat & (height < 1e-9 * z0)
    assert touching.sum() == summits
    radius = corrugation.summit_radius(pattern, z0, q)
    for curvature in (xx, yy):
        np.testing.assert_allclose(curvature[touching], 1 / radius, rtol=1e-10)
    np.testing.assert_allclose(xy[touching], 0, atol=1e-9 / radius)
    saddles = flat & (xx * yy - xy**2 < 0)
    assert saddles.sum() == 6
    np.testing.assert_allclose(height[saddles], corrugation.saddle_height(pattern, z0), rtol=1e-11)
    assert height.max() == pytest.approx(2 * z0, rel=1e-13, abs=0)
    assert height.min() == pytest.approx(0, abs=1e-13 * z0)
    assert height.mean() == pytest.approx(corrugation.mean_height(pattern, z0), rel=1e-13, abs=0)


@pytest.mark.parametrize("pattern", ["tri", "hex"])
def test_corrugation_energy_and_pressure_of_full_contact(pattern):
    q, z0 = 4.2e4, 5e-6
    height, kx, ky = cell_of(pattern, q)
    wave_number = np.hypot(kx, ky)
    spectrum = np.fft.fft2(height * z0) / height.size
    energy = corrugation.full_contact_energy(z0, q, MODULUS)
    assert corrugation.spectrum_energy(spectrum, wave_number, MODULUS) == pytest.approx(energy, rel=1e-12, abs=0)
    assert energy == pytest.approx(4 * MODULUS * q * z0**2 / (27 * np.sqrt(3)), rel=1e-13, abs=0)
    pressure = -np.fft.ifft2(wave_number * MODULUS / 2 * spectrum).real * height.size
    needed = corrugation.full_contact_pressure(pattern, z0, q, MODULUS)
    assert -pressure.min() == pytest.approx(needed, rel=1e-12, abs=0)
    assert corrugation.reduced_surface_energy(z0, q, MODULUS, ADHESION) == pytest.approx(
        ADHESION / energy, rel=1e-14, abs=0
    )


def test_unknown_pattern_is_refused():
    with pytest.raises(ValueError, match=r"pattern must be one of \['hex', 'tri'\]"):
        corrugation.summit_radius("square", 1e-6, 4e4)


def test_tabor_parameters_are_limits_of_one_formula():
    expected = RADIUS ** (1 / 3) * (ADHESION / MODULUS) ** (2 / 3) / 2e-7
    assert tabor.asperity(RADIUS, MODULUS, ADHESION, 2e-7) == pytest.approx(expected, rel=1e-13, abs=0)
    expected = np.sqrt(RADIUS * ADHESION / MODULUS) / 2e-7
    assert tabor.flat_punch(RADIUS, MODULUS, ADHESION, 2e-7) == pytest.approx(expected, rel=1e-13, abs=0)
    assert tabor.power_law(RADIUS, MODULUS, ADHESION, 2e-7, 1e9) == pytest.approx(expected, rel=1e-6, abs=0)


def test_theoretical_strength_is_the_steepest_slope_of_the_cohesive_law():
    reach = 2e-7
    gap = np.linspace(0, reach, 200_001)
    potential = -ADHESION * (1 + np.cos(np.pi * gap / reach)) / 2
    slope = np.gradient(potential, gap).max()
    assert tabor.theoretical_strength(ADHESION, reach) == pytest.approx(slope, rel=1e-8, abs=0)
