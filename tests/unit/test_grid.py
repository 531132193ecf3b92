"""The cell, the punch block and its points: by brute force over all grid points, and on any number of ranks."""

from dataclasses import dataclass

import numpy as np
import pytest

from pgfmd.solver.grid import Grid, PunchPoints, share


@dataclass
class Alone:
    """What PunchPoints asks of a communicator, for one rank out of many that are not there."""

    size: int = 1
    rank: int = 0


CASES = [
    (16, 0.25), (17, 0.25), (64, 0.25), (97, 0.23), (100, 0.5), (5, 0.1), (4, 0.02), (9, 0.499), (12, None), (13, None),
]  # fmt: skip


def brute_force(n, length, radius):
    """Which of the n x n points are under the punch."""
    x = (np.arange(n) + 0.5) * length / n - length / 2
    if radius is None:
        return np.ones((n, n), dtype=bool)
    return np.hypot(x[None, :], x[:, None]) <= radius * (1 + 1e-12)


def ranks_of(grid, radius, size):
    return [PunchPoints(grid, radius, Alone(size, rank)) for rank in range(size)]


def rows_of_points(points):
    """(rows, nb) cell rows and columns of the local points."""
    row, column = np.nonzero(points.inside())
    return points.block_start + points.row_start + row, points.block_start + column


@pytest.mark.parametrize("n", [4, 5, 16, 27, 97, 100])
def test_points_are_symmetric_about_the_axis_and_fill_the_cell(n):
    grid = Grid(n, 1.5e-3)
    x = grid.coordinate(np.arange(n))
    np.testing.assert_allclose(x + x[::-1], 0.0, atol=1e-18)
    np.testing.assert_allclose(np.diff(x), grid.spacing, rtol=1e-12)
    assert x[0] - grid.spacing / 2 == pytest.approx(-0.75e-3, rel=1e-14)
    assert grid.cell_area * n**2 == pytest.approx(1.5e-3**2, rel=1e-14)


@pytest.mark.parametrize(("n", "relative_radius"), CASES)
def test_block_is_the_smallest_centred_square_that_holds_the_punch(n, relative_radius):
    length = 2e-3
    radius = None if relative_radius is None else relative_radius * length
    start, nb = Grid(n, length).block(radius)
    assert 2 * start + nb == n, "not centred"
    inside = brute_force(n, length, radius)
    held = inside[start : start + nb, start : start + nb]
    assert held.sum() == inside.sum()
    if inside.any():
        assert held[0].any() and held[-1].any() and held[:, 0].any() and held[:, -1].any()


def test_a_radius_that_ends_on_a_point_counts_it():
    # 20 points a side, spacing 1: points at 0.5, 1.5, ...
    start, nb = Grid(20, 20.0).block(4.5)
    assert (start, nb) == (5, 10)
    assert Grid(20, 20.0).block(np.nextafter(4.5, 0) * (1 - 1e-11)) == (6, 8)


@pytest.mark.parametrize("n", [8, 9])
def test_a_punch_smaller_than_the_spacing_still_has_a_block(n):
    start, nb = Grid(n, float(n)).block(1e-3)
    assert 2 * start + nb == n
    assert nb == (2 if n % 2 == 0 else 1)


@pytest.mark.parametrize("parts", [1, 2, 3, 7, 16, 17, 40])
@pytest.mark.parametrize("count", [0, 1, 7, 16, 33])
def test_shares_are_contiguous_even_and_complete(count, parts):
    shares = [share(count, parts, part) for part in range(parts)]
    ends = np.cumsum([size for _, size in shares])
    assert [start for start, _ in shares] == [0, *ends[:-1]]
    assert ends[-1] == count
    sizes = [size for _, size in shares]
    assert max(sizes) - min(sizes) <= 1 and sizes == sorted(sizes, reverse=True)


@pytest.mark.parametrize("size", [1, 2, 3, 20, 130])
@pytest.mark.parametrize(("n", "relative_radius"), CASES)
def test_points_of_all_ranks_are_the_points_under_the_punch_in_row_order(n, relative_radius, size):
    grid = Grid(n, 2e-3)
    radius = None if relative_radius is None else relative_radius * grid.length
    ranks = ranks_of(grid, radius, size)
    inside = brute_force(n, grid.length, radius)
    rows, columns = (np.concatenate(part) for part in zip(*(rows_of_points(points) for points in ranks), strict=True))
    expected_rows, expected_columns = np.nonzero(inside)
    np.testing.assert_array_equal(rows, expected_rows)
    np.testing.assert_array_equal(columns, expected_columns)
    first = np.cumsum([0, *(points.size for points in ranks)])
    for points, start in zip(ranks, first, strict=False):
        assert points.first_point == start
        assert points.total == inside.sum()
        assert points.offset.shape == (points.rows + 1,) and points.offset[0] == 0
        assert points.offset[-1] == points.size == points.zeros().size
        np.testing.assert_array_equal(np.diff(points.offset), points.last - points.first)


@pytest.mark.parametrize("size", [1, 3, 200])
def test_coordinates_follow_the_points(size):
    grid, radius = Grid(27, 1.0), 0.31
    axis = grid.coordinate(np.arange(27))
    for points in ranks_of(grid, radius, size):
        rows, columns = rows_of_points(points)
        x, y = points.coordinates()
        np.testing.assert_array_equal(x, axis[columns])
        np.testing.assert_array_equal(y, axis[rows])
        assert np.all(np.hypot(x, y) <= radius)


@pytest.mark.parametrize("size", [1, 3, 40])
def test_to_rows_goes_there_and_back(size):
    for points in ranks_of(Grid(27, 1.0), 0.31, size):
        values = points.first_point + np.arange(points.size, dtype=float)
        rows = points.to_rows(values)
        assert rows.shape == (points.rows, points.nb)
        np.testing.assert_array_equal(rows[points.inside()], values)
        assert np.all(np.isnan(rows[~points.inside()]))
        assert np.all(points.to_rows(values, outside=-1.0)[~points.inside()] == -1.0)


def test_one_rank_gathers_nothing():
    points = PunchPoints(Grid(16, 1.0), 0.4, Alone())
    local = np.arange(3.0 * points.rows).reshape(3, points.rows)
    assert points.all_rows(local) is local
    np.testing.assert_array_equal(points.total_of(local), local.sum(axis=1))
    assert points.maximum_of(-3.5) == -3.5
