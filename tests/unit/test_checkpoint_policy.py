"""When a run writes a checkpoint and when it stops, by a clock that the test sets."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from pgfmd.restart import checkpoint_policy as module
from pgfmd.restart.checkpoint_policy import CheckpointPolicy, Timing
from pgfmd.restart.checkpoints import Saved
from pgfmd.restart.history import History

STEP, SAVE = 0.5, 4.0


class Signals:
    stop, patience, asked = 0, 6.0, False

    def take_save(self):
        return False

    def heard(self):
        pass


class Run:
    """A run whose steps and checkpoints take as long as the test says."""

    def __init__(self, monkeypatch, timing, bytes_expected=0, ranks=1):
        self.now, self.saves, self.said = 1000.0, [], []
        clock = SimpleNamespace(time=lambda: self.now, perf_counter=lambda: self.now)
        monkeypatch.setattr(module, "time", clock)
        monkeypatch.setattr(module, "numbers_of", lambda packed: {})
        monkeypatch.setattr(module, "arrays_of", lambda packed: {"u": np.zeros(3)})
        counters = SimpleNamespace(steps=0)
        self.state = SimpleNamespace(counters=counters, phase=0, finished="", time=0.0)
        self.simulation = SimpleNamespace(state=self.state, scheme=SimpleNamespace(transform_seconds=0.0))
        outputs = SimpleNamespace(marks=lambda: {}, snapshots=SimpleNamespace(agenda=None))
        self.signals, self.history = Signals(), History(ranks, {}, 0.0)
        comm = SimpleNamespace(rank=0, size=1)
        checkpoints = SimpleNamespace(save=self.save)
        self.keeper = CheckpointPolicy(comm, checkpoints, outputs, self.signals, timing, {}, self.history, bytes_expected,
                             self.said.append)  # fmt: skip

    def save(self, head, arrays):
        self.now += SAVE
        self.saves.append((self.now, self.state.counters.steps, head["why"]))
        return Saved(24, SAVE)

    def step(self):
        self.now += STEP
        self.state.counters.steps += 1
        return self.keeper.attend(self.simulation)

    def until_stopped(self, most=1000):
        while not self.step():
            assert self.state.counters.steps < most
        return self.now


def test_checkpoints_come_when_it_is_time(monkeypatch):
    run = Run(monkeypatch, Timing(every=60.0))
    assert not run.keeper.attend(run.simulation) and len(run.saves) == 1
    for _ in range(300):
        run.step()
    times = np.diff([time for time, _, _ in run.saves])
    assert len(times) == 2 and np.all((times >= 60.0) & (times < 60.0 + SAVE + 2 * STEP))
    assert len(run.said) == 2 and run.said[0].startswith("checkpoint  t ")


def test_a_new_phase_and_the_end_are_saved_unless_all_is_off(monkeypatch):
    for every, expected in ((1e9, [0, 3, 5]), (math.inf, [5])):
        run = Run(monkeypatch, Timing(every=every))
        run.keeper.attend(run.simulation)
        for step in range(5):
            run.state.phase = int(step >= 2)
            run.state.finished = "detached" if step == 4 else ""
            assert not run.step()
        assert [steps for _, steps, _ in run.saves] == expected


def test_the_limit_is_kept_with_a_checkpoint_that_takes_long(monkeypatch):
    limit = 1200.0
    run = Run(monkeypatch, Timing(limit=limit))
    run.keeper.attend(run.simulation)
    ended = run.until_stopped()
    assert run.keeper.out_of_time and run.saves[-1][2] == run.keeper.why == "the limit of time"
    # No more than what three steps, three checkpoints and a reserve of 3 % take.
    assert limit - 3 * STEP - 3 * SAVE - 0.03 * 200.0 - STEP < ended - SAVE <= ended < limit


def test_before_the_first_checkpoint_its_time_is_guessed_from_its_size(monkeypatch):
    run = Run(monkeypatch, Timing(every=math.inf, limit=1200.0), bytes_expected=int(SAVE * module.SLOW_DISK))
    run.keeper.attend(run.simulation)
    assert run.saves == []
    assert run.until_stopped() < 1200.0 and len(run.saves) == 1


@pytest.mark.parametrize("restore", [0.0, 30.0])
def test_a_link_knows_from_the_last_one_how_long_a_checkpoint_takes(restore, monkeypatch):
    run = Run(monkeypatch, Timing(every=math.inf, limit=1200.0))
    run.history.go_on([{"checkpoint_s": 10 * SAVE, "checkpoints": 10, "wall_s": 1.0}], 500, [])
    run.state.counters.steps = 500
    run.now += restore
    run.keeper.go_on(run.simulation)
    ended = run.until_stopped(most=2000)
    # The time of the restore is no step's.
    assert 1200.0 - 3 * STEP - 3 * SAVE - 0.03 * 200.0 - STEP < ended - SAVE < ended < 1200.0


def test_a_signal_stops_with_a_checkpoint_that_says_so(monkeypatch):
    run = Run(monkeypatch, Timing())
    run.keeper.attend(run.simulation)
    run.step()
    run.signals.stop = 10
    assert run.step() and run.keeper.why == "USR1" and not run.keeper.out_of_time
    assert run.saves[-1][1:] == (2, "USR1")


def test_ranks_have_patience_for_long_steps(monkeypatch):
    run = Run(monkeypatch, Timing(every=math.inf))
    run.keeper.comm.size = 2
    monkeypatch.setattr(run.keeper, "_agree", lambda now: (0, False))
    run.step()
    assert run.signals.patience == module.PATIENCE
    run.now += 10.0
    run.step()
    assert run.signals.patience == pytest.approx(4.0 * 10.5)


def test_a_step_is_waited_for_as_long_as_the_limit_allows(monkeypatch):
    run = Run(monkeypatch, Timing(every=math.inf, limit=1200.0, whose="Slurm job 4711"))
    run.keeper.attend(run.simulation)
    run.step()
    # Three checkpoints, and 3 % of the time that there was; but no three steps.
    latest = 1200.0 - 6.0 - 3.0 * run.keeper._longest_save
    run.now = latest - 0.01
    assert not run.keeper.interrupts()
    run.now = latest + 0.01
    assert run.keeper.interrupts()
    run.keeper.comm.rank = 1
    assert not run.keeper.interrupts()
    run.signals.asked = True
    assert run.keeper.interrupts()
    run.keeper.comm.rank, run.signals.asked = 0, False
    assert run.step() and run.keeper.why == run.saves[-1][2] == "the limit of time (Slurm job 4711)"
