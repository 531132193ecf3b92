"""Finding the step whose end meets a value that ends the phase, such as the preload, and fitting steps to events. Plain
Python."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from pgfmd.physics.drive import AREA, FORCE, PLACE, TRAVEL, Ending, Phase

from .state import State

if TYPE_CHECKING:
    from pgfmd.schemes.base import ImplicitScheme

PRELOAD_TOLERANCE = 1e-4
"""Relative error with which a force is met: a late turn would shift the whole retraction."""
PRELOAD_SHARE = 0.1
"""The same as a fraction of the tolerance of a step, if that is smaller; and the error with which a displacement is met,
in lengths of the law."""
LEAST_FORCE = 1e-2
"""Smallest force to which the error of a force is relative, as a fraction of the preload."""
AREA_TOLERANCE = 1e-3
"""Relative error with which a contact area is met, at least one point of the grid."""
CLOSE = 0.95
"""From this fraction of a force on, steps are solved to a smaller tolerance."""


def slack_of(preload: float, tolerance: float) -> float:
    """Allowed error [N] of the preload, for this tolerance of a step."""
    return min(PRELOAD_TOLERANCE, PRELOAD_SHARE * tolerance) * preload


def values_of(phase: Phase, state: State, force: float, place: float, area: Callable[[], float]) -> list[float]:
    """The values of the quantities that may end a phase, for a force [N], a displacement of the punch [m] and a contact area
    [m^2], which is computed only if it is asked for."""
    found = []
    for ending in phase.endings:
        if ending.quantity == AREA:
            found.append(area())
        else:
            known = {FORCE: force, PLACE: place, TRAVEL: abs(place - state.phase_place)}
            found.append(known[ending.quantity])
    return found


def signs_at(phase: Phase, values: Sequence[float]) -> list[int]:
    """From which side the values that end a phase are reached, from the values at its start."""
    pairs = zip(phase.endings, values, strict=True)
    return [ending.sign or (1 if value < ending.value else -1) for ending, value in pairs]


def signs_of(state: State, phase: Phase, values: Sequence[float]) -> Sequence[int]:
    """The same as the state has them since the phase began; from these values for a state that no loop has begun."""
    known = len(state.phase_signs) == len(phase.endings)
    return state.phase_signs if known else signs_at(phase, values)


def is_over(phase: Phase, values: Sequence[float], signs: Sequence[int]) -> bool:
    """Whether one of these values has ended a phase."""
    triples = zip(phase.endings, values, signs, strict=True)
    return any(sign * (value - ending.value) >= 0.0 for ending, value, sign in triples)


class EndingSearch:
    """Finds the length of a step at whose end a phase ends with a value, by trial steps; inactive in other phases.

    start: values of the endings at the start of the step. signs: from which side they are reached. tolerance: of a step, in
    lengths of the law. preload [N]: scale of forces; length [m]: of the law; cell [m^2]: of a grid point.
    """

    def __init__(
        self, phase: Phase, start: Sequence[float], signs: Sequence[int], tolerance: float, preload: float,
        length: float, cell: float,
    ):  # fmt: skip
        self.endings, self.start, self.signs = phase.endings, start, signs
        self.slacks = [_slack(ending, tolerance, preload, length, cell) for ending in phase.endings]
        self.bracket: Bracket | None = None

    @property
    def sharp(self) -> bool:
        """Whether trial steps need a smaller tolerance, because a force is close to the one that ends the phase."""
        return self.bracket is not None or any(
            ending.quantity == FORCE and _is_close(ending.value, value, sign)
            for ending, value, sign in zip(self.endings, self.start, self.signs, strict=True)
        )

    def other_step(self, step: float, values: Callable[[], Sequence[float]]) -> float | None:
        """The next step [s] to try after one that ended at these values; None if that one is accepted."""
        if not self.endings:
            return None
        excess, slack = self._excess(values())
        if excess <= slack and (self.bracket is None or excess >= -slack):
            return None
        self.bracket = self.bracket or Bracket(0.0, self._excess(self.start)[0])
        return self.bracket.narrow(step, excess)

    def is_met(self, values: Callable[[], Sequence[float]]) -> bool:
        """Whether a step that ends at these values ends the phase."""
        if not self.endings:
            return False
        excess, slack = self._excess(values())
        return excess >= -slack

    def _excess(self, values: Sequence[float]) -> tuple[float, float]:
        """By how much the values are beyond the nearest ending, and the allowed error: in units of that ending's quantity,
        or, of several endings, in allowed errors."""
        triples = zip(self.endings, values, self.signs, strict=True)
        beyond = [sign * (value - ending.value) for ending, value, sign in triples]
        if len(beyond) == 1:
            return beyond[0], self.slacks[0]
        return max(excess / slack for excess, slack in zip(beyond, self.slacks, strict=True)), 1.0


def search_of(
    scheme: ImplicitScheme, state: State, phase: Phase, tolerance: float, preload: float, length: float
) -> EndingSearch:
    """The search in a step of a scheme; arguments as of EndingSearch."""
    cell = scheme.points.grid.cell_area if phase.endings else 0.0
    start = scheme.values_of(state, phase)
    return EndingSearch(phase, start, signs_of(state, phase, start), tolerance, preload, length, cell)


def _slack(ending: Ending, tolerance: float, preload: float, length: float, cell: float) -> float:
    """Allowed error of the value of an ending."""
    if ending.quantity == FORCE:
        return slack_of(max(abs(ending.value), LEAST_FORCE * preload), tolerance)
    if ending.quantity == AREA:
        return max(AREA_TOLERANCE * ending.value, cell)
    return PRELOAD_SHARE * tolerance * length


def _is_close(value: float, force: float, sign: int) -> bool:
    if sign > 0 and value > 0.0:
        return force > CLOSE * value
    return sign * (value - force) < (1.0 - CLOSE) * max(abs(value), abs(force))


NARROW = 1e-6
"""Width of a bracket, as a fraction of the first step that was too long, below which a jump of the value is
distinguished from a steep one."""
STEEP = 1e3
"""The value jumps if it changes within a narrow bracket by more than this multiple of what its width suggests."""
NARROWEST = 1e-14
"""Width of a bracket, as the same fraction, at which rounding ends the search."""


class Bracket:
    """Regula falsi (Illinois) for the step at which a value is met."""

    def __init__(self, low: float, low_value: float):
        self.low, self.low_value = low, low_value
        # Until a step was too long.
        self.high = self.high_value = math.nan
        self.first: float | None = None
        self.last_side = 0
        # The true values at the ends: the method halves those that it uses.
        self._ends, self._first_span = [low_value, 0.0], 0.0

    def narrow(self, step: float, value: float) -> float | None:
        """Adds the excess of the value at a step [s]; returns the next step to try, None if the bracket is
        empty."""
        side = 1 if value > 0.0 else -1
        self._ends[side > 0] = value
        if self.first is None:
            self.first, self._first_span = step, value - self.low_value
        if side > 0:
            self.high, self.high_value = step, value
        else:
            self.low, self.low_value = step, value
        if self.last_side == side:
            if side > 0:
                self.low_value *= 0.5
            else:
                self.high_value *= 0.5
        self.last_side = side
        width = self.high - self.low
        if width <= NARROW * self.first:
            # A preload may be tiny compared with the change of the force in one step, and must be met all the same.
            jumps = (self._ends[1] - self._ends[0]) * self.first > STEEP * width * self._first_span
            if jumps or width <= NARROWEST * self.first:
                return None
        inside = self.low - self.low_value * width / (self.high_value - self.low_value)
        return min(max(inside, self.low + 1e-3 * width), self.high - 1e-3 * width)


def fit(step: float, end: float, until: float) -> tuple[float, str]:
    """The step, shortened or slightly stretched to end at the end of the phase or at a requested time; and which of
    them it meets."""
    target, why = (end, "duration") if end <= until else (until, "time")
    if step >= target * (1.0 - 1e-9):
        return target, why
    if step > 0.5 * target:
        return 0.5 * target, ""
    return step, ""
