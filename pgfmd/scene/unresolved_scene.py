"""A scene before validation: nested tables from a TOML file, a shipped name or Python, and changes of them."""

from __future__ import annotations

import difflib
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.errors import Problem, SceneError
from pgfmd.files.text import read_text
from pgfmd.units import DIMENSIONS

from .drive_section import REPLACED
from .fields import extra_of, toml_of, written
from .model import ADHESION, PATTERNS, RHEOLOGIES, SECTIONS
from .programme_section import ALSO, STEPS, ProgrammeStep, names_force

SELECTORS = (("punch", "pattern", PATTERNS), ("rheology", "model", RHEOLOGIES), ("adhesion", "law", ADHESION))
"""Keys that determine which other keys their section may have, with those keys."""


PATHS = ("punch.file", "substrate.compliance_file", "adhesion.file")
"""Keys that name files, beside those of steps: relative ones start at the folder of the scene."""


def names_file(key: str) -> bool:
    """Whether a key names a file: one of PATHS, or the file that a step follows, such as "drive.step.2.file"."""
    first, _, rest = key.partition("drive.step.")
    return key in PATHS or (not first and rest.removesuffix(".file").isdecimal() and rest.endswith(".file"))


@dataclass(frozen=True)
class Given:
    """A scene as given. mapping: tables by section ("solver.gfmd" is a section of its own), and the title; source: its
    name in messages; folder: the start of relative paths."""

    mapping: Mapping[str, Any]
    source: str = "scene"
    folder: Path = Path(".")

    @classmethod
    def of(cls, tables: Mapping[str, Any], source: str = "scene", folder: str | Path = ".") -> Given:
        """From nested tables, which are copied; NumPy numbers and arrays, paths and tuples become plain values."""
        mapping = {str(name): plain(value) for name, value in tables.items()}
        _flatten(mapping)
        return cls(mapping, source, Path(folder).absolute())

    @classmethod
    def read(cls, source: str | Path) -> Given:
        """From a TOML file, or a shipped name; a file takes precedence. Raises SceneError if there is none, or if it is
        not TOML.

        Paths in a file's scene start at its folder, those in a shipped scene at the working folder.
        """
        path = Path(source)
        if isinstance(source, str) and not os.path.isfile(source) and source in shipped_scenes():
            return cls.parse(shipped_text(source), source)
        try:
            text = read_text(path)
        except FileNotFoundError:
            cure = did_you_mean(str(source), shipped_scenes()) or f"shipped scenes: {', '.join(shipped_scenes())}"
            raise SceneError(str(source), [Problem("scene", str(source), "a file or a shipped scene", cure)]) from None
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or str(error)
            raise SceneError(str(source), [Problem("scene", str(source), "a readable text file", why)]) from None
        return cls.parse(text, str(source), path.parent)

    @classmethod
    def parse(cls, text: str, source: str = "scene", folder: str | Path = ".") -> Given:
        """From a TOML text. Raises SceneError if it is not TOML."""
        try:
            return cls.of(parse_toml(text), source, folder)
        except ValueError as error:
            cure = 'texts and quantities need quotes, such as speed = "1 um/s"'
            raise SceneError(source, [Problem("scene", source, f"valid TOML, but: {error}", cure)]) from None

    def overridden(self, overrides: Sequence[str]) -> tuple[Given, list[Problem]]:
        """The scene with overrides such as "drive.speed=10 um/s", and the problems of these."""
        changes, problems = changes_of(overrides)
        return self.changed(changes), problems

    def changed(self, changes: Mapping[str, Any]) -> Given:
        """The scene with changed keys, by section; None resets a key to its default.

        A new pattern, model or law drops unused keys of its section, unless they are changed as well; new steps of a
        programme those that they replace. Keys such as
        "step.2.duration" of [drive] change a step, counted from 1, and "repeat.times" its repeats; those of a step that is not
        there are kept as they are, and are wrong keys.
        """
        mapping = {name: dict(value) if isinstance(value, dict) else value for name, value in self.mapping.items()}
        changes = {name: plain(value) for name, value in changes.items()}
        _flatten(changes)
        for section, values in changes.items():
            if not isinstance(values, dict):
                mapping[section] = values
            elif isinstance(mapping.setdefault(section, {}), dict):
                # Something that is not a section is reported as such.
                whole, within = values, {}
                if section == "drive":
                    within = {name: value for name, value in values.items() if name.startswith(("step.", "repeat."))}
                    whole = {name: value for name, value in values.items() if name not in within}
                both = mapping[section] | whole
                for name, value in within.items():
                    _change_within(both, name, value)
                mapping[section] = {name: value for name, value in both.items() if value is not None}
        for section, selector, table in SELECTORS:
            named = changes[section] if isinstance(changes.get(section), dict) else {}
            choice = named.get(selector)
            if isinstance(choice, str) and choice in table and isinstance(mapping[section], dict):
                unused = set(SECTIONS[section].model_fields).difference(*table[choice], named)
                mapping[section] = {name: value for name, value in mapping[section].items() if name not in unused}
        drive = changes.get("drive")
        if isinstance(drive, dict) and drive.get("step") and isinstance(mapping["drive"], dict):
            unused = (REPLACED | ({"preload"} if names_force(drive["step"]) else set())) - set(drive)
            mapping["drive"] = {name: value for name, value in mapping["drive"].items() if name not in unused}
        return Given(mapping, self.source, self.folder)

    def to_toml(self) -> str:
        """The same as a TOML text, which may be read anywhere: with absolute paths, and with what is automatic left
        so."""
        tables = {
            section: {key: self._at_home(f"{section}.{key}", value) for key, value in values.items()}
            for section, values in self.mapping.items()
            if isinstance(values, dict)
        }
        return toml_of(self.mapping.get("title", ""), tables)

    def _at_home(self, key: str, value: Any) -> Any:
        if key == "drive.step" and isinstance(value, list):
            return [
                {name: self._at_home(f"{key}.{number}.{name}", each) for name, each in step.items()}
                if isinstance(step, dict)
                else step
                for number, step in enumerate(value, 1)
            ]
        named = names_file(key) and isinstance(value, str)
        return os.path.normpath(self.folder / os.path.expanduser(value)) if named else value


def _change_within(drive: dict[str, Any], name: str, value: Any) -> None:
    """Changes "step.2.duration" or "repeat.times" of a [drive], whose steps and repeats are replaced by copies.

    None resets a key to its default; a new kind of step drops the keys that it has no use for. What is not there stays
    under its own name.
    """
    first, _, rest = name.partition(".")
    number, _, key = rest.partition(".")
    steps = drive.get("step")
    if first == "repeat" and rest and "." not in rest and isinstance(drive.get("repeat", {}), dict):
        drive["repeat"] = _with(drive.get("repeat", {}), rest, value)
        return
    index = int(number) - 1 if number.isdecimal() else -1
    if first != "step" or not key or not isinstance(steps, list) or not 0 <= index < len(steps):
        drive[name] = value
        return
    if not isinstance(steps[index], dict):
        drive[name] = value
        return
    key = ALSO.get(key, key)
    table = {ALSO.get(known, known): entry for known, entry in steps[index].items()}
    if key == "do" and value in STEPS:
        used = {"do"}.union(*STEPS[value])
        table = {known: entry for known, entry in table.items() if known in used}
    drive["step"] = [*steps[:index], _with(table, key, value), *steps[index + 1 :]]


def _with(table: Mapping[str, Any], key: str, value: Any) -> dict[str, Any]:
    """A copy of a table with another value, without the key if that is None."""
    return {name: entry for name, entry in (dict(table) | {key: value}).items() if entry is not None}


def shipped_scenes() -> list[str]:
    """Names of the scenes that come with pgfmd."""
    return sorted(entry.name.removesuffix(".toml") for entry in _shelf().iterdir() if entry.name.endswith(".toml"))


def shipped_text(name: str) -> str:
    """The commented TOML of a shipped scene. Raises SceneError if there is none of this name."""
    if name not in shipped_scenes():
        known = ", ".join(shipped_scenes())
        problem = Problem("scene", name, f"a shipped scene: {known}", did_you_mean(name, shipped_scenes()))
        raise SceneError(name, [problem])
    text: str = (_shelf() / f"{name}.toml").read_text(encoding="utf-8")
    return text


def _shelf() -> Any:
    return resources.files("pgfmd") / "scenes"


def did_you_mean(word: str, known: Sequence[str]) -> str:
    """A question with the most similar known word; empty if none is similar."""
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.6)
    return f"did you mean {near[0]}?" if near else ""


def parse_toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text. Raises ValueError for every kind of error."""
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("brackets within brackets, too many to be read") from None


def changes_of(overrides: Sequence[str]) -> tuple[dict[str, Any], list[Problem]]:
    """Values by section from overrides such as "drive.speed=10 um/s", and the problems of these."""
    changes: dict[str, Any] = {}
    problems = []
    for override in overrides:
        name, equals, text = override.partition("=")
        split = name.rpartition if name.rpartition(".")[0].strip() in SECTIONS else name.partition
        section, dot, key = (part.strip() for part in split("."))
        if not equals or not section or (dot and not key) or (not dot and section != "title"):
            problems.append(Problem("override", override, "section.key=value", "for instance drive.speed=10 um/s"))
            continue
        value = override_value(text.strip())
        if dot:
            changes.setdefault(section, {})[key] = value
        else:
            changes[section] = value
    return changes, problems


def override_value(text: str) -> Any:
    """The value of an override: a number, list or boolean in TOML, else a text."""
    try:
        parsed = parse_toml(f"value = {text}")
    except ValueError:
        return text
    return parsed["value"] if set(parsed) == {"value"} else text


def plain(value: Any) -> Any:
    """A Python value as from TOML: no NumPy types, no paths, lists instead of tuples."""
    if isinstance(value, Mapping):
        return {str(name): plain(entry) for name, entry in value.items()}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    return os.fspath(value) if isinstance(value, Path) else value


def with_units(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Tables of a Python program as from TOML: numbers, which are in SI units, become texts with units."""
    found = {str(name): plain(value) for name, value in tables.items()}
    _flatten(found)
    for section, model in SECTIONS.items():
        if isinstance(found.get(section), dict):
            for key, field in model.model_fields.items():
                extra = extra_of(field)
                if key in found[section] and extra.get("dimension") in DIMENSIONS:
                    found[section][key] = written(_floats(found[section][key]), extra)
    drive = found.get("drive")
    if isinstance(drive, dict):
        if isinstance(drive.get("step"), list):
            drive["step"] = [_step_with_units(step) if isinstance(step, dict) else step for step in drive["step"]]
        for name in drive:
            if name.startswith("step."):
                drive[name] = _step_with_units({name.rpartition(".")[2]: drive[name]}).popitem()[1]
    return found


def _step_with_units(step: Mapping[str, Any]) -> dict[str, Any]:
    """A step of a programme, with texts in the place of numbers whose dimension is known."""
    found = dict(step)
    for key, value in step.items():
        field = ProgrammeStep.model_fields.get(ALSO.get(key, key))
        extra = extra_of(field) if field else {}
        if extra.get("dimension") in DIMENSIONS:
            found[key] = written(_floats(value), extra)
    return found


def _floats(value: Any) -> Any:
    """Integers as floats, because quantities are floats; anything else unchanged."""
    if isinstance(value, list):
        return [_floats(entry) for entry in value]
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def _flatten(mapping: dict[str, Any]) -> None:
    """Moves nested tables, such as [solver.gfmd], to the top level under their full names."""
    for name in SECTIONS:
        outer, dot, inner = name.rpartition(".")
        if dot and isinstance(mapping.get(outer), dict) and inner in mapping[outer]:
            mapping[outer] = dict(mapping[outer])
            mapping[name] = mapping[outer].pop(inner)
