"""Signals that ask a run to stop or to save, and the end of a job that can't answer them any more.

    with StopSignals(comm) as signals:
        while ...:                               # every rank: one step, then
            number = comm.allreduce(signals.stop, MAX)
            if number:
                signals.heard()
                ...                              # write a checkpoint, leave

Python runs its handlers between two steps of its interpreter, so a rank that waits in MPI for one that is dead never
gets there. Therefore a thread, the warden, reads the signals' numbers from a socket: the interpreter writes them there
at once, and MPI's blocking calls let threads run. Where the ranks don't agree to stop in time, the warden ends its own.
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
"""HUP: the terminal, or the connection to it, is gone. XCPU: the limit of processor time is near; it comes every
second."""
SAVING = signal.SIGUSR2
# What is sent once may come twice. A terminal gives Ctrl-C to launcher and ranks, and some launchers pass it on as
# well; a batch system gives TERM to mpirun and ranks, and OpenMPI's mpirun sends its own some seconds later.
_REPEATED = {signal.SIGINT: 0.5, signal.SIGTERM: 5.0, signal.SIGHUP: 5.0}
"""Signals that end the process at once when they come again, so many seconds after the first of them."""
_WAKE = b"\0"


class StopSignals:
    """Turns USR1, TERM, Ctrl-C, HUP and XCPU into a request to stop that the run's loop asks for; USR2 into one to
    save.

    HUP stays ignored where it was (nohup).

    A context manager, without communication; the handlers of before come back at its end. Outside the main thread,
    where there are no signals to be had, it does nothing. A second Ctrl-C, TERM or HUP before `heard` ends the process.

    Attributes:
        patience: seconds from TERM, Ctrl-C or HUP until `heard` must have been called; after that the process is ended
            with exit code 130. It has to be longer than a step. One rank alone waits for nobody, and has no limit. Nor
            have USR1 and XCPU: each announces an end, and a step that takes long must not cost the checkpoint.
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
        self._warden: threading.Thread | None = None

    def __enter__(self) -> StopSignals:
        if threading.current_thread() is not threading.main_thread():
            return self
        self._ear, self._mouth = socket.socketpair()
        self._mouth.setblocking(False)
        self._warden = threading.Thread(target=self._watch, name="stop-signals", daemon=True)
        self._warden.start()
        self._former_mouth = signal.set_wakeup_fd(self._mouth.fileno(), warn_on_full_buffer=False)
        heeded = [number for number in (*STOPPING, SAVING) if not (number == signal.SIGHUP and is_ignored(number))]
        self._previous = {number: signal.signal(number, self._note) for number in heeded}
        for number in take_early():
            self._note(number, None)
        return self

    def __exit__(self, *exception: object) -> None:
        if self._warden is None:
            return
        for number, handler in self._previous.items():
            # None: one that was not set from Python, and can't be.
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        signal.set_wakeup_fd(self._former_mouth)
        self._ending = True
        with contextlib.suppress(OSError):
            self._mouth.send(_WAKE)
        self._warden.join(timeout=1.0)
        self._warden = None
        self._ear.close()
        self._mouth.close()

    @property
    def stop(self) -> int:
        """0, or the number of the first stop signal that this rank has got."""
        return self._first

    @property
    def asked(self) -> bool:
        """Whether a stop signal has come to this rank."""
        return self._first != 0

    def take_save(self) -> bool:
        """Whether USR2 came since this was last asked. Only the loop asks: it ends what `heard` allowed for a save."""
        if self._heard and not self._first:
            self._heard = False
        wanted, self._save = self._save, False
        return wanted

    def heard(self) -> None:
        """The ranks have agreed to stop, or to save: no limit from here on; to save, until `take_save` is called."""
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
        """The warden's life."""
        while not self._ending:
            # Patience and `heard` may change while it waits.
            ready, _, _ = select.select([self._ear], [], [], min(self._time_left(), 1.0) if self._urgent else None)
            if self._ending:
                return
            for number in self._ear.recv(64) if ready else b"":
                if number in _REPEATED:
                    self._urge(signal.Signals(number))
            if self._time_left() <= 0.0:
                name = self.name_of(min(self._urgent, key=self._urgent.get))
                self._end(f"{name}: no end of the step within {self.patience:g} s, ended without a checkpoint")

    def _urge(self, number: int) -> None:
        """Takes note of a TERM, Ctrl-C or HUP; a second one ends the process."""
        now = time.monotonic()
        first = min(self._urgent.values(), default=now)
        if self._urgent and not self._heard and now - first > _REPEATED[number]:
            self._end(f"{self.name_of(number)} again: ended without a checkpoint")
        self._urgent.setdefault(number, now)

    def _time_left(self) -> float:
        """Seconds until the warden ends the process. Other ranks leave rank 0 time to speak."""
        if self._heard or self._alone or not self._urgent:
            return math.inf
        grace = 0.0 if self._speaks else 0.5
        return max(0.0, min(self._urgent.values()) + self.patience + grace - time.monotonic())

    def _end(self, message: str) -> None:
        # Past Python's buffers and locks, which the main thread may hold.
        if self._speaks:
            with contextlib.suppress(OSError):
                os.write(2, f"pgfmd: {message}. {WRITTEN_IS_VALID}\n".encode())
        os._exit(INTERRUPTED)
