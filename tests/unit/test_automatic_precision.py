"""The precision that a scene leaves open: what is chosen, what says so, and what a run that goes on keeps."""

import json

import pytest
from mpi4py import MPI

from pgfmd.commands.check import report
from pgfmd.errors import SceneError
from pgfmd.files.storage import RUN_FILE, SCENE_FILE
from pgfmd.forecast.effort import effort_of
from pgfmd.forecast.estimate import FUSED_PAIR, OUTSIDE, SINGLE_PAIR, memory_of
from pgfmd.restart.bitwise_comparison import differences
from pgfmd.restart.resume import plan
from pgfmd.restart.scene_changes import differing, review
from pgfmd.runner import Options, run_scene
from pgfmd.scene import load_scene, parse_scene, shipped_scenes
from pgfmd.scene import precision as rule
from pgfmd.scene.precision import FINEST_MIXED, LEAST_SIDE, best_precision
from tests.unit.small_runs import SCENE, run

AUTO, DOUBLE, MIXED = (f"solver.precision={name}" for name in ("auto", "double", "mixed"))
LARGE = f"grid.n={LEAST_SIDE}"


def chosen(*changes, name="tri-tack"):
    return load_scene(name, list(changes)).solver.precision


@pytest.fixture
def cheap(monkeypatch):
    """As if mixed precision paid on any grid."""
    monkeypatch.setattr(rule, "LEAST_SIDE", 1)


# -- the rule ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", shipped_scenes())
def test_shipped_scenes_on_grids_where_it_pays(name):
    if load_scene(name).drive.controls_load:
        assert chosen(LARGE, name=name) == "double"
        return
    assert chosen(LARGE, name=name) == "mixed" and chosen(f"grid.n={LEAST_SIDE - 1}", name=name) == "double"


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        (["solver.scheme=gfmd"], "gfmd"),
        (["solver.scheme=quasistatic"], "quasi-static"),
        (["solver.scheme=quasistatic", "drive.control=load"], "load control"),
        ([f"solver.accuracy={0.99 * FINEST_MIXED:g}"], "accuracy"),
        (["grid.n=64"], str(LEAST_SIDE)),
        # The transform is twice as wide as the punch, whatever the cell is.
        (["substrate.boundary=free", "grid.n=1024", "grid.length=15 mm"], str(LEAST_SIDE)),
    ],
)
def test_double_where_mixed_is_worse_or_not_cheaper(changes, word):
    scene = load_scene("tri-tack", ["grid.n=512", *changes])
    assert scene.solver.precision == "double" and word in best_precision(scene).reason


@pytest.mark.parametrize(
    "changes",
    [
        ["solver.accuracy=0.3"],
        [f"solver.accuracy={FINEST_MIXED:g}"],
        ["rheology.model=elastic"],
        ["rheology.modulus_ratio=1e6"],
        ["substrate.thickness=100 um"],
        ["substrate.boundary=free", "grid.n=1024", "grid.length=3 mm"],
        ["solver.order=1"],
    ],
)
def test_mixed_where_it_has_the_error_of_double(changes):
    scene = load_scene("tri-tack", ["grid.n=512", *changes])
    assert scene.solver.precision == "mixed" and "error of double" in best_precision(scene).reason


def test_a_precision_that_is_given_stays():
    for name in ("double", "mixed", "single"):
        scene = load_scene("tri-tack", [LARGE, f"solver.precision={name}"])
        assert scene.solver.precision == name and not scene.solver.automatic_precision
    assert load_scene("tri-tack", [LARGE, AUTO]) == load_scene("tri-tack", [LARGE])


def test_the_resolved_scene_names_what_was_chosen():
    for changes in ([LARGE], ["grid.n=64"]):
        scene = load_scene("tri-tack", changes)
        again = parse_scene(scene.to_toml())
        assert f'precision = "{scene.solver.precision}"' in scene.to_toml()
        assert again == scene and again.solver.precision == scene.solver.precision
        assert scene.solver.automatic_precision and not again.solver.automatic_precision


def test_check_tells_the_precision_and_why():
    def line(*changes):
        lines = report(load_scene("tri-tack", list(changes))).sections["Scene (SI)"]
        return next(line for line in lines if line.name == "solver.precision")

    assert (line(LARGE).value, line("grid.n=64").value) == ("mixed", "double")
    assert line(LARGE).note.startswith("because ") and line("grid.n=64").note.startswith("because ")
    assert line(LARGE, MIXED).note == ""


def test_the_forecast_is_that_of_the_precision_that_was_chosen():
    plain = ["grid.n=512", "solver.coarse_grid=none"]
    auto, double, mixed = (load_scene("tri-tack", [*plain, *more]) for more in ([], [DOUBLE], [MIXED]))
    assert memory_of(auto) == memory_of(mixed) != memory_of(double)
    single, whole = OUTSIDE + FUSED_PAIR * SINGLE_PAIR, OUTSIDE + FUSED_PAIR
    assert [effort_of(scene).cost for scene in (auto, double, mixed)] == pytest.approx([single, whole, single])


# -- runs that go on ---------------------------------------------------------------------------------------------------


def go_on(folder, *changes):
    """Goes on with a scene that has these changes; what was said."""
    told = []
    run_scene(load_scene(SCENE[0], [*SCENE[1:], *changes]), MPI.COMM_SELF, folder, told.append, Options())
    return told


@pytest.mark.parametrize("began", ["double", "mixed"])
def test_a_run_that_goes_on_keeps_the_precision_that_it_began_with(tmp_path, monkeypatch, began):
    """A run of version 0.1, whose default was double; and one of a rule that has changed."""
    whole = run(tmp_path / "whole", f"solver.precision={began}")
    folder = run(tmp_path / "run", f"solver.precision={began}", stop_after=20)
    monkeypatch.setattr(rule, "LEAST_SIDE", {"double": 1, "mixed": 100}[began])
    other = chosen(*SCENE[1:])
    assert other != began
    with pytest.raises(SceneError, match=r"solver\.precision = "):
        run_scene(
            load_scene(SCENE[0], [*SCENE[1:], f"solver.precision={other}"]), MPI.COMM_SELF, folder, print,
            Options(allow=("solver",)),
        )  # fmt: skip
    told = go_on(folder)
    assert f"solver.precision stays '{began}', with which this run began" in told
    assert not differences(whole, folder)
    assert (whole / SCENE_FILE).read_bytes() == (folder / SCENE_FILE).read_bytes()
    record = json.loads((folder / RUN_FILE).read_text())
    assert record["precision"] == began and record["links"][-1].get("changed", []) == []
    # Finished now: the same scene, and no other.
    assert "finished" in go_on(folder)[-1]
    (folder / "checkpoint.h5").unlink()
    assert "finished" in go_on(folder)[-1]


def test_what_was_chosen_is_what_runs(tmp_path, cheap):
    auto, given = run(tmp_path / "auto"), run(tmp_path / "given", MIXED)
    assert not differences(auto, given) and (auto / SCENE_FILE).read_bytes() == (given / SCENE_FILE).read_bytes()
    assert json.loads((auto / RUN_FILE).read_text())["precision"] == "mixed"
    again = load_scene(auto / SCENE_FILE)
    assert again.solver.precision == "mixed" and plan(auto, again, False, ()).record
    # On a grid this small it is not what double gives.
    assert differences(auto, run(tmp_path / "double", DOUBLE))


def test_a_scene_that_leaves_it_open_differs_from_none(tmp_path, cheap):
    old = load_scene(SCENE[0], [*SCENE[1:], DOUBLE])
    assert chosen(*SCENE[1:]) == "mixed"
    assert not list(differing(old.to_toml(), load_scene(SCENE[0], SCENE[1:])))
    head = {"scene": old.to_toml(), "files": {}}
    assert review(head, load_scene(SCENE[0], SCENE[1:]), (), tmp_path) == []
    given = load_scene(SCENE[0], [*SCENE[1:], MIXED])
    assert [key for key, _, _ in differing(old.to_toml(), given)] == ["solver.precision"]
