"""Checks of launchers for `doctor`: to which MPI an mpirun belongs, and Python on two ranks."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from types import ModuleType

from .launchers import environment_without

TIME_LIMIT = 60.0
"""Time limit [s] of every check."""
_MAKERS = {
    "Open MPI": ("Open MPI", "OpenRTE", "PRRTE"), "Intel MPI": ("Intel",), "MVAPICH": ("MVAPICH",),
    "MPICH": ("MPICH", "HYDRA"),
}  # fmt: skip
"""MPI implementations, and words by which their libraries and launchers are recognised."""


class Trouble(Exception):
    """A failed check: what is wrong, and a remedy."""

    stops = True

    def __init__(self, what: str, cure: str):
        super().__init__(what)
        self.cure = cure


class Lack(Trouble):
    """Something is missing that runs can do without."""

    stops = False


def launcher() -> str | None:
    """The path of mpirun or mpiexec; None if there is neither."""
    return shutil.which("mpirun") or shutil.which("mpiexec")


def library_of(mpi: ModuleType) -> str:
    """Name and version of an MPI library."""
    return mpi.Get_library_version().splitlines()[0].split(",")[0].strip("\0 ")


def mpi_of_mpi4py() -> str:
    """Name and version of the MPI that mpi4py uses."""
    import mpi4py

    mpi4py.rc.initialize = False
    from mpi4py import MPI

    return library_of(MPI)


def mpi_of_launcher(path: str) -> str:
    """Name and version of an mpirun, from its own output."""
    try:
        done = subprocess.run([path, "--version"], capture_output=True, text=True, timeout=TIME_LIMIT, errors="replace")
    except (OSError, subprocess.SubprocessError):
        return "an unknown MPI"
    maker = maker_of(done.stdout)
    version = re.search(r"\d+(\.\d+)+", done.stdout)
    return f"{maker} {version[0]}" if maker and version else maker or "an unknown MPI"


def maker_of(text: str) -> str:
    """The MPI implementation that a text is about; empty if unknown."""
    return next((maker for maker, words in _MAKERS.items() if any(word in text for word in words)), "")


def on_ranks(path: str | None, arguments: list[str], count: int = 2, limit: float = TIME_LIMIT) -> str:
    """Standard output of Python on `count` ranks under this mpirun, or on one rank without mpirun. Raises Trouble if it
    fails or takes longer than `limit` [s]. Modules are not imported from the current folder, which may have a numpy.py
    of the user."""
    environment = environment_without() | {
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "OMPI_MCA_rmaps_base_oversubscribe": "1",
        "OMP_NUM_THREADS": "1",
    }
    start = [path, "-n", str(count)] if path else []
    ranks = f"{path}: {'two' if count == 2 else count} ranks" if path else "one rank"
    command = [*start, sys.executable, "-P", *arguments]
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as complaints:
        process = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=output, stderr=complaints, start_new_session=True
        )
        try:
            code = process.wait(timeout=limit)
        except subprocess.TimeoutExpired:
            _end(process)
            raise Trouble(
                f"{ranks} did not finish within {limit:.0f} s",
                "check mpirun's network settings and host names",
            ) from None
        except BaseException:
            # In a session of its own, it does not receive Ctrl-C.
            _end(process)
            raise
        output.seek(0)
        complaints.seek(0)
        if code:
            by_hand = shlex.join([*start, sys.executable, "-P", "-m", "mpi4py.bench", "helloworld"])
            complaint = _gist(complaints.read())
            raise Trouble(f"{ranks} ended with code {code}: {complaint}", f"try it by hand: {by_hand}")
        return output.read()


def _gist(complaint: str) -> str:
    """The most informative line: the last line of a traceback, else the first line."""
    lines = [line.strip() for line in complaint.splitlines() if line.strip(" -")]
    if any(line.startswith("Traceback") for line in lines):
        start = next(k for k, line in enumerate(lines) if line.startswith("Traceback"))
        raised = [line for line in lines[start:] if re.match(r"[\w.]+(Error|Exception|Exit|Interrupt)\b", line)]
        lines = raised[:1] or lines
    return lines[0] if lines else "no message"


def _end(process: subprocess.Popen) -> None:
    """Ends mpirun, which then ends its ranks; kills it if that fails."""
    process.terminate()
    try:
        process.wait(timeout=5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
