"""The numbers of a scene that are fitted: their keys, start values, bounds, and what the search sees of them.

A number above a limit l, such as a length or a time above 0, is searched for as x = ln(v - l), in which equal steps are equal
shares; any other one as x = v/s, with its own size s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pgfmd.errors import PgfmdError
from pgfmd.scene.fields import extra_of
from pgfmd.scene.model import SECTIONS, unused_keys
from pgfmd.scene.unresolved_scene import did_you_mean
from pgfmd.units import DIMENSIONS, UnitError, format_quantity, handy_quantity, parse_quantity

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

    from pgfmd.scene import Scene

SECTIONS_TO_FIT = ("punch", "substrate", "rheology", "adhesion", "drive")
FACTOR = 100.0
"""Default bounds of a number: factors relative to its start value."""


class FitError(PgfmdError):
    """A fit that can't be made as it was asked for: says which key, what was expected and what to do."""

    exit_code = 2


class MissingRun(FitError):
    """A run without which a fit can't go on."""


@dataclass(frozen=True)
class Parameter:
    """A number that is fitted. key: such as "adhesion.work_of_adhesion"; start, low, high: in SI units; limit: l in the head of
    this module, None without one; size: s."""

    key: str
    start: float
    low: float
    high: float
    limit: float | None
    size: float = 1.0

    @property
    def dimension(self) -> str:
        """A key of units.DIMENSIONS; empty for a bare number."""
        extra = extra_of(_field(self.key))
        return extra["dimension"] if extra["dimension"] in DIMENSIONS else ""

    @property
    def unit(self) -> str:
        """The SI unit, empty for a bare number."""
        return DIMENSIONS[self.dimension].unit if self.dimension else ""

    def place(self, value: float) -> float:
        """x of a value."""
        return value / self.size if self.limit is None else math.log(value - self.limit)

    def value(self, place: float) -> float:
        """The value at x, within the bounds; at the start to the last bit."""
        if place == self.place(self.start):
            return self.start
        found = place * self.size if self.limit is None else self.limit + math.exp(place)
        return min(max(found, self.low), self.high)

    def slope(self, place: float) -> float:
        """dv/dx at x."""
        return self.size if self.limit is None else math.exp(place)

    def written(self, value: float) -> str | float:
        """A value as a scene has it, without loss: a text with its unit, or a bare number."""
        return format_quantity(value, self.dimension) if self.dimension else float(value)

    def shown(self, value: float) -> str:
        """A value as a person would write it."""
        return handy_quantity(value, self.dimension, 4) if self.dimension else f"{value:.4g}"


def parameters_of(scene: Scene, keys: Sequence[str], bounds: Mapping[str, str]) -> list[Parameter]:
    """The numbers with these keys, from the values of a scene on. bounds: by key, as "20 mJ/m^2:80 mJ/m^2".

    Raises FitError for keys that are no numbers which this scene uses, for bounds that are none, or that leave out the start.
    """
    if not keys:
        raise FitError("--free: name at least one key, such as adhesion.work_of_adhesion")
    doubled = sorted({key for key in keys if list(keys).count(key) > 1})
    if doubled:
        raise FitError(f"--free {doubled[0]}: is named twice; leave one")
    for key in bounds:
        if key not in keys:
            raise FitError(f"--bounds {key}: is not fitted; add it to --free, or leave the bounds out")
    return [_parameter(scene, key, bounds.get(key)) for key in keys]


def _parameter(scene: Scene, key: str, bounds: str | None) -> Parameter:
    section, _, name = key.rpartition(".")
    known = [
        f"{other}.{field}"
        for other in SECTIONS_TO_FIT
        for field, info in SECTIONS[other].model_fields.items()
        if extra_of(info).get("count", 0) is None and field not in unused_keys(scene, other)
    ]
    if key not in known:
        hint = did_you_mean(key, known) or f"this scene has {', '.join(known)}"
        raise FitError(f"--free {key}: expected a key of the scene whose value is one number, and that it uses; {hint}")
    start, extra = getattr(scene.section(section), name), extra_of(_field(key))
    if not isinstance(start, float) or not math.isfinite(start):
        raise FitError(f"--free {key}: the scene has no finite value to start from; give it one, such as {key}=...")
    limit = extra["above"] if extra["above"] is not None else extra["at_least"]
    if limit is not None and not start > limit:
        raise FitError(
            f"--free {key}: starts at its limit, {limit:g}, where no share can be told; give it another value"
        )
    low, high = _bounds(key, bounds, extra) if bounds is not None else (-math.inf, math.inf)
    if limit is not None:
        low = max(low, limit + (start - limit) / FACTOR) if bounds is None else low
        high = min(high, limit + (start - limit) * FACTOR) if bounds is None else high
    elif bounds is None:
        raise FitError(f"--free {key}: may have any sign; give its bounds, --bounds {key}=LOW:HIGH")
    if extra["at_most"] is not None:
        high = min(high, extra["at_most"])
    if limit is not None and not low > limit:
        raise FitError(f"--bounds {key}={bounds}: expected a lower bound above {limit:g}")
    if not low < start < high:
        raise FitError(
            f"--bounds {key}={bounds}: the start, {start:.6g}, is not between them; give the scene another value to start from"
        )
    return Parameter(key, start, low, high, limit, high - low if limit is None else 1.0)


def _bounds(key: str, text: str, extra: Mapping[str, Any]) -> tuple[float, float]:
    parts = text.split(":")
    if len(parts) != 2:
        raise FitError(f"--bounds {key}={text}: expected LOW:HIGH, two values with their units")
    try:
        low, high = (
            parse_quantity(part, extra["dimension"]) if extra["dimension"] in DIMENSIONS else float(part)
            for part in parts
        )
    except (UnitError, ValueError) as error:
        raise FitError(f"--bounds {key}={text}: {error}") from None
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise FitError(f"--bounds {key}={text}: expected two finite values, the lower one first")
    return low, high


def _field(key: str) -> FieldInfo:
    section, _, name = key.rpartition(".")
    return SECTIONS[section].model_fields[name]
