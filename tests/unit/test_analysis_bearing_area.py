"""The bearing-area model: summits of known faces, one asperity against JKR, many of them, and the crack's law."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from pgfmd.analysis.asperity_laws import JkrAsperity, MeasuredAsperity, ViscoelasticAsperity, force_of, release_rate
from pgfmd.analysis.bearing_area import laws_of, machine_remarks, predict
from pgfmd.analysis.crack_law import CrackLaw
from pgfmd.analysis.summits import Summits, summits_of
from pgfmd.physics.rheology import PronySeries
from pgfmd.reference import jkr
from pgfmd.results.curve import measure
from pgfmd.scene import load_scene
from tests.unit.analysis_loops import MODULUS, WORK, loop_of

RADIUS = 140e-6
STRENGTH = math.pi * WORK / (2 * 0.5e-6)
SERIES = PronySeries.single(250.0, 200e-6)


def equal_summits(count, height=0.0, radius=RADIUS):
    same = np.ones(count)
    return Summits(0 * same, 0 * same, height * same, radius * same)


def jkr_law(radius):
    return JkrAsperity(radius, MODULUS, WORK)


def crack_law():
    return CrackLaw(SERIES, MODULUS, WORK, STRENGTH)


@pytest.mark.parametrize(("name", "count", "factor"), [("tri-tack", 23, 9 / 8), ("hex-tack", 42, 9 / 4)])
def test_summits_of_the_papers_punches(name, count, factor):
    scene = load_scene(name, ["grid.n=64"])
    found = summits_of(scene)
    expected = factor * (scene.punch.wavelength / (2 * math.pi)) ** 2 / scene.punch.amplitude
    assert len(found) == count
    np.testing.assert_allclose(found.radius, expected, rtol=1e-4)
    assert np.ptp(found.height) < 1e-15 and np.hypot(found.x, found.y).max() <= 375e-6
    nearest = [np.sort(np.hypot(found.x - x, found.y - y))[1] for x, y in zip(found.x, found.y, strict=True)]
    spacing = scene.punch.wavelength / (1 if name == "tri-tack" else math.sqrt(3))
    np.testing.assert_allclose(nearest, spacing, rtol=1e-9)


def test_summits_of_other_faces(tmp_path):
    assert len(summits_of(load_scene("flat-punch", ["grid.n=64"]))) == 0
    sphere = summits_of(load_scene("hertz", ["grid.n=64"]))
    assert (len(sphere), sphere.radius[0]) == (1, pytest.approx(10e-3, rel=1e-6))
    ridges = ["punch.pattern=sinusoid", "punch.amplitude=1 um", "punch.wavelength=100 um", "grid.n=64"]
    assert len(summits_of(load_scene("tri-tack", ridges))) == 0
    curved = load_scene("hex-tack", ["grid.n=64", "punch.curvature_radius=40 mm", "punch.height_jitter=0.1 um"])
    high = summits_of(curved)
    assert np.all(np.diff(high.height) >= 0) and np.ptp(high.height) > 1e-6
    # The curvature of the whole adds to that of a summit, to first order.
    assert np.median(high.radius) == pytest.approx(1 / (1 / 139.388e-6 + 1 / 40e-3), rel=2e-3)


def test_summits_of_a_height_map(tmp_path):
    axis = np.linspace(-100e-6, 100e-6, 201)
    x, y = axis, axis[:, np.newaxis]
    two = np.minimum((x + 40e-6) ** 2 + y**2, (x - 40e-6) ** 2 + y**2 + 2 * 80e-6 * 1e-6) / (2 * 80e-6)
    np.save(tmp_path / "map.npy", two)
    changes = ["punch.pattern=file", f"punch.file={tmp_path / 'map.npy'}", 'punch.file_size=["201 um", "201 um"]']
    found = summits_of(load_scene("hertz", [*changes, "punch.radius=90 um", "grid.length=512 um", "grid.n=512"]))
    assert len(found) == 2
    np.testing.assert_allclose(found.radius, 80e-6, rtol=0.1)
    assert found.height[1] - found.height[0] == pytest.approx(1e-6, abs=0.1e-6)
    # The extrema of its noise are no asperities, nor is what stands out by less than it should.
    np.save(tmp_path / "map.npy", two + 20e-9 * np.random.default_rng(0).normal(size=two.shape))
    changes += ["punch.radius=90 um", "grid.length=512 um", "grid.n=512"]
    assert len(summits_of(load_scene("hertz", changes))) == 2
    assert len(summits_of(load_scene("hertz", [*changes, "punch.file_relief=12 um"]))) == 1


@pytest.mark.parametrize("count", [1, 7])
def test_equal_summits_give_so_many_times_jkr(count):
    preload = count * 2e-4
    loop = predict(equal_summits(count), jkr_law, preload, "JKR").loop
    end = jkr.displacement_controlled_pull_off(RADIUS, MODULUS, WORK)
    turn = loop.branches["retraction"].start
    for k in range(0, len(loop.force), 7):
        depth = loop.indentation[k]
        if depth < (0.0 if k <= turn else end.indentation):
            assert loop.force[k] == 0.0
            continue
        # The stable branch has the contact radii beyond that of the end.
        radius = brentq(lambda a, d=depth: jkr.indentation(a, RADIUS, MODULUS, WORK) - d, end.contact_radius, RADIUS)
        expected = count * float(jkr.force(radius, RADIUS, MODULUS, WORK))
        assert loop.force[k] == pytest.approx(expected, rel=0, abs=1e-6 * preload)
    assert loop.force.max() == pytest.approx(preload, rel=1e-6)
    found = measure(loop)
    assert found.pull_off.tension == pytest.approx(1.5 * math.pi * WORK * RADIUS * count, rel=1e-4)
    assert loop.force[-1] == 0.0
    assert loop.force[0] == pytest.approx(-4 / 3 * math.pi * WORK * RADIUS * count, rel=1e-6)  # snap-in at zero overlap


def test_summits_of_two_heights_add_up():
    heights = np.array([0.0, 0.3e-6, 0.3e-6])
    mixed = Summits(0 * heights, 0 * heights, heights, np.full(3, RADIUS))
    loop = predict(mixed, jkr_law, 5e-4, "JKR").loop
    law, turn = jkr_law(RADIUS), loop.branches["retraction"].start
    depth = loop.indentation
    expected = law.approach(depth[: turn + 1]) + 2 * law.approach(depth[: turn + 1] - 0.3e-6)
    np.testing.assert_allclose(loop.force[: turn + 1], expected, rtol=0, atol=1e-15)
    deep = depth[turn]
    back = law.retraction(depth[turn:], deep) + 2 * law.retraction(depth[turn:] - 0.3e-6, deep - 0.3e-6)
    np.testing.assert_allclose(loop.force[turn:], back, rtol=0, atol=1e-15)
    # One that is too high to be reached stays out.
    far = Summits(np.zeros(2), np.zeros(2), np.array([0.0, 1e-3]), np.full(2, RADIUS))
    alone = predict(equal_summits(1), jkr_law, 2e-4, "JKR")
    found = predict(far, jkr_law, 2e-4, "JKR")
    assert (found.summits, found.touched) == (2, 1)
    assert measure(found.loop).pull_off.tension == pytest.approx(measure(alone.loop).pull_off.tension, rel=1e-9)


def test_no_summits_is_an_error():
    with pytest.raises(ValueError, match="no summits"):
        predict(equal_summits(0), jkr_law, 1e-3, "JKR")


@pytest.mark.parametrize("speed", [1e-8, 1e-5, 1e-3])
def test_the_cracks_law_is_persson_and_breners_integral(speed):
    crack, creep = crack_law(), SERIES.to_creep()
    g = float(crack.opening_energy(speed))
    cutoff = 2 * math.pi * speed / (g * crack.zone)

    def integrand(x):
        loss = -creep.compliance_of(x * cutoff).imag
        return math.sqrt(1 - x**2) * float(loss) / x

    knee = 1 / (cutoff * creep.retardation_times[0])
    points = [knee] if knee < 1 else None
    integral = quad(integrand, 1e-12, 1, points=points, limit=400)[0]
    assert 1 / g == pytest.approx(1 - 2 / math.pi * integral, rel=2e-4)


def test_the_cracks_law_has_its_limits_and_its_inverse():
    crack = crack_law()
    assert float(crack.opening_energy(1e-15)) == pytest.approx(1.0, abs=1e-6)
    assert float(crack.opening_energy(1e3)) == pytest.approx(250.0, rel=1e-2)
    speeds = np.geomspace(1e-12, 1e-1, 40)
    g = crack.opening_energy(speeds)
    assert np.all(np.diff(g) > 0)
    np.testing.assert_allclose(crack.edge_speed(g), -speeds, rtol=1e-3)
    np.testing.assert_allclose(crack.edge_speed(1 / g), speeds, rtol=1e-3)
    assert float(crack.edge_speed(1.0)) == 0.0
    with pytest.raises(ValueError, match="at least one element"):
        CrackLaw(PronySeries.elastic(), MODULUS, WORK, STRENGTH)


def test_force_and_release_rate_are_jkrs_in_equilibrium():
    a = np.linspace(5e-6, 60e-6, 20)
    depth = jkr.indentation(a, RADIUS, MODULUS, WORK)
    np.testing.assert_allclose(release_rate(a, depth, RADIUS, MODULUS), WORK, rtol=1e-9)
    np.testing.assert_allclose(force_of(a, depth, RADIUS, MODULUS), jkr.force(a, RADIUS, MODULUS, WORK), rtol=1e-9)


def viscoelastic(speed):
    return ViscoelasticAsperity(RADIUS, MODULUS, WORK, crack_law(), speed, speed)


def test_a_slow_viscoelastic_asperity_is_jkrs():
    law, reference = viscoelastic(1e-11), jkr_law(RADIUS)
    depth = np.linspace(0.2e-6, 1e-6, 50)
    np.testing.assert_allclose(law.approach(depth), reference.approach(depth), rtol=0, atol=2e-3 * 5e-5)
    back = np.linspace(1e-6, -0.55e-6, 200)
    np.testing.assert_allclose(law.retraction(back, 1e-6), reference.retraction(back, 1e-6), rtol=0, atol=5e-3 * 5e-5)


def test_faster_is_stickier_and_energy_is_never_gained():
    pull_offs, loops = [], []
    for speed in (1e-7, 1e-6, 1e-5):
        loop = predict(equal_summits(1), lambda radius, v=speed: viscoelastic(v), 1e-4, "crack").loop
        found = measure(loop)
        pull_offs.append(found.pull_off.tension)
        loops.append(found.hysteresis)
        assert loop.force.max() == pytest.approx(1e-4, rel=1e-4) and loop.force[-1] == 0.0
    elastic = measure(predict(equal_summits(1), jkr_law, 1e-4, "JKR").loop)
    assert elastic.pull_off.tension < pull_offs[0] and np.all(np.diff(pull_offs) > 0)
    assert 0 < elastic.hysteresis < loops[0] and np.all(np.diff(loops) > 0)


def test_the_curve_of_one_asperity_is_followed():
    one = predict(equal_summits(1), jkr_law, 1e-4, "JKR").loop
    law = MeasuredAsperity(RADIUS, one)
    depth = np.linspace(-2e-6, one.indentation.max(), 300)
    np.testing.assert_allclose(law.approach(depth), jkr_law(RADIUS).approach(depth), rtol=0, atol=1e-7 + 4e-9)
    many = predict(equal_summits(5), lambda radius: law, 5e-4, "single").loop
    assert measure(many).pull_off.tension == pytest.approx(5 * measure(one).pull_off.tension, rel=1e-3)
    assert many.indentation.max() == pytest.approx(one.indentation.max(), rel=1e-3)
    # Beyond its depth it goes on straight; before, an asperity that turns early follows the lower branch.
    wide = loop_of([0, -1e-6, 0, 1e-6], [0.0, 1e-3, -0.5e-3, 0.0], 2)
    beyond = MeasuredAsperity(RADIUS, wide)
    assert beyond.approach(np.array([2e-6]))[0] == pytest.approx(2e-3)
    early = beyond.retraction(np.array([0.5e-6, 0.4e-6]), 0.5e-6)
    assert early == pytest.approx([0.25e-3, 0.1e-3])


def test_laws_of_a_scene():
    assert list(laws_of(load_scene("hex-tack", ["grid.n=64"]))) == ["JKR", "JKR with crack speed"]
    assert list(laws_of(load_scene("hex-tack", ["grid.n=64", "rheology.model=elastic"]))) == ["JKR"]


def test_the_machine_of_a_run_is_none_of_the_model():
    assert machine_remarks(load_scene("hex-tack")) == []
    for change, word in (
        ("drive.machine_stiffness=1 kN/m", "has a spring"),
        ("drive.control=load", "controls the force"),
    ):
        (remark,) = machine_remarks(load_scene("hex-tack", [change]))
        assert word in remark and "rigid machine" in remark


def test_the_model_calls_the_hexagonal_punch_the_stickier_one():
    """As the paper says: it has twice as many summits, and saddles don't exist for the model."""
    pull_off = {}
    for name in ("hex-tack", "tri-tack"):
        scene = load_scene(name, ["grid.n=64", "drive.speed=25 um/s"])
        law = laws_of(scene)["JKR"]
        pull_off[name] = measure(predict(summits_of(scene), law, scene.drive.preload, "JKR").loop).pull_off.tension
    ratio = 42 * 139.388 / (23 * 160.297)
    assert pull_off["hex-tack"] / pull_off["tri-tack"] == pytest.approx(ratio, rel=1e-3)
