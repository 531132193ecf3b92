"""The section [drive] of a scene: the loading programme, and the machine."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import field_validator

from .fields import Section, key, quantity
from .programme_section import ProgrammeStep, Repeat, largest_force, read_steps

if TYPE_CHECKING:
    # In a resolved scene there is a number in the place of a word, and of what is not given.
    Automatic = float
    LikeAnother = float
    LikeProgramme = float
else:
    Automatic = float | Literal["auto"]
    LikeAnother = LikeProgramme = float | None

REPLACED = {"speed", "retract_speed", "dwell", "control", "turn_time"}
"""Keys that are not read where there are steps."""


class Drive(Section):
    """The loading programme: approach at constant speed to the preload, turn, hold, retract; or any steps."""

    speed: LikeProgramme = quantity("speed", "speed of the approach; required without steps", None)
    preload: LikeProgramme = quantity(
        "force",
        "compressive force at which the punch turns round; required without steps. With steps that name no force, about the "
        "largest force, to which errors are relative",
        None,
    )
    retract_speed: LikeAnother = quantity("speed", "speed of the retraction; by default that of the approach", None)
    dwell: float = quantity("time", "time for which the displacement is held after the turn", 0.0, at_least=0.0)
    control: Literal["displacement", "load"] = key(
        "what the machine controls: `displacement`, or `load`, by a very soft spring; steps say it themselves",
        "displacement",
    )
    machine_stiffness: float = quantity(
        "stiffness", "stiffness of the machine's spring between drive and punch", math.inf,
        infinite=True,
    )  # fmt: skip
    turn_time: Automatic = quantity(
        "time",
        "time in which the velocity turns; `auto` moves the punch by at most 0.02 ranges beyond the preload and by "
        "at most 0.02 back: 0.08 range/speed at equal speeds, 0.04 range over the faster one where they are very "
        "different",
        "auto",
        words=("auto",),
    )
    clearance: Automatic = quantity(
        "length",
        "smallest gap at the start, negative to start pressed in; `auto` is the range, just out of reach",
        "auto",
        above=None,
        words=("auto",),
    )
    step: tuple[ProgrammeStep, ...] = key(
        "steps of a programme in the place of `speed`, `retract_speed`, `preload` and `dwell`, each a table of its own; see "
        "[below](#steps-of-a-programme)",
        (),
    )
    repeat: Repeat | None = key("which steps are repeated: a table with `times`, and `first` and `last`", None)

    @field_validator("step", mode="before")
    @classmethod
    def _steps(cls, value: object) -> tuple[ProgrammeStep, ...]:
        return read_steps(value)

    @property
    def unused(self) -> frozenset[str]:
        """The keys that steps replace; in a resolved scene they have values that stand for the programme."""
        if not self.step:
            return frozenset({"step", "repeat"})
        return frozenset(REPLACED | ({"preload"} if largest_force(self.step) else set()))

    @property
    def controls_load(self) -> bool:
        """Whether the machine controls the load, if only in some steps."""
        return self.control == "load" or any(step.controls_load for step in self.step)
