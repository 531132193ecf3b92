"""A scheme that is added from outside: one folder (kelvin_voigt/) and one line. It runs, and all that asks about schemes
knows it."""

import math

import numpy as np
import pytest

import pgfmd
from pgfmd.errors import SceneError
from pgfmd.forecast.effort import effort_of
from pgfmd.results import uncertainty
from pgfmd.results.curve import Loop
from pgfmd.scene import load_scene
from pgfmd.schemes import registry
from tests.unit import kelvin_voigt, small_runs

SLOW = ["rheology.modulus_ratio=1e5", "rheology.relaxation_time=1 us"]
"""A spectrum of which slow motion sees the dashpot alone, of 0.1 s."""


@pytest.fixture(scope="module", autouse=True)
def added():
    with registry.registered(kelvin_voigt.ENTRY) as entry:
        yield entry


def scene_with(accuracy, *changes):
    common = ["grid.n=24", "drive.speed=20 um/s", "drive.preload=1 mN", *SLOW]
    return load_scene("tri-tack", [*common, "solver.scheme=kelvin-voigt", f"solver.accuracy={accuracy}", *changes])


@pytest.fixture(scope="module")
def recordings(added):
    return {share: pgfmd.simulate(scene_with(share)) for share in (0.1, 0.05)}


def test_a_tack_test_runs_to_its_end_and_its_energy_audit_closes_by_the_first_order(recordings):
    residuals = []
    for share, recording in recordings.items():
        assert recording.run["finished"] == "detached" and recording.run["scheme"] == "kelvin-voigt"
        assert recording.run["accuracy"] == share and recording.run["mirror"] == "x"
        assert recording.run["transform_pairs"] == recording.run["steps"]
        residuals.append(recording.run["energy_residual"])
    assert residuals[1] < 0.02
    assert residuals[0] / residuals[1] == pytest.approx(2.0, abs=0.2)


def test_its_curve_approaches_that_of_the_implicit_scheme_by_the_first_order(recordings):
    scene = scene_with(1e-4, "solver.scheme=inertialess", "output.energy=false")
    wanted = pgfmd.simulate(scene).run["pull_off_force_N"]
    errors = [abs(recording.run["pull_off_force_N"] / wanted - 1.0) for recording in recordings.values()]
    assert errors[1] < 0.03 and errors[0] / errors[1] == pytest.approx(2.0, abs=0.3)


def test_it_is_checked_like_any_other(recordings):
    scene = scene_with(0.1, "solver.order=1")
    report = scene.check()
    assert report["solver.scheme"] == "kelvin-voigt" and report["mirror symmetry"] == "x"
    assert any("solver.order has no effect" in text and "it is of order 1" in text for text in report.warnings)
    assert not any("jumps" in text for text in report.remarks)
    steps = recordings[0.1].run["steps"]
    assert steps / 2.0 < effort_of(scene_with(0.1)).steps < steps * 2.0
    with pytest.raises(
        SceneError, match=r"solver\.precision = .single.: expected 'double' with the scheme kelvin-voigt"
    ):
        scene_with(0.1, "solver.precision=single")
    with pytest.raises(SceneError, match="a periodic cell, because the scheme kelvin-voigt knows"):
        scene_with(0.1, "substrate.boundary=free")
    assert load_scene("tri-tack", ["solver.scheme=kelvin-voigt"]).to_toml().count("kelvin-voigt") == 1


def test_a_run_that_was_stopped_goes_on_to_the_same_bits(tmp_path):
    changes = ["solver.scheme=kelvin-voigt", "solver.accuracy=0.3", "drive.speed=50 um/s"]
    whole, parts = small_runs.run(tmp_path / "whole", *changes), tmp_path / "parts"
    small_runs.run(parts, *changes, stop_after=20)
    small_runs.run(parts, *changes)
    assert (whole / "curve.csv").read_bytes() == (parts / "curve.csv").read_bytes()
    loop = Loop.of(pgfmd.load(parts))
    assert loop.share == pytest.approx(2.0 * 0.3) and np.isfinite(loop.force).all()


def test_what_is_not_there_is_refused_and_nothing_is_supposed_of_it(added):
    with pytest.raises(ValueError, match="one of this name already"):
        registry.register(added)
    with pytest.raises(SceneError, match="expected 'inertialess', 'gfmd', 'quasistatic' or 'kelvin-voigt'"):
        load_scene("tri-tack", ["solver.scheme=kelvin"])
    of_another = {"scheme": "spectral", "accuracy": 0.01}
    assert math.isnan(uncertainty.share_of(of_another)) and uncertainty.share_of({"accuracy": 0.01}) == 0.02
    assert registry.scheme_in({}).name == registry.DEFAULT and registry.names()[-1] == "kelvin-voigt"
