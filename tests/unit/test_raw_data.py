"""The tutorial from raw data to an overlay, on a small grid: what was put into the files comes out again."""

import re

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator
from typer.testing import CliRunner

import pgfmd
from pgfmd.analysis.comparison import load_loops, overlay
from pgfmd.cli import app
from pgfmd.maps.raw import MapError
from pgfmd.punch.face import face_on_grid
from pgfmd.scene import load_scene
from pgfmd.scene_objects import series_of
from scripts.studies.raw_data import make as raw


def pgfmd_command(*words):
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == 0, done.exception
    return done.stdout


def test_from_raw_data_to_an_overlay(tmp_path):
    raw.make(tmp_path, points=24)
    scene = tmp_path / "scene.toml"
    told = pgfmd_command("check", scene)
    assert "map.txt" in told
    with pytest.raises(MapError, match="pixels under the punch have no height"):
        face_on_grid(load_scene(scene, ["punch.file_missing=refuse"]))
    # The face without tilt and gaps, to the noise of the map.
    found, true = face_on_grid(load_scene(scene)), raw.heights(np.random.default_rng(1))
    x = (np.arange(raw.PIXELS) + 0.5) / raw.PIXELS * raw.SIZE - raw.SIZE / 2
    wanted = RegularGridInterpolator((x, x), true)((found.y[:, None] + 0 * found.x, found.x + 0 * found.y[:, None]))
    difference = (found.z - wanted)[found.inside]
    assert np.ptp(difference) < 0.2e-6 < 0.1 * raw.TILT * raw.SIZE
    told = pgfmd_command("fit-prony", tmp_path / "sweeps.txt", "-t", "25C", "-n", "12", "--into", scene)
    assert "nu = 0.495" in told and re.search(r"left out: .*-65 C", told)
    found = load_scene(scene)
    assert found.substrate.youngs_modulus == pytest.approx(raw.STATIC_MODULUS, rel=0.03)
    omega = [1.0, 1e2, 1e4]
    assert series_of(found.rheology).storage(omega) == pytest.approx(raw.SERIES.storage(omega), rel=0.06)
    pgfmd.run(scene, tmp_path / "out", say=lambda line: None)
    stiffness = f"{raw.MACHINE_STIFFNESS} N/m"
    words = ["--machine-stiffness", stiffness, "--offset", "fit", "-o", tmp_path / "both.png"]
    told = pgfmd_command("compare", tmp_path / "out", tmp_path / "tack.csv", *words)
    assert re.search(
        r"^tack +force far away, 18\S+ uN, taken off, - F/k_M \(2 kN/m\), pushed in by", told, re.MULTILINE
    )
    runs, measured = load_loops([tmp_path / "out", tmp_path / "tack.csv"])
    both = overlay(runs, measured, machine_stiffness=raw.MACHINE_STIFFNESS, offset=None)
    run, tack = both.measures
    spread = tack.pull_off.uncertainty + run.pull_off.uncertainty
    assert tack.pull_off.tension == pytest.approx(run.pull_off.tension, abs=spread)
    assert tack.work_of_separation == pytest.approx(run.work_of_separation, rel=0.05)
    assert both.differences[0] < 0.02 * run.largest_force
    assert not [text for text in measured[0].remarks if "baseline" in text]
