"""Every compiled kernel against a few lines of NumPy: odd sizes, rows without points, ranks without rows."""

import itertools
from dataclasses import dataclass

import numpy as np
import pytest

from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.physics.adhesion.repulsive import Repulsive
from pgfmd.schemes.inertialess import retardation_kernels
from pgfmd.solver import contact_kernels, kernels, transform_kernels
from pgfmd.solver.grid import Grid, PunchPoints

GAMMA, RHO = 0.05, 0.75e-6
LAWS = {"cosine": Cosine(GAMMA, RHO), "repulsive": Repulsive(GAMMA, RHO)}


@dataclass
class Rank:
    rank: int
    size: int


# Grid and radius (in a cell of side 1), and which rank of how many; the last has no rows, the one before no points.
SHARES = {
    "odd block": PunchPoints(Grid(27, 1.0), 0.31, Rank(0, 1)),
    "whole cell": PunchPoints(Grid(12, 1.0), None, Rank(1, 3)),
    "a part": PunchPoints(Grid(100, 1.0), 0.25, Rank(1, 3)),
    "single row": PunchPoints(Grid(27, 1.0), 0.31, Rank(8, 9)),
    "empty rows": PunchPoints(Grid(8, 1.0), 1e-3, Rank(0, 1)),
    "no rows": PunchPoints(Grid(16, 1.0), 0.3, Rank(10, 11)),
}


@pytest.fixture(params=SHARES)
def points(request):
    return SHARES[request.param]


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def numbers(law):
    return law.numbers


def row_sums(values, points):
    return np.array([values[points.offset[i] : points.offset[i + 1]].sum() for i in range(points.rows)])


def row_maxima(values, points, empty):
    parts = [values[points.offset[i] : points.offset[i + 1]] for i in range(points.rows)]
    return np.array([part.max() if part.size else empty for part in parts])


def close(actual, expected, scale=1.0, rounding=2e-14):
    np.testing.assert_allclose(actual, expected, rtol=rounding, atol=rounding * scale)


def test_the_shares_hold_what_their_names_say():
    assert SHARES["no rows"].rows == 0 and SHARES["no rows"].size == 0
    assert SHARES["empty rows"].rows == 2 and SHARES["empty rows"].size == 0
    assert SHARES["single row"].rows == 1 and SHARES["a part"].row_start > 0


# Transform -----------------------------------------------------------------------------------------------------------
def test_rows_are_scattered_with_zeros_around_and_gathered_back(points, rng):
    vector, lines, length = rng.standard_normal(points.size), 5, 2 * points.nb + 3
    back = np.full(points.size, np.nan)
    padded = points.to_rows(vector, outside=0.0)
    for row in range(0, points.rows, lines):
        count = min(lines, points.rows - row)
        line = np.full((lines, length), np.nan)
        transform_kernels.scatter_rows(vector, points.offset, points.first, row, count, -2.5, line)
        np.testing.assert_array_equal(line[:count, : points.nb], -2.5 * padded[row : row + count])
        np.testing.assert_array_equal(line[:count, points.nb :], 0.0)
        assert np.all(np.isnan(line[count:])), "wrote behind its rows"
        transform_kernels.gather_rows(line, points.offset, points.first, row, count, back)
    np.testing.assert_array_equal(back, -2.5 * vector)


def test_pairs_of_rows_are_packed_separated_joined_and_gathered_back(points, rng):
    for n in (2 * points.nb + 4, 2 * points.nb + 3):
        vector, lines = rng.standard_normal(points.size), np.full((3, 2 * n), np.nan)
        back, padded = np.full(points.size, np.nan), np.zeros((points.rows, n))
        padded[:, : points.nb] = points.to_rows(vector, outside=0.0)
        for row in range(0, points.rows, 6):
            count = min(6, points.rows - row)
            transform_kernels.scatter_packed(vector, points.offset, points.first, row, count, -2.5, lines)
            expected = np.zeros((6, n))
            expected[:count] = -2.5 * padded[row : row + count]
            np.testing.assert_array_equal(lines.view(complex), expected[0::2] + 1j * expected[1::2])
            hat = np.full((6, n // 2 + 1), np.nan, dtype=complex)
            spectra = np.fft.fft(lines.view(complex)).view(float)
            transform_kernels.separate_packed(spectra, 0.5, hat.view(float))
            close(hat, np.fft.rfft(expected), n)
            # They don't count, as in a transform to real numbers.
            hat[:, 0] += 1e3j
            hat[:, n // 2] += 1e3j * (n % 2 == 0)
            joined = np.full_like(lines, np.nan)
            transform_kernels.join_packed(hat.view(float), joined)
            lines = np.fft.ifft(joined.view(complex)).view(float)
            transform_kernels.gather_packed(lines, points.offset, points.first, row, count, back)
        close(back, -2.5 * vector, n)


@pytest.mark.parametrize(
    ("rows", "n", "width", "batch"),
    [
        ((5,), 16, 9, 4),
        ((4, 3), 7, 4, 4),
        ((1,), 9, 5, 3),
        ((2, 0, 4), 13, 1, 1),
        ((4,), 8, 0, 2),
        ((2, 2, 4), 16, 13, 7),
    ],
)
def test_rows_become_tiles_columns_are_loaded_from_them_multiplied_and_stored(rows, n, width, batch, rng):
    """Of one rank's columns; rows: of each rank."""
    ends = np.concatenate(([0], np.cumsum(rows)))
    nb, before = ends[-1], 2
    hat = rng.standard_normal((nb, before + width)) + 1j * rng.standard_normal((nb, before + width))
    tiles = np.full(nb * width, np.nan, dtype=complex)
    for first, last in itertools.pairwise(ends):
        block = tiles[first * width : last * width]
        for row in range(0, last - first, 3):
            some = hat[first + row : min(first + row + 3, last)]
            transform_kernels.put_rows(some, len(some), before, row, last - first, width, batch, block)
            back = np.zeros_like(some)
            transform_kernels.take_rows(block, len(some), before, row, last - first, width, batch, back)
            np.testing.assert_array_equal(back[:, before:], some[:, before:])
            assert not back[:, :before].any()
    assert not np.isnan(tiles).any()
    multiplier = rng.standard_normal((width, n // 2 + 1))
    ky = np.minimum(np.arange(n), n - np.arange(n))
    row = np.arange(nb)
    # As they are, in Makhoul's order, and from the end.
    for places in (row, np.where(row % 2, n - 1 - row // 2, row // 2), row + n - nb):
        free = np.setdiff1d(np.arange(n), places)
        begin, end = (free[0], free[-1] + 1) if free.size else (0, 0)
        stored = np.full_like(tiles, np.nan)
        for column in range(0, width, batch):
            buffer = np.full((batch, n), np.nan, dtype=complex)
            count = transform_kernels.load_columns(tiles, ends, width, batch, column, places, begin, end, buffer)
            assert count == min(batch, width - column)
            expected = np.zeros((count, n), dtype=complex)
            expected[:, places] = hat[:, before + column : before + column + count].T
            np.testing.assert_array_equal(buffer[:count], expected)
            assert np.all(np.isnan(buffer[count:]))
            transform_kernels.multiply_columns(buffer.view(float), multiplier, column, count)
            expected *= multiplier[column : column + count][:, ky]
            np.testing.assert_array_equal(buffer[:count], expected)
            transform_kernels.store_columns(buffer, ends, width, batch, column, places, stored)
        again = np.zeros((nb, width), dtype=complex)
        for first, last in itertools.pairwise(ends):
            block = stored[first * width : last * width]
            transform_kernels.take_rows(block, last - first, 0, 0, last - first, width, batch, again[first:last])
        column = np.arange(width)
        np.testing.assert_array_equal(again, hat[:, before:] * multiplier[column, :][:, ky[places]].T)


# Cohesion and the incremental potential ------------------------------------------------------------------------------
@pytest.fixture
def trial(points, rng):
    """Gaps on both sides of contact and of the range, some exactly on them."""
    size = points.size
    fields = {name: RHO * rng.standard_normal(size) for name in ("height", "u", "s")}
    fields |= {name: 1e4 * rng.standard_normal(size) for name in ("w", "t", "history")}
    return fields


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_evaluate_is_the_incremental_potential_and_its_slopes(points, trial, law):
    position, step, weight, compliance = 0.3 * RHO, 0.7, 0.2, 0.013
    f, k, r, rows = points.zeros(), points.zeros(), points.zeros(), np.full((4, points.rows), np.nan)
    before = {name: values.copy() for name, values in trial.items()}
    contact_kernels.evaluate(
        trial["height"], position, trial["u"], trial["w"], trial["s"], trial["t"], step, weight, trial["history"],
        compliance, numbers(law), points.offset, f, k, r, rows,
    )  # fmt: skip
    u, w = trial["u"] + step * trial["s"], trial["w"] + weight * trial["t"]
    gap = position + trial["height"] - u
    close(f, law.traction(gap), law.strength)
    close(k, law.curvature(gap), law.stiffness)
    close(r, law.traction(gap) - (w - trial["history"]) / compliance, 1e4 / compliance)
    # The potential without that of the law is u (w/2 - history)/J; its growth along s holds where A is symmetric.
    growth = step * trial["s"] * ((trial["w"] + w) / 2 - trial["history"]) / compliance
    close(rows[0], row_sums(f, points), 1e2 * law.strength)
    close(rows[1], row_sums(r, points), 1e2 * 1e4 / compliance)
    close(rows[2], row_sums(law.potential(gap), points), 1e2 * GAMMA)
    close(rows[3], row_sums(growth, points), 1e2 * RHO * 1e4 / compliance)
    assert all(np.array_equal(trial[name], before[name]) for name in trial), "inputs were changed"


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_evaluate_at_the_edges_of_the_law(law):
    gaps = np.array([0.0, -0.0, RHO, np.nextafter(RHO, 0), np.nextafter(0, -1), 5 * RHO, -3 * RHO, 1.0])
    zeros, offset = np.zeros(gaps.size), np.array([0, gaps.size])
    f, k, r = zeros.copy(), zeros.copy(), zeros.copy()
    contact_kernels.evaluate(
        gaps, 0.0, zeros, zeros, zeros, zeros, 0.0, 0.0, zeros, 1.0, numbers(law), offset, f, k, r, np.zeros((4, 1))
    )
    close(f, law.traction(gaps), law.strength, 1e-15)
    if law.attractive:
        close(k, law.curvature(gaps), law.stiffness, 1e-15)
        assert k[2] == 0.0 and k[3] < -0.999 * law.stiffness
    assert f[2] == f[5] == f[7] == 0.0


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
@pytest.mark.parametrize("weighted", [True, False])
def test_observe_counts_energies_and_gaps(points, trial, law, weighted, rng):
    weights = rng.standard_normal(points.size) if weighted else np.zeros(0)
    rows = np.full((6, points.rows), np.nan)
    position, levels = 0.4 * RHO, (law.contact_gap, 0.0, 0.8 * RHO)
    contact_kernels.observe(
        trial["height"], position, trial["u"], trial["w"], weights, numbers(law), levels, points.offset, rows
    )
    gap = position + trial["height"] - trial["u"]
    for found, level in zip(rows[:3], levels, strict=True):
        np.testing.assert_array_equal(found, row_sums((gap < level).astype(float), points))
    close(rows[3], row_sums(law.potential(gap), points), 1e2 * GAMMA)
    far = weights * trial["w"] if weighted and points.size else points.zeros()
    close(rows[4], row_sums(far, points), 1e6)
    np.testing.assert_array_equal(rows[5], row_maxima(-gap, points, -np.inf))


# Conjugate gradients -------------------------------------------------------------------------------------------------
def test_dot(points, rng):
    a, b = rng.standard_normal((2, points.size))
    rows = np.zeros((1, points.rows))
    kernels.dot(a, b, points.offset, rows)
    close(rows[0], row_sums(a * b, points), 1e2)


def test_turn_direction(points, rng):
    z, r, k, p, y = rng.standard_normal((5, points.size))
    rows, beta = np.zeros((1, points.rows)), 0.37
    new_p, new_y = z + beta * p, r + beta * y
    kernels.turn_direction(z, r, beta, k, p, y, points.offset, rows)
    close(p, new_p)
    close(y, new_y)
    close(rows[0], row_sums(new_p * (new_y + k * new_p), points), 1e2)


def test_advance(points, rng):
    p, y, k, s, t, r = rng.standard_normal((6, points.size))
    k[rng.random(points.size) < 0.5] = 0.0
    rows, alpha = np.zeros((3, points.rows)), 0.37
    new_s, new_t, new_r = s + alpha * p, t + alpha * y, r - alpha * (y + k * p)
    kernels.advance(alpha, p, y, k, s, t, r, points.offset, rows)
    close(s, new_s)
    close(t, new_t)
    close(r, new_r)
    near = k != 0
    close(rows[0], row_maxima(np.where(near, np.abs(alpha * p), 0), points, 0.0))
    close(rows[1], row_maxima(np.where(near, np.abs(new_s), 0), points, 0.0))
    close(rows[2], row_sums(new_r, points), 1e2)


def test_largest_in_rows(points, rng):
    values, k = rng.standard_normal((2, points.size))
    k[rng.random(points.size) < 0.5] = 0.0
    rows = np.zeros((1, points.rows))
    kernels.largest_in_rows(values, k, points.offset, rows)
    np.testing.assert_array_equal(rows[0], row_maxima(np.where(k != 0, np.abs(values), 0), points, 0.0))


def test_move(points, rng):
    u, w, s, t = rng.standard_normal((4, points.size))
    new_u, new_w = u + 0.7 * s, w - 3.0 * t
    kernels.move(u, w, s, t, 0.7, -3.0)
    close(u, new_u)
    close(w, new_w)


# Prediction and its error --------------------------------------------------------------------------------------------
def test_combine(points, rng):
    a, b, c = rng.standard_normal((3, points.size))
    out = points.zeros()
    kernels.combine(3.0, a, -3.0, b, 1.0, c, out)
    close(out, 3 * a - 3 * b + c, 10.0)


def test_largest_difference_near(points, rng):
    a, b, c, u, height = RHO * rng.standard_normal((5, points.size))
    position = 1.5 * RHO
    other = 3 * a - 3 * b + c
    gaps = np.minimum(position + height - u, position + height - other)
    near = gaps < RHO
    distance, change = kernels.largest_difference_near(3.0, a, -3.0, b, 1.0, c, u, height, position, RHO)
    close(distance, np.abs(u - other)[near].max(initial=0.0), 10 * RHO)
    close(change, np.abs(u - a)[near].max(initial=0.0), 10 * RHO)
    assert kernels.largest_difference_near(1.0, a, 0.0, b, 0.0, c, u, height, 1.0, RHO) == (0.0, 0.0)


# Retardation ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("elements", [0, 1, 5])
def test_weigh_branches(points, elements, rng):
    branches, weights = rng.standard_normal((elements, points.size)), rng.standard_normal((2, elements))
    out = np.full((2, points.size), np.nan)
    retardation_kernels.weigh_internal_variables(branches, weights, out)
    close(out, weights @ branches, 10.0)


@pytest.mark.parametrize("elements", [0, 1, 5])
@pytest.mark.parametrize("count", [1, 2])
def test_advance_branches(points, elements, count, rng):
    branches, stages = rng.standard_normal((elements, points.size)), rng.standard_normal((2, points.size))
    decay, gain = rng.standard_normal(elements), rng.standard_normal((elements, 2))
    expected = decay[:, None] * branches + gain[:, :count] @ stages[:count]
    retardation_kernels.advance_internal_variables(branches, decay, stages, gain, count)
    close(branches, expected, 10.0)


@pytest.mark.parametrize("elements", [0, 1, 5])
@pytest.mark.parametrize("count", [1, 2])
def test_advance_branches_and_energy(points, elements, count, rng):
    size = points.size
    phi, psi = rng.standard_normal((2, elements, size))
    f, u = rng.standard_normal((2, count, size))
    decay, compliances = rng.random((2, elements))
    internal_weight, compliance, stage_weight = rng.standard_normal((count, elements)), 0.5 + rng.random(count), 0.7
    g = (u - internal_weight @ psi) / compliance[:, None]
    g[1:] -= stage_weight * g[:-1] / compliance[1:, None]
    gain, rate_decay, quadrature = rng.standard_normal((3, elements, count))
    rate_gain = np.tril(rng.standard_normal((elements, count, count)))
    rates_phi = rate_decay[:, :, None] * phi[:, None, :] + np.einsum("mij,jp->mip", rate_gain, f)
    rates_psi = rate_decay[:, :, None] * psi[:, None, :] + np.einsum("mij,jp->mip", rate_gain, g)
    lost = np.einsum("mi,mip,mip->p", quadrature, rates_phi, rates_psi)
    new_phi, new_psi = decay[:, None] * phi + gain @ f, decay[:, None] * psi + gain @ g
    stored = np.einsum("m,mp,mp->p", compliances, new_phi, new_psi) / 2
    rows = np.zeros((3, points.rows))
    weights = internal_weight, stage_weight, compliance, decay, gain, rate_decay, rate_gain, quadrature, compliances
    given = phi, psi, f, u[0], u[-1], *weights
    before = phi.copy(), psi.copy()
    foreseen = np.zeros((3, points.rows))
    retardation_kernels.advance_branches_and_energy(*given, False, points.offset, foreseen)
    assert np.array_equal(phi, before[0]) and np.array_equal(psi, before[1])
    retardation_kernels.advance_branches_and_energy(*given, True, points.offset, rows)
    # To rounding: without writing, a processor may sum more numbers of a row at a time.
    close(foreseen, rows, 1e3)
    close(phi, new_phi, 10.0)
    close(psi, new_psi, 10.0)
    close(rows[0], row_sums(stored, points), 1e3)
    close(rows[1], row_sums(lost, points), 1e4)
    close(rows[2], row_sums(f[-1] * g[-1], points), 1e3)
