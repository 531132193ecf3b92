"""A scene during validation: the values that could be read."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pgfmd.errors import MISSING as MISSING
from pgfmd.errors import Problem
from pgfmd.units import DIMENSIONS

from .fields import extra_of, written
from .model import SECTIONS


class Unread(Exception):
    """A rule uses a value that could not be read."""


@dataclass
class Draft:
    """A scene during validation: `raw` as written, `values` in SI as far as they could be read, by section and key."""

    folder: Path
    raw: dict[str, dict[str, Any]] = field(default_factory=dict)
    values: dict[str, dict[str, Any]] = field(default_factory=dict)

    def __getitem__(self, dotted: str) -> Any:
        """The value of a key such as "grid.length", or its default. Raises Unread if it is missing or wrong."""
        section, _, name = dotted.rpartition(".")
        if name in self.values[section]:
            return self.values[section][name]
        if self.given(dotted) or SECTIONS[section].model_fields[name].is_required():
            raise Unread(dotted)
        return SECTIONS[section].model_fields[name].default

    def given(self, dotted: str) -> bool:
        """Whether the scene contains this key."""
        section, _, name = dotted.rpartition(".")
        return name in self.raw[section]

    def problem(self, dotted: str, expected: str, cure: str = "") -> Problem:
        """A Problem about a key, with the value in the scene or its default."""
        section, _, name = dotted.rpartition(".")
        model_field = SECTIONS[section].model_fields[name]
        default = MISSING if model_field.is_required() else written(model_field.default, extra_of(model_field))
        value = self.raw[section].get(name, default)
        return Problem(dotted, MISSING if value is None else value, expected, cure)

    def path(self, dotted: str) -> Path | None:
        """The absolute path of a key; paths are relative to the scene's folder."""
        text = self[dotted]
        return None if text is None else (self.folder / os.path.expanduser(text)).absolute()


def is_unicode(text: str) -> bool:
    """Whether a text can be encoded in UTF-8; command lines and names of folders may have other bytes."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def example(section: str, name: str) -> str:
    """An example of a line with this key, for messages: 'radius = "375 um"'."""
    extra = extra_of(SECTIONS[section].model_fields[name])
    kind = DIMENSIONS.get(extra.get("dimension", ""))
    if kind is None:
        return f"{name} = ..."
    return f'{name} = "{kind.example}"' if extra["count"] is None else f'{name} = ["{kind.example}", ...]'
