"""Radii of adhesive spheres: JKR's pressed part, Maugis's two radii, and the rings that solve any range of our law."""

import math

import numpy as np
import pytest

from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.reference import cohesive_sphere, hertz, jkr, maugis

RADIUS, MODULUS, WORK = 10e-3, 2.65e6, 0.05
ABOUT = (RADIUS, MODULUS, WORK)
TENSION = math.pi * WORK * RADIUS


def law_of(tabor):
    return Cosine(WORK, RADIUS ** (1 / 3) * (WORK / MODULUS) ** (2 / 3) / tabor)


def solved(contact_radius, tabor, rings_per_zone=32):
    """The equilibrium whose traction is largest at the contact radius."""
    law = law_of(tabor)
    return cohesive_sphere.equilibrium(contact_radius, 0.5 * law.range, RADIUS, MODULUS, law, rings_per_zone)


def test_jkrs_pressure_changes_sign_at_the_compressed_radius():
    for a in (150e-6, 200e-6, 300e-6):
        pressed = float(jkr.compressed_radius(a, *ABOUT))
        assert 0 < pressed < a
        assert abs(jkr.pressure(pressed, a, *ABOUT)) < 1e-9 * float(jkr.pressure(0.0, a, *ABOUT))
        assert jkr.pressure(0.999 * pressed, a, *ABOUT) > 0 > jkr.pressure(1.001 * pressed, a, *ABOUT)
    # A small contact is pulled all over; without adhesion all of it is pressed.
    assert jkr.compressed_radius(100e-6, *ABOUT) == 0.0
    assert jkr.compressed_radius(100e-6, RADIUS, MODULUS, 0.0) == 100e-6


def dugdale_pressure(r, a, c, strength, modulus=MODULUS):
    """Maugis's pressure [Pa]: Hertz's, less the pull of the zone on the contact, and the zone itself."""
    inside = r < a
    x = np.where(inside, r, 0.0)
    hertzian = 2 * modulus * np.sqrt(a * a - x * x) / (np.pi * RADIUS)
    pull = strength / np.pi * np.arccos((2 * a * a - c * c - x * x) / (c * c - x * x))
    return np.where(inside, hertzian - pull, np.where(r < c, -strength, 0.0))


@pytest.mark.parametrize("transition", [0.3, 1.0, 4.0])
def test_maugis_states_solve_the_half_space(transition):
    """The pressure of each state, put on rings: its sum is the force, the contact is the sphere's shape at the depth of
    the state, and the gap at the outer radius is the range."""
    strength = transition / maugis.transition_parameter(*ABOUT, 1.0)
    state = maugis.state_at(*ABOUT, strength, contact_radius=220e-6)
    a, c = float(state.contact_radius), float(state.outer_radius)
    assert a == pytest.approx(220e-6, rel=1e-9) and c > a
    rings = np.concatenate((np.linspace(0, a, 801), np.linspace(a, c, 401)[1:], [1.001 * c]))
    sphere = cohesive_sphere.CohesiveSphere(RADIUS, MODULUS, law_of(1.0), rings)
    r = sphere.distance
    pressure = dugdale_pressure(r, a, c, strength)
    assert pressure @ sphere.area == pytest.approx(float(state.force), abs=2e-3 * TENSION)
    gap = r**2 / (2 * RADIUS) - float(state.indentation) + sphere.compliance @ pressure
    reach = WORK / strength
    assert np.abs(gap[r < 0.98 * a]).max() < 5e-3 * reach
    assert np.interp(c, r, gap) == pytest.approx(reach, rel=0.01)


def test_maugis_radii_join_dmt_and_jkr():
    for force in (-TENSION, 0.0, 2 * TENSION):
        closed = float(jkr.contact_radius_at_force(force, *ABOUT))
        short = maugis.state_at(*ABOUT, 40 / maugis.transition_parameter(*ABOUT, 1.0), force=force)
        assert closed == pytest.approx(float(short.contact_radius), rel=3e-3)
        assert closed == pytest.approx(float(short.outer_radius), rel=3e-3)
        assert float(short.contact_radius) < float(short.outer_radius)
        long = maugis.state_at(*ABOUT, 1e-4 / maugis.transition_parameter(*ABOUT, 1.0), force=force)
        dmt = float(np.cbrt(3 * RADIUS * (force + 2 * TENSION) / (4 * MODULUS)))
        assert float(long.contact_radius) == pytest.approx(dmt, rel=3e-3)


def test_maugis_state_is_found_by_any_of_its_numbers():
    strength = WORK / 1e-6
    state = maugis.state_at(*ABOUT, strength, force=-0.5 * TENSION)
    for name, value in zip(maugis.States._fields, state, strict=True):
        again = maugis.state_at(*ABOUT, strength, **{name: float(value)})
        np.testing.assert_allclose(again, state, rtol=1e-6)
    with pytest.raises(ValueError, match="no equilibrium with force"):
        maugis.state_at(*ABOUT, strength, force=-2.1 * TENSION)
    with pytest.raises(TypeError, match="one of force"):
        maugis.state_at(*ABOUT, strength, force=0.0, indentation=0.0)


def test_uniform_pressure_on_a_disc():
    """Love: 2 p b/E* in the middle, 4 p b/(pi E*) at the rim, a point force far away; both sides join at the rim."""
    b = 100e-6
    at = cohesive_sphere.disc_displacement(np.array([0.0, b, b * (1 + 1e-9), 1e3 * b]), b, MODULUS)
    expected = [2 * b / MODULUS, *[4 * b / (math.pi * MODULUS)] * 2, b / (1e3 * MODULUS)]
    np.testing.assert_allclose(at, expected, rtol=1e-6)
    assert cohesive_sphere.disc_displacement(b, 0.0, MODULUS) == 0.0


def test_rings_have_the_contact_radius_in_the_middle_of_one():
    for zone in (1e-6, 30e-6, 1e-3):
        edges = cohesive_sphere.rings(200e-6, zone)
        middles = 0.5 * (edges[1:] + edges[:-1])
        assert edges[0] == 0.0 and np.all(np.diff(edges) > 0)
        assert np.abs(middles - 200e-6).min() < 1e-12
        assert edges[-1] - 200e-6 >= max(2 * zone, 100e-6)
    with pytest.raises(ValueError, match="begin with 0 and ascend"):
        cohesive_sphere.CohesiveSphere(RADIUS, MODULUS, law_of(1.0), [0.0, 2e-5, 1e-5])


def test_rings_tend_to_jkr():
    """Radius of the largest traction against JKR's at the same depth: an error that vanishes with the range, between
    orders one and two. The points in overlap tend to the pressed part of JKR's contact, and not to JKR's radius."""
    for a in (300e-6, 200e-6):
        errors = []
        for tabor in (0.5, 1.0, 2.0, 4.0):
            found = solved(a, tabor)
            assert found.radius_within(0.5 * law_of(tabor).range) == pytest.approx(a, rel=1e-6)
            closed = float(jkr.contact_radius_at_indentation(found.indentation, *ABOUT))
            errors.append(a / closed - 1)
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        assert np.all((orders > 1.2) & (orders < 2.0)) and 0 < errors[-1] < 0.012
        overlap, pressed = found.radius_within(0.0), float(jkr.compressed_radius(closed, *ABOUT))
        assert overlap == pytest.approx(pressed, rel=2e-3) and overlap < 0.83 * a


def test_rings_tend_to_hertz():
    """A force far above pi w R, through a stiff overlap."""
    law = Cosine(1e-7, 2e-10)
    found = cohesive_sphere.equilibrium(100e-6, 1e-10, RADIUS, MODULUS, law)
    assert found.force == pytest.approx(float(hertz.force(found.indentation, RADIUS, MODULUS)), rel=5e-3)
    assert float(hertz.contact_radius(found.indentation, RADIUS)) == pytest.approx(100e-6, rel=0.01)


def test_rings_do_virtual_work():
    """Along the path F d(delta) = dU, U elastic and adhesive; the largest tension is near Maugis's of equal range."""
    law, rings = law_of(1.0), cohesive_sphere.rings(200e-6, 50e-6)
    sphere = cohesive_sphere.CohesiveSphere(RADIUS, MODULUS, law, rings)
    middle, energies, found, start = sphere.ring_at(200e-6), [], [], None
    for ring in range(middle - 6, middle + 7):
        start = sphere.at_ring(ring, 0.5 * law.range, start)
        traction = law.traction(start.gap)
        elastic = 0.5 * (traction * sphere.area) @ (sphere.compliance @ traction)
        energies.append(elastic + law.potential(start.gap) @ sphere.area)
        found.append(start)
    force, depth = np.array([(one.force, one.indentation) for one in found]).T
    work = 0.5 * (force[1:] + force[:-1]) @ np.diff(depth)
    assert work == pytest.approx(energies[-1] - energies[0], rel=3e-3)
    maugis_pull = maugis.pull_off_force(RADIUS, WORK, maugis.transition_parameter(*ABOUT, WORK / law.range))
    assert min(solved(a, 1.0).force for a in (190e-6, 200e-6, 210e-6)) == pytest.approx(maugis_pull, rel=0.02)


def test_rings_converge():
    forces = [solved(250e-6, 1.5, count).force for count in (16, 32, 64, 128)]
    changes = np.abs(np.diff(forces))
    assert changes[-1] < 0.005 * TENSION and changes[-1] < changes[0]


def test_rings_out_of_reach_are_refused():
    sphere = cohesive_sphere.CohesiveSphere(RADIUS, MODULUS, law_of(0.5), np.linspace(0, 220e-6, 200))
    with pytest.raises(ArithmeticError, match="no equilibrium with the gap"):
        sphere.at_ring(180, 0.5 * law_of(0.5).range)
