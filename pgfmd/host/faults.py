"""Unexpected errors: one message if the system is the cause, else one block to be reported. No MPI."""

from __future__ import annotations

import importlib.metadata
import platform
import shlex
import sys
import time
import traceback
from pathlib import Path

LIBRARIES = ("pgfmd", "numpy", "scipy", "numba", "mpi4py", "mpi4py-fft", "h5py", "matplotlib")
FIRST_TURN = 2.0
"""Time [s] that rank 1 waits before it reports an error; rank 0 does not wait. When a rank ends the job, Open MPI's
mpirun sends TERM to the others a second later."""
TURN = 0.2
"""Additional waiting time [s] of each further rank."""
LAST_TURN = 4.0
"""Longest waiting time [s] of any rank."""

_command: list[str] | None = None


def expect(arguments: list[str]) -> None:
    """Declares that this process is `pgfmd` with these arguments, so that an uncaught error is an error in pgfmd."""
    global _command
    _command = arguments


def describe(error: BaseException, rank: int = 0, ranks: int = 1) -> str:
    """The message for an error. In a program of a user: the traceback."""
    message = system_message(error)
    if message:
        return message
    trace = "".join(traceback.format_exception(error)).rstrip("\n")
    if _command is None:
        return trace
    asked = shlex.join(["pgfmd", *_command])
    where = f" (rank {rank} of {ranks})" if ranks > 1 else ""
    lines = [f"asked for: {asked}{where}", f"in: {_folder()}", f"with: {_versions()}", *trace.splitlines()]
    return f"this is a fault of pgfmd. {_address()}\n" + "\n".join(f"  {line}" for line in lines)


def system_message(error: BaseException) -> str:
    """The message for an error of the system or the installation; empty for any other error."""
    if isinstance(error, MemoryError):
        detail = f" ({error})" if str(error) else ""
        cure = "take a smaller grid, or ranks on more nodes; `pgfmd check` estimates it"
        return f"the memory is not enough{detail}: {cure}"
    if isinstance(error, OSError) and error.errno and error.strerror:
        names = " and ".join(str(name) for name in (error.filename, error.filename2) if name is not None)
        return f"{names or 'the system refuses'}: {error.strerror}"
    if isinstance(error, ImportError) and not (error.name or "pgfmd").startswith("pgfmd"):
        return f"a library can't be loaded: {error}; `pgfmd doctor` tells more"
    return ""


def exit_code(error: BaseException) -> int:
    """Exit code of a process that ends with an unexpected error."""
    if not system_message(error):
        return 1
    return 3 if isinstance(error, MemoryError) else 4 if isinstance(error, OSError) else 1


def take_turn(rank: int) -> None:
    """Waits so that only one of several ranks with an error reports it: that rank ends the job before the next one's
    turn."""
    if rank:
        time.sleep(min(FIRST_TURN + TURN * (rank - 1), LAST_TURN))


def _address() -> str:
    """The address for reports."""
    try:
        urls = importlib.metadata.metadata("pgfmd").get_all("Project-URL") or []
    except importlib.metadata.PackageNotFoundError:
        urls = []
    for label, _, url in (entry.partition(", ") for entry in urls):
        if label.lower() in ("issues", "bug tracker", "bugs", "tracker"):
            return f"Please report it at {url}, with this block:"
    return "Please report it with this block:"


def _folder() -> str:
    try:
        return str(Path.cwd())
    except OSError:
        return "a folder that is gone"


def _versions() -> str:
    found = []
    for name in LIBRARIES:
        try:
            found.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            continue
    return ", ".join([*found, f"Python {sys.version.split()[0]}", platform.platform(terse=True)])
