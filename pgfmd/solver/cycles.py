"""The numbers of each cycle of a programme with repeats."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .state import State


@dataclass
class CycleNumbers:
    """Numbers of one cycle; those of energies and times are counted from its start once it is over.

    number: from 1, 0 before the first. start, end [s]: when it began, and its last step ended. preload [N]: force at the
    end of its last approach, and largest_force, pull_off_force, snap_in_force [N] as of the whole run (state.State);
    pull_off_force and snap_in_force are zero or negative. work, work_of_separation, viscous, released, residual [J].
    contact_time [s]: with any point in contact. detached: whether the punch has been pulled off.
    """

    number: int = 0
    start: float = 0.0
    end: float = 0.0
    preload: float | None = None
    largest_force: float = 0.0
    snap_in_force: float = 0.0
    pull_off_force: float = 0.0
    contact_time: float = 0.0
    detached: bool = False
    work: float = 0.0
    work_of_separation: float = 0.0
    viscous: float = 0.0
    released: float = 0.0
    residual: float = 0.0

    def begin(self, state: State, number: int) -> None:
        """Begins a cycle at the end of a step."""
        fresh = CycleNumbers(number, state.time, state.time)
        for name in COUNTED:
            setattr(fresh, name, getattr(state.energies, name))
        for entry in fields(self):
            setattr(self, entry.name, getattr(fresh, entry.name))

    def follow(self, state: State, approaches: bool, recedes: bool) -> None:
        """Takes up a step that has been measured; whether the punch approaches or recedes in it."""
        self.end = state.time
        self.largest_force = max(self.largest_force, state.force)
        if state.contact_points:
            self.contact_time += state.last_step
        if approaches:
            self.snap_in_force = min(self.snap_in_force, state.least_force)
        elif recedes:
            self.pull_off_force = min(self.pull_off_force, state.least_force)

    def row(self, state: State) -> list[float | None]:
        """The numbers up to the present state, in the order of the fields."""
        found: list[float | None] = []
        for entry in fields(self):
            value = getattr(self, entry.name)
            found.append(getattr(state.energies, entry.name) - value if entry.name in COUNTED else value)
        return found


COUNTED = ("work", "work_of_separation", "viscous", "released", "residual")
"""Fields that hold what the run had at the start of the cycle."""


UNITS = {
    "start": "s", "end": "s", "preload": "N", "largest_force": "N", "snap_in_force": "N", "pull_off_force": "N",
    "contact_time": "s", "work": "J", "work_of_separation": "J", "viscous": "J", "released": "J", "residual": "J",
}  # fmt: skip
"""Units of the fields, which are part of the keys in `run.json`."""
TENSIONS = ("snap_in_force", "pull_off_force")
"""Forces that `run.json` counts positive in tension."""


def numbers_in_record(row: list[float | None]) -> dict[str, float | None]:
    """A cycle as `run.json` has it, from the list that `CycleNumbers.row` gives."""
    found: dict[str, float | None] = {}
    for entry, value in zip(fields(CycleNumbers), row, strict=True):
        unit = UNITS.get(entry.name)
        number = 0.0 - value if value is not None and entry.name in TENSIONS else value
        plain = "cycle" if entry.name == "number" else entry.name
        found[f"{entry.name}_{unit}" if unit else plain] = number
    return found
