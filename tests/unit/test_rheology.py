"""Prony series and their creep form, against arithmetic with 80 digits and against identities."""

from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from pgfmd.physics.rheology import CreepSeries, PronySeries


def creep_form_in_decimal(kappa, tau):
    """(J, retardation times) by plain bisection of kappa = 1 + sum kappa tau/(tau - t) = 0 with 80 digits."""
    with localcontext() as context:
        context.prec = 80
        pairs = sorted((Decimal(float(t)), Decimal(float(k))) for k, t in zip(kappa, tau, strict=True))
        poles = [t for t, _ in pairs]
        top = poles[-1] + 2 * sum(k * t for t, k in pairs)
        weights, times = [], []
        for low, high in zip(poles, [*poles[1:], top], strict=True):
            for _ in range(230):
                middle = (low + high) / 2
                if 1 + sum(k * t / (t - middle) for t, k in pairs) > 0:
                    high = middle
                else:
                    low = middle
            times.append(middle)
            weights.append(1 / (middle * sum(k * t / (t - middle) ** 2 for t, k in pairs)))
        return np.array([float(w) for w in weights])[::-1], np.array([float(t) for t in times])[::-1]


NASTY = {
    "one element": ([249.0], [4e-4]),
    "nearly equal times": ([1.0, 2.0, 0.5, 3.0], [1.0, 1.0 - 1e-6, 1.0 - 2e-6, 0.3]),
    "times equal to 3e-8": ([1.0, 1e-3, 700.0], [1.0, 1.0 + 3e-8, 1e-4]),
    "kappa over twelve decades, rising": (np.logspace(-6, 6, 13), np.logspace(6, -6, 13)),
    "kappa over twelve decades, falling": (np.logspace(6, -6, 13), np.logspace(6, -6, 13)),
    "kappa alternating by twelve decades": ([1e6, 1e-6] * 5, np.logspace(3, -6, 10)),
    "tiny kappa": ([1e-12, 3.0, 1e-30, 1e-15], [1.0, 0.1, 0.01, 0.001]),
    "all tiny": ([1e-20, 1e-18], [1.0, 0.5]),
    "tiny between large": ([1e5, 1e-10, 9e5], [1.0, 0.99, 0.98]),
    "N = 40, twelve decades": ((1e6 - 1) / 40 * np.ones(40), np.logspace(6, -6, 40)),
}


@pytest.mark.parametrize("name", NASTY)
def test_creep_form_agrees_with_80_digits(name):
    kappa, tau = NASTY[name]
    expected_J, expected_times = creep_form_in_decimal(kappa, tau)
    creep = PronySeries(kappa, tau).to_creep()
    np.testing.assert_allclose(creep.retardation_times, expected_times, rtol=1e-15, atol=0)
    np.testing.assert_allclose(creep.J, expected_J, rtol=2e-14, atol=0)


@st.composite
def ladders(draw):
    """Up to 40 elements with times at least 20 % apart over about twelve decades, kappa_inf up to 1e6."""
    gaps = draw(st.lists(st.floats(0.08, 0.6), min_size=1, max_size=39))
    tau = 1e6 * 10.0 ** -np.minimum(np.cumsum([0.0, *gaps]), 12 + 1e-3 * np.arange(len(gaps) + 1) * 80)
    log_kappa = draw(st.lists(st.floats(-12, 0), min_size=tau.size, max_size=tau.size))
    kappa = 10.0 ** np.array(log_kappa)
    return kappa * draw(st.floats(1e-3, 1e6)) / kappa.sum(), tau


@given(ladders())
@settings(derandomize=True, database=None, max_examples=150, deadline=None)
def test_round_trip_sum_rules_and_interlacing(ladder):
    kappa, tau = ladder
    prony = PronySeries(kappa, tau)
    creep = prony.to_creep()
    back = creep.to_maxwell()
    assert creep.elements == prony.elements == kappa.size
    np.testing.assert_allclose(back.kappa, prony.kappa, rtol=1e-12, atol=0)
    np.testing.assert_allclose(back.tau, prony.tau, rtol=1e-14, atol=0)
    assert creep.J_inf == 1 / prony.kappa_inf
    assert abs(creep.J_inf + creep.J.sum() - 1) < 1e-13
    assert np.all(creep.retardation_times >= prony.tau)
    assert np.all(creep.retardation_times[1:] <= prony.tau[:-1])
    omega = np.logspace(-8, 8, 200)
    np.testing.assert_allclose(prony.kappa_of(omega) * creep.compliance_of(omega), 1, rtol=1e-12)


@pytest.mark.parametrize("seed", range(40))
def test_both_forms_respond_alike_over_twelve_decades_with_crowded_times(seed):
    """Up to 40 elements, times and weights over twelve decades, two in five times within 1e-9 to 0.1 of another."""
    random = np.random.default_rng(seed)
    elements = 40 - seed % 10 * 4
    tau, kappa = 10.0 ** random.uniform(-6, 6, elements), 10.0 ** random.uniform(-6, 6, elements)
    for index in np.flatnonzero(random.random(elements) < 0.4):
        tau[index] = tau[index - 1] * (1 + 10.0 ** random.uniform(-9, -1))
    prony = PronySeries(kappa, tau)
    creep = prony.to_creep()
    omega, time = np.logspace(-9, 9, 300), np.logspace(-9, 9, 300)
    np.testing.assert_allclose(prony.kappa_of(omega) * creep.compliance_of(omega), 1, rtol=1e-12)
    np.testing.assert_allclose(creep.storage(omega), prony.storage(omega), rtol=1e-12)
    np.testing.assert_allclose(creep.loss(omega), prony.loss(omega), rtol=1e-12)
    np.testing.assert_allclose(creep.relaxation(time), prony.relaxation(time), rtol=1e-12)
    np.testing.assert_allclose(creep.to_maxwell().creep(time), creep.creep(time), rtol=1e-12)
    np.testing.assert_array_equal(prony.creep(time), creep.creep(time))


@pytest.mark.parametrize("epsilon", [2e-8, 1e-6, 1e-4])
def test_round_trip_of_nearly_equal_times_keeps_the_response(epsilon):
    prony = PronySeries([1.0, 2.0, 700.0], [1.0, 1.0 - epsilon, 1e-4])
    back = prony.to_creep().to_maxwell()
    omega = np.logspace(-3, 7, 300)
    np.testing.assert_allclose(back.kappa_of(omega), prony.kappa_of(omega), rtol=1e-13)
    assert back.elements == 3
    np.testing.assert_allclose(back.kappa, prony.kappa, rtol=2e-15 / epsilon)


def test_one_element_has_the_textbook_creep_form():
    creep = PronySeries.single(250, 4e-4).to_creep()
    np.testing.assert_allclose([creep.J_inf, creep.J[0]], [1 / 250, 249 / 250], rtol=1e-15)
    np.testing.assert_allclose(creep.retardation_times, [250 * 4e-4], rtol=1e-15)


def test_elastic_has_no_memory():
    prony = PronySeries.elastic()
    creep = prony.to_creep()
    assert prony.elements == creep.elements == creep.to_maxwell().elements == 0
    assert prony.kappa_inf == creep.J_inf == 1.0
    np.testing.assert_array_equal(prony.kappa_of([0.0, 3.0]), [1, 1])
    np.testing.assert_array_equal(creep.creep([-1.0, 0.0, 3.0]), [0, 1, 1])
    np.testing.assert_array_equal(prony.relaxation([-1.0, 0.0, 3.0]), [0, 1, 1])
    assert PronySeries.single(1.0, 1e-3).elements == 0


def test_complex_modulus_is_the_sum_of_maxwell_elements():
    prony = PronySeries([3.0, 0.5, 40.0], [2.0, 0.1, 1e-3])
    omega = np.logspace(-2, 5, 30).reshape(5, 6)
    expected = 1 + sum(k * 1j * omega * t / (1 + 1j * omega * t) for k, t in zip(prony.kappa, prony.tau, strict=True))
    np.testing.assert_allclose(prony.kappa_of(omega), expected, rtol=1e-14)
    np.testing.assert_allclose(prony.storage(omega), expected.real, rtol=1e-14)
    np.testing.assert_allclose(prony.loss(omega), expected.imag, rtol=1e-14)
    assert prony.storage(0.0) == 1.0
    assert prony.storage(1e12) == pytest.approx(prony.kappa_inf, rel=1e-15, abs=0)
    assert prony.kappa_inf == 44.5


def test_creep_and_relaxation_are_inverse_of_each_other():
    """int_0^t E(t - s) dJ(s) = 1: a strain history that creeps under a unit stress needs that unit stress."""
    prony = PronySeries([3.0, 0.5, 4.0], [2.0, 0.5, 0.1])
    creep = prony.to_creep()

    def creep_rate(time):
        return np.sum(creep.J / creep.retardation_times * np.exp(-time / creep.retardation_times))

    for time in (0.05, 1.0, 7.0):
        integral = quad(lambda s, t=time: float(prony.relaxation(t - s)) * creep_rate(s), 0, time, epsrel=1e-13)[0]
        assert integral + creep.J_inf * float(prony.relaxation(time)) == pytest.approx(1, rel=1e-12, abs=0)
    assert float(creep.creep(1e3)) == pytest.approx(1, rel=1e-14, abs=0)
    assert float(creep.creep(0.0)) == pytest.approx(1 / 8.5, rel=1e-14, abs=0)
    assert float(prony.relaxation(0.0)) == pytest.approx(8.5, rel=1e-14, abs=0)


def test_creep_keeps_its_digits_at_short_times():
    creep = PronySeries.single(1e6, 1.0).to_creep()
    ratio = 1e-9
    expected = 1e-6 + (1 - 1e-6) * (ratio - ratio**2 / 2)
    assert float(creep.creep(1e6 * ratio)) == pytest.approx(expected, rel=1e-14, abs=0)


def test_geometric_ladder_is_the_papers():
    prony = PronySeries.geometric(250, 40e-6, elements=5, time_ratio=6, exponent=0.8)
    np.testing.assert_allclose(prony.kappa[1:] / prony.kappa[:-1], 6**0.8, rtol=1e-14)
    np.testing.assert_allclose(prony.tau[:-1] / prony.tau[1:], 6, rtol=1e-14)
    assert prony.tau[-1] == 40e-6
    assert prony.kappa_inf == pytest.approx(250, rel=1e-14, abs=0)


@pytest.mark.parametrize("exponent", [0.5, 0.8])
def test_long_geometric_ladder_is_a_power_law(exponent):
    """Far from both ends E' - 1 scales exactly: one rung of frequency is a factor time_ratio^exponent."""
    prony = PronySeries.geometric(1e12, 1.0, elements=41, time_ratio=6, exponent=exponent)
    omega = 6.0**-20 * np.linspace(1, 6, 11)
    ratio = (prony.storage(6 * omega) - 1) / (prony.storage(omega) - 1)
    np.testing.assert_allclose(ratio, 6**exponent, rtol=1e-6)


def test_elements_are_sorted_merged_and_frozen():
    prony = PronySeries([1.0, 2.0, 0.0, 4.0, 8.0], [0.1, 5.0, 9.0, 0.1, 0.1 * (1 + 4e-9)])
    np.testing.assert_array_equal(prony.kappa, [2.0, 13.0])
    np.testing.assert_allclose(prony.tau, [5.0, 0.1 * (1 + 4e-9 * 8 / 13)], rtol=1e-15)
    with pytest.raises(ValueError, match="read-only"):
        prony.kappa[0] = 1
    with pytest.raises(AttributeError):
        prony.kappa = np.ones(1)


def test_a_fine_ladder_of_times_does_not_collapse():
    tau = 1 + 0.9e-8 * np.arange(10)
    prony = PronySeries(np.ones(10), tau)
    assert prony.elements == 5
    assert prony.kappa.sum() == 10


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (lambda: PronySeries([-1.0], [1.0]), "every kappa must be finite and >= 0"),
        (lambda: PronySeries([np.nan], [1.0]), "every kappa must be finite"),
        (lambda: PronySeries([1.0], [0.0]), "every time must be finite and > 0"),
        (lambda: PronySeries([1.0], [np.inf]), "every time must be finite and > 0"),
        (lambda: PronySeries([1.0, 2.0], [1.0]), "same length"),
        (lambda: PronySeries([[1.0]], [[1.0]]), "same length"),
        (lambda: PronySeries.single(0.5, 1.0), "modulus_ratio must be finite and >= 1"),
        (lambda: PronySeries.geometric(10, 1.0, 0, 6, 0.8), "elements must be a whole number"),
        (lambda: PronySeries.geometric(10, 1.0, 2.5, 6, 0.8), "elements must be a whole number"),
        (lambda: PronySeries.geometric(10, 1.0, 2, 1.0, 0.8), "time_ratio must be finite and > 1"),
        (lambda: PronySeries.geometric(10, 1.0, 2, 6, np.nan), "exponent must be finite"),
        (lambda: PronySeries.geometric(10, -1.0, 2, 6, 0.8), "every time must be finite and > 0"),
        (lambda: CreepSeries(0.0, [1.0], [1.0]), r"J_inf must lie in \(0, 1\]"),
        (lambda: CreepSeries(0.5, [0.4], [1.0]), "must be 1"),
        (lambda: CreepSeries(0.5, [-0.5], [1.0]), "every J must be finite and >= 0"),
    ],
)
def test_bad_input_is_refused_in_words(build, text):
    with pytest.raises(ValueError, match=text):
        build()
