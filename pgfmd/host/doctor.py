"""Checks whether runs work on this machine. One line per check, with a remedy if it fails. FAIL: no run works, or none
under mpirun. NOTE: runs work, but something is missing.

MPI is only started in child processes with a hard time limit, so that a broken MPI can't stop the other checks.
`python -m pgfmd.host.doctor FILE` is such a child process.
"""

from __future__ import annotations

import functools
import json
import os
import platform
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from .processes import cores
from .ranks import Lack, Trouble, launcher, library_of, maker_of, mpi_of_launcher, mpi_of_mpi4py, on_ranks

_LEAST_PYTHON = (3, 11)
_LARGEST_ERROR = 1e-12
_KERNEL_BYTES = 2**20
"""Upper bound of the size of a compiled kernel [bytes]."""
_PACKAGES = {
    "NumPy": "numpy scipy", "numba": "numba llvmlite", "compiled kernels": "numba llvmlite", "MPI": "mpi4py",
    "mpirun": "mpi4py", "FFTW": "mpi4py-fft", "parallel HDF5": "h5py", "transform": "mpi4py-fft",
}  # fmt: skip
_ONE_MPI = "put the mpirun of mpi4py's MPI first on PATH, or install mpi4py anew with this one's mpicc"
_REINSTALL_H5PY = "build h5py with MPI: HDF5_MPI=ON CC=mpicc pip install --no-binary=h5py --no-build-isolation h5py"


@dataclass(frozen=True)
class Finding:
    """The result of a check: its name, whether runs work, what was found, and a remedy if there is a problem."""

    name: str
    fine: bool
    found: str
    cure: str = ""

    def __str__(self) -> str:
        verdict = "FAIL" if not self.fine else "NOTE" if self.cure else "OK  "
        line = f"{verdict} {self.name}: {self.found}"
        return f"{line}\n     cure: {self.cure}" if self.cure else line


def examine() -> Iterator[Finding]:
    """All checks, one after the other."""
    for name, check in CHECKS.items():
        try:
            yield Finding(name, True, check())
        except Trouble as trouble:
            yield Finding(name, not trouble.stops, str(trouble), trouble.cure)
        except Exception as error:  # a library may fail to load in any way, and the other checks should still run
            cure = f"install it anew: pip install --force-reinstall {_PACKAGES.get(name, 'pgfmd')}"
            yield Finding(name, False, f"{type(error).__name__}: {error}", cure)


def _python() -> str:
    if sys.version_info < _LEAST_PYTHON:
        raise Trouble(platform.python_version(), "use Python 3.11 or newer")
    return platform.python_version()


def _numpy() -> str:
    import numpy
    import scipy

    return f"{numpy.__version__}, scipy {scipy.__version__}"


def _numba() -> str:
    import numba
    import numpy as np

    @numba.njit
    def total(values: np.ndarray) -> float:
        result = 0.0
        for value in values:
            result += value
        return result

    if total(np.arange(5.0)) != 10.0:
        raise Trouble("a compiled sum is wrong", "install numba and llvmlite anew")
    return f"{numba.__version__}, compiles"


def _kernels() -> str:
    from pgfmd.solver.compiled import CURE, place

    folder = place()
    if folder is None:
        raise Lack("can't be kept anywhere, each start compiles anew", CURE)
    try:
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(_KERNEL_BYTES))
    except OSError as error:
        raise Lack(f"can't be kept in {folder}: {error.strerror}", f"make room, or {CURE}") from None
    return f"kept in {folder}"


def _mpi() -> str:
    import mpi4py

    mpi4py.rc.initialize = False
    from mpi4py import MPI

    major, minor = MPI.Get_version()
    return f"{library_of(MPI)}, MPI {major}.{minor}, mpi4py {mpi4py.__version__}"


def _fftw() -> str:
    import importlib.metadata

    import mpi4py

    mpi4py.rc.initialize = False
    from mpi4py_fft import fftw

    for name in ("rfftn", "irfftn", "FFTW_ESTIMATE"):
        if not hasattr(fftw, name):
            raise Trouble(f"mpi4py-fft lacks {name}", "install mpi4py-fft anew, with FFTW's headers present")
    return f"mpi4py-fft {importlib.metadata.version('mpi4py-fft')}"


def _hdf5() -> str:
    import h5py

    version = f"h5py {h5py.__version__}, HDF5 {h5py.version.hdf5_version}"
    if not h5py.get_config().mpi:
        raise Lack(f"{version}, without MPI: rank 0 has to write all fields alone", _REINSTALL_H5PY)
    return f"{version}, with MPI"


def _mpirun() -> str:
    trouble = _trouble_with_mpirun()
    if trouble is not None:
        raise trouble
    return f"{launcher()} belongs to the same MPI"


@functools.cache
def _trouble_with_mpirun() -> Trouble | None:
    try:
        _try_mpirun()
    except Trouble as trouble:
        return trouble
    return None


def _try_mpirun() -> None:
    path = launcher()
    if path is None:
        cure = "install MPI's programs (Debian: openmpi-bin), or load its module"
        raise Lack("neither mpirun nor mpiexec is on PATH: runs on one rank only", cure)
    # A single write, because lines of two processes may be mixed up otherwise.
    probe = "import os; from mpi4py import MPI; os.write(1, b'%d\\n' % MPI.COMM_WORLD.size)"
    own, theirs = mpi_of_mpi4py(), mpi_of_launcher(path)
    try:
        sizes = on_ranks(path, ["-c", probe]).split()
    except Trouble as trouble:
        if maker_of(own) == maker_of(theirs):
            raise
        raise Trouble(f"{path} is of {theirs}, mpi4py of {own}: {trouble}", _ONE_MPI) from None
    if sizes != ["2", "2"]:
        seen = " and ".join(sizes) or "no"
        raise Trouble(f"{path} is of {theirs}, mpi4py of {own}: 2 processes see {seen} ranks", _ONE_MPI)


def _transform() -> str:
    # Problems of mpirun have their own line; this one is about runs on one rank.
    path, ranks = (launcher(), "2 ranks") if _trouble_with_mpirun() is None else (None, "1 rank")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "probe.json")
        on_ranks(path, ["-m", "pgfmd.host.doctor", str(target)])
        if not target.is_file():
            raise Trouble(f"{ranks} left no result", "see the lines above")
        found = json.loads(target.read_text())
    if not found["error"] < _LARGEST_ERROR:
        raise Trouble(f"on {ranks} it differs by {found['error']:.1e} from NumPy's", "install mpi4py-fft and FFTW anew")
    return f"on {ranks} as NumPy's, to {found['error']:.1e}"


def _memory() -> str:
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if pages < 1e9:
        raise Lack(f"{pages / 1e9:.1f} GB", "a run needs about 0.2 GB for each rank and its fields")
    return f"{pages / 1e9:.1f} GB, {cores()} cores for this process"


CHECKS: dict[str, Callable[[], str]] = {
    "Python": _python,
    "NumPy": _numpy,
    "numba": _numba,
    "compiled kernels": _kernels,
    "MPI": _mpi,
    "FFTW": _fftw,
    "parallel HDF5": _hdf5,
    "mpirun": _mpirun,
    "transform": _transform,
    "memory": _memory,
}


def _probe(target: Path) -> None:
    """The test on two ranks: convolves a random traction, and compares with NumPy's transform of the whole plane."""
    import numpy as np
    from mpi4py import MPI

    from pgfmd.physics.halfspace import HalfSpace
    from pgfmd.solver.grid import Grid, PunchPoints
    from pgfmd.solver.multiplier import periodic_multiplier
    from pgfmd.solver.transform import Convolution

    comm, n = MPI.COMM_WORLD, 45
    points, compliance = PunchPoints(Grid(n, 1.0), 0.3, comm), HalfSpace(2.0)
    everything = np.random.default_rng(1).standard_normal((points.nb, points.nb))
    mine = everything[points.row_start : points.row_start + points.rows]
    displacement = Convolution(points, n, periodic_multiplier(compliance, 1.0))(mine[points.inside()], points.zeros())

    plane = np.zeros((n, n))
    alone = PunchPoints(Grid(n, 1.0), 0.3, MPI.COMM_SELF)
    block = slice(points.block_start, points.block_start + points.nb)
    plane[block, block] = np.where(alone.inside(), everything, 0.0)
    q = 2.0 * np.pi * np.fft.fftfreq(n, 1.0 / n)
    surface = np.fft.ifft2(compliance(q[None, :], q[:, None]) * np.fft.fft2(plane)).real
    wanted = surface[block, block][points.row_start : points.row_start + points.rows][points.inside()]
    error = float(np.abs(displacement - wanted).max(initial=0.0) / np.abs(surface).max())
    error = comm.allreduce(error, op=MPI.MAX)
    if comm.rank == 0:
        target.write_text(json.dumps({"ranks": comm.size, "error": error}))


if __name__ == "__main__":
    _probe(Path(sys.argv[1]))
