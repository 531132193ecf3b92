"""Summits, saddles and valleys of a punch: against the closed form of the corrugation, and against its gradient."""

import math

import numpy as np
import pytest

from pgfmd.physics.contact_sites import KINDS, contact_sites
from pgfmd.physics.topography import Topography

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
    "face, names",
    [
        (Topography("flat", radius=RADIUS), []),
        (Topography("flat", radius=RADIUS, curvature_radius=0.05), ["summit"]),
        (Topography("flat", radius=RADIUS, curvature_radius=-0.05), ["valley"]),
        (Topography("sphere", radius=RADIUS, curvature_radius=0.005, layer_step=1e-7), ["summit"]),
        (Topography("power", radius=RADIUS, curvature_radius=0.005, exponent=4.0), ["summit"]),
        (Topography("file", radius=RADIUS, file="not read.npy", file_size=(1e-3, 1e-3)), []),
    ],
    ids=["flat", "convex", "concave", "sphere", "power", "file"],
)
def test_other_faces_have_one_site_or_none(face, names):
    sites = contact_sites(face)
    assert sites.names() == names and not np.any(sites.x) and not np.any(sites.y)


def test_a_face_without_an_outline_needs_the_side_of_its_cell():
    with pytest.raises(ValueError, match="give the side of the cell"):
        contact_sites(Topography("sinusoid", wavelength=50e-6, amplitude=1e-6))
