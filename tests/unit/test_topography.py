"""Topographies: the paper's formula and its summits and saddles, jitter, printing layers, files."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgfmd.physics import heightfile
from pgfmd.physics.asperities import site_normals
from pgfmd.physics.topography import PATTERNS, Topography, layered

WAVELENGTH = 150e-6
SHIFT = math.sqrt(3) / 4 * WAVELENGTH
TRIANGULAR = Topography("triangular", radius=375e-6, wavelength=WAVELENGTH, amplitude=4e-6)
HEXAGONAL = Topography("hexagonal", radius=375e-6, wavelength=WAVELENGTH, amplitude=9.2e-6)
SINUSOID = Topography("sinusoid", wavelength=WAVELENGTH, amplitude=1e-6)
SPHERE = Topography("sphere", curvature_radius=1e-3)
# positions of one summit, and of one saddle next to it
SUMMITS = {
    "triangular": (0.0, -SHIFT),
    "hexagonal": (0.0, WAVELENGTH / math.sqrt(3) - SHIFT),
    "sinusoid": (WAVELENGTH / 2, 3e-5),
    "sphere": (0.0, 0.0),
}
SADDLE = (WAVELENGTH / 2, -SHIFT)


def curvatures(punch, x, y, step=1e-7):
    """Second derivatives of the height at (x, y) along four directions."""
    angle = math.pi / 4 * np.arange(4)
    along = punch.heights(x + step * np.cos(angle), y + step * np.sin(angle))
    against = punch.heights(x - step * np.cos(angle), y - step * np.sin(angle))
    return (along + against - 2 * punch.heights(x, y)) / step**2


def grid(points=397):
    """Cell-centred points over 2 x 2 rectangular unit cells of the lattice."""
    fraction = (np.arange(points) + 0.5) / points - 0.5
    return 2 * WAVELENGTH * fraction, 2 * math.sqrt(3) * WAVELENGTH * fraction[:, np.newaxis]


def test_formula_of_the_paper_with_its_shift():
    x, y = np.array([0.0, 1e-5, 7e-5, -2e-4]), np.array([0.0, 3e-5, -8e-5, 1e-4])
    q = 2 * math.pi / WAVELENGTH
    waves = 1.5 + 2 * np.cos(q * x) * np.cos(q * y / math.sqrt(3)) + np.cos(2 / math.sqrt(3) * q * y)
    shifted = y - math.sqrt(3) * WAVELENGTH / 4
    np.testing.assert_allclose(HEXAGONAL.heights(x, shifted), 9.2e-6 * 4 / 9 * waves, rtol=1e-12)
    np.testing.assert_allclose(TRIANGULAR.heights(x, shifted), 4e-6 * (2 - 4 / 9 * waves), rtol=0, atol=1e-20)


@pytest.mark.parametrize(
    ("punch", "expected"), [(TRIANGULAR, 160.3e-6), (HEXAGONAL, 139.4e-6), (SINUSOID, 570e-6), (SPHERE, 1e-3)]
)
def test_summits_touch_first_and_have_the_stated_curvature(punch, expected):
    x, y = SUMMITS[punch.pattern]
    assert punch.heights(x, y) == pytest.approx(0, abs=1e-20)
    assert punch.summit_radius == pytest.approx(expected, rel=1e-3)
    directions = [0] if punch.pattern == "sinusoid" else [0, 1, 2, 3]
    np.testing.assert_allclose(1 / curvatures(punch, x, y)[directions], punch.summit_radius, rtol=2e-5)


def test_summit_radius_in_terms_of_wave_number():
    q = 2 * math.pi / WAVELENGTH
    assert TRIANGULAR.summit_radius == pytest.approx(9 / (8 * 4e-6 * q * q), rel=1e-14)
    assert HEXAGONAL.summit_radius == pytest.approx(9 / (4 * 9.2e-6 * q * q), rel=1e-14)


@pytest.mark.parametrize(("punch", "share"), [(TRIANGULAR, 16 / 9), (HEXAGONAL, 2 / 9)])
def test_saddles(punch, share):
    assert punch.heights(*SADDLE) == pytest.approx(share * punch.amplitude, rel=1e-12)
    curvature = curvatures(punch, *SADDLE)
    assert curvature.min() < 0 < curvature.max()
    step = 1e-9
    for direction in (np.array([step, 0]), np.array([0, step])):
        slope = (punch.heights(*(SADDLE + direction)) - punch.heights(*(SADDLE - direction))) / (2 * step)
        assert abs(slope) < 1e-9


@pytest.mark.parametrize(("punch", "summits"), [(TRIANGULAR, 8), (HEXAGONAL, 16)])
def test_range_and_number_of_summits(punch, summits):
    z = punch.heights(*grid())
    assert z.min() >= 0 and z.max() <= 2 * punch.amplitude
    assert z.min() < 2e-3 * punch.amplitude and z.max() > 1.998 * punch.amplitude
    # close to its tip a summit of curvature radius R is cut at height c in a disc of area 2 pi R c
    cut = 0.03 * punch.amplitude
    area = np.mean(z < cut) * 4 * math.sqrt(3) * WAVELENGTH**2
    assert area / (2 * math.pi * punch.summit_radius * cut) == pytest.approx(summits, rel=0.03)


@pytest.mark.parametrize("punch", [TRIANGULAR, HEXAGONAL])
def test_periodicity_and_mirror_symmetry(punch):
    x, y = grid(31)
    z = punch.heights(x, y)
    tolerance = 1e-12 * punch.amplitude
    for shift_x, shift_y in ((WAVELENGTH, 0.0), (WAVELENGTH / 2, math.sqrt(3) / 2 * WAVELENGTH)):
        np.testing.assert_allclose(punch.heights(x + shift_x, y + shift_y), z, rtol=0, atol=tolerance)
    np.testing.assert_allclose(punch.heights(-x, y), z, rtol=0, atol=tolerance)
    assert np.abs(punch.heights(x + WAVELENGTH / 2, y) - z).max() > punch.amplitude


def test_the_two_patterns_are_complementary():
    x, y = grid(31)
    total = TRIANGULAR.heights(x, y) / TRIANGULAR.amplitude + HEXAGONAL.heights(x, y) / HEXAGONAL.amplitude
    np.testing.assert_allclose(total, 2, rtol=1e-14)


def test_simple_shapes():
    assert np.all(Topography("flat", radius=1.0).heights(np.arange(3.0), np.arange(2.0)[:, None]) == np.zeros((2, 3)))
    assert SPHERE.heights(3e-5, 4e-5) == pytest.approx(2.5e-9 / 2e-3)
    cone = Topography("power", curvature_radius=2.0, exponent=1)
    assert cone.heights(3.0, 4.0) == pytest.approx(5.0) and cone.summit_radius == 0
    quartic = Topography("power", curvature_radius=2.0, exponent=4)
    assert quartic.heights(0.0, 1.0) == pytest.approx(2 * 0.5**4 / 4) and quartic.summit_radius == math.inf
    parabola = Topography("power", curvature_radius=1e-3, exponent=2)
    assert parabola.heights(3e-5, 4e-5) == pytest.approx(SPHERE.heights(3e-5, 4e-5))
    assert SINUSOID.heights(0.0, 5.0) == pytest.approx(2e-6)


def test_macroscopic_curvature_is_added():
    curved = Topography("triangular", wavelength=WAVELENGTH, amplitude=4e-6, curvature_radius=0.02)
    x, y = grid(17)
    np.testing.assert_allclose(
        curved.heights(x, y) - TRIANGULAR.heights(x, y), (x**2 + y**2) / 0.04, rtol=0, atol=1e-19
    )
    concave = Topography("flat", curvature_radius=-0.02)
    assert concave.heights(1e-4, 0.0) == pytest.approx(-1e-8 / 0.04)


def summit_positions(pattern, count):
    """Positions of count x count summits of the pattern."""
    i, j = np.meshgrid(np.arange(count) - count // 2, np.arange(count) - count // 3)
    x, y = SUMMITS[pattern]
    if pattern == "sinusoid":
        return x + i * WAVELENGTH, y + 0.0 * j
    return x + (i + j / 2) * WAVELENGTH, y + math.sqrt(3) / 2 * j * WAVELENGTH


def with_jitter(pattern, seed=7, jitter=2e-7):
    return Topography(pattern, wavelength=WAVELENGTH, amplitude=4e-6, height_jitter=jitter, seed=seed)


@pytest.mark.parametrize("pattern", ["triangular", "hexagonal"])
def test_jitter_of_the_summits_is_gaussian_with_the_stated_rms(pattern):
    offset = with_jitter(pattern).heights(*summit_positions(pattern, 100)) / 2e-7
    count = offset.size
    assert abs(offset.mean()) < 4 / math.sqrt(count)
    assert offset.std() == pytest.approx(1, abs=4 / math.sqrt(2 * count))
    assert abs((offset**3).mean()) < 4 * math.sqrt(15 / count)
    assert (offset**4).mean() == pytest.approx(3, abs=4 * math.sqrt(96 / count))
    assert abs((offset[1:] * offset[:-1]).mean()) < 4 / math.sqrt(count)
    assert abs((offset[:, 1:] * offset[:, :-1]).mean()) < 4 / math.sqrt(count)
    other = with_jitter(pattern, seed=8).heights(*summit_positions(pattern, 100)) / 2e-7
    assert abs((offset * other).mean()) < 4 / math.sqrt(count)


def test_both_summits_of_a_hexagonal_cell_are_lifted_independently():
    x, y = summit_positions("hexagonal", 60)
    one = with_jitter("hexagonal").heights(x, y) / 2e-7
    two = with_jitter("hexagonal").heights(x, y + WAVELENGTH / math.sqrt(3)) / 2e-7
    assert two.std() == pytest.approx(1, abs=4 / math.sqrt(2 * two.size))
    assert abs((one * two).mean()) < 4 / math.sqrt(one.size)


def test_jitter_of_line_asperities_is_constant_along_the_line():
    punch = with_jitter("sinusoid")
    x = WAVELENGTH / 2 + WAVELENGTH * np.arange(400)
    offset = (punch.heights(x, 0.0)) / 2e-7
    assert offset.std() == pytest.approx(1, abs=4 / math.sqrt(800))
    np.testing.assert_array_equal(punch.heights(x, 3.3 * WAVELENGTH), punch.heights(x, 0.0))


@pytest.mark.parametrize("pattern", ["triangular", "hexagonal"])
def test_jitter_lifts_summits_without_tilting_or_reshaping_them(pattern):
    punch, step = with_jitter(pattern), 1e-8
    x, y = SUMMITS[pattern]
    np.testing.assert_allclose(1 / curvatures(punch, x, y), punch.summit_radius, rtol=2e-5)
    assert abs(punch.heights(x + step, y) - punch.heights(x - step, y)) / (2 * step) < 1e-8
    assert abs(punch.heights(x, y + step) - punch.heights(x, y - step)) / (2 * step) < 1e-8


@pytest.mark.parametrize("pattern", ["triangular", "hexagonal", "sinusoid"])
def test_jitter_has_no_cliffs(pattern):
    smooth = Topography(pattern, wavelength=WAVELENGTH, amplitude=4e-6)
    line = np.linspace(-4 * WAVELENGTH, 4 * WAVELENGTH, 40001)
    field = (with_jitter(pattern).heights(line, 0.37 * line) - smooth.heights(line, 0.37 * line)) / 2e-7
    # neighbouring offsets differ by a few standard deviations over a distance of lambda/sqrt(3) or more
    assert np.abs(np.diff(field)).max() < 20 * (line[1] - line[0]) / WAVELENGTH
    assert 0.3 < field.std() < 1.5


@pytest.mark.parametrize("pattern", ["triangular", "hexagonal", "sinusoid"])
def test_heights_do_not_depend_on_the_partition_or_order_of_points(pattern):
    punch = Topography(
        pattern,
        wavelength=WAVELENGTH,
        amplitude=4e-6,
        curvature_radius=0.02,
        layer_step=2e-7,
        height_jitter=1e-7,
        seed=-5,
    )
    x, y = np.broadcast_arrays(*grid(61))
    whole = punch.heights(x, y)
    for rows in (slice(0, 7), slice(7, 8), slice(8, 61)):
        np.testing.assert_array_equal(punch.heights(x[rows], y[rows]), whole[rows])
    order = np.random.default_rng(1).permutation(x.size)
    np.testing.assert_array_equal(punch.heights(x.ravel()[order], y.ravel()[order]), whole.ravel()[order])
    assert punch.heights(x[5, 9], y[5, 9]) == whole[5, 9]
    assert punch.heights(x[:0], y[:0]).shape == (0, 61)


def test_site_numbers_are_pinned_across_versions():
    """The random surface is part of a scene's definition, so these numbers must never change.

    Origin: the same splitmix64 chain in unbounded Python integers.
    """
    numbers = site_normals(42, np.array([0, 1, -1]), np.array([0, 0, 5]))
    np.testing.assert_allclose(numbers, [-0.2872138887120173, -1.8282672483858906, 1.312205576412854], rtol=1e-12)
    assert site_normals(42, np.array([1]), np.array([0])) != site_normals(42, np.array([0]), np.array([1]))


def test_layer_levels_and_ramps():
    step, smoothing = 2e-7, 0.4
    flat_share = (1 - smoothing) / 2
    levels = np.arange(-3, 4)
    for offset in (-0.99 * flat_share, 0.0, 0.99 * flat_share):
        np.testing.assert_allclose(
            layered(step * (levels + offset), step, smoothing), step * levels, rtol=0, atol=1e-15 * step
        )
    np.testing.assert_allclose(layered(step * (levels + 0.5), step, smoothing), step * (levels + 0.5), rtol=1e-12)


@settings(derandomize=True, database=None, max_examples=200)
@given(st.lists(st.floats(-1e-5, 1e-5), min_size=2, max_size=20), st.floats(1e-8, 1e-6), st.floats(0.01, 1))
def test_layers_are_monotone_and_move_by_less_than_half_a_step(heights, step, smoothing):
    z = np.sort(np.array(heights))
    printed = layered(z, step, smoothing)
    assert np.all(np.diff(printed) >= -1e-15 * 1e-5)
    assert np.all(np.abs(printed - z) <= step / 2 * (1 + 1e-9))


def test_layered_punch_spends_the_stated_share_on_the_levels():
    punch = Topography("triangular", wavelength=WAVELENGTH, amplitude=4e-6, layer_step=2e-7, layer_smoothing=0.5)
    x, y = grid()
    raw, printed = TRIANGULAR.heights(x, y), punch.heights(x, y)
    on_level = np.abs(printed / 2e-7 - np.round(printed / 2e-7)) < 1e-9
    expected = np.abs(raw / 2e-7 - np.round(raw / 2e-7)) <= 0.25
    assert 0.4 < on_level.mean() < 0.6
    assert np.mean(on_level != expected) < 0.02


def write_map(path, z):
    if path.suffix == ".npy":
        np.save(path, z)
    elif path.suffix == ".npz":
        np.savez(path, z=z, size=[3e-3, 2e-3])
    else:
        np.savetxt(path, z, delimiter="," if path.suffix == ".csv" else " ", header="heights in m", fmt="%.17g")


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".csv", ".txt"])
@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("periodic", [True, False])
def test_file_round_trip(tmp_path, suffix, order, periodic):
    z = np.random.default_rng(2).normal(size=(8, 12)) * 1e-6
    path = tmp_path / f"map{suffix}"
    write_map(path, z)
    punch = Topography("file", file=path, file_size=(3e-3, 2e-3), file_order=order, file_periodic=periodic)
    x = ((np.arange(12) + 0.5) / 12 - 0.5) * 3e-3
    y = ((np.arange(8) + 0.5) / 8 - 0.5) * 2e-3
    np.testing.assert_allclose(punch.heights(x, y[:, None]), z, rtol=0, atol=1e-19)
    assert math.isnan(punch.summit_radius)
    if suffix == ".npz":
        own_size = Topography("file", file=path, file_order=order, file_periodic=periodic)
        np.testing.assert_array_equal(own_size.heights(x, y[:, None]), punch.heights(x, y[:, None]))
    if periodic:
        moved = punch.heights(x + 3e-3, y[:, None] - 4e-3)
        np.testing.assert_allclose(moved, z, rtol=0, atol=1e-17)


@pytest.mark.parametrize(("order", "tolerance"), [(1, 3.4e-3), (3, 1.1e-6)])
def test_file_interpolates_a_smooth_periodic_surface(tmp_path, order, tolerance):
    count_x, count_y, size_x, size_y = 64, 96, 2.0, 3.0

    def surface(x, y):
        return np.cos(2 * np.pi * x / size_x) + np.sin(4 * np.pi * y / size_y)

    x = ((np.arange(count_x) + 0.5) / count_x - 0.5) * size_x
    y = ((np.arange(count_y) + 0.5) / count_y - 0.5) * size_y
    np.save(tmp_path / "map.npy", surface(x, y[:, None]))
    punch = Topography(
        "file", file=tmp_path / "map.npy", file_size=(size_x, size_y), file_periodic=True, file_order=order
    )
    x, y = np.random.default_rng(4).uniform(-1.5, 1.5, (2, 2000))
    error = np.abs(punch.heights(x, y) - surface(x, y)).max()
    # leading errors for waves of k dx = 0.098 and 0.131: the sum of (k dx)^2/8, of (k dx)^4/384
    assert tolerance / 2 < error < tolerance


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("order", [1, 3])
def test_a_large_map_is_interpolated_in_stripes_of_its_own(tmp_path, monkeypatch, order, periodic):
    heights = np.random.default_rng(3).standard_normal((90, 70))
    np.save(tmp_path / "map.npy", heights)
    face = {"file": tmp_path / "map.npy", "file_size": (2.0, 2.5), "file_order": order, "file_periodic": periodic}
    # Beyond the edges by less than the samples that a spline needs to become level there.
    reach = np.array([[2.0], [2.5]]) * (1.4 if periodic else 0.51)
    x, y = np.random.default_rng(4).uniform(-1.0, 1.0, (2, 3000)) * reach
    whole = Topography("file", radius=0.9, **face).heights(x, y)
    monkeypatch.setattr(heightfile, "WHOLE", 800)
    large = Topography("file", radius=0.9, **face)
    np.testing.assert_allclose(large.heights(x, y), whole, rtol=0, atol=1e-9)
    # It stays on the disk, and a place has the same bits whatever else is asked for.
    assert isinstance(large.map.heights, np.memmap)
    np.testing.assert_array_equal(large.heights(x[::-7], y[::-7]), large.heights(x, y)[::-7])


def test_map_must_cover_the_punch_but_not_the_block_around_it(tmp_path):
    np.save(tmp_path / "map.npy", np.ones((4, 4)))
    x = np.array([-1.0, 0.0, 1.0])
    covered = Topography("file", radius=0.9, file=tmp_path / "map.npy", file_size=(1.8, 1.8))
    np.testing.assert_array_equal(covered.heights(x, x[:, None]), np.ones((3, 3)))
    short = Topography("file", radius=1.0, file=tmp_path / "map.npy", file_size=(1.8, 1.8))
    with pytest.raises(ValueError, match="less than the punch"):
        short.heights(x, x[:, None])


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.csv", "1,2\n3,oops\n", "a.csv"),
        ("b.txt", "1 2\n3 nan\n", "not finite"),
        ("c.txt", "1 2 3\n", "2 x 2"),
        ("d.stl", "solid", "unknown kind of file"),
    ],
)
def test_bad_files_are_refused(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    punch = Topography("file", file=tmp_path / name, file_size=(1.0, 1.0))
    with pytest.raises(ValueError, match=message):
        punch.heights(0.0, 0.0)


def test_file_without_a_size_is_refused(tmp_path):
    np.save(tmp_path / "map.npy", np.ones((4, 4)))
    with pytest.raises(ValueError, match="file_size"):
        Topography("file", file=tmp_path / "map.npy").heights(0.0, 0.0)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"pattern": "square"}, "triangular, hexagonal"),
        ({"pattern": "triangular", "wavelength": 1.0}, "amplitude: missing"),
        ({"pattern": "sphere", "curvature_radius": -1.0}, "curvature_radius"),
        ({"pattern": "power", "exponent": 2.0}, "curvature_radius"),
        ({"pattern": "flat", "curvature_radius": 0.0}, "curvature_radius"),
        ({"pattern": "flat", "height_jitter": 1e-7}, "no asperities"),
        ({"pattern": "flat", "layer_step": -1e-7}, "layer_step"),
        ({"pattern": "file", "file": "map.npy", "file_relief": 0.0}, "file_relief"),
        ({"pattern": "flat", "layer_step": 1e-7, "layer_smoothing": 0.0}, "layer_smoothing"),
    ],
)
def test_bad_fields_are_named(fields, message):
    with pytest.raises(ValueError, match=message):
        Topography(**fields)


def test_every_pattern_names_fields_that_exist():
    for pattern in PATTERNS.values():
        assert set(pattern.needs) <= set(Topography.__dataclass_fields__)
