"""Height maps on several ranks: one of them reads."""

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.assemble import heights_of, share_map
from pgfmd.errors import PgfmdError
from pgfmd.maps import raw
from pgfmd.maps.reading import read_map
from pgfmd.physics.heightfile import forget
from pgfmd.scene import load_scene
from pgfmd.symmetry import points_of

pytestmark = pytest.mark.mpi

HEIGHTS = np.random.default_rng(8).normal(size=(20, 30))
"""In micrometres."""


def scene_of(path, *more):
    size = 'punch.file_size=["0.9 mm", "0.8 mm"]'
    return load_scene("tri-tack", ["grid.n=64", "punch.pattern=file", f"punch.file={path}", size, *more])


@pytest.mark.parametrize("large", [False, True])
def test_one_rank_reads_and_all_have_the_same_heights(mpi_tmp_path, monkeypatch, large):
    comm, path, reads = MPI.COMM_WORLD, mpi_tmp_path / ("map.npy" if large else "map.csv"), []
    if comm.rank == 0:
        np.save(path, 1e-6 * HEIGHTS) if large else np.savetxt(path, HEIGHTS, delimiter=",")
    comm.Barrier()
    if large:
        monkeypatch.setattr(raw, "WHOLE", 100)
    monkeypatch.setattr("pgfmd.maps.reading.read_map", lambda name: reads.append(name) or read_map(name))
    forget()
    scene = scene_of(
        path, f"punch.file_unit={'m' if large else 'um'}", "punch.file_peaks=down", "punch.file_detrend=tilt"
    )
    share_map(scene, comm)
    found = comm.allgather(heights_of(scene, points_of(scene, "", comm)))
    # One on the disk each maps into its memory.
    assert len(reads) == (1 if large or comm.rank == 0 else 0)
    share_map(scene, MPI.COMM_SELF)
    np.testing.assert_array_equal(np.concatenate(found), heights_of(scene, points_of(scene, "", MPI.COMM_SELF)))


def test_all_ranks_are_told_what_a_scene_has_to_say(mpi_tmp_path):
    path = mpi_tmp_path / "map.csv"
    if MPI.COMM_WORLD.rank == 0:
        np.savetxt(path, HEIGHTS, delimiter=",")
    MPI.COMM_WORLD.Barrier()
    with pytest.raises(PgfmdError, match=r"(?s)2 problems .*file_peaks = .*file_unit = "):
        share_map(scene_of(path), MPI.COMM_WORLD)
