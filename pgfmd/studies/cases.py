"""The cases of a study: every combination of its axes, and the single ones, each with a name and a checked scene."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from pgfmd.errors import Problem, SceneError
from pgfmd.scene import Scene, load_scene
from pgfmd.scene_objects import confirm

from .study_file import Axis, Study, StudyError, is_settable
from .values import override_of, slug

LONGEST_NAME = 150
MOST_NAMED = 3
"""Number of cases that a message names; further ones are counted."""
SUFFIXES = (".log", ".csv", ".txt", ".png", ".json", ".sh", ".toml")
"""Suffixes of the files in the folder of a study."""
_SAFE = re.compile(r"[A-Za-z0-9][A-Za-z0-9.+_-]*")


@dataclass(frozen=True)
class Case:
    """One run of a study. name: of its folder; places: label of its value on each axis, by the name of the axis, empty
    for a single case. twin: name of the case that is its quasi-static twin, if it has one (twins.py). source, overrides:
    arguments of `pgfmd run`. scene: the resulting scene."""

    name: str
    source: str
    overrides: tuple[str, ...]
    scene: Scene = field(repr=False)
    places: dict[str, str] = field(default_factory=dict)
    twin: str = ""


def cases_of(study: Study) -> list[Case]:
    """Every case, the grid first, its first axis varying slowest.

    Raises StudyError with all problems of the file and of all cases. Scenes of cases with wrong keys are not checked.
    """
    complaints: dict[str, list[str]] = {}
    cases = []
    for name, places, changes in _proposed_cases(study):
        if not study.scene or not all(map(is_settable, changes)):
            continue
        overrides = tuple(override_of(key, value) for key, value in changes.items())
        try:
            scene = load_scene(study.scene, overrides)
            confirm(scene, name, study.ranks)
        except SceneError as error:
            for problem in error.problems:
                complaints.setdefault(str(problem), []).append(name)
            continue
        cases.append(Case(name, study.scene, overrides, scene, places))
    problems = [*study.problems, *(f"{_named(names)}: {text}" for text, names in complaints.items())]
    problems += _names_refused(_proposed_cases(study))
    if not study.problems:
        # Cases with errors may seem to be the same.
        problems += _twins(cases)
    if problems:
        raise StudyError(study.source, problems)
    return cases


def _proposed_cases(study: Study) -> Iterator[tuple[str, dict[str, str], dict[str, Any]]]:
    """Name, places and changes of each case."""
    shown = short_names([axis for axis in study.axes if not axis.bundles])
    for values in itertools.product(*(axis.values for axis in study.axes)) if study.axes else ():
        parts, changes = [], dict(study.common)
        for axis, value in zip(study.axes, values, strict=True):
            parts.append(slug(value.label if axis.bundles else f"{shown[axis.name]}-{value.label}"))
            changes |= value.changes
        yield "_".join(parts), {axis.name: value.label for axis, value in zip(study.axes, values, strict=True)}, changes
    for name, changes in study.singles.items():
        yield name, {}, study.common | changes


def short_names(axes: Iterable[Axis]) -> dict[str, str]:
    """The short name of a key for names and legends: without its section if that is unique."""
    names = [axis.name for axis in axes]
    last = [name.rpartition(".")[2] for name in names]
    return {name: short if last.count(short) == 1 else name for name, short in zip(names, last, strict=True)}


def _names_refused(proposed: Iterable[tuple[str, dict[str, str], dict[str, Any]]]) -> Iterator[str]:
    seen: dict[str, int] = {}
    for name, _, _ in proposed:
        if not _SAFE.fullmatch(name) or name.endswith(SUFFIXES):
            what = "letters, digits and . + _ - alone, and ends otherwise than " + ", ".join(SUFFIXES)
            yield str(Problem("case", name, f"a name of a folder: it has {what}", "rename it, or the axis's value"))
        elif len(name) > LONGEST_NAME:
            yield f"case {name}: its name is longer than {LONGEST_NAME}; give a bundle of keys a short name instead"
        # Some file systems do not distinguish capitals.
        seen[name.lower()] = seen.get(name.lower(), 0) + 1
    for name, count in seen.items():
        if count > 1:
            yield f"{count} cases are called {name}: their folders must differ in more than blanks, signs and capitals"


def _twins(cases: Iterable[Case]) -> Iterator[str]:
    """Cases whose scenes are the same."""
    groups: dict[str, list[str]] = {}
    for case in cases:
        groups.setdefault(case.scene.to_toml(), []).append(case.name)
    for names in groups.values():
        if len(names) > 1:
            yield f"{', '.join(names)}: these cases are the same scene; leave one"


def _named(names: list[str]) -> str:
    if len(names) == 1:
        return f"case {names[0]}"
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return f"cases {', '.join(names[:MOST_NAMED])}{more}"
