"""Summits, saddles and valleys of a punch: against the closed form of the corrugation, and against its gradient; those
of a height map against the formula that it was sampled from, and against floods of a few pixels level by level."""

import math

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pgfmd import load
from pgfmd.physics import contact_sites as module
from pgfmd.physics.contact_sites import KINDS, contact_sites
from pgfmd.physics.persistence import critical_points
from pgfmd.physics.topography import Topography
from tests.unit.small_runs import run

WAVE, RADIUS = 150e-6, 375e-6
SADDLE_HEIGHT = {"hexagonal": 2 / 9, "triangular": 16 / 9}


def corrugated(pattern, **more):
    return Topography(pattern, **{"radius": RADIUS, "wavelength": WAVE, "amplitude": 4e-6} | more)


def lattice(*offsets):
    """All points within the outline of triangular lattices of spacing WAVE, at offsets from the pattern's origin."""
    i, j = np.meshgrid(np.arange(-9, 10), np.arange(-9, 10))
    x, y = WAVE * (i + 0.5 * j).ravel(), WAVE * (0.5 * math.sqrt(3) * j).ravel()
    x = np.concatenate([x + a * WAVE for a, _ in offsets])
    y = np.concatenate([y + b * WAVE for _, b in offsets]) - math.sqrt(3) / 4 * WAVE
    return np.array([x, y])[:, np.hypot(x, y) <= RADIUS]


TOPS = [(0.0, 0.0)]
HOLLOWS = [(0.0, 1 / math.sqrt(3)), (0.0, -1 / math.sqrt(3))]
MIDDLES = [(0.5, 0.0), (0.25, math.sqrt(3) / 4), (-0.25, math.sqrt(3) / 4)]
PLACES = {"triangular": (TOPS, MIDDLES, HOLLOWS), "hexagonal": (HOLLOWS, MIDDLES, TOPS)}


@pytest.mark.parametrize("pattern", PLACES)
def test_sites_of_the_corrugations_are_where_the_closed_form_has_them(pattern):
    face = corrugated(pattern)
    sites = contact_sites(face)
    heights = (0.0, SADDLE_HEIGHT[pattern] * face.amplitude, 2 * face.amplitude)
    for kind, (offsets, height) in enumerate(zip(PLACES[pattern], heights, strict=True)):
        found, expected = np.array([sites.x, sites.y])[:, sites.kind == kind], lattice(*offsets)
        assert found.shape == expected.shape
        away = np.hypot(*(found[:, :, None] - expected[:, None, :])).min(axis=1)
        assert away.max() < 1e-8 * WAVE, KINDS[kind]
        np.testing.assert_allclose(sites.z[sites.kind == kind], height, atol=1e-12 * face.amplitude)
    assert sites.count() == ([23, 69, 42] if pattern == "triangular" else [42, 69, 23])
    assert sites.count(slice(0, 30)) == ([23, 7, 0] if pattern == "triangular" else [30, 0, 0])


def gradient(pattern, x, y, radius_of_curvature, amplitude):
    """grad z of the corrugation, differentiated by hand."""
    q = 2 * math.pi / WAVE
    y0 = y + math.sqrt(3) / 4 * WAVE
    sign = (1 if pattern == "hexagonal" else -1) * 4 / 9 * amplitude * q
    along_x = -2 * np.sin(q * x) * np.cos(q * y0 / math.sqrt(3))
    along_y = -2 / math.sqrt(3) * (np.cos(q * x) * np.sin(q * y0 / math.sqrt(3)) + np.sin(2 * q * y0 / math.sqrt(3)))
    return sign * along_x + x / radius_of_curvature, sign * along_y + y / radius_of_curvature


@pytest.mark.parametrize("pattern", PLACES)
@pytest.mark.parametrize("curvature_radius", [50e-3, -10e-3])
def test_a_curved_face_has_its_sites_where_the_slope_vanishes(pattern, curvature_radius):
    sites = contact_sites(corrugated(pattern, curvature_radius=curvature_radius))
    slope = np.hypot(*gradient(pattern, sites.x, sites.y, curvature_radius, 4e-6))
    assert slope.max() < 1e-9
    # None is missing: around the outline the slope turns as often as the indices of the sites within say.
    angle = np.linspace(0, 2 * math.pi, 20001)
    along = gradient(pattern, RADIUS * np.cos(angle), RADIUS * np.sin(angle), curvature_radius, 4e-6)
    turns = np.unwrap(np.arctan2(along[1], along[0]))[[0, -1]] / (2 * math.pi)
    summits, saddles, valleys = sites.count()
    assert turns[1] - turns[0] == pytest.approx(summits - saddles + valleys, abs=1e-6) and len(sites) > 100


def test_layers_move_no_site_and_unequal_heights_only_a_little():
    plain = contact_sites(corrugated("hexagonal"))
    layered = contact_sites(corrugated("hexagonal", layer_step=0.5e-6))
    np.testing.assert_array_equal([layered.x, layered.y, layered.z], [plain.x, plain.y, plain.z])
    uneven = contact_sites(corrugated("hexagonal", height_jitter=50e-9, seed=3))
    # Sites at the rim may come in or leave.
    inner, known = (np.hypot(sites.x, sites.y) < 0.85 * RADIUS for sites in (uneven, plain))
    assert uneven.count(inner) == plain.count(known)
    lifts = uneven.z[inner & (uneven.kind == 0)]
    assert 20e-9 < lifts.std() < 100e-9
    again = contact_sites(corrugated("hexagonal", height_jitter=50e-9, seed=3))
    np.testing.assert_array_equal(again.x, uneven.x)


def test_a_large_punch_has_as_many_sites_as_its_area_says():
    face = corrugated("triangular", radius=20 * WAVE)
    cells = math.pi * 20**2 / (math.sqrt(3) / 2)
    assert contact_sites(face).count() == pytest.approx([cells, 3 * cells, 2 * cells], rel=0.01)


def test_a_sinusoid_has_a_site_for_each_ridge_and_trough():
    sites = contact_sites(Topography("sinusoid", wavelength=50e-6, amplitude=1e-6), side=200e-6)
    assert sites.names() == ["summit"] * 4 + ["valley"] * 4
    np.testing.assert_allclose(1e6 * sites.x, [-75, -25, 25, 75, -100, -50, 0, 50], atol=1e-6)
    np.testing.assert_array_equal(sites.y, 0)
    round_ = Topography("sinusoid", radius=110e-6, wavelength=50e-6, amplitude=1e-6, curvature_radius=0.1)
    assert contact_sites(round_).names() == ["summit"] * 4 + ["saddle"] * 5


@pytest.mark.parametrize(
    ("face", "names"),
    [
        (Topography("flat", radius=RADIUS), []),
        (Topography("flat", radius=RADIUS, curvature_radius=0.05), ["summit"]),
        (Topography("flat", radius=RADIUS, curvature_radius=-0.05), ["valley"]),
        (Topography("sphere", radius=RADIUS, curvature_radius=0.005, layer_step=1e-7), ["summit"]),
        (Topography("power", radius=RADIUS, curvature_radius=0.005, exponent=4.0), ["summit"]),
    ],
    ids=["flat", "convex", "concave", "sphere", "power"],
)
def test_other_faces_have_one_site_or_none(face, names):
    sites = contact_sites(face)
    assert sites.names() == names and not np.any(sites.x) and not np.any(sites.y)


def test_a_face_without_an_outline_needs_the_side_of_its_cell():
    with pytest.raises(ValueError, match="give the side of the cell"):
        contact_sites(Topography("sinusoid", wavelength=50e-6, amplitude=1e-6))


# -- height maps -------------------------------------------------------------------------------------------------------

CLEAR = 348e-6
"""A radius at which no site of the corrugations is close to the outline."""


def pixels(count, size):
    return ((np.arange(count) + 0.5) / count - 0.5) * size


def map_of(folder, z, size, radius=None, **more):
    """The face of a square height map z of this size [m]."""
    np.save(folder / "map.npy", z)
    return Topography("file", radius=radius, file=folder / "map.npy", file_size=(size, size), **more)


def sampled(folder, face, count, size, noise=0.0, **more):
    """The face of a map with so many pixels a side, with Gaussian noise [m] on each."""
    axis = pixels(count, size)
    z = face.heights(axis, axis[:, np.newaxis])
    return map_of(folder, z + noise * np.random.default_rng(5).normal(size=z.shape), size, face.radius, **more)


def farthest(found, known):
    """How far the sites are from the known ones of their kind at most [m]."""
    away = np.hypot(found.x[:, None] - known.x, found.y[:, None] - known.y)
    return np.where(found.kind[:, None] == known.kind, away, np.inf).min(axis=1).max()


@pytest.mark.parametrize("curvature_radius", [math.inf, 50e-3, -50e-3])
@pytest.mark.parametrize("pattern", PLACES)
@pytest.mark.parametrize(("count", "size"), [(301, 0.9e-3), (500, 1.2e-3)])
def test_a_map_has_the_sites_of_the_formula_with_noise_and_without(tmp_path, pattern, curvature_radius, count, size):
    face = corrugated(pattern, radius=CLEAR, curvature_radius=curvature_radius)
    known = contact_sites(face)
    for noise, pixels_away, height in ((0.0, 2.0, 0.03e-6), (40e-9, 4.5, 0.2e-6)):
        found = contact_sites(sampled(tmp_path, face, count, size, noise))
        assert found.count() == known.count()
        assert farthest(found, known) < pixels_away * size / count
        for kind in range(3):
            z, expected = (np.sort(sites.z[sites.kind == kind]) for sites in (found, known))
            np.testing.assert_allclose(z, expected, rtol=0, atol=height)
    # In order of kind, then y, then x.
    assert np.all(np.lexsort((found.x, found.y, found.kind)) == np.arange(len(found)))


@pytest.mark.parametrize("pattern", PLACES)
def test_a_map_that_ends_at_the_outline_loses_no_more_than_a_saddle_there(tmp_path, pattern):
    face = corrugated(pattern, radius=CLEAR)
    known, found = contact_sites(face), contact_sites(sampled(tmp_path, face, 250, 2 * CLEAR))
    assert (found.count()[0], found.count()[2]) == (known.count()[0], known.count()[2])
    assert 0 <= known.count()[1] - found.count()[1] <= 2 and farthest(found, known) < 2.0 * 2 * CLEAR / 250


@pytest.mark.parametrize("ground", [-10e-6, 100e-6])
@pytest.mark.parametrize("pattern", PLACES)
def test_ground_beyond_the_outline_makes_no_sites(tmp_path, pattern, ground):
    """Lower ground takes summits from the last half wave before the rim at most, higher ground valleys."""
    face, axis = corrugated(pattern, radius=CLEAR), pixels(401, 0.9e-3)
    z = face.heights(axis, axis[:, np.newaxis])
    z[np.hypot(axis, axis[:, np.newaxis]) > CLEAR] = ground
    known, found = contact_sites(face), contact_sites(map_of(tmp_path, z, 0.9e-3, CLEAR))
    assert farthest(found, known) < 2.0 * 0.9e-3 / 401
    inner, expected = (np.hypot(sites.x, sites.y) < CLEAR - 0.5 * WAVE for sites in (found, known))
    assert found.count(inner) == known.count(expected)
    kept = 2 if ground < 0 else 0
    assert found.count()[kept] == known.count()[kept]


def test_steps_in_height_move_sites_within_their_plateaus(tmp_path):
    face, axis = corrugated("hexagonal", radius=CLEAR), pixels(401, 0.9e-3)
    z = face.heights(axis, axis[:, np.newaxis])
    found = contact_sites(map_of(tmp_path, 0.1e-6 * np.round(z / 0.1e-6), 0.9e-3, CLEAR))
    assert found.count() == contact_sites(face).count()
    # Half a step above a summit of the radius R, its plateau has a radius of sqrt(R * step), 4 um; others are flatter.
    assert farthest(found, contact_sites(face)) < 9e-6
    for flat in (map_of(tmp_path, np.full((9, 9), 3.3e-6), 0.9e-3, radius) for radius in (CLEAR, None)):
        assert len(contact_sites(flat, side=0.9e-3)) == 0


def test_a_coarser_lattice_where_a_map_is_very_fine(tmp_path, monkeypatch):
    face = corrugated("triangular", radius=CLEAR)
    monkeypatch.setattr(module, "MOST_SAMPLES", 180)
    found = contact_sites(sampled(tmp_path, face, 900, 1.1e-3))
    assert found.count() == contact_sites(face).count() and farthest(found, contact_sites(face)) < 10 * 1.1e-3 / 900


def hills(axis, *places):
    """Downward hills (x, y, depth) of width 0.1, as a map."""
    x, y = axis, axis[:, np.newaxis]
    return -sum(depth * np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * 0.1**2)) for a, b, depth in places)


def test_a_threshold_between_two_reliefs_takes_one_summit_and_its_saddle(tmp_path):
    axis = pixels(200, 2.4)
    z = hills(axis, (-0.35, 0.0, 1.0), (0.0, 0.0, 0.8), (0.32, 0.0, 0.6))
    reliefs = []
    for here, there in ((0.0, -0.35), (0.32, 0.0)):
        between = (axis > min(here, there)) & (axis < max(here, there))
        reliefs.append(z[100, between].max() - z[100, np.argmin(np.abs(axis - here))])
    assert 0.1 < reliefs[1] < reliefs[0]

    def counts(relief):
        return contact_sites(map_of(tmp_path, z, 2.4, 1.0, file_relief=relief)).count()

    assert counts(reliefs[1] - 0.02) == [3, 2, 0]
    assert counts(reliefs[1] + 0.02) == counts(reliefs[0] - 0.02) == [2, 1, 0]
    assert counts(reliefs[0] + 0.02) == [1, 0, 0]
    one = contact_sites(map_of(tmp_path, z, 2.4, 1.0, file_relief=reliefs[0] + 0.02))
    assert (one.x[0], one.y[0], one.z[0]) == pytest.approx((-0.35, 0.0, -1.0), abs=0.02)


def test_a_summit_on_a_slope_to_the_rim_counts_by_its_climb(tmp_path):
    """Lower places at the rim are no sites, but end what is only a wrinkle of the slope to them."""
    axis = pixels(200, 2.4)
    slope = -2.0 * np.hypot(axis, axis[:, np.newaxis])
    for depth, summits in ((0.5, 0), (1.0, 1)):  # climbs of 0.08 and 0.49
        for size in (200, 168):  # with a margin, and without
            cut = slice((200 - size) // 2, (200 + size) // 2)
            z = (slope + hills(axis, (0.5, 0.3, depth)))[cut, cut]
            sites = contact_sites(map_of(tmp_path, z, 2.4 * size / 200, 1.0, file_relief=0.1))
            assert sites.count() == [summits, summits, 1]
            assert np.all(np.hypot(sites.x, sites.y) < 0.8)


@pytest.mark.parametrize("waves", [1, 2, 3])
@pytest.mark.parametrize("tiles", [1, 2, 3])
def test_a_map_that_fills_the_cell_obeys_euler(tmp_path, waves, tiles):
    """A product of cosines: on a square of one wave two summits, four saddles, and two valleys."""
    axis = pixels(60, 2 * math.pi * waves)
    z = np.cos(axis) * np.cos(axis[:, np.newaxis])
    noise = 0.01 * np.random.default_rng(1).normal(size=z.shape)
    for face in (z, z + noise, np.round(z / 0.2) * 0.2):
        many = 2 * (waves * tiles) ** 2
        assert contact_sites(map_of(tmp_path, face, 1.0), side=1.0 * tiles).count() == [many, 2 * many, many]


def test_a_cell_with_one_summit_has_one_valley_and_two_saddles(tmp_path):
    axis = pixels(50, 1.0)
    z = -np.cos(2 * np.pi * (axis - 0.1)) - 0.7 * np.cos(2 * np.pi * (axis[:, np.newaxis] + 0.2))
    sites = contact_sites(map_of(tmp_path, z, 1.0), side=1.0)
    assert sites.names() == ["summit", "saddle", "saddle", "valley"]
    expected = np.array([[0.1, -0.4, 0.1, -0.4], [-0.2, -0.2, 0.3, 0.3]])
    np.testing.assert_allclose([sites.x, sites.y], expected, rtol=0, atol=0.011)
    above = contact_sites(map_of(tmp_path, z, 1.0, file_relief=3.5), side=1.0)
    assert len(above) == 0


def flooded(z, steps, periodic):
    """Relief of each local minimum by pixel: level by level, until its lake holds a lower one; None for the lowest."""
    flat, rows, columns = z.ravel(), *np.indices(z.shape)
    ends = []
    for i, j in steps:
        y, x = rows + i, columns + j
        inside = (y % z.shape[0] == y) & (x % z.shape[1] == x) | periodic
        here, there = rows * z.shape[1] + columns, y % z.shape[0] * z.shape[1] + x % z.shape[1]
        ends.append([here[inside], there[inside]])
    one, other = np.concatenate(ends, axis=1)
    found = {}
    for level in np.sort(flat):
        wet = flat <= level
        joined = wet[one] & wet[other]
        graph = coo_array((joined[joined], (one[joined], other[joined])), shape=(flat.size, flat.size))
        _, lake = connected_components(graph, directed=False)
        lowest = np.full(flat.size, np.inf)
        np.minimum.at(lowest, lake[wet], flat[wet])
        for pixel in np.flatnonzero(wet):
            if lowest[lake[pixel]] == flat[pixel]:
                found.setdefault(pixel, None)
            elif pixel in found and found[pixel] is None:
                found[pixel] = level - flat[pixel]
    return found


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_reliefs_are_those_of_a_flood_level_by_level(seed, periodic):
    random = np.random.default_rng(seed)
    z = random.normal(size=random.integers(3, 13, 2))
    four = [(0, 1), (1, 0)]
    known = [flooded(z, [*four, (1, 1), (1, -1)], periodic), flooded(-z, four, periodic)]
    for relief in (0.0, 0.3, 1.0, 2.0, 3.0, 10.0):
        points = critical_points(z, relief, periodic)
        for found, reliefs in zip((points.minima, points.maxima), known, strict=True):
            out = [pixel for pixel, rise in reliefs.items() if (np.ptp(z) if rise is None else rise) >= relief]
            assert found.tolist() == sorted(out)
        if periodic:
            assert points.saddles.size == points.minima.size + points.maxima.size


def rough(count, seed=2):
    """A periodic self-affine surface of unit height."""
    random = np.random.default_rng(seed)
    wave = np.hypot(np.fft.fftfreq(count, 1 / count)[:, None], np.fft.rfftfreq(count, 1 / count))
    spectrum = np.fft.rfft2(random.normal(size=(count, count))) * np.maximum(wave, 4.0) ** -1.8 * (wave < count / 6)
    z = np.fft.irfft2(spectrum, (count, count))
    return z / z.std()


def test_a_rough_periodic_map_obeys_euler_wherever_the_cell_begins(tmp_path):
    z = rough(96)
    for relief in (0.01, 0.3, 1.0, 3.0):
        sites = contact_sites(map_of(tmp_path, z, 1.0, file_relief=relief), side=1.0)
        moved = contact_sites(map_of(tmp_path, np.roll(z, (31, 17), (0, 1)), 1.0, file_relief=relief), side=1.0)
        summits, saddles, valleys = sites.count()
        assert summits - saddles + valleys == 0 and summits >= 1
        assert sites.count() == moved.count()
        np.testing.assert_allclose(np.sort(sites.z), np.sort(moved.z), rtol=0, atol=1e-12)
        # Turned over, its valleys are summits, but for what depends on passes from corner to corner of a pixel.
        over = contact_sites(map_of(tmp_path, -z, 1.0, file_relief=relief), side=1.0)
        if relief >= 0.3:
            assert (over.count()[0], over.count()[2]) == pytest.approx((valleys, summits), rel=0.1, abs=1)
    assert len(sites) < 60


def test_maps_that_can_not_be_used(tmp_path):
    with pytest.raises(ValueError, match=r"file_relief = -1\.0"):
        map_of(tmp_path, np.ones((4, 4)), 1.0, file_relief=-1.0)
    with pytest.raises(ValueError, match="less than the punch"):
        contact_sites(map_of(tmp_path, np.ones((4, 4)), 1.0, 0.6))
    with pytest.raises(ValueError, match="give the side of the cell"):
        contact_sites(map_of(tmp_path, np.ones((4, 4)), 1.0))


def test_a_run_with_a_measured_punch_follows_its_sites(tmp_path):
    axis = pixels(301, 0.9e-3)
    z = corrugated("triangular").heights(axis, axis[:, np.newaxis])
    np.save(tmp_path / "map.npy", z + 20e-9 * np.random.default_rng(6).normal(size=z.shape))
    changes = ["punch.pattern=file", f"punch.file={tmp_path / 'map.npy'}", 'punch.file_size=["0.9 mm", "0.9 mm"]']
    changes += ["grid.n=32", "solver.scheme=quasistatic", "solver.accuracy=0.1"]
    with load(run(tmp_path / "out", *changes)) as results:
        sites, patches, events = results.sites, results.patches, results.events
        assert {"summit"} <= set(sites["kind"]) <= set(KINDS) and {"joins", "leaves"} == set(sites["event"])
        assert set(np.asarray(sites["of"])[np.asarray(sites["kind"]) == "summit"]) == {23}
        assert "summit" in set(patches["kind"]) and "" not in set(patches["nearest"])
        assert any("summit" in str(joined) for joined in events["joined"])


def test_a_map_without_a_pixel_under_the_punch_has_no_sites(tmp_path):
    np.save(tmp_path / "coarse.npy", np.array([[0.0, 1e-6], [2e-6, 3e-6]]))
    face = Topography("file", radius=0.1e-3, file=tmp_path / "coarse.npy", file_size=(4e-3, 4e-3))
    assert len(contact_sites(face, 4e-3).x) == 0


def test_the_search_takes_a_few_rows_of_a_pattern_of_any_size(monkeypatch):
    face = Topography("hexagonal", radius=200e-6, wavelength=80e-6, amplitude=4e-6, height_jitter=1e-7)
    whole = contact_sites(face)
    monkeypatch.setattr("pgfmd.physics.contact_sites.AT_A_TIME", 500)
    assert len(whole) > 50
    for name in ("x", "y", "z", "kind"):
        np.testing.assert_array_equal(getattr(contact_sites(face), name), getattr(whole, name))
