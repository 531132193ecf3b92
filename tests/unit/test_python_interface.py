"""The Python interface: a scene is made, changed and looked at; a test is simulated in memory, and run into a folder."""

import copy
import math
import os
import pickle
import signal
import subprocess
import sys

import numpy as np
import pytest

import pgfmd
from pgfmd import Scene
from pgfmd.errors import SceneError

SMALL = {"grid": {"n": 32}, "drive": {"speed": "50 um/s", "preload": 1e-3}}


@pytest.fixture(scope="module")
def scene():
    return Scene("tri-tack", **SMALL)


def test_numbers_are_si_and_texts_have_units(scene):
    other = Scene("tri-tack", grid={"n": np.int64(32)}, drive={"speed": np.float64(5e-5), "preload": "1 mN"})
    assert other == scene and hash(other) == hash(scene)
    assert other.drive.preload == 1e-3 and other.substrate.thickness == math.inf


def test_what_is_automatic_follows_a_change(scene):
    finer = scene.replace(grid={"n": 128})
    assert finer == Scene("tri-tack", grid={"n": 128}, drive=SMALL["drive"])
    assert finer.adhesion.range == pytest.approx(scene.adhesion.range / 2)
    fixed = scene.replace(adhesion={"range": 1e-6})
    assert fixed.adhesion.range == 1e-6
    assert fixed.replace(adhesion={"range": None}) == scene
    assert scene.replace(solver={"precision": "double"}).solver.precision == "double"


def test_a_new_pattern_needs_no_keys_of_the_old_one(scene):
    flat = scene.replace(punch={"pattern": "flat"}, title="flat")
    assert flat.punch.wavelength is None and flat.title == "flat"
    with pytest.raises(SceneError, match="curvature_radius"):
        scene.replace(punch={"pattern": "sphere"})


def test_sources_of_a_scene(scene, tmp_path, monkeypatch):
    path = tmp_path / "mine.toml"
    path.write_text(scene.to_toml(), encoding="utf-8")
    assert Scene(path) == Scene(str(path)) == Scene(scene) == scene
    tables = {"title": scene.title, **scene.tables()}
    assert Scene(tables) == Scene(**tables) == scene
    # A file that is named relatively belongs to the scene's folder, wherever it is changed.
    (tmp_path / "law.txt").write_text("1e3 1e-9\n1e5 1e-11\n", encoding="utf-8")
    path.write_text(scene.replace(title="own").to_toml(), encoding="utf-8")
    own = Scene(path, substrate={"compliance_file": "law.txt"})
    monkeypatch.chdir("/")
    assert own.replace(grid={"n": 48}).substrate.compliance_file == str(tmp_path / "law.txt")


def test_a_copy_with_other_resolved_values_stays_as_it_is_when_it_is_replaced(scene):
    double = scene.model_copy(update={"title": "other"})
    assert double.replace(grid={"n": 48}).title == "other"
    for same in (pickle.loads(pickle.dumps(scene)), copy.deepcopy(scene)):
        assert same == scene and same.replace(grid={"n": 64}) == scene.replace(grid={"n": 64})


def test_every_problem_is_told(scene):
    with pytest.raises(SceneError) as caught:
        Scene("tri-tack", grid={"n": 4.5}, drive={"preload": -1.0, "sped": 1})
    assert all(text in str(caught.value) for text in ("grid.n", "drive.preload", "drive.sped", "3 problems"))
    with pytest.raises(TypeError, match="gird"):
        scene.replace(gird={"n": 32})


def test_how_a_scene_shows_itself(scene):
    assert (
        repr(scene)
        == "<Scene 'Tack test, triangular corrugation', triangular punch, 50 um/s to 1 mN, n = 32, inertialess>"
    )
    assert "<table>" in scene._repr_html_() and "&quot;5e-05 m/s&quot;" in scene._repr_html_()
    assert "expected transform pairs" in scene.check()


def test_a_simulation_in_memory_is_that_of_a_folder(scene, tmp_path):
    made = scene.replace(output={"snapshots": ["0.5 t_pl", "1.2 t_pl"]})
    found, lines = pgfmd.simulate(made), []
    results = pgfmd.run(made, tmp_path / "run", say=lines.append)
    for name in ("curve", "energy", "events"):
        mine, theirs = getattr(found, name), getattr(results, name)
        assert list(mine.columns) == list(theirs.columns)
        kept = [column for column in mine.columns if column not in ("joined", "left", "x [m]", "y [m]", "at")]
        for column in kept:
            assert mine[column].tolist() == theirs[column].tolist(), column
    assert found.labels == results.labels and len(found.labels) == 4
    for name in ("gap", "traction", "displacement"):
        np.testing.assert_array_equal(found.frame(name, 1), results.frame(name, 1))
    np.testing.assert_array_equal(np.asarray(results.fields["x"]), found.fields["x"])
    assert found.measures == pgfmd.analyse(tmp_path / "run").measures
    assert found.run["pull_off_force_N"] == results.run["pull_off_force_N"] and found.contact_gap == results.contact_gap


def test_a_function_sees_every_step_and_can_stop(scene):
    seen = []

    def look(step):
        inside = np.isfinite(step.gap)
        held = np.count_nonzero(step.gap[inside] < found_gap) * (step.x[1] - step.x[0]) ** 2
        seen.append((step.kind, step.number, step.force, held, step.contact_area))
        assert step.gap.shape == (len(step.y), len(step.x)) == step.traction.shape == step.surface.shape
        pressed = -np.nansum(step.traction) * (step.x[1] - step.x[0]) ** 2
        assert pressed == pytest.approx(step.force, rel=1e-3, abs=1e-7)
        if step.phase == "retract":
            step.stop()

    found_gap = scene.adhesion.range / 2
    recording = pgfmd.simulate(scene, each=look)
    assert [row[1] for row in seen] == list(range(len(seen))) and seen[0][0] == "start"
    assert all(held == pytest.approx(area) for *_, held, area in seen)
    assert len(recording.curve) == len(seen) and recording.run["finished"] == ""
    assert "stopped" in repr(recording) and recording.curve["phase"].iloc[-1] == "retract"


def program(text):
    """A process that runs these lines."""
    return subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


INTERRUPTED = """
import sys, os, signal, pgfmd
{more}
def look(step):
    if step.number == 5:
        os.kill(os.getpid(), signal.SIGINT)
found = pgfmd.simulate(pgfmd.Scene("tri-tack", grid={{"n": 32}}, drive={{"preload": 1e-3}}), each=look)
print(found)
"""


def test_ctrl_c_returns_what_was_found_in_an_interactive_session_and_raises_elsewhere():
    typed, script = program(INTERRUPTED.format(more="sys.ps1 = '>>> '")), program(INTERRUPTED.format(more=""))
    (said, problem), (_, raised) = (process.communicate(timeout=120) for process in (typed, script))
    assert typed.returncode == 0 and "interrupted after step 5" in said and "stopped, 5 steps" in said, problem
    assert script.returncode != 0 and "KeyboardInterrupt: interrupted after step 5" in raised
    assert script.returncode == -signal.SIGINT


def test_processes_of_mpirun_have_to_say_what_they_do():
    environment = os.environ | {"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "0"}
    text = "import pgfmd\ntry:\n    pgfmd.simulate('tri-tack')\nexcept pgfmd.PgfmdError as error:\n    print(error)"
    done = subprocess.run([sys.executable, "-c", text], env=environment, capture_output=True, text=True, timeout=120)
    assert "comm=MPI.COMM_WORLD" in done.stdout and not done.stderr


def test_several_ranks_are_started_for_a_run(scene, tmp_path):
    said = []
    results = pgfmd.run(scene, tmp_path / "two", ranks=2, say=said.append)
    assert results.run["ranks"] == 2 and results.run["finished"] == "detached"
    found = pgfmd.simulate(scene)
    assert found.curve["force [N]"].tolist() == results.curve["force [N]"].tolist()
    assert (tmp_path / "two.log").exists() and said
    with pytest.raises(pgfmd.PgfmdError, match="holds a run of another scene") as caught:
        pgfmd.run(scene.replace(grid={"n": 36}), tmp_path / "two", ranks=2, say=said.append)
    assert caught.value.exit_code != 0
