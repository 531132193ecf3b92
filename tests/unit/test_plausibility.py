"""What can't be meant: lengths, speeds and pressures that a wrong unit leaves, in words a person would use."""

import math
import re

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.commands.check import report
from pgfmd.forecast import plausibility
from pgfmd.forecast.advice import warnings as all_warnings
from pgfmd.forecast.plausibility import face_of, warnings
from pgfmd.maps import raw
from pgfmd.physics.heightfile import forget
from pgfmd.runner import Options, run_scene
from pgfmd.scene import load_scene, shipped_scenes
from pgfmd.scene_objects import topography_of

MAP = ("tri-tack", "punch.pattern=file")
WAVES = ["punch.pattern=sinusoid", "punch.wavelength=150 um", "punch.amplitude=4 um", "grid.n=1000"]


def told(name, *overrides):
    return list(warnings(load_scene(name, overrides)))


@pytest.fixture
def save(tmp_path):
    """Saves a map and returns the override that names it."""

    def do(heights):
        np.save(tmp_path / "map.npy", heights)
        return f"punch.file={tmp_path / 'map.npy'}"

    return do


CHANGES = {
    "cyclic-hold": ("grid.n=32", "solver.scheme=quasistatic", "drive.step.3.speed=1 mm/s"),
    "rough-film": ("grid.n=80", "solver.scheme=quasistatic", "drive.retract_speed=1 mm/s"),
    "sphere-tack": ("grid.n=32", "drive.retract_speed=1 mm/s"),
}
"""What is changed of shipped scenes that not all of the usual changes suit."""


@pytest.mark.parametrize("name", shipped_scenes())
def test_shipped_scenes_are_plausible(name):
    usual = ("grid.n=32", "solver.scheme=quasistatic", "drive.retract_speed=1 mm/s")
    assert told(name) == []
    for override in CHANGES.get(name, usual):
        assert told(name, override) == []


WRONG = {
    "punch.amplitude: .* rises by 8 m, 2.1e.04 times .* small slopes": ["punch.amplitude=4 m"],
    "punch.amplitude: .* less than an atom": ["punch.amplitude=4 pm"],
    "punch.curvature_radius: .* rises by .* slope is ": ["punch.pattern=sphere", "punch.curvature_radius=10 um"],
    "punch.curvature_radius: .* rises by 703 um, 1.9 times": ["punch.pattern=flat", "punch.curvature_radius=100 um"],
    "adhesion.range is 23.6 mm, 63 times the punch's radius: .* work_of_adhesion = 50 MJ/m.2, E. = 2.65 MPa": [
        "adhesion.work_of_adhesion=50 MJ/m^2"
    ],
    "adhesion.range is 2.6 mm, .* look at its unit": ["adhesion.range=2.6 mm"],
    "adhesion.range is 2.6 um, 0.65 times the film's thickness": ["adhesion.range=2.6 um", "substrate.thickness=4 um"],
    "adhesion.work_of_adhesion: gamma/E. = 50 mJ/m.2 / 265 Pa = 189 um": ["substrate.youngs_modulus=200 Pa"],
    "drive.speed = 1 km/s is beyond the speed of sound .* 51 m/s": ["drive.speed=1 km/s"],
    "drive.retract_speed = 1 km/s": ["drive.retract_speed=1 km/s"],
    "drive.preload = 40 kN is a mean pressure of 90.5 GPa": ["drive.preload=40 kN", "substrate.thickness=4 mm"],
    "drive.clearance: the punch starts 4 m above .* 1.1e.04 times .* 46.3 days": ["drive.clearance=4 m"],
    "solver.accuracy has no effect with solver.scheme = .gfmd., as its steps": ["solver.scheme=gfmd", "solver.accuracy=1e-3"],
    "solver.order has no effect": ["solver.scheme=quasistatic", "solver.order=1"],
    "drive.dwell has no effect with .*, as time": ["solver.scheme=quasistatic", "drive.dwell=1 s"],
    "grid.length: points .* are 58.6 pm apart": [
        "punch.pattern=flat", "punch.radius=4 nm", "grid.length=15 nm", "grid.n=256"],
}  # fmt: skip


@pytest.mark.parametrize("words", WRONG)
def test_what_cannot_be_meant_is_said(words):
    found = told("tri-tack", *WRONG[words])
    assert any(re.search(words, text) for text in found), found


def test_slope_and_relief_are_those_of_the_profile_on_any_grid():
    """z0 (1 + cos qx) is steepest at z0 q; r^2/(2R) is a/R at the rim, and a^2/(2R) high; the corrugation is steepest
    as its gradient on a fine lattice is."""
    for n in (24, 1000):
        face = face_of(load_scene("tri-tack", [*WAVES, f"grid.n={n}"]))
        assert face.slope == pytest.approx(4e-6 * 2 * math.pi / 150e-6, rel=1e-3)
        assert face.relief == pytest.approx(8e-6, rel=1e-3)
    # Waves that a regular lattice of points would take for a plane.
    face = face_of(load_scene("tri-tack", [*WAVES, "punch.wavelength=1.46484375 um", "grid.n=2048"]))
    assert face.relief == pytest.approx(8e-6, rel=1e-3)
    face = face_of(load_scene("hertz"))
    assert (face.slope, face.relief) == pytest.approx((375e-6 / 10e-3, 375e-6**2 / 20e-3), rel=1e-9)
    assert face_of(load_scene("flat-punch")).relief == 0.0
    heights = topography_of(load_scene("hex-tack").punch).heights
    x, y = np.meshgrid(np.linspace(0, 150e-6, 801), np.linspace(0, 150e-6 * math.sqrt(3), 801))
    along_y, along_x = np.gradient(heights(x, y), y[:, 0], x[0])
    face = face_of(load_scene("hex-tack", ["grid.n=32"]))
    assert face.slope == pytest.approx(np.hypot(along_x, along_y)[1:-1, 1:-1].max(), rel=2e-3)
    assert face.relief == pytest.approx(2 * 9.2e-6, rel=2e-3)


def test_a_map_has_the_slope_of_the_profile_that_it_samples(save):
    x = (np.arange(600) + 0.5) / 600 * 900e-6
    named = save(np.broadcast_to(4e-6 * (1 + np.cos(2 * np.pi / 150e-6 * x)), (40, 600)))
    changes = ["punch.pattern=file", named, 'punch.file_size=["900 um", "900 um"]', "grid.n=1000"]
    face = face_of(load_scene("tri-tack", changes))
    assert face.slope == pytest.approx(4e-6 * 2 * math.pi / 150e-6, rel=1e-3)
    assert face.relief == pytest.approx(8e-6, rel=1e-3)
    # On a grid that is coarser than the map it is the same face.
    coarse = face_of(load_scene("tri-tack", [*changes, "grid.n=256"]))
    assert coarse.slope == pytest.approx(face.slope, rel=0.02) and coarse.relief == face.relief
    save(np.zeros((600, 600)))
    face = face_of(load_scene("tri-tack", [*changes, "punch.curvature_radius=10 mm"]))
    assert (face.slope, face.relief) == pytest.approx((375e-6 / 10e-3, 375e-6**2 / 20e-3), rel=0.02)


@pytest.mark.parametrize("cell", [False, True], ids=["punch", "cell"])
def test_a_map_on_the_disk_is_looked_at_in_stripes(save, monkeypatch, cell):
    # Whole numbers without a sign, whose differences would be large numbers.
    heights = np.random.default_rng(5).integers(0, 3, (61, 57)).astype(np.uint8)
    changes = ["punch.pattern=file", save(heights), 'punch.file_size=["900 um", "900 um"]', "grid.n=64"]
    scene = load_scene("tri-tack", [*changes, "punch.curvature_radius=1 m"])
    punch = scene.punch.model_copy(update={"radius": None}) if cell else scene.punch
    scene = scene.model_copy(update={"punch": punch})
    plausibility._face_of.cache_clear()
    whole = face_of(scene)
    plausibility._face_of.cache_clear()
    monkeypatch.setattr(raw, "WHOLE", 300)
    forget()
    # The last rows and columns, and those that follow them across the border of a cell, are there as well.
    assert face_of(scene) == whole
    plausibility._face_of.cache_clear()
    assert whole.relief == pytest.approx(2.0, rel=1e-3) and whole.size == (900e-6, 900e-6)
    assert whole.slope < 2.0 * math.sqrt(2.0) / (900e-6 / 61)


def test_heights_in_micrometres_are_told_in_metres(save):
    x = (np.arange(24) + 0.5) / 24
    z = 2.0 * (1 - np.cos(2 * np.pi * 6 * x))
    overrides = ["punch.pattern=file", save(z[:, None] + z), 'punch.file_size=["900 um", "900 um"]', "grid.n=64"]
    (text,) = told("tri-tack", *overrides)
    assert text.startswith("punch.file: ") and "rises by 5.66 m" in text and "read in metres" in text
    found = report(load_scene("tri-tack", overrides))
    assert found["height range"] == pytest.approx(4 * 2**0.5, rel=1e-9) and text in found.warnings


def test_a_map_that_is_saved_anew_is_looked_at_anew(save):
    overrides = ["punch.pattern=file", save(np.zeros((8, 8))), 'punch.file_size=["900 um", "900 um"]']
    assert told("tri-tack", *overrides) == []
    save(np.eye(9))
    assert "rises by 1 m" in told("tri-tack", *overrides)[0]


def test_pixels_beyond_the_punch_do_not_count(save):
    heights = np.zeros((24, 24))
    heights[0, 0] = 1.0
    overrides = ["punch.pattern=file", save(heights), 'punch.file_size=["1.5 mm", "1.5 mm"]']
    assert told("tri-tack", *overrides) == []
    scene = load_scene("tri-tack", overrides)
    cell = scene.model_copy(update={"punch": scene.punch.model_copy(update={"radius": None})})
    assert "rises by 1 m" in next(warnings(cell))


def test_a_map_that_does_not_fit_into_the_cell_is_told(tmp_path):
    np.save(tmp_path / "map.npy", np.zeros((8, 8)))
    named = 'pattern = "file"\nfile = "map.npy"\nfile_size = SIZE'
    text = load_scene("tri-tack").to_toml().replace('pattern = "triangular"', named)
    of_waves = ("radius", "wavelength", "amplitude", "height_jitter", "seed")
    lines = [line for line in text.split("\n") if not line.startswith(of_waves)]
    for size, fits in (("750 um", True), ("1.5 mm", True), ("900 um", False), ("2 mm", False)):
        path = tmp_path / "scene.toml"
        path.write_text("\n".join(lines).replace("SIZE", f'["750 um", "{size}"]'))
        found = list(warnings(load_scene(path)))
        assert found == [] if fits else "does not fit into the cell" in found[0]


def test_a_run_begins_with_its_warnings_and_goes_on_without(tmp_path):
    scene = load_scene("tri-tack", ["grid.n=20", "drive.preload=1 mN", "solver.max_steps=1"])
    lines = []
    run_scene(scene, MPI.COMM_SELF, tmp_path, lines.append)
    expected = [f"warning: {text}" for text in all_warnings(scene)]
    assert expected and lines[: len(expected)] == expected
    longer, lines = load_scene("tri-tack", ["grid.n=20", "drive.preload=1 mN", "solver.max_steps=2"]), []
    run_scene(longer, MPI.COMM_SELF, tmp_path, lines.append, Options(allow=("solver.max_steps",)))
    assert not [line for line in lines if line in expected]
