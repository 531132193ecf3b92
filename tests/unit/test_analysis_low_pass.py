"""The low-pass filter: what it takes out, what it leaves, and that it delays nothing."""

import numpy as np
import pytest

from pgfmd.analysis.low_pass import filtered, low_pass
from tests.unit.analysis_loops import loop_of, triangle

RESOLUTION = 1e-7


def uneven(length, rows, seed=3):
    """Displacements of uneven steps, from a fifth of the mean to nearly twice as long."""
    x = (np.arange(rows) + np.random.default_rng(seed).uniform(-0.4, 0.4, rows)) * length / (rows - 1)
    x[0], x[-1] = 0.0, length
    return x


def test_a_fine_ripple_goes_and_a_long_wave_stays():
    x = uneven(20e-6, 60_000)
    wave, ripple = np.sin(2 * np.pi * x / 5e-6), 0.3 * np.sin(2 * np.pi * x / 0.01e-6)
    inner = (x > 0.5e-6) & (x < 19.5e-6)
    assert np.max(np.abs(low_pass(x, wave, RESOLUTION) - wave)) < 1e-3
    assert np.max(np.abs(low_pass(x, ripple, RESOLUTION)[inner])) < 1e-2 * 0.3
    assert np.max(np.abs(low_pass(x, wave + ripple, RESOLUTION) - wave)[inner]) < 4e-3


@pytest.mark.parametrize("wavelength", [0.15e-6, 0.3e-6, 1e-6])
def test_a_wave_keeps_what_the_formula_says(wavelength):
    x = np.linspace(0, 10e-6, 20_001)
    wave = np.cos(2 * np.pi * x / wavelength)
    inner = (x > 1e-6) & (x < 9e-6)
    kept = low_pass(x, wave, RESOLUTION)[inner] @ wave[inner] / (wave[inner] @ wave[inner])
    width = RESOLUTION / np.sqrt(12)
    assert kept == pytest.approx(np.exp(-2 * (np.pi * width / wavelength) ** 2), rel=5e-3)


def test_straight_lines_and_end_points_stay_and_rows_may_be_few():
    x = uneven(3e-6, 12)
    line = 4e-3 - 2e3 * x
    np.testing.assert_allclose(low_pass(x, line, RESOLUTION), line, rtol=0, atol=1e-12)
    bent = np.abs(x - 1e-6) * 1e3
    found = low_pass(x, bent, RESOLUTION)
    assert (found[0], found[-1]) == pytest.approx((bent[0], bent[-1]))


def test_the_area_and_the_place_of_a_dip_are_kept():
    x = uneven(10e-6, 5_000)
    force = 2e-3 - 1e3 * x - 3e-3 * np.exp(-0.5 * ((x - 4e-6) / 0.05e-6) ** 2)
    smooth = low_pass(x, force, RESOLUTION)
    assert np.trapezoid(smooth, x) == pytest.approx(np.trapezoid(force, x), rel=1e-3)
    # Wider and shallower, at the same place whichever way the punch goes.
    dip = smooth - (2e-3 - 1e3 * x)
    assert dip.min() > -2.9e-3
    assert np.trapezoid(x * dip, x) / np.trapezoid(dip, x) == pytest.approx(4e-6, abs=2e-9)
    np.testing.assert_allclose(low_pass(-x[::-1], force[::-1], RESOLUTION)[::-1], smooth, rtol=1e-6, atol=1e-9)


def test_a_jump_becomes_a_step_as_wide_as_the_resolution():
    x = np.array([0.0, 2e-6, 2e-6, 4e-6])
    found = low_pass(np.linspace(0, 4e-6, 4001), np.where(np.linspace(0, 4e-6, 4001) < 2e-6, 1.0, 0.0), RESOLUTION)
    place = np.linspace(0, 4e-6, 4001)
    wide = np.ptp(place[(found > 0.05) & (found < 0.95)])
    assert 0.5 * RESOLUTION < wide < 1.5 * RESOLUTION
    assert np.isfinite(low_pass(x, np.array([1.0, 1.0, 0.0, 0.0]), RESOLUTION)).all()


def test_branches_are_not_mixed_and_the_turn_stays():
    displacement, turn = triangle(10e-6, 4e-6, rows=2001, turn_rows=1001)
    way_out = -1e3 * displacement - 5e-3 * (displacement + 10e-6) / 14e-6
    force = np.where(np.arange(2001) < turn, -1e3 * displacement, way_out)
    loop = filtered(loop_of(displacement, force, turn, jumps=[1500]), RESOLUTION)
    np.testing.assert_allclose(loop.force, force, rtol=0, atol=1e-9)
    assert not loop.jump.any()


def test_a_wrong_resolution_is_refused():
    x = np.linspace(0, 1e-5, 50)
    for resolution in (0.0, -1e-7, np.nan, np.inf):
        with pytest.raises(ValueError, match="expected a positive length"):
            low_pass(x, x, resolution)
    with pytest.raises(ValueError, match="expected at least"):
        low_pass(x, x, 1e-12)
