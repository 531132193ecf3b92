"""Values of keys as texts: as an override of `pgfmd run`, as part of a file's name."""

from __future__ import annotations

import re
import tomllib
import unicodedata
from typing import Any

from pgfmd.scene.dotted_keys import field_of
from pgfmd.scene.fields import extra_of, toml_text
from pgfmd.units import DIMENSIONS

_UNSAFE = re.compile(r"[^A-Za-z0-9.+_-]+")


def label_of_value(value: Any) -> str:
    """A value for readers: texts without quotes."""
    return value if isinstance(value, str) else toml_text(value)


def override_of(key: str, value: Any) -> str:
    """The argument of `pgfmd run` that sets a key, such as "drive.speed=1 um/s"; read back, it has the same value."""
    return f"{key}={value if isinstance(value, str) and _is_bare(value) else toml_text(value)}"


def _is_bare(text: str) -> bool:
    """Whether a text keeps its meaning without quotes; "0.5" would become a number."""
    if text != text.strip() or not text or "\n" in text:
        return False
    try:
        tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return True
    return False


def slug(text: str) -> str:
    """A text as part of a file name: "1 um/s" becomes "1um-s". May be empty."""
    text = unicodedata.normalize("NFKD", text.replace("µ", "u").replace("μ", "u"))
    text = re.sub(r"(?<=\d)\s+(?=[A-Za-z])", "", text.replace("^", ""))
    text = re.sub(r"(?<![\w.])-(?=[\d.])", "minus", text)
    return re.sub(r"-{2,}", "-", _UNSAFE.sub("-", text)).strip("-.")


def unit_of(key: str) -> str:
    """The SI unit of a key of the scene; empty where it has none."""
    field = field_of(key)
    kind = DIMENSIONS.get(extra_of(field).get("dimension", "")) if field else None
    return kind.unit if kind else ""


def header(name: str, unit: str) -> str:
    """The header of a column: "drive.speed [m/s]"."""
    return f"{name} [{unit}]" if unit else name
