"""Compliances: closed forms against Navier's equations, free kernels against their Fourier and Hankel transforms."""

import math

import numpy as np
import pytest
from scipy.fft import irfft2, rfft2
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.sparse.linalg import LinearOperator, cg
from scipy.special import j0

from pgfmd.physics.film import Film, ratio_deficit, ratio_over_x
from pgfmd.physics.free_kernel import FAR, TABLE_REACH, FreeFilm, FreeHalfSpace
from pgfmd.physics.halfspace import HalfSpace, TabulatedCompliance

BASES = ("bonded", "sliding")
POISSON_RATIOS = (-0.4, 0.0, 0.3, 0.495, 0.5)


def navier_compliance(q, youngs_modulus, poisson_ratio, thickness, base):
    """Surface displacement per normal traction of wave number q, by integrating Navier's equations through the film.

    State (U, W, s, t) with u_x = U sin qx, u_z = W cos qx, sigma_zz = s cos qx, sigma_xz = t sin qx.
    """
    shear = youngs_modulus / (2 * (1 + poisson_ratio))
    lame = youngs_modulus * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio))
    stiff = lame + 2 * shear
    through = expm(
        thickness
        * np.array(
            [
                [0, q, 0, 1 / shear],
                [-lame * q / stiff, 0, 1 / stiff, 0],
                [0, 0, 0, -q],
                [q * q * (stiff - lame**2 / stiff), 0, q * lame / stiff, 0],
            ]
        )
    )
    free = [2, 3] if base == "bonded" else [0, 2]  # what the base leaves open: (s, t), or (U, s) where it slides
    unknown = np.linalg.solve(through[np.ix_([2, 3], free)], [1.0, 0.0])
    return through[1, free] @ unknown


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("poisson_ratio", [-0.4, 0.0, 0.3, 0.49])
def test_film_solves_naviers_equations(base, poisson_ratio):
    film = Film(2.0, poisson_ratio, 0.7, base)
    for qh in (0.02, 0.3, 0.5, 1.0, 2.5, 4.0):
        expected = navier_compliance(qh / 0.7, 2.0, poisson_ratio, 0.7, base)
        assert film(qh / 0.7, 0.0) == pytest.approx(expected, rel=1e-9)


def test_half_space_value_and_periodic_rule_at_zero():
    solid = HalfSpace(contact_modulus=4.0)
    assert solid(3.0, 4.0) == pytest.approx(2 / (4.0 * 5.0), rel=1e-15)
    assert solid(0.0, 0.0) == 0.0
    assert solid(np.arange(3.0)[:, None], np.arange(4.0)).shape == (3, 4)
    assert not solid.is_free and not Film(1.0, 0.3, 1.0).is_free


def test_prestrain_scales_each_component():
    solid = HalfSpace(contact_modulus=1.0, prestrain=(2.0, 0.5))
    assert solid(3.0, 0.0) == pytest.approx(2 / 6)
    assert solid(0.0, 3.0) == pytest.approx(2 / 1.5)


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("poisson_ratio", POISSON_RATIOS)
def test_film_is_a_half_space_to_short_waves_without_overflow(base, poisson_ratio):
    film = Film(2.0, poisson_ratio, 1.0, base)
    with np.errstate(over="raise", invalid="raise", divide="raise"):
        values = film(np.array([40.0, 1.7e4, 1e5]), 0.0)
    np.testing.assert_allclose(values, HalfSpace(film.contact_modulus)(np.array([40.0, 1.7e4, 1e5]), 0.0), rtol=1e-14)


@pytest.mark.parametrize("poisson_ratio", POISSON_RATIOS)
def test_film_limits_of_long_waves(poisson_ratio):
    youngs_modulus, thickness, qh = 3.0, 0.2, 1e-8
    oedometric = thickness * (1 + poisson_ratio) * (1 - 2 * poisson_ratio) / (youngs_modulus * (1 - poisson_ratio))
    lateral = thickness * (1 - poisson_ratio**2) / youngs_modulus
    bonded = Film(youngs_modulus, poisson_ratio, thickness, "bonded")
    sliding = Film(youngs_modulus, poisson_ratio, thickness, "sliding")
    assert bonded(0.0, 0.0) == pytest.approx(oedometric, rel=1e-15, abs=0)
    assert sliding(0.0, 0.0) == pytest.approx(oedometric, rel=1e-15, abs=0)
    assert sliding(qh / thickness, 0.0) == pytest.approx(lateral, rel=1e-14)
    # next order of an incompressible bonded film: lubrication, q^2 h^3 (1 + nu) / (1.5 E) = q^2 h^3 / E
    expected = oedometric if poisson_ratio < 0.5 else qh**2 * thickness / youngs_modulus
    assert bonded(qh / thickness, 0.0) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("poisson_ratio", POISSON_RATIOS)
def test_film_forms_agree_with_extended_precision_and_with_each_other(base, poisson_ratio):
    x = np.geomspace(1e-3, 12, 400)
    wide, nu = x.astype(np.longdouble), np.longdouble(poisson_ratio)
    if base == "bonded":
        top = (3 - 4 * nu) * np.sinh(2 * wide) - 2 * wide
        ratio = top / ((3 - 4 * nu) * np.cosh(2 * wide) + 2 * wide**2 + 5 - 12 * nu + 8 * nu**2)
    else:
        ratio = (np.cosh(2 * wide) - 1) / (np.sinh(2 * wide) + 2 * wide)
    np.testing.assert_allclose(ratio_over_x(x, poisson_ratio, base), (ratio / wide).astype(float), rtol=2e-12)
    np.testing.assert_allclose(ratio_over_x(x[x > 0.1], poisson_ratio, base), (ratio / wide)[x > 0.1], rtol=2e-15)
    np.testing.assert_allclose(
        1 - x * ratio_over_x(x, poisson_ratio, base), ratio_deficit(x, poisson_ratio, base), rtol=0, atol=1e-15
    )


def test_table_is_exact_for_a_power_law_and_reads_its_file(tmp_path):
    path = tmp_path / "compliance.txt"
    path.write_text("# q [rad/m]  G0 [m/Pa]\n1e3 2e-6  # long\n1e4 2e-7\n1e6 2e-9\n")
    table = TabulatedCompliance.from_file(path)
    q = np.geomspace(1e3, 1e6, 31)
    np.testing.assert_allclose(table(q, 0.0), HalfSpace(1e3)(q, 0.0), rtol=1e-12)
    np.testing.assert_allclose(table(0.6 * 5e4, -0.8 * 5e4), 4e-8, rtol=1e-12)
    assert table(0.0, 0.0) == 0.0
    assert TabulatedCompliance([0.0, 1.0, 2.0], [7.0, 3.0, 1.0])(0.0, 0.0) == 7.0


def test_table_names_the_range_it_misses():
    table = TabulatedCompliance([10.0, 100.0], [1.0, 0.1])
    with pytest.raises(ValueError, match=r"covers q = 10 to 100 rad/m, but 5 to 250 rad/m are needed"):
        table(np.array([0.0, 5.0, 250.0]), 0.0)


@pytest.mark.parametrize(
    ("q", "compliance", "message"),
    [
        ([1.0, 1.0], [1.0, 1.0], "strictly increasing"),
        ([1.0, 2.0], [1.0, -1.0], "G0 > 0"),
        ([1.0, math.nan], [1.0, 1.0], "not finite"),
        ([0.0, 1.0], [1.0, 1.0], "two rows"),
        ([1.0, 2.0], [1.0], "two equal columns"),
    ],
)
def test_bad_tables_are_refused(q, compliance, message):
    with pytest.raises(ValueError, match=message):
        TabulatedCompliance(q, compliance)


def test_bad_file_is_refused(tmp_path):
    path = tmp_path / "three.txt"
    path.write_text("1 2 3\n4 5 6\n")
    with pytest.raises(ValueError, match=r"three\.txt: found 3 columns"):
        TabulatedCompliance.from_file(path)


@pytest.mark.parametrize(
    ("build", "name"),
    [
        (lambda: HalfSpace(0.0), "contact_modulus"),
        (lambda: HalfSpace(1.0, (1.0, -1.0)), r"prestrain\[1\]"),
        (lambda: Film(1.0, 0.51, 1.0), "poisson_ratio"),
        (lambda: Film(1.0, 0.3, math.inf), "thickness"),
        (lambda: FreeFilm(1.0, 0.3, 1.0, "glued"), "base"),
        (lambda: FreeFilm(1.0, 0.3, 1.0).kernel(0.0, 0.0, 2.1), "spacing"),
    ],
)
def test_bad_arguments_are_named(build, name):
    with pytest.raises(ValueError, match=name):
        build()


def test_free_kernel_at_the_load_is_loves_value():
    solid = FreeHalfSpace(contact_modulus=5.0)
    assert solid.is_free
    assert solid.kernel(0.0, 0.0, 0.3) == pytest.approx(4 * 0.3 * math.asinh(1.0) / (math.pi * 5.0), rel=1e-15)


def test_free_kernel_is_the_cell_average_at_every_distance():
    rng = np.random.default_rng(3)
    parts = [rng.uniform(0, 2, 500), rng.uniform(2, 40, 500), rng.uniform(FAR - 1, FAR + 1, 200)]
    distance = np.concatenate(parts)
    angle = rng.uniform(0, 2 * np.pi, distance.size)
    x, y = distance * np.cos(angle), distance * np.sin(angle)
    wide_x, wide_y = x.astype(np.longdouble), y.astype(np.longdouble)
    exact = np.zeros(distance.size, dtype=np.longdouble)
    for sign_x in (1, -1):
        for sign_y in (1, -1):
            u, v = wide_x + sign_x * np.longdouble(0.5), wide_y + sign_y * np.longdouble(0.5)
            exact += sign_x * sign_y * (u * np.arcsinh(v / np.abs(u)) + v * np.arcsinh(u / np.abs(v)))
    kernel = FreeHalfSpace(1 / math.pi).kernel(x, y, 1.0)
    np.testing.assert_allclose(kernel, exact.astype(float), rtol=2e-13)


def test_free_kernel_far_away_is_the_multipole_series():
    x, y = np.array([50.0, 3e3, 1e6, 0.0]), np.array([20.0, -4e3, 1e-3, 1e5])
    r = np.hypot(x, y)
    kernel = FreeHalfSpace(1 / math.pi).kernel(x, y, 1.0)
    fourth = (105 * (x**4 + y**4) / r**9 - 90 * (x**2 + y**2) / r**7 + 18 / r**5) / 1920
    fourth += (105 * x**2 * y**2 / r**9 - 12 / r**5) / 576
    np.testing.assert_allclose(kernel, 1 / r + 1 / (24 * r**3) + fourth, rtol=1e-12)


def test_free_kernel_takes_offsets_on_cell_edges_and_corners():
    kernel = FreeHalfSpace(1 / math.pi).kernel(np.array([0.5, 0.5, 0.0]), np.array([0.5, 0.0, -0.5]), 1.0)
    corner = 2 * math.asinh(1.0)
    edge = 2 * (0.5 * math.asinh(2.0) + math.asinh(0.5))
    np.testing.assert_allclose(kernel, [corner, edge, edge], rtol=1e-14)


def test_prestrained_free_kernel_is_anisotropic_and_reduces_to_the_isotropic_one():
    prestrained = FreeHalfSpace(1 / math.pi, (2.0, 0.5))
    x, y = 300.0, 400.0
    expected = 1 / (2.0 * 0.5 * math.hypot(x / 2.0, y / 0.5))
    assert prestrained.kernel(x, y, 1.0) == pytest.approx(expected, rel=1e-5)
    uniform = FreeHalfSpace(3.0, (2.0, 2.0))
    assert uniform.kernel(1.2, 0.3, 0.4) == pytest.approx(FreeHalfSpace(6.0).kernel(1.2, 0.3, 0.4), rel=1e-14)


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("poisson_ratio", [0.0, 0.3, 0.5])
def test_free_film_is_the_hankel_transform_of_the_difference(base, poisson_ratio):
    film, spacing = FreeFilm(2.0, poisson_ratio, 0.5, base), 1e-4
    half_space = FreeHalfSpace(film.contact_modulus)
    for s in (0.0, 0.01, 0.777, 3.0, 11.0):
        point = -quad(
            lambda x, s=s: ratio_deficit(np.float64(x), poisson_ratio, base) * j0(x * s),
            1e-300,
            30,
            epsabs=1e-13,
            epsrel=0,
            limit=400,
        )[0]
        difference = film.kernel(0.5 * s, 0.0, spacing) - half_space.kernel(0.5 * s, 0.0, spacing)
        scaled = difference * math.pi * film.contact_modulus * 0.5 / spacing**2
        # the point value differs from the cell average by (spacing/h)^2/24 of the curvature, 1e-9 here
        assert scaled == pytest.approx(point, abs=1e-8)


@pytest.mark.parametrize("spacing", [0.1, 1.0, 2.0])
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("poisson_ratio", [0.3, 0.5])
def test_free_film_sums_to_the_compliance_of_a_wide_load(spacing, base, poisson_ratio):
    """Poisson summation: over all cells the averaged kernel adds up to the limit of G0 at q -> 0, at any spacing."""
    film = FreeFilm(2.0, poisson_ratio, 1.0, base)
    x = spacing * np.arange(-round(40 / spacing), round(40 / spacing) + 1)
    total = film.kernel(x[:, None], x, spacing).sum()
    limit = Film(2.0, poisson_ratio, 1.0, base)(1e-7, 0.0)
    assert total == pytest.approx(limit, abs=2e-9 * film.kernel(0.0, 0.0, spacing))


def test_free_film_dies_out_without_a_step():
    film = FreeFilm(1.0, 0.5, 1.0, "bonded")
    edge = film.kernel(np.array([TABLE_REACH - 1e-3, TABLE_REACH + 1e-3]), 0.0, 0.2)
    assert edge[1] == 0.0
    assert abs(edge[0]) < 1e-12 * film.kernel(0.0, 0.0, 0.2)


def flat_punch_stiffness(kernel, points):
    """Force per displacement of a square array's inscribed circular punch; `kernel(dx, dy)` between its points."""
    offset = np.arange(2 * points)
    offset = np.where(offset < points, offset, offset - 2 * points).astype(float)
    kernel_hat = rfft2(kernel(offset, offset[:, None]))
    centred = np.arange(points) - (points - 1) / 2
    inside = np.hypot(centred, centred[:, None]) <= points / 2

    def displacement(traction):
        field = np.zeros((2 * points, 2 * points))
        field[:points, :points][inside] = traction
        return irfft2(kernel_hat * rfft2(field), s=field.shape)[:points, :points][inside]

    count = int(inside.sum())
    traction, failed = cg(LinearOperator((count, count), matvec=displacement), np.ones(count), rtol=1e-8)
    assert failed == 0
    return traction.sum()


def flat_punch_ratio(radius_over_thickness, poisson_ratio, base):
    """Stiffness of a frictionless flat punch on a film relative to 2 a E*, from its dual integral equations.

    With the traction's Hankel transform written as int_0^1 phi(t) cos(q t) dt (a = 1) they become
    phi(t) - (2/pi) int_0^1 phi(t') int_0^inf D(q h) cos(q t) cos(q t') dq dt' = 1, and the ratio is int_0^1 phi dt.
    """
    nodes, weights = np.polynomial.legendre.leggauss(24)
    t, weight = (1 + nodes) / 2, weights / 2
    x = np.linspace(0, 25, 20001)[1:] - 25 / 40000
    deficit = ratio_deficit(x, poisson_ratio, base) * 25 / 20000
    waves = np.cos(np.outer(t, x * radius_over_thickness))
    matrix = 2 / math.pi * radius_over_thickness * (waves * deficit) @ waves.T
    return weight @ np.linalg.solve(np.eye(24) - matrix * weight, np.ones(24))


@pytest.mark.parametrize(("base", "expected"), [("bonded", 1.26), ("sliding", 1.16)])
def test_flat_punch_on_the_papers_film_is_stiffer_than_on_a_half_space(base, expected):
    """a = h/5.3 and nu = 0.495, as in the paper, which says 20 %."""
    exact = flat_punch_ratio(1 / 5.3, 0.495, base)
    assert exact == pytest.approx(expected, abs=0.005)
    points, radius = 48, 375e-6
    spacing = 2 * radius / points
    film = FreeFilm(2e6, 0.495, 5.3 * radius, base)
    half_space = FreeHalfSpace(film.contact_modulus)
    on_film = flat_punch_stiffness(lambda i, j: film.kernel(i * spacing, j * spacing, spacing), points)
    on_half_space = flat_punch_stiffness(lambda i, j: half_space.kernel(i * spacing, j * spacing, spacing), points)
    assert on_film / on_half_space == pytest.approx(exact, rel=2e-3)
    assert on_half_space * spacing**2 == pytest.approx(2 * radius * film.contact_modulus, rel=0.01)
