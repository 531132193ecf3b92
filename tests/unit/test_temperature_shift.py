"""Time-temperature superposition: known constants come back from synthetic sweeps."""

import numpy as np
import pytest

from pgfmd.characterisation.dma import Sweep
from pgfmd.characterisation.prony_fit import fit_series
from pgfmd.characterisation.temperature_shift import WLF, fit_wlf, master_curve
from pgfmd.physics.rheology import PronySeries

SERIES = PronySeries.geometric(1000, 1e-7, elements=20, time_ratio=3, exponent=0.5)
KNOWN = WLF(8.86, 101.6, 298.15)
KELVIN = 298.15 + np.arange(-40.0, 21.0, 10)


def sweeps(law=KNOWN, kelvin=KELVIN, noise=0.0, vertical=False, seed=0):
    random = np.random.default_rng(seed)
    omega = 2 * np.pi * np.geomspace(0.1, 100, 16)
    result = []
    for temperature in kelvin:
        reduced = omega * 10 ** law.log_shift(temperature)
        scale = 2e6 * (temperature / law.reference_temperature if vertical else 1.0)
        factors = 1 + noise * random.standard_normal((2, omega.size))
        moduli = scale * factors * [SERIES.storage(reduced), SERIES.loss(reduced)]
        result.append(Sweep(omega, *moduli, temperature))
    return result


def test_wlf_is_the_published_equation():
    universal = WLF(17.44, 51.6, 373.15)
    assert float(universal.log_shift(373.15)) == 0
    assert float(universal.log_shift(383.15)) == pytest.approx(-17.44 * 10 / 61.6, rel=1e-14, abs=0)
    np.testing.assert_allclose(universal.log_shift([363.15, 423.15]), [174.4 / 41.6, -872 / 101.6], rtol=1e-14)


def test_moving_the_reference_keeps_all_shifts():
    moved = KNOWN.moved_to(273.15)
    assert pytest.approx(KNOWN.C1 * KNOWN.C2, rel=1e-14, abs=0) == moved.C1 * moved.C2
    expected = KNOWN.log_shift(KELVIN) - KNOWN.log_shift(273.15)
    np.testing.assert_allclose(moved.log_shift(KELVIN), expected, rtol=1e-12, atol=1e-13)
    assert pytest.approx(KNOWN.C1, rel=1e-14, abs=0) == moved.moved_to(298.15).C1


@pytest.mark.parametrize("reference", [298.15, 283.15, 270.0])
def test_constants_are_recovered_at_any_reference(reference):
    found, known = fit_wlf(sweeps(), reference), KNOWN.moved_to(reference)
    assert pytest.approx(known.C1, rel=2e-4) == found.C1
    assert pytest.approx(known.C2, rel=2e-4) == found.C2
    np.testing.assert_allclose(found.log_shift(KELVIN), known.log_shift(KELVIN), atol=1e-3)


@pytest.mark.parametrize(("law", "step"), [(WLF(17.44, 51.6, 250.0), 3), (WLF(4.0, 200.0, 300.0), 10)])
def test_other_constants(law, step):
    kelvin = law.reference_temperature + step * np.arange(-3.0, 4.0)
    found = fit_wlf(sweeps(law, kelvin), law.reference_temperature)
    assert pytest.approx((law.C1, law.C2), rel=1e-3) == (found.C1, found.C2)


def test_noise_and_order_of_the_sweeps():
    noisy = sweeps(noise=0.02, seed=5)
    found = fit_wlf(noisy[::-1], 298.15)
    np.testing.assert_allclose(found.log_shift(KELVIN), KNOWN.log_shift(KELVIN), atol=0.05)
    master = master_curve(noisy, found)
    fit = fit_series(master.omega, master.storage, master.loss)
    assert fit.rms < 0.025
    assert fit.static_modulus == pytest.approx(2e6, rel=0.02)
    assert fit.series.kappa_inf == pytest.approx(1000, rel=0.02)
    omega = np.geomspace(0.1, 1e7, 50)
    np.testing.assert_allclose(fit.series.storage(omega), SERIES.storage(omega), rtol=0.15)


def test_a_vertical_shift_is_undone_only_if_asked_for():
    data = sweeps(vertical=True)
    found = fit_wlf(data, 298.15, vertical=True)
    assert pytest.approx((KNOWN.C1, KNOWN.C2), rel=2e-3) == (found.C1, found.C2)
    master = master_curve(data, KNOWN, vertical=True)
    np.testing.assert_allclose(master.storage, 2e6 * SERIES.storage(master.omega), rtol=1e-12)
    np.testing.assert_allclose(master.loss, 2e6 * SERIES.loss(master.omega), rtol=1e-12)
    plain = master_curve(data, KNOWN)
    assert np.max(np.abs(plain.storage / (2e6 * SERIES.storage(plain.omega)) - 1)) > 0.05


def test_master_curve_is_sorted_and_complete():
    master = master_curve(sweeps()[::-1], KNOWN)
    assert master.omega.size == 7 * 16 and np.all(np.diff(master.omega) >= 0)
    assert master.temperature == 298.15
    np.testing.assert_allclose(master.storage, 2e6 * SERIES.storage(master.omega), rtol=1e-12)


def test_refusals():
    with pytest.raises(ValueError, match="need at least 3 temperatures, found 2"):
        fit_wlf(sweeps()[:2], 298.15)
    with pytest.raises(ValueError, match=r"ends at 196\.55 K, found a temperature of 190 K"):
        KNOWN.log_shift([298.0, 190.0])
    with pytest.raises(ValueError, match="a reference temperature of 150 K lies below"):
        KNOWN.moved_to(150.0)
    with pytest.raises(ValueError, match="expected positive constants"):
        WLF(-8.86, 101.6, 298.15)
    upside_down = [Sweep(s.omega, s.storage, s.loss, 600 - s.temperature) for s in sweeps()]
    with pytest.raises(ValueError, match="lie the wrong way round: the warmer one is stiffer"):
        fit_wlf(upside_down, 298.15)
    with pytest.raises(ValueError, match=r"at 258\.15 K and 298\.15 K share no range of moduli"):
        fit_wlf(sweeps(kelvin=[258.15, 298.15, 308.15]), 298.15)
