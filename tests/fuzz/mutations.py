"""Absurd scenes: keys left out, of the wrong kind, beyond every limit, or well formed and without any sense."""

from __future__ import annotations

import math
from typing import Any

from .declarations import KEYS, Key
from .draw import Draw, Mapping, Natural, legal, written
from .files import BROKEN, BROKEN_COMPLIANCES, COMPLIANCE, MAPS

NUMBERS = (
    0.0, -0.0, -1.0, 5e-324, 1e-300, 1e-200, 1e-100, 1e-30, 1e-12, 1e-9, 1e-3, 0.3, 0.49999999999, 0.5, 1.0,
    1.0000000001, 2.0, 1e3, 1e6, 1e12, 1e30, 1e100, 1e200, 1e300, 1.7976931348623157e308, math.inf, -math.inf,
    math.nan, -0.999999999999,
)  # fmt: skip
"""Numbers that programs choke on, in SI."""
ODD = (
    "", " ", "inf", "nan", "auto", "grid", "1", "1 um", "1um/s", "-1 m", "1e400 m", "1e-400 m",
    "1e99999999999999999999 m", "1 m^-1", "1 m^9", "1 furlong", "0x10 m", "1_000 um", "1__0 um", "٣ um", "1 µm",
    "1 μm", "1 m\n", "1 \0m", "1 Hz", "1 rad/s", "1 deg C", "1 m*m", "1 m/m", "t_pl", "1 t_pl", "-1 t_pl",
    "1e400 t_pl", "0 t_pl", "1 byte", "1 dB", "1 degC", "1 kelvin s", "inf m", "-inf m", "nan m", "+.5 mm", "5. mm",
    "1 m * s^-1", "1 1/m", "1/m", "∞", "1 ²m", "1 m²", "1 N·m", "1 pH", "1 Np", "1 %", "1 lb", "1 mmHg", "1,5 mm",
    "1 M", "1 mpa", "1 MJ/m^2", "../../etc/passwd", "/dev/null", "/", "~", "a" * 5000, True, False, [], [1], {}, [[]],
    {"a": 1}, 0, 1, -1, 3, 65536, 65537, 2**63, 2**64, 10**400, 1.5,
)  # fmt: skip
"""Values that are well formed in TOML, and of no use to most keys."""
EDGES = (-1, 0, 1)
"""Steps beyond a limit, at it and within it."""


def mutate(draw: Draw, scene: Mapping, natural: Natural, count: int) -> None:
    """Changes that many keys, or more of the scene."""
    for _ in range(count):
        if draw.chance(0.05):
            _break_the_form(draw, scene)
            continue
        key = KEYS[draw.choice(tuple(KEYS))]
        section = scene.setdefault(key.section, {})
        if not isinstance(section, dict):
            continue
        roll = draw.random()
        if roll < 0.1:
            section.pop(key.name, None)
        elif roll < 0.25:
            section[key.name] = draw.choice(ODD)
        elif roll < 0.45:
            section[key.name] = legal(draw, key, natural, _texts(key))
        else:
            section[key.name] = _extreme(draw, key, natural)


def _break_the_form(draw: Draw, scene: Mapping) -> None:
    """Something that no declaration of a key can tell: sections that are none, keys that are strange."""
    name = draw.choice(tuple(scene))
    what = draw.randrange(5)
    if what == 0:
        scene.pop(name)
    elif what == 1:
        scene[name] = draw.choice(ODD)
    elif what == 2:
        scene["paunch"] = {"radius": "1 um"}
    elif what == 3 and isinstance(scene[name], dict):
        scene[name]["raduis"] = "1 um"
    else:
        scene["title"] = draw.choice(ODD)


def _texts(key: Key) -> tuple[str, ...]:
    """Texts that a key for a file might hold; which key is which is told by its name."""
    if "compliance" in key.name:
        return (COMPLIANCE, *BROKEN_COMPLIANCES)
    return (*MAPS, *BROKEN)


def _extreme(draw: Draw, key: Key, natural: Natural) -> Any:
    """At the edges of what a key allows, and beyond."""
    if key.kind in ("quantity", "number"):
        if key.count is None:
            return _extreme_entry(draw, key, natural)
        return [_extreme_entry(draw, key, natural) for _ in range(draw.choice([key.count or 1, key.count or 3, 1, 4]))]
    if key.kind == "whole":
        edges = [limit + step for limit in (key.at_least, key.at_most) if limit is not None for step in EDGES]
        return draw.choice([*edges, 0, 1, 2, 3, 7, 13, 10**9, 2**63, -5])
    if key.kind == "times":
        texts = [text for text in ODD if isinstance(text, str)]
        return [draw.choice([*texts, "1 s", "1e300 s", "1e-300 s", "1e300 t_pl", "0.1 t_pl"]) for _ in range(3)]
    return legal(draw, key, natural, _texts(key))


def _extreme_entry(draw: Draw, key: Key, natural: Natural) -> Any:
    roll = draw.random()
    limits = [limit for limit in (key.above, key.at_least, key.at_most) if limit is not None]
    if roll < 0.2 and limits:
        limit = draw.choice(limits)
        value = draw.choice([limit, math.nextafter(limit, math.inf), math.nextafter(limit, -math.inf)])
    elif roll < 0.6:
        value = draw.choice(NUMBERS)
    else:
        value = natural.unit(key.dimension) * draw.log(1e-15, 1e15)
    return value if key.kind == "number" else written(value, key.dimension)
