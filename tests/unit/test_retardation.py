"""The weights of an implicit step: against the stages written out, sum rules, limits, order, and stability."""

import math

import numpy as np
import pytest

from pgfmd.physics.rheology import CreepSeries, PronySeries
from pgfmd.schemes.inertialess.retardation import IMPLICIT_EULER, SDIRK2, step_weights
from pgfmd.solver.drift import ROUNDING, Drift

METHODS = {"implicit Euler": IMPLICIT_EULER, "SDIRK2": SDIRK2}
SERIES = {
    "elastic": PronySeries.elastic(),
    "single": PronySeries.single(250, 4e-4),
    "paper, model 3": PronySeries.geometric(250, 40e-6, 5, 6, 0.8),
    "N = 20": PronySeries.geometric(1000, 1e-8, 20, 3, 0.5),
}


@pytest.fixture(params=METHODS)
def method(request):
    return METHODS[request.param]


@pytest.fixture(params=SERIES)
def creep(request):
    return SERIES[request.param].to_creep()


def stages_one_element(a, speed, phi, traction):
    """Stages of dphi/dt = (f - phi)/lambda, speed = h/lambda, one after the other: (rates k_i, values phi_i)."""
    count = len(a)
    rates, values = [], []
    for i in range(count):
        before = phi + speed * sum(a[i][j] * rates[j] for j in range(i))
        # k = f - (before + speed a_ii k)
        rates.append((traction[i] - before) / (1 + speed * a[i][i]))
        values.append(before + speed * a[i][i] * rates[i])
    return rates, values


def trajectory(creep, method, traction, steps, end, start=0.0):
    """w at the end for a given f(t), by the weights, from phi = 0."""
    h = end / steps
    weights = step_weights(creep, method, h)
    phi = np.full(creep.elements, start)
    for step in range(steps):
        f = np.array([traction((step + node) * h) for node in method.nodes])
        history = weights.internal_weight @ phi + weights.stage_weight @ f
        w = weights.compliance * f + history
        phi = weights.decay * phi + weights.gain @ f
    return w[-1]


@pytest.mark.parametrize("step", [1e-9, 1e-5, 4e-4, 1e-2, 10.0])
def test_weights_are_those_of_the_stages_written_out(creep, method, step):
    rng = np.random.default_rng(3)
    phi, f = rng.standard_normal(creep.elements), rng.standard_normal(method.stages)
    weights = step_weights(creep, method, step)
    load, ends, lost = creep.J_inf * f, [], 0.0
    for m in range(creep.elements):
        speed = step / creep.retardation_times[m]
        rates, values = stages_one_element(method.a, speed, phi[m], f)
        load = load + creep.J[m] * np.array(values)
        ends.append(values[-1])
        found = weights.rate_decay[m] * phi[m] + weights.rate_gain[m] @ f
        np.testing.assert_allclose(found, rates, rtol=1e-12, atol=1e-13)
        # The energy lost in the element: h J/lambda sum b_i k_i^2.
        lost += speed * creep.J[m] * sum(b * k * k for b, k in zip(method.a[-1], rates, strict=True))
    history = weights.internal_weight @ phi + weights.stage_weight @ f
    np.testing.assert_allclose(weights.compliance * f + history, load, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(weights.decay * phi + weights.gain @ f, ends, rtol=1e-12, atol=1e-13)
    rates = weights.rate_decay * phi[:, None] + np.einsum("mij,j->mi", weights.rate_gain, f)
    assert np.sum(weights.quadrature * rates**2) == pytest.approx(lost, rel=1e-12, abs=1e-30)


@pytest.mark.parametrize("step", 10.0 ** np.arange(-14, 11, 2))
def test_an_equilibrium_stays_one(creep, method, step):
    # phi = f = 1 everywhere: w = 1, phi = 1, and nothing is lost.
    weights = step_weights(creep, method, step)
    total = weights.compliance + weights.internal_weight.sum(axis=1) + weights.stage_weight.sum(axis=1)
    np.testing.assert_allclose(total, 1.0, rtol=1e-13)
    np.testing.assert_allclose(weights.decay + weights.gain.sum(axis=1), 1.0, rtol=1e-13)
    rates = weights.rate_decay + weights.rate_gain.sum(axis=2)
    np.testing.assert_allclose(rates, 0.0, atol=1e-14)


def exact_weights(speed, method):
    """(decay, gain) of one element with 60 digits."""
    from decimal import Decimal, localcontext

    with localcontext() as context:
        context.prec = 60
        # The coefficients themselves are the doubles that the code uses.
        a, x = [[Decimal(value) for value in row] for row in method.a], Decimal(speed)
        zero, one = Decimal(0), Decimal(1)
        unit = [[one if i == j else zero for j in range(len(a))] for i in range(len(a))]
        _, values = stages_one_element(a, x, one, [zero] * len(a))
        gains = [stages_one_element(a, x, zero, row)[1][-1] for row in unit]
        return float(values[-1]), [float(gain) for gain in gains]


@pytest.mark.parametrize("exponent", range(-12, 13))
def test_no_digits_are_lost_over_24_decades(method, exponent):
    speed = 10.0**exponent
    creep = CreepSeries(0.5, [0.5], [1.0])
    weights = step_weights(creep, method, speed)
    decay, gain = exact_weights(speed, method)
    # Slow elements: relative to a gain that is itself as small as the speed. Fast ones: what vanishes like 1/speed,
    # next to weights that add to one, needs its digits relative to one.
    rounding = 2e-15 * min(speed, 1.0)
    np.testing.assert_allclose(weights.gain[0], gain, rtol=1e-15, atol=rounding)
    np.testing.assert_allclose(weights.decay[0], decay, rtol=1e-15, atol=1e-15)


@pytest.mark.parametrize("exponent", [-12, -8, -4])
def test_slow_elements_gain_in_proportion_to_the_step(method, exponent):
    speed = 10.0**exponent
    weights = step_weights(CreepSeries(0.5, [0.5], [1.0]), method, speed)
    assert weights.gain.sum() == pytest.approx(-math.expm1(-speed), rel=2 * speed + 1e-14)
    np.testing.assert_allclose(weights.gain[0], speed * np.array(method.a[-1]), rtol=3 * speed + 1e-14)
    assert weights.compliance[-1] == pytest.approx(0.5 + 0.5 * speed * method.a[-1][-1], rel=2 * speed + 1e-15)


def test_fast_elements_follow(method):
    weights = step_weights(CreepSeries(0.25, [0.75], [1e-12]), method, 1.0)
    np.testing.assert_allclose(weights.compliance, 1.0, rtol=1e-11)
    np.testing.assert_allclose(weights.internal_weight, 0.0, atol=1e-11)
    np.testing.assert_allclose(weights.stage_weight, 0.0, atol=1e-11)


def test_without_elements_a_step_is_an_equilibrium(method):
    weights = step_weights(PronySeries.elastic().to_creep(), method, 0.1)
    np.testing.assert_array_equal(weights.compliance, 1.0)
    assert weights.internal_weight.shape == (method.stages, 0) and not weights.stage_weight.any()


@pytest.mark.parametrize("name", ["single", "paper, model 3", "N = 20"])
def test_order_of_convergence_for_a_smooth_traction(name, method):
    """f = sin^2: against the exact convolution, element by element."""
    creep = SERIES[name].to_creep()
    end, omega = 0.6, 5.0

    def traction(t):
        return math.sin(omega * t) ** 2

    # f = Re[(1 - e^{2i omega t})/2];  phi = 1/2 (1 - e^{-t/l}) - Re[(e^{2i omega t} - e^{-t/l}) / (1 + 2i omega l)] / 2
    times = creep.retardation_times
    decayed = np.exp(-end / times)
    oscillating = ((np.exp(2j * omega * end) - decayed) / (1 + 2j * omega * times)).real
    exact = creep.J_inf * traction(end) + creep.J @ (1 - decayed - oscillating) / 2
    errors = [abs(trajectory(creep, method, traction, steps, end) - exact) for steps in (400, 800, 1600)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, method.order, atol=0.12)


@pytest.mark.parametrize("speed", [1.0, 10.0, 100.0, 1e4, 1e8])
def test_long_steps_do_not_ring(method, speed):
    weights = step_weights(CreepSeries(0.5, [0.5], [1.0]), method, speed)
    # |R(z)| decreases like 1/|z| (Euler) or (1 - 2 gamma)/(gamma^2 |z|) = (2 + 2 sqrt 2)/|z| (SDIRK2): L-stable.
    assert abs(weights.decay[0]) < (1.0 if method.order == 1 else 2 + 2 * math.sqrt(2)) / speed
    assert abs(weights.decay[0]) < 1.0


def test_the_largest_undershoot_of_sdirk2_is_small():
    speeds = np.logspace(-3, 6, 2000)
    creep = CreepSeries(0.5, [0.5], [1.0])
    decay = np.array([step_weights(creep, SDIRK2, speed).decay[0] for speed in speeds])
    assert decay.max() <= 1.0
    assert decay.min() == pytest.approx(-(math.sqrt(2) - 1) / 2, rel=1e-4)
    assert abs(step_weights(creep, SDIRK2, 100.0).decay[0]) < 0.045


def test_the_methods_are_stiffly_accurate(method):
    a = np.array(method.a)
    assert method.nodes[-1] == pytest.approx(1.0, rel=1e-15)
    # Order conditions with b = last row: sum b = 1, and for the second order sum b c = 1/2.
    assert a[-1].sum() == pytest.approx(1.0, rel=1e-15)
    if method.order == 2:
        assert a[-1] @ np.array(method.nodes) == pytest.approx(0.5, rel=1e-15)
    assert np.all(np.diag(a) > 0) and np.all(np.triu(a, 1) == 0)


def test_error_constants_are_those_of_the_scalar_equation(method):
    # R(z) - exp(z) = -C z^(p+1) + ..., here by the decay of one element.
    speed = 1e-2 if method.order == 2 else 1e-3
    decay = step_weights(CreepSeries(0.5, [0.5], [1.0]), method, speed).decay[0]
    constant = abs(decay - math.exp(-speed)) / speed ** (method.order + 1)
    assert constant == pytest.approx(method.error_constant, rel=0.05)


def test_dissipation_is_never_negative(creep, method):
    for step in 10.0 ** np.arange(-12, 7, 3):
        weights = step_weights(creep, method, step)
        assert np.all(weights.quadrature > 0) or creep.elements == 0


@pytest.mark.parametrize("name", ["single", "paper, model 3"])
def test_the_energy_of_one_mode_balances_better_with_every_step_halved(name, method):
    """Work of f on w = stored + lost; G0 = 1."""
    creep = SERIES[name].to_creep()
    residuals = []
    for steps in (100, 200, 400):
        h = 2e-2 / steps
        weights = step_weights(creep, method, h)
        phi, work, lost, old_w, old_f = np.zeros(creep.elements), 0.0, 0.0, 0.0, 0.0
        for step in range(steps):
            f = np.array([math.sin(150 * (step + node) * h) for node in method.nodes])
            w = weights.compliance * f + weights.internal_weight @ phi + weights.stage_weight @ f
            rates = weights.rate_decay * phi[:, None] + weights.rate_gain @ f
            lost += np.sum(weights.quadrature * rates**2)
            phi = weights.decay * phi + weights.gain @ f
            work += 0.5 * (old_f + f[-1]) * (w[-1] - old_w)
            old_w, old_f = w[-1], f[-1]
        stored = 0.5 * creep.J_inf * old_f**2 + 0.5 * creep.J @ phi**2
        residuals.append(abs(work - stored - lost) / work)
    assert residuals[-1] < (5e-2 if method.order == 1 else 1e-4)
    assert residuals[1] < 0.65 * residuals[0] and residuals[2] < 0.65 * residuals[1]


# Drift ---------------------------------------------------------------------------------------------------------------
def weights_of_a_growing_history(count):
    """Weights of quadratic extrapolation where every step is 1.5 times the last."""
    ahead, past = 1.5, [0.0, -1.0, -1.0 - 1 / 1.5]
    return [[math.prod((ahead - other) / (here - other) for other in past if other != here) for here in past]] * count


def test_covariances_of_the_drift_agree_with_random_trials():
    size, trials, steps = 100.0, 40_000, 6
    rng = np.random.default_rng(11)
    drift = Drift(np.zeros((3, 3)))
    known = [np.zeros(trials) for _ in range(3)]
    for c in weights_of_a_growing_history(steps):
        fresh = ROUNDING * size * math.sqrt(1 + np.dot(c, c)) * rng.standard_normal(trials)
        new = sum(weight * surface for weight, surface in zip(c, known, strict=True)) + fresh
        known = [new, *known[:2]]
        drift = drift.extrapolated(c, size).kept([0, 1, 2])
    observed = np.cov(np.array(known))
    np.testing.assert_allclose(drift.covariance, observed, rtol=0.05)
    assert drift.newest == pytest.approx(known[0].std(), rel=0.02)
    assert drift.newest > 100 * ROUNDING * size, "growing steps amplify: the case that it is for"


def test_the_drift_of_thousands_of_equal_steps_is_that_of_summed_up_roundings():
    """The third differences are fresh roundings; covariances would have lost them after some hundred steps."""
    steps, size = 3000, 10.0
    drift = Drift(np.zeros((3, 3)))
    for _ in range(steps):
        drift = drift.extrapolated([3.0, -3.0, 1.0], size).kept([0, 1, 2])
    fresh = ROUNDING * size * math.sqrt(20.0)
    summed = math.sqrt(sum(math.comb(step + 2, 2) ** 2 for step in range(steps)))
    assert drift.newest == pytest.approx(fresh * summed, rel=1e-6)


def test_a_surface_evaluated_anew_forgets_its_past():
    drift = Drift(np.array([[2.0, 0.0], [2.0, 0.0]])).renewed(10.0)
    assert drift.newest == ROUNDING * 10.0
    assert drift.covariance[0, 1] == drift.covariance[1, 0] == 0.0 and drift.covariance[1, 1] == 4.0


def test_drifts_are_kept_by_position():
    covariance = np.array([[9.0, 2.0, 1.0], [2.0, 4.0, 0.5], [1.0, 0.5, 1.0]])
    kept = Drift(np.linalg.cholesky(covariance)).kept([0, 2])
    np.testing.assert_allclose(kept.covariance, [[9.0, 1.0], [1.0, 1.0]])
    assert kept.newest == 3.0


def test_fewer_weights_than_surfaces_use_the_newest():
    drift = Drift(np.diag([2.0, 1.0])).extrapolated([2.0], 0.0)
    np.testing.assert_allclose(drift.covariance, [[16.0, 8.0, 0.0], [8.0, 4.0, 0.0], [0.0, 0.0, 1.0]])


def test_an_error_of_its_own_disturbs_the_newest_surface_alone():
    covariance = np.array([[9.0, 2.0], [2.0, 4.0]])
    drift = Drift(np.linalg.cholesky(covariance))
    np.testing.assert_allclose(drift.disturbed(4.0).covariance, [[25.0, 2.0], [2.0, 4.0]])
    assert drift.disturbed(4.0).newest == pytest.approx(5.0)
    assert drift.disturbed(0.0) is drift
