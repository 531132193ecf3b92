"""The fuzzer, small: some hundred scenes read, a few run, and damage that its judges have to find."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.files.hdf5 import open_serial
from pgfmd.host import launch
from pgfmd.host.launchers import environment_without
from pgfmd.runner import run_scene
from pgfmd.scene import load_scene
from pgfmd.scene.fields import quantity

from . import campaign, running, scenes
from .comparing import compared
from .declarations import EXPONENTS, KEYS, _key
from .faults import Fault
from .files import write_files
from .judging_results import judge_folder
from .relations import RELATIONS
from .scenes import make

pytestmark = pytest.mark.skipif(launch.launched()[0] > 1, reason="starts processes of its own")

SEED, CHECKS = 3, 110
RUNS = {1: "finished", 20: "refused"}
"""Scenes of SEED that are run, with what comes of them."""
RELATED = {
    2: "resolved",
    42: "series",
    5: "units",
    13: "mirror",
    15: "every",
    17: "symmetry",
    21: "outputs",
    44: "resume",
    45: "precision",
}
"""A scene of SEED for every relation, each of which costs a second or two. `ranks` is in tests/parallel."""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """CHECKS scenes of SEED with what came of each."""
    folder = tmp_path_factory.mktemp("files")
    write_files(folder)
    made = [make(SEED, index, "check") for index in range(CHECKS)]
    return [(one, campaign.check(one, folder, limit=None)) for one in made]


def test_scenes_are_read_or_refused_with_a_message(found):
    wrong = [f"scene {one.index}: {fault}\n{one.text}" for one, finding in found for fault in finding.faults]
    assert not wrong, f"{len(wrong)} faults; python -m tests.fuzz check --seed {SEED} --count {CHECKS}\n\n" + wrong[0]


def test_some_scenes_are_fine_and_some_are_not(found):
    outcomes = [finding.outcome for _, finding in found]
    assert min(outcomes.count("fine"), outcomes.count("refused")) > CHECKS / 5


def test_plausible_scenes_can_be_run(tmp_path):
    write_files(tmp_path)
    outcomes = [campaign.check(make(SEED, k, "relate"), tmp_path, limit=None).outcome for k in range(20)]
    assert outcomes.count("fine") >= 18


def test_every_key_and_every_choice_is_drawn():
    made = [make(SEED, index, kind).scene for kind in ("check", "relate") for index in range(600)]
    values = {dotted: [] for dotted in KEYS}
    for scene in made:
        for section, keys in scene.items():
            for name, value in keys.items() if isinstance(keys, dict) else ():
                values.get(f"{section}.{name}", []).append(value)
    for dotted, key in KEYS.items():
        assert len({repr(value) for value in values[dotted]}) > 1, dotted
        assert all(choice in values[dotted] for choice in key.choices), dotted


def test_a_scene_follows_from_seed_number_and_kind():
    one = make(5, 7, "check")
    assert make(5, 7, "check").text == one.text
    assert len({one.text, make(5, 8, "check").text, make(6, 7, "check").text, make(5, 7, "run").text}) == 4


def test_a_key_that_is_new_is_drawn_by_itself(monkeypatch):
    new = _key("drive", "brake", quantity("speed", "a new one", None))
    monkeypatch.setitem(scenes.KEYS, "drive.brake", new)
    drawn = {str(make(1, index, "relate").scene["drive"].get("brake")) for index in range(60)}
    assert len(drawn) > 3 and all(text.endswith("m/s") for text in drawn - {"None"})
    assert {key.dimension for key in KEYS.values()} <= EXPONENTS.keys()


def fuzz(*commands: str, folder: Path) -> subprocess.CompletedProcess:
    """Commands of the fuzzer, one after the other in a process that has not loaded MPI."""
    calls = " + ".join(f"main({[*command.split(), '--out', str(folder)]})" for command in commands)
    program = f"import sys; from tests.fuzz.__main__ import main; sys.exit({calls})"
    return subprocess.run(
        [sys.executable, "-c", program], cwd=Path(__file__).parents[2], env=environment_without(), capture_output=True, text=True,
        timeout=110, check=False,
    )  # fmt: skip


def test_runs_are_without_fault_and_those_that_must_agree_do(tmp_path):
    indices, pairs = (" ".join(map(str, numbers)) for numbers in (RUNS, RELATED))
    done = fuzz(f"run --seed {SEED} --index {indices}", f"relate --seed {SEED} --index {pairs}", folder=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert (
        f"{len(RUNS)} scenes, 0 with faults" in done.stdout and f"{len(RELATED)} scenes, 0 with faults" in done.stdout
    )
    outcomes = [*RUNS.values(), *(f"{name}: agrees" for name in RELATED.values())]
    assert all(f"1  {outcome}" in done.stdout for outcome in outcomes), done.stdout
    assert {*RELATED.values(), "ranks"} == RELATIONS.keys()


def test_a_fault_is_told_with_the_scene_and_the_command_that_repeats_it(tmp_path):
    told, one = [], campaign.Campaign("check", SEED, (5,), tmp_path, 1.0)
    faults = [Fault("hangs", "for ever"), Fault("slow")]
    assert (
        campaign.tell(one, [campaign.Finding(5, "broken", faults, "x.toml"), campaign.Finding(6, "fine")], told.append)
        == 1
    )
    text = "\n".join(told)
    assert (
        "FAULT hangs: for ever\n      scene x.toml\n      again python -m tests.fuzz check --seed 3 --index 5" in text
    )
    assert "2 scenes, 1 with faults" in text


SAID = "results: out"
TRACEBACK = 'Traceback (most recent call last):\n  File "/x/pgfmd/units.py", line 71, in f\nTypeError: no'


@pytest.fixture(scope="module")
def run_once(tmp_path_factory):
    """A whole run with jumps and snapshots, and its scene."""
    folder = tmp_path_factory.mktemp("run") / "out"
    scene = load_scene(
        "tri-tack", ["grid.n=20", "drive.preload=0.5 mN", "rheology.model=elastic", "solver.accuracy=0.02"]
    )
    run_scene(scene, MPI.COMM_SELF, folder, lambda line: None)
    return folder, scene


def table(name, change):
    """Damage to the lines of a table."""

    def damage(folder):
        lines = (folder / name).read_text().splitlines()
        changed = change(lines)
        (folder / name).write_text("\n".join(lines if changed is None else changed) + "\n")

    return damage


def entry(name, value):
    """Damage to an entry of the record."""

    def damage(folder):
        record = json.loads((folder / "run.json").read_text())
        (folder / "run.json").write_text(json.dumps(record | {name: value}))

    return damage


def cell(lines, row, column, text):
    parts = lines[row].split(",")
    parts[column] = text
    lines[row] = ",".join(parts)


def shifted(folder):
    with open_serial(folder / "fields.h5", "r+") as file:
        file["punch_position"][0] *= 1.01


def pressed(folder):
    with open_serial(folder / "fields.h5", "r+") as file:
        inside = np.isfinite(file["gap"][0])
        file["traction"][0] = np.where(inside, file["traction"][0] * 1.1, np.nan)


def opened(folder):
    with open_serial(folder / "fields.h5", "r+") as file:
        gap = file["gap"][0]
        gap[gap < 0.0] = 1e-12
        file["gap"][0] = gap


DAMAGE = {
    "verify: curve.csv": table("curve.csv", lambda lines: cell(lines, 5, 2, "1.0")),
    "curve: force [N] not finite": table("curve.csv", lambda lines: cell(lines, 5, 3, "nan")),
    "curve: near_area [m^2] below 0": table("curve.csv", lambda lines: cell(lines, 5, 6, "-5.625e-9")),
    "curve: phase none of": table("curve.csv", lambda lines: cell(lines, 5, -1, "pause")),
    "curve: time [s] falls": table("curve.csv", lambda lines: [*lines[:5], lines[6], lines[5], *lines[7:]]),
    "curve: equal rows": table("curve.csv", lambda lines: lines[:5] + lines[4:]),
    "curve: indentation is not -displacement": table("curve.csv", lambda lines: cell(lines, 5, 2, "1e-9")),
    "curve: phases out of order": table("curve.csv", lambda lines: cell(lines, 5, -1, "retract")),
    "curve: an area that is no number": table("curve.csv", lambda lines: cell(lines, 5, 4, "1e-10")),
    "curve: more overlap than": table("curve.csv", lambda lines: cell(lines, 5, 5, "5.625e-7")),
    # The range is long on so coarse a grid: what is within 500 nm is well in contact.
    "curve: more near than contact area": table("curve.csv", lambda lines: cell(lines, 5, 6, "1.125e-6")),
    "the results don't know the gaps": entry("contact_gap_m", 0.0),
    "force at the end of a detached run": table("curve.csv", lambda lines: cell(lines, -1, 3, "1e-4")),
    "contact at the end of a detached run": table("curve.csv", lambda lines: cell(lines, -1, 4, "5.625e-9")),
    "a pull-off force below a tension in the curve": entry("pull_off_force_N", 1e-9),
    "a preload that was not asked for, untold": entry("preload_N", 1e-3),
    "null in the record": entry("work_J", None),
    "negative in the record: jumps": entry("jumps", -1),
    "an end that has no name": entry("finished", "gone"),
    "record: traceback, ValueError": entry("work_J", float("nan")),
    "exit code 0 without a record": lambda folder: (folder / "run.json").unlink(),
    "left over in the folder": lambda folder: (folder / "curve.csv.tmp").touch(),
    "events: preload or end are not those of the record": table("events.csv", lambda lines: lines[:-1]),
    "events: not as many jumps as the record has": entry("jumps", 1000),
    "events: time [s] falls": table("events.csv", lambda lines: [lines[0], *lines[:0:-1]]),
    "energy: viscous [J] not finite": table("energy.csv", lambda lines: cell(lines, 5, 4, "inf")),
    "patches: kind none of": table("patches.csv", lambda lines: cell(lines, 1, -2, "ridge")),
    "sites: event none of": table("sites.csv", lambda lines: cell(lines, 1, 8, "stays")),
    "events: one that has no row in the curve": table("events.csv", lambda lines: cell(lines, 1, 2, "0.12345")),
    "energy: columns do not add up": table("energy.csv", lambda lines: cell(lines, 9, 1, "1e-8")),
    "energy: released falls": table("energy.csv", lambda lines: cell(lines, -1, 5, "0.0")),
    "energy: an audit that does not close, untold": table("energy.csv", lambda lines: cell(lines, -1, 6, "1e-7")),
    "energy: other rows than the curve": table("energy.csv", lambda lines: lines[:-1]),
    "fields: a displacement that is not the curve's": shifted,
    "fields: areas that are not the curve's": opened,
    "fields: a force that is not the curve's": pressed,
    "fields: none, not even of the preload": lambda folder: (folder / "fields.h5").unlink(),
    "patches: not the contact of the snapshot": table("patches.csv", lambda lines: cell(lines, 1, 3, "1.0")),
    "sites: one joins that is there": table("sites.csv", lambda lines: lines[:2] + lines[1:]),
    "sites: in contact at the end": table("sites.csv", lambda lines: lines[:-1]),
}


@pytest.mark.parametrize("label", DAMAGE)
def test_damage_is_found(run_once, tmp_path, label):
    folder, scene = run_once
    copy = shutil.copytree(folder, tmp_path / "out")
    DAMAGE[label](copy)
    labels = [fault.label for fault in judge_folder(copy, scene, 0, SAID)]
    assert any(found.startswith(label) for found in labels), labels


def test_a_sound_run_is_without_fault_and_agrees_with_itself(run_once):
    folder, scene = run_once
    assert judge_folder(folder, scene, 0, SAID) == []
    assert compared(folder, folder) == []
    assert {fault.label for fault in compared(folder, folder, factor=lambda unit: 2.0)} >= {"curve.csv differs"}


@pytest.mark.parametrize(
    ("said", "code", "label"),
    [
        (TRACEBACK, 1, "traceback, TypeError at units.py:71"),
        ("/x/pgfmd/a.py:3: RuntimeWarning: overflow", 0, "RuntimeWarning at a.py:3"),
        ("pgfmd: interrupted", 130, "exit code 130"),
        ("", 2, "0 messages for exit code 2"),
        ("pgfmd: no equilibrium", 3, "a failed run whose message names no key"),
    ],
)  # fmt: skip
def test_words_are_judged(tmp_path, said, code, label):
    assert any(fault.label.startswith(label) for fault in judge_folder(tmp_path, None, code, said))


def deaf():
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    time.sleep(60)


@pytest.mark.parametrize(
    ("action", "outcome", "label"),
    [
        (deaf, "hung", "hangs: TERM was not answered"),
        (lambda: time.sleep(60), "out of time", None),
        (lambda: os.kill(os.getpid(), signal.SIGKILL), "died", f"the process died of {-signal.SIGKILL}"),
        (lambda: 1 / 0, "died", "the process died of 1"),
        (lambda: ("fine", [Fault("small")]), "fine", "small"),
    ],
)
def test_processes_that_hang_or_die_are_told(tmp_path, monkeypatch, action, outcome, label):
    # None of these uses MPI, which this process may have loaded.
    monkeypatch.delitem(sys.modules, "mpi4py.MPI")
    monkeypatch.setattr(running, "GRACE", 0.2)
    ended = running.in_child(action, tmp_path / "child", limit=0.5)
    assert (ended.outcome, [fault.label for fault in ended.faults]) == (outcome, [label] if label else [])


def test_the_cure_of_a_failed_run_is_tried(tmp_path, monkeypatch):
    scene, asked = load_scene("tri-tack", ["solver.accuracy=0.1"]), []
    codes = iter([3, 0, 3, 3])
    monkeypatch.setattr(campaign, "pgfmd", lambda *arguments: (asked.append(arguments[2]), (next(codes), ""))[1])
    assert campaign.cured(scene, "raise drive.preload") == [] and not asked
    assert campaign.cured(scene, "try a smaller solver.accuracy") == []
    assert [fault.label for fault in campaign.cured(scene, "try a smaller solver.accuracy")] == [
        "a failed run whose cure is none"
    ]
    assert asked == ["solver.accuracy=0.010000000000000002", "solver.accuracy=0.001"] * 2
