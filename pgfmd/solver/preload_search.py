"""Finding the step whose end meets the preload, and fitting steps to events. Plain Python."""

from __future__ import annotations

import math

from pgfmd.physics.drive import PRELOAD, Phase

PRELOAD_TOLERANCE = 1e-4
"""Relative error with which the preload is met: a late turn would shift the whole retraction."""
PRELOAD_SHARE = 0.1
"""The same as a fraction of the tolerance of a step, if that is smaller."""
CLOSE_TO_PRELOAD = 0.95
"""From this fraction of the preload on, steps are solved to a smaller tolerance."""


def slack_of(preload: float, tolerance: float) -> float:
    """Allowed error [N] of the preload, for this tolerance of a step."""
    return min(PRELOAD_TOLERANCE, PRELOAD_SHARE * tolerance) * preload


class PreloadSearch:
    """Finds the length of a step at whose end the force meets the preload, by trial steps; inactive in other phases.

    force [N]: at the start of the step.
    """

    def __init__(self, phase: Phase, force: float, preload: float, slack: float):
        self.is_on = phase.ends_with == PRELOAD
        self.start, self.preload, self.slack = force, preload, slack
        self.bracket: Bracket | None = None

    @property
    def sharp(self) -> bool:
        """Whether trial steps need a smaller tolerance, because the force is close to the preload."""
        return self.bracket is not None or (self.is_on and self.start > CLOSE_TO_PRELOAD * self.preload)

    def other_step(self, step: float, force: float) -> float | None:
        """The next step [s] to try after one that ended at `force` [N]; None if that one is accepted."""
        excess = force - self.preload
        if not self.is_on or (excess <= self.slack and (self.bracket is None or excess >= -self.slack)):
            return None
        self.bracket = self.bracket or Bracket(0.0, self.start - self.preload)
        return self.bracket.narrow(step, excess)

    def is_met(self, force: float) -> bool:
        """Whether a step that ends at `force` [N] ends the phase."""
        return self.is_on and force >= self.preload - self.slack


NARROW = 1e-6
"""Width of a bracket, as a fraction of the first step that was too long, below which a jump of the force is
distinguished from a steep force."""
STEEP = 1e3
"""The force jumps if it changes within a narrow bracket by more than this multiple of what its width suggests."""
NARROWEST = 1e-14
"""Width of a bracket, as the same fraction, at which rounding ends the search."""


class Bracket:
    """Regula falsi (Illinois) for the step at which the force meets the preload."""

    def __init__(self, low: float, low_value: float):
        self.low, self.low_value = low, low_value
        # Until a step was too long.
        self.high = self.high_value = math.nan
        self.first: float | None = None
        self.last_side = 0
        # The true values at the ends: the method halves those that it uses.
        self._ends, self._first_span = [low_value, 0.0], 0.0

    def narrow(self, step: float, value: float) -> float | None:
        """Adds the excess [N] of the force at a step [s]; returns the next step to try, None if the bracket is
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
