"""Programmes of steps: their phases, and how a scene says them."""

import itertools
import math

import numpy as np
import pytest

import pgfmd
from pgfmd.errors import MISSING, SceneError
from pgfmd.files.followed_path import read_path
from pgfmd.physics.drive import AREA, DETACHED, DISPLACEMENT, FORCE, LOAD, PLACE, PRELOAD, TRAVEL, Ending
from pgfmd.physics.programme import Machine, Path, Step, phases_of
from pgfmd.restart.scene_changes import contents_of, review
from pgfmd.scene import load_scene, parse_scene
from pgfmd.scene_objects import drive_of
from pgfmd.studies.study_file import is_settable

REACH, SPEED = 1e-6, 2e-6
MACHINE = Machine(soft=1e-2, stiffness=1e4, reach=REACH)
APPROACH = Step("approach", DISPLACEMENT, SPEED, until=((FORCE, 1e-3),))
RETRACT = Step("retract", DISPLACEMENT, -3 * SPEED, until=((DETACHED, 0.0),))
HOLD = Step("hold", LOAD, duration=5.0)
DWELL = Step("hold", DISPLACEMENT, duration=5.0)
RAMP = Step("ramp", LOAD, 1e-3, until=((FORCE, 2e-3),))
SWING = Step("oscillate", DISPLACEMENT, amplitude=1e-8, frequency=10.0, cycles=3.0)


def named(phases):
    return [(phase.name, phase.cycle, phase.stage) for phase in phases]


# Phases -------------------------------------------------------------------------------------------------------------


def test_velocities_are_continuous_while_the_machine_controls_the_same():
    steps = (APPROACH, DWELL, SWING, RETRACT, HOLD, RAMP, RETRACT, APPROACH)
    phases = phases_of(steps, MACHINE)
    turned = {phase.stage for phase in phases if phase.name == "turn"}
    for before, after in itertools.pairwise(phases):
        if before.control == after.control:
            assert before.velocity(before.duration) == pytest.approx(after.velocity(0.0), rel=1e-12, abs=1e-25)
        else:
            # The punch stays where it is, and its velocity is not given.
            assert after.velocity_start == 0.0 or after.name != "turn"
    # Between steps that both rest there is nothing to turn; before a ramp the load has to begin to change.
    assert turned == {2, 4, 6, 7, 8}
    turn = next(phase for phase in phases if phase.name == "turn")
    moved = abs(turn.displacement(turn.duration))
    assert moved == pytest.approx(0.02 * REACH, rel=1e-12)


def test_steps_are_repeated_from_the_first_to_the_last():
    steps = (APPROACH, DWELL, HOLD, RETRACT)
    found = [key for key in named(phases_of(steps, MACHINE, times=3, first=2, last=3)) if key[0] != "turn"]
    assert found == [
        ("approach", 1, 1), ("dwell", 1, 2), ("hold", 1, 3), ("dwell", 2, 2), ("hold", 2, 3), ("dwell", 3, 2),
        ("hold", 3, 3), ("retract", 3, 4),
    ]  # fmt: skip
    # Only where nothing but a retraction is left does a punch that is free stay free.
    assert [phase.final for phase in phases_of((APPROACH, RETRACT), MACHINE, 2)] == [False] * 5 + [True, True]


def test_without_time_nothing_is_held():
    steps = (APPROACH, DWELL, HOLD, RETRACT)
    timeless = Machine(1e-2, 1e4, REACH, timeless=True)
    assert [phase.name for phase in phases_of(steps, timeless)] == ["approach", "turn", "retract"]


def test_ends_are_reached_from_where_the_step_comes_from():
    down = Step("retract", DISPLACEMENT, -SPEED, until=((FORCE, -1e-3), (AREA, 1e-9), (PLACE, 1e-6), (TRAVEL, 1e-6)))
    (_, _, phase) = phases_of((APPROACH, down), MACHINE)
    assert [ending.sign for ending in phase.endings] == [-1, -1, 1, 1] and phase.ends_with == ""
    phases = phases_of((APPROACH, Step("hold", LOAD, until=((AREA, 1e-9),)), RETRACT), MACHINE)
    assert phases[1].endings == (Ending(AREA, 1e-9, 0),)
    assert (phases[0].ends_with, phases[-1].ends_with) == (PRELOAD, DETACHED)


def test_a_load_moves_the_end_of_a_soft_spring():
    (phase,) = phases_of((RAMP,), MACHINE)
    # The spring gives way by 1 mN/s times its compliance, the contact by its own.
    assert phase.velocity(0.0) == pytest.approx(-1e-3 * (1e-2 + 1e-4), rel=1e-14)
    assert MACHINE.punch_speed(LOAD, phase.velocity(0.0)) == pytest.approx(1e-3 / 1e4, rel=1e-14)


def test_an_oscillation_starts_and_ends_at_rest_with_full_cycles_between():
    (phase,) = phases_of((SWING,), MACHINE)
    assert phase.duration == 0.5 and phase.longest_step == 1 / 640
    for elapsed in (0.0, phase.duration):
        assert abs(phase.displacement(elapsed)) < 1e-20 and abs(phase.velocity(elapsed)) < 1e-18
    t = np.linspace(0.1, 0.4, 301)
    full = [phase.displacement(float(each)) for each in t]
    assert np.allclose(full, -1e-8 * np.sin(2 * np.pi * 10.0 * t), rtol=0, atol=1e-20)
    t = np.linspace(0.0, 0.5, 2001)
    place, velocity = (np.array([of(float(each)) for each in t]) for of in (phase.displacement, phase.velocity))
    assert np.abs(np.gradient(place, t)[1:-1] - velocity[1:-1]).max() < 1e-3 * phase.fastest
    assert 0.9 * np.abs(velocity).max() < np.abs(velocity).max() <= phase.fastest


def test_a_path_goes_through_its_rows_without_passing_over_them():
    times, places = (0.0, 1.0, 1.5, 3.0), (0.0, -2e-6, -2e-6, 1e-6)
    path = Path(times, places)
    assert [path.place(time) for time in times] == pytest.approx(places, abs=1e-20)
    t = np.linspace(0.0, 3.0, 3001)
    place, velocity = (np.array([of(float(each)) for each in t]) for of in (path.place, path.velocity))
    assert place.min() == pytest.approx(-2e-6, rel=1e-12) and place.max() == pytest.approx(1e-6, rel=1e-12)
    assert np.abs(np.diff(velocity)).max() < 0.01 * path.fastest
    assert np.abs(velocity).max() <= path.fastest <= 1.001 * np.abs(velocity).max()
    held = Step("follow", LOAD, table=((5.0, 6.0, 7.0), (1e-3, 2e-3, 2e-3)))
    phase = phases_of((APPROACH, held), MACHINE)[-1]
    assert phase.duration == 2.0 and phase.displacement(1.0) == pytest.approx(-1e-3 * 1.01e-2, rel=1e-12)


# Scenes -------------------------------------------------------------------------------------------------------------

STEPS = """
[[drive.step]]
do = "approach"
speed = "10 um/s"
until = ["4 mN", "1 mm"]
[[drive.step]]
do = "hold"
of = "load"
for = "0.5 s"
[[drive.step]]
do = "oscillate"
amplitude = "20 nm"
frequency = "10 Hz"
cycles = 2.5
[[drive.step]]
do = "retract"
speed = "10 um/s"
[drive.repeat]
times = 2
last = 2
"""
HEAD = """
[punch]
pattern = "flat"
radius = "375 um"
[substrate]
youngs_modulus = "2 MPa"
poisson_ratio = 0.495
[rheology]
model = "elastic"
[adhesion]
work_of_adhesion = "50 mJ/m^2"
[grid]
n = 24
length = "1.5 mm"
[drive]
"""


def scene(*overrides, steps=STEPS, **where):
    return parse_scene(HEAD + steps, overrides, **where)


def problems(*overrides, steps=STEPS, **where):
    with pytest.raises(SceneError) as caught:
        scene(*overrides, steps=steps, **where)
    return {problem.key: problem for problem in caught.value.problems}


def test_a_resolved_programme_reads_back_as_itself():
    found = scene()
    assert found.drive.step[0].until == ("0.004 N", "0.001 m") and found.drive.step[1].duration == 0.5
    assert parse_scene(found.to_toml()) == found
    assert parse_scene(found.given.to_toml()) == found
    names = [phase.name for phase in drive_of(found).phases if phase.name != "turn"]
    assert names == ["approach", "hold", "approach", "hold", "oscillate", "retract"]
    # What stands for it in forecasts, and is no key.
    assert (found.drive.preload, found.drive.speed) == (4e-3, 1e-5) and "preload" not in found.to_toml()


def test_numbers_of_a_python_program_are_in_si_units():
    given = {
        "step": [
            {"do": "approach", "speed": 1e-5, "until": ["4 mN", "1 mm"]},
            {"do": "hold", "of": "load", "for": 0.5},
            {"do": "oscillate", "amplitude": "20 nm", "frequency": 10, "cycles": 2.5},
            {"do": "retract", "speed": np.float64(1e-5)},
        ],
        "repeat": {"times": 2, "last": 2},
    }
    assert pgfmd.Scene(scene(steps='speed = "1 um/s"\npreload = "1 mN"'), drive=given) == scene()
    changed = pgfmd.Scene(scene(), drive={"step.2.duration": 30.0, "step.4.until": "free", "repeat.times": 5})
    assert (changed.drive.step[1].duration, changed.drive.repeat.times) == (30.0, 5)
    with pytest.raises(SceneError, match=r"drive\.step\.3\.amplitude = 2e-08: .*write a text with a unit"):
        pgfmd.Scene(scene(), drive={"step.3.amplitude": 2e-8})


def test_overrides_change_single_steps():
    found = scene("drive.step.2.duration=30 s", "drive.step.1.until=2 mN", "drive.repeat.times=3")
    assert (found.drive.step[1].duration, found.drive.step[0].until) == (30.0, ("0.002 N",))
    assert (found.drive.repeat.times, found.drive.repeat.last) == (3, 2)
    assert scene("drive.step.2.for=30 s") == scene("drive.step.2.duration=30 s")
    # Another kind of step drops the keys that it has no use for.
    assert scene("drive.step.3.do=hold", "drive.step.3.for=1 s").drive.step[2].amplitude is None
    steps = 'drive.step=[{do="approach",speed="1 um/s",until="1 mN"},{do="retract",speed="3 um/s"}]'
    assert load_scene("tri-tack", [steps, "grid.n=24"]).drive.preload == 1e-3
    found = problems("drive.step.9.duration=30 s", "drive.step.x=3", "drive.repeat.first=3")
    assert "a step from 1 to 4" in found["drive.step.9.duration"].expected and "drive.step.x" in found
    assert all(map(is_settable, ("drive.step.2.speed", "drive.step.11.for", "drive.repeat.times")))
    assert not any(map(is_settable, ("drive.step.speed", "drive.step.2.sped", "drive.repeat.time")))


@pytest.mark.parametrize(
    ("override", "key", "told"),
    [
        ("drive.step.1.speed=", "step.1.speed", "a speed above 0"),
        ("drive.step.1.rate=1 N/s", "step.1.rate", "no such key in 'approach'"),
        ("drive.step.1.sped=1 m/s", "step.1.sped", "a key of a step: do, speed"),
        ("drive.step.1.until=[]", "step.1.until", "what ends 'approach'"),
        ("drive.step.1.until=3 mN/s", "step.1.until", 'a contact area such as "0.2 mm^2", or "free"'),
        ("drive.step.1.until=-1 um", "step.1.until", "a force such as"),
        ("drive.step.1.until=free", "step.1", "no end at 'free'"),
        ("drive.step.1.do=jump", "step.1.do", "'approach', 'hold'"),
        ("drive.step.2.of=speed", "step.2.of", "'displacement' or 'load'"),
        ("drive.step.3.amplitude=3 s", "step.3.amplitude", "a length above 0"),
        ("drive.step.3.frequency=3 rad/s", "step.3.frequency", "a frequency above 0"),
        ("drive.step.3.do=follow", "step.3.file", "a value for 'follow'"),
        ("drive.step=3", "step", "a list of tables"),
        ("drive.step=[]", "step", "at least one step"),
        ("drive.repeat.first=3", "repeat", "of the 4 that there are"),
        ("drive.repeat.last=5", "repeat", "of the 4 that there are"),
        ("drive.repeat.many=5", "repeat.many", "a key of [drive.repeat]"),
        ("drive.repeat=5", "repeat", "a table [drive.repeat]"),
        ("drive.dwell=1 s", "dwell", "no such key beside drive.step"),
        ("drive.preload=1 mN", "preload", "no such key where steps name forces"),
        ("drive.step.1.until=1 um", "preload", "as no step names one"),
        ("output.snapshots=[\"every 0.1 V\"]", None, "a distance such as"),
    ],
)  # fmt: skip
def test_what_is_wrong_names_the_step_and_its_key(override, key, told):
    found = problems(override)
    assert told in found[f"drive.{key}" if key else "output.snapshots"].expected


def test_a_step_may_lack_nothing_and_say_nothing_twice():
    found = problems(
        steps=STEPS.replace('do = "hold"', 'do = "hold"\nduration = "1 s"').replace('speed = "10 um/s"\nu', "u")
    )
    assert found["drive.step.1.speed"].value is MISSING and "which means the same" in found["drive.step.2.for"].expected
    found = problems(steps=STEPS.split("[[drive.step]]", 2)[2].join(["[[drive.step]]", ""]))
    assert "out of reach" in found["drive.step"].expected


def test_a_followed_file_belongs_to_the_scene(tmp_path):
    steps = STEPS.replace('do = "hold"\nof = "load"\nfor = "0.5 s"', 'do = "follow"\nof = "load"\nfile = "load.csv"')
    assert "load.csv" in str(problems(steps=steps, folder=tmp_path)["drive.step.2.file"].cure)
    (tmp_path / "load.csv").write_text("time (s), force (mN)\n1, 4\n2, 5\n2, 6\n")
    assert "times that grow" in problems(steps=steps, folder=tmp_path)["drive.step.2.file"].cure
    (tmp_path / "load.csv").write_text("time (s), force (mN)\n1, 4\n2, 5\n3, 5\n")
    assert read_path(tmp_path / "load.csv", "load") == ((1.0, 2.0, 3.0), (4e-3, 5e-3, 5e-3))
    found = scene(steps=steps, folder=tmp_path)
    assert found.drive.step[1].file == str(tmp_path / "load.csv") and found.given.to_toml().count(str(tmp_path)) == 1
    assert parse_scene(found.to_toml()) == parse_scene(found.given.to_toml()) == found
    files = contents_of(found)
    assert list(files) == ["drive.step.2.file"]
    # Where it lies does not matter, what is in it does.
    head = {"scene": found.to_toml(), "files": files, "state": {"phase": 0, "force": 0.0}}
    (tmp_path / "moved").mkdir()
    (tmp_path / "load.csv").rename(tmp_path / "moved" / "load.csv")
    moved = scene(steps=steps, folder=tmp_path / "moved")
    assert review(head, moved, (), tmp_path) == []
    (tmp_path / "moved" / "load.csv").write_text("time (s), force (mN)\n1, 4\n2, 5\n3, 6\n")
    moved = scene(steps=steps, folder=tmp_path / "moved")
    assert review(head, moved, ("drive.step",), tmp_path) == ["drive.step"]
    head["state"]["phase"] = next(k for k, phase in enumerate(drive_of(moved).phases) if phase.stage == 2)
    with pytest.raises(SceneError, match="step 2 has begun, and the file that it follows has other contents now"):
        review(head, moved, ("drive.step",), tmp_path)


def test_steps_to_come_may_change_and_those_that_have_begun_may_not(tmp_path):
    head = {"scene": scene().to_toml(), "files": {}, "state": {"phase": 1, "force": 4e-3}}
    assert drive_of(scene()).phases[1].name == "hold"
    later = scene("drive.step.3.cycles=9", "drive.repeat.times=7")
    assert review(head, later, ("drive.step", "drive.repeat"), tmp_path) == ["drive.repeat.times", "drive.step"]
    with pytest.raises(SceneError, match=r"add --allow drive\.step") as caught:
        review(head, later, (), tmp_path)
    assert "add --allow drive.repeat" in str(caught.value)
    for begun in ("drive.step.1.until=3 mN", "drive.step.2.duration=1 s"):
        with pytest.raises(SceneError, match="the hold has begun"):
            review(head, scene(begun), ("drive.step",), tmp_path)
    with pytest.raises(SceneError, match="programme of the other kind"):
        review(head, scene(steps='speed = "1 um/s"\npreload = "4 mN"'), ("drive",), tmp_path)


def test_durations_add_up_to_a_finite_programme():
    held = Step("hold", DISPLACEMENT, duration=2.0, until=((FORCE, 1e-3),))
    (_, _, phase) = phases_of((APPROACH, held), MACHINE)
    assert phase.duration == 2.0 and phase.name == "dwell" and math.isfinite(phase.duration)
