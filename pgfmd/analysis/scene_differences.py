"""Differences of two resolved scenes, which decide whether their runs may be compared."""

from __future__ import annotations

import math
from collections.abc import Iterator

ALIKE = 1e-3
"""Quantities that differ by no more than this fraction count as equal."""
SAY_NOTHING = ("q_ref", "range_factor")
"""Keys whose effect is included in adhesion.range."""


def differences(
    scene: dict, other: dict, sections: tuple[str, ...], passed_over: tuple[str, ...] = ()
) -> Iterator[tuple[str, object, object]]:
    """Dotted keys, with both values, that two scenes have in common and that differ.

    scene, other: of `Results.scene`. sections: those that are compared. passed_over: names of keys that are not
    compared.
    """
    for section in sections:
        mine, yours = scene.get(section, {}), other.get(section, {})
        for key in sorted(set(mine) & set(yours) - {*passed_over, *SAY_NOTHING}):
            if not _alike(mine[key], yours[key]):
                yield f"{section}.{key}", mine[key], yours[key]


def _alike(one: object, two: object) -> bool:
    """Whether two values of a resolved scene, texts with SI units where they are quantities, mean the same."""
    if one == two:
        return True
    parts = [str(value).split(" ", 1) for value in (one, two)]
    try:
        numbers = [float(part[0]) for part in parts]
    except ValueError:
        return False
    return parts[0][1:] == parts[1][1:] and math.isclose(*numbers, rel_tol=ALIKE)
