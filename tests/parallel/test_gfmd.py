"""The paper's scheme on any number of ranks, and the whole plane that it lives on."""

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.output.recorder import Recorder
from pgfmd.physics.halfspace import HalfSpace
from pgfmd.results import load
from pgfmd.runner import run_scene
from pgfmd.scene import load_scene
from pgfmd.solver.far_field import FarPoints, far_weights
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.multiplier import periodic_multiplier
from pgfmd.solver.transform import Convolution, Plane

pytestmark = pytest.mark.mpi

LENGTH, MODULUS = 1.5e-3, 2.65e6
SCENES = {
    "one element": ("tri-tack", ["grid.n=32", "drive.speed=400 um/s", "drive.preload=1 mN"]),
    "five elements, odd grid, dwell": (
        "hex-tack",
        ["grid.n=27", "rheology.model=geometric", "rheology.relaxation_time=400 us", "rheology.elements=5",
         "rheology.time_ratio=6", "rheology.exponent=0.8", "drive.speed=400 um/s", "drive.dwell=5 ms",
         "drive.preload=1 mN"],
    ),
    "spring": ("tri-tack", ["grid.n=24", "drive.speed=1 mm/s", "drive.preload=1 mN", "drive.machine_stiffness=3 kN/m"]),
}  # fmt: skip


@pytest.mark.parametrize("n", [12, 15, 17])
def test_the_plane_is_numpys_transform(n):
    plane = Plane(MPI.COMM_WORLD, n)
    rows = slice(plane.row_start, plane.row_start + plane.real.shape[0])
    whole = np.random.default_rng(3).standard_normal((n, n))
    plane.real[:] = whole[rows]
    plane.forward()
    np.testing.assert_allclose(plane.spectral, np.fft.rfft2(whole)[:, plane.kx], atol=1e-12 * n)
    plane.backward()
    np.testing.assert_allclose(plane.real / n**2, whole[rows], atol=1e-13)
    assert plane.pairs == 1
    # Columns' sums in one order, whatever rank has them.
    sums = np.stack([plane.kx, 0.1 * plane.kx])
    assert plane.total_of(sums)[0] == sum(range(n // 2 + 1))


@pytest.mark.parametrize("n", [64, 65])
def test_the_far_displacement_out_of_the_plane_is_that_of_the_weights(n):
    comm = MPI.COMM_WORLD
    plane = Plane(comm, n)
    compliance = HalfSpace(MODULUS)
    points = PunchPoints(Grid(n, LENGTH), 0.25 * LENGTH, comm)
    x, y = points.coordinates()
    traction = np.exp(-((x - 5e-5) ** 2 + y**2) / (1e-4) ** 2)
    weighted = comm.allreduce(far_weights(compliance, points) @ traction)
    convolve = Convolution(points, n, periodic_multiplier(compliance, LENGTH))
    plane.real[:], first = convolve.whole_cell(traction)
    assert first == plane.row_start
    ours = FarPoints(plane).displacement()
    assert ours == pytest.approx(weighted, rel=2e-5)
    assert all(other == ours for other in comm.allgather(ours))


def test_points_may_follow_the_slabs_of_the_plane():
    comm = MPI.COMM_WORLD
    grid = Grid(22, LENGTH)
    plane = Plane(comm, grid.n)
    points = PunchPoints(grid, 0.2 * LENGTH, comm, (plane.row_start, plane.real.shape[0]))
    even = PunchPoints(grid, 0.2 * LENGTH, comm)
    assert comm.allreduce(points.rows) == points.nb
    _, y = points.coordinates()
    mine = grid.coordinate(plane.row_start + np.arange(plane.real.shape[0]))
    assert np.isin(np.round(y / grid.spacing, 6), np.round(mine / grid.spacing, 6)).all()
    both = [np.concatenate(comm.allgather(np.stack(p.coordinates(), axis=1))) for p in (points, even)]
    np.testing.assert_array_equal(*both)
    assert points.total_of(np.ones((1, points.rows)))[0] == points.nb


@pytest.mark.parametrize("name", SCENES)
def test_a_run_is_the_same_on_any_number_of_ranks(name):
    """To rounding, not to the bit: mpi4py-fft's plans depend on how many lines a rank transforms at a time."""
    source, overrides = SCENES[name]
    curves, states = [], []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        simulation = assemble(load_scene(source, ["solver.scheme=gfmd", *overrides]), comm)
        recorder = Recorder()
        simulation.observers.append(recorder)
        states.append(simulation.run())
        # Without the start.
        curves.append(recorder.rows("time", "force", "u_inf")[1:])
    shared, alone = states
    assert shared.finished == alone.finished == "detached"
    assert shared.counters == alone.counters
    assert shared.counters.transform_pairs == shared.counters.steps == len(curves[0])
    scale = np.abs(curves[1]).max(axis=0)
    np.testing.assert_allclose(curves[0] / scale, curves[1] / scale, rtol=0, atol=1e-9)
    assert shared.energies.viscous == pytest.approx(alone.energies.viscous, rel=1e-9)
    # The same decisions and bits on every rank.
    assert all(other == shared.energies for other in MPI.COMM_WORLD.allgather(shared.energies))


def test_snapshots_hold_the_whole_surface(tmp_path_factory):
    comm = MPI.COMM_WORLD
    folder = comm.bcast(str(tmp_path_factory.mktemp("gfmd")) if comm.rank == 0 else None)
    overrides = [*SCENES["one element"][1], "output.surface=true", "output.every=50", 'output.snapshots=["1.1 t_pl"]']
    record = run_scene(load_scene("tri-tack", ["solver.scheme=gfmd", *overrides]), comm, folder, lambda line: None)
    if comm.rank == 0:
        assert record["scheme"] == "gfmd" and record["steps"] == record["transform_pairs"]
        with load(folder) as results:
            assert {"preload", "1.1 t_pl", "largest tension"} <= set(results.labels)
            surface, displacement = (
                np.asarray(results.fields[name]) for name in ("surface_displacement", "displacement")
            )
            assert len(results.curve) < record["steps"] / 40
        start = (surface.shape[1] - displacement.shape[1]) // 2
        block = surface[:, start : start + displacement.shape[1], start : start + displacement.shape[2]]
        inside = np.isfinite(displacement)
        np.testing.assert_allclose(block[inside], displacement[inside], rtol=1e-6)
        assert np.abs(surface.mean(axis=(1, 2))).max() < 1e-6 * np.abs(surface).max()
    comm.Barrier()
