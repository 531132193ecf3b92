"""What is said of a height map before a run: closed forms of simple faces, and what must be warned of."""

import math
import re

import numpy as np
import pytest

from pgfmd.commands.check import report
from pgfmd.forecast import map_advice
from pgfmd.maps.raw import MapError
from pgfmd.physics.map_survey import survey
from pgfmd.scene_objects import confirm, topography_of

from .map_files import matrix, middles, sphere
from .test_map_files import DOWN, SIZES, scene_of

MAP = SIZES | DOWN | {"file_unit": "m"}
X = middles(96, 840e-6)
Y = X[:, None]


def seen(folder, z, reach=1e-6, **keys):
    """The survey of heights [m] over 840 um."""
    np.save(folder / "map.npy", z)
    return survey(topography_of(scene_of(folder, "map.npy", **MAP | keys).punch), 20e-6, reach)


def told(folder, z, *, name="map.npy", **keys):
    """What `check` warns of in such a map, on a grid no finer than it."""
    if z is not None:
        np.save(folder / name, z)
    scene = scene_of(folder, name, **MAP | keys)
    confirm(scene, "test")
    return list(map_advice.warnings(scene))


def test_numbers_of_a_dome_off_its_axis(tmp_path):
    """r^2/(2 R) around (d, 0), under a punch of radius a: range, rms and tilt are those of a parabola."""
    radius, a, d = 5e-3, 375e-6, 60e-6
    found = seen(tmp_path, ((X - d) ** 2 + Y**2) / (2 * radius))
    assert found.relief == pytest.approx((a + d) ** 2 / (2 * radius), rel=0.05)
    # Heights r^2/(2R) - x d/R: their variance over a disc.
    variance = a**4 / (48 * radius**2) + (d * a / (2 * radius)) ** 2
    assert found.rms == pytest.approx(math.sqrt(variance), rel=0.02)
    assert found.tilt == (pytest.approx(-d / radius, rel=1e-6), pytest.approx(0.0, abs=1e-9))
    assert found.slope == pytest.approx((a + d) / radius, rel=0.05)
    assert (found.first.x, found.first.y) == (pytest.approx(d, abs=6e-6), pytest.approx(0.0, abs=6e-6))
    assert not found.first.at_rim and found.others == ()
    # Without the tilt the axis touches first, which is d^2/(2 R) higher.
    assert found.lift == pytest.approx(d**2 / (2 * radius), abs=0.2e-6)
    assert found.sag == pytest.approx((X[1] - X[0]) ** 2 / (8 * radius), rel=1e-3)


def test_places_come_in_the_order_in_which_they_touch(tmp_path):
    """Four domes of different heights."""
    places = {(0.1e-3, 0.15e-3): 0.0, (-0.2e-3, 0.1e-3): 0.4e-6, (0.0, -0.2e-3): 1.0e-6, (0.25e-3, -0.1e-3): 0.7e-6}
    domes = [height + ((X - x) ** 2 + (Y - y) ** 2) / 1e-3 for (x, y), height in places.items()]
    found = seen(tmp_path, np.minimum(np.min(domes, axis=0), 8e-6))
    assert (found.first.x, found.first.y) == pytest.approx((0.1e-3, 0.15e-3), abs=5e-6)
    assert [other.height for other in found.others] == pytest.approx([0.4e-6, 0.7e-6, 1.0e-6], abs=0.05e-6)
    away = [math.dist((0.1e-3, 0.15e-3), place) for place in ((-0.2e-3, 0.1e-3), (0.25e-3, -0.1e-3), (0.0, -0.2e-3))]
    assert [other.distance for other in found.others] == pytest.approx(away, abs=10e-6)


def test_a_map_the_wrong_way_up_touches_at_the_rim(tmp_path):
    matrix(tmp_path / "map.csv", 1e6 * sphere(96), ",")
    keys = MAP | {"file_unit": "um"}
    right = report(scene_of(tmp_path, "map.csv", **keys))
    assert right["first contact"] == "inside" and right["height map"] == "96 x 96" and right["peaks"] == "down"
    wrong = report(scene_of(tmp_path, "map.csv", **keys | {"file_peaks": "up"}))
    assert wrong["first contact"] == "at the rim" and wrong["rms height"] == pytest.approx(right["rms height"])
    text = map_advice.head(scene_of(tmp_path, "map.csv", **keys))
    assert (
        len(text) == 3
        and "96 x 96 pixels of 8.75 um x 8.75 um" in text[0]
        and "in um by the scene, peaks down" in text[0]
    )
    assert "tilt none" in text[1] and "first contact inside" in text[2]


def spiky(z, *pixels, by=-8e-6):
    z = z.copy()
    for row, column in pixels:
        z[row, column] += by
    return z


FLAT = 20e-9 * np.random.default_rng(5).normal(size=(96, 96))
DOME = sphere(96)
STEPS = np.round((DOME + 3 * FLAT) / 0.4e-6) * 0.4e-6
ZEROS = np.where(np.random.default_rng(6).random((96, 96)) < 0.03, 0.0, DOME - 8e-6 + FLAT)
WARNED = {
    "decides where contact begins: .* is 6.. nm higher now": (FLAT + 1.745e-3 * X, {}),
    "pixels are not square, 8.75 um x 4.38 um": (DOME, {"file_size": ["840 um", "420 um"], "radius": "200 um"}),
    "2 single pixels stick out .* the furthest by [78].*? um out of the face, towards the elastomer": (
        spiky(DOME + FLAT, (40, 45), (60, 52)), {}),
    "a single pixel sticks out .* into the face": (spiky(DOME + FLAT, (50, 45), by=4e-6), {}),
    "hold the very same extreme height": (np.maximum(DOME + FLAT, 2e-6), {}),
    "pixels of 35 um x 35 um are coarser than the grid's spacing, 23.4 um": (sphere(24), {}),
    "heights bend by .* nm within a pixel, .* of the range": (DOME + 50 * FLAT, {}),
    "heights come in steps of 400 nm, 0.27 of the range of adhesion": (STEPS, {}),
    "pixels hold the number 0, far more than hold any other, .* file_missing_value = .0.": (ZEROS, {}),
    "scene nor file says the unit .* taken for metres, a range of 1.* um": (DOME, {"file_unit": None}),
    "have no height and are made up": (np.where((abs(X) < 70e-6) & (abs(Y) < 90e-6), np.nan, DOME), {"file_missing": "fill"}),
}  # fmt: skip


@pytest.mark.parametrize("words", WARNED)
def test_what_may_not_be_meant_is_warned_of(tmp_path, words):
    z, keys = WARNED[words]
    found = told(tmp_path, z, **keys)
    assert any(re.search(words, text) for text in found), found
    if "bend by" not in words:
        assert len(found) <= 2, found


def test_a_good_map_is_not_warned_of(tmp_path):
    two_levels = np.where(np.hypot((X + 1e-9) % 60e-6 - 30e-6, Y % 60e-6 - 30e-6) < 20e-6, 0.0, 10e-6)
    ground = np.where(np.hypot(X, Y) > 0.374e-3, 1e-3, DOME + FLAT)
    ruled = np.broadcast_to(2e-6 * (1 + np.cos(X / 20e-6)), (96, 96))
    for z in (DOME, DOME + FLAT, FLAT, np.zeros((96, 96)), two_levels, ground, ruled):
        assert not told(tmp_path, z, radius="360 um")
    # A tilt that is taken off is no matter any more.
    assert not told(tmp_path, FLAT + 1.745e-3 * X, file_detrend="tilt")


def test_no_pixel_of_a_large_map_is_passed_over(tmp_path, monkeypatch):
    """Of 97 pixels across each fourth is looked at: a lone spike, a hole and a code lie between these."""
    monkeypatch.setattr("pgfmd.physics.map_survey.MOST_ACROSS", 32)
    x = middles(97, 840e-6)
    z = np.random.default_rng(7).normal(size=(97, 97)) * 20e-9 + (x**2 + x[:, None] ** 2) / 0.1
    found = seen(tmp_path, spiky(spiky(z, (50, 55)), (42, 59), by=4e-6))
    assert [spike.height for spike in found.spikes] == pytest.approx([-8e-6, 4e-6], abs=2e-6)
    assert (found.first.x, found.first.y) == pytest.approx((x[55], x[50]), abs=4 * 8.7e-6) and not found.first.at_rim
    monkeypatch.setattr("pgfmd.maps.raw.WHOLE", 1000)
    z[49, 53] = z[51, 50] = -9999.0
    with pytest.raises(MapError, match=r"2 of .* pixels under the punch have no height, .* hold -9999"):
        seen(tmp_path, z)


def test_a_unit_or_a_way_that_is_not_that_of_the_file_is_told(tmp_path):
    np.savez(tmp_path / "map.npz", z=1e6 * DOME, size=[840e-6] * 2, unit="um", peaks="down")
    keys = {"name": "map.npz", "file_size": None}
    assert told(tmp_path, None, file_unit="µm", **keys) == []
    (text,) = told(tmp_path, None, file_unit="nm", **keys)[:1]
    assert 'punch.file_unit is "nm", but by the file heights are in um' in text
    (text,) = told(tmp_path, None, file_unit="um", file_peaks="up", **keys)[:1]
    assert 'file_peaks is "up", but by the file they are down, so that the lowest heights touch first' in text


def test_a_size_that_is_not_that_of_the_file_is_told(tmp_path):
    np.savez(tmp_path / "map.npz", z=DOME, size=[840e-6] * 2)
    size = f"{840e-6 * 95 / 96!r} m"
    (text,) = told(tmp_path, None, name="map.npz", file_size=[size, size])
    assert "by the file the map is 840 um x 840 um: a size reaches half a pixel beyond" in text
    (text,) = told(tmp_path, None, name="map.npz", file_size=["900 um", "840 um"])[-1:]
    assert "is 900 um x 840 um, but by the file" in text or "not square" in text
