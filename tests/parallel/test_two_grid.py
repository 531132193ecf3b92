"""Conjugate gradients with a coarser grid: the same bits on any number of ranks, and after a restart."""

import math
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import pgfmd.runner
from pgfmd.errors import Stopped
from pgfmd.restart.bitwise_comparison import differences
from pgfmd.runner import run_scene
from pgfmd.scene import load_scene
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.two_grid import Cells, coarse_points_of
from tests.stopper import StopAfter

pytestmark = pytest.mark.mpi

# Halves, quarters and wholes, blocks that no share of rows divides, more ranks than rows of cells, both boundaries.
SCENES = {
    "half, mixed": ["tri-tack", "grid.n=80", "drive.preload=2 mN", "solver.precision=mixed"],
    "quarter": ["flat-punch", "grid.n=48", "drive.preload=1 mN", "punch.radius=100 um"],
    "whole, free": [
        "hex-tack", "grid.n=56", "drive.preload=1 mN", "drive.speed=20 um/s", "substrate.boundary=free",
        "solver.symmetry=none",
    ],
    "half, sprung": [
        "tri-tack", "grid.n=20", "drive.preload=1 mN", "drive.speed=20 um/s", "drive.machine_stiffness=2 kN/m",
    ],
    "few cells": ["tri-tack", "grid.n=20", "drive.preload=1 mN", "drive.speed=20 um/s"],
}  # fmt: skip


@pytest.fixture
def folder(tmp_path_factory):
    comm = MPI.COMM_WORLD
    yield Path(comm.bcast(str(tmp_path_factory.mktemp("two-grid")) if comm.rank == 0 else None))
    comm.Barrier()


@pytest.mark.parametrize("name", SCENES)
def test_a_run_has_the_same_bits_on_any_number_of_ranks_and_after_a_stop(name, folder, monkeypatch):
    comm, (source, *changes) = MPI.COMM_WORLD, SCENES[name]
    scene = load_scene(source, [*changes, "solver.coarse_grid=always", "solver.accuracy=0.05"])
    record = run_scene(scene, comm, folder / "whole", lambda line: None)
    assert record["finished"] == "detached"
    if comm.rank == 0:
        run_scene(scene, MPI.COMM_SELF, folder / "alone", lambda line: None)
        assert not differences(folder / "whole", folder / "alone")
    comm.Barrier()
    monkeypatch.setattr(pgfmd.runner, "StopSignals", StopAfter)
    monkeypatch.setattr(StopAfter, "steps", record["steps"] // 2)
    with pytest.raises(Stopped):
        run_scene(scene, comm, folder / "stopped", lambda line: None)
    monkeypatch.setattr(StopAfter, "steps", math.inf)
    run_scene(scene, comm, folder / "stopped", lambda line: None)
    assert not differences(folder / "whole", folder / "stopped")


@pytest.mark.parametrize(("n", "m", "mirror"), [(64, 8, ""), (64, 8, "x"), (96, 4, "xy"), (70, 5, "x")])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_each_rank_has_the_same_cells_and_its_part_of_the_same_points(n, m, mirror, dtype):
    found = []
    for each in (MPI.COMM_WORLD, MPI.COMM_SELF):
        points = PunchPoints(Grid(n, 1e-3), 0.25e-3, each, mirror=mirror)
        coarse = coarse_points_of(points, m, MPI.COMM_SELF)
        cells, rng = Cells(points, coarse), np.random.default_rng(7)
        mine = slice(points.first_point, points.first_point + points.size)
        r, k = (rng.standard_normal(points.total // points.images).astype(dtype)[mine] for _ in "rk")
        s, t = rng.standard_normal((2, coarse.size))
        means, d = np.zeros(cells.shape), points.zeros(dtype)
        cells.means(r, means)
        cells.turn(r, k, s, t, means, d)
        rough = cells.roughness(r, k, means, np.zeros((1, points.rows)))
        found.append((means, np.concatenate(each.allgather(d)), rough))
    for here, alone in zip(*found, strict=True):
        np.testing.assert_array_equal(here, alone)
