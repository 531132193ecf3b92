"""Random faces: the sum of their waves, their spectrum and statistics, and scenes that have one."""

import importlib.util
import math

import numpy as np
import pytest

from pgfmd.commands.check import report
from pgfmd.errors import SceneError
from pgfmd.physics.asperities import site_uniforms
from pgfmd.physics.contact_sites import SUMMIT, contact_sites
from pgfmd.physics.random_surface import RandomSurface
from pgfmd.physics.topography import Topography
from pgfmd.scene import load_scene, parse_scene
from pgfmd.scene_objects import topography_of
from pgfmd.solver.grid import Grid
from pgfmd.symmetry import expected

FACE = RandomSurface(0.8, 60e-6, 40e-6, 7e-6, 100e-6, rms_height=1e-6, seed=3)
ROUGH = [
    "punch.pattern=rough", "punch.hurst=0.8", "punch.longest=300 um", "punch.shortest=60 um", "punch.rms_slope=0.05",
    "grid.n=64",
]  # fmt: skip


def sum_of_waves(face, x, y):
    """The heights by the formula, wave after wave."""
    total = np.zeros(np.broadcast(x, y).shape)
    most = math.floor(face.period / face.shortest)
    amplitudes = []
    for i in range(most + 1):
        for j in range(-most, most + 1):
            q = 2 * math.pi / face.period * math.hypot(i, j)
            if not (i > 0 or j > 0) or not 2 * math.pi / face.longest <= q <= 2 * math.pi / face.shortest:
                continue
            amplitude = max(1.0, q * face.roll_off / (2 * math.pi)) ** (-1.0 - face.hurst)
            phase = 2 * math.pi * site_uniforms(face.seed, i, j)
            total += amplitude * np.cos(2 * math.pi * (i * x + j * y) / face.period + phase)
            amplitudes.append(amplitude)
    return face.rms_height / math.sqrt(0.5 * np.sum(np.square(amplitudes))) * total


def test_heights_are_the_sum_of_the_waves():
    x, y = np.random.default_rng(1).uniform(-3e-4, 3e-4, (2, 500))
    np.testing.assert_allclose(FACE(x, y), sum_of_waves(FACE, x, y), rtol=0, atol=1e-11 * FACE.rms_height)


def test_a_height_depends_on_its_point_alone():
    x, y = (line.ravel() for line in np.meshgrid(np.linspace(-9e-5, 7e-5, 60), np.linspace(-4e-5, 6e-5, 70)))
    whole, order = FACE(x, y), np.random.default_rng(2).permutation(x.size)
    # In one call the lines of a lattice, one by one few points of many lines.
    np.testing.assert_array_equal(FACE(x[order], y[order]), whole[order])
    np.testing.assert_array_equal([FACE(x[k : k + 1], y[k : k + 1])[0] for k in range(0, x.size, 97)], whole[::97])
    assert FACE(x[:0], y[:0]).shape == (0,)


def test_statistics_over_a_period_are_those_asked_for():
    along = np.arange(64) / 64 * FACE.period
    z = FACE(*np.meshgrid(along, along))
    assert abs(z.mean()) < 1e-10 * FACE.rms_height
    assert z.std() == pytest.approx(FACE.rms_height, rel=1e-9)
    by_spectrum, found = FACE.expected, FACE.realised()
    for name in ("height", "slope", "curvature"):
        assert getattr(found, name) == pytest.approx(getattr(by_spectrum, name), rel=1e-9)
    step = 1e-3 * FACE.shortest
    x, y = np.meshgrid(along, along)
    slope = np.hypot(FACE(x + step, y) - FACE(x - step, y), FACE(x, y + step) - FACE(x, y - step)) / (2 * step)
    assert math.sqrt(np.mean(slope**2)) == pytest.approx(found.slope, rel=1e-5)
    assert 0.9 * slope.max() < found.steepest < 1.1 * slope.max()
    steep = RandomSurface(0.8, 60e-6, 40e-6, 7e-6, 100e-6, rms_slope=0.2, seed=3)
    assert steep.realised().slope == pytest.approx(0.2, rel=1e-9)
    np.testing.assert_allclose(steep(x, y) / 0.2, z / found.slope, rtol=0, atol=1e-10 * FACE.rms_height / found.slope)


def test_the_spectrum_is_the_closed_form():
    """C(q) from a Fourier transform of the heights, and its moments against those of an isotropic spectrum without lattice."""
    face = RandomSurface(0.6, 1.0, 0.5, 0.05, 8.0, rms_height=0.01, seed=1)
    count = 512
    along = np.arange(count) / count * face.period
    waves = np.fft.fft2(face(*np.meshgrid(along, along))) * (face.period / count) ** 2
    density = np.abs(waves) ** 2 / face.period**2
    q = 2 * math.pi * np.hypot(*np.meshgrid(*[np.fft.fftfreq(count, face.period / count)] * 2))
    np.testing.assert_allclose(density, face.density(q), rtol=1e-9, atol=1e-12 * density.max())
    low, roll, high = 2 * math.pi / np.array([1.0, 0.5, 0.05])
    plateau, h = face.density(np.array([low]))[0], face.hurst
    integral = 0.5 * (roll**2 - low**2) + roll ** (2 + 2 * h) * (roll ** (-2 * h) - high ** (-2 * h)) / (2 * h)
    assert plateau * integral / (2 * math.pi) == pytest.approx(face.rms_height**2, rel=0.01)
    integral = 0.25 * (roll**4 - low**4) + roll ** (2 + 2 * h) * (high ** (2 - 2 * h) - roll ** (2 - 2 * h)) / (
        2 - 2 * h
    )
    assert plateau * integral / (2 * math.pi) == pytest.approx(face.expected.slope**2, rel=0.01)


@pytest.mark.skipif(importlib.util.find_spec("SurfaceTopography") is None, reason="SurfaceTopography is not installed")
def test_the_spectrum_is_what_surface_topography_finds():
    from SurfaceTopography import Topography as Map

    face = RandomSurface(0.8, 2.0, 1.0, 0.1, 4.0, rms_slope=0.1, seed=5)
    count = 256
    along = np.arange(count) / count * face.period
    found = Map(face(*np.meshgrid(along, along)).T, (face.period,) * 2, periodic=True)
    assert found.rms_height_from_area() == pytest.approx(face.expected.height, rel=1e-6)
    # Its slopes are differences of neighbours, 6 points to the shortest wave.
    assert found.rms_gradient() == pytest.approx(0.1, rel=0.01)
    q, density = found.power_spectrum_from_area()
    seen = ~(np.ma.getmaskarray(q) | np.ma.getmaskarray(density)) & (q > math.pi * 1.1) & (q < 0.9 * 2 * math.pi / 0.1)
    assert seen.sum() > 10
    # Means over rings of wave vectors, whose width is a sixth of q, are 2 % more where the spectrum falls like q^-3.6.
    np.testing.assert_allclose(density[seen], face.density(q[seen]), rtol=0.03)


def test_summits_have_the_mean_curvature_of_nayak():
    face = RandomSurface(0.8, 10.0, 10.0, 1.0, 60.0, rms_slope=0.1, seed=2)
    count = 720
    along = np.arange(count) / count * face.period
    z = face(*np.meshgrid(along, along))
    around = [np.roll(z, (a, b), (0, 1)) for a in (-1, 0, 1) for b in (-1, 0, 1) if (a, b) != (0, 0)]
    summit = np.all([z < other for other in around], axis=0)
    q2 = sum(np.square(2 * math.pi * line) for line in np.meshgrid(*[np.fft.fftfreq(count, along[1])] * 2))
    bend = -0.5 * np.fft.ifft2(q2 * np.fft.fft2(z)).real[summit]
    # Of so many summits the mean is known to this, three times.
    error = 3 * bend.std() / math.sqrt(summit.sum()) / bend.mean()
    assert summit.sum() > 700 and error < 0.06
    assert bend.mean() * face.summit_radius == pytest.approx(1.0, abs=error)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"hurst": 0.0}, "hurst"), ({"hurst": 1.1}, "hurst"), ({"rms_slope": 0.1}, "one of the two"),
        ({"rms_height": None}, "one of the two"), ({"shortest": 50e-6}, "roll_off"), ({"longest": 2e-4}, "period"),
        ({"shortest": 1e-9}, "2048"), ({"longest": 59e-6, "shortest": 58e-6, "roll_off": 58.5e-6}, "no wave"),
    ],
)  # fmt: skip
def test_a_face_that_can_not_be_is_refused(change, word):
    keys = {
        "hurst": 0.8,
        "longest": 6e-5,
        "roll_off": 4e-5,
        "shortest": 7e-6,
        "period": 1e-4,
        "rms_height": 1e-6,
        "rms_slope": None,
    }
    with pytest.raises(ValueError, match=word):
        RandomSurface(**keys | change)


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        (["punch.rms_height=1 um"], "punch.rms_slope"), (["punch.shortest=400 um"], "punch.shortest"),
        (["punch.roll_off=400 um"], "punch.roll_off"), (["punch.shortest=40 um"], "punch.shortest"),
        (["punch.period=700 um"], "punch.period"), (["punch.longest=2 mm", "punch.period=1.5 mm"], "punch.longest"),
        (["punch.shortest=0.5 um", "grid.n=65536"], "punch.shortest"), (["punch.hurst=1.2"], "punch.hurst"),
        (["punch.height_jitter=1 nm"], "punch.height_jitter"), (["punch.wavelength=50 um"], "punch.wavelength"),
    ],
)  # fmt: skip
def test_a_scene_with_a_wrong_random_face_names_the_key(changes, key):
    with pytest.raises(SceneError) as caught:
        load_scene("tri-tack", [*ROUGH, *changes])
    assert [problem.key for problem in caught.value.problems] == [key]


def test_a_random_face_that_fills_the_cell_fits_into_it():
    lines = load_scene("tri-tack", ROUGH).to_toml().splitlines()
    filled = "\n".join(line for line in lines if not line.startswith(("radius", "period", "roll_off")))
    scene = parse_scene(filled)
    assert (scene.punch.period, scene.punch.roll_off) == (scene.grid.length, scene.punch.longest)
    z, side = topography_of(scene.punch).heights, scene.grid.length
    y = np.linspace(-0.5, 0.5, 30) * side
    np.testing.assert_allclose(z(-0.5 * side, y), z(0.5 * side, y), rtol=0, atol=1e-16)
    with pytest.raises(SceneError, match="whole number of periods"):
        parse_scene(filled, ["punch.period=1 mm"])
    with pytest.raises(SceneError, match="rms_height or rms_slope"):
        parse_scene(filled.replace("rms_slope = 0.05\n", ""))
    with pytest.raises(SceneError, match="no curvature"):
        parse_scene(filled, ["punch.curvature_radius=5 mm"])


def test_refining_the_grid_refines_the_same_face():
    """Points that two grids share have the same heights; an odd factor keeps the points of a cell-centred grid."""
    coarse, fine, wide = (
        load_scene("tri-tack", [*ROUGH, f"grid.n={n}", f"grid.length={side} mm"])
        for n, side in ((64, 1.5), (192, 1.5), (128, 3.0))
    )
    assert coarse.punch == fine.punch == wide.punch
    grids = [Grid(scene.grid.n, scene.grid.length) for scene in (coarse, fine, wide)]
    x, of_fine, of_wide = (grid.coordinate(np.arange(grid.n)) for grid in grids)
    np.testing.assert_allclose([of_fine[1::3], of_wide[32:-32]], [x, x], rtol=1e-14)
    z, finer, wider = (
        topography_of(scene.punch).heights(line, line[:, np.newaxis])
        for scene, line in ((coarse, x), (fine, of_fine[1::3]), (wide, of_wide[32:-32]))
    )
    np.testing.assert_allclose([finer, wider], [z, z], rtol=0, atol=1e-17)


def test_what_is_said_of_a_random_face(tmp_path):
    scene = load_scene("tri-tack", [*ROUGH, "punch.curvature_radius=20 mm", "punch.layer_step=0.3 um"])
    found = report(scene)
    assert found["rms slope"] == pytest.approx(0.05, rel=0.25)
    face = topography_of(scene.punch).random
    assert found["rms height"] == pytest.approx(face.expected.height, rel=0.5)
    assert found["rms curvature"] == pytest.approx(face.expected.curvature, rel=0.25)
    assert found["largest slope of the random face"] == face.realised(scene.punch.radius).steepest
    assert found["summit radius"] == face.summit_radius
    q, amplitude = face.waves()
    stored = 0.25 * scene.substrate.contact_modulus * np.sum(0.5 * q * amplitude**2)
    assert found["gamma/v_full"] == pytest.approx(scene.adhesion.work_of_adhesion / stored)
    assert any("points a wavelength, the shortest of the face" in text for text in found.warnings)
    assert expected(scene).mirror == "" and "mirror image" in expected(scene).reason
    assert load_scene("tri-tack", [*ROUGH, "punch.seed=1"]).punch != load_scene("tri-tack", ROUGH).punch


def test_summits_of_a_random_face_stand_out():
    face = Topography("rough", 5e-5, hurst=0.8, longest=4e-5, shortest=1e-5, rms_height=1e-6, period=2e-4, seed=4)
    sites = contact_sites(face)
    summits, saddles, valleys = sites.count()
    assert summits > 5 and valleys > 5 and saddles > 5
    assert np.all(np.hypot(sites.x, sites.y) <= 5e-5)
    top = sites.kind == SUMMIT
    for angle in np.arange(8) * math.pi / 4:
        step = 1.5e-6
        beside = face.heights(sites.x[top] + step * math.cos(angle), sites.y[top] + step * math.sin(angle))
        assert np.all(beside > sites.z[top])
