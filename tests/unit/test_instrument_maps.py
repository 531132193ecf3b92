"""Files of instruments, read by SurfaceTopography in a process of its own."""

import importlib.util
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest

from pgfmd.maps.preparing import prepared
from pgfmd.maps.raw import MapKeys

from .map_files import lopsided, middles
from .test_map_files import face_of, refusals

# Not imported here: beside it numba keeps no compiled kernels, which other tests of this process ask for.
pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("SurfaceTopography") is None, reason="SurfaceTopography is not installed"
)
SIZE = (900e-6, 800e-6)
PROGRAM = """
import os, pickle, sys
from pathlib import Path
from pgfmd.maps.worker import instrument, surface_topography

folder = Path(sys.argv[1])
z, library = __import__("numpy").load(folder / "z.npy"), surface_topography()
topography = library.Topography(1e6 * z.T, (900.0, 800.0), unit="um")
topography.to_x3p(str(folder / "map.x3p"))
topography.to_netcdf(str(folder / "map.nc"))
topography.to_matrix(str(folder / "map.txt"))
(folder / "map.pickle").write_bytes(pickle.dumps(instrument(folder / "map.x3p")))
print("peaks", instrument(folder / "map.x3p").peaks, instrument(folder / "map.txt").peaks)
__import__("scipy.io").io.savemat(folder / "map.mat", {"z": z})
for name in ("map.mat", "odd.dem"):
    try:
        instrument(folder / name)
    except ValueError as error:
        print(error)
from mpi4py import MPI
print("MPI is", MPI.Is_initialized())
"""
LAUNCHED = {"OMPI_COMM_WORLD_SIZE": "2", "OMPI_COMM_WORLD_RANK": "0", "PMIX_RANK": "0"}
"""What a rank of a launcher sees, which would wait for whoever starts MPI."""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The lopsided face as SurfaceTopography writes it, peaks up, so turned over; and what the program said."""
    folder = tmp_path_factory.mktemp("maps")
    np.save(folder / "z.npy", -lopsided())
    # As many bytes as a square of heights without any mark has.
    (folder / "odd.dem").write_bytes(bytes(2 * 24 * 24))
    surroundings = os.environ | LAUNCHED | {"MPI4PY_RC_INITIALIZE": "0"}
    command = [sys.executable, "-c", PROGRAM, str(folder)]
    done = subprocess.run(command, check=True, timeout=100, env=surroundings, capture_output=True, text=True)
    return folder, done.stdout


def test_a_file_of_an_instrument_says_all(written):
    # Not by another start of the program that reads it, which takes seconds: see the one of HDF5 in test_map_files.
    found = pickle.loads((written[0] / "map.pickle").read_bytes())
    heights, facts = prepared(found, MapKeys(), 375e-6)
    np.testing.assert_allclose(heights, lopsided(), atol=1e-11)
    assert facts.size == pytest.approx(SIZE, rel=1e-9) and (facts.peaks, facts.unit) == (("up", "file"), ("m", "file"))
    assert not facts.problems and facts.kind == "a file of the format x3p"


@pytest.mark.parametrize("name", ["map.nc", "map.txt"])
def test_what_the_library_writes_for_others_has_the_same_axes_unit_and_size(written, name):
    """Which way the heights grow the scene has to say."""
    face = face_of(written[0], name, file_peaks="up")
    assert face.map.size == pytest.approx(SIZE, rel=1e-6)
    x, y = middles(30, SIZE[0])[3:-3], middles(20, SIZE[1])[3:-3]
    np.testing.assert_allclose(face.heights(x, y[:, None]), lopsided()[3:-3, 3:-3], atol=1e-11)
    assert set(refusals(written[0], name)) == {"punch.file_peaks"}


def test_it_starts_no_mpi_and_tells_what_it_can_not_read(written):
    peaks, matlab, refusal, mpi = written[1].splitlines()[-4:]
    assert peaks == "peaks up None" and matlab.endswith("save its map as .npy, z[iy, ix]")
    assert refusal.startswith("unknown kind of file: SurfaceTopography ") and mpi == "MPI is False"
