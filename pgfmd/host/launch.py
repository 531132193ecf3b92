"""Starting and ending under MPI: checks that mpirun belongs to our MPI; an error on one rank ends the whole job.

    comm = launch.world()
    with launch.guarded(comm):
        ...                       # what every rank does

Only `world` loads MPI. From then on an error on one rank ends the job, also outside of `guarded`.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import TYPE_CHECKING, Any, NoReturn

from pgfmd.errors import WRITTEN_IS_VALID, LaunchError, PgfmdError

from . import faults
from .launchers import is_launched, launched
from .processes import end_with_launcher
from .streams import complain

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

INTERRUPTED = 130
"""Exit code after Ctrl-C."""
PATIENCE = 5.0
"""Time [s] that a rank with an error waits for the others to have the same error, before it ends the job."""


class RelayedError(PgfmdError):
    """Raised on the other ranks for an error of rank 0."""

    def __init__(self, message: str, exit_code: int):
        super().__init__(message)
        self.exit_code = exit_code


def world() -> Intracomm:
    """MPI's communicator of all ranks. Raises LaunchError if the launcher started more processes than MPI sees.

    After this call, no rank survives its launcher. An uncaught exception, or a sys.exit with a code other than 0, ends
    all ranks unless it happens on all of them.
    """
    processes, _ = launched()
    if is_launched():
        end_with_launcher()
    try:
        from mpi4py import MPI
    except (ImportError, RuntimeError) as error:
        raise LaunchError(f"MPI can't be loaded: {error}; `pgfmd doctor` tells more") from None
    if processes > 1 and MPI.COMM_WORLD.size == 1:
        library = MPI.Get_library_version().splitlines()[0].split(",")[0]
        raise LaunchError(
            f"{processes} processes were started, but each is alone: the mpirun or srun that started them belongs to "
            f"another MPI than the one pgfmd runs with, {library}. Use its own mpirun; `pgfmd doctor` tells more."
        )
    if MPI.COMM_WORLD.size > 1:
        _watch_for_faults(MPI)
    return MPI.COMM_WORLD


def communicator(comm: Intracomm | None, what: str) -> Intracomm:
    """The communicator for a function of the Python interface: the given one, or one of this process alone.

    Raises LaunchError if several processes were started and no communicator is given.
    """
    if comm is not None:
        return comm
    processes, _ = launched()
    if processes > 1:
        raise LaunchError(
            f"{what}: {processes} processes were started; say what they are to do: comm=MPI.COMM_WORLD, all together, or "
            "comm=MPI.COMM_SELF, each for itself (from mpi4py import MPI)"
        )
    from mpi4py import MPI

    return MPI.COMM_SELF


def on_first(comm: Intracomm, action: Callable[[], Any]) -> Any:
    """The result of `action` on rank 0, on every rank. A PgfmdError is raised on every rank. Collective."""
    result, failure = None, None
    if comm.rank == 0:
        try:
            result = action()
        except PgfmdError as error:
            failure = error
    if comm.size > 1:
        # For objects of any size: MPI's own broadcast refuses more than 2 GiB, on rank 0 alone.
        from mpi4py.util import pkl5

        comm = pkl5.Intracomm(comm)
    outcome = comm.bcast((result, None) if failure is None else (None, (str(failure), failure.exit_code)))
    if failure is not None:
        raise failure
    if outcome[1] is not None:
        raise RelayedError(*outcome[1])
    return outcome[0]


def listen() -> None:
    """After this call, USR1, USR2 and XCPU do not end the process. Signals before the start of a run (stop_signals.py)
    are remembered. Signals after its end are ignored, because there is nothing to stop or save."""
    if threading.current_thread() is threading.main_thread():
        for number in _REMEMBERED:
            signal.signal(number, lambda number, frame: _early.append(number))


def is_ignored(number: int) -> bool:
    """Whether the caller has set this signal to be ignored, like nohup."""
    return signal.getsignal(number) == signal.SIG_IGN


def take_early() -> list[int]:
    """The signals received since `listen`, or since the last call."""
    found = _early[:]
    _early.clear()
    return found


_early: list[int] = []
_REMEMBERED = (signal.SIGUSR1, signal.SIGUSR2, signal.SIGXCPU)


class _Exit(SystemExit):
    """Raised by sys.exit. Records whether it ends the process, or was caught."""

    leaving: _Exit | None = None

    def __init__(self, *args: object):
        super().__init__(*args)
        self.stack = "".join(traceback.format_stack()[:-2])

    @property
    def code(self) -> Any:  # type: ignore[override]
        if sys._getframe().f_back is None:
            # Without a calling frame it is the interpreter that asks, at exit.
            _Exit.leaving = self
        return None if not self.args else self.args[0] if len(self.args) == 1 else self.args


def _exit(status: object = None) -> NoReturn:
    raise _Exit(status)


def _watch_for_faults(MPI: ModuleType) -> None:
    """Makes errors, and exits with an error code, end all ranks. MPI itself would wait for the others for ever.

    An exit with code 0 is not an error: ranks may finish earlier than others.
    """
    if sys.exit is _exit:
        return
    comm, process = MPI.COMM_WORLD, os.getpid()

    def abort(what: str, text: str, code: int) -> None:
        complain(f"rank {comm.rank}: {what} on this rank ends the job\n{text}")
        comm.Abort(code)

    def on_error(kind: type[BaseException], error: BaseException, trace: Any) -> None:
        if MPI.Is_finalized() or os.getpid() != process:
            sys.__excepthook__(kind, error, trace)
        elif isinstance(error, KeyboardInterrupt):
            complain(_INTERRUPTION)
            comm.Abort(INTERRUPTED)
        elif not (isinstance(error, PgfmdError) and _all_here(comm)):
            faults.take_turn(comm.rank)
            abort("error", faults.describe(error, comm.rank, comm.size), faults.exit_code(error))
        elif comm.rank == 0:
            sys.__excepthook__(kind, error, trace)

    def on_error_in_thread(found: Any) -> None:
        if found.exc_type is not SystemExit:
            on_error(found.exc_type, found.exc_value, found.exc_traceback)

    def at_end() -> None:
        leaving = _Exit.leaving
        code = leaving.code if leaving else 0
        if leaving is None or code in (0, None) or MPI.Is_finalized() or os.getpid() != process or _all_here(comm):
            return
        abort("exit", f"exit code {code}, from\n{leaving.stack}", code if isinstance(code, int) else 1)

    sys.excepthook, threading.excepthook, sys.exit = on_error, on_error_in_thread, _exit
    atexit.register(at_end)


@contextmanager
def guarded(comm: Intracomm) -> Iterator[None]:
    """A context for collective work: an exception on one rank ends the whole job within seconds.

    A PgfmdError on all ranks is printed once, and raises SystemExit with its exit code. A PgfmdError on some ranks, and
    any other exception including SystemExit, is reported with its rank and aborts MPI. Ctrl-C and TERM print a message
    and end with exit code 130 (mpirun may replace it by its own); so does HUP, unless it is ignored.
    """
    listen()
    alone = comm.size == 1
    meeting = None if alone else comm.Dup()
    ending = [signal.SIGINT, signal.SIGTERM, *([] if is_ignored(signal.SIGHUP) else [signal.SIGHUP])]
    previous = {number: signal.signal(number, _stopper(comm)) for number in ending}
    try:
        yield
    except PgfmdError as error:
        if meeting is None or _all_here(meeting):
            if comm.rank == 0:
                complain(error)
            raise SystemExit(error.exit_code) from None
        complain(f"rank {comm.rank}: {error}")
        comm.Abort(error.exit_code)
    except KeyboardInterrupt:
        complain(_INTERRUPTION)
        if not alone:
            comm.Abort(INTERRUPTED)
        raise SystemExit(INTERRUPTED) from None
    except BaseException as error:
        if alone:
            raise
        faults.take_turn(comm.rank)
        exits = isinstance(error, SystemExit)
        text = "".join(traceback.format_exception(error)) if exits else faults.describe(error, comm.rank, comm.size)
        complain(f"rank {comm.rank}: {'exit' if exits else 'error'} on this rank ends the job\n{text}")
        comm.Abort(faults.exit_code(error))
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)
        # The handlers are not restored, because the same signal may come twice and must not end a run that it has just
        # stopped. They are set to ignore, because Python resets its own handlers to the default at exit.
        for number in (*_REMEMBERED, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
    if meeting is not None:
        meeting.Free()


_INTERRUPTION = f"interrupted. {WRITTEN_IS_VALID}"


def _stopper(comm: Intracomm) -> Callable[[int, Any], None]:
    """The handler of Ctrl-C: raises KeyboardInterrupt on a single rank; several ranks can't unwind together, so ends
    the job."""

    def stop(number: int, frame: Any) -> None:
        if comm.size == 1:
            raise KeyboardInterrupt
        if comm.rank:
            # Rank 0 prints the message, and its abort ends this rank as well.
            time.sleep(PATIENCE)
        complain(_INTERRUPTION)
        comm.Abort(INTERRUPTED)

    return stop


def _all_here(meeting: Intracomm) -> bool:
    """Whether every rank arrives here within PATIENCE.

    This may use MPI's world communicator in the middle of other calls: if not all ranks arrive, the job ends anyway.
    """
    request = meeting.Ibarrier()
    latest = time.monotonic() + PATIENCE
    while not request.Test():
        if time.monotonic() > latest:
            return False
        time.sleep(0.01)
    return True
