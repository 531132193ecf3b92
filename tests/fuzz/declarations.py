"""What pgfmd declares of the keys of a scene: kind of value, dimension, limits. New keys are found by themselves."""

from __future__ import annotations

import types
import typing
from dataclasses import dataclass

from pgfmd.scene.fields import OneOf
from pgfmd.scene.model import SECTIONS
from pgfmd.units import DIMENSIONS

EXPONENTS = {
    "length": (1, 0, 0),
    "time": (0, 0, 1),
    "speed": (1, 0, -1),
    "force": (2, 1, 0),
    "modulus": (0, 1, 0),
    "energy per area": (1, 1, 0),
    "angular frequency": (0, 0, -1),
    "wavenumber": (-1, 0, 0),
    "stiffness": (1, 1, 0),
    "force rate": (2, 1, -1),
    "frequency": (0, 0, -1),
    "stiffness per area": (-1, 1, 0),
    "number": (0, 0, 0),
}
"""Powers of a length, a modulus and a time that a dimension is made of."""


@dataclass(frozen=True)
class Key:
    """A key of a scene, as the models declare it.

    kind: "quantity" or "number", which have dimension and limits (above, at_least, at_most), a count (None: one value,
    0: a list of any length), words that stand for a value, and whether it may be infinite; "choice" with its choices;
    "flag"; "whole" with at_least and at_most; "times", a list of times; "text".
    """

    section: str
    name: str
    kind: str
    required: bool
    dimension: str = "number"
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    words: tuple[str, ...] = ()
    infinite: bool = False
    count: int | None = None
    choices: tuple = ()

    @property
    def dotted(self) -> str:
        """Such as "punch.radius"."""
        return f"{self.section}.{self.name}"


def exponents(dimension: str) -> tuple[int, int, int]:
    """Powers of length, modulus and time. A dimension that pgfmd has learnt since has to be added to the table."""
    return EXPONENTS[dimension]


def _key(section: str, name: str, field) -> Key:
    required, extra = field.is_required(), field.json_schema_extra or {}
    if "dimension" in extra:
        kind = "quantity" if extra["dimension"] in DIMENSIONS else "number"
        return Key(
            section, name, kind, required, extra["dimension"], extra["above"], extra["at_least"], extra["at_most"],
            tuple(extra["words"]), extra["infinite"], extra["count"],
        )  # fmt: skip
    parts = _parts(field.annotation)
    choices = tuple(choice for part in parts if typing.get_origin(part) is typing.Literal for choice in part.__args__)
    choices = next((mark.words() for mark in field.metadata if isinstance(mark, OneOf)), choices)
    if choices:
        return Key(section, name, "choice", required, choices=choices)
    if bool in parts:
        return Key(section, name, "flag", required)
    if int in parts:
        least = next((limit.ge for limit in field.metadata if hasattr(limit, "ge")), None)
        most = next((limit.le for limit in field.metadata if hasattr(limit, "le")), None)
        below = next((limit.lt - 1 for limit in field.metadata if hasattr(limit, "lt")), None)
        return Key(section, name, "whole", required, at_least=least, at_most=most if below is None else below)
    if any(typing.get_origin(part) is tuple for part in parts):
        return Key(section, name, "times", required)
    if str in parts:
        return Key(section, name, "text", required)
    raise TypeError(f"{section}.{name}: the fuzzer knows no values for {field.annotation}: teach it in declarations.py")


def _parts(annotation) -> tuple:
    """The types of a union but None; a single type alone."""
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        return tuple(part for part in annotation.__args__ if part is not type(None))
    return (annotation,)


PROGRAMME = ("drive.step", "drive.repeat")
"""Tables within a section; scenes.py draws programmes of steps as a whole."""
KEYS: dict[str, Key] = {
    key.dotted: key
    for section, model in SECTIONS.items()
    for key in (
        _key(section, name, field) for name, field in model.model_fields.items() if f"{section}.{name}" not in PROGRAMME
    )
}
"""All keys by their dotted names, in the order of the resolved scene."""
