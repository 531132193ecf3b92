"""Kernels that do several things in one pass, and those of small matrices, against a few lines of NumPy."""

import math

import numpy as np
import pytest

from pgfmd.schemes.inertialess import retardation_kernels
from pgfmd.solver import contact_kernels, drift_kernels, kernels
from pgfmd.solver.grid import Grid, PunchPoints
from tests.unit.test_kernels import LAWS, RHO, SHARES, close, numbers, row_maxima, row_sums

ROUNDING = {"float32": 3e-6, "float64": 2e-14}


@pytest.fixture(params=SHARES)
def points(request):
    return SHARES[request.param]


@pytest.fixture
def rng():
    return np.random.default_rng(11)


@pytest.fixture(params=ROUNDING)
def dtype(request):
    return request.param


def vectors(points, rng, dtype, count):
    """Random point vectors, and K, zero at half of the points."""
    found = [rng.standard_normal(points.size).astype(dtype) for _ in range(count)]
    k = rng.standard_normal(points.size).astype(dtype)
    k[rng.random(points.size) < 0.5] = 0.0
    return found, k


def test_survey(points, rng, dtype):
    (z, r), k = vectors(points, rng, dtype, 2)
    rows = np.full((4, points.rows), np.nan)
    kernels.survey(z, r, k, points.offset, rows)
    a, b, stiff = (values.astype(float) for values in (z, r, k))
    for found, expected in zip(rows[:3], (a * b, a * stiff * a, stiff * a), strict=True):
        close(found, row_sums(expected, points), 1e2)
    near = row_maxima(np.where(stiff != 0.0, np.abs(a), 0.0), points, 0.0)
    np.testing.assert_array_equal(rows[3], near)


@pytest.mark.parametrize("first", [False, True])
@pytest.mark.parametrize("last", [False, True])
def test_turn_and_advance(points, rng, dtype, first, last):
    (z, p, y, s, t, r), k = vectors(points, rng, dtype, 6)
    rows, alpha, beta = np.full((2, points.rows), np.nan), 0.37, 0.0 if first else 0.81
    if first:
        p[:], y[:], s[:], t[:] = np.nan, np.nan, np.nan, np.nan
    old = [0.0 if first else values.astype(float) for values in (p, y, s, t)]
    turned = z.astype(float) + beta * old[0], r.astype(float) + beta * old[1]
    moved = old[2] + alpha * turned[0], old[3] + alpha * turned[1]
    rest = r - alpha * (turned[1] + k * turned[0])
    before = [values.copy() for values in (p, y, r)]
    kernels.turn_and_advance(z, beta, alpha, k, p, y, s, t, r, first, last, rows)
    for found, expected in zip((s, t), moved, strict=True):
        close(found, expected, 10.0, ROUNDING[dtype])
    for found, expected, kept in zip((p, y, r), (*turned, rest), before, strict=True):
        if last:
            np.testing.assert_array_equal(found, kept)
        else:
            close(found, expected, 10.0, ROUNDING[dtype])
    if points.rows:
        largest = [np.abs(values[k != 0.0]).max(initial=0.0) for values in (p, s)]
        assert (last or rows[0].max() == largest[0]) and ((first and last) or rows[1].max() == largest[1])
        assert np.all(rows[:, 1:] == 0.0)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@pytest.mark.parametrize("place", [-4.0, 0.0, 6.0])
def test_evaluate_where_whole_blocks_are_in_contact_or_out_of_reach(law, place, rng):
    size = 3 * contact_kernels.BLOCK + 7
    height = RHO * (place + 0.1 * rng.standard_normal(size))
    # At each end of a row, and in its middle, one point that is attracted.
    height[[0, size // 2, -1]] = 0.4 * RHO
    zeros, offset = np.zeros(size), np.array([0, size])
    f, k, r, rows = zeros.copy(), zeros.copy(), zeros.copy(), np.zeros((4, 1))
    contact_kernels.evaluate(
        height, 0.0, zeros, zeros, zeros, zeros, 0.0, 0.0, zeros, 1.0, numbers(law), offset, f, k, r, rows
    )
    close(f, law.traction(height), law.strength, 1e-14)
    close(k, law.curvature(height), law.stiffness, 1e-14)
    close(rows[2, 0], law.potential(height).sum(), 1e2 * law.work_of_adhesion)


def test_places_are_in_the_order_of_numbers():
    values = np.array([-math.inf, -1e300, -2.5, -1e-310, -0.0, 0.0, 1e-310, 1.0, np.nextafter(1.0, 2.0), math.inf])
    for size in (len(values), 3):
        rows = np.zeros((6, 1))
        zeros = np.zeros(size)
        heights = values[-size:].copy()
        heights[~np.isfinite(heights)] = 7.0
        levels, law = (0.0, 0.0, 0.0), numbers(LAWS["cosine"])
        contact_kernels.observe(heights, 0.0, zeros, zeros, np.zeros(0), law, levels, np.array([0, size]), rows)
        assert rows[5, 0] == -heights.min()


@pytest.mark.parametrize("mirror", ["", "x", "xy"])
def test_reduced_sums_some_kinds_and_takes_the_largest_of_others(mirror, rng):
    class Alone:
        rank, size = 0, 1

    points = PunchPoints(Grid(26, 1.0), 0.3, Alone(), mirror=mirror)
    rows = rng.standard_normal((5, points.rows)) - 3.0
    found = points.reduced(rows, 3)
    assert all(type(number) is float for number in found)
    close(found[:3], points.images * rows[:3].sum(axis=1), 1e2)
    assert found[3:] == rows[3:].max(axis=1).tolist()


def test_stage_and_history(points, rng):
    total, history, following = rng.standard_normal((3, points.size))
    out, expected = points.zeros(), (total - history) / 0.3
    wanted = following + 0.6 * expected
    retardation_kernels.stage_and_history(total, history, 0.3, 0.6, out, following)
    close(out, expected, 10.0)
    close(following, wanted, 10.0)
    retardation_kernels.stage_of(total, history, 0.3, out)
    close(out, expected, 10.0)


@pytest.mark.parametrize(("count", "length"), [(1, 1), (1, 3), (3, 4), (4, 4), (5, 3), (2, 6)])
def test_lower_factor_has_the_same_covariance(count, length, rng):
    rows = rng.standard_normal((count, length)) * np.logspace(0, -12, count)[:, None]
    lower = drift_kernels.lower_factor(rows)
    assert lower.shape == (count, min(count, length)) and np.all(np.triu(lower, 1) == 0.0)
    # Each row to its own rounding, however small beside the others.
    for i in range(count):
        size = np.linalg.norm(rows[i])
        close(lower[i] @ lower.T, rows[i] @ rows.T, size * np.abs(rows).max())
        assert np.linalg.norm(lower[i]) == pytest.approx(size, rel=1e-13)
    assert np.all(drift_kernels.lower_factor(np.zeros((count, length))) == 0.0)
