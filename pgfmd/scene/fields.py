"""Fields for the keys of a scene: meaning, dimension, allowed range, reading and writing of values.

Every key is a pydantic field whose `json_schema_extra` has its dimension and range. The models, the messages about
wrong values, the resolved TOML and the reference page are generated from these. A section is read in one pass: valid
values are collected even if others are wrong, so that rules for several keys can use them.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, PydanticCustomError, PydanticKnownError, PydanticUndefined, core_schema

from pgfmd.units import DIMENSIONS, UnitError, decimal_comma, format_quantity, parse_quantity

REQUIRED = PydanticUndefined
LARGEST = 1e30
"""Largest magnitude, in SI units, of any number of a scene. No physical value is larger, and derived numbers do not
overflow."""
SMALLEST = 1e-30
"""Smallest magnitude except 0; derived numbers do not underflow."""


def number(
    meaning: str,
    default: Any = REQUIRED,
    *,
    dimension: str = "number",
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    words: tuple[str, ...] = (),
    infinite: bool = False,
    count: int | None = None,
) -> Any:
    """A field for a float, or a list of floats.

    meaning: the sentence in the reference page. default: an SI float, a word, or None for no value. dimension: a key of
    `units.DIMENSIONS`, or "number". above, at_least, at_most: the allowed range in SI. words: texts allowed instead.
    infinite: whether "inf" is allowed. count: 0 for a list of any length except 0, else its length; None for a single
    value.
    """
    extra: dict[str, Any] = {"dimension": dimension, "above": above, "at_least": at_least, "at_most": at_most}
    extra |= {"words": list(words), "infinite": infinite, "count": count}
    return Field(default, description=meaning, json_schema_extra=extra)


def quantity(dimension: str, meaning: str, default: Any = REQUIRED, **limits: Any) -> Any:
    """A field with a dimension; positive unless changed by `above=None` or `at_least`."""
    if "at_least" not in limits:
        limits.setdefault("above", 0.0)
    return number(meaning, default, dimension=dimension, **limits)


def key(meaning: str, default: Any = REQUIRED, **limits: Any) -> Any:
    """A field for a word, an integer, a text or a boolean; pydantic's own limits apply."""
    return Field(default, description=meaning, **limits)


@dataclass(frozen=True)
class OneOf:
    """Restricts a text to those returned by `words` at the time of reading: `Annotated[str, OneOf(names)]`."""

    words: Callable[[], tuple[str, ...]]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.no_info_plain_validator_function(self._read)

    def _read(self, value: object) -> str:
        words = self.words()
        if isinstance(value, str) and value in words:
            return value
        *others, last = (f"'{word}'" for word in words)
        raise PydanticKnownError("literal_error", {"expected": " or ".join([", ".join(others), last][not others :])})


def extra_of(field: FieldInfo) -> dict[str, Any]:
    """What `number` knows of a field: dimension and range; empty for one made by `key`."""
    found = field.json_schema_extra
    return found if isinstance(found, dict) else {}


def limits_text(extra: dict[str, Any]) -> str:
    """The range of a field in words, such as "above 0 and at most 0.5", empty if there is none."""
    limits = (("above", extra["above"]), ("at least", extra["at_least"]), ("at most", extra["at_most"]))
    return " and ".join(f"{word} {limit:g}" for word, limit in limits if limit is not None)


def expectation(extra: dict[str, Any]) -> str:
    """The expected value of a field in words: 'a length above 0, such as "375 um", or "auto"'."""
    if extra["count"] is None:
        return _expected_entry(extra)
    return f"a list of {extra['count'] or 'any number of'} entries, each {_expected_entry(extra)}"


def _expected_entry(extra: dict[str, Any]) -> str:
    kind = DIMENSIONS.get(extra["dimension"])
    text = f"{kind.phrase if kind else 'a number'} {limits_text(extra)}".strip()
    if kind:
        text += f', such as "{kind.example}"'
    words = extra["words"] + (["inf"] if extra["infinite"] else [])
    return text + "".join(f', or "{word}"' for word in words)


def refuse(value: object, expected: str, cure: str = "") -> PydanticCustomError:
    """An error that `scene.load_scene` turns into a Problem with these parts."""
    return PydanticCustomError("scene", "expected something else", {"problems": [(value, expected, cure)]})


def _read_one(value: object, extra: dict[str, Any]) -> float | str:
    if isinstance(value, str) and value in extra["words"]:
        return value
    if extra["dimension"] in DIMENSIONS:
        try:
            result = parse_quantity(value, extra["dimension"])
        except UnitError as error:
            raise refuse(value, _expected_entry(extra), error.cure) from None
    elif isinstance(value, bool) or not isinstance(value, (int, float)):
        cure = ""
        if isinstance(value, str) and value.strip():
            cure = decimal_comma(value) or "write a bare number, without quotes or unit"
        raise refuse(value, _expected_entry(extra), cure)
    else:
        try:
            result = float(value)
        except OverflowError:
            result = math.inf
    if math.isinf(result) and result > 0 and extra["infinite"]:
        return result
    if not within_limits(result, extra):
        cure = "" if math.isfinite(result) else "it must be a finite number"
        if math.isfinite(result) and result and not _least_magnitude(extra) <= abs(result) <= LARGEST:
            unit = DIMENSIONS[extra["dimension"]].unit if extra["dimension"] in DIMENSIONS else ""
            least = f"at least {SMALLEST:g} and " if _least_magnitude(extra) else ""
            cure = f"the magnitude of a number must be {least}at most {LARGEST:g} {unit}".rstrip()
        raise refuse(value, _expected_entry(extra), cure)
    return result


def within_limits(value: float, extra: dict[str, Any]) -> bool:
    """Whether a field allows an SI value: finite, within its range, and of an allowed magnitude."""
    above, least, most = extra["above"], extra["at_least"], extra["at_most"]
    inside = (above is None or value > above) and (least is None or value >= least) and (most is None or value <= most)
    return inside and (value == 0 or _least_magnitude(extra) <= abs(value) <= LARGEST)


def _least_magnitude(extra: dict[str, Any]) -> float:
    """The smallest magnitude of a field except 0; no limit if 0 is not special."""
    return SMALLEST if 0 in (extra["above"], extra["at_least"]) else 0.0


def _read_number(value: object, extra: dict[str, Any]) -> object:
    """The SI value of the entry for a field made by `number` or `quantity`."""
    if extra["count"] is None:
        return _read_one(value, extra)
    if not isinstance(value, (list, tuple)):
        raise refuse(value, expectation(extra), "write it in square brackets")
    if not value or (extra["count"] and len(value) != extra["count"]):
        raise refuse(value, expectation(extra), f"it has {len(value)}")
    results, problems = [], []
    for index, entry in enumerate(value):
        try:
            results.append(_read_one(entry, extra))
        except PydanticCustomError as error:
            (_, expected, cure) = (error.context or {})["problems"][0]
            problems.append((entry, f"{expected} (entry {index + 1} of the list)", cure))
    if problems:
        raise PydanticCustomError("scene", "expected something else", {"problems": problems})
    return tuple(results)


class Section(BaseModel):
    """Base class of the sections of a scene: unknown keys are refused, no implicit conversions, values in SI."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    def __setattr__(self, name: str, value: object) -> None:
        if name in type(self).model_fields:
            raise AttributeError(
                f"{name}: a scene can't be changed; make another one, such as scene.replace(grid={{'n': 1024}})"
            )
        super().__setattr__(name, value)

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{name}: a scene can't be changed")

    @field_validator("*", mode="wrap")
    @classmethod
    def _read(cls, value: object, handler: Any, info: ValidationInfo) -> object:
        name = str(info.field_name)
        extra = extra_of(cls.model_fields[name])
        result = handler(_read_number(value, extra) if "dimension" in extra else value)
        if info.context is not None:
            info.context[name] = result
        return result


_FRACTION = re.compile(r"\s*(?P<factor>\d*\.?\d+(?:[eE][+-]?\d+)?)\s*t_pl\s*")


def snapshot_time(text: str) -> tuple[float, bool]:
    """(3.0, False) of "3 s", a time [s]; (1.125, True) of "1.125 t_pl", a fraction of the time to the preload.

    Raises UnitError for anything else.
    """
    expected = 'a time such as "3 s", a fraction of the time to the preload such as "1.125 t_pl", or "every 0.5 s"'
    match = _FRACTION.fullmatch(text) if isinstance(text, str) else None
    try:
        value = float(match["factor"]) if match else parse_quantity(text, "time")
    except UnitError as error:
        raise UnitError(expected, error.cure) from None
    if not (math.isfinite(value) and value >= 0):
        raise UnitError(expected, "it must be finite and not negative")
    return value, match is not None


def written(value: object, extra: dict[str, Any] | None) -> object:
    """A resolved value of a field for TOML: quantities as texts with SI units, tuples as lists, sections as tables."""
    if isinstance(value, Section):
        return {
            name: written(getattr(value, name), extra_of(field))
            for name, field in type(value).model_fields.items()
            if getattr(value, name) not in (None, ())
        }
    if isinstance(value, (list, tuple)):
        return [written(entry, extra) for entry in value]
    if extra and extra.get("dimension") in DIMENSIONS and isinstance(value, float):
        return format_quantity(value, extra["dimension"])
    return value


def toml_of(title: str, tables: Mapping[str, Mapping[str, Any]]) -> str:
    """A scene as TOML: its title, if it has one, and its sections, in their order."""
    lines = [f"title = {toml_text(title)}"] if title else []
    for name, values in tables.items():
        lines += [""] * bool(lines) + [f"[{name}]"]
        lines += [f"{key} = {toml_text(value)}" for key, value in values.items()]
    return "\n".join(lines) + "\n"


def toml_text(value: Any) -> str:
    """A text, number, boolean, list or table, on one line, in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(toml_text(entry) for entry in value) + "]"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name} = {toml_text(entry)}" for name, entry in value.items()) + "}"
    return repr(value) if isinstance(value, (int, float)) else toml_text(str(value))
