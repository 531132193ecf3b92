"""Any number of points and ranks: what MPI can't count goes in pieces or is refused alike, and the start shrinks with the
ranks. Small stand-ins for large numbers."""

import gc
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.errors import ResultError, RunError
from pgfmd.files import row_pieces
from pgfmd.forecast.estimate import memory_of
from pgfmd.host import launch
from pgfmd.output.fields_file import FieldsFile
from pgfmd.output.outputs import Outputs
from pgfmd.physics.film import Film
from pgfmd.scene import load_scene
from pgfmd.solver import patches
from pgfmd.solver.far_field import far_weights
from pgfmd.solver.grid import Grid, PunchPoints, share
from pgfmd.solver.node import Node

pytestmark = pytest.mark.mpi

N = 30


@pytest.fixture
def comm():
    return MPI.COMM_WORLD


class Refusing:
    """A communicator whose rooted collective calls of arrays fail on rank 0, as MPI's do beyond 2^31."""

    def __getattr__(self, name):
        return getattr(MPI.COMM_WORLD, name)

    def Gatherv(self, *arguments):
        if self.rank == 0:
            raise MPI.Exception(MPI.ERR_ARG)
        return MPI.COMM_WORLD.Gatherv(*arguments)

    gather = Gather = Igatherv = Gatherv


def snapshots(path, comm, parallel, uneven=False):
    """A file with one snapshot of numbers that name their places."""
    first, rows = share(N, comm.size, comm.rank)
    if uneven:
        first, rows = (0, N) if comm.rank == 0 else (N, 0)
    values = np.arange(N * N, dtype=float).reshape(N, N)[first : first + rows]
    fields = FieldsFile(path, comm, N, 1e-3, 0, N, first, rows, np.ones((rows, N), bool), parallel=parallel)
    fields.append("x", 0.0, 0.0, 0.0, values, 2.0 * values, 3.0 * values)
    comm.Barrier()
    return path


@pytest.mark.parametrize("lines", [1, 4, 1000])
def test_snapshots_come_to_the_file_in_pieces(comm, tmp_path, monkeypatch, lines):
    folder = comm.bcast(tmp_path)
    monkeypatch.setattr(row_pieces, "PIECE_BYTES", 8 * N * lines + 8)
    for uneven in (False, True):
        paths = [snapshots(folder / f"gathered {uneven}.h5", Refusing(), False, uneven)]
        if h5py.get_config().mpi:
            paths.append(snapshots(folder / f"together {uneven}.h5", comm, True, uneven))
        for path in paths:
            with h5py.File(path, "r", locking=False) as file:
                for factor, name in enumerate(("gap", "traction", "displacement"), 1):
                    expected = factor * np.arange(N * N, dtype=float).reshape(1, N, N)
                    np.testing.assert_array_equal(file[name], expected)
        comm.Barrier()


def test_a_failure_in_the_middle_of_pieces_is_one_on_all_ranks(comm, tmp_path, monkeypatch):
    """The other ranks send what is left, and hear of it."""
    folder, written = comm.bcast(tmp_path), FieldsFile._write_rows
    monkeypatch.setattr(row_pieces, "PIECE_BYTES", 8 * N)

    def refuse(self, name, frame, start, rows):
        if start == N // 2 and name == "traction":
            raise OSError(28, "No space left on device")
        written(self, name, frame, start, rows)

    monkeypatch.setattr(FieldsFile, "_write_rows", refuse)
    with pytest.raises(ResultError, match="could not be written: No space left") as caught:
        snapshots(folder / "fields.h5", comm, False)
    assert len(set(comm.allgather(str(caught.value)))) == 1


def test_a_failed_collective_write_does_not_leave_the_others_waiting(comm, tmp_path, monkeypatch):
    if not h5py.get_config().mpi:
        pytest.skip("h5py has no MPI")
    monkeypatch.setattr(row_pieces, "PIECE_BYTES", 8 * N)

    def fail(array):
        if comm.rank == comm.size - 1 and array.size and array.flat[0] > 0.0 and array.flat[0] % (2 * N) == 0:
            raise ValueError("no memory for a copy")
        return np.ascontiguousarray(array)

    folder = comm.bcast(tmp_path)
    monkeypatch.setattr(row_pieces, "contiguous", fail)
    with pytest.raises(ResultError, match="no memory for a copy"):
        snapshots(folder / "fields.h5", comm, True)


def test_more_pieces_of_contact_than_mpi_counts_are_refused_alike(comm, monkeypatch):
    monkeypatch.setattr(patches, "MOST", 20)
    points = PunchPoints(Grid(N, 1.0), None, comm)
    contact = (np.arange(N * N) % 2 == 0)[points.first_point : points.first_point + points.size]
    if comm.size == 1:
        assert patches.label_contact(points, contact, periodic=False).count == N // 2
        return
    with pytest.raises(RunError, match=rf"30 x 30 points has \d+ pieces on {comm.size} ranks") as caught:
        patches.label_contact(points, contact, periodic=False)
    assert len(set(comm.allgather(str(caught.value)))) == 1


def test_what_one_rank_found_comes_to_all_in_any_size(comm):
    """Arrays go beside the pickle, in calls of their own."""
    found = launch.on_first(comm, lambda: {"z": np.arange(10**5), "name": "map"})
    assert found["name"] == "map" and found["z"].sum() == 10**5 * (10**5 - 1) // 2


SUBSTRATES = {
    "film": ["substrate.thickness=0.4 mm", "substrate.base=bonded"],
    "free": ["substrate.boundary=free"],
    "single": ["solver.precision=single"],
}


class Ready(Exception):
    """All is made that a scheme begins with."""


@pytest.mark.parametrize("substrate", SUBSTRATES)
def test_the_start_allocates_what_is_foretold_and_shrinks_with_the_ranks(comm, substrate, monkeypatch):
    def make(n):
        return load_scene("tri-tack", [f"grid.n={n}", *SUBSTRATES[substrate]])

    def ready(*arguments):
        raise Ready

    # Buffers of a fixed size, and tables and plans of the first time, don't count.
    monkeypatch.setattr("pgfmd.solver.transform._LARGEST_BATCH", 1)
    assemble(make(32), comm)
    monkeypatch.setattr("pgfmd.schemes.inertialess.scheme.Inertialess", ready)
    scene, shared, moments, trim = make(640), 0, [], Node.trim
    if comm.size > 1:
        node = Node.of(comm)
        gc.collect()
        node.trim()
        node.most_held, shared = node.held, node.held

    def trimmed(self):
        """What is given back here does not count together with what comes later."""
        moments.append(tracemalloc.get_traced_memory()[1] + self.most_held - shared)
        trim(self)
        tracemalloc.reset_peak()
        self.most_held = self.held

    monkeypatch.setattr(Node, "trim", trimmed)
    tracemalloc.start()
    try:
        with pytest.raises(Ready):
            assemble(scene, comm)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    if comm.size > 1:
        # Memory that the ranks of a node share is not Python's.
        peak = max(peak + node.most_held - shared, *moments, 0)
    assert max(comm.allgather(peak)) == pytest.approx(memory_of(scene, comm.size).start, rel=0.1)
    assert max(comm.allgather(peak)) < 1.7 * memory_of(scene).start / comm.size


@pytest.mark.parametrize("n", [37, 64])
def test_far_weights_have_the_same_bits_on_any_number_of_ranks(comm, n):
    compliance = Film(2e6, 0.49, 0.2e-3)
    for radius in (0.25e-3, None):
        shared, alone = (PunchPoints(Grid(n, 1e-3), radius, each) for each in (comm, MPI.COMM_SELF))
        weights = np.concatenate(comm.allgather(far_weights(compliance, shared)))
        np.testing.assert_array_equal(weights, far_weights(compliance, alone))


@pytest.mark.parametrize(
    ("pattern", "precision", "symmetry"),
    [
        ("triangular", "double", "auto"),
        ("triangular", "mixed", "auto"),
        ("flat", "mixed", "auto"),
        ("flat", "mixed", "none"),
    ],
)
def test_steps_allocate_what_is_foretold_of_the_whole_a_half_or_a_quarter(
    comm, pattern, precision, symmetry, monkeypatch
):
    changes = [f"punch.pattern={pattern}", f"solver.precision={precision}", f"solver.symmetry={symmetry}"]
    scene = load_scene("tri-tack", ["grid.n=640", *changes])
    monkeypatch.setattr("pgfmd.solver.transform._LARGEST_BATCH", 1)

    def start(scene):
        simulation = assemble(scene, comm)
        simulation.controller.advance(simulation.state, simulation.phase)
        return simulation

    # Tables and plans of the first time don't count, nor memory that ranks still hold from then.
    start(load_scene("tri-tack", ["grid.n=32", *changes]))
    shared = 0
    if comm.size > 1:
        node = Node.of(comm)
        gc.collect()
        node.trim()
        shared = node.held
    tracemalloc.start()
    try:
        simulation = start(scene)
        assert simulation.points.images == (1 if symmetry == "none" else 4 if pattern == "flat" else 2)
        tracemalloc.reset_peak()
        for _ in range(3):
            simulation.controller.advance(simulation.state, simulation.phase)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    if comm.size > 1:
        # Memory that the ranks of a node share is not Python's.
        peak += node.held - shared
    assert max(comm.allgather(peak)) == pytest.approx(memory_of(scene, comm.size).running, rel=0.1)


@pytest.mark.parametrize(("pattern", "patches"), [("triangular", True), ("flat", True), ("triangular", False)])
def test_a_snapshot_of_full_contact_takes_what_is_foretold(comm, pattern, patches, tmp_path_factory, monkeypatch):
    scene = load_scene("tri-tack", ["grid.n=960", f"punch.pattern={pattern}", f"output.patches={str(patches).lower()}"])
    folder = Path(comm.bcast(str(tmp_path_factory.mktemp("snapshot")) if comm.rank == 0 else None))
    # Buffers of a fixed size don't count.
    monkeypatch.setattr("pgfmd.files.row_pieces.PIECE_BYTES", 2**16)
    monkeypatch.setattr("pgfmd.files.checksum.BLOCK", 2**10)
    simulation = assemble(scene, comm)
    outputs = Outputs(simulation, scene, comm, folder, lambda line: None)
    simulation.state.surface_displacement[:] = simulation.scheme.height
    simulation.state.position = 0.1 * simulation.scheme.law.range
    outputs.snapshots._write_present(simulation, "first")
    tracemalloc.start()
    try:
        simulation.state.force = -1.0
        outputs.snapshots.agenda.tension.take(simulation.state, None, 0.0)
        outputs.snapshots._write_present(simulation, "second")
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        outputs.close()
    assert max(comm.allgather(peak)) == pytest.approx(memory_of(scene, comm.size).output, rel=0.15)
    if patches and comm.rank == 0:
        rows = (folder / "patches.csv").read_text().splitlines()
        assert len(rows) == 3
