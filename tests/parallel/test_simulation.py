"""A whole tack test on any number of ranks: the same bits as on one."""

import functools
import math

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.results import load
from pgfmd.runner import run_scene
from pgfmd.scene import load_scene, scene_from_mapping
from pgfmd.solver.simulation import Observer

pytestmark = pytest.mark.mpi

PLANE = {
    "punch": {"pattern": "sinusoid", "wavelength": "50 um", "amplitude": "1 um"},
    "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495},
    "rheology": {"model": "single", "modulus_ratio": 250, "relaxation_time": "400 us"},
    "adhesion": {"work_of_adhesion": "50 mJ/m^2", "range": "0.5 um"},
    "drive": {"speed": "1 um/s", "preload": "1 mN"},
    "grid": {"n": 16, "length": "100 um"},
}
SCENES = {
    "one element": ("tri-tack", ["grid.n=32", "drive.preload=5 mN"]),
    "five elements, odd grid, dwell": (
        "hex-tack",
        ["grid.n=27", "rheology.model=geometric", "rheology.relaxation_time=40 us", "rheology.elements=5",
         "rheology.time_ratio=6", "rheology.exponent=0.8", "drive.speed=20 um/s", "drive.dwell=10 ms",
         "drive.preload=5 mN"],
    ),
    "elastic, jumps": ("flat-punch", ["grid.n=32", "rheology.model=elastic"]),
    "free, jitter": (
        "tri-tack",
        ["grid.n=32", "substrate.boundary=free", "punch.height_jitter=50 nm", "drive.preload=2 mN"],
    ),
    "without audit": ("tri-tack", ["grid.n=24", "output.energy=false", "drive.preload=2 mN"]),
    "whole plane": (PLANE, []),
    "quasi-static": ("tri-tack", ["grid.n=32", "solver.scheme=quasistatic", "drive.preload=1 mN", "solver.accuracy=0.03"]),
    "whole plane, quasi-static": (PLANE, ["solver.scheme=quasistatic", "solver.accuracy=0.03"]),
    "without symmetry": ("tri-tack", ["grid.n=24", "drive.preload=2 mN", "solver.symmetry=none"]),
    "quarter, free": ("flat-punch", ["grid.n=26", "substrate.boundary=free"]),
    "programme": (
        "flat-punch",
        ["grid.n=22", "rheology.relaxation_time=20 ms", "rheology.modulus_ratio=10",
         'drive.step=[{do="approach",speed="20 um/s",until=["2 mN","0.5 mm^2"]},{do="hold",of="load",for="20 ms"},'
         '{do="hold",for="20 ms"},{do="ramp",rate="-100 mN/s",until="-1 mN"},{do="retract",speed="20 um/s"}]',
         "drive.repeat={times=2,first=2,last=4}"],
    ),
    "spring": ("tri-tack", ["grid.n=24", "drive.preload=2 mN", "drive.speed=20 um/s", "drive.machine_stiffness=300 N/m"]),
    "load": ("tri-tack", ["grid.n=24", "drive.preload=2 mN", "drive.speed=20 um/s", "drive.control=load"]),
    "another grid": ("tri-tack", ["grid.n=72", "drive.preload=1 mN"]),
}  # fmt: skip


class Curve(Observer):
    """Every step's numbers, and the times at which it asks for a step to end."""

    def __init__(self, times=()):
        self.times, self.rows, self.kinds = list(times), [], []

    def next_time(self, simulation):
        return next((time for time in self.times if time > simulation.state.time), math.inf)

    def observe(self, simulation, event):
        state = simulation.state
        self.kinds.append(event.kind)
        self.rows.append(
            (state.time, state.position, state.force, state.contact_points, state.smallest_gap, state.far_displacement,
             state.energies.residual, state.energies.viscous, state.energies.elastic, event.released)
        )  # fmt: skip


@functools.cache
def run(name, alone=False):
    """A run of a scene on all ranks, or on each alone, its state, and its curve; made once, as tests only look at
    them."""
    comm = MPI.COMM_SELF if alone else MPI.COMM_WORLD
    source, overrides = SCENES[name]
    load = load_scene if isinstance(source, str) else scene_from_mapping
    simulation = assemble(load(source, overrides), comm)
    curve = Curve([0.1, 0.2])
    simulation.observers.append(curve)
    return simulation, simulation.run(), curve


@pytest.mark.parametrize("name", SCENES)
def test_a_tack_test_has_the_same_bits_on_any_number_of_ranks(name):
    comm = MPI.COMM_WORLD
    shared, state, curve = run(name)
    alone, expected, expected_curve = run(name, alone=True)
    assert state.finished == expected.finished == "detached"
    assert curve.kinds == expected_curve.kinds
    assert len(curve.rows) > 30
    np.testing.assert_array_equal(np.array(curve.rows), np.array(expected_curve.rows))
    assert state.counters == expected.counters
    assert (state.pull_off_force, state.snap_in_force) == (expected.pull_off_force, expected.snap_in_force)
    assert state.energies == expected.energies
    for field in ("surface_displacement", "effective_traction", "traction"):
        whole = np.concatenate(comm.allgather(getattr(state, field)))
        np.testing.assert_array_equal(whole, getattr(expected, field))
    branches = np.concatenate(comm.allgather(state.internal_variables), axis=1)
    np.testing.assert_array_equal(branches, expected.internal_variables)
    np.testing.assert_array_equal(shared.points.total, alone.points.total)


def test_events_come_in_order_and_at_the_times_asked_for():
    simulation, state, curve = run("one element")
    assert curve.kinds[0] == "start" and curve.kinds[-1] == "end"
    assert curve.kinds.count("preload") == 1
    met = [row[0] for row, kind in zip(curve.rows, curve.kinds, strict=True) if kind == "time"]
    assert met == pytest.approx([0.1, 0.2], rel=1e-12)
    at_preload = curve.rows[curve.kinds.index("preload")]
    assert at_preload[2] == pytest.approx(5e-3, rel=1e-4)
    assert simulation.scheme.pairs == state.counters.transform_pairs


def test_all_ranks_take_the_same_decisions():
    comm = MPI.COMM_WORLD
    _, state, curve = run("elastic, jumps")
    assert all(other == (state.counters, curve.kinds) for other in comm.allgather((state.counters, curve.kinds)))
    assert state.counters.jumps > 0


def test_snapshots_at_the_start_twice_at_once_and_around_the_preload(tmp_path_factory):
    """Wanted times that are over, or equal, must not ask for a step of no length; each gets its frame at its time."""
    comm = MPI.COMM_WORLD
    folder = comm.bcast(str(tmp_path_factory.mktemp("snapshots")) if comm.rank == 0 else None)
    wanted = '["1e-9 s", "1 s", "1 s", "0.5 t_pl", "1.1 t_pl", "1.1 t_pl", "every 2 s"]'
    scene = load_scene("hex-tack", ["grid.n=40", "drive.preload=2 mN", f"output.snapshots={wanted}"])
    record = run_scene(scene, comm, folder, lambda line: None)
    if comm.rank == 0:
        with load(folder) as results:
            labels, times = list(results.labels), np.asarray(results.fields["time"])
            curve = np.asarray(results.curve["time [s]"])
        assert record["finished"] == "detached"
        assert labels.count("t = 1 s") == 2 and labels.count("1.1 t_pl") == 2
        assert {"t = 1e-09 s", "0.5 t_pl", "preload", "largest tension"} <= set(labels)
        assert np.all(times[[label == "t = 1 s" for label in labels]] == pytest.approx(1.0, abs=1e-12))
        assert np.all(np.diff(curve) > 0.0) and np.all(np.diff(times[:-1]) >= 0.0)
        # Of the multiples of the interval each has one.
        labels = np.array(labels)
        assert curve[-1] > 4.0
        for k in range(1, int(curve[-1] / 2.0) + 1):
            assert list(times[labels == f"t = {2 * k} s"]) == [pytest.approx(2.0 * k, abs=1e-12)]
        assert len(labels) == 8 + int(curve[-1] / 2.0)
    comm.Barrier()
