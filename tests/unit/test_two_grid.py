"""Conjugate gradients with a coarser grid: against dense linear algebra, and against those without."""

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd import coarsening
from pgfmd.assemble import assemble
from pgfmd.commands.check import report
from pgfmd.forecast.effort import effort_of
from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.physics.halfspace import HalfSpace
from pgfmd.scene import load_scene
from pgfmd.solver.conjugate_gradients import ConjugateGradients
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.mirrored_transform import MirroredConvolution
from pgfmd.solver.multiplier import periodic_multiplier
from pgfmd.solver.transform import Convolution
from pgfmd.solver.two_grid import Cells, CoarseGrid, TwoGrid, coarse_points_of

MODULUS, LENGTH = 2e6, 1e-3
CASES = [
    (48, 4, 0.25, ""),
    (48, 4, 0.25, "x"),
    (48, 4, 0.25, "xy"),
    (70, 5, 0.31, "x"),
    (64, 8, 0.5, "xy"),
    (56, 7, 0.2, ""),
]


def points_of(n, share, mirror=""):
    return PunchPoints(Grid(n, LENGTH), share * LENGTH, MPI.COMM_SELF, mirror=mirror)


def operator_on(points, dtype=np.float64):
    kind = MirroredConvolution if points.mirror else Convolution
    return kind(points, points.grid.n, periodic_multiplier(HalfSpace(MODULUS), LENGTH), dtype=dtype)


def places(points, m):
    """Row and column of each point's cell in the coarser cell, and both coordinates in spacings of it."""
    x, y = points.coordinates()
    spacing, n = m * points.grid.spacing, points.grid.n // m
    column, row = (value / spacing + 0.5 * n for value in (x, y))
    return np.floor(row).astype(int), np.floor(column).astype(int), row, column


def spread(coarse, values):
    """Numbers of the coarse points, images included, in the whole coarser cell, (n, n); zero elsewhere."""
    n = coarse.grid.n
    plane = np.zeros((n, n))
    x, y = coarse.coordinates()
    for sx in (1, -1) if "x" in coarse.mirror else (1,):
        for sy in (1, -1) if "y" in coarse.mirror else (1,):
            row, column = (
                np.rint(value / coarse.grid.spacing + 0.5 * (n - 1)).astype(int) for value in (sy * y, sx * x)
            )
            plane[row, column] = values
    return plane


@pytest.mark.parametrize(("n", "m", "share", "mirror"), CASES)
def test_cells_have_the_means_of_their_points(n, m, share, mirror):
    points = points_of(n, share, mirror)
    coarse = coarse_points_of(points, m, MPI.COMM_SELF)
    cells, values = Cells(points, coarse), np.random.default_rng(3).standard_normal(points.size)
    found = np.full(cells.shape, np.nan)
    cells.means(values, found)
    row, column, *_ = places(points, m)
    expected = np.zeros((n // m, n // m))
    np.add.at(expected, (row, column), values / m**2)
    # All of them are at coarse points, so the sum stays.
    kept = cells.at_points(found)
    assert points.images * kept.sum() * m**2 == pytest.approx(points.images * values.sum())
    x, y = coarse.coordinates()
    here = [np.rint(value / coarse.grid.spacing + 0.5 * (n // m - 1)).astype(int) for value in (y, x)]
    np.testing.assert_allclose(kept, expected[tuple(here)], atol=1e-14)
    rough, rows = np.abs(values - expected[row, column]), np.zeros((1, points.rows))
    stiff = (values > 0.0).astype(float)
    assert cells.roughness(values, stiff, found, rows) == pytest.approx((rough * stiff).max(), rel=1e-12)


@pytest.mark.parametrize(("n", "m", "share", "mirror"), CASES)
def test_the_dual_of_a_direction_is_the_residual_without_what_the_cells_correct(n, m, share, mirror):
    """d = r - K P s_c, P bilinear, but for a constant in each cell, which gives whole cells the mean t_c."""
    points, rng = points_of(n, share, mirror), np.random.default_rng(4)
    coarse = coarse_points_of(points, m, MPI.COMM_SELF)
    cells = Cells(points, coarse)
    r, k = rng.standard_normal((2, points.size))
    s, t = rng.standard_normal((2, coarse.size))
    means, d = np.zeros(cells.shape), points.zeros()
    cells.means(r, means)
    cells.turn(r, k, s, t, means, d)
    row, column, y, x = places(points, m)
    plane = np.pad(spread(coarse, s), 1)
    top, left = np.floor(y - 0.5).astype(int), np.floor(x - 0.5).astype(int)
    b, a = y - 0.5 - top, x - 0.5 - left
    between = (1 - b) * ((1 - a) * plane[top + 1, left + 1] + a * plane[top + 1, left + 2])
    between += b * ((1 - a) * plane[top + 2, left + 1] + a * plane[top + 2, left + 2])
    change = d - (r - k * between)
    label = row * (n // m) + column
    for cell in np.unique(label):
        inside = label == cell
        assert np.ptp(change[inside]) < 1e-12
        if inside.sum() == m**2:
            assert d[inside].mean() == pytest.approx(spread(coarse, t).ravel()[cell], abs=1e-12)


def solvers(n=96, m=4, mirror="x", dtype=np.float64):
    """Conjugate gradients with a coarser grid and without, on the same points."""
    points, law = points_of(n, 0.25, mirror), Cosine(0.05, 2e-6)
    coarse = coarse_points_of(points, m, MPI.COMM_SELF)
    shortest = float(HalfSpace(MODULUS)(np.pi / coarse.grid.spacing, 0.0))
    grid = CoarseGrid(coarse, operator_on(coarse, dtype), shortest)
    return TwoGrid(points, operator_on(points, dtype), law, False, grid), ConjugateGradients(
        points, operator_on(points), law, False
    )


def contact(points, stiffness):
    """K of a contact with rough edges, and a residual in it."""
    x, y = points.coordinates()
    wave = np.cos(2e4 * x) * np.cos(3e4 * y)
    return np.where(wave > 0.2, stiffness, np.where(wave > 0.0, -0.02 * stiffness, 0.0)), np.where(
        wave > 0.0, 1e3 * (1 + y / LENGTH), 0.0
    )


@pytest.mark.parametrize("mirror", ["", "x", "xy"])
def test_corrections_solve_newtons_equations_in_fewer_pairs(mirror):
    two, one = solvers(mirror=mirror)
    k, r = contact(two.points, 2e11)
    compliance, loose = 0.3, (1e30, 1e30, float(r.sum()) * two.points.images)
    for cg in (two, one):
        cg.curvature[:], cg.r[:] = k, r
    before = two.operator.pairs
    pairs, size, bent = two.correct(compliance, 1e-5, *loose)
    assert not bent and pairs == two.operator.pairs - before and two.coarse_pairs > 0
    # s = A t, and t = r - K s to about the tolerance.
    s = operator_on(two.points)(two.t, two.points.zeros(), compliance)
    np.testing.assert_allclose(two.s, s, atol=1e-9 * np.abs(s).max())
    one.linear_share, one.forcing = 1e-6, 1e-6
    one.correct(compliance, 1e-5, *loose)
    interacting = k != 0.0
    error = np.abs(two.s - one.s)[interacting].max() / two.law.range
    assert error < 1e-5 + 0.05 * size and size == pytest.approx(
        np.abs(one.s)[interacting].max() / two.law.range, rel=0.06
    )
    one.linear_share, one.forcing = ConjugateGradients.linear_share, ConjugateGradients.forcing
    one.r[:] = r
    assert pairs <= 0.6 * one.correct(compliance, 1e-5, *loose)[0]


def test_where_the_potential_bends_down_the_last_direction_leads_to_the_edge_of_trust():
    two, one = solvers()
    k, r = contact(two.points, -3e11)
    for cg in (two, one):
        cg.curvature[:], cg.r[:] = k, r
    limits = (0.3, 1e-5, 1e30, 0.5, float(r.sum()) * 2)
    count, size, bent = two.correct(*limits)
    expected, largest, also = one.correct(*limits)
    assert bent and also and count == expected + 1
    assert size == pytest.approx(largest, rel=1e-9)
    np.testing.assert_allclose(two.s, one.s, rtol=1e-6, atol=1e-12 * np.abs(one.s).max())


def test_nothing_is_corrected_where_nothing_is_left():
    two, _ = solvers()
    two.curvature[:] = 1e10
    _, size, bent = two.correct(0.3, 1e-5, 1e30, 1e30, 0.0)
    assert size == 0.0 and not bent and not two.s.any() and not two.t.any()


RUNS = {
    "half": ("tri-tack", ["drive.preload=4 mN"]),
    "quarter, five elements": ("flat-punch", ["rheology.model=geometric", "rheology.elements=5", "rheology.time_ratio=6",
        "rheology.exponent=0.8", "rheology.relaxation_time=40 us", "rheology.modulus_ratio=250"]),
    "whole, free, mixed": ("hex-tack", ["substrate.boundary=free", "solver.symmetry=none", "solver.precision=mixed",
        "drive.preload=2 mN"]),
    "free film": ("tri-tack", ["substrate.boundary=free", "substrate.thickness=100 um", "drive.preload=2 mN"]),
    "nearly elastic": ("tri-tack", ["rheology.modulus_ratio=3", "drive.preload=1 mN", "drive.speed=20 um/s"]),
}  # fmt: skip


@pytest.mark.parametrize("name", RUNS)
def test_runs_end_as_those_without_in_fewer_pairs(name):
    source, changes = RUNS[name]
    found = {}
    for kind in ("always", "none"):
        scene = load_scene(source, ["grid.n=80", f"solver.coarse_grid={kind}", *changes])
        simulation = assemble(scene, MPI.COMM_SELF)
        state = simulation.run()
        found[kind] = state, simulation.scheme.pairs
        assert isinstance(simulation.scheme.solver.cg, TwoGrid) == (kind == "always")
    (state, pairs), (expected, more) = found["always"], found["none"]
    assert state.finished == expected.finished == "detached"
    assert pairs < 0.95 * more
    # Errors of both, at the default accuracy.
    assert state.pull_off_force == pytest.approx(expected.pull_off_force, rel=1e-2, abs=1e-3 * scene.drive.preload)
    assert state.energies.work == pytest.approx(expected.energies.work, rel=4e-2)
    assert abs(state.energies.residual) < 1.5 * abs(expected.energies.residual) + 5e-3 * abs(expected.energies.work)


@pytest.mark.parametrize(
    ("factor", "reason", "changes"),
    [
        (8, "", ["tri-tack", "grid.n=1024"]),
        (8, "", ["tri-tack", "grid.n=1024", "substrate.boundary=free"]),
        (5, "", ["tri-tack", "grid.n=1000"]),
        (8, "", ["tri-tack", "grid.n=64", "solver.coarse_grid=always"]),
        (0, "below 1000 points", ["tri-tack", "grid.n=512"]),
        (0, "no multiple of 8, 10, 12, 14, 16", ["tri-tack", "grid.n=1026"]),
        (0, "solver.coarse_grid", ["tri-tack", "grid.n=1024", "solver.coarse_grid=none"]),
        (0, "quasistatic", ["tri-tack", "grid.n=1024", "solver.scheme=quasistatic"]),
        (0, "gfmd", ["tri-tack", "grid.n=1024", "solver.scheme=gfmd"]),
        (0, "elastic", ["flat-punch", "grid.n=1024", "rheology.model=elastic"]),
        (0, "elastic", ["flat-punch", "grid.n=1024", "rheology.modulus_ratio=1.5", "solver.coarse_grid=always"]),
        (0, "without adhesion", ["tri-tack", "grid.n=1024", "adhesion.law=repulsive"]),
    ],
)
def test_a_coarser_grid_is_used_where_it_was_measured_to_be_cheaper(factor, reason, changes):
    scene = load_scene(changes[0], changes[1:])
    found = coarsening.expected(scene)
    assert found.factor == factor and reason in found.reason and bool(reason) == (not factor)
    assert report(scene)["coarser grid"] == (scene.grid.n // factor if factor else "none")


def test_fewer_pairs_are_expected():
    two, one = (
        effort_of(load_scene("tri-tack", ["grid.n=1024", f"solver.coarse_grid={kind}"])) for kind in ("auto", "none")
    )
    assert 0.8 < two.steps / one.steps < 1.2 and two.pairs < 0.6 * one.pairs and two.seconds < one.seconds
