"""The errors that reach a user: one message that says what, where, what was expected and what to do."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass

LONGEST_VALUE = 300
"""Characters of a value that a message shows."""
WRITTEN_IS_VALID = "What has been written so far is valid."
"""What every message says that ends a run within its steps."""


class PgfmdError(Exception):
    """Base of every error whose text is meant for the user; the command line prints it without a traceback."""

    exit_code = 1

    def _render_traceback_(self) -> list[str]:
        """What IPython, and so a notebook, shows of it: the message, no traceback."""
        return [f"{type(self).__name__}: {self}"]


class _Missing:
    def __repr__(self) -> str:
        return "(missing)"


MISSING = _Missing()
"""The `value` of a Problem about a key that is not there."""


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with a scene: dotted key, the value found, what was expected, and a cure."""

    key: str
    value: object
    expected: str
    cure: str = ""

    def __str__(self) -> str:
        text = f"{self.key} = {_shown(self.value)}: expected {self.expected}"
        return on_one_line(f"{text}; {self.cure}" if self.cure else text)


def on_one_line(text: str) -> str:
    """A text with its control characters, such as those in a file's name, written out as `\\n` and the like."""
    return "".join(repr(letter)[1:-1] if unicodedata.category(letter) == "Cc" else letter for letter in text)


def _shown(value: object) -> str:
    """A value as a message shows it: the middle of a long one is left out."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):
        # A whole number of thousands of digits, or lists within lists.
        return "(too long to be shown)"
    return text if len(text) <= LONGEST_VALUE else f"{text[: LONGEST_VALUE - 50]} ... {text[-40:]}"


class SceneError(PgfmdError):
    """A scene that can't be run. Carries every problem that was found, not only the first one."""

    exit_code = 2

    def __init__(self, source: str, problems: list[Problem]):
        self.source = source
        self.problems = problems
        count = "1 problem" if len(problems) == 1 else f"{len(problems)} problems"
        lines = "\n".join(f"  - {problem}" for problem in problems)
        super().__init__(f"{source}: {count} in this scene\n{lines}")


class RunError(PgfmdError):
    """A run that could not go on: says at which step and time, and what the user can change."""

    exit_code = 3


class ResultError(PgfmdError):
    """A results folder that can't be read or written."""

    exit_code = 4


class MeasurementError(PgfmdError):
    """A file of measurements that can't be read, or from which nothing can be computed."""

    exit_code = 4


class LaunchError(PgfmdError):
    """MPI can't be loaded or started, or the processes that were started don't see each other."""

    exit_code = 5


class Stopped(PgfmdError):
    """A run that was stopped, with a checkpoint from which it goes on."""

    exit_code = 75
