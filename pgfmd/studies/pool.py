"""Parallel jobs on this machine. Each is a separate `pgfmd run`, under mpirun if it has several ranks.

No MPI here. A stop is passed on as USR1, on which runs write a checkpoint, however long their step takes. Jobs have
their own process groups, so that Ctrl-C in a terminal does not reach them directly, because mpirun would soon kill its
ranks.
"""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pgfmd.errors import LaunchError, ResultError, Stopped
from pgfmd.files.regular_files import open_regular
from pgfmd.files.storage import reason
from pgfmd.host.launchers import environment_without
from pgfmd.host.processes import cores, signal_at_end_of_parent
from pgfmd.host.walltime import LIMIT_OF_TIME

STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGXCPU, signal.SIGUSR1)
REMIND_AFTER = 3.0
"""Time [s] after which USR1 is sent again, because mpirun does not pass it on before its ranks have started."""
KILL_AFTER = 15.0
"""Time [s] from a second Ctrl-C until remaining jobs are killed."""
TICK = 0.05


@dataclass(frozen=True)
class Task:
    """A job: a name, the arguments of `pgfmd run`, the folder of its results, and the file for its output."""

    name: str
    arguments: tuple[str, ...]
    folder: Path
    log: Path


@dataclass(frozen=True)
class Ending:
    """The end of a job. why: its message if it failed. seconds: wall time of this process."""

    code: int
    why: str
    seconds: float


class _Job:
    def __init__(self, task: Task, process: subprocess.Popen, start: int):
        self.task, self.process, self.start, self.began = task, process, start, time.monotonic()

    def ending(self) -> Ending:
        return Ending(self.process.returncode, last_words(self.task.log, self.start), time.monotonic() - self.began)


class Pool:
    """Runs tasks, `jobs` at a time, each on `ranks` ranks.

    Attributes:
        stopped: why no further job was started: the name of a signal, or a time limit; empty if all were started.
    """

    def __init__(self, ranks: int = 1, jobs: int = 1, say: Callable[[str], None] = print):
        self.ranks, self.jobs, self.say = ranks, jobs, say
        self.stopped = ""
        self._running: list[_Job] = []
        self._signals: list[int] = []
        self._reminder = self._kill_at = float("inf")

    def run(self, tasks: list[Task], on_end: Callable[[Task, Ending], None]) -> None:
        """Runs every task; calls `on_end` with each as it ends. Returns when none is running any more.

        Raises LaunchError, before anything is started, where mpirun is missing; ResultError if a log can't be written.
        """
        if tasks:
            require_launcher(self.ranks)
        waiting = list(tasks)
        with self._listening():
            try:
                while waiting or self._running:
                    while waiting and not self.stopped and len(self._running) < self.jobs:
                        self._start(waiting.pop(0))
                    if not self._running:
                        break
                    time.sleep(TICK)
                    self._answer()
                    self._gather(on_end)
            finally:
                # Only if an unexpected error has ended the loop.
                for job in self._running:
                    self._send(job, signal.SIGUSR1)

    def _start(self, task: Task) -> None:
        command = [*launcher(self.ranks), *program(), *task.arguments]
        try:
            task.log.parent.mkdir(parents=True, exist_ok=True)
            with os.fdopen(open_regular(task.log, os.O_WRONLY | os.O_CREAT | os.O_APPEND), "ab") as log:
                line = f"# {time.strftime('%Y-%m-%dT%H:%M:%S%z')}  {shlex.join(command)}\n"
                log.write(line.encode())
                log.flush()
                start = log.tell()
                process = subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True,
                    env=environment(self.ranks, self.jobs), preexec_fn=_stop_with_parent,
                )  # fmt: skip
        except OSError as error:
            raise ResultError(f"{task.log}: the job can't be started: {reason(error)}") from error
        self._running.append(_Job(task, process, start))
        self.say(f"{task.name}: started")

    def _gather(self, on_end: Callable[[Task, Ending], None]) -> None:
        for job in [job for job in self._running if job.process.poll() is not None]:
            self._running.remove(job)
            ending = job.ending()
            if ending.code == Stopped.exit_code and not self.stopped and ran_out_of_time(job.task.folder):
                # A job started now would have even less time.
                self.stopped = LIMIT_OF_TIME
            on_end(job.task, ending)

    def _answer(self) -> None:
        """Passes on what signals asked for."""
        now = time.monotonic()
        if self._signals and not self.stopped:
            number = self._signals.pop(0)
            self.stopped = "Ctrl-C" if number == signal.SIGINT else signal.Signals(number).name.removeprefix("SIG")
            self.say(f"{self.stopped}: stopping {_jobs(len(self._running))} with a checkpoint; "
                     "once more ends them at once")  # fmt: skip
            self._reminder = now
        elif self._signals and self._signals.pop(0) in (signal.SIGINT, signal.SIGTERM):
            self._kill_at = min(self._kill_at, now + KILL_AFTER)
            for job in self._running:
                self._send(job, signal.SIGTERM)
        if now >= self._reminder:
            self._reminder = now + REMIND_AFTER
            for job in self._running:
                self._send(job, signal.SIGUSR1)
        if now >= self._kill_at:
            for job in self._running:
                with suppress(ProcessLookupError):
                    os.killpg(job.process.pid, signal.SIGKILL)

    @staticmethod
    def _send(job: _Job, number: int) -> None:
        # Popen asks first whether the process is still there.
        job.process.send_signal(number)

    @contextmanager
    def _listening(self) -> Iterator[None]:
        """Records signals while jobs run. Signals that were ignored before (nohup) stay ignored."""
        previous: dict[int, Any] = {}
        for number in STOPPING:
            if signal.getsignal(number) != signal.SIG_IGN:
                previous[number] = signal.signal(number, lambda number, frame: self._signals.append(number))
        try:
            yield
        finally:
            for kept, handler in previous.items():
                signal.signal(kept, signal.SIG_DFL if handler is None else handler)


def launcher(ranks: int) -> list[str]:
    """The command that starts a number of ranks."""
    return ["mpirun", "-n", str(ranks)] if ranks > 1 else []


def program() -> list[str]:
    """`pgfmd run` of this very installation."""
    # -P: a folder named pgfmd in the current folder must not be imported instead.
    return [sys.executable, "-P", "-m", "pgfmd.cli", "run"]


def require_launcher(ranks: int) -> None:
    """Raises LaunchError if mpirun is needed and missing."""
    if ranks > 1 and shutil.which("mpirun") is None:
        raise LaunchError(
            f"mpirun is not there, and each job wants {ranks} ranks: install an MPI (`pgfmd doctor` tells more), load "
            "its module, or take --ranks 1, which needs none"
        )


def environment(ranks: int, jobs: int) -> dict[str, str]:
    """The environment of each of a number of jobs."""
    kept = environment_without()
    kept.setdefault("OMP_NUM_THREADS", "1")
    if jobs > 1:
        # mpirun would bind the ranks of each job to the first cores.
        kept.setdefault("OMPI_MCA_hwloc_base_binding_policy", "none")
    if ranks * jobs > cores():
        # Otherwise waiting ranks would occupy the cores of those that compute, because each mpirun only knows its own
        # ranks.
        kept.setdefault("OMPI_MCA_mpi_yield_when_idle", "1")
    return kept


def ran_out_of_time(folder: Path) -> bool:
    """Whether the run in a folder was stopped with a checkpoint by a time limit."""
    from pgfmd.results.inventory import take_inventory

    try:
        found = take_inventory(folder)
    except ResultError:
        return False
    return found is not None and found.why_stopped.startswith(LIMIT_OF_TIME)


def last_words(log: Path, start: int) -> str:
    """The last message of a job: that of pgfmd, which may have several lines, else the last line, in its output from
    `start` [bytes] on."""
    try:
        with open(log, "rb") as file:
            file.seek(start)
            lines = file.read().decode(errors="replace").splitlines()
    except OSError as error:
        return reason(error)
    own = [number for number, line in enumerate(lines) if line.startswith("pgfmd: ")]
    if not own:
        return next((line.strip() for line in reversed(lines) if line.strip(" -")), "it said nothing")
    more = [line for line in lines[own[-1] + 1 :] if line.startswith("  - ")]
    return "\n".join([lines[own[-1]].removeprefix("pgfmd: "), *more])


def _stop_with_parent() -> None:
    """In a new job: asks the kernel to send USR1 when the study's process dies, so that no job continues unattended."""
    signal_at_end_of_parent(signal.SIGUSR1)


def _jobs(count: int) -> str:
    return "1 job" if count == 1 else f"{count} jobs"
