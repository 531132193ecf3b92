"""The loading programme: no jump in position or velocity, the stated overshoot and dwell."""

import itertools
import math

import numpy as np
import pytest

from pgfmd.physics.drive import DETACHED, OVERSHOOT, PRELOAD, Drive, Phase

DRIVES = {
    "turn": Drive(2e-6, 1e-2, 2e-6, 0.03, 0.0, 1e-6),
    "faster back": Drive(1e-6, 1e-2, 25e-6, 0.03, 0.0, 1e-6),
    "dwell": Drive(2e-6, 1e-2, 2e-6, 0.03, 1.5, 1e-6),
    "dwell, slower back": Drive(2e-6, 1e-2, 0.5e-6, 0.03, 1e-4, -1e-6),
}
APPROACH_TIME = 0.7


def played(drive, times):
    """Position relative to the start, phase by phase, with the preload met after APPROACH_TIME."""
    result, start, position = np.empty_like(times), 0.0, 0.0
    for phase in drive.phases:
        length = APPROACH_TIME if phase.ends_with == PRELOAD else phase.duration
        here = times >= start
        result[here] = [position + phase.displacement(time - start) for time in times[here]]
        if math.isfinite(length):
            position += phase.displacement(length)
            start += length
    return result


@pytest.mark.parametrize("name", DRIVES)
def test_velocity_is_continuous_from_phase_to_phase(name):
    phases = DRIVES[name].phases
    for before, after in itertools.pairwise(phases):
        assert before.velocity_end == after.velocity_start
    assert phases[0].velocity_start == -DRIVES[name].speed
    assert phases[-1].velocity_end == DRIVES[name].retract_speed
    assert (phases[0].ends_with, phases[-1].ends_with) == (PRELOAD, DETACHED)
    assert all(math.isfinite(phase.duration) and not phase.ends_with for phase in phases[1:-1])


@pytest.mark.parametrize("name", DRIVES)
def test_position_has_no_step_and_velocity_no_kink(name):
    drive = DRIVES[name]
    times = np.linspace(0, APPROACH_TIME + 0.03 + drive.dwell + 0.1, 200_001)
    position = played(drive, times)
    step = times[1] - times[0]
    fastest = max(drive.speed, drive.retract_speed)
    assert np.abs(np.diff(position)).max() <= fastest * step * (1 + 1e-9)
    change = np.abs(np.diff(position, 2)) / step**2
    accelerations = [abs(p.velocity_end - p.velocity_start) / p.duration for p in drive.phases[1:-1]]
    assert change.max() == pytest.approx(max(accelerations), rel=1e-2)


@pytest.mark.parametrize("name", ["turn", "dwell"])
def test_overshoot_is_v_T_over_4(name):
    drive = DRIVES[name]
    times = np.linspace(APPROACH_TIME, APPROACH_TIME + 0.03 + drive.dwell, 100_001)
    overshoot = -drive.speed * APPROACH_TIME - played(drive, times).min()
    assert overshoot == pytest.approx(drive.speed * drive.turn_time / 4, rel=1e-6)


def test_overshoot_with_two_speeds():
    # At constant deceleration (v + v_r)/T it is v^2 T / (2 (v + v_r)).
    drive = DRIVES["faster back"]
    turn = drive.phases[1]
    times = np.linspace(0, turn.duration, 100_001)
    deepest = min(turn.displacement(time) for time in times)
    expected = drive.speed**2 * drive.turn_time / (2 * (drive.speed + drive.retract_speed))
    assert -deepest == pytest.approx(expected, rel=1e-6)


def test_a_symmetric_turn_ends_where_it_began():
    assert DRIVES["turn"].phases[1].displacement(0.03) == pytest.approx(0.0, abs=1e-22)


@pytest.mark.parametrize("name", ["dwell", "dwell, slower back"])
def test_the_dwell_is_exact_and_stands_still(name):
    drive = DRIVES[name]
    names = [phase.name for phase in drive.phases]
    assert names == ["approach", "turn", "dwell", "turn", "retract"]
    dwell = drive.phases[2]
    assert dwell.duration == drive.dwell and dwell.fastest == 0.0
    assert all(dwell.displacement(time) == 0.0 for time in (0.0, 0.3 * drive.dwell, drive.dwell))
    assert drive.phases[1].duration + drive.phases[3].duration == drive.turn_time


def test_without_dwell_there_is_none():
    assert [phase.name for phase in DRIVES["turn"].phases] == ["approach", "turn", "retract"]


def test_the_automatic_turn_of_a_scene_overshoots_by_its_share_of_the_range():
    from pgfmd.scene import load_scene

    scene = load_scene("tri-tack", ["drive.speed=3 um/s"])
    assert scene.drive.speed * scene.drive.turn_time / 4 == pytest.approx(OVERSHOOT * scene.adhesion.range, rel=1e-12)


def test_fastest_is_the_larger_end():
    assert Phase("turn", -1.0, 3.0, 2.0).fastest == 3.0
    assert Phase("turn", -4.0, 3.0, 2.0).fastest == 4.0
    assert Phase("retract", 2.0, 2.0).displacement(1.5) == 3.0
