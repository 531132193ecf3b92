"""Scenes of the fuzzer on all ranks together: the same bits as on one."""

from pathlib import Path

import pytest
from mpi4py import MPI

from pgfmd.runner import run_scene
from pgfmd.scene.reading import parse_scene
from tests.fuzz.comparing import compared
from tests.fuzz.files import write_files
from tests.fuzz.scenes import make

pytestmark = pytest.mark.mpi

SCENES = (9, 12, 27, 31)
"""Scenes of seed 3 that are run within a second."""


def silent(line):
    pass


@pytest.mark.parametrize("index", SCENES)
def test_fuzzed_scenes_have_the_same_bits_on_all_ranks(tmp_path_factory, index):
    comm, made = MPI.COMM_WORLD, make(3, index, "relate")
    folder = Path(comm.bcast(str(tmp_path_factory.mktemp("fuzzed")) if comm.rank == 0 else None))
    if comm.rank == 0:
        write_files(folder, made.natural.length)
    comm.Barrier()
    scene = parse_scene(made.text, folder=folder)
    run_scene(scene, comm, folder / "together", silent)
    faults = None
    if comm.rank == 0:
        run_scene(scene, MPI.COMM_SELF, folder / "alone", silent)
        faults = compared(folder / "alone", folder / "together")
    assert comm.bcast(faults) == []
