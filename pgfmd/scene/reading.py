"""Reading a scene: TOML file or shipped name, overrides, every problem at once, "auto" resolved, paths absolute.

    scene = load_scene("tri-tack", ["grid.n=512", "drive.speed=10 um/s"])

What a scene says is in unresolved_scene.py, the models are in model.py, the rules across keys in checks.py.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from pgfmd.errors import MeasurementError, Problem, SceneError
from pgfmd.physics.adhesion.registry import LAWS, clearance_of, length_of, range_by_rule
from pgfmd.physics.drive import automatic_turn
from pgfmd.physics.random_surface import automatic_period

from .checks import check, refer_to_relaxed
from .fields import expectation, extra_of, within_limits, written
from .model import SECTIONS, Adhesion, Scene
from .partial_scene import MISSING, PartialScene, example, is_unicode
from .precision import best_precision
from .programme_section import Repeat, largest_force
from .unresolved_scene import Given, did_you_mean, shipped_scenes, shipped_text

__all__ = ["Scene", "load_scene", "parse_scene", "scene_from_mapping", "shipped_scenes", "shipped_text"]

AUTOMATIC = ("adhesion.q_ref", "adhesion.range", "drive.turn_time", "drive.clearance")
"""Keys whose values may follow from others."""


def load_scene(source: str | Path, overrides: Sequence[str] = (), *, require_files: bool = True) -> Scene:
    """The checked and resolved scene of a TOML file or of a shipped name.

    source: a path, or a name from `shipped_scenes()`; a file of that name wins. overrides: texts such as
    "drive.speed=10 um/s". Paths in a file's scene start at its folder, those in a shipped scene at the working folder.
    require_files: whether the files that it names must be there; those of a run of the past may have moved.
    Raises SceneError with every problem found.
    """
    return scene_of(Given.read(source), overrides, require_files=require_files)


def parse_scene(
    text: str,
    overrides: Sequence[str] = (),
    *,
    source: str = "scene",
    folder: str | Path = ".",
    require_files: bool = True,
) -> Scene:
    """The checked and resolved scene of a TOML text; source names it in errors, relative paths start at folder.

    require_files: as for `load_scene`.
    """
    return scene_of(Given.parse(text, source, folder), overrides, require_files=require_files)


def scene_from_mapping(
    mapping: Mapping[str, Any],
    overrides: Sequence[str] = (),
    *,
    source: str = "scene",
    folder: str | Path = ".",
    require_files: bool = True,
) -> Scene:
    """The checked and resolved scene of nested tables: quantities are texts with units, or SI numbers."""
    return scene_of(Given.of(mapping, source, folder), overrides, require_files=require_files)


def scene_of(given: Given, overrides: Sequence[str] = (), *, require_files: bool = True) -> Scene:
    """The checked and resolved scene of what was given. Raises SceneError with every problem found."""
    given, problems = given.overridden(overrides)
    mapping, partial = given.mapping, PartialScene(given.folder)
    problems += _read_sections(mapping, partial)
    problems += refer_to_relaxed(partial)
    problems += check(partial, require_files)
    title = mapping.get("title", "")
    if not isinstance(title, str):
        problems.append(Problem("title", title, "a text", "put it in quotes"))
    elif not is_unicode(title):
        problems.append(Problem("title", title, "a text in Unicode", "correct what was not UTF-8 in it"))
    if problems:
        raise SceneError(given.source, problems)
    try:
        scene = _resolve(title, partial)
    except (OSError, MeasurementError) as error:
        # Of a law, or of a step to follow, whose file is asked for though files need not be there.
        followed = any(step.file for step in partial["drive.step"])
        file = getattr(error, "filename", None) or str(error)
        problem = Problem("drive.step" if followed else "adhesion.file", file, "a file that can be read", str(error))
        raise SceneError(given.source, [problem]) from None
    problems = list(_automatic_problems(scene))
    if problems:
        raise SceneError(given.source, problems)
    return scene.remembering(given)


def _read_sections(mapping: Mapping[str, Any], partial: PartialScene) -> list[Problem]:
    """Fills the partial scene; returns what is wrong with single keys."""
    problems = []
    for name, value in mapping.items():
        if name not in SECTIONS and name != "title":
            owners = [section for section, model in SECTIONS.items() if name in model.model_fields]
            moved = owners and not isinstance(value, dict)
            cure = f"move it to [{owners[0]}]" if moved else did_you_mean(name, list(SECTIONS))
            problems.append(Problem(name, value, "one of the sections " + ", ".join(SECTIONS), cure))
    for section, model in SECTIONS.items():
        raw = mapping.get(section, {})
        if not isinstance(raw, dict):
            cure = f"write [{section}] on a line of its own, its keys below"
            problems.append(Problem(section, raw, "a section", cure))
            raw = {}
        partial.raw[section], partial.values[section] = raw, {}
        try:
            model.model_validate(raw, context=partial.values[section])
        except ValidationError as error:
            for details in error.errors(include_url=False):
                problems += _problems_of(section, model, details, raw)
    return problems


def _problems_of(
    section: str, model: type[BaseModel], error: Mapping[str, Any], raw: Mapping[str, Any]
) -> list[Problem]:
    """A pydantic error in the words of the scene; raw: the section as given."""
    name, context = str(error["loc"][0]), error.get("ctx", {})
    dotted = ".".join([section, *(str(part) for part in error["loc"])])
    if error["type"] == "scene":
        # The fourth part, if there is one, is the rest of the key.
        return [Problem(dotted + "".join(parts[3:]), *parts[:3]) for parts in context["problems"]]
    if error["type"] == "extra_forbidden" and section == "drive" and name.startswith("step."):
        steps = raw.get("step")
        count = len(steps) if isinstance(steps, list) else 0
        expected = f"a step from 1 to {count}, and a key of it" if count else "a scene with steps, [[drive.step]]"
        return [Problem(dotted, error["input"], expected, "for instance drive.step.1.duration=30 s" if count else "")]
    if error["type"] in ("extra_forbidden", "missing") and len(error["loc"]) > 1:
        # Of the table [drive.repeat], the one within a section.
        if error["type"] == "missing":
            return [Problem(dotted, MISSING, "a whole number", "add times = 3 to [drive.repeat]")]
        inner = str(error["loc"][1])
        expected = f"a key of [drive.repeat]: {', '.join(Repeat.model_fields)}"
        return [Problem(dotted, error["input"], expected, did_you_mean(inner, list(Repeat.model_fields)))]
    if error["type"] == "extra_forbidden":
        owners = [other for other, fields in SECTIONS.items() if name in fields.model_fields]
        cure = f"move it to [{owners[0]}]" if owners else did_you_mean(name, list(model.model_fields))
        return [Problem(dotted, error["input"], f"a key of [{section}]: {', '.join(model.model_fields)}", cure)]
    if error["type"] == "missing":
        field = model.model_fields[name]
        choices = getattr(field.annotation, "__args__", ())
        words = " or ".join(f"'{choice}'" for choice in choices if isinstance(choice, str)) or "a whole number"
        expected = expectation(extra_of(field)) if extra_of(field) else words
        return [Problem(dotted, MISSING, expected, f"add {example(section, name)} to [{section}]")]
    if error["type"] == "string_unicode":
        return [Problem(dotted, error["input"], "a text in UTF-8", "correct, or rename, what is not UTF-8 in it")]
    expected = error["msg"].removeprefix("Input should be ")
    if error["type"] == "model_type":
        expected = f"a table [{dotted}] with times, and perhaps first and last"
    if error["type"] == "literal_error":
        choices = [word.strip("' ") for word in context["expected"].replace(" or ", ",").split(",")]
        return [Problem(dotted, error["input"], context["expected"], did_you_mean(str(error["input"]), choices))]
    return [Problem(dotted, error["input"], expected)]


def _resolve(title: str, partial: PartialScene) -> Scene:
    """The scene with defaults, automatic values and absolute paths filled in; the partial scene has no problems."""
    # Of these, words are still words.
    parts: dict[str, Any] = {name: model.model_construct(**partial.values[name]) for name, model in SECTIONS.items()}
    drive, substrate = parts["drive"], parts["substrate"]
    # As the others.
    adhesion: Any = _with_own_values(partial, parts["adhesion"])
    q_ref = adhesion.q_ref
    if q_ref == "grid":
        q_ref = 2.0 * math.pi * parts["grid"].n / parts["grid"].length
    reach = adhesion.range
    if reach == "auto":
        modulus = substrate.contact_modulus
        reach = range_by_rule(adhesion, modulus, adhesion.range_factor, q_ref)
    adhesion = adhesion.model_copy(update={"q_ref": q_ref, "range": reach})
    if drive.step:
        radius = parts["punch"].radius or 0.5 * parts["grid"].length
        drive = _standing_in(drive, partial, 2.0 * radius * substrate.contact_modulus, length_of(adhesion))
        parts["drive"] = drive
    retract_speed = drive.retract_speed or drive.speed
    automatic: dict[str, dict[str, Any]] = {
        "drive": {
            "retract_speed": retract_speed,
            "turn_time": (
                automatic_turn(length_of(adhesion), drive.speed, retract_speed)
                if drive.turn_time == "auto"
                else drive.turn_time
            ),
            "clearance": clearance_of(adhesion) if drive.clearance == "auto" else drive.clearance,
        },
        "punch": {"file": _text(partial.path("punch.file")), **_of_random_face(parts["punch"], parts["grid"].length)},
        "substrate": {
            "compliance_file": _text(partial.path("substrate.compliance_file")),
            "base": (substrate.base or "bonded") if math.isfinite(substrate.thickness) else None,
        },
    }
    parts["adhesion"] = adhesion
    resolved = {name.replace(".", "_"): part.model_copy(update=automatic.get(name, {})) for name, part in parts.items()}
    scene = Scene.model_construct(title=title, **resolved)
    if scene.solver.precision != "auto":
        return scene
    return scene.model_copy(update={"solver": scene.solver.chosen(best_precision(scene).precision)})


def _standing_in(drive: Any, partial: PartialScene, stiffness: float, reach: float) -> Any:
    """A [drive] with steps, with absolute paths, and the speed and the preload that stand for them in forecasts: about that
    of the first step that moves, the largest speed, and the largest force. stiffness [N/m]: of the contact of the whole punch; reach [m]: of
    adhesion, which the punch is taken to move by where all steps hold."""
    steps = []
    for step in drive.step:
        path = step.file and str((partial.folder / os.path.expanduser(step.file)).absolute())
        steps.append(step.model_copy(update={"file": path}))
    held = max(step.duration or 1.0 for step in steps)
    speed = next((speed for step in steps if (speed := step.speed_with(stiffness))), reach / held)
    fastest = max(speed, *(step.speed_with(stiffness) for step in steps))
    preload = largest_force(drive.step) or drive.preload
    return drive.model_copy(update={"step": tuple(steps), "speed": speed, "retract_speed": fastest, "preload": preload})


def _with_own_values(partial: PartialScene, adhesion: Adhesion) -> Adhesion:
    """The section with the path of its file, and with what its law knows by itself of keys that are not given."""
    law = LAWS[adhesion.law]
    adhesion = adhesion.model_copy(update={"file": _text(partial.path("adhesion.file"))})
    left = [name for name in law.known if not partial.given(f"adhesion.{name}")]
    found = law.own_values(adhesion) if left else {}
    return adhesion.model_copy(update={name: found[name] for name in left})


def _automatic_problems(scene: Scene) -> Iterator[Problem]:
    """Automatic values that a scene could not give by itself: then what they follow from makes no sense together."""
    for dotted in AUTOMATIC:
        section, _, name = dotted.rpartition(".")
        value, field = getattr(scene.section(section), name), SECTIONS[section].model_fields[name]
        if not within_limits(value, extra_of(field)):
            expected = f"{expectation(extra_of(field))}; it follows from other keys, which do not fit together"
            yield Problem(dotted, written(value, extra_of(field)), expected, "look at their units")


def _of_random_face(punch: Any, side: float) -> dict[str, float]:
    """What a random face, in a cell of this side [m], does not say itself; nothing of another punch."""
    if punch.pattern != "rough":
        return {}
    period = punch.period or automatic_period(punch.radius, punch.longest, side)
    return {"roll_off": punch.roll_off or punch.longest, "period": period}


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path)
