"""Signals that request a run to stop or to save, and ending a job that can't respond to them any more.

    with StopSignals(comm) as signals:
        while ...:                               # every rank: one step, then
            number = comm.allreduce(signals.stop, MAX)
            if number:
                signals.heard()
                ...                              # write a checkpoint, leave

Python runs signal handlers between two instructions of its interpreter, which a rank that waits in MPI for a dead rank
never reaches. Therefore a thread, the watchdog, reads the numbers of signals from a socket: the interpreter writes them
there immediately, and threads run during blocking calls of MPI. If the ranks do not agree to stop in time, the watchdog
ends its own process.
"""

from __future__ import annotations

import contextlib
import math
import os
import select
import signal
import socket
import threading
import time
from typing import TYPE_CHECKING, Any

from pgfmd.errors import WRITTEN_IS_VALID

from .launch import INTERRUPTED, is_ignored, take_early

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

PATIENCE = 6.0
"""Time [s] from TERM or Ctrl-C until the ranks must have agreed to stop."""
STOPPING = (signal.SIGUSR1, signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGXCPU)
"""Signals that stop a run. HUP: the connection to the terminal was lost. XCPU: the limit of processor time is near; it
is sent every second."""
SAVING = signal.SIGUSR2
# A single signal may arrive twice. A terminal sends Ctrl-C to launcher and ranks, and some launchers forward it as
# well; a batch system sends TERM to mpirun and ranks, and OpenMPI's mpirun sends its own some seconds later.
_REPEATED = {signal.SIGINT: 0.5, signal.SIGTERM: 5.0, signal.SIGHUP: 5.0}
"""Signals that end the process immediately if they are repeated, after so many seconds since the first one."""
_WAKE = b"\0"


class StopSignals:
    """Turns USR1, TERM, Ctrl-C, HUP and XCPU into a request to stop, which the loop of the run polls; USR2 into a
    request to save.

    HUP stays ignored if it was (nohup).

    A context manager without communication; it restores the earlier handlers at its end. Outside the main thread, which
    alone receives signals, it does nothing. A second Ctrl-C, TERM or HUP before `heard` ends the process.

    Attributes:
        patience: time [s] from TERM, Ctrl-C or HUP within which `heard` must be called, else the process ends with exit
            code 130. It has to be longer than a step. A single rank has no limit, because it waits for nobody. USR1 and
            XCPU have none either: they announce an end, and a long step must not prevent the checkpoint.
    """

    def __init__(self, comm: Intracomm):
        self.patience = PATIENCE
        self._alone = comm.size == 1
        self._speaks = comm.rank == 0
        self._first = 0
        self._save = False
        self._heard = False
        self._urgent: dict[int, float] = {}
        self._previous: dict[int, Any] = {}
        self._ending = False
        self._watchdog: threading.Thread | None = None

    def __enter__(self) -> StopSignals:
        if threading.current_thread() is not threading.main_thread():
            return self
        self._ear, self._mouth = socket.socketpair()
        self._mouth.setblocking(False)
        self._watchdog = threading.Thread(target=self._watch, name="stop-signals", daemon=True)
        self._watchdog.start()
        self._former_mouth = signal.set_wakeup_fd(self._mouth.fileno(), warn_on_full_buffer=False)
        heeded = [number for number in (*STOPPING, SAVING) if not (number == signal.SIGHUP and is_ignored(number))]
        self._previous = {number: signal.signal(number, self._note) for number in heeded}
        for number in take_early():
            self._note(number, None)
        return self

    def __exit__(self, *exception: object) -> None:
        if self._watchdog is None:
            return
        for number, handler in self._previous.items():
            # None: a handler that was not set from Python and can't be restored.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        signal.set_wakeup_fd(self._former_mouth)
        self._ending = True
        with contextlib.suppress(OSError):
            self._mouth.send(_WAKE)
        self._watchdog.join(timeout=1.0)
        self._watchdog = None
        self._ear.close()
        self._mouth.close()

    @property
    def stop(self) -> int:
        """Number of the first stop signal that this rank has received, or 0."""
        return self._first

    @property
    def asked(self) -> bool:
        """Whether this rank has received a stop signal."""
        return self._first != 0

    def take_save(self) -> bool:
        """Whether USR2 arrived since the last call. Only for the loop: it ends the time that `heard` gave for a
        save."""
        if self._heard and not self._first:
            self._heard = False
        wanted, self._save = self._save, False
        return wanted

    def heard(self) -> None:
        """Called when the ranks have agreed to stop or to save: removes the limit; for a save, until `take_save`."""
        self._heard = True

    @staticmethod
    def name_of(number: int) -> str:
        """USR1, TERM or Ctrl-C."""
        return "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name.removeprefix("SIG")

    def _note(self, number: int, frame: Any) -> None:
        if number == SAVING:
            self._save = True
        elif not self._first:
            self._first = number

    def _watch(self) -> None:
        """The loop of the watchdog thread."""
        while not self._ending:
            # `patience` and `heard` may change during the wait.
            ready, _, _ = select.select([self._ear], [], [], min(self._time_left(), 1.0) if self._urgent else None)
            if self._ending:
                return
            for number in self._ear.recv(64) if ready else b"":
                if number in _REPEATED:
                    self._urge(signal.Signals(number))
            if self._time_left() <= 0.0:
                name = self.name_of(min(self._urgent, key=self._urgent.__getitem__))
                self._end(f"{name}: no end of the step within {self.patience:g} s, ended without a checkpoint")

    def _urge(self, number: signal.Signals) -> None:
        """Records a TERM, Ctrl-C or HUP; a second one ends the process."""
        now = time.monotonic()
        first = min(self._urgent.values(), default=now)
        if self._urgent and not self._heard and now - first > _REPEATED[number]:
            self._end(f"{self.name_of(number)} again: ended without a checkpoint")
        self._urgent.setdefault(number, now)

    def _time_left(self) -> float:
        """Time [s] until the watchdog ends the process. Other ranks give rank 0 time to print a message."""
        if self._heard or self._alone or not self._urgent:
            return math.inf
        grace = 0.0 if self._speaks else 0.5
        return max(0.0, min(self._urgent.values()) + self.patience + grace - time.monotonic())

    def _end(self, message: str) -> None:
        # Bypasses Python's buffers and locks, which the main thread may hold.
        if self._speaks:
            with contextlib.suppress(OSError):
                os.write(2, f"pgfmd: {message}. {WRITTEN_IS_VALID}\n".encode())
        os._exit(INTERRUPTED)
