"""Steps that are given up in the middle, by all ranks alike, and leave nothing behind."""

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.files.packing import arrays_of, numbers_of
from pgfmd.scene import load_scene
from pgfmd.solver import interruption
from pgfmd.solver.interruption import Interrupted, Question

SCENE = ["grid.n=20", "drive.preload=0.5 mN", "solver.max_steps=12"]
pytestmark = pytest.mark.mpi
SCHEMES = {
    "quasistatic": ["solver.scheme=quasistatic"],
    "inertialess": [],
    "gfmd": ["solver.scheme=gfmd"],
}


@pytest.fixture(autouse=True)
def _asks_at_every_iteration(monkeypatch):
    monkeypatch.setattr(interruption, "EVERY", 0.0)
    monkeypatch.setattr(interruption, "FIRST", 1)


@pytest.fixture
def comm():
    return MPI.COMM_WORLD


class Wish:
    """Wants steps given up: on the last rank alone, at every so many-th question."""

    def __init__(self, comm, every):
        self.every, self.is_mine, self.asked = every, comm.rank == comm.size - 1, 0

    def __call__(self):
        self.asked += 1
        return self.is_mine and self.asked % self.every == 0


@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_step_that_was_given_up_leaves_the_bits_as_they_were(scheme, comm):
    changes = [*SCENE, *SCHEMES[scheme]]
    whole = assemble(load_scene("tri-tack", changes), comm)
    whole.run()
    simulation, positions = assemble(load_scene("tri-tack", changes), comm), []
    wish = Wish(comm, 61 if scheme == "quasistatic" else 29)
    simulation.run(interrupt=wish, attend=lambda run: positions.append(run.state.counters.steps))
    assert numbers_of(simulation.state) == numbers_of(whole.state)
    before, after = arrays_of(whole.state), arrays_of(simulation.state)
    assert before.keys() == after.keys() and all(np.array_equal(before[name], after[name]) for name in before)
    # After a step that was given up, the state is shown once more.
    given_up = len(positions) - len(set(positions))
    assert comm.allgather(given_up) == [given_up] * comm.size
    assert (given_up == 0) == (scheme == "gfmd")


def test_a_run_that_is_stopped_in_the_middle_of_a_step_has_the_state_of_before(comm):
    simulation = assemble(load_scene("tri-tack", [*SCENE, *SCHEMES["quasistatic"]]), comm)
    wants, seen = [], []

    def attend(run):
        seen.append((run.state.counters.steps, {name: array.copy() for name, array in arrays_of(run.state).items()}))
        wants.extend([True] * (run.state.counters.steps == 5))
        return len(seen) > 1 and seen[-2][0] == seen[-1][0]

    state = simulation.run(attend=attend, interrupt=lambda: comm.rank == 0 and bool(wants))
    assert state.counters.steps == 5 and not state.finished
    before, after = seen[-2][1], arrays_of(state)
    assert all(np.array_equal(before[name], after[name]) for name in before)


def test_a_start_that_is_given_up_says_so(comm):
    simulation = assemble(load_scene("hertz", ["grid.n=16", "solver.scheme=quasistatic"]), comm)
    with pytest.raises(Interrupted):
        simulation.run(interrupt=lambda: True)
    assert simulation.scheme.solver.cg.poll() is None


def test_questions_are_as_far_apart_as_the_clock_of_the_first_rank_says(comm, monkeypatch):
    monkeypatch.setattr(interruption, "EVERY", 1.0)
    monkeypatch.setattr(interruption, "FIRST", 2)
    asked, now = [], 0.0
    monkeypatch.setattr(interruption.time, "perf_counter", lambda: now)
    question = Question(comm, lambda: asked.append(now) or False)
    for _ in range(400):
        # An iteration takes 10 ms here, and other ranks' clocks stand still.
        now += 0.01 if comm.rank == 0 else 0.0
        question()
    assert comm.allgather(len(asked)) == [len(asked)] * comm.size
    if comm.rank == 0:
        np.testing.assert_allclose(np.diff(asked), [0.08, 0.32, 1.0, 1.0, 1.0], rtol=1e-9)
