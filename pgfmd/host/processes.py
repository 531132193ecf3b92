"""Processes of the operating system: is this one still alive, and how a rank ends with the launcher that started it."""

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
"""Processes that run at a time, on average, from which on a machine is not idle."""


@dataclass(frozen=True)
class Process:
    """A process, told apart from a later one with its number.

    started: in ticks of the machine's clock since it was started; boot: which start of the machine that was. Both are
    empty where the system has no /proc.
    """

    host: str
    pid: int
    started: int | None
    boot: str

    @classmethod
    def this(cls) -> Process:
        """The process that asks."""
        return cls(socket.gethostname(), os.getpid(), _start_of(os.getpid())[1], _boot())

    def is_alive(self) -> bool | None:
        """Whether it still runs; None for one on another host."""
        if self.host != socket.gethostname():
            return None
        if self.pid <= 0 or (self.boot and self.boot != _boot()):
            return False
        state, started = _start_of(self.pid)
        if started is not None:
            # A zombie runs no more: its parent has only not asked for its exit code.
            return state not in "ZX" and self.started in (None, started)
        try:
            os.kill(self.pid, 0)
        except ProcessLookupError:
            return False
        except (PermissionError, OverflowError):
            # Somebody else's, which some systems hide in /proc.
            return self.pid < 2**31
        return True


@functools.cache
def _boot() -> str:
    with contextlib.suppress(OSError):
        return (_PROC / "sys/kernel/random/boot_id").read_text().strip()
    return ""


def _start_of(pid: int) -> tuple[str, int | None]:
    """(state, start) of a process as /proc has them; ("", None) if it has not."""
    with contextlib.suppress(OSError, ValueError, IndexError):
        # The name, in brackets, may hold anything.
        fields = (_PROC / str(pid) / "stat").read_text(errors="replace").rpartition(")")[2].split()
        return fields[0], int(fields[19])
    return "", None


def end_with_launcher() -> None:
    """Has the kernel kill this process when the launcher that started it dies: it must not go on alone.

    Only where its parent is a launcher: what a shell has started may outlive it (nohup). Only on Linux. OpenMPI's ranks
    end by themselves within a few seconds when mpirun is gone, those of other MPIs may not.
    """
    parent = os.getppid()
    try:
        name = (_PROC / str(parent) / "comm").read_text()
    except OSError:
        return
    if any(part in name for part in PROGRAMS) and signal_at_end_of_parent(signal.SIGKILL) and os.getppid() != parent:
        # It died in between.
        os.kill(os.getpid(), signal.SIGKILL)


def signal_at_end_of_parent(number: int) -> bool:
    """Asks the kernel for a signal to this process when its parent dies; whether it will send one. Only Linux does.

    May be called between fork and exec.
    """
    prctl = getattr(_LIBC, "prctl", None)
    return prctl is not None and prctl(_SET_DEATH_SIGNAL, number, 0, 0, 0) == 0


def load() -> float:
    """How many processes run on this machine at a time, on average over the last minute; 0 where it is idle (`BUSY`)."""
    found = os.getloadavg()[0]
    return found if found > BUSY else 0.0


def cores() -> int:
    """How many cores this process may use."""
    return len(cores_of())


def cores_of() -> set[int]:
    """The numbers of the cores that this process may use."""
    return os.sched_getaffinity(0) if hasattr(os, "sched_getaffinity") else set(range(os.cpu_count() or 1))
