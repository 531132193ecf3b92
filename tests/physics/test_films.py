"""Films on a rigid base against closed forms, in whole runs: flat punch on a free film, film in a periodic cell."""

import numpy as np
import pytest
from scipy.integrate import quad

from pgfmd.reference import film
from tests.physics.runs import CONTACT_MODULUS, RIGID, SINUSOID, orders, run

THICKNESS = 5.3 * 375e-6
"""Thickness [m] for which the radius of the punch is the paper's, a = h/5.3."""


def stiffness(n: int, poisson_ratio: float, *substrate: str) -> float:
    """Contact stiffness [N/m] of the smooth flat punch."""
    result = run(
        "flat-punch", *RIGID, f"grid.n={n}", "solver.accuracy=1e-3", "drive.preload=1 mN",
        f"substrate.poisson_ratio={poisson_ratio}", *substrate,
    )  # fmt: skip
    return result.contact_stiffness()


@pytest.mark.parametrize(("base", "ratio"), [("bonded", 1.26), ("sliding", 1.16)])
def test_flat_punch_on_a_film(base, ratio):
    """1.26 and 1.16 times as stiff as on a half-space, to their last digit. (The overlap in series costs 0.2 %.)"""
    half_space = stiffness(64, 0.495)
    on_film = stiffness(64, 0.495, f"substrate.thickness={THICKNESS:.9g} m", f"substrate.base={base}")
    assert on_film / half_space == pytest.approx(ratio, abs=6e-3)


@pytest.mark.parametrize("base", ["bonded", "sliding"])
def test_flat_punch_on_a_thick_film(base):
    """To first order in a/h the base's image is uniform over the contact: k = k_half / (1 - 2 a D(0)/(pi h)).

    D(0) is the integral of 1 - G_film/G_half over x = q h, here from the compliance that the reference gets by solving
    for the stresses. The next order is (a/h)^3.
    """

    def deficit(x):
        return 1 - film.compliance(x, 1.0, 1.0, 0.3, base) / film.half_space(x, 1.0, 0.3)

    image = quad(deficit, 1e-3, 30.0, epsabs=1e-8, limit=200)[0] + 1e-3
    errors = []
    half_space = stiffness(32, 0.3)
    for radii in (10.0, 20.0):
        on_film = stiffness(32, 0.3, f"substrate.thickness={radii * 375e-6:.9g} m", f"substrate.base={base}")
        # The half-space's stiffness as the grid has it takes overlap and outline out of the comparison.
        effective = half_space / CONTACT_MODULUS_03
        errors.append(abs(1 - half_space / on_film - effective * image / (np.pi * radii * 375e-6)))
    assert errors[0] < 1e-3
    assert orders(errors)[0] > 1.5


CONTACT_MODULUS_03 = 2e6 / (1 - 0.3**2)


@pytest.mark.parametrize("base", ["bonded", "sliding"])
@pytest.mark.parametrize("thickness", ["2 um", "200 um"])
def test_film_in_a_periodic_cell_is_oedometric(base, thickness):
    """In complete contact the mean displacement answers the mean pressure with h/M + 1/K_0, whatever the wave."""
    result = run(
        SINUSOID, "punch.amplitude=0.01 um", "substrate.poisson_ratio=0.3", f"substrate.thickness={thickness}",
        f"substrate.base={base}", "adhesion.range=0.05 um", "drive.preload=1 mN", "grid.n=16", "solver.accuracy=1e-4",
    )  # fmt: skip
    depth, force, pressing = result.phase("approach")
    full = np.flatnonzero(pressing == 16**2)
    first, last = full[0], full[-1]
    compliance = (depth[last] - depth[first]) / (force[last] - force[first]) * (100e-6) ** 2
    closed = film.oedometric(result.scene.substrate.thickness, 2e6, 0.3)
    overlap = 1 / result.simulation.scheme.solver.law.stiffness
    assert compliance == pytest.approx(closed + overlap, rel=2e-3)


def test_a_thick_film_in_a_periodic_cell_is_a_half_space_plus_a_spring():
    """q h = 6.3: the wave no longer feels the base. Force against depth shifts by the oedometric spring alone."""
    preload = "drive.preload=0.2 mN"
    half_space = run(SINUSOID, "grid.n=32", "solver.accuracy=1e-3", preload)
    thick = run(SINUSOID, "grid.n=32", "solver.accuracy=1e-3", preload, "substrate.thickness=100 um")
    spring = film.oedometric(100e-6, 2e6, 0.495) / (100e-6) ** 2
    forces = np.linspace(0.2, 1.0, 9) * 0.2e-3
    depths = []
    for one in (half_space, thick):
        depth, force, _ = one.phase("approach")
        touching = force > 0
        depths.append(np.interp(forces, force[touching], depth[touching]))
    assert np.max(np.abs(depths[1] - spring * forces - depths[0])) < 1e-2 * np.ptp(depths[0])
    assert pytest.approx(thick.scene.substrate.contact_modulus) == CONTACT_MODULUS
