"""Keys of a scene by their dotted names, those within the steps of a programme included: "drive.step.2.duration"."""

from __future__ import annotations

from typing import Any

from pydantic.fields import FieldInfo

from .model import SECTIONS, Scene
from .programme_section import ALSO, ProgrammeStep, Repeat

STEP, REPEAT = "drive.step.", "drive.repeat."


def field_of(dotted: str) -> FieldInfo | None:
    """The declaration of a key; None if there is no such key. The numbers of steps are not looked at."""
    if dotted.startswith(REPEAT):
        return Repeat.model_fields.get(dotted.removeprefix(REPEAT))
    if dotted.startswith(STEP):
        number, _, name = dotted.removeprefix(STEP).partition(".")
        return ProgrammeStep.model_fields.get(ALSO.get(name, name)) if number.isdecimal() else None
    section, _, name = dotted.rpartition(".")
    return SECTIONS[section].model_fields.get(name) if section in SECTIONS else None


def value_of(scene: Scene, dotted: str) -> Any:
    """The value of a key in a scene, SI; None for a step or a repeat that it does not have. KeyError for an unknown key."""
    if field_of(dotted) is None:
        raise KeyError(dotted)
    if dotted.startswith(REPEAT):
        return getattr(scene.drive.repeat, dotted.removeprefix(REPEAT), None)
    if dotted.startswith(STEP):
        number, _, name = dotted.removeprefix(STEP).partition(".")
        steps = scene.drive.step
        return getattr(steps[int(number) - 1], ALSO.get(name, name)) if 1 <= int(number) <= len(steps) else None
    section, _, name = dotted.rpartition(".")
    return getattr(scene.section(section), name)
