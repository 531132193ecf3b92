"""Is this machine ready? One line a check, with the cure where it fails.

MPI is started in child processes only, under a hard time limit: a broken MPI must not take the doctor with it.
`python -m pgfmd.host.doctor FILE` is such a child.
"""

from __future__ import annotations

import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from .processes import cores

TIME_LIMIT = 60.0
_LEAST_PYTHON = (3, 11)
_LARGEST_ERROR = 1e-12
_LAUNCHER_PREFIXES = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "HYDRA_", "HYDI_")
_REINSTALL_H5PY = "build h5py with MPI: HDF5_MPI=ON CC=mpicc pip install --no-binary=h5py --no-build-isolation h5py"


class Trouble(Exception):
    """A check that failed: what is wrong, and a cure."""

    def __init__(self, what: str, cure: str):
        super().__init__(what)
        self.cure = cure


@dataclass(frozen=True)
class Finding:
    """The outcome of a check: its name, whether it is fine, what was found, and the cure if it is not."""

    name: str
    fine: bool
    found: str
    cure: str = ""

    def __str__(self) -> str:
        line = f"{'OK  ' if self.fine else 'FAIL'} {self.name}: {self.found}"
        return f"{line}\n     cure: {self.cure}" if self.cure else line


def examine() -> Iterator[Finding]:
    """All checks, one after the other."""
    for name, check in CHECKS.items():
        try:
            yield Finding(name, True, check())
        except Trouble as trouble:
            yield Finding(name, False, str(trouble), trouble.cure)
        except Exception as error:  # a library may fail to load in any way, and the other checks should still run
            cure = "install it anew: pip install --force-reinstall"
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
    def total(values):
        result = 0.0
        for value in values:
            result += value
        return result

    if total(np.arange(5.0)) != 10.0:
        raise Trouble("a compiled sum is wrong", "install numba and llvmlite anew")
    return f"{numba.__version__}, compiles"


def _mpi() -> str:
    import mpi4py

    mpi4py.rc.initialize = False
    from mpi4py import MPI

    major, minor = MPI.Get_version()
    return f"{_library(MPI)}, MPI {major}.{minor}, mpi4py {mpi4py.__version__}"


def _library(mpi) -> str:
    return mpi.Get_library_version().splitlines()[0].split(",")[0].strip("\0 ")


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
        raise Trouble(f"{version}, without MPI: rank 0 has to write all fields alone", _REINSTALL_H5PY)
    return f"{version}, with MPI"


def _mpirun() -> str:
    path = shutil.which("mpirun") or shutil.which("mpiexec")
    if path is None:
        cure = "install MPI's programs (Debian: openmpi-bin), or load its module"
        raise Trouble("neither mpirun nor mpiexec is on PATH", cure)
    # One write each: two processes that print may mix up their lines.
    probe = "import os; from mpi4py import MPI; os.write(1, b'%d\\n' % MPI.COMM_WORLD.size)"
    output = _under_mpirun(path, ["-c", probe])
    sizes = output.split()
    if sizes != ["2", "2"]:
        raise Trouble(
            f"{path} starts 2 processes that see {' and '.join(sizes) or 'no'} ranks: it is not mpi4py's MPI",
            "put the mpirun of mpi4py's MPI first on PATH, or install mpi4py anew with this one's mpicc",
        )
    return f"{path} belongs to the same MPI"


def _transform() -> str:
    path = shutil.which("mpirun") or shutil.which("mpiexec")
    if path is None:
        raise Trouble("not tried: no mpirun", "see the line about mpirun")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder, "probe.json")
        _under_mpirun(path, ["-m", "pgfmd.host.doctor", str(target)])
        if not target.is_file():
            raise Trouble("the two ranks left no result", "see the lines above")
        found = json.loads(target.read_text())
    if found["ranks"] != 2 or not found["error"] < _LARGEST_ERROR:
        raise Trouble(
            f"on {found['ranks']} ranks it differs by {found['error']:.1e} from NumPy's",
            "install mpi4py-fft and FFTW anew",
        )
    return f"on 2 ranks as NumPy's, to {found['error']:.1e}"


def _memory() -> str:
    pages = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if pages < 1e9:
        raise Trouble(f"{pages / 1e9:.1f} GB", "a run needs about 0.2 GB for each rank and its fields")
    return f"{pages / 1e9:.1f} GB, {cores()} cores for this process"


CHECKS: dict[str, Callable[[], str]] = {
    "Python": _python,
    "NumPy": _numpy,
    "numba": _numba,
    "MPI": _mpi,
    "FFTW": _fftw,
    "parallel HDF5": _hdf5,
    "mpirun": _mpirun,
    "transform": _transform,
    "memory": _memory,
}


def _under_mpirun(path: str, arguments: list[str]) -> str:
    """Standard output of Python on two ranks. Raises Trouble if that fails or takes too long."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith(_LAUNCHER_PREFIXES)}
    # A user's own settings of Open MPI count; what a surrounding mpirun left behind does not.
    environment |= {name: value for name, value in os.environ.items() if name.startswith("OMPI_MCA_rmaps")}
    environment |= {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "OMP_NUM_THREADS": "1",
    }
    command = [path, "-n", "2", sys.executable, *arguments]
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as complaints:
        process = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=output, stderr=complaints, start_new_session=True
        )
        try:
            code = process.wait(timeout=TIME_LIMIT)
        except subprocess.TimeoutExpired:
            _end(process)
            raise Trouble(
                f"{path}: two ranks did not finish within {TIME_LIMIT:.0f} s",
                "check mpirun's network settings and host names",
            ) from None
        output.seek(0)
        complaints.seek(0)
        if code:
            lines = [line for line in complaints.read().splitlines() if line.strip(" -")]
            raise Trouble(
                f"{path}: two ranks ended with code {code}: {lines[0] if lines else 'no message'}",
                f"try it by hand: {path} -n 2 {sys.executable} -m mpi4py.bench helloworld",
            )
        return output.read()


def _end(process: subprocess.Popen) -> None:
    """Ends mpirun, which then ends its ranks; the hard way if it does not."""
    process.terminate()
    try:
        process.wait(timeout=5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _probe(target: Path) -> None:
    """What the two ranks do: convolve a random traction and compare with NumPy's transform of the whole plane."""
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
