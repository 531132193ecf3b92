"""What is run ahead of a run with early snapshots: the same moments on any ranks, also on more than the coarse grid has rows for."""

import pytest
from mpi4py import MPI

from pgfmd.output import snapshot_times
from pgfmd.output.snapshot_times import run_ahead
from pgfmd.scene import load_scene
from pgfmd.solver.interruption import Interrupted

COMM = MPI.COMM_WORLD
SCENE = ["grid.n=32", "drive.speed=25 um/s", "solver.accuracy=0.1", 'output.snapshots=["0.25 t_pl", "0.5 t_pl"]']


class CheckpointPolicy:
    """Wants to stop, or not."""

    def __init__(self, wanted):
        self.wanted = wanted

    def interrupts(self):
        return self.wanted


@pytest.mark.parametrize("most", [1, 2, 8])
def test_the_moments_are_the_same_on_all_and_on_a_part_of_the_ranks(monkeypatch, most):
    scene, said = load_scene("hex-tack", SCENE), []
    alone = run_ahead(scene, MPI.COMM_SELF, lambda line: None)
    monkeypatch.setattr(snapshot_times, "_most_ranks", lambda scene: most)
    together = run_ahead(scene, COMM, said.append, CheckpointPolicy(False))
    assert together == alone and [label for _, label in alone] == ["0.25 t_pl", "0.5 t_pl"]
    assert bool(said) == (COMM.rank == 0)


@pytest.mark.parametrize("most", [1, 8])
def test_a_stop_is_heard_on_all_ranks(monkeypatch, most):
    monkeypatch.setattr(snapshot_times, "_most_ranks", lambda scene: most)
    with pytest.raises(Interrupted):
        run_ahead(load_scene("hex-tack", SCENE), COMM, lambda line: None, CheckpointPolicy(COMM.rank == 0))
