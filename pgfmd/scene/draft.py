"""A scene half read: what is known of it while it is checked."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pgfmd.errors import MISSING as MISSING
from pgfmd.errors import Problem
from pgfmd.units import DIMENSIONS

from .fields import written
from .model import SECTIONS


class Unread(Exception):
    """A rule asked for a value that could not be read."""


@dataclass
class Draft:
    """A scene half read: `raw` as written, `values` in SI for what could be read, by section and key."""

    folder: Path
    raw: dict[str, dict[str, Any]] = field(default_factory=dict)
    values: dict[str, dict[str, Any]] = field(default_factory=dict)

    def __getitem__(self, dotted: str) -> Any:
        """The value of a key such as "grid.length", or its default. Raises Unread where it is missing or wrong."""
        section, _, name = dotted.rpartition(".")
        if name in self.values[section]:
            return self.values[section][name]
        if self.given(dotted) or SECTIONS[section].model_fields[name].is_required():
            raise Unread(dotted)
        return SECTIONS[section].model_fields[name].default

    def given(self, dotted: str) -> bool:
        """Whether the scene names this key."""
        section, _, name = dotted.rpartition(".")
        return name in self.raw[section]

    def problem(self, dotted: str, expected: str, cure: str = "") -> Problem:
        """A Problem about a key, with the value as the scene has it or its default."""
        section, _, name = dotted.rpartition(".")
        model_field = SECTIONS[section].model_fields[name]
        default = MISSING if model_field.is_required() else written(model_field.default, model_field.json_schema_extra)
        value = self.raw[section].get(name, default)
        return Problem(dotted, MISSING if value is None else value, expected, cure)

    def path(self, dotted: str) -> Path | None:
        """The absolute path that a key means, relative to the scene's folder."""
        text = self[dotted]
        return None if text is None else (self.folder / os.path.expanduser(text)).absolute()


def is_unicode(text: str) -> bool:
    """Whether a text can be written in UTF-8; a command line's, or a folder's name, may hold other bytes."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def example(section: str, name: str) -> str:
    """How a line with this key may look, for messages: 'radius = "375 um"'."""
    extra = SECTIONS[section].model_fields[name].json_schema_extra or {}
    kind = DIMENSIONS.get(extra.get("dimension", ""))
    if kind is None:
        return f"{name} = ..."
    return f'{name} = "{kind.example}"' if extra["count"] is None else f'{name} = ["{kind.example}", ...]'
