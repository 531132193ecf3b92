"""Processes of the operating system: whether one is still alive, and ending a rank together with its launcher."""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import signal
import socket
import sys
from dataclasses import dataclass
from pathlib import Path

from .launchers import PROGRAMS

_PROC = Path("/proc")
_SET_DEATH_SIGNAL = 1
"""PR_SET_PDEATHSIG of prctl(2)."""
_LIBC = ctypes.CDLL(None) if sys.platform.startswith("linux") else None
BUSY = 0.5
"""Load average from which on a machine is not idle."""


@dataclass(frozen=True)
class Process:
    """A process. Its start time distinguishes it from a later process with the same number.

    started: in clock ticks since the machine was booted; boot: id of this boot. Both are empty on systems without
    /proc.
    """

    host: str
    pid: int
    started: int | None
    boot: str

    @classmethod
    def this(cls) -> Process:
        """The present process."""
        return cls(socket.gethostname(), os.getpid(), _start_of(os.getpid())[1], _boot())

    def is_alive(self) -> bool | None:
        """Whether it is still running; None for a process on another host."""
        if self.host != socket.gethostname():
            return None
        if self.pid <= 0 or (self.boot and self.boot != _boot()):
            return False
        state, started = _start_of(self.pid)
        if started is not None:
            # A zombie has ended; its parent has not yet read its exit code.
            return state not in "ZX" and self.started in (None, started)
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return False
        except (PermissionError, OverflowError):
            # A process of another user, which some systems hide in /proc.
            return self.pid < 2**31
        return True


@functools.cache
def _boot() -> str:
    with contextlib.suppress(OSError):
        return (_PROC / "sys/kernel/random/boot_id").read_text().strip()
    return ""


def _start_of(pid: int) -> tuple[str, int | None]:
    """(state, start) of a process from /proc; ("", None) if not available."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        # The name, in brackets, may contain anything.
        fields = (_PROC / str(pid) / "stat").read_text(errors="replace").rpartition(")")[2].split()
        return fields[0], int(fields[19])
    return "", None


def end_with_launcher() -> None:
    """Makes the kernel kill this process when its launcher dies, so that it does not continue alone.

    Only if the parent is a launcher, because a process started by a shell may survive it (nohup). Only on Linux. Ranks
    of OpenMPI end by themselves within a few seconds after mpirun; those of other MPIs may not.
    """
    parent = os.getppid()
    try:
        name = (_PROC / str(parent) / "comm").read_text()
    except OSError:
        return
    if any(part in name for part in PROGRAMS) and signal_at_end_of_parent(signal.SIGKILL) and os.getppid() != parent:
        # The launcher died in between.
        os.kill(os.getpid(), signal.SIGKILL)


def signal_at_end_of_parent(number: int) -> bool:
    """Makes the kernel send a signal to this process when its parent dies; returns whether that works (Linux only).

    May be called between fork and exec.
    """
    prctl = getattr(_LIBC, "prctl", None)
    return prctl is not None and prctl(_SET_DEATH_SIGNAL, number, 0, 0, 0) == 0


def load() -> float:
    """Load average of this machine over the last minute; 0 if it is idle (`BUSY`)."""
    found = os.getloadavg()[0]
    return found if found > BUSY else 0.0


def cores() -> int:
    """Number of cores that this process may use."""
    return len(cores_of())


def cores_of() -> set[int]:
    """The numbers of the cores that this process may use."""
    return os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set(range(os.cpu_count() or 1))
