"""A study from its cases to its table: the cases that are to be run, the jobs, and their results."""

from __future__ import annotations

import fnmatch
import re
import shlex
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from pgfmd.errors import PgfmdError, ResultError, RunError, Stopped
from pgfmd.files import storage

from .case_state import CHANGED, DAMAGED, FAILED, FINISHED, RUNNING, CaseState, case_state_of
from .cases import Case
from .pool import Ending, Pool, Task
from .study_file import StudyError, did_you_mean

CURES = {
    FAILED: "go on with --retry, and with --allow KEY if the study's keys have changed since",
    CHANGED: "--fresh starts it anew and keeps the old results in previous-1",
    DAMAGED: "`pgfmd verify` tells more; --fresh starts it anew and keeps what is there in previous-1",
}

_CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")


class Unfinished(PgfmdError):
    """Not every case could be finished. The exit code is that of a run that was stopped, or that failed.

    table: the table of the study (table.StudyTable), if `study` or `converge` raises it.
    """

    table: Any = None

    def __init__(self, message: str, failed: bool):
        super().__init__(message)
        self.exit_code = RunError.exit_code if failed else Stopped.exit_code


@dataclass(frozen=True)
class Wishes:
    """Options of a study. It runs unfinished cases. retry: also failed ones. fresh: also changed and damaged ones, from
    the start. allow: keys that may have changed since a run began. checkpoint_every: time between checkpoints."""

    retry: bool = False
    fresh: bool = False
    allow: tuple[str, ...] = ()
    checkpoint_every: str = "10min"


@dataclass
class Campaign:
    """The cases of a study. Results are in OUT/<case>, and the output of a job is in OUT/<case>.log."""

    cases: list[Case]
    out: Path
    wishes: Wishes = field(default_factory=Wishes)
    say: Callable[[str], None] = print

    def __post_init__(self) -> None:
        """Raises StudyError for characters that must not be in a line of a script, or in one that a user may copy."""
        texts = [str(self.out), *(text for case in self.cases for text in (case.source, *case.overrides, case.name))]
        found = dict.fromkeys(text for text in texts if _CONTROL.search(text))
        if found:
            expected = "no line feed nor any other control character; rename the file or folder"
            raise StudyError("command line", [f"{text!r}: expected {expected}" for text in found])

    def folder(self, case: Case) -> Path:
        """The folder of a case's results."""
        return self.out / case.name

    def states(self) -> dict[str, CaseState]:
        """The state of every case, by name."""
        return {case.name: case_state_of(case, self.folder(case), self.wishes.allow) for case in self.cases}

    def only(self, patterns: Sequence[str]) -> Campaign:
        """The cases whose names match one of the patterns, such as "preload-40mN*"; all without a pattern.

        Raises StudyError for a pattern that matches none.
        """
        names = [case.name for case in self.cases]
        problems = []
        for pattern in patterns:
            if not fnmatch.filter(names, pattern):
                hint = did_you_mean(pattern, names) or f"cases: {', '.join(names)}"
                problems.append(f"--only {pattern}: no case has such a name; {hint}")
        if problems:
            raise StudyError("command line", problems)
        kept = [case for case in self.cases if any(fnmatch.fnmatch(case.name, pattern) for pattern in patterns)]
        return replace(self, cases=kept) if patterns else self

    def agenda(self, states: dict[str, CaseState]) -> list[Case]:
        """The cases for which a job has to be started."""
        anew = (CHANGED, DAMAGED) if self.wishes.fresh else ()
        never = {FINISHED, RUNNING, CHANGED, DAMAGED, *(() if self.wishes.retry else (FAILED,))} - set(anew)
        return [case for case in self.cases if states[case.name].state not in never]

    def clear_folders(self, cases: Sequence[Case], states: dict[str, CaseState]) -> None:
        """Moves the contents of the folders of changed and damaged cases aside, so that these can start again.
        ResultError."""
        from pgfmd.host.run_lock import RunLock

        for case in cases:
            if states[case.name].state in (CHANGED, DAMAGED):
                folder = self.folder(case)
                lock = RunLock.acquire(folder, 1)
                try:
                    aside, error = storage.attempt(f"{folder}", partial(storage.set_aside, folder))
                finally:
                    lock.release()
                if error is not None:
                    raise error
                self.say(f"{case.name}: begins anew; what was there is in {aside}")

    def arguments(self, case: Case) -> tuple[str, ...]:
        """The arguments of `pgfmd run` for a case, without its folder."""
        allowed = [part for key in self.wishes.allow for part in ("--allow", key)]
        return (case.source, *case.overrides, "--checkpoint-every", self.wishes.checkpoint_every, *allowed)

    def quoted(self, case: Case) -> str:
        """The arguments of a case, quoted for a shell."""
        return shlex.join(self.arguments(case))

    def run(self, ranks: int, jobs: int) -> None:
        """Runs unfinished cases on this machine. Raises Unfinished if a case is not finished afterwards."""
        states = self.states()
        chosen = self.agenda(states)
        self.tell(states)
        make_folder(self.out)
        self.clear_folders(chosen, states)
        counted: Counter[str] = Counter()

        def on_end(task: Task, ending: Ending) -> None:
            counted["ended"] += 1
            self.say(f"[{counted['ended']}/{len(chosen)}] {task.name}: {self._outcome(task, ending)}")

        tasks = [self._task(case) for case in chosen]
        pool = Pool(ranks, jobs, self.say)
        failures: dict[str, str] = {}

        def keep(task: Task, ending: Ending) -> None:
            if ending.code not in (0, Stopped.exit_code) and not pool.stopped:
                failures[task.name] = f"exit code {ending.code}: {ending.why}"
            on_end(task, ending)

        pool.run(tasks, keep)
        self.conclude(failures, pool.stopped)

    def _task(self, case: Case) -> Task:
        folder = self.folder(case)
        return Task(case.name, (*self.arguments(case), "--out", str(folder)), folder, self.out / f"{case.name}.log")

    def tell(self, states: dict[str, CaseState]) -> None:
        """Prints the states of the cases."""
        counts = Counter(case_state.state for case_state in states.values())
        count = "1 case" if len(self.cases) == 1 else f"{len(self.cases)} cases"
        self.say(f"{count} in {self.out}: " + ", ".join(f"{counts[state]} {state}" for state in counts))

    def conclude(self, failures: dict[str, str], stopped: str) -> None:
        """Raises Unfinished with the unfinished cases, the reasons, and what to do."""
        states = self.states()
        lines, left = [], []
        for case in self.cases:
            case_state = states[case.name]
            if case_state.state == FINISHED:
                continue
            if case_state.state in CURES:
                lines.append(f"{case.name}: {case_state.state}: {case_state.why}; {CURES[case_state.state]}")
            elif case.name in failures:
                lines.append(f"{case.name}: {failures[case.name]}; its output is {self.out / case.name}.log")
            else:
                left.append(f"{case.name} ({case_state.state})")
        if not lines and not left:
            return
        text = f"{len(self.cases) - len(lines) - len(left)} of {len(self.cases)} cases are finished"
        if stopped:
            text += f"; stopped by {stopped}: the same command goes on"
        if left:
            text += f"\n  not finished: {', '.join(left)}"
        text += "".join(f"\n  {line}" for line in lines)
        raise Unfinished(text, failed=bool(lines) and not stopped)

    def _outcome(self, task: Task, ending: Ending) -> str:
        """The end of a job, in one line."""
        if ending.code == Stopped.exit_code:
            return f"stopped with a checkpoint, {ending.seconds:.3g} s"
        if ending.code:
            return f"failed with exit code {ending.code} after {ending.seconds:.3g} s: {ending.why}"
        case = next(case for case in self.cases if case.name == task.name)
        case_state = case_state_of(case, self.folder(case), self.wishes.allow)
        record = case_state.record or {}
        numbers = [
            f"{name} {record[key] * factor + 0.0:.4g} {unit}"
            for name, key, factor, unit in (
                ("pull-off", "pull_off_force_N", 1e3, "mN"),
                ("loop", "work_J", 1e9, "nJ"),
            )
            if record.get(key) is not None
        ]
        return ", ".join([str(case_state), *numbers, f"{ending.seconds:.3g} s"])


def make_folder(out: Path) -> None:
    """Makes the folder of a study. Raises ResultError if it can't be made or written to."""
    try:
        storage.make_directory(out)
    except OSError as error:
        raise ResultError(f"{out}: can't be used as a folder for results: {storage.reason(error)}") from error
