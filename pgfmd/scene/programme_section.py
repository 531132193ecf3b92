"""The steps of a loading programme in a scene, `[[drive.step]]`, and their repeats, `[drive.repeat]`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Literal

from pydantic import ValidationError, field_validator
from pydantic_core import PydanticCustomError

from pgfmd.errors import MISSING
from pgfmd.files.followed_path import read_path
from pgfmd.physics.drive import AREA, DETACHED, FORCE, TRAVEL
from pgfmd.units import UnitError, format_quantity, parse_quantity, usual_first

from .fields import LARGEST, Section, expectation, extra_of, key, number, quantity, refuse

FREE, TIME = "free", "time"
UNTIL = {"force": FORCE, "length": TRAVEL, "area": AREA, "time": TIME}
"""What `until` means, by the dimension of its value."""
UNTIL_EXPECTED = 'a force such as "40 mN", a travel such as "3 um", a time such as "60 s", a contact area such as "0.2 mm^2", or "free"'
AMPLITUDE_EXPECTED = 'a length above 0, such as "20 nm", or a force above 0, such as "1 mN"'
STEPS: dict[str, tuple[frozenset[str], frozenset[str]]] = {
    "approach": (frozenset({"speed"}), frozenset({"until", "to", "duration", "turn_time"})),
    "retract": (frozenset({"speed"}), frozenset({"until", "to", "duration", "turn_time"})),
    "hold": (frozenset(), frozenset({"of", "until", "duration", "turn_time"})),
    "ramp": (frozenset({"rate"}), frozenset({"until", "to", "duration", "turn_time"})),
    "oscillate": (frozenset({"amplitude", "frequency", "cycles"}), frozenset({"turn_time"})),
    "follow": (frozenset({"file", "of"}), frozenset()),
}
"""For every kind of step the keys that it needs and those that it may have."""
ALSO = {"for": "duration"}
"""Other names of keys."""


class ProgrammeStep(Section):
    """One step of a programme."""

    do: Literal["approach", "hold", "retract", "ramp", "oscillate", "follow"] = key(
        "`approach` or `retract` at a constant speed, `hold` the displacement or the load, `ramp` the load, `oscillate` "
        "about where the punch is, or `follow` a displacement or a load from a file"
    )
    speed: float | None = quantity("speed", "speed of the machine in `approach` and `retract`", None)
    rate: float | None = quantity("force rate", "rate of the load in `ramp`, negative to pull", None, above=None)
    of: Literal["displacement", "load"] | None = key(
        "what `hold` keeps or `follow` reads from its file; `hold` keeps the displacement unless said otherwise", None
    )
    until: tuple[str, ...] = key(
        "what ends the step: a force, a travel of the punch since its start, a contact area, a time, or `free`, where the "
        "punch has left the reach of adhesion; of several the first that is met. `retract` goes on until it is free unless "
        "said otherwise",
        (),
    )
    to: float | None = quantity("length", "displacement of the punch that ends the step", None, above=None)
    duration: float | None = quantity("time", "time that ends the step; `for` means the same", None)
    amplitude: str | None = key("amplitude of `oscillate`: of the displacement, or of the load", None, min_length=1)
    frequency: float | None = quantity("frequency", "frequency of `oscillate`", None)
    cycles: float | None = number(
        "number of cycles of `oscillate` with its full amplitude; in one more before and one after, the amplitude rises and falls",
        None,
        above=0.0,
    )
    file: str | None = key(
        "file of `follow`: two columns, time and displacement or load, with their units in the header; relative to the "
        "scene's folder",
        None,
        min_length=1,
    )
    turn_time: float | None = quantity(
        "time",
        "time of the smooth turn at the start of the step; by default it moves the punch by at most 0.02 ranges of adhesion "
        "to either side",
        None,
    )

    @field_validator("until", mode="before")
    @classmethod
    def _until(cls, value: object) -> tuple[str, ...]:
        entries = value if isinstance(value, (list, tuple)) else [value]
        texts, problems = [], []
        for entry in entries:
            try:
                texts.append(ending_text(entry))
            except UnitError as error:
                problems.append((entry, error.expected, error.cure))
        if problems:
            raise PydanticCustomError("scene", "expected an ending", {"problems": problems})
        return tuple(texts)

    @field_validator("amplitude", mode="before")
    @classmethod
    def _amplitude(cls, value: object) -> object:
        if value is None:
            return None
        try:
            size, dimension = _one_of(value, ("length", "force"), AMPLITUDE_EXPECTED)
        except UnitError as error:
            raise refuse(value, AMPLITUDE_EXPECTED, error.cure) from None
        if size <= 0.0:
            raise refuse(value, AMPLITUDE_EXPECTED)
        return format_quantity(size, dimension)

    @field_validator("frequency", mode="before")
    @classmethod
    def _frequency(cls, value: object) -> object:
        # A radian has no dimension: it would pass for a cycle.
        if isinstance(value, str) and ("rad" in value or "deg" in value):
            raise refuse(value, expectation(extra_of(cls.model_fields["frequency"])), "give cycles per second, in Hz")
        return value

    @property
    def endings(self) -> list[tuple[str, float]]:
        """Pairs of a quantity (FORCE, TRAVEL, AREA, TIME or DETACHED) and its value of what `until` lists."""
        return [ending_of(text) for text in self.until]

    @property
    def controls_load(self) -> bool:
        """Whether the machine controls the load in this step."""
        if self.do == "oscillate":
            return self.swing[1] == "force"
        return self.do == "ramp" or self.of == "load"

    def speed_with(self, stiffness: float) -> float:
        """About the largest speed [m/s] of a punch in contact of this stiffness [N/m]; 0 of a hold.

        Raises MeasurementError or OSError for a file to follow that can't be read.
        """
        if self.speed is not None:
            return self.speed
        rate = abs(self.rate or 0.0)
        if self.do == "oscillate":
            assert self.frequency is not None, "checked when it was read"
            size, dimension = self.swing
            rate = 2.0 * math.pi * self.frequency * size
            return rate / stiffness if dimension == "force" else rate
        if self.do == "follow":
            times, values = read_path(str(self.file), str(self.of))
            rate = max(abs((b - a) / (t - s)) for a, b, s, t in zip(values, values[1:], times, times[1:], strict=False))
            return rate / stiffness if self.of == "load" else rate
        return rate / stiffness

    @property
    def swing(self) -> tuple[float, str]:
        """Amplitude [m or N] of an oscillation, and its dimension."""
        return _one_of(self.amplitude, ("length", "force"), AMPLITUDE_EXPECTED)


def largest_force(steps: tuple[ProgrammeStep, ...]) -> float:
    """The largest force [N] that steps name; 0 if they name none."""
    forces = [abs(value) for step in steps for named, value in step.endings if named == FORCE]
    return max(forces, default=0.0)


def names_force(steps: object) -> bool:
    """Whether steps that have not been read yet name a force that ends one; not if they can't be read."""
    try:
        return largest_force(read_steps(steps)) > 0.0
    except PydanticCustomError:
        return False


class Repeat(Section):
    """Which steps of a programme are repeated."""

    times: int = key("how many times the steps are done in all", ge=1, le=100_000)
    first: int = key("number of the first step that is repeated", 1, ge=1)
    last: int | None = key("number of the last one; the last step of the programme unless said otherwise", None, ge=1)


def _one_of(value: object, dimensions: tuple[str, ...], expected: str) -> tuple[float, str]:
    """The SI value of a text with a unit of one of these dimensions, and which. Raises UnitError."""
    cure = ""
    for dimension in usual_first(value, dimensions):
        try:
            size = parse_quantity(value, dimension)
        except UnitError as error:
            cure = error.cure
            continue
        if not abs(size) <= LARGEST:
            raise UnitError(expected, "it must be a finite number")
        return size, dimension
    if not isinstance(value, str):
        cure = "write a text with a unit"
    raise UnitError(expected, cure)


def ending_of(text: object) -> tuple[str, float]:
    """Quantity and value of what ends a step: FORCE [N], TRAVEL [m], AREA [m^2], TIME [s], or DETACHED.

    Raises UnitError for anything else.
    """
    if text == FREE:
        return DETACHED, 0.0
    value, dimension = _one_of(text, tuple(UNTIL), UNTIL_EXPECTED)
    if dimension != "force" and value <= 0.0:
        raise UnitError(UNTIL_EXPECTED, f"a {'travel' if dimension == 'length' else dimension} must be above 0")
    return UNTIL[dimension], value


def ending_text(text: object) -> str:
    """The same as a text in SI units. Raises UnitError."""
    quantity_of, value = ending_of(text)
    if quantity_of == DETACHED:
        return FREE
    return format_quantity(value, next(name for name, meant in UNTIL.items() if meant == quantity_of))


Problem = tuple[object, str, str, str]
"""Value, what was expected, a cure, and the key after `drive.step`."""


def read_steps(value: object) -> tuple[ProgrammeStep, ...]:
    """The steps of a programme from a list of tables. Raises PydanticCustomError with all problems."""
    if not isinstance(value, (list, tuple)):
        raise refuse(value, "a list of tables, each headed [[drive.step]]", "write double brackets")
    steps, problems = [], []
    for number_, raw in enumerate(value, 1):
        if isinstance(raw, ProgrammeStep):
            steps.append(raw)
            continue
        if not isinstance(raw, Mapping):
            problems.append((raw, "a table with the keys of a step", "", f".{number_}"))
            continue
        table = {ALSO.get(str(name), str(name)): entry for name, entry in raw.items()}
        problems += [
            (
                raw[name],
                f"no such key beside '{same}', which means the same",
                "delete one of them",
                f".{number_}.{name}",
            )
            for name, same in ALSO.items()
            if name in raw and same in raw
        ]
        found = _problems_of_keys(table, number_)
        try:
            steps.append(ProgrammeStep.model_validate(table))
        except ValidationError as error:
            wrong = _problems_of_values(error, number_)
            known = {problem[3] for problem in wrong}
            found = wrong + [problem for problem in found if problem[3] not in known]
        problems += found
    if problems:
        raise PydanticCustomError("scene", "expected steps", {"problems": problems})
    return tuple(steps)


def _problems_of_values(error: ValidationError, number_: int) -> list[Problem]:
    """What is wrong with the values of a step, in the words of the scene."""
    problems: list[Problem] = []
    for details in error.errors(include_url=False):
        name = str(details["loc"][0])
        dotted, given = f".{number_}.{name}", details.get("input")
        if details["type"] == "scene":
            problems += [(*parts, dotted) for parts in details["ctx"]["problems"]]
        elif details["type"] == "missing":
            problems.append((MISSING, f"one of {', '.join(STEPS)}", 'add do = "approach", for instance', dotted))
        elif details["type"] == "extra_forbidden":
            problems.append((given, f"a key of a step: {', '.join(ProgrammeStep.model_fields)}", "", dotted))
        else:
            problems.append((given, details["msg"].removeprefix("Input should be "), "", dotted))
    return problems


def _problems_of_keys(table: Mapping[str, Any], number_: int) -> list[Problem]:
    """Keys that a step of its kind lacks, or must not have."""
    do = table.get("do")
    if do not in STEPS:
        return []
    required, optional = STEPS[do]
    problems: list[Problem] = [
        (MISSING, f"a value for '{do}'", f"add {name} = ... to step {number_}", f".{number_}.{name}")
        for name in sorted(required - table.keys())
    ]
    for name in sorted(table.keys() & ProgrammeStep.model_fields.keys() - required - optional - {"do"}):
        users = [other for other, keys in STEPS.items() if name in keys[0] | keys[1]]
        problems.append((table[name], f"no such key in '{do}'", f"only in {', '.join(users)}", f".{number_}.{name}"))
    ends = [name for name in ("until", "to", "duration") if table.get(name) not in (None, [], ())]
    if do in ("approach", "hold", "ramp") and not ends:
        problems.append(
            (MISSING, f"what ends '{do}'", 'add duration = "60 s", or until = "40 mN"', f".{number_}.until")
        )
    return problems
