"""The section [output] of a scene: what a run writes, and when."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pydantic import field_validator
from pydantic_core import PydanticCustomError

from pgfmd.units import UnitError, format_quantity, parse_quantity, usual_first

from .fields import LARGEST, SMALLEST, Section, key, quantity, refuse, snapshot_time

NEAR_GAP = 500e-9
"""Gap [m] below which a point looks closed in an optical image: about the wavelength of light."""


EVERY, STEP_ENDS = "every ", "step ends"
KINDS = {"displacement": "length", "force": "force"}
"""Dimensions of the distances of regular snapshots, beside times."""
EXPECTED = 'a distance such as "every 0.1 s", "every 0.02 t_pl", "every 0.1 um" or "every 1 mN"'
LEAST_FRACTION = 1e-3
ROUNDING = 1e-9


@dataclass(frozen=True)
class Rhythm:
    """Snapshots that are wanted regularly. kind: "time", "t_pl", "displacement", "force" or "step ends"; size: their
    distance [s, 1, m or N]."""

    kind: str
    size: float


class Output(Section):
    """What is written."""

    directory: str | None = key("folder of the results; by default `out/<scene name>`", None, min_length=1)
    snapshots: tuple[str, ...] = key(
        'when fields are written: times ("3 s"), fractions of the time to the preload ("1.125 t_pl"), regularly ("every '
        '0.1 s", "every 0.02 t_pl", "every 0.1 um" of the punch, "every 1 mN"), and at the ends of the steps of a programme '
        '("step ends")',
        (),
    )
    every: int = key("number of steps between two rows of the curve", 1, ge=1)
    surface: bool = key("whether snapshots hold the surface of the whole cell", False)
    near_gap: float = quantity(
        "length", "gap below which a point is near, as an optical image sees it: `near_area` of the curve", NEAR_GAP
    )
    energy: bool = key("whether the energy audit is kept", True)
    patches: bool = key(
        "whether contact patches are listed, and the times at which summits, saddles and valleys join and leave", True
    )

    @field_validator("snapshots", mode="before")
    @classmethod
    def _snapshots(cls, value: object) -> tuple[str, ...]:
        if not isinstance(value, (list, tuple)):
            raise refuse(value, 'a list of times such as ["3 s", "1.125 t_pl"]', "write it in square brackets")
        texts, problems = [], []
        for entry in value:
            try:
                texts.append(_text_of(entry))
            except UnitError as error:
                problems.append((entry, error.expected, error.cure))
        if problems:
            raise PydanticCustomError("scene", "expected a time", {"problems": problems})
        return tuple(texts)

    @property
    def snapshot_times(self) -> list[tuple[float, bool]]:
        """Every single snapshot as (value, relative): a time [s], or a fraction of the time to the preload where
        relative. Fractions of t_pl before the preload that are asked for regularly are among them."""
        single = [snapshot_time(text) for text in self.snapshots if not _is_regular(text)]
        for rhythm in self.rhythms:
            if rhythm.kind == "t_pl":
                count = math.ceil(1.0 / rhythm.size - ROUNDING)
                single += [(k * rhythm.size, True) for k in range(1, count)]
        return single

    @property
    def rhythms(self) -> list[Rhythm]:
        """The snapshots that are wanted regularly."""
        return [rhythm_of(text) for text in self.snapshots if _is_regular(text)]


def _is_regular(text: object) -> bool:
    return isinstance(text, str) and (text.startswith(EVERY) or text == STEP_ENDS)


def rhythm_of(text: str) -> Rhythm:
    """What "every 0.1 um" asks for. Raises UnitError for anything else."""
    if text == STEP_ENDS:
        return Rhythm(STEP_ENDS, 0.0)
    rest = text.removeprefix(EVERY)
    try:
        # Whatever has no usual unit of a distance may be a time.
        if usual_first(rest, ("time", *KINDS.values()))[0] != "time":
            raise UnitError(EXPECTED)
        value, relative = snapshot_time(rest)
        kind = "t_pl" if relative else "time"
    except UnitError:
        kind, value = _distance(rest)
    if not SMALLEST < value < LARGEST or (kind == "t_pl" and value < LEAST_FRACTION):
        raise UnitError(EXPECTED, "it must be above 0, and at least 0.001 of t_pl")
    return Rhythm(kind, value)


def _distance(text: str) -> tuple[str, float]:
    """Kind and size of a distance that is no time. Raises UnitError for anything else."""
    cure = ""
    kinds = {dimension: kind for kind, dimension in KINDS.items()}
    for dimension in usual_first(text, tuple(kinds)):
        try:
            return kinds[dimension], parse_quantity(text, dimension)
        except UnitError as error:
            cure = error.cure
    raise UnitError(EXPECTED, cure)


def _text_of(entry: str) -> str:
    """An entry of `snapshots` in SI units. Raises UnitError."""
    if _is_regular(entry):
        rhythm = rhythm_of(entry)
        if rhythm.kind == STEP_ENDS:
            return STEP_ENDS
        if rhythm.kind == "t_pl":
            return f"{EVERY}{rhythm.size!r} t_pl"
        return EVERY + format_quantity(rhythm.size, {"time": "time", **KINDS}[rhythm.kind])
    time, relative = snapshot_time(entry)
    return f"{time!r} t_pl" if relative else format_quantity(time, "time")
