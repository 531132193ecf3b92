"""Elastic, round and wavy contacts, through whole runs, against Hertz, power laws, JKR, Maugis, Westergaard.

What is left of an error is said beside each tolerance: h is the grid spacing, a the contact radius.
"""

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.assemble import convolution_of
from pgfmd.physics.free_kernel import FreeHalfSpace
from pgfmd.physics.halfspace import HalfSpace
from pgfmd.reference import hertz, jkr, maugis, power_law, tabor, wavy
from pgfmd.scene import load_scene
from pgfmd.solver.far_field import far_weights
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.multiplier import free_multiplier, periodic_multiplier
from pgfmd.solver.transform import Convolution
from tests.physics.runs import CONTACT_MODULUS, RIGID, SINUSOID, WORK_OF_ADHESION, orders, radius_of_traction, run

SPHERE = 10e-3
TENSION = np.pi * WORK_OF_ADHESION * SPHERE
"""pi w R [N], the unit of adhesive forces on a sphere."""


# Hertz and power laws ------------------------------------------------------------------------------------------------
def test_hertz_force_along_the_approach_and_back():
    """From a = 9 h on the force is Hertz's to 0.5 %; the way back is the way in. No energy is lost, nothing jumps."""
    result = run("hertz", "grid.n=128", "solver.accuracy=1e-3")
    depth, force, pressing = result.phase("approach")
    later = force > 0.1 * result.scene.drive.preload
    closed = hertz.force(depth[later], SPHERE, CONTACT_MODULUS)
    assert np.max(np.abs(force[later] / closed - 1)) < 5e-3
    # Counting points that press: a grid line more or less at the rim.
    counted = np.sqrt(pressing[later] * result.spacing**2 / np.pi)
    assert np.max(np.abs(counted - hertz.contact_radius(depth[later], SPHERE))) < result.spacing
    # The solver leaves a force out of balance of 0.2 x 0.0005 preloads, on either way.
    depth_back, force_back, _ = result.phase("retract")
    loaded = force_back > 0.1 * result.scene.drive.preload
    way_back = force_back[loaded] / hertz.force(depth_back[loaded], SPHERE, CONTACT_MODULUS)
    way_in = np.interp(depth_back[loaded], depth[later], force[later] / closed)
    assert np.max(np.abs(way_back - way_in)) < 5e-3
    assert abs(np.mean(way_back - way_in)) < 1e-3
    energies = result.state.energies
    assert energies.largest_residual < 3e-3 * hertz.elastic_energy(depth[-1], SPHERE, CONTACT_MODULUS)
    assert abs(energies.work) < 3e-3 * hertz.elastic_energy(depth[-1], SPHERE, CONTACT_MODULUS)
    assert result.state.finished == "detached" and result.state.pull_off_force == 0.0


def test_hertz_contact_radius_where_the_traction_vanishes():
    for preload, points_across in ((0.5e-3, 9.6), (1e-3, 12.1), (4e-3, 19.2)):
        result = run("hertz", "grid.n=128", f"drive.preload={preload} N")
        depth = -result.preload_position
        closed = hertz.contact_radius(depth, SPHERE)
        assert closed / result.spacing == pytest.approx(points_across, rel=0.02)
        assert radius_of_traction(result) == pytest.approx(closed, rel=3e-3)


def test_hertz_contact_without_attraction_never_jumps():
    """The potential is convex. Four times the stiffness against overlap makes the force good to 0.1 % at a = 19 h."""
    result = run("hertz", "grid.n=128", "adhesion.range_factor=4", "solver.max_steps=3000")
    assert result.state.finished == "detached"
    assert result.jumps == []
    depth = -result.preload_position
    assert result.state.preload == pytest.approx(hertz.force(depth, SPHERE, CONTACT_MODULUS), rel=1e-3)


@pytest.mark.parametrize(
    ("exponent", "radius", "preload"), [(1.5, "40 mm", "4 mN"), (3, "3 mm", "0.6 mN"), (4, "2 mm", "0.15 mN")]
)
def test_power_law_force_against_indentation(exponent, radius, preload):
    """At contact radii of 9 to 17 h. The overlap in series is 0.75 % at 9 h and less at more."""
    result = run(
        "hertz", "grid.n=128", "punch.pattern=power", f"punch.exponent={exponent}", f"punch.curvature_radius={radius}",
        f"drive.preload={preload}", "solver.accuracy=1e-3",
    )  # fmt: skip
    size = result.scene.punch.curvature_radius
    # The lowest grid points, h/sqrt(2) from the axis, are z = 0: the apex between them would be this much lower.
    apex = power_law.height(result.spacing / np.sqrt(2), size, exponent)
    tested = 0
    for contact_radius in (110e-6, 160e-6, 200e-6):
        closed = power_law.force(contact_radius, size, exponent, CONTACT_MODULUS)
        if closed < result.scene.drive.preload:
            depth = power_law.indentation(contact_radius, size, exponent) - apex
            assert result.force_at(depth, "approach") == pytest.approx(closed, rel=1e-2 * 110e-6 / contact_radius)
            tested += 1
    assert tested == (1 if exponent == 1.5 else 3)


# Adhesion: JKR and Maugis --------------------------------------------------------------------------------------------
def sticky_sphere(n: int, range_factor: float):
    """Sphere with the cosine law. Ranges are long for the grid (0.156 is usual): no lattice pinning."""
    return run(
        "hertz", f"grid.n={n}", "adhesion.law=cosine", f"adhesion.range_factor={range_factor}", "drive.preload=0.2 mN"
    )


@pytest.fixture(scope="module")
def spheres():
    """Ever shorter ranges, by sqrt(2): Tabor numbers 0.52, 0.73 and 1.04."""
    return [sticky_sphere(n, 0.04) for n in (64, 128, 256)]


def test_jkr_pull_off_is_the_limit_of_short_ranges(spheres):
    """Largest tension 3/2 pi w R and snap-off at JKR's displacement; both errors fall at first order or nearly so."""
    excess = np.array([-one.state.pull_off_force / TENSION - 1.5 for one in spheres])
    assert np.all(excess > 0) and excess[-1] < 0.11
    assert np.all(orders(excess, np.sqrt(2)) > 0.7)
    limit = jkr.displacement_controlled_pull_off(SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION)
    last = [one.before_last_jump() for one in spheres]
    late = np.array([row.position / -limit.indentation - 1 for row in last])
    assert np.all(late > 0) and late[-1] < 0.12
    assert np.all(orders(late, np.sqrt(2)) > 1.0)
    # dF/dd is infinite at the snap-off, so the force there depends on how close the last step comes.
    assert last[-1].force / TENSION == pytest.approx(limit.force / TENSION, abs=0.06)


def test_maugis_brackets_the_pull_off_at_a_finite_range(spheres):
    """The cosine law is no Dugdale stress: one of equal strength is shorter, one of equal range weaker.

    Pull-off lies between Maugis's value for equal strength, pi w/(2 rho), which is too close to JKR by 4 %, and DMT's
    2 pi w R; equal range, strength w/rho, is within 2 %.
    """
    one = spheres[-1]
    reach = one.scene.adhesion.range
    assert tabor.asperity(SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION, reach) == pytest.approx(1.04, abs=0.01)
    found = -one.state.pull_off_force / TENSION

    def by_maugis(strength):
        transition = maugis.transition_parameter(SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION, strength)
        return -maugis.pull_off_force(SPHERE, WORK_OF_ADHESION, transition) / TENSION

    equal_strength = by_maugis(np.pi * WORK_OF_ADHESION / (2 * reach))
    assert equal_strength < found < 2.0
    assert found / equal_strength == pytest.approx(1.04, abs=0.01)
    assert found == pytest.approx(by_maugis(WORK_OF_ADHESION / reach), rel=0.02)


def test_jkr_force_against_indentation_in_contact(spheres):
    """Retracting from d = 0 to half of JKR's snap-off: JKR plus an error that falls with the range."""
    limit = jkr.displacement_controlled_pull_off(SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION).indentation
    depth = np.linspace(0.0, 0.5 * limit, 11)
    radius = jkr.contact_radius_at_indentation(depth, SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION)
    closed = jkr.force(radius, SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION)
    errors = [np.max(np.abs(one.force_at(depth, "retract") - closed)) / TENSION for one in spheres]
    assert errors[-1] < 0.13
    assert np.all(orders(errors, np.sqrt(2)) > 0.7)


def test_snaps_of_a_sphere_are_booked(spheres):
    """Elastic: all of the loop's work is released in jumps; the release at pull-off is the largest on the way back."""
    for one in spheres[1:]:
        energies = one.state.energies
        assert energies.viscous == 0.0
        assert energies.released == pytest.approx(energies.work, rel=2e-2)
        assert {row.phase for row in one.jumps} == {"approach", "retract"}
        assert one.rows[-1].force == 0.0


# Wavy contact --------------------------------------------------------------------------------------------------------
def test_westergaard_contact_fraction():
    """Both rims of the strip are known to a grid line: first order in the spacing."""
    wave_number = 2 * np.pi / 100e-6
    closing = wavy.full_contact_pressure(1e-6, wave_number, CONTACT_MODULUS)
    for n in (32, 64, 128):
        result = run(SINUSOID, "solver.accuracy=1e-3", f"grid.n={n}", f"drive.preload={1.2 * closing * 1e-8:.9g} N")
        _, force, pressing = result.phase("approach")
        pressure = force / 1e-8
        closed = wavy.contact_fraction(pressure, 1e-6, wave_number, CONTACT_MODULUS)
        touching = pressure > 0
        # Just before it closes the gap's width falls like a square root, and its last lines close at once.
        error = np.abs(pressing / n**2 - closed)[touching & (pressure < 0.95 * closing)]
        # Lines come in mirrored pairs, so counting is off by up to two of them, and the overlap adds up to one.
        assert error.max() < 3.0 / n
        assert pressing[-1] == n**2 and pressing[np.searchsorted(pressure, 0.9 * closing)] < n**2


def test_westergaard_pressure():
    wave_number = 2 * np.pi / 100e-6
    closing = wavy.full_contact_pressure(1e-6, wave_number, CONTACT_MODULUS)
    result = run(SINUSOID, "grid.n=128", f"drive.preload={0.5 * closing * 1e-8:.9g} N")
    x, _ = result.simulation.points.coordinates()
    # The summit, where z = z0 (1 + cos qx) vanishes, is at x = L/2.
    closed = wavy.pressure(x - 50e-6, result.state.preload / 1e-8, 1e-6, wave_number, CONTACT_MODULUS)
    # One grid line at the rim has another share of contact; the root there makes that h^1.5 on average.
    difference = np.abs(-result.preloaded - closed)
    assert difference.mean() < 5e-3 * closing
    assert np.median(difference[closed > 0.2 * closing]) < 1e-2 * closing


# The operator, free and periodic -------------------------------------------------------------------------------------
@pytest.mark.parametrize("n", [12, 17])
def test_free_transform_is_the_direct_sum(n):
    """Same bits no, same sum yes: padding leaves no image of the punch."""
    points = PunchPoints(Grid(n, 1e-3), 0.25e-3, MPI.COMM_SELF)
    compliance = FreeHalfSpace(CONTACT_MODULUS)
    scene = load_scene("flat-punch", [f"grid.n={n}", "grid.length=1 mm", "punch.radius=250 um"])
    operator = convolution_of(scene, points)
    x, y = points.coordinates()
    dense = compliance.kernel(x[:, None] - x, y[:, None] - y, points.grid.spacing)
    traction = np.random.default_rng(4).standard_normal(points.size)
    found = operator(traction, points.zeros())
    np.testing.assert_allclose(found, dense @ traction, rtol=0, atol=1e-13 * np.abs(dense @ traction).max())


def test_uniform_pressure_on_a_disc():
    """Centre 2 p a/E*, rim 4 p a/(pi E*). The error is that of the disc's area on the grid: second order on average."""
    errors = []
    for n in (64, 128, 256):
        points = PunchPoints(Grid(n, 1.5e-3), 375e-6, MPI.COMM_SELF)
        compliance = FreeHalfSpace(CONTACT_MODULUS)
        operator = Convolution(points, 2 * points.nb, free_multiplier(compliance, points.grid.spacing))
        u = operator(np.full(points.size, 1e4), points.zeros())
        x, y = points.coordinates()
        r = np.hypot(x, y)
        radius = np.sqrt(points.total / np.pi) * points.grid.spacing
        centre = u[r < points.grid.spacing].mean() / (2 * 1e4 * radius / CONTACT_MODULUS) - 1
        rim = u[r > r.max() - 0.2 * points.grid.spacing].mean() / (4 * 1e4 * radius / (np.pi * CONTACT_MODULUS)) - 1
        errors.append(abs(centre))
        assert abs(rim) < 2.0 * points.grid.spacing / radius
    assert errors[-1] < 1e-4
    assert errors[-1] < errors[0] / 8


def interpolate(surface, length, x, y):
    """Trigonometric interpolation of a whole-cell surface (n, n), points at (i + 1/2) h - L/2, at one point."""
    n = surface.shape[0]
    wave = 2 * np.pi * np.fft.fftfreq(n, 1 / n) / length
    first = 0.5 * length / n - 0.5 * length

    def weights(at):
        phase = np.exp(1j * wave * (at - first))
        if n % 2 == 0:
            phase[n // 2] = phase[n // 2].real
        return phase / n

    return float((weights(y) @ np.fft.fft2(surface) @ weights(x)).real)


@pytest.mark.parametrize("n", [32, 37])
@pytest.mark.parametrize("prestrain", [(1.0, 1.0), (1.0, 1.7)])
def test_far_displacement_is_that_of_the_whole_cell(n, prestrain):
    """6 u(corner) - 5 u(edge) from the weights and from the surface. (The 11 % from a free surface are its own.)"""
    length = 1.5e-3
    points = PunchPoints(Grid(n, length), 375e-6, MPI.COMM_SELF)
    compliance = HalfSpace(CONTACT_MODULUS, prestrain)
    operator = Convolution(points, n, periodic_multiplier(compliance, length))
    load = np.random.default_rng(1).standard_normal(points.size) - 1.0
    surface, first_row = operator.whole_cell(load)
    assert first_row == 0 and surface.shape == (n, n)
    corner = interpolate(surface, length, 0.5 * length, 0.5 * length)
    # u(L/2, 0) of the rule and its mirror image agree for isotropic solids only; x = 0 runs along axis 1 here.
    edge = interpolate(surface, length, 0.0, 0.5 * length), interpolate(surface, length, 0.5 * length, 0.0)
    closed = 6 * corner - 5 * np.array(edge)
    found = far_weights(compliance, points) @ load
    assert np.min(np.abs(found - closed)) < 1e-10 * np.abs(surface).max()


def test_rigid_settings_are_those_of_the_hertz_scene():
    """The shipped scene and the overrides that other tests share make the same range."""
    shipped, shared = load_scene("hertz"), load_scene("hertz", RIGID)
    assert shared.adhesion == shipped.adhesion and shared.rheology == shipped.rheology
