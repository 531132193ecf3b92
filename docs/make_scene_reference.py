"""Writes the reference page of the scene's keys, docs/reference/scene.md, from the models.

python docs/make_scene_reference.py           writes the page
python docs/make_scene_reference.py -         prints it
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from pgfmd.scene import shipped_scenes
from pgfmd.scene.fields import LARGEST, SMALLEST, OneOf, limits_text, written
from pgfmd.scene.model import ADHESION, PATTERNS, RHEOLOGIES, SECTIONS, Keys
from pgfmd.scene.programme_section import STEPS, ProgrammeStep, Repeat
from pgfmd.units import DIMENSIONS

PAGE = Path(__file__).parent / "reference" / "scene.md"
CHOICES: dict[str, tuple[str, dict[str, Keys]]] = {
    "punch": ("pattern", PATTERNS),
    "rheology": ("model", RHEOLOGIES),
    "adhesion": ("law", ADHESION),
    "drive.step": ("do", STEPS),
}
BOUNDS = {"ge": "at least", "le": "at most"}

HEAD = """# Keys of a scene

This page is made from the models by `docs/make_scene_reference.py`.

A scene is a TOML file of sections, in UTF-8; a byte order mark, UTF-16 and Windows-1252 (Latin-1) are read as well. A
quantity is a text with its unit, such as `"375 um"`, `"375 µm"` or `"50 mJ/m^2"`; any unit of the right dimension will
do. A number without a dimension is written bare. The magnitude of a number, given or automatic, must be between
{smallest:g} and {largest:g} in SI units, or zero where the key allows it. Keys that are not listed here are errors, and
so are keys for which the chosen `pattern`, `model` or `law` has no use. Relative paths start at the scene's folder.

Any key can be changed on the command line or in `load_scene` by an override `section.key=value`, such as
`"drive.speed=10 um/s"`. Overriding `punch.pattern`, `rheology.model` or `adhesion.law` drops those keys of the scene
which the new choice does not use.

Shipped scenes: {scenes}.

At the top of the file, before any section, `title = "..."` may name the scene.
"""

PROGRAMME = """## Steps of a programme

A `[drive]` with steps has no `speed`, `retract_speed`, `dwell`, `control` and `turn_time` of its own. Each step is a table headed
`[[drive.step]]`, or an entry of the list `step`; steps are done in their order. On the command line, steps are counted from 1:
`drive.step.2.duration=30 s`, and `drive.repeat.times=5`. How to use them: [Programmes](../how-to/programme.md).
"""
REPEAT = "The steps from `first` to `last` are done `times` times; each time is a cycle."


def type_text(name: str, field: FieldInfo) -> str:
    """Type or dimension of a key, with its allowed range."""
    extra: dict[str, Any] | None = field.json_schema_extra
    if extra:
        kind = DIMENSIONS.get(extra["dimension"])
        limits = limits_text(extra)
        text = f"{extra['dimension']} [{kind.unit}]" if kind else "number"
        text += f", {limits}" if limits else ""
        text += "".join(f', or `"{word}"`' for word in extra["words"] + ["inf"] * extra["infinite"])
        if extra["count"] is None:
            return text
        return f"list of {extra['count']}: {text}" if extra["count"] else f"list: {text}"
    options = [field.annotation, *get_args(field.annotation)]
    literals = next((get_args(option) for option in options if get_origin(option) is Literal), ())
    literals = next((mark.words() for mark in field.metadata if isinstance(mark, OneOf)), literals)
    if literals:
        return ", ".join(f"`{json.dumps(word)}`" for word in literals)
    names: dict[Any, str] = {
        int: "whole number", bool: "`true` or `false`", str: "text",
        tuple[str, ...]: "text, or list of texts" if name == "until" else "list of texts",
        tuple[ProgrammeStep, ...]: "tables, each headed `[[drive.step]]`", Repeat: "a table `[drive.repeat]`",
    }  # fmt: skip
    bounds = [(word, getattr(limit, name, None)) for limit in field.metadata for name, word in BOUNDS.items()]
    limits = [f"{word} {bound}" for word, bound in bounds if bound is not None]
    return ", ".join([next(names[option] for option in options if option in names), *limits])


def default_text(field: FieldInfo) -> str:
    """Default of a key as TOML, "required", or a dash for a key without a value of its own."""
    if field.is_required():
        return "required"
    if field.default is None or field.annotation == tuple[ProgrammeStep, ...]:
        return "-"
    value = '"inf"' if field.default == math.inf else written(field.default, field.json_schema_extra)
    if isinstance(value, str):
        return f'`"{value.strip(chr(34))}"`'
    return f"`{value}`".lower() if isinstance(value, bool) else f"`{value}`"


def use_text(section: str, name: str) -> str:
    """Which patterns, models or laws need a key of a section with a choice, and which may have it."""
    selector, table = CHOICES[section]
    if name == selector:
        return "always"
    needed = [f"`{choice}`" for choice, (required, _) in table.items() if name in required]
    allowed = [f"`{choice}`" for choice, (_, optional) in table.items() if name in optional]
    if len(allowed) == len(table):
        return "all"
    parts = ["required by " + ", ".join(needed)] * bool(needed) + ["allowed for " + ", ".join(allowed)] * bool(allowed)
    return "; ".join(parts)


def section_lines(section: str) -> Iterator[str]:
    """The heading, the meaning and the table of a section."""
    model = SECTIONS[section]
    yield from (f"## [{section}]", "", model.__doc__.strip(), "")
    yield from key_lines(section, model)


def programme_lines() -> Iterator[str]:
    """What `drive.step` and `drive.repeat` may hold."""
    yield from (PROGRAMME, "### [[drive.step]]", "")
    yield from key_lines("drive.step", ProgrammeStep)
    yield from ("### [drive.repeat]", "", REPEAT, "")
    yield from key_lines("drive.repeat", Repeat)


def key_lines(section: str, model: Any) -> Iterator[str]:
    """The table of a section's keys."""
    with_use = section in CHOICES
    head = ["key", "type", "default"] + ["used by"] * with_use + ["meaning"]
    yield "| " + " | ".join(head) + " |"
    yield "| " + " | ".join("---" for _ in head) + " |"
    for name, field in model.model_fields.items():
        cells = [f"`{name}`", type_text(name, field), default_text(field)]
        cells += [use_text(section, name), field.description] if with_use else [field.description]
        yield "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"
    yield ""


def page() -> str:
    """The whole page as Markdown."""
    scenes = ", ".join(f"`{name}`" for name in shipped_scenes())
    lines = [HEAD.format(scenes=scenes, smallest=SMALLEST, largest=LARGEST)]
    for section in SECTIONS:
        lines.extend(section_lines(section))
        if section == "drive":
            lines.extend(programme_lines())
    return "\n".join(lines)


def main() -> None:
    if sys.argv[1:] == ["-"]:
        print(page(), end="")
        return
    PAGE.parent.mkdir(parents=True, exist_ok=True)
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
