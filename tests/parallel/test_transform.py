"""The fused transform on any number of ranks: against numpy.fft on the whole plane, with the same bits as on one."""

import numpy as np
import pytest
import scipy.fft
from mpi4py import MPI

from pgfmd.errors import PgfmdError
from pgfmd.physics.film import Film
from pgfmd.physics.free_kernel import FreeHalfSpace
from pgfmd.physics.halfspace import HalfSpace
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.multiplier import free_multiplier, periodic_multiplier
from pgfmd.solver.transform import Convolution, plain_pair

pytestmark = pytest.mark.mpi

MODULUS, LENGTH = 2.65e6, 1.5e-3
# Grid points, and the radius as a share of the cell: even, odd, prime, blocks of one, two and three rows, whole cells.
CELLS = [
    (16, 0.25), (27, 0.25), (64, 0.25), (97, 0.3), (100, 0.23), (100, 0.5), (4, 0.25), (5, 0.1), (5, 0.25), (16, None),
    (27, None), (20, 0.25), (48, 0.25), (72, 0.25),
]  # fmt: skip


def gathered(comm, values):
    """A point vector of all ranks, on every rank."""
    return np.concatenate(comm.allgather(np.asarray(values)))


def random_field(points, seed=5):
    """The local part of a random point vector that doesn't depend on the number of ranks."""
    whole = np.random.default_rng(seed).standard_normal(points.total)
    return whole[points.first_point : points.first_point + points.size]


def case(comm, n, share_of_cell):
    """The points; cells with fewer pairs of rows or columns than ranks are for `test_too_many_ranks_are_refused`."""
    points = PunchPoints(Grid(n, LENGTH), None if share_of_cell is None else share_of_cell * LENGTH, comm)
    if min((points.nb + 1) // 2, n // 2 + 1) < comm.size:
        pytest.skip("fewer pairs of rows than ranks")
    return points


def on_the_plane(points, field):
    """All points of the cell (n, n), zero where there is no punch, from a whole point vector and one rank's points."""
    n, start, nb = points.grid.n, points.block_start, points.nb
    plane = np.zeros((n, n))
    plane[start : start + nb, start : start + nb] = points.to_rows(field, outside=0.0)
    return plane


def by_numpy(plane, compliance):
    """Periodic convolution of the whole plane by numpy.fft."""
    n = plane.shape[0]
    q = 2 * np.pi / LENGTH * np.fft.fftfreq(n, 1 / n)
    return np.fft.ifft2(np.fft.fft2(plane) * compliance(q[None, :], q[:, None])).real


HALF_SPACE = HalfSpace(MODULUS)


def periodic(points, compliance=HALF_SPACE):
    return Convolution(points, points.grid.n, periodic_multiplier(compliance, LENGTH))


def free(points, reach=None):
    size = scipy.fft.next_fast_len(points.nb + (reach or points.nb) - 1, real=True)
    return Convolution(points, size, free_multiplier(FreeHalfSpace(MODULUS), points.grid.spacing))


COMPLIANCES = {
    "half-space": HALF_SPACE,
    "prestrained": HalfSpace(MODULUS, (1.3, 0.7)),
    "film": Film(2e6, 0.49, 0.2e-3, "bonded"),
}


@pytest.mark.parametrize("compliance", COMPLIANCES)
@pytest.mark.parametrize(("n", "radius"), CELLS)
def test_periodic_convolution_is_that_of_the_whole_plane(n, radius, compliance):
    comm, substrate = MPI.COMM_WORLD, COMPLIANCES[compliance]
    points, alone = case(comm, n, radius), case(MPI.COMM_SELF, n, radius)
    result = gathered(comm, periodic(points, substrate)(random_field(points), points.zeros()))
    whole = by_numpy(on_the_plane(alone, random_field(alone)), substrate)
    start, nb = alone.block_start, alone.nb
    expected = whole[start : start + nb, start : start + nb][alone.inside()]
    np.testing.assert_allclose(result, expected, atol=2e-15 * np.abs(expected).max() * np.log2(n), rtol=0)


@pytest.mark.parametrize(("n", "radius"), [cell for cell in CELLS if cell[1] is not None])
def test_free_convolution_is_the_sum_over_all_pairs(n, radius):
    comm = MPI.COMM_WORLD
    points, alone = case(comm, n, radius), case(MPI.COMM_SELF, n, radius)
    result = gathered(comm, free(points)(random_field(points), points.zeros()))
    x, y = alone.coordinates()
    some = np.linspace(0, alone.total - 1, min(alone.total, 50)).astype(int)
    kernel = FreeHalfSpace(MODULUS).kernel(x[some, None] - x, y[some, None] - y, alone.grid.spacing)
    expected = kernel @ random_field(alone)
    np.testing.assert_allclose(result[some], expected, atol=1e-13 * np.abs(result).max(), rtol=0)


@pytest.mark.parametrize("make", [periodic, free], ids=["periodic", "free"])
@pytest.mark.parametrize(("n", "radius"), CELLS)
def test_the_bits_do_not_depend_on_the_number_of_ranks(n, radius, make):
    comm = MPI.COMM_WORLD
    points, alone = case(comm, n, radius), case(MPI.COMM_SELF, n, radius)
    shared, own = make(points), make(alone)
    for seed in range(3):
        field = random_field(points, seed)
        result = gathered(comm, shared(field, points.zeros(), 0.37))
        expected = own(random_field(alone, seed), alone.zeros(), 0.37)
        np.testing.assert_array_equal(result, expected)
    assert shared.pairs == own.pairs == 3


@pytest.mark.parametrize("make", [periodic, free], ids=["periodic", "free"])
def test_every_call_gives_the_same_and_keeps_its_input(make):
    points = case(MPI.COMM_WORLD, 100, 0.23)
    convolve, field = make(points), random_field(points)
    before = field.copy()
    first = convolve(field, points.zeros()).copy()
    convolve(random_field(points, 1), points.zeros())
    out = points.zeros()
    assert convolve(field, out) is out
    np.testing.assert_array_equal(out, first)
    np.testing.assert_array_equal(field, before)
    scaled = convolve(field, points.zeros(), -2.5)
    np.testing.assert_allclose(scaled, -2.5 * first, atol=1e-15 * np.abs(first).max(initial=0))


def test_a_result_may_overwrite_its_input():
    points = case(MPI.COMM_WORLD, 27, 0.25)
    convolve, field = periodic(points), random_field(points)
    expected = convolve(field, points.zeros()).copy()
    np.testing.assert_array_equal(convolve(field, field), expected)


@pytest.mark.parametrize(("n", "radius"), CELLS)
def test_the_surface_of_the_whole_cell(n, radius):
    comm = MPI.COMM_WORLD
    points, alone = case(comm, n, radius), case(MPI.COMM_SELF, n, radius)
    rows, first = periodic(points).whole_cell(random_field(points))
    assert comm.exscan(rows.shape[0]) == (first if comm.rank else None)
    surface = np.concatenate(comm.allgather(rows))
    expected = by_numpy(on_the_plane(alone, random_field(alone)), HalfSpace(MODULUS))
    assert surface.shape == (n, n)
    np.testing.assert_allclose(surface, expected, atol=2e-15 * np.abs(expected).max() * np.log2(n), rtol=0)
    own, _ = periodic(alone).whole_cell(random_field(alone))
    np.testing.assert_array_equal(surface, own)


@pytest.mark.parametrize(("n", "radius"), [(16, 0.25), (27, 0.25), (5, 0.1), (40, 0.25)])
def test_the_surface_of_the_whole_cell_around_a_free_punch(n, radius):
    comm = MPI.COMM_WORLD
    points, alone = case(comm, n, radius), case(MPI.COMM_SELF, n, radius)
    rows, _ = free(points, reach=n).whole_cell(random_field(points))
    surface = np.concatenate(comm.allgather(rows))
    axis = alone.grid.coordinate(np.arange(n))
    x, y = alone.coordinates()
    for row in (0, n // 3, n - 1):
        kernel = FreeHalfSpace(MODULUS).kernel(axis[:, None] - x, axis[row] - y + 0 * axis[:, None], alone.grid.spacing)
        np.testing.assert_allclose(
            surface[row], kernel @ random_field(alone), atol=1e-13 * np.abs(surface).max(), rtol=0
        )


@pytest.mark.parametrize(("n", "radius"), [(27, 0.25), (64, 0.25)])
def test_block_and_whole_cell_agree_under_the_punch(n, radius):
    points = case(MPI.COMM_SELF, n, radius)
    convolve, field = periodic(points), random_field(points)
    surface, _ = convolve.whole_cell(field)
    start, nb = points.block_start, points.nb
    block = surface[start : start + nb, start : start + nb][points.inside()]
    np.testing.assert_allclose(block, convolve(field, points.zeros()), atol=1e-15 * np.abs(surface).max())


def test_sums_and_maxima_have_the_same_bits_on_every_rank():
    from pgfmd.solver import kernels

    comm, totals = MPI.COMM_WORLD, []
    for communicator in (comm, MPI.COMM_SELF):
        points = case(communicator, 97, 0.3)
        a, b = random_field(points, 1), random_field(points, 2)
        rows = np.zeros((1, points.rows))
        kernels.dot(a, b, points.offset, rows)
        largest = points.maximum_of(a.max(initial=-np.inf))
        totals.append((points.total_of(rows)[0], points.all_rows(rows).max(), largest))
    assert totals[0] == totals[1]
    assert len(set(comm.allgather(totals[0]))) == 1


def test_single_precision_is_that_good():
    points = case(MPI.COMM_WORLD, 64, 0.25)
    exact = periodic(points)(random_field(points), points.zeros())
    single = Convolution(points, 64, periodic_multiplier(HalfSpace(MODULUS), LENGTH), dtype=np.float32)
    error = np.abs(single(random_field(points), points.zeros()) - exact).max(initial=0)
    assert points.maximum_of(error) < 1e-5 * points.maximum_of(np.abs(exact).max(initial=0))


@pytest.mark.parametrize(("n", "radius"), CELLS)
def test_two_rows_in_one_transform_are_that_good_and_have_the_same_bits_on_any_number_of_ranks(n, radius):
    comm = MPI.COMM_WORLD
    points, alone = case(comm, n, radius), case(MPI.COMM_SELF, n, radius)
    make = periodic_multiplier(Film(2e6, 0.49, 0.2e-3, "bonded"), LENGTH)
    shared, own = (Convolution(each, n, make, dtype=np.float32) for each in (points, alone))
    exact = Convolution(alone, n, make)
    for seed in range(2):
        # The second row of a pair must not be rounded to what was there before, a billion times as large.
        size = 1e9 if seed == 0 else 1.0
        fields = [(size * random_field(each, seed)).astype(np.float32) for each in (points, alone)]
        found = gathered(comm, shared(fields[0], points.zeros(np.float32), 0.37))
        np.testing.assert_array_equal(found, own(fields[1], alone.zeros(np.float32), 0.37))
        expected = exact(fields[1].astype(float), alone.zeros(), 0.37)
        np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max(), rtol=0)
    cell, _ = shared.whole_cell(fields[0])
    single = np.concatenate(comm.allgather(cell))
    expected, _ = exact.whole_cell(fields[1].astype(float))
    np.testing.assert_allclose(single, expected, atol=1e-6 * np.abs(expected).max(), rtol=0)


def test_measured_plans_agree_to_rounding():
    points = case(MPI.COMM_WORLD, 64, 0.25)
    exact = periodic(points)(random_field(points), points.zeros())
    measured = Convolution(points, 64, periodic_multiplier(HalfSpace(MODULUS), LENGTH), effort="measure")
    result = measured(random_field(points), points.zeros())
    np.testing.assert_allclose(result, exact, atol=1e-14 * np.abs(exact).max(initial=1e-300))


def test_too_many_ranks_are_refused_by_every_rank():
    comm = MPI.COMM_WORLD
    points = PunchPoints(Grid(5, LENGTH), 0.1 * LENGTH, comm)
    assert points.nb == 1
    if comm.size == 1:
        periodic(points)
        return
    with pytest.raises((PgfmdError, AssertionError)):
        periodic(points)


def test_the_plain_pair_runs():
    plain_pair(MPI.COMM_WORLD, 16)()
