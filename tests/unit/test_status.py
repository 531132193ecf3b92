"""How the run in a folder stands: every state, why it ended, how far it has come, what is left."""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace

import pytest
from mpi4py import MPI

from pgfmd import cli
from pgfmd.commands import status as status_command
from pgfmd.errors import Problem, ResultError, RunError, SceneError
from pgfmd.files.table_reading import CurveTail, count_ends
from pgfmd.files.tables import CURVE
from pgfmd.forecast.progress import Moment, outlook
from pgfmd.host import run_lock
from pgfmd.host.launchers import environment_without
from pgfmd.host.run_lock import Holder, RunLock
from pgfmd.restart.checkpoint_layout import read_head
from pgfmd.results.status import Mark, _pace, status_of
from pgfmd.runner import run_scene
from pgfmd.scene import load_scene
from tests.unit.small_runs import damage_an_array, flip, run

STOPPED_AT = 20


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A finished run, and one stopped on its way in."""
    folder = tmp_path_factory.mktemp("runs")
    run(folder / "finished")
    run(folder / "stopped", stop_after=STOPPED_AT)
    return folder


def left_by_the_dead(folder):
    """Leaves a lock in a folder whose process is gone."""
    code = (
        "import os, sys; from pathlib import Path; from pgfmd.host.run_lock import RunLock; "
        "RunLock.acquire(Path(sys.argv[1]), 3); os._exit(9)"
    )
    subprocess.run([sys.executable, "-c", code, str(folder)], timeout=60)


def add_rows(folder, count, **changes):
    """Adds rows to the curve as a run does that goes on, each a second later; returns the last one."""
    path = folder / "curve.csv"
    last = CurveTail(path).rows[-1]
    with open(path, "a", encoding="utf-8") as file:
        for _ in range(count):
            last = replace(last, time=last.time + 1.0, displacement=last.displacement - 1e-8, **changes)
            file.write(",".join(str(getattr(last, name)) for name in last.__dataclass_fields__) + "\n")
    return last


def break_seal(path):
    flip(path, 10)


# -- states ------------------------------------------------------------------------------------------------------------


def test_finished_says_how(finished):
    found = status_of(finished)
    assert (found.state, found.why, found.warnings) == ("finished", "detached", [])
    record = json.loads((finished / "run.json").read_text())
    assert (found.steps, found.ranks, found.links) == (record["steps"], 1, 1)
    assert found.title == "Tack test, triangular corrugation" and found.left_s is None
    head = read_head(finished / "checkpoint.h5")
    assert (found.time_s, found.displacement_m) == (head["state"]["time"], head["state"]["position"])
    assert found.wall_s == head["links"][0]["wall_s"] > 0.0
    assert found.checkpoint["bytes"] == (finished / "checkpoint.h5").stat().st_size


@pytest.mark.parametrize(
    ("change", "why"), [("solver.max_steps=7", "max_steps reached"), ("drive.preload=1e9 N", "preload not reached")]
)
def test_finished_early_says_why(change, why, tmp_path):
    more = ["punch.radius=100 um", "drive.speed=1 mm/s"] if "preload" in change else []
    found = status_of(run(tmp_path / "run", change, *more))
    assert (found.state, found.why) == ("finished", why)


def test_finished_without_its_checkpoints(finished):
    (finished / "checkpoint.h5").unlink()
    found = status_of(finished)
    assert (found.state, found.why, found.checkpoint) == ("finished", "detached", None)
    assert found.steps == json.loads((finished / "run.json").read_text())["steps"]


def test_finished_without_its_record_goes_on(finished):
    (finished / "run.json").unlink()
    found = status_of(finished)
    assert (found.state, found.why) == ("resumable", "detached, only its record is missing")


def test_stopped_is_resumable(stopped):
    found = status_of(stopped)
    assert found.state == "resumable" and found.why.startswith("stopped by ") and found.holder is None
    assert (found.phase, found.steps, found.preload_N) == ("approach", STOPPED_AT, 1e-3)
    assert 0.05 < found.progress < 0.5 and found.left_s > 0.0 and found.left_remark == ""


def test_killed_leaves_a_stale_lock(stopped):
    left_by_the_dead(stopped)
    add_rows(stopped, 3)
    found = status_of(stopped)
    assert found.state == "resumable" and found.why.startswith("killed or lost: process ")
    # Where it goes on from, not where it was.
    assert found.steps == STOPPED_AT and found.time_s == read_head(stopped / "checkpoint.h5")["state"]["time"]


def test_rows_after_the_checkpoint_tell_of_an_error(stopped):
    add_rows(stopped, 1)
    assert status_of(stopped).why == "ended by an error after its last checkpoint: see its output"


def test_failed_has_its_message(tmp_path, monkeypatch):
    from pgfmd.schemes.inertialess.controller import Controller

    advance, calls = Controller.advance, []

    def fail_later(self, state, *rest):
        calls.append(1)
        if state.counters.steps == 12 and len(calls) > 12:
            raise RunError("no equilibrium in step 13: lower solver.accuracy")
        return advance(self, state, *rest)

    monkeypatch.setattr(Controller, "advance", fail_later)
    with pytest.raises(RunError):
        run(tmp_path / "run", "output.snapshots=[]")
    found = status_of(tmp_path / "run")
    assert (found.state, found.why) == ("resumable", "failed: no equilibrium in step 13: lower solver.accuracy")
    for name in ("checkpoint.h5", "checkpoint.previous.h5"):
        (tmp_path / "run" / name).unlink(missing_ok=True)
    found = status_of(tmp_path / "run")
    assert found.state == "damaged"
    failure = "failed: no equilibrium in step 13: lower solver.accuracy"
    assert found.why == f"results, but no checkpoint to go on from; {failure}"


def test_the_checkpoint_before_counts_where_the_newest_is_damaged(stopped):
    break_seal(stopped / "checkpoint.h5")
    found = status_of(stopped)
    head = read_head(stopped / "checkpoint.previous.h5")
    assert found.state == "resumable" and found.steps == head["state"]["counters"]["steps"] != STOPPED_AT
    assert found.checkpoint["file"] == "checkpoint.previous.h5"
    assert len(found.warnings) == 1 and found.warnings[0].startswith(f"{stopped}/checkpoint.h5: its seal is changed")


def test_damaged_gives_the_reason_for_each(stopped):
    break_seal(stopped / "checkpoint.h5")
    os.truncate(stopped / "checkpoint.previous.h5", 9000)
    found = status_of(stopped)
    assert found.state == "damaged"
    assert "checkpoint.h5: its seal is changed" in found.why
    assert "checkpoint.previous.h5: it has 9000 bytes instead of" in found.why


def test_a_checkpoint_of_another_version_is_named_so(stopped, monkeypatch):
    from pgfmd.results import inventory

    (stopped / "checkpoint.previous.h5").unlink()
    monkeypatch.setattr(inventory, "read_head", lambda path: {"pgfmd": "9.9", "state": {}})
    found = status_of(stopped)
    assert found.state == "damaged" and "of another version of pgfmd (9.9)" in found.why


def test_results_without_a_checkpoint_are_damaged(stopped):
    for name in ("checkpoint.h5", "checkpoint.previous.h5"):
        (stopped / name).unlink()
    found = status_of(stopped)
    assert (found.state, found.why) == ("damaged", "results, but no checkpoint to go on from")


def test_nothing_yet(tmp_path):
    (tmp_path / "previous-1").mkdir()
    assert status_of(tmp_path).state == "empty"
    (tmp_path / "curve.csv").write_text(",".join(CURVE.titles) + "\n")
    assert (status_of(tmp_path).state, status_of(tmp_path).why) == ("empty", "ended before its first step")


def test_no_results_folder(tmp_path):
    (tmp_path / "letter.txt").write_text("Dear Sir")
    with pytest.raises(ResultError, match="not a results folder"):
        status_of(tmp_path)
    with pytest.raises(ResultError, match="no such folder"):
        status_of(tmp_path / "nowhere")
    with pytest.raises(ResultError, match=r"letter\.txt: a file, not a results folder"):
        status_of(tmp_path / "letter.txt")


def test_a_broken_record_is_told(stopped):
    (stopped / "run.json").write_text("{")
    found = status_of(stopped)
    assert found.state == "resumable" and "run.json: damaged" in found.warnings[0]
    for text in ('{"a": 1}', "[1]", '{"finished": null}', '"x"'):
        (stopped / "run.json").write_text(text)
        found = status_of(stopped)
        assert found.state == "resumable" and "run.json: damaged" in found.warnings[0], text


# -- running -----------------------------------------------------------------------------------------------------------


def at(path, seconds_ago):
    """Gives a file a time of writing."""
    when = time.time() - seconds_ago
    os.utime(path, (when, when))


def test_running_counts_steps_and_pace_from_the_files(stopped):
    lock = RunLock.acquire(stopped, 4)
    try:
        last = add_rows(stopped, 30)
        at(stopped / "run.lock", 5000)
        at(stopped / "checkpoint.h5", 60)
        at(stopped / "checkpoint.previous.h5", 90)
        at(stopped / "curve.csv", 0)
        found = status_of(stopped)
        assert (found.state, found.ranks, found.holder["pid"]) == ("running", 4, os.getpid())
        assert (found.steps, found.phase, found.time_s) == (STOPPED_AT + 30, "approach", last.time)
        assert found.steps_per_s == pytest.approx(0.5, rel=1e-2)
        moved = read_head(stopped / "checkpoint.h5")["state"]["position"] - last.displacement
        assert found.punch_m_per_s == pytest.approx(moved / 60.0, rel=1e-2)
        assert found.links == 1 and found.checkpoint["age_s"] == pytest.approx(60, abs=5) and found.row_age_s < 5.0
        # A checkpoint from before this process began: it is another link.
        at(stopped / "run.lock", 40)
        found = status_of(stopped)
        assert found.links == 2 and found.steps_per_s == pytest.approx(0.75, rel=1e-2)
    finally:
        lock.release()
    assert status_of(stopped).state == "resumable"


def test_running_before_the_first_checkpoint(stopped):
    for name in ("checkpoint.h5", "checkpoint.previous.h5"):
        (stopped / name).unlink()
    lock = RunLock.acquire(stopped, 1)
    try:
        at(stopped / "run.lock", 100)
        at(stopped / "curve.csv", 0)
        found = status_of(stopped)
        assert (found.state, found.steps, found.links, found.checkpoint) == ("running", STOPPED_AT, 1, None)
        assert found.steps_per_s == pytest.approx(STOPPED_AT / 100, rel=1e-2) and found.left_s > 0.0
        (stopped / "curve.csv").unlink()
        assert status_of(stopped).left_remark == "no step has been made yet"
    finally:
        lock.release()


def test_a_checkpoint_may_be_ahead_of_a_thinned_curve(tmp_path):
    folder = run(tmp_path / "run", "output.every=7", stop_after=STOPPED_AT)
    state = read_head(folder / "checkpoint.h5")["state"]
    lock = RunLock.acquire(folder, 1)
    try:
        found = status_of(folder)
        assert (found.steps, found.time_s, found.force_N) == (STOPPED_AT, state["time"], state["force"])
        add_rows(folder, 2)
        assert status_of(folder).steps == STOPPED_AT + 14
    finally:
        lock.release()


def test_another_host_is_not_asked(stopped, monkeypatch):
    elsewhere = Holder("node17", 4711, "Slurm job 12", "2026-01-01 10:00:00", "me", 64, None)
    monkeypatch.setattr(run_lock, "holder", lambda folder: elsewhere)
    (stopped / "run.lock").write_text("{}")
    found = status_of(stopped)
    assert (found.state, found.why) == ("running", "whether it is alive can't be told from here")
    assert found.holder["job"] == "Slurm job 12"
    for path in stopped.iterdir():
        at(path, 10 * 3600)
    assert status_of(stopped).why.endswith("no sign of life for 10.0 h: perhaps it is lost")


def test_a_finished_run_may_leave_its_lock_on_another_host(finished, monkeypatch):
    elsewhere = Holder("node17", 4711, "", "2026-01-01 10:00:00", "me", 64, None)
    monkeypatch.setattr(run_lock, "holder", lambda folder: elsewhere)
    assert status_of(finished).state == "finished"
    (finished / "run.json").unlink()
    assert status_of(finished).state == "running"


def test_a_run_that_has_only_just_begun(tmp_path):
    lock = RunLock.acquire(tmp_path, 2)
    try:
        found = status_of(tmp_path)
        assert (found.state, found.ranks, found.links) == ("running", 2, 1)
        assert found.left_remark == "it has only just begun"
    finally:
        lock.release()


def test_a_row_that_is_just_being_written_does_not_count(stopped):
    lock = RunLock.acquire(stopped, 1)
    try:
        before = status_of(stopped)
        with open(stopped / "curve.csv", "a", encoding="utf-8") as file:
            file.write("17.5,-1e-")
        assert status_of(stopped).time_s == before.time_s and status_of(stopped).steps == STOPPED_AT
    finally:
        lock.release()


def test_pace_takes_the_shortest_time_that_is_long_enough():
    marks = [Mark(95.0, 90, -9.0, "turn"), Mark(80.0, 70, -6.0, "turn"), Mark(0.0, 0, 0.0, "approach")]
    assert _pace(marks, Mark(100.0, 100, -8.0, "turn")) == (1.5, 0.1)
    # No way over a phase that has ended; no pace over less than a second, or without a step.
    assert _pace(marks[2:], Mark(100.0, 100, -8.0, "turn")) == (1.0, None)
    assert _pace(marks[:1], Mark(95.5, 100, -8.0, "turn")) == (None, None)
    assert _pace(marks[:1], Mark(200.0, 90, -9.0, "turn")) == (None, None)


# -- forecasts ---------------------------------------------------------------------------------------------------------


def moments(folder, every):
    """(moment, steps left, those of them in a dwell to come) at each third row of a finished run, as seen from there."""
    path = folder / "curve.csv"
    lines = path.read_bytes().splitlines(keepends=True)
    rows = CurveTail(path).rows
    assert len(rows) == len(lines) - 1, "longer than what is looked at"
    turn, phases, end = next(k for k, row in enumerate(rows) if row.phase == "turn") - 1, [], len(lines[0])
    for k, row in enumerate(rows[:-1]):
        end += len(lines[k + 1])
        phases.append(row.phase)
        if k % 3:
            continue
        met = {"preload_time": rows[turn].time, "depth": -rows[turn].displacement} if k > turn else {}
        dwelt, left = phases.count("dwell"), len(rows) - 1 - k
        to_dwell = sum(one.phase == "dwell" for one in rows[k + 1 :])
        moment = Moment(row.phase, row.time, row.displacement, row.force, row.step, every * k,
                        stiffness=CurveTail(path, end).stiffness, dwell_steps=every * dwelt, **met)  # fmt: skip
        yield moment, every * left, every * to_dwell


EXPLICIT = ("tri-tack", "grid.n=32", "drive.speed=1 mm/s", "solver.scheme=gfmd")
CASES = {
    "slow": ("tri-tack", "grid.n=64"),
    "fast": ("tri-tack", "grid.n=64", "drive.speed=10 um/s"),
    "slower back": ("tri-tack", "grid.n=48", "drive.retract_speed=0.1 um/s"),
    "hexagonal": ("hex-tack", "grid.n=48", "output.snapshots=[]"),
    "dwell": ("tri-tack", "grid.n=64", "drive.speed=5 um/s", "drive.dwell=20 s"),
    "explicit": (*EXPLICIT, "output.every=10"),
    "explicit, on a spring": (*EXPLICIT, "output.every=40", "drive.machine_stiffness=2 kN/m"),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_left_is_mostly_right_within_a_factor_of_two(case, tmp_path):
    scene = load_scene(CASES[case][0], CASES[case][1:])
    run_scene(scene, MPI.COMM_SELF, tmp_path, lambda line: None)
    # At such speeds the elastomer is stiffer, and the preload met earlier, than in a static contact.
    factor, ratios, shares = 2.5 if case.startswith("explicit") else 2.0, [], []
    for moment, left, to_dwell in moments(tmp_path, scene.output.every):
        ahead = outlook(scene, moment)
        shares.append(ahead.progress)
        left -= to_dwell if "the dwell" in ahead.remark else 0
        if ahead.steps is not None and left >= 10:
            ratios.append(ahead.steps / left)
    good = sum(1 / factor <= ratio <= factor for ratio in ratios)
    assert len(ratios) > 20 and good >= 0.9 * len(ratios) and max(ratios) < 3.0
    # The end of a spring's way follows from the force of the pull-off, which is hardly known.
    assert 0.0 <= min(shares) < 0.1 and (0.8 if "spring" in case else 0.9) < max(shares) <= 1.0


def test_no_forecast_where_nothing_can_be_said():
    scene = load_scene("tri-tack", ["grid.n=64", "solver.max_steps=150"])
    moment = Moment("retract", 30.0, 1e-7, -1e-3, 0.01, 120)
    assert outlook(scene, moment).remark == "where the preload was met is not known"
    off = outlook(scene, replace(moment, preload_time=15.0, depth=14e-6))
    assert off.steps is None and off.progress > 0.9 and off.remark == "the punch may come off at any moment"
    capped = outlook(scene, replace(moment, displacement=-13e-6, preload_time=15.0, depth=14e-6))
    assert (capped.steps, capped.remark) == (30, "until solver.max_steps is reached")
    waiting = outlook(load_scene("tri-tack", ["drive.dwell=20 s"]), Moment("approach", 1.0, 0.0, 0.0, 0.01, 12))
    assert waiting.steps > 100 and waiting.remark == "and what the dwell of 20 s takes"


def test_status_says_so_if_the_scene_cannot_be_read(stopped, monkeypatch):
    from pgfmd.results import status

    def refuse(text, **options):
        raise SceneError("scene", [Problem("punch.file", "/gone.npy", "a file that exists")])

    monkeypatch.setattr(status, "parse_scene", refuse)
    found = status_of(stopped)
    assert found.state == "resumable" and found.progress is None and found.steps == STOPPED_AT
    assert found.left_remark.startswith("its scene can't be read here: ") and "/gone.npy" in found.left_remark


# -- the end of the curve ----------------------------------------------------------------------------------------------


def test_the_tail_of_a_long_curve(tmp_path, finished):
    path, lines = tmp_path / "curve.csv", (finished / "curve.csv").read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0] + b"".join(lines[1:]) * 40)
    tail = CurveTail(path)
    assert 300 < len(tail.rows) < 40 * len(lines) and tail.rows[-1] == CurveTail(finished / "curve.csv").rows[-1]
    assert count_ends(path) == 1 + 40 * (len(lines) - 1)
    for phase in ("approach", "turn", "retract"):
        each = sum(line.endswith(f",{phase}\n".encode()) for line in lines)
        assert count_ends(path, ending=f",{phase}") == 40 * each > 0


def test_endings_are_counted_across_pieces(tmp_path, monkeypatch):
    from pgfmd.files import table_reading

    (tmp_path / "table").write_text("a,dwell\nb,turn\n" * 50)
    for size in range(1, 20):
        monkeypatch.setattr(table_reading, "PIECE_BYTES", size)
        assert count_ends(tmp_path / "table", ending=",dwell") == 50 and count_ends(tmp_path / "table", 8) == 99


def test_lines_that_are_no_rows_are_told(stopped):
    with open(stopped / "curve.csv", "a", encoding="utf-8") as file:
        file.write("1.0,2.0\n1,2,3,4,x,6,7,8,9,approach\n")
    assert status_of(stopped).warnings == [f"{stopped}/curve.csv: 2 of its last lines are no rows: `pgfmd verify` it"]


def test_stiffness_is_that_of_the_last_rise(stopped):
    path = stopped / "curve.csv"
    for k in range(8):
        add_rows(stopped, 1, force=1e-3 * (1 + k))
    assert CurveTail(path).stiffness == pytest.approx(1e-3 / 1e-8)
    add_rows(stopped, 1, force=-1e-6)
    assert CurveTail(path).stiffness is None


# -- the command -------------------------------------------------------------------------------------------------------


def called(capsys, *arguments):
    """(exit code, stdout, stderr) of the command line."""
    with pytest.raises(SystemExit) as ended:
        cli.main([str(argument) for argument in arguments])
    said = capsys.readouterr()
    return ended.value.code, said.out, said.err


def test_one_folder_line_by_line(stopped, capsys):
    code, out, err = called(capsys, "status", stopped)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0].startswith(f"{stopped}: resumable (stopped by ") and lines[0].endswith(" % of the punch's way")
    words = {line.split()[0]: line.split(maxsplit=1)[1] for line in lines[1:]}
    assert list(words) == ["title", "step", "force", "left", "rate", "checkpoint", "links"]
    assert words["step"].startswith(f"{STOPPED_AT}, t = ") and words["force"].endswith("(preload 1 mN)")
    assert words["left"].startswith("about ") and words["checkpoint"].startswith(f"checkpoint.h5: step {STOPPED_AT}, ")


def test_several_folders_a_line_each_and_what_is_none_ends_in_4(stopped, finished, tmp_path, capsys):
    break_seal(finished / "checkpoint.h5")
    (tmp_path / "new").mkdir()
    code, out, err = called(capsys, "status", stopped, finished, tmp_path / "new", tmp_path / "nowhere")
    assert code == 4 and err == f"pgfmd: {tmp_path}/nowhere: no such folder\n"
    header, *lines = out.splitlines()
    assert header.split()[:4] == ["folder", "state", "phase", "way"] and len(lines) == 4
    assert [line.split()[1] for line in lines[:3]] == ["resumable", "damaged", "empty"]
    assert lines[3].startswith(f"{finished}: finished (detached), but no checkpoint is valid: checkpoint.h5: its seal")
    assert called(capsys, "status", stopped, tmp_path / "new")[0] == 0


def test_json(stopped, finished, capsys):
    code, out, _ = called(capsys, "status", "--json", stopped, finished)
    first, second = json.loads(out)
    assert code == 0 and (first["state"], second["state"]) == ("resumable", "finished")
    assert first["folder"] == str(stopped) and first["steps"] == STOPPED_AT and 0 < first["progress"] < 1
    assert second["left_s"] is None and second["warnings"] == []


def test_no_array_is_read_and_no_mpi_loaded(finished):
    """The data of a checkpoint may be damaged: status takes no notice, as it looks at heads only."""
    damage_an_array(finished / "checkpoint.h5")
    assert status_of(finished).state == "finished" and status_of(finished).warnings == []
    script = (
        "import atexit, sys\n"
        "loaded = lambda: sorted({'mpi4py', 'mpi4py_fft', 'numba', 'matplotlib'} & set(sys.modules))\n"
        "atexit.register(lambda: print(loaded(), file=sys.stderr))\n"
        "from pgfmd.cli import main\n"
        "main()"
    )
    environment = environment_without()
    for command, code in (("status", 0), ("verify", 4)):
        done = subprocess.run(
            [sys.executable, "-c", script, command, str(finished)], capture_output=True, text=True, timeout=60,
            env=environment,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (code, "[]\n"), done.stderr


@pytest.mark.parametrize(
    ("seconds", "text"),
    [(0.2, "0 s"), (59.4, "59 s"), (59.6, "1 min"), (3580, "1 h 00 min"), (7500, "2 h 05 min"), (172799, "2 d 0 h"),
     (200000, "2 d 8 h")],
)  # fmt: skip
def test_times_are_written_in_their_units(seconds, text):
    assert status_command.span(seconds) == text


def test_sizes_are_written_in_their_units():
    sizes = [status_command.size(count) for count in (17, 30050, 999.6e3, 1.5e9)]
    assert sizes == ["17 bytes", "30.1 kB", "1 MB", "1.5 GB"]
