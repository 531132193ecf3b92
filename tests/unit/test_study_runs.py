"""Studies: how cases stand, what is run, in which order, what becomes of failures and signals; table and figures."""

import csv
import json
import os
import shutil
import signal
import sys
import time
from pathlib import Path

import pytest
from typer.testing import CliRunner

import pgfmd
from pgfmd import cli
from pgfmd.errors import LaunchError, ResultError
from pgfmd.host.run_lock import RunLock
from pgfmd.plots.numbers import plot_numbers
from pgfmd.restart.bitwise_comparison import differences
from pgfmd.restart.checkpoint_policy import OUT_OF_TIME
from pgfmd.results import load
from pgfmd.results.reading import runs_in
from pgfmd.studies import pool as pool_module
from pgfmd.studies.campaign import Campaign, Unfinished, Wishes
from pgfmd.studies.case_state import CaseState, case_state_of
from pgfmd.studies.cases import cases_of
from pgfmd.studies.pictures import Plan, curves_figure, draw_study, measures_figure
from pgfmd.studies.pool import Pool, Task, last_words
from pgfmd.studies.study_file import StudyError, study_from_mapping
from pgfmd.studies.table import COLUMNS, MEASURED, StudyTable, overview, remarks, rows_of, write_table
from tests.unit.small_runs import SCENE, damage_an_array, run

COMMON = {"grid": {"n": 24}, "output": {"snapshots": ["1 s"]}}
SPEEDS, PRELOADS = ["1 um/s", "2 um/s"], ["1 mN", "2 mN"]
MAPPING = {
    "scene": SCENE[0], "set": COMMON, "axes": {"drive.preload": PRELOADS, "drive.speed": SPEEDS},
    "case": [{"name": "beside", "set": {"drive.preload": "1.5 mN"}}],
}  # fmt: skip


@pytest.fixture(scope="module")
def study():
    return study_from_mapping(MAPPING, "small.toml", Path("."))


@pytest.fixture(scope="module")
def runs(study, tmp_path_factory):
    """Every case of the study finished, but the last of the grid, which was stopped."""
    folder = tmp_path_factory.mktemp("runs")
    for case in cases_of(study):
        changes = [f"drive.preload={case.scene.drive.preload!r} N", f"drive.speed={case.scene.drive.speed!r} m/s"]
        stop = {"stop_after": 20} if case.name == "preload-2mN_speed-2um-s" else {}
        run(folder / case.name, *changes, **stop)
    return folder


@pytest.fixture
def campaign(study, runs, tmp_path):
    """The cases with copies of their results, and what was said."""
    said = []
    found = Campaign(cases_of(study), shutil.copytree(runs, tmp_path / "out"), say=said.append)
    found.said = said
    return found


FIRST, LAST = "preload-1mN_speed-1um-s", "preload-2mN_speed-2um-s"


# -- how cases stand ---------------------------------------------------------------------------------------------------


def test_standings_are_those_of_the_runs(campaign):
    states = campaign.states()
    assert [case_state.state for case_state in states.values()] == ["finished"] * 3 + ["resumable", "finished"]
    assert states[FIRST].complete and states[FIRST].record["steps"] > 0 and str(states[FIRST]) == "finished"
    shutil.rmtree(campaign.out / FIRST)
    (campaign.out / "beside" / "checkpoint.h5").unlink()
    states = campaign.states()
    assert states[FIRST].state == "new" and states["beside"].state == "finished"
    assert [case.name for case in campaign.agenda(states)] == [FIRST, LAST]


def test_a_run_that_failed_is_left_unless_asked_for(campaign):
    record = json.loads((campaign.out / FIRST / "run.json").read_text())
    stopped = campaign.out / LAST
    (stopped / "run.json").write_text(json.dumps(record | {"finished": "failed", "error": "no equilibrium"}))
    states = campaign.states()
    assert (states[LAST].state, states[LAST].why) == ("failed", "no equilibrium")
    assert campaign.agenda(states) == []
    campaign.wishes = Wishes(retry=True)
    assert [case.name for case in campaign.agenda(states)] == [LAST]


def test_changed_settings_are_refused_in_the_words_of_the_run(campaign, study, monkeypatch):
    changed = MAPPING | {"set": COMMON | {"solver": {"accuracy": 5e-3}}}
    later = Campaign(cases_of(study_from_mapping(changed, "small.toml", Path("."))), campaign.out, say=campaign.say)
    states = later.states()
    assert {case_state.state for case_state in states.values()} == {"changed"} and later.agenda(states) == []
    why = states[FIRST].why
    assert "solver.accuracy = 0.005: expected 0.01" in why and "--allow solver.accuracy" in why
    with pytest.raises(Unfinished, match="--fresh starts it anew") as caught:
        later.run(1, 1)
    assert caught.value.exit_code == 3
    # Only the one that has not finished may go on with it.
    later.wishes = Wishes(allow=("solver.accuracy",))
    assert LAST in [case.name for case in later.agenda(later.states())]
    later.wishes = Wishes(fresh=True)
    chosen = later.agenda(states)
    assert len(chosen) == 5
    later.clear_folders(chosen[:1], states)
    assert (later.out / FIRST / "previous-1" / "curve.csv").exists() and later.states()[FIRST].state == "new"
    assert not (later.out / FIRST / "run.lock").exists()


def test_a_title_may_change(campaign, study):
    case = campaign.cases[0]
    renamed = type(case)(case.name, case.source, case.overrides, case.scene.model_copy(update={"title": "other"}))
    assert case_state_of(renamed, campaign.folder(case)).state == "finished"


def test_damaged_and_foreign_folders_and_runs_in_use(campaign):
    for name in ("checkpoint.h5", "checkpoint.previous.h5"):
        path = campaign.out / LAST / name
        if path.exists():
            path.write_bytes(b"nothing")
    shutil.rmtree(campaign.out / FIRST)
    (campaign.out / FIRST).mkdir()
    (campaign.out / FIRST / "letter.doc").write_text("dear")
    lock = RunLock.acquire(campaign.out / "beside", 1)
    try:
        states = campaign.states()
    finally:
        lock.release()
    assert states[LAST].state == states[FIRST].state == "damaged"
    assert "not a results folder" in states[FIRST].why
    assert campaign.agenda(states) == []


def test_only_some_cases(campaign):
    assert [case.name for case in campaign.only(["*_speed-1um-s", "beside"]).cases] == [
        FIRST, "preload-2mN_speed-1um-s", "beside",
    ]  # fmt: skip
    assert campaign.only([]) is campaign
    with pytest.raises(StudyError, match=r"--only besid: no case has such a name; did you mean beside\?"):
        campaign.only(["besid"])


# -- the pool ----------------------------------------------------------------------------------------------------------

OBEDIENT = """
import os, signal, sys, time
signal.signal(signal.SIGUSR1, lambda number, frame: sys.exit(75))
print("pgfmd: stopped by USR1", flush=True)
open(sys.argv[-1] + ".up", "w").close()
time.sleep(60)
"""
ENDING = "import sys; print(sys.argv[-2]); sys.exit(int(sys.argv[-1]))"


def tasks(folder, *arguments):
    return [
        Task(f"t{k}", tuple(map(str, own)), folder / f"t{k}", folder / f"t{k}.log") for k, own in enumerate(arguments)
    ]


def in_place_of_a_run(monkeypatch, program):
    monkeypatch.setattr(pool_module, "program", lambda: [sys.executable, "-c", program])


def test_a_failure_stops_no_other_job(monkeypatch, tmp_path):
    in_place_of_a_run(monkeypatch, ENDING)
    found, said = {}, []
    Pool(jobs=2, say=said.append).run(
        tasks(tmp_path, ("fine", 0), ("pgfmd: no equilibrium\n  - key: why\nnoise", 3), ("Killed", 137), ("fine", 0)),
        lambda task, ending: found.__setitem__(task.name, (ending.code, ending.why)),
    )
    assert found["t1"] == (3, "no equilibrium\n  - key: why") and found["t2"] == (137, "Killed")
    assert found["t0"][0] == found["t3"][0] == 0 and said == [f"t{k}: started" for k in range(4)]
    assert "t1.log" in {path.name for path in tmp_path.iterdir()}
    # A second start says more in the same log, and its own last words count.
    log = tmp_path / "t1.log"
    size = log.stat().st_size
    log.write_bytes(log.read_bytes() + b"Bus error\n")
    assert last_words(log, size) == "Bus error" and last_words(log, size + 10) == "it said nothing"


def test_no_more_than_so_many_at_once_and_all_stopped_by_a_signal(monkeypatch, tmp_path):
    in_place_of_a_run(monkeypatch, OBEDIENT)
    said, codes, before = [], [], signal.getsignal(signal.SIGTERM)
    pool = Pool(jobs=2, say=said.append)
    real = pool._answer

    def answer():
        if len(list(tmp_path.glob("*.up"))) == 2 and not pool.stopped and not pool._signals:
            os.kill(os.getpid(), signal.SIGTERM)
        real()

    monkeypatch.setattr(pool, "_answer", answer)
    began = time.monotonic()
    pool.run(tasks(tmp_path, *[(tmp_path / f"{k}",) for k in range(4)]), lambda task, ending: codes.append(ending.code))
    assert codes == [75, 75] and pool.stopped == "TERM" and time.monotonic() - began < 30.0
    assert [line for line in said if line.endswith("started")] == ["t0: started", "t1: started"]
    assert any("stopping 2 jobs with a checkpoint" in line for line in said)
    assert signal.getsignal(signal.SIGTERM) is before


def test_jobs_that_do_not_stop_are_killed_on_a_second_signal(monkeypatch, tmp_path):
    in_place_of_a_run(monkeypatch, OBEDIENT.replace("sys.exit(75)", "None") + "signal.pause()")
    monkeypatch.setattr(pool_module, "KILL_AFTER", 0.0)
    codes, pool = [], Pool(say=lambda line: None)
    real = pool._answer

    def answer():
        if list(tmp_path.glob("*.up")) and not pool._signals:
            os.kill(os.getpid(), signal.SIGINT)
        real()

    monkeypatch.setattr(pool, "_answer", answer)
    pool.run(tasks(tmp_path, (tmp_path / "0",)), lambda task, ending: codes.append(ending.code))
    assert codes[0] in (-signal.SIGTERM, -signal.SIGKILL) and pool.stopped == "Ctrl-C"


def test_nothing_more_is_started_when_a_limit_of_time_has_come(monkeypatch, runs, tmp_path):
    in_place_of_a_run(monkeypatch, ENDING)
    codes, pool = [], Pool(say=lambda line: None)
    run(tmp_path / "t0", stop_after=20, stop_for=OUT_OF_TIME)
    pool.run(tasks(tmp_path, ("stopped", 75), ("fine", 0)), lambda task, ending: codes.append(ending.code))
    assert codes == [75] and pool.stopped == "the limit of time"
    # A job that somebody has stopped by hand is nothing to the others, whatever it says.
    codes.clear()
    shutil.rmtree(tmp_path / "t0")
    shutil.copytree(runs / LAST, tmp_path / "t0")
    pool = Pool(say=lambda line: None)
    words = "pgfmd: stopped by the limit of time after step 7"
    pool.run(tasks(tmp_path, (words, 75), ("fine", 0)), lambda task, ending: codes.append(ending.code))
    assert codes == [75, 0] and pool.stopped == ""


def test_a_missing_mpirun_is_told_before_anything_starts(monkeypatch, tmp_path):
    in_place_of_a_run(monkeypatch, ENDING)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(LaunchError, match="mpirun is not there, and each job wants 2 ranks"):
        Pool(ranks=2).run(tasks(tmp_path, ("fine", 0)), lambda task, ending: None)
    assert not list(tmp_path.glob("*.log"))
    codes, pool = [], Pool(ranks=1, say=lambda line: None)
    pool.run(tasks(tmp_path, ("fine", 0)), lambda task, ending: codes.append(ending.code))
    assert codes == [0]


# -- the command -------------------------------------------------------------------------------------------------------


def command(capsys, *arguments):
    """Exit code, stdout and stderr of `pgfmd`."""
    with pytest.raises(SystemExit) as caught:
        cli.main(list(map(str, arguments)))
    return caught.value.code, *capsys.readouterr()


def study_file(folder, text=""):
    path = folder / "small.toml"
    path.write_text(
        f'scene = "tri-tack"\nset.grid.n = 24\nset.output.snapshots = ["1 s"]\n{text}\n'
        '[axes]\ndrive.preload = ["1 mN", "2 mN"]\ndrive.speed = ["1 um/s", "2 um/s"]\n'
        '[[case]]\nname = "beside"\nset.drive.preload = "1.5 mN"\n'
    )
    return path


def test_a_study_goes_on_and_leaves_what_is_finished(campaign, tmp_path, capsys):
    before = {name: (campaign.out / name / "run.json").stat().st_mtime_ns for name in (FIRST, "beside")}
    path = study_file(tmp_path)
    code, said, _ = command(capsys, "study", path, "--out", campaign.out, "--dry-run")
    assert code == 0 and said.count("to run  ") == 1 and f"to run  {LAST}: resumable" in said
    code, said, complaints = command(capsys, "study", path, "--out", campaign.out)
    assert code == 0 and complaints == "" and "[1/1] " + LAST + ": finished, pull-off" in said
    assert before == {name: (campaign.out / name / "run.json").stat().st_mtime_ns for name in before}
    alone = run(tmp_path / "alone", "drive.preload=2 mN", "drive.speed=2 um/s")
    assert differences(alone, campaign.out / LAST) == []
    rows = list(csv.DictReader((campaign.out / "table.csv").read_text().splitlines()))
    assert {row["state"] for row in rows} == {"finished"} and len(rows) == 5
    assert float(rows[3]["pull_off_force [N]"]) == load(campaign.out / LAST).run["pull_off_force_N"]
    assert {"curves.png", "measures.png", f"{LAST}.log"} <= {path.name for path in campaign.out.iterdir()}


def test_what_is_wrong_is_told_before_anything_starts(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = study_file(tmp_path, 'set.drive.turn_time = "1 mN"')
    code, _, complaints = command(capsys, "study", path)
    assert code == 2 and "drive.turn_time = '1 mN'" in complaints and "and 2 more" in complaints
    assert not (tmp_path / "out").exists()
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    code, _, complaints = command(capsys, "study", study_file(tmp_path))
    assert code == 1 and "start it without mpirun" in complaints


@pytest.mark.parametrize(
    ("options", "said"),
    [(["--checkpoint-every", "often"], "--checkpoint-every"), (["--collect", "--slurm"], "--collect"),
     (["--sbatch-options", "--time=1"], "--slurm"), (["--allow", "grid.m"], "--allow"), (["--only", "x"], "--only")],
)  # fmt: skip
def test_options_that_make_no_sense(options, said, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, complaints = command(capsys, "study", study_file(tmp_path), *options)
    assert code == 2 and said in complaints and not (tmp_path / "out").exists()


def test_convergence_of_runs_that_are_there(tmp_path, capsys):
    out = tmp_path / "out"
    for accuracy in (1e-2, 5e-3, 2.5e-3, 1.25e-3):
        run(out / f"accuracy-{accuracy:.6g}", "output.snapshots=[]", f"solver.accuracy={accuracy!r}")
    changes = ["grid.n=24", "drive.preload=1 mN", "output.snapshots=[]"]
    options = ["--axis", "accuracy", "--factor", "2", "--out", out, "--quantity", "work"]
    code, said, complaints = command(capsys, "converge", "tri-tack", *changes, *options)
    assert code == 0 and complaints == "" and "4 cases in" in said and "started" not in said
    record = json.loads((out / "converge.json").read_text())
    assert [level["size"] for level in record["levels"]] == [1e-2, 5e-3, 2.5e-3, 1.25e-3]
    assert record["fixed"] is None and record["quantity"] == "work"
    works = [load(out / f"accuracy-{accuracy:.6g}").run["work_of_separation_J"] for accuracy in (1e-2, 1.25e-3)]
    assert [record["levels"][0]["value"], record["levels"][-1]["value"]] == works
    assert abs(record["free"]["limit"] / works[1] - 1.0) < 0.02
    assert (out / "converge.png").exists() and (out / "table.csv").exists()


# -- table and figures -------------------------------------------------------------------------------------------------


def test_the_table(campaign, study, tmp_path):
    rows = rows_of(campaign.cases, study.axes, campaign.states())
    write_table(tmp_path / "table.csv", rows, study.axes)
    found = list(csv.DictReader((tmp_path / "table.csv").read_text().splitlines()))
    assert list(found[0]) == ["case", "drive.preload [N]", "drive.speed [m/s]", "state", *COLUMNS]
    assert [float(row["drive.preload [N]"]) for row in found] == [1e-3, 1e-3, 2e-3, 2e-3, 1.5e-3]
    assert found[3]["state"] == "resumable (stopped by USR1)" and found[3]["work [J]"] == ""
    record = load(campaign.out / "beside").run
    for column, key in MEASURED.items():
        assert float(found[4][column]) == record[key], column
    lines = overview(rows)
    assert len(lines) == 6 and f"{record['pull_off_force_N'] * 1e3:.4g}" in lines[-1]


def test_a_curve_that_is_lost_is_told_of(campaign, study):
    (campaign.out / "beside" / "curve.csv").unlink()
    rows = rows_of(campaign.cases, study.axes, campaign.states(), campaign.out)
    (told,) = remarks(rows)
    assert told.startswith("beside has no areas and is in no picture of curves: ") and "curve.csv" in told
    assert rows[0].measured["contact_area_at_preload [m^2]"] > 0.0


def test_bundles_and_words_in_the_table():
    mapping = {
        "scene": "tri-tack", "set": {"grid": {"n": 24}},
        "axes": {
            "solver.precision": ["double", "mixed"],
            "material": {"hard": {"rheology.modulus_ratio": 900.0}, "as is": {}},
        },
        "case": [{"name": "beside", "set": {"solver.precision": "single"}}],
    }  # fmt: skip
    study = study_from_mapping(mapping, "s.toml", Path("."))
    cases = cases_of(study)
    rows = rows_of(cases, study.axes, {case.name: CaseState("new") for case in cases})
    assert [tuple(row.places.values()) for row in rows] == [
        ("double", "hard"), ("double", "as is"), ("mixed", "hard"), ("mixed", "as is"), ("single", None),
    ]  # fmt: skip
    assert measures_figure(Plan(rows, study.axes), "") is None


def test_the_figures_show_every_case(campaign, study):
    rows = rows_of(campaign.cases, study.axes, campaign.states())
    plan = Plan(rows, study.axes)
    figure = curves_figure(campaign.out, plan, "a title")
    titles = [axis.get_title() for axis in figure.axes]
    assert titles == ["speed  1 um/s", "speed  2 um/s", "further cases"]
    lines = figure.axes[0].lines
    curve = load(campaign.out / FIRST).curve
    drawn = {float(x) for line in lines for x in line.get_xdata()}
    assert drawn >= {float(x) for x in 1e6 * curve["indentation [m]"]}
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["preload", "1 mN", "2 mN"]
    # The one that was stopped has a curve, but no numbers.
    assert len([line for line in figure.axes[1].lines if len(line.get_xdata()) > 2]) >= 3
    panel = measures_figure(plan, "").axes[0]
    by_label = {line.get_label(): line for line in panel.lines}
    assert set(by_label) == {"speed 1 um/s", "speed 2 um/s", "beside"}
    record = load(campaign.out / FIRST).run
    slow = by_label["speed 1 um/s"]
    assert list(slow.get_xdata()) == [1e-3, 2e-3]
    assert slow.get_ydata()[0] == pytest.approx(1e3 * record["pull_off_force_N"])
    assert len(by_label["speed 2 um/s"].get_xdata()) == 1
    assert panel.get_xlabel() == "preload (mN)" and panel.get_ylabel() == "pull-off force (mN)"


def test_figures_without_a_curve_are_left_out(campaign, study, tmp_path):
    cases = {case.name: CaseState("new") for case in campaign.cases}
    assert draw_study(StudyTable(rows_of(campaign.cases, study.axes, cases), study.axes, tmp_path)) == []
    damage_an_array(campaign.out / FIRST / "checkpoint.h5")
    (campaign.out / FIRST / "curve.csv").write_text("nonsense\n")
    assert (
        len(draw_study(StudyTable(rows_of(campaign.cases, study.axes, campaign.states()), study.axes, campaign.out)))
        == 2
    )


# -- from Python -------------------------------------------------------------------------------------------------------


def test_a_study_from_python_is_that_of_the_command(campaign, study, tmp_path):
    table = pgfmd.study(MAPPING, out=campaign.out, run=False)
    expected = rows_of(campaign.cases, study.axes, campaign.states(), campaign.out)
    assert table.rows == expected and len(table) == 5 and str(table).splitlines() == overview(expected)
    assert table["case"][0] == FIRST and table["drive.preload [N]"] == [1e-3, 1e-3, 2e-3, 2e-3, 1.5e-3]
    assert table["pull_off_force [N]"][0] == load(campaign.out / FIRST).run["pull_off_force_N"]
    table.to_csv(tmp_path / "table.csv")
    lines = list(csv.DictReader((tmp_path / "table.csv").open()))
    assert [line["case"] for line in lines] == table["case"] and list(lines[0]) == table.columns
    frame = table.to_dataframe()
    assert list(frame.columns) == table.columns and frame["state"].tolist() == [row["state"] for row in table]
    assert "<td>beside</td>" in table._repr_html_()
    with pytest.raises(KeyError, match=r"expected one of case, drive.preload \[N\]"):
        table["nonsense"]
    for draw in (pgfmd.plot_study_curves, pgfmd.plot_study_numbers):
        assert "out  ·  4 of 5 cases are finished" in [text.get_text() for text in draw(table).texts]


def test_a_study_is_made_of_a_scene_in_memory(tmp_path):
    scene = pgfmd.Scene("tri-tack", grid={"n": 24}, drive={"preload": "1 mN"})
    axes = {"drive.speed": [1e-6, "2 um/s"], "material": {"hard": {"rheology": {"modulus_ratio": 900}}, "as it is": {}}}
    cases = {"slow": {"drive.speed": 1.23456789e-7}}
    table = pgfmd.study(scene, axes, cases=cases, out=tmp_path / "out", run=False)
    assert table["case"] == [
        "speed-1um-s_hard",
        "speed-1um-s_as-it-is",
        "speed-2um-s_hard",
        "speed-2um-s_as-it-is",
        "slow",
    ]
    assert table["drive.speed [m/s]"] == [1e-6, 1e-6, 2e-6, 2e-6, 1.23456789e-7] and set(table["state"]) == {"new"}
    made = table.rows[2].case.scene
    assert made == scene.replace(drive={"speed": 2e-6}, rheology={"modulus_ratio": 900})
    # What is automatic stays so: the range follows a grid that a case has changed.
    finer = pgfmd.study(scene, {"grid.n": [24, 96]}, out=tmp_path / "finer", run=False).rows[1].case.scene
    assert finer.adhesion.range == pytest.approx(scene.adhesion.range / 2)
    with pytest.raises(ValueError, match="out names the folder"):
        pgfmd.study(scene, axes)
    with pytest.raises(ValueError, match="out names the folder"):
        pgfmd.converge(scene)
    with pytest.raises(StudyError, match="checkpoint_every = 'now'"):
        pgfmd.study(MAPPING, out=tmp_path / "out", checkpoint_every="now")
    with pytest.raises(StudyError, match=r"drive\.sped.*did you mean drive\.speed"):
        pgfmd.study("tri-tack", {"drive.sped": [1.0]}, out=tmp_path / "out")


# -- several runs in one picture ---------------------------------------------------------------------------------------


def test_numbers_of_runs_against_a_key_with_error_bars(runs):
    folders = runs_in(runs)
    axis = plot_numbers(*folders, x="preload").axes[0]
    records = {folder.name: load(folder).run for folder in folders}
    # A line for each speed; the case beside the grid has that of the first.
    first, second = axis.containers
    assert [first.get_label(), second.get_label()] == ["speed 1 µm/s", "speed 2 µm/s"]
    place, force = first.lines[0].get_data()
    assert list(place) == [1.0, 1.5, 2.0] and axis.get_xlabel() == "drive.preload (mN)"
    assert force[0] == pytest.approx(1e3 * records[FIRST]["pull_off_force_N"])
    low, high = first.lines[2][0].get_segments()[0][:, 1]
    assert (high - low) / 2 == pytest.approx(1e3 * records[FIRST]["pull_off_force_uncertainty_N"])
    assert len(second.lines[0].get_xdata()) == 1
    # Which key, if nobody says it.
    alone = [runs / FIRST, runs / "beside"]
    assert plot_numbers(*alone, y="loop", log="xy").axes[0].get_xscale() == "log"
    with pytest.raises(
        ResultError, match=r"they differ in (drive\.speed, drive\.preload|drive\.preload, drive\.speed)"
    ):
        plot_numbers(*folders)
    with pytest.raises(ResultError, match="no key of these scenes"):
        plot_numbers(*folders, x="sped")
    with pytest.raises(ValueError, match="expected one of pull-off"):
        plot_numbers(*folders, y="pull")


def test_the_command_draws_several_runs_and_studies(runs, tmp_path):
    ask = CliRunner().invoke
    done = ask(cli.app, ["plot", str(runs), "-o", str(tmp_path / "all")])
    assert done.exit_code == 0, done.output
    assert sorted(path.name for path in (tmp_path / "all").iterdir()) == ["curves.png", "time.png"]
    two = [str(runs / FIRST), str(runs / "beside"), "-o", str(tmp_path)]
    assert ask(cli.app, ["plot", *two, "--x", "preload", "--format", "svg", "--width", "single"]).exit_code == 0
    assert "<svg" in (tmp_path / "pull-off-preload.svg").read_text()
    assert ask(cli.app, ["plot", *two, "--x", "time", "--y", "contact", "--log", "x", "--format", "pdf"]).exit_code == 0
    assert (tmp_path / "contact-time.pdf").read_bytes().startswith(b"%PDF")
    wrong = ask(cli.app, ["plot", *two, "--y", "nonsense"])
    assert wrong.exit_code == 2
    assert isinstance(ask(cli.app, ["plot", str(tmp_path)]).exception, ResultError)
