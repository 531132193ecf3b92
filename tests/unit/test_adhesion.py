"""The cohesive law: the paper's formula, its slopes by finite differences, continuity at 0 and at the range."""

import math

import numpy as np
import pytest

from pgfmd.physics.adhesion.base import range_of_adhesion
from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.physics.adhesion.registry import LAWS
from pgfmd.physics.adhesion.repulsive import Repulsive

GAMMA, RHO = 0.05, 0.75e-6
COSINE, REPULSIVE = Cosine(GAMMA, RHO), Repulsive(GAMMA, RHO)
# Away from the places where the curvature's slope jumps.
SMOOTH = RHO * np.array([-2.0, -0.7, -0.1, 0.1, 0.33, 0.5, 0.77, 0.9, 1.2, 3.0])


def paper(gap):
    """Gamma(g), case by case, as the paper writes it."""
    if gap >= RHO:
        return 0.0
    if gap >= 0:
        return -GAMMA * (1 + math.cos(math.pi * gap / RHO)) / 2
    return -GAMMA * (1 - (math.pi * gap / RHO) ** 2 / 4)


def observed_order(derivative, function, points):
    """Order of the central difference towards `derivative`, from the errors at two spacings."""
    errors = []
    for h in (2e-2 * RHO, 1e-2 * RHO):
        difference = (function(points + h) - function(points - h)) / (2 * h)
        errors.append(np.abs(difference - derivative(points)))
    return errors


def test_the_potential_is_the_papers():
    gaps = RHO * np.linspace(-3, 2, 501)
    np.testing.assert_allclose(COSINE.potential(gaps), [paper(gap) for gap in gaps], rtol=1e-13, atol=1e-16 * GAMMA)


@pytest.mark.parametrize("law", [COSINE, REPULSIVE])
@pytest.mark.parametrize(("slope", "function"), [("traction", "potential"), ("curvature", "traction")])
def test_slopes_agree_with_central_differences_to_second_order(law, slope, function):
    coarse, fine = observed_order(getattr(law, slope), getattr(law, function), SMOOTH)
    scale = np.abs(getattr(law, slope)(SMOOTH)).max()
    # The error of a central difference is h^2/6 times the third derivative, pi^3/rho^3-like: 1.6e-4 here.
    assert np.all(fine < 2e-4 * scale)
    curved = coarse > 1e-9 * scale
    np.testing.assert_allclose(coarse[curved] / fine[curved], 4.0, rtol=1e-3)
    if law.attractive:
        assert curved.sum() >= 4


@pytest.mark.parametrize("law", [COSINE, REPULSIVE])
def test_potential_and_traction_are_continuous(law):
    for place in (0.0, RHO):
        below, above = np.nextafter(place, -1), np.nextafter(place, 1)
        assert law.potential(below) == pytest.approx(law.potential(above), abs=1e-15 * GAMMA)
        assert law.traction(below) == pytest.approx(law.traction(above), abs=1e-14 * COSINE.strength)


def test_the_curvature_is_continuous_at_contact_and_jumps_at_the_range():
    assert COSINE.curvature(-1e-30) == COSINE.curvature(0.0) == COSINE.stiffness
    assert COSINE.curvature(1e-6 * RHO) == pytest.approx(COSINE.stiffness, rel=1e-10)
    assert COSINE.curvature(RHO * (1 - 1e-9)) == pytest.approx(-COSINE.stiffness, rel=1e-12)
    assert COSINE.curvature(RHO) == 0.0


def test_the_numbers_of_the_law():
    assert COSINE.stiffness == pytest.approx(GAMMA * math.pi**2 / (2 * RHO**2), rel=1e-15)
    gaps = RHO * np.linspace(0, 1, 100_001)
    assert COSINE.traction(gaps).max() == pytest.approx(COSINE.strength, rel=1e-8)
    assert gaps[COSINE.traction(gaps).argmax()] == pytest.approx(RHO / 2, rel=1e-4)
    # Opening the interface costs the work of adhesion.
    assert np.trapezoid(COSINE.traction(gaps), gaps) == pytest.approx(GAMMA, rel=1e-9)
    assert COSINE.potential(0.0) == pytest.approx(-GAMMA, rel=1e-15) and COSINE.potential(RHO) == 0.0
    assert (COSINE.reach, REPULSIVE.reach) == (RHO, 0.0)


def test_the_repulsive_law_is_the_overlap_alone():
    gaps = RHO * np.linspace(-2, 2, 401)
    overlap = np.minimum(gaps, 0)
    np.testing.assert_allclose(REPULSIVE.potential(gaps), COSINE.stiffness * overlap**2 / 2, rtol=1e-15)
    np.testing.assert_allclose(REPULSIVE.traction(gaps), COSINE.traction(overlap), rtol=1e-15, atol=0)
    assert np.all(REPULSIVE.traction(gaps[gaps >= 0]) == 0)


def test_outside_the_punch_there_is_nothing():
    for law in (COSINE, REPULSIVE):
        assert law.potential(np.inf) == law.curvature(np.inf) == 0.0
        # sin(pi) is a rounding error, 1e-16 of the strength.
        assert law.traction(np.inf) == pytest.approx(0.0, abs=2e-16 * law.strength)


def test_shapes_are_kept():
    gaps = np.zeros((3, 5))
    for name in ("potential", "traction", "curvature"):
        assert getattr(COSINE, name)(gaps).shape == (3, 5)
        assert np.shape(getattr(COSINE, name)(0.1 * RHO)) == ()


@pytest.mark.parametrize(("n", "expected"), [(2048, 0.264e-6), (4096, 0.187e-6)])
def test_the_automatic_range_gives_the_papers_numbers(n, expected):
    modulus = 2e6 / (1 - 0.495**2)
    reach = range_of_adhesion(GAMMA, modulus, 0.156, 2 * math.pi * n / 1.5e-3)
    assert reach == pytest.approx(expected, abs=0.5e-9)
    assert Cosine(GAMMA, reach).stiffness == pytest.approx(0.156 * 2 * math.pi * n / 1.5e-3 * modulus, rel=1e-13)


@pytest.mark.parametrize(("gamma", "reach"), [(0.0, 1e-6), (0.05, 0.0), (-0.05, 1e-6), (0.05, -1e-6)])
def test_a_law_without_energy_or_range_is_refused(gamma, reach):
    with pytest.raises(ValueError, match="must be positive"):
        Cosine(gamma, reach)


def test_the_table_names_the_laws_of_a_scene():
    assert [name for name, law in LAWS.items() if not law.attractive] == ["repulsive"]
    assert all(law.__module__.endswith(f".{name.replace('-', '_')}") for name, law in LAWS.items())


def test_contact_ends_at_the_largest_traction_and_is_the_stable_side():
    for law in (Cosine(0.05, 3e-7), Repulsive(0.05, 3e-7)):
        gap = np.linspace(-1.0, 1.0, 4001) * law.range
        largest = law.traction(np.array([law.contact_gap]))[0]
        assert np.all(law.traction(gap) <= largest) and largest == law.strength
        held = gap < law.contact_gap - 1e-9 * law.range
        assert np.all(law.curvature(gap[held]) > 0.0) and np.all(law.curvature(gap[~held]) <= 1e-9 * law.stiffness)
    assert Cosine(0.05, 3e-7).contact_gap == 1.5e-7
