"""Random values that follow from a seed alone, and scenes as TOML."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pgfmd.units import DIMENSIONS

from .declarations import Key, exponents

Mapping = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class Natural:
    """Units that a scene is made in: a length [m], a modulus [Pa], a time [s]."""

    length: float
    modulus: float
    time: float

    def unit(self, dimension: str) -> float:
        """The unit of a dimension, in SI."""
        powers = exponents(dimension)
        return math.prod(
            base**power for base, power in zip((self.length, self.modulus, self.time), powers, strict=True)
        )

    def quantity(self, ratio: float, dimension: str) -> str:
        """A quantity that is so many units, as a scene writes it."""
        return written(ratio * self.unit(dimension), dimension)


class Draw(random.Random):
    """Python's generator, which gives the same numbers for the same text on every machine."""

    def __init__(self, *names: object):
        super().__init__("-".join(map(str, names)))

    def log(self, low: float, high: float) -> float:
        """A number between two, its logarithm uniform."""
        return 10 ** self.uniform(math.log10(low), math.log10(high))

    def chance(self, probability: float) -> bool:
        return self.random() < probability


def written(value: float, dimension: str) -> str:
    """A quantity in SI as a scene writes it."""
    return f"{float(value)!r} {DIMENSIONS[dimension].unit}"


def legal(draw: Draw, key: Key, natural: Natural, texts: Sequence[str] = ("text",)) -> Any:
    """A value that the declaration of a key allows, over six decades of the natural units. texts: for a text."""
    if key.kind == "choice":
        return draw.choice(key.choices)
    if key.kind == "flag":
        return draw.chance(0.5)
    if key.kind == "text":
        return draw.choice(texts)
    if key.kind == "times":
        return [draw.choice([f"{draw.log(0.1, 3)!r} t_pl", natural.quantity(draw.log(1e-2, 1e2), "time")])]
    if key.kind == "whole":
        low, high = key.at_least or 0, min(key.at_most or 10**6, 10**6)
        return min(high, max(low, round(draw.log(max(low, 1), high)))) if draw.chance(0.9) else low
    if key.count is not None:
        return [_legal_entry(draw, key, natural) for _ in range(key.count or draw.choice([1, 2, 5]))]
    return _legal_entry(draw, key, natural)


def _legal_entry(draw: Draw, key: Key, natural: Natural) -> Any:
    if key.words and draw.chance(0.2):
        return draw.choice(key.words)
    if key.infinite and draw.chance(0.2):
        return "inf"
    low = key.above if key.above is not None else key.at_least
    ratio = draw.log(1e-3, 1e3)
    if low is None:
        ratio *= draw.choice([-1.0, 1.0])
    elif low < 0:
        ratio = draw.uniform(low, -low if key.at_most is None else key.at_most)
    elif low > 0:
        ratio = low * (1.0 + ratio) if key.dimension == "number" else ratio
    if key.dimension == "number":
        return ratio if key.at_most is None else min(ratio, key.at_most)
    return natural.quantity(ratio, key.dimension)


def as_toml(scene: Mapping) -> str:
    """The TOML of a scene; keys that are no sections come first."""
    loose = [f"{_name(name)} = {_value(value)}" for name, value in scene.items() if not isinstance(value, dict)]
    lines = list(loose)
    for section, keys in scene.items():
        if isinstance(keys, dict):
            lines += [f"[{section}]", *(f"{_name(name)} = {_value(value)}" for name, value in keys.items())]
    return "\n".join(lines) + "\n"


def _name(name: str) -> str:
    return name if name.replace("_", "").isalnum() and name.isascii() else _value(name)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_name(name)} = {_value(entry)}" for name, entry in value.items()) + "}"
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return repr(value)
