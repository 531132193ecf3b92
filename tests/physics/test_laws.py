"""Laws of adhesion in whole solutions: Maugis's sphere for Dugdale's law, one pull-off for all laws of short range, and
energies that add up."""

import math

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.physics.adhesion.dugdale import Dugdale
from pgfmd.physics.adhesion.exponential import Exponential
from pgfmd.physics.adhesion.lennard_jones import LennardJones
from pgfmd.reference import maugis
from pgfmd.reference.cohesive_sphere import CohesiveSphere
from pgfmd.scene import load_scene
from pgfmd.solver.simulation import Observer
from scripts.studies.laws import run as study
from tests.physics.runs import CONTACT_MODULUS, WORK_OF_ADHESION

RADIUS = 10e-3
TENSION = math.pi * WORK_OF_ADHESION * RADIUS
TABOR = RADIUS ** (1 / 3) * (WORK_OF_ADHESION / CONTACT_MODULUS) ** (2 / 3)
"""Tabor number times range [m]."""


def pull_off(law, largest_radius, rings):
    """The largest tension [N] of a sphere under a law, by rings: the contact shrinks from ring to ring."""
    outer = 1.25 * math.sqrt(largest_radius**2 + 2.4 * RADIUS * law.reach)
    sphere = CohesiveSphere(RADIUS, CONTACT_MODULUS, law, np.linspace(0.0, outer, rings + 1))
    found, least = None, 0.0
    for ring in range(sphere.ring_at(largest_radius), 2, -1):
        found = sphere.at_ring(ring, law.contact_gap, found)
        if found.force > 0.99 * least and least < 0.0:
            return -least
        least = min(least, found.force)
    raise AssertionError("the tension has no maximum")


@pytest.mark.parametrize(("tabor", "radius", "rings"), [(0.1, 250e-6, 120), (0.3, 190e-6, 160), (1.0, 185e-6, 280)])
def test_dugdales_law_tends_to_maugis(tabor, radius, rings):
    """The error of its smooth ends is of first order in their width: without it, less than 1 % is left."""
    reach = TABOR / tabor
    found = [
        pull_off(Dugdale(WORK_OF_ADHESION, reach, 60 * WORK_OF_ADHESION / reach**2, width), radius, rings)
        for width in (0.2, 0.1)
    ]
    transition = maugis.transition_parameter(RADIUS, CONTACT_MODULUS, WORK_OF_ADHESION, WORK_OF_ADHESION / reach)
    closed = -maugis.pull_off_force(RADIUS, WORK_OF_ADHESION, transition)
    assert 2 * found[1] - found[0] == pytest.approx(closed, rel=0.01)
    assert found[1] == pytest.approx(closed, rel=0.02)


def test_laws_of_short_range_have_one_pull_off():
    """Equal work of adhesion, and lengths over which tractions come and go: as these fall the laws' tensions of a sphere
    come together, on the way to JKR's."""
    spread, largest = [], []
    for tabor, radius, rings in ((0.7, 210e-6, 100), (2.0, 210e-6, 200)):
        length = TABOR / tabor
        # sqrt(2 K_0 / gamma) rho/pi.
        per_length = {Cosine: 1.0, Dugdale: math.sqrt(5.0 / math.pi), Exponential: 0.4502, LennardJones: 1.81}
        laws = [kind(WORK_OF_ADHESION, factor * length) for kind, factor in per_length.items()]
        np.testing.assert_allclose([law.length for law in laws], length, rtol=0.01)
        found = np.array([pull_off(law, radius, rings) for law in laws]) / TENSION
        spread.append(np.ptp(found))
        largest.append(found)
    short, long = largest[1] - 1.5, largest[0] - 1.5
    assert np.all(short > 0.0) and np.all(short < 0.5 * long) and spread[1] < 0.7 * spread[0]


@pytest.mark.parametrize("law", ["cosine", "dugdale"])
def test_a_dead_load_pulls_off_at_the_largest_tension_of_the_law(law):
    """A flat punch: on the way to Kendall's force as the range falls, and never beyond its strength. A sphere: as by rings."""
    found = [study.pulled_off(study.flat(law, n), "flat", study.KENDALL) for n in (32, 64)]
    shares = [one.force / one.closed for one in found]
    assert shares[0] < shares[1] < 1.0 and 1.0 - shares[1] < 0.6 * (1.0 - shares[0])
    # The outline on the grid is up to 2 % wider.
    assert all(one.force < 1.04 * math.pi * study.RADIUS**2 * one.strength for one in found)
    round_ = study.pulled_off(
        study.sphere(138, {"law": law, "range_factor": 0.04}), "sphere", study.JKR, with_rings=True
    )
    assert round_.force == pytest.approx(round_.rings, rel=0.012)
    assert all(one.residual < 0.006 for one in (*found, round_))


@pytest.mark.parametrize("scheme", ["inertialess", "quasistatic", "gfmd"])
def test_energies_of_dugdales_law_add_up(scheme):
    """In each scheme what the machine has put in is stored or lost; the contact was attracted, and is gone. Tractions and
    adhesive energy of each step are those of the law as NumPy has it."""
    keys = [
        f"solver.scheme={scheme}",
        "adhesion.law=dugdale",
        "grid.n=24",
        "drive.preload=2 mN",
        "solver.accuracy=3e-3",
    ]
    if scheme == "gfmd":
        keys += ["solver.gfmd.omega=15700 rad/s", "solver.gfmd.dt=20 us", "drive.speed=1 mm/s"]
    simulation = assemble(load_scene("tri-tack", keys), MPI.COMM_SELF)
    simulation.observers.append(AsNumPyHasIt())
    state = simulation.run()
    assert state.energies.largest_residual < 0.02 * state.energies.work_of_separation
    assert state.pull_off_force < -1e-3 and abs(state.force) < 1e-15 and state.energies.adhesive == 0.0


class AsNumPyHasIt(Observer):
    """Compares the kernels' tractions and energies with the law's own."""

    def observe(self, simulation, event):
        state, scheme, points = simulation.state, simulation.scheme, simulation.points
        law, gap = scheme.law, np.float64(state.position) + scheme.height - state.surface_displacement
        np.testing.assert_allclose(state.traction, law.traction(gap), rtol=1e-10, atol=1e-10 * law.strength)
        stored = points.images * law.potential(gap).sum() * points.grid.cell_area
        assert state.energies.adhesive == pytest.approx(
            stored, rel=1e-9, abs=1e-9 * law.work_of_adhesion * points.grid.cell_area
        )
