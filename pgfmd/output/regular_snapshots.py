"""Snapshots at regular distances of time, displacement or force, and at the ends of the steps of a programme."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from pgfmd.units import handy_quantity

if TYPE_CHECKING:
    from pgfmd.scene.output_section import Rhythm
    from pgfmd.solver.state import State

NEAR = 0.02
"""How near to a multiple a displacement or a force has to come, as a fraction of the distance."""
CLOSE = 1e-9
"""The same of a time, which steps meet."""
SHORTEST = 1e-3
"""Shortest step that ends at a multiple, as a fraction of the last step: a shorter one is not asked for."""


@dataclass
class RegularSnapshots:
    """Which snapshots are due because a value has reached the next multiple of a distance.

    kinds: "time", "t_pl", "displacement" or "force", one for each distance. sizes [s, a fraction of t_pl, m or N]. counts:
    the multiple that was reached last, or the place of the start in distances; below 0 for t_pl before the preload.
    values, before: at the ends of the last two steps, from which the time of the next multiple is estimated. step_ends:
    whether the ends of steps of the programme are wanted too.
    """

    kinds: list[str] = field(default_factory=list)
    sizes: list[float] = field(default_factory=list)
    counts: list[float] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    before: list[float] = field(default_factory=list)
    step_ends: bool = False

    @classmethod
    def of(cls, rhythms: list[Rhythm], state: State) -> RegularSnapshots:
        """From the present state on."""
        wanted = [rhythm for rhythm in rhythms if rhythm.kind != "step ends"]
        found = cls([rhythm.kind for rhythm in wanted], [rhythm.size for rhythm in wanted])
        found.values = [found._value(k, state) for k in range(len(wanted))]
        found.before = list(found.values)
        found.counts = [found._first(k, state) for k in range(len(wanted))]
        found.step_ends = len(wanted) < len(rhythms)
        return found

    def next_time(self, state: State) -> float:
        """About when [s] the next multiple will be reached; infinity if none is in sight."""
        return min((self._when(k, state) for k in range(len(self.kinds))), default=math.inf)

    def take(self, state: State) -> list[str]:
        """Labels of the snapshots that are due at the end of a step."""
        labels = []
        for k, kind in enumerate(self.kinds):
            value = self._value(k, state)
            self.before[k], self.values[k] = self.values[k], value
            if kind == "t_pl" and self.counts[k] < 0.0:
                # Nothing before the preload, which has a snapshot of its own.
                self.counts[k] = self._first(k, state)
                continue
            count = self._reached(k)
            if count != self.counts[k]:
                self.counts[k] = count
                labels.append(self._label(k))
        return labels

    def _value(self, k: int, state: State) -> float:
        kind = self.kinds[k]
        if kind == "displacement":
            return state.punch_displacement
        if kind == "force":
            return state.force
        if kind == "time":
            return state.time
        # Before the preload t_pl is not known: those snapshots are placed by a run ahead.
        if state.preload_time is None:
            return 0.0
        first = state.first_contact_time or 0.0
        return (state.time - first) / max(state.preload_time - first, 1e-300)

    def _first(self, k: int, state: State) -> float:
        """Where a value starts, in distances; -1 for t_pl before the preload."""
        if self.kinds[k] == "t_pl" and state.preload_time is None:
            return -1.0
        at = self.values[k] / self.sizes[k]
        return float(round(at)) if abs(at - round(at)) <= self._tolerance(k) else at

    def _reached(self, k: int) -> float:
        """The last multiple that a value has reached or passed, on its way from the one before."""
        at, count, near = self.values[k] / self.sizes[k], self.counts[k], self._tolerance(k)
        if at > count:
            return max(count, float(math.floor(at + near)))
        return min(count, float(math.ceil(at - near)))

    def _tolerance(self, k: int) -> float:
        return CLOSE if self.kinds[k] in ("time", "t_pl") else NEAR

    def _when(self, k: int, state: State) -> float:
        if self.kinds[k] in ("time", "t_pl"):
            if self.kinds[k] == "t_pl" and state.preload_time is None:
                return math.inf
            first = (state.first_contact_time or 0.0) if self.kinds[k] == "t_pl" else 0.0
            unit = self.sizes[k] * ((state.preload_time or 0.0) - first if self.kinds[k] == "t_pl" else 1.0)
            if unit <= 0.0:
                return math.inf
            return first + unit * (math.floor((state.time - first) / unit + CLOSE) + 1)
        moved = self.values[k] - self.before[k]
        if moved == 0.0 or not state.last_step or not state.elapsed:
            return math.inf
        count = self.counts[k]
        target = (math.floor(count) + 1 if moved > 0.0 else math.ceil(count) - 1) * self.sizes[k]
        ahead = (target - self.values[k]) / moved * state.last_step
        return state.time + ahead if ahead > SHORTEST * state.last_step else math.inf

    def _label(self, k: int) -> str:
        kind, value, multiple = self.kinds[k], self.values[k], self.counts[k] * self.sizes[k]
        value = 0.0 + (multiple if abs(value - multiple) <= self._tolerance(k) * self.sizes[k] else value)
        if kind == "t_pl":
            return f"{value:.4g} t_pl"
        symbol, dimension = {"time": ("t", "time"), "displacement": ("d", "length"), "force": ("F", "force")}[kind]
        return f"{symbol} = {handy_quantity(value, dimension)}"
