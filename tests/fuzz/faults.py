"""A fault, and how exceptions and warnings are told."""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pgfmd

PACKAGE = str(Path(pgfmd.__file__).parent)


@dataclass(frozen=True)
class Fault:
    """label: what kind, the same for all of its kind; text: this one."""

    label: str
    text: str = ""

    def __str__(self) -> str:
        return f"{self.label}: {self.text}" if self.text else self.label


def of_exception(error: BaseException) -> Fault:
    """An exception that reached the user, by its kind and the place in the package that it came from."""
    places = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename.startswith(PACKAGE)]
    place = f" at {Path(places[-1].filename).relative_to(PACKAGE)}:{places[-1].lineno}" if places else ""
    return Fault(f"traceback, {type(error).__name__}{place}", str(error)[:300])


def of_warnings(caught: Sequence[warnings.WarningMessage]) -> list[Fault]:
    """Python's warnings that a user would see, those of a place once."""
    found = {}
    for one in caught:
        name = one.filename.removeprefix(f"{PACKAGE}/")
        place = f"{name}:{one.lineno}" if name != one.filename else Path(one.filename).name
        found.setdefault(f"{one.category.__name__} at {place}", str(one.message)[:200])
    return [Fault(label, text) for label, text in found.items()]
