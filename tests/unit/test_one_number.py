"""One definition of each number of a tack test: every command tells the same, with its uncertainty; old folders;
turns."""

import dataclasses
import json
import re
import shutil

import numpy as np
import pytest
from mpi4py import MPI
from typer.testing import CliRunner

from pgfmd.analysis.pictures import overlay_figure
from pgfmd.analysis.summary import analyse
from pgfmd.cli import app
from pgfmd.commands.run import _summary
from pgfmd.files.packing import numbers_of, unpack
from pgfmd.plots.curves import plot_force
from pgfmd.results import load
from pgfmd.results.curve import Loop, branches, measure, turning_row
from pgfmd.runner import run_scene
from pgfmd.scene import load_scene
from pgfmd.solver.state import State
from tests.unit.analysis_loops import loop_of
from tests.unit.small_runs import run

STUDY = """scene = "tri-tack"
[set]
grid.n = 24
drive.preload = "1 mN"
drive.retract_speed = "100 um/s"
drive.turn_time = "0.2 s"
output.snapshots = []
[axes]
solver.accuracy = [0.01]
"""
QUICK = ("tri-tack", "grid.n=24", "drive.preload=1 mN", "drive.retract_speed=100 um/s", "drive.turn_time=0.2 s",
         "output.snapshots=[]")  # fmt: skip


def pgfmd(*arguments):
    done = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert done.exit_code == 0, (done.exception, done.output)
    return done.stdout


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """A study of one case that pulls off within its turn: the study's folder and file, the case's folder, the
    record."""
    out = tmp_path_factory.mktemp("study")
    (out / "plan.toml").write_text(STUDY)
    folder = out / "runs" / "accuracy-0.01"
    source, *changes = QUICK
    scene = load_scene(source, [*changes, "solver.accuracy=0.01"])
    record = run_scene(scene, MPI.COMM_SELF, folder, lambda line: None)
    return out, folder, json.loads(json.dumps(record))


def test_every_command_tells_the_same_numbers(quick, tmp_path):
    _, folder, record = quick
    pull_off, spread = record["pull_off_force_N"], record["pull_off_force_uncertainty_N"]
    assert 0.0 < spread < 0.2 * pull_off
    told = f"pull-off force {1e3 * pull_off:.4g} ± {1e3 * spread:.2g} mN"
    assert told in "\n".join(_summary(record, folder))
    table = json.loads(pgfmd("analyse", folder, "--json"))
    forces, work = table["forces"], table["work"]
    for key in ("preload_N", "largest_force_N", "pull_off_force_N", "pull_off_force_uncertainty_N", "snap_in_force_N",
                "snap_in_force_uncertainty_N", "time_to_preload_s"):  # fmt: skip
        assert forces[key] == record[key] is not None, key
    assert work["work_of_separation_J"] == record["work_of_separation_J"]
    assert work["work_of_separation_uncertainty_J"] == record["work_of_separation_uncertainty_J"]
    assert (work["hysteresis_J"], work["hysteresis_uncertainty_J"]) == (record["work_J"], record["work_uncertainty_J"])
    audit = table["hysteresis_by_the_energy_audit"]
    for mine, its in (("audit_work_J", "work_J"), ("audit_viscous_J", "viscous_J"), ("audit_released_J", "released_J")):
        assert audit[mine] == record[its]
    compared = pgfmd("compare", folder, "--out", tmp_path / "one.png")
    for name, key in (("pull-off force", "pull_off_force_N"), ("snap-in force", "snap_in_force_N"),
                      ("preload", "preload_N"), ("largest force", "largest_force_N"),
                      ("work of separation", "work_of_separation_J"), ("hysteresis", "work_J")):  # fmt: skip
        assert re.search(rf"^{name} +{re.escape(f'{record[key]:.5g}')} ", compared, re.MULTILINE), name


def test_studies_and_pictures_tell_the_same_numbers(quick):
    out, folder, record = quick
    pull_off, spread = record["pull_off_force_N"], record["pull_off_force_uncertainty_N"]
    collected = pgfmd("study", out / "plan.toml", "--out", out / "runs", "--collect")
    assert f"{1e3 * pull_off:.4g}" in collected
    header, row = (line.split(",") for line in (out / "runs" / "table.csv").read_text().splitlines())
    of_case = dict(zip(header, row, strict=True))
    for column, key in (("pull_off_force [N]", "pull_off_force_N"), ("largest_force [N]", "largest_force_N"),
                        ("pull_off_force_uncertainty [N]", "pull_off_force_uncertainty_N"),
                        ("work_uncertainty [J]", "work_uncertainty_J")):  # fmt: skip
        assert float(of_case[column]) == record[key]
    with load(folder) as results:
        lines = {line.get_label().split("  ")[0]: line for line in plot_force(results).axes[0].lines}
    for name, key, sign in (("pull-off", "pull_off_force_N", -1), ("snap-in", "snap_in_force_N", -1),
                            ("preload", "preload_N", 1)):  # fmt: skip
        assert lines[name].get_ydata().item() == sign * 1e3 * record[key]
    assert f"± {1e3 * spread:.2g} mN" in lines["pull-off"].get_label()


def test_a_pull_off_within_the_turn_is_found(quick):
    _, folder, record = quick
    loop = Loop.of(load(folder))
    lowest = int(np.argmin(loop.force))
    assert loop.phase[lowest] == "turn"
    turn = loop.turning_row
    assert loop.phase[turn] == "turn" and loop.displacement[turn] == loop.displacement.min() and turn < lowest
    rows = measure(dataclasses.replace(loop, recorded={})).pull_off
    assert rows.tension == pytest.approx(record["pull_off_force_N"], abs=rows.uncertainty)
    assert any(bulge.kind == "minimum" for bulge in analyse(folder).bulges)


def test_its_surface_at_the_largest_tension_is_kept(tmp_path):
    folder = run(tmp_path / "run", "drive.retract_speed=100 um/s")
    with load(folder) as results:
        place = results.labels.index("largest tension")
        kept, lowest = float(results.fields["force"][place]), float(np.min(results.curve["force [N]"]))
    assert kept == lowest < 0.0


def test_the_uncertainty_covers_what_a_finer_run_finds(tmp_path):
    keys = ("pull_off_force", "_N"), ("snap_in_force", "_N"), ("work_of_separation", "_J"), ("work", "_J")
    for scheme, accuracies in (("inertialess", (0.03, 0.003)), ("quasistatic", (0.03, 0.01))):
        found = []
        for accuracy in accuracies:
            changes = f"solver.scheme={scheme}", f"solver.accuracy={accuracy}", "output.patches=false"
            found.append(load(run(tmp_path / f"{scheme}-{accuracy}", *changes)).run)
        coarse, fine = found
        for key, unit in keys:
            spread = coarse[f"{key}_uncertainty{unit}"]
            assert abs(coarse[key + unit] - fine[key + unit]) < spread, (scheme, key)
            assert spread > fine[f"{key}_uncertainty{unit}"] > 0.0
        assert coarse["pull_off_force_uncertainty_N"] < 0.2 * coarse["pull_off_force_N"]
        parts = coarse["unbalanced_J"], coarse["jump_places_J"]
        if scheme == "quasistatic":
            left = coarse["energy_residual"] * abs(coarse["work_J"])
            assert coarse["work_uncertainty_J"] == pytest.approx(sum(parts) + left, rel=1e-12) and min(parts) > 0.0
        else:
            assert parts == (None, None)


def test_explicit_steps_have_no_accuracy_to_tell_an_uncertainty_from(tmp_path):
    folder = run(tmp_path / "run", "solver.scheme=gfmd", "drive.speed=2 mm/s", "solver.max_steps=20")
    record = load(folder).run
    assert record["snap_in_force_uncertainty_N"] is None and record["work_uncertainty_J"] is None


def test_what_is_not_known_is_not_told_as_a_number(tmp_path):
    changes = ["grid.n=20", "drive.preload=0.5 mN", "output.snapshots=[]", "output.energy=false"]
    record = run_scene(load_scene("tri-tack", changes), MPI.COMM_SELF, tmp_path, lambda line: None)
    assert record == json.loads((tmp_path / "run.json").read_text())
    assert record["work_of_separation_uncertainty_J"] is None and record["pull_off_force_uncertainty_N"] > 0.0
    (line,) = (line for line in _summary(record, tmp_path) if line.startswith("pull-off force"))
    assert "nan" not in line and line.count("±") == 1


def test_folders_of_before_are_read(quick, tmp_path):
    _, folder, record = quick
    old = tmp_path / "old"
    old.mkdir()
    for file in folder.iterdir():
        if file.suffix in (".csv", ".toml"):
            (old / file.name).write_bytes(file.read_bytes())
    new = ("largest_force_N", *(key for key in record if "uncertainty" in key))
    (old / "run.json").write_text(json.dumps({key: value for key, value in record.items() if key not in new}))
    mine, its = measure(Loop.of(load(old))), measure(Loop.of(load(folder)))
    assert mine.largest_force == its.largest_force
    for one, other in ((mine.pull_off, its.pull_off), (mine.snap_in, its.snap_in)):
        assert one.tension == other.tension and one.uncertainty == pytest.approx(other.uncertainty, rel=1e-9)
    # Without a record, as of a run that goes on, by rows.
    (old / "run.json").unlink()
    rows = measure(Loop.of(load(old)))
    assert rows.pull_off.tension == pytest.approx(its.pull_off.tension, abs=rows.pull_off.uncertainty)


def test_a_checkpoint_without_the_new_numbers_is_read_and_they_stay_unknown():
    state = State(*(np.zeros(0) for _ in range(5)), position=0.0)
    state.pull_off_force = -1e-3
    packed = numbers_of(state)
    for name in ("largest_force", "pull_off_at_ends", "snap_in_at_ends"):
        del packed[name]
    other = State(*(np.zeros(0) for _ in range(5)), position=0.0)
    unpack(other, packed, lambda name, share: None)
    assert other.pull_off_force == -1e-3
    assert np.isnan([max(other.largest_force, 2.0), min(other.pull_off_at_ends, -2.0)]).all()
    del packed["pull_off_force"]
    with pytest.raises(KeyError):
        unpack(other, packed, lambda name, share: None)


def test_the_retraction_begins_where_the_punch_turns():
    phase = np.array(["approach"] * 3 + ["turn"] * 4 + ["retract"] * 2)
    place = np.array([0.0, -1, -2, -2.2, -2.3, -2.2, -1.5, -1, 0])
    assert turning_row(place, phase) == 4
    assert branches(place, phase) == {"approach": slice(0, 5), "retraction": slice(4, 9)}
    # The end of a dwell; a drive that turns at once; an approach that goes on.
    held = np.array(["approach"] * 2 + ["turn"] + ["dwell"] * 2 + ["turn", "retract"])
    assert turning_row(np.array([0.0, -1, -1.1, -1.1, -1.1, -1, 0]), held) == 4
    assert turning_row(np.array([0.0, -1, 0]), np.array(["approach", "approach", "retract"])) == 1
    assert turning_row(place[:3], phase[:3]) == 3 and not loop_of(place[:3], -place[:3], 3).retracted
    assert not Loop.retracted.fget(dataclasses.replace(loop_of(place[:5], -place[:5], 5), phase=phase[:5]))


def test_a_run_that_goes_on_has_not_said_its_last_word(quick, tmp_path):
    _, folder, record = quick
    live = tmp_path / "live"
    shutil.copytree(folder, live)
    (live / "run.json").unlink()
    lines = (live / "curve.csv").read_text().splitlines(keepends=True)
    falling = max(k for k, line in enumerate(lines[1:], 1) if float(line.split(",")[3]) > 0.0) + 1
    (live / "curve.csv").write_text("".join(lines[: falling + 1]))
    analysis = analyse(live)
    assert 0.0 < analysis.measures.pull_off.tension < record["pull_off_force_N"]
    assert analysis.measures.pull_off.uncertainty is None
    assert any(text.startswith("the run has not ended yet: pull-off force") for text in analysis.table.remarks)
    assert not any("ended" in text for text in analyse(folder).table.remarks)


def test_legends_say_what_was_done_to_curves():
    loop = loop_of([0, -4e-6, 0, 2e-6], [0, 3e-3, -1e-3, -1e-3], 2)
    changes = ["as simulated", "− F/k_M (38.1 kN/m)", ", ".join(["pushed in by 0.5 um"] * 6)]
    figure = overlay_figure([loop] * 3, 1, changes)
    (legend,) = figure.legends
    assert [text.get_text().replace("\n", " ") for text in legend.get_texts()] == [f"made: {text}" for text in changes]
    # Within the picture, and above the curves.
    figure.draw_without_rendering()
    place, axis = legend.get_window_extent(), figure.axes[0].get_window_extent()
    assert place.x1 < figure.bbox.x1 and place.y0 > axis.y1 and axis.width > 0.8 * figure.bbox.width
