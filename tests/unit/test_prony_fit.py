"""Fitting Prony series: known ones come back, power laws are met as well as N elements can, nonsense is refused."""

import numpy as np
import pytest
from scipy.optimize import nnls

from pgfmd.characterisation.prony_fit import fit_series, ladder, moduli_of, weights_of
from pgfmd.physics.rheology import PronySeries

FIVE = PronySeries.geometric(250, 40e-6, elements=5, time_ratio=6, exponent=0.8)
OMEGA = np.geomspace(0.1, 1e6, 60)


def power_law(decades, exponent=0.5):
    omega = np.geomspace(1, 10**decades, 10 * decades + 1)
    modulus = 1 + (1j * omega) ** exponent
    return omega, modulus.real, modulus.imag


def test_weights_are_those_of_plain_least_squares():
    times = np.array([1e-4, 1e-2])
    storage, loss = 2e6 * FIVE.storage(OMEGA), 2e6 * FIVE.loss(OMEGA)
    rows = []
    for omega, elastic in zip(OMEGA, storage, strict=True):
        rows.append([1 / elastic, *((omega * t) ** 2 / (1 + (omega * t) ** 2) / elastic for t in times)])
    for omega, viscous in zip(OMEGA, loss, strict=True):
        rows.append([0, *(omega * t / (1 + (omega * t) ** 2) / viscous for t in times)])
    expected, norm = nnls(np.array(rows), np.ones(2 * OMEGA.size))
    weights, misfit = weights_of(OMEGA, storage, loss, times)
    np.testing.assert_allclose(weights, expected, rtol=1e-9)
    assert np.linalg.norm(misfit) == pytest.approx(norm, rel=1e-12, abs=0)


@pytest.mark.parametrize("elements", [5, None])
def test_the_papers_series_is_recovered(elements):
    fit = fit_series(OMEGA[::-1], 2e6 * FIVE.storage(OMEGA[::-1]), 2e6 * FIVE.loss(OMEGA[::-1]), elements)
    np.testing.assert_allclose(fit.series.kappa, FIVE.kappa, rtol=1e-4)
    np.testing.assert_allclose(fit.series.tau, FIVE.tau, rtol=1e-4)
    assert fit.static_modulus == pytest.approx(2e6, rel=1e-5)
    assert fit.rms < 1e-5 and fit.warnings() == [] and fit.automatic == (elements is None)
    storage, loss = moduli_of(fit, OMEGA)
    np.testing.assert_allclose(storage, 2e6 * FIVE.storage(OMEGA), rtol=1e-4)
    np.testing.assert_allclose(loss, 2e6 * FIVE.loss(OMEGA), rtol=1e-4)


def test_noise_neither_adds_elements_nor_spoils_the_static_modulus():
    random = np.random.default_rng(3)
    factors = 1 + 0.03 * random.standard_normal((2, OMEGA.size))
    fit = fit_series(OMEGA, 2e6 * FIVE.storage(OMEGA) * factors[0], 2e6 * FIVE.loss(OMEGA) * factors[1])
    assert 4 <= fit.series.elements <= 8
    assert 0.02 < fit.rms < 0.035
    assert fit.static_modulus == pytest.approx(2e6, rel=0.02)
    np.testing.assert_allclose(fit.series.storage(OMEGA), FIVE.storage(OMEGA), rtol=0.06)
    size, modulus, omega = fit.largest
    row = ("E'", "E''").index(modulus)
    assert size == np.abs(fit.misfit).max() == np.abs(fit.misfit[row, np.flatnonzero(fit.omega == omega)[0]])


@pytest.mark.parametrize(
    ("decades", "elements", "plain", "moved"),
    [(8, 5, 22, 16), (8, 12, 3.5, 0.84), (10, 5, 33, 24), (10, 12, 3.4, 1.9), (10, 20, 2.8, 0.13)],
)
def test_misfit_of_a_power_law(decades, elements, plain, moved):
    """The table of docs/how-to/rheology.md, by scripts/studies/rheology/prony_misfit.py."""
    data = power_law(decades)
    _, misfit = weights_of(*data, ladder(data[0], elements))
    assert 100 * np.sqrt(np.mean(misfit**2)) == pytest.approx(plain, rel=0.03)
    assert 100 * fit_series(*data, elements).rms == pytest.approx(moved, rel=0.03)


def test_few_elements_are_warned_about_and_enough_are_found():
    poor = fit_series(*power_law(10), 5)
    assert "off by 24 % rms: choose more elements" in poor.warnings()[0]
    found = fit_series(*power_law(10))
    assert 12 <= found.series.elements <= 18 and found.rms < 0.01
    assert "off by" not in "".join(found.warnings())


def test_data_without_plateaus_are_warned_about():
    low, high = fit_series(*power_law(6)).warnings()
    assert "at the lowest frequency tan delta is still 0.41: E(0) is extrapolated" in low
    assert "at the highest frequency tan delta is still 1" in high


def test_data_that_contradict_causality_are_warned_about():
    """A loss modulus of a hundred times what the slope of E' allows."""
    fit = fit_series(OMEGA, np.full(OMEGA.size, 2e6), np.full(OMEGA.size, 1e6))
    assert "more elements don't help" in fit.warnings()[0]


def test_elastic_data_need_no_element():
    fit = fit_series(OMEGA, np.full(OMEGA.size, 2e6), np.zeros(OMEGA.size))
    assert fit.series.elements == 0 and fit.static_modulus == pytest.approx(2e6, rel=1e-12) and fit.rms < 1e-12


def test_a_liquid_is_refused():
    tau = 1e-3
    x = OMEGA * tau
    with pytest.raises(ValueError, match="no static modulus, E\\(0\\) = 0: this is a liquid"):
        fit_series(OMEGA, 1e6 * x**2 / (1 + x**2), 1e6 * x / (1 + x**2))


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (([1, 10], [2, 3], [1, 1]), "at least 3 frequencies, found 2"),
        (([1, 10, 10], [2, 3, 3], [1, 1, 1]), "at least 3 frequencies, found 2"),
        (([1, 10, 100], [2, -3, 4], [1, 1, 1]), "above 0"),
        (([1, 10, 100], [2, 3, 4], [1, -1, 1]), "above 0"),
        (([0, 10, 100], [2, 3, 4], [1, 1, 1]), "above 0"),
        (([1, 10, np.inf], [2, 3, 4], [1, 1, 1]), "finite"),
        (([1, 10, 100], [2, 3], [1, 1, 1]), "as many moduli as frequencies"),
        (([1, 10, 100], [2, 3, 4], [1, 1, 1], 0), "a whole number from 1 to 40"),
        (([1, 10, 100], [2, 3, 4], [1, 1, 1], 41), "a whole number from 1 to 40"),
    ],
)
def test_nonsense_is_refused(arguments, text):
    with pytest.raises(ValueError, match=text):
        fit_series(*arguments)
