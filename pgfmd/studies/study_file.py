"""The file of a study: a scene, changes for every case, the axes of a grid, further cases. No MPI.

    study = read_study("preloads.toml")

Problems of the scenes, such as a value out of range, are found by `cases.cases_of`, which reports all problems.
"""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pgfmd.errors import PgfmdError, Problem
from pgfmd.files.text import read_text
from pgfmd.scene import shipped_scenes
from pgfmd.scene.dotted_keys import field_of
from pgfmd.scene.model import SECTIONS
from pgfmd.scene.partial_scene import MISSING
from pgfmd.scene.unresolved_scene import names_file, parse_toml

from .values import label_of_value

KEYS = tuple(f"{section}.{name}" for section, model in SECTIONS.items() for name in model.model_fields)
"""Every key of a scene, with its section."""
OWN = "output.directory"
"""The key that is set by the study."""
PARTS = ("title", "scene", "set", "axes", "case", "run")


class StudyError(PgfmdError):
    """A study that can't be started. It has all problems, as texts."""

    exit_code = 2

    def __init__(self, source: str, problems: list[str]):
        self.problems = problems
        count = "1 problem" if len(problems) == 1 else f"{len(problems)} problems"
        lines = "\n".join(f"  - {problem}" for problem in problems)
        super().__init__(f"{source}: {count} in this study\n{lines}")


@dataclass(frozen=True)
class Value:
    """A value on an axis: its text in the file, and the keys of the scene that it sets."""

    label: str
    changes: dict[str, Any]


@dataclass(frozen=True)
class Axis:
    """An axis of the grid. name: a key of the scene, or the name of a table of bundles (then `bundles`)."""

    name: str
    values: tuple[Value, ...] = ()
    bundles: bool = False


@dataclass(frozen=True)
class Study:
    """A study as its file has it. scene: a shipped name or an absolute path; common: changes for every case; singles:
    further cases, their changes by name; ranks of each job, number of parallel jobs, time between checkpoints;
    twins: whether the quasi-static twins of the cases are run too.

    problems: errors of the file, which `cases_of` raises together with those of its cases. A wrong scene is empty;
    changes keep wrong keys.
    """

    source: str
    title: str
    scene: str
    common: dict[str, Any] = field(default_factory=dict)
    axes: tuple[Axis, ...] = ()
    singles: dict[str, dict[str, Any]] = field(default_factory=dict)
    ranks: int = 1
    jobs: int = 1
    checkpoint_every: str = "10min"
    twins: bool = False
    problems: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The file's name without its ending."""
        return Path(self.source).stem


def read_study(path: str | Path) -> Study:
    """The study in a file, with its problems. Raises StudyError if it can't be read at all."""
    path = Path(path)
    try:
        text = read_text(path)
    except FileNotFoundError:
        raise StudyError(str(path), ["there is no such file; docs/how-to/studies.md shows how one looks"]) from None
    except (OSError, ValueError) as error:
        raise StudyError(str(path), [f"could not be read: {getattr(error, 'strerror', None) or error}"]) from None
    try:
        mapping = parse_toml(text)
    except ValueError as error:
        cure = 'texts, quantities and keys with dots need quotes, such as "drive.speed" = ["1 um/s"]'
        raise StudyError(str(path), [f"not valid TOML: {error}; {cure}"]) from None
    return study_from_mapping(mapping, str(path), path.absolute().parent)


def study_from_mapping(mapping: Mapping[str, Any], source: str, folder: Path) -> Study:
    """The study of nested dicts as TOML would give them, with its problems."""
    reader = _Reader(folder)
    for name in set(mapping) - set(PARTS):
        reader.wrong(name, mapping[name], "one of " + ", ".join(PARTS), did_you_mean(name, PARTS))
    title = reader.typed(mapping.get("title", ""), "title", str, "")
    scene = reader.scene(mapping.get("scene", MISSING))
    common = reader.changes(mapping.get("set", {}), "set")
    axes = reader.axes(mapping.get("axes", {}), common)
    singles = reader.singles(mapping.get("case", []))
    if not axes and not singles and not reader.problems:
        reader.problems.append("nothing varies: give it [axes], or a [[case]]")
    run = reader.run(mapping.get("run", {}))
    return Study(source, title, scene, common, axes, singles, **run, problems=tuple(reader.problems))


def is_settable(key: str) -> bool:
    """Whether a study may set a key."""
    return key != OWN and (key in KEYS or field_of(key) is not None)


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A hint at the nearest known word; empty if none is near. A key without its section is found, too."""
    known = list(known)
    owners = [name for name in known if name.rpartition(".")[2] == word]
    near = owners or difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f"did you mean {' or '.join(near)}?" if near else ""


class _Reader:
    """Reads the parts of a study, and collects their errors."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.problems: list[str] = []

    def wrong(self, key: str, value: object, expected: str, cure: str = "") -> None:
        self.problems.append(str(Problem(key, value, expected, cure)))

    def typed(self, value: Any, name: str, kind: type[Any], instead: Any) -> Any:
        words = {
            str: "a text in quotes",
            dict: "a table",
            list: "a list",
            int: "a whole number above 0",
            bool: "true or false",
        }
        if (isinstance(value, bool) and kind is not bool) or not isinstance(value, kind) or (kind is int and value < 1):
            self.wrong(name, value, words[kind])
            return instead
        return value

    def scene(self, value: Any) -> str:
        if not isinstance(value, str):
            self.wrong("scene", value, "a file, or the name of a shipped scene", 'for instance scene = "tri-tack"')
            return ""
        path = self.folder / os.path.expanduser(value)
        if path.is_file():
            return str(path)
        if value not in shipped_scenes():
            cure = did_you_mean(value, shipped_scenes()) or f"shipped scenes: {', '.join(shipped_scenes())}"
            self.wrong("scene", value, f"a file in {self.folder}, or a shipped scene", cure)
            return ""
        return value

    def changes(self, table: Any, where: str) -> dict[str, Any]:
        """Keys and values of a table, nested or with dotted keys; wrong keys, too."""
        found = {}
        for name, value in _flat(self.typed(table, where, dict, {})):
            found[name] = self._at_home(name, value)
            if is_settable(name):
                continue
            cure = "a study chooses its folders itself" if name == OWN else did_you_mean(name, KEYS)
            self.wrong(f"{where}: {name}", value, "a key of the scene, such as drive.speed", cure)
        return found

    def _at_home(self, name: str, value: Any) -> Any:
        """A value; relative paths of files start at the folder of the study."""
        named = names_file(name) and isinstance(value, str)
        return os.path.normpath(self.folder / os.path.expanduser(value)) if named else value

    def axes(self, table: Any, common: dict[str, Any]) -> tuple[Axis, ...]:
        axes = []
        for name, entry in self.typed(table, "axes", dict, {}).items():
            axes += self._axes_of(name, entry)
        setters: dict[str, str] = {}
        for axis in axes:
            for key in {key for value in axis.values for key in value.changes}:
                if key in setters:
                    self.problems.append(f"axes: {key} is set by {setters[key]} and by {axis.name}; leave it to one")
                elif key in common and not axis.bundles:
                    self.problems.append(f"axes: {key} is in [set], too; leave it to one")
                setters[key] = axis.name
        return tuple(axes)

    def _axes_of(self, name: str, entry: Any) -> list[Axis]:
        """The axis that an entry of [axes] is, or the axes of its keys: `drive.speed = [...]` without quotes."""
        if isinstance(entry, list):
            return self._key_axis(name, entry)
        if not isinstance(entry, dict) or not entry:
            cure = "one value needs no axis: it goes into [set]" if not isinstance(entry, dict) else ""
            self.wrong(f"axes: {name}", entry, "a list of values, or a table of named bundles of keys", cure)
            return []
        if any(isinstance(inner, list) for inner in entry.values()):
            return [axis for key, inner in entry.items() for axis in self._axes_of(f"{name}.{key}", inner)]
        inner = [key for key in entry if f"{name}.{key}" in SECTIONS]
        if inner and all(isinstance(each, list) for key in inner for each in entry[key].values()):
            return [axis for key in inner for axis in self._axes_of(f"{name}.{key}", entry[key])]
        return [self._bundle_axis(name, entry)]

    def _key_axis(self, name: str, values: list) -> list[Axis]:
        if not values:
            self.wrong(f"axes: {name}", values, "at least one value")
        if not is_settable(name):
            # Reported once.
            self.changes({name: values[0] if values else values}, "axes")
            return []
        places = {label_of_value(value): {name: self._at_home(name, value)} for value in values}
        self._twice(f"axes: {name}", [label_of_value(value) for value in values])
        return [Axis(name, tuple(Value(label, changes) for label, changes in places.items()))]

    def _bundle_axis(self, name: str, table: dict) -> Axis:
        places = [Value(label, self.changes(bundle, f"axes.{name}, {label}")) for label, bundle in table.items()]
        return Axis(name, tuple(places), bundles=True)

    def _twice(self, where: str, labels: list[str]) -> None:
        for label in sorted({label for label in labels if labels.count(label) > 1}):
            self.problems.append(f"{where}: {label} is there twice")

    def singles(self, entries: Any) -> dict[str, dict[str, Any]]:
        found: dict[str, dict[str, Any]] = {}
        for number, entry in enumerate(self.typed(entries, "case", list, []), 1):
            entry = self.typed(entry, f"case {number}", dict, {"name": str(number)})
            name = entry.get("name", MISSING)
            if not isinstance(name, str) or not name:
                self.wrong(f"case {number}: name", name, "a text that names the case")
                continue
            for key in set(entry) - {"name", "set"}:
                self.wrong(f"case {name}: {key}", entry[key], "name or set", "keys of the scene go into set = { ... }")
            if name in found:
                self.problems.append(f"case {name}: there are two cases of this name")
            found[name] = self.changes(entry.get("set", {}), f"case {name}")
        return found

    def run(self, table: Any) -> dict[str, Any]:
        found = {}
        kinds = {"ranks": int, "jobs": int, "checkpoint_every": str, "twins": bool}
        for name, value in self.typed(table, "run", dict, {}).items():
            if name not in kinds:
                self.wrong(f"run: {name}", value, "one of " + ", ".join(kinds), did_you_mean(name, kinds))
            elif (value := self.typed(value, f"run: {name}", kinds[name], None)) is not None:
                found[name] = value
        return found


def _flat(table: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    for name, value in table.items():
        if isinstance(value, dict) and value:
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
