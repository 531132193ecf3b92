"""Retractions much faster or slower than the approach: the turn adds nothing of its own, and the programme ends with
the contact."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.errors import RunError, SceneError
from pgfmd.output.record import record_of
from pgfmd.physics.drive import OVERSHOOT, Drive, Phase, automatic_turn
from pgfmd.restart.history import History
from pgfmd.restart.scene_changes import review
from pgfmd.scene import load_scene
from pgfmd.schemes.inertialess.audit import tension_of
from pgfmd.schemes.inertialess.retardation import IMPLICIT_EULER
from tests.physics.runs import run

FEW = ("grid.n=32", "drive.speed=1 um/s", "solver.accuracy=0.003")
TACK, PUNCH = ("tri-tack", *FEW, "drive.preload=1 mN"), ("flat-punch", *FEW, "drive.preload=5 mN")
HOLD = (*TACK, "drive.dwell=0.5 s")


@pytest.mark.parametrize("dwell", [0.0, 1.0])
@pytest.mark.parametrize("ratio", [1e-6, 0.3, 1.0, 7.0, 1e6])
def test_the_automatic_turn_is_short_on_either_side(ratio, dwell):
    reach, speed = 0.7e-6, 2e-6
    drive = Drive(speed, 1.0, ratio * speed, automatic_turn(reach, speed, ratio * speed), dwell, reach)
    turns = [phase for phase in drive.phases if phase.name == "turn"]
    position, way = 0.0, [0.0]
    for phase in turns:
        way += [position + phase.displacement(time) for time in np.linspace(0.0, phase.duration, 2001)]
        position = way[-1]
    assert -min(way) == pytest.approx(drive.overshoot, rel=1e-5)
    assert position - min(way) == pytest.approx(drive.rise, rel=1e-5)
    longest = max(drive.overshoot, drive.rise)
    assert longest <= OVERSHOOT * reach * (1 + 1e-12)
    assert longest == pytest.approx(OVERSHOOT * reach) if not dwell else longest >= 0.49 * OVERSHOOT * reach


def test_equal_speeds_turn_as_they_always_have():
    for speed in (1e-6, 3e-6, 0.7e-9, 1.3):
        assert automatic_turn(0.264e-6, speed, speed) == 4.0 * OVERSHOOT * 0.264e-6 / speed


def test_only_the_last_way_up_recedes():
    assert not Phase("approach", -1.0, -1.0).recedes(3.0)
    turn = Phase("turn", -1.0, 3.0, 4.0)
    assert not turn.recedes(1.0) and turn.recedes(1.1) and turn.recedes(4.0)
    assert not Phase("turn", -1.0, 0.0, 1.0).recedes(1.0) and not Phase("dwell", 0.0, 0.0, 1.0).recedes(0.5)
    assert Phase("retract", 2.0, 2.0).recedes(0.1)


def test_work_of_separation_is_that_of_the_way_up_alone():
    turn = Phase("turn", -1.0, 1.0, 2.0)
    state = SimpleNamespace(force=-3.0, elapsed=0.0)
    for start, up in ((0.0, 0.5), (1.0, 0.5)):
        state.elapsed, step = start, 2.0 - start
        way = turn.displacement(2.0) - turn.displacement(start)
        trial = SimpleNamespace(step=step, phase=turn, forces=[-3.0], force=-3.0, is_jump=False, runaway=False)
        assert tension_of(state, trial, IMPLICIT_EULER, 3.0 * way) == pytest.approx((-3.0, 3.0 * up), rel=1e-3)


@pytest.mark.parametrize(
    ("scene", "ratio"), [(TACK, 1e-3), (TACK, 100.0), (TACK, 1e6), (PUNCH, 100.0), (PUNCH, 1e6), (HOLD, 100.0)]
)
def test_the_turn_does_not_change_the_pull_off(scene, ratio):
    speed = f"drive.retract_speed={1e-6 * ratio:.9g} m/s"
    found = run(*scene, speed)
    shorter = run(*scene, speed, f"drive.turn_time={0.1 * found.scene.drive.turn_time:.9g} s")
    assert found.state.pull_off_force == pytest.approx(shorter.state.pull_off_force, rel=5e-3)
    # 310 at a ratio of 1e-3, where the elastomer has the time to creep; 80 at 1e6.
    assert found.state.counters.steps < 400
    assert found.simulation.phase.name == "retract"


def test_a_punch_that_comes_off_within_a_long_turn_ends_there():
    found = run(*TACK, "drive.retract_speed=1 m/s", "drive.turn_time=0.17 s")
    state = found.state
    assert state.finished == "detached" and found.simulation.phase.name == "turn"
    # At the end of the turn the punch would be 8 cm further.
    assert state.position < 2e-6 and state.counters.steps < 1000
    assert state.smallest_gap >= found.scene.adhesion.range and state.force == 0.0
    assert found.rows[-1].phase == "turn"
    record = record_of(found.simulation, found.scene, MPI.COMM_SELF, History(1, {}, 0.0))
    assert record["pull_off_force_N"] == -state.pull_off_force > 1e-3 and record["work_of_separation_J"] > 0.0


def test_a_turn_that_follows_a_changed_speed_may_change_along():
    def review_of(phase: int, change: list[str], allow: tuple[str, ...]) -> list[str]:
        head = {"scene": load_scene("tri-tack", before).to_toml(), "files": {}, "state": {"phase": phase, "force": 0.0}}
        return review(head, load_scene("tri-tack", [*before, *change]), allow, Path("out"))

    before, faster, allow = ["drive.dwell=1 s"], ["drive.retract_speed=5 um/s"], ("drive.retract_speed",)
    old = load_scene("tri-tack", before).drive.turn_time
    assert set(review_of(0, faster, allow)) == {"drive.retract_speed", "drive.turn_time"}
    with pytest.raises(SceneError, match=r"--allow drive\.turn_time"):
        review_of(0, [*faster, "drive.turn_time=1 s"], allow)
    # In the dwell half of the turn is over, and as it was.
    with pytest.raises(SceneError, match=f'the dwell has begun: keep drive.turn_time = "{old!r} s"'):
        review_of(2, faster, allow)
    assert review_of(2, [*faster, f"drive.turn_time={old!r} s"], allow) == ["drive.retract_speed"]


def test_a_start_beyond_the_preload_is_refused():
    start = ("hertz", "grid.n=16", "drive.clearance=-20 um")
    for scheme in ("inertialess", "quasistatic"):
        with pytest.raises(RunError, match=r"force is 0\.03.*more than drive\.preload = 1e-05 N.*Raise drive\.preload"):
            run(*start, f"solver.scheme={scheme}", "drive.preload=10 uN")
    begun = run(*start, "drive.preload=40 mN")
    assert begun.state.finished == "detached" and begun.state.preload == pytest.approx(0.04, rel=1e-3)
    assert math.isclose(begun.rows[0].position, -20e-6)
