"""What is a fault in reading and reporting a scene, in this process: `pgfmd check` without its printing."""

from __future__ import annotations

import math
import re
import signal
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import Any

from pgfmd.commands.check import report
from pgfmd.errors import Problem, SceneError
from pgfmd.scene.model import SECTIONS, Scene, unused_keys
from pgfmd.scene.reading import parse_scene
from pgfmd.scene_objects import confirm

from .declarations import KEYS
from .draw import Draw, Mapping, as_toml
from .faults import Fault, of_exception, of_warnings

SLOW = 10.0
"""Processor time [s] in which any scene is read and reported."""
LONGEST_LINE = 2000
"""Characters of a problem that somebody still reads."""
PREFIXES = {"n": -9, "u": -6, "m": -3, "k": 3, "M": 6}
PLAIN = re.compile(r"(?P<number>[+-]?\d+(?:\.\d*)?(?:e[+-]?\d+)?) (?P<unit>m|s|m/s|N|Pa|J/m\^2|N/m)")


@dataclass
class Verdict:
    """What came of a scene: "fine", "refused" or "broken", the message where it is refused, and the faults."""

    outcome: str
    message: str = ""
    faults: list[Fault] = field(default_factory=list)


class Hung(BaseException):
    """The limit of time has come. No Exception, which something on the way might take for its own."""


@contextmanager
def limited(seconds: float | None) -> Iterator[None]:
    """Raises Hung in this thread after some seconds; None for no limit."""
    if seconds is None:
        yield
        return

    def stop(number: int, frame: Any) -> None:
        raise Hung

    previous = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, previous)


def judge_check(text: str, folder: Path, limit: float | None = None) -> Verdict:
    """Reads the TOML of a scene whose files are in a folder, confirms and reports it, and reads it back. limit [s]."""
    verdict, began = Verdict("broken"), time.process_time()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            with limited(limit):
                _judge(text, folder, verdict)
        except Hung as error:
            verdict.faults.append(Fault("hangs", f"more than {limit:g} s, {of_exception(error).label}"))
        except Exception as error:
            verdict.faults.append(of_exception(error))
    verdict.faults += of_warnings(caught)
    spent = time.process_time() - began
    if limit is not None and spent > SLOW:
        verdict.faults.append(Fault("slow", f"{spent:.1f} s"))
    return verdict


def _judge(text: str, folder: Path, verdict: Verdict) -> None:
    try:
        scene = parse_scene(text, source="fuzzed", folder=folder)
        confirm(scene, "fuzzed")
    except SceneError as error:
        verdict.outcome, verdict.message = "refused", str(error)
        verdict.faults += [fault for problem in error.problems for fault in _of_problem(problem)]
        if not error.problems:
            verdict.faults.append(Fault("refused without a problem", verdict.message))
        return
    verdict.faults += [*_of_scene(scene), *_of_report(scene)]
    verdict.outcome = "fine"


def _of_problem(problem: Problem) -> Iterator[Fault]:
    """A problem says where, and what was expected or what to do, on one line."""
    section, _, _ = problem.key.rpartition(".")
    known = problem.key in ("scene", "title", "override") or problem.key in SECTIONS
    known |= problem.key.startswith(("drive.step.", "drive.repeat."))
    if not (known or problem.key in KEYS or section in SECTIONS or not section):
        yield Fault("a problem with a key that is none", problem.key)
    if not (problem.cure or problem.expected):
        yield Fault("a problem without a cure", str(problem))
    for word in ("None", "nan", "Traceback", "errno"):
        if word in f"{problem.expected} {problem.cure}".split():
            yield Fault(f"a problem whose cure says {word}", str(problem)[:300])
    if "\n" in str(problem):
        yield Fault("a problem of several lines", repr(str(problem))[:300])
    if len(problem.expected + problem.cure) > LONGEST_LINE + len(str(problem.value)):
        yield Fault("a problem as long as a page", str(problem)[:300])


def _of_scene(scene: Scene) -> list[Fault]:
    """The resolved scene is finite, keeps what its declarations say, and reads back as itself."""
    faults = [Fault(f"{dotted} beyond its limits", repr(value)) for dotted, value in _outside(scene)]
    try:
        again = parse_scene(scene.to_toml(), source="resolved", folder="/")
        confirm(again, "resolved")
    except SceneError as error:
        return [*faults, Fault("resolved scene refused", str(error).split("\n", 1)[1][:300])]
    used = [key.dotted for key in KEYS.values() if key.name not in unused_keys(scene, key.section)]
    changed = [dotted for dotted in used if _of(again, dotted) != _of(scene, dotted)]
    return faults + ([Fault("resolved scene differs", ", ".join(changed))] if changed else [])


def _of(scene: Scene, dotted: str) -> Any:
    section, _, name = dotted.rpartition(".")
    return getattr(scene.section(section), name)


def _outside(scene: Scene) -> Iterator[tuple[str, Any]]:
    """Numbers of a resolved scene that a scene would not be allowed to hold."""
    for dotted, key in KEYS.items():
        value = _of(scene, dotted)
        for entry in value if isinstance(value, tuple) else (value,):
            if key.kind not in ("quantity", "number") or not isinstance(entry, float):
                continue
            low = (key.above is None or entry > key.above) and (key.at_least is None or entry >= key.at_least)
            high = key.at_most is None or entry <= key.at_most
            if not (low and high and (math.isfinite(entry) or (entry > 0 and key.infinite))):
                yield dotted, value


INFINITE_LINES = ("curvature_radius", "thickness", "machine_stiffness", "time to", "expected time", "expected steps")


def _of_report(scene: Scene) -> Iterator[Fault]:
    """Every number of the report is one, and no warning holds one that is none."""
    found = report(scene, 1)
    for lines in found.sections.values():
        for line in lines:
            value = line.value
            infinite = isinstance(value, float) and math.isinf(value)
            if isinstance(value, float) and math.isnan(value):
                yield Fault(f"report: {line.name} is NaN")
            elif infinite and not any(word in line.name for word in INFINITE_LINES):
                yield Fault(f"report: {line.name} is infinite")
    for text in (*found.warnings, *found.remarks):
        if re.search(r"\b(nan|inf|None)\b", text):
            yield Fault("report: a warning that says nan, inf or None", text[:300])


def respelled(draw: Draw, scene: Mapping) -> str:
    """The same scene with other prefixes before its units."""

    def other(value: Any) -> Any:
        if isinstance(value, list):
            return [other(entry) for entry in value]
        match = PLAIN.fullmatch(value) if isinstance(value, str) else None
        if match is None:
            return value
        prefix = draw.choice(tuple(PREFIXES))
        return f"{Decimal(match['number']).scaleb(-PREFIXES[prefix])} {prefix}{match['unit']}"

    return as_toml({
        section: {name: other(value) if _has_units(section, name) else value for name, value in keys.items()}
        if isinstance(keys, dict)
        else keys
        for section, keys in scene.items()
    })  # fmt: skip


def _has_units(section: str, name: str) -> bool:
    """Whether a key is a quantity; a name of a folder may look like one."""
    key = KEYS.get(f"{section}.{name}")
    return key is not None and key.kind == "quantity"


def judge_spelling(draw: Draw, scene: Mapping, folder: Path) -> list[Fault]:
    """A scene that is fine reads the same with its quantities spelled in other units."""
    one, other = (parse_scene(text, folder=folder) for text in (as_toml(scene), respelled(draw, scene)))
    changed = [dotted for dotted in KEYS if _of(one, dotted) != _of(other, dotted)]
    return [Fault("another prefix gives other bits", ", ".join(changed))] if changed else []
