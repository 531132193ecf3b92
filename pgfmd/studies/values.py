"""Values of keys as texts: as an override of `pgfmd run`, as part of a file's name, with a handy unit."""

from __future__ import annotations

import re
import tomllib
import unicodedata
from collections.abc import Iterable
from typing import Any

from pgfmd.scene.model import SECTIONS, toml_text
from pgfmd.units import DIMENSIONS

_PREFIXES = {1e9: "G", 1e6: "M", 1e3: "k", 1.0: "", 1e-3: "m", 1e-6: "µ", 1e-9: "n", 1e-12: "p", 1e-15: "f"}
_AREAS = {1.0: "m²", 1e-6: "mm²", 1e-12: "µm²"}
_SCALABLE = ("m", "s", "N", "Pa", "J", "m/s", "rad/s", "J/m^2")
_UNSAFE = re.compile(r"[^A-Za-z0-9.+_-]+")


def label_of_value(value: Any) -> str:
    """A value as a reader wants to see it: texts without quotes."""
    return value if isinstance(value, str) else toml_text(value)


def override_of(key: str, value: Any) -> str:
    """The argument of `pgfmd run` that sets a key, such as "drive.speed=1 um/s"; read back, it has the same value."""
    return f"{key}={value if isinstance(value, str) and _is_bare(value) else toml_text(value)}"


def _is_bare(text: str) -> bool:
    """Whether a text stays what it is without quotes: not "0.5", which is a number then."""
    if text != text.strip() or not text or "\n" in text:
        return False
    try:
        tomllib.loads(f"value = {text}")
    except tomllib.TOMLDecodeError:
        return True
    return False


def slug(text: str) -> str:
    """A text as part of a file's name: "1 um/s" becomes "1um-s". Empty if nothing is left of it."""
    text = unicodedata.normalize("NFKD", text.replace("µ", "u").replace("μ", "u"))
    text = re.sub(r"(?<=\d)\s+(?=[A-Za-z])", "", text.replace("^", ""))
    text = re.sub(r"(?<![\w.])-(?=[\d.])", "minus", text)
    return re.sub(r"-{2,}", "-", _UNSAFE.sub("-", text)).strip("-.")


def unit_of(key: str) -> str:
    """The SI unit of a key of the scene; empty where it has none."""
    section, _, name = key.rpartition(".")
    extra = SECTIONS[section].model_fields[name].json_schema_extra or {}
    kind = DIMENSIONS.get(extra.get("dimension", ""))
    return kind.unit if kind else ""


def header(name: str, unit: str) -> str:
    """A column's head: "drive.speed [m/s]"."""
    return f"{name} [{unit}]" if unit else name


def handy(values: Iterable[float], unit: str) -> tuple[float, str]:
    """Factor and name of the unit in which the largest of the values is between 1 and 1000: (1e-6, "µm/s").

    Areas in m², mm² or µm², the largest at least a tenth.
    """
    largest = max((abs(value) for value in values), default=0.0)
    if unit == "m^2":
        return next(((factor, name) for factor, name in _AREAS.items() if largest >= 0.1 * factor), (1e-12, "µm²"))
    if unit not in _SCALABLE or largest == 0.0:
        return 1.0, unit
    for factor, prefix in _PREFIXES.items():
        # What is 1000 nm but for rounding is 1 um.
        if largest >= factor * (1.0 - 1e-9):
            return factor, f"{prefix}{unit}".replace("^2", "²")
    return 1.0, unit
