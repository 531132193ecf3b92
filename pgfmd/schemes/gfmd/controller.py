"""Steps of constant length for explicit schemes, slightly shortened to end at the end of a phase or at a requested
time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from pgfmd.physics.drive import Phase
from pgfmd.schemes.base import ExplicitScheme
from pgfmd.solver.ending_search import is_over, signs_of
from pgfmd.solver.state import State

LEAST_SHARE = 0.02
"""Shortest step to meet a value that ends a phase, as a fraction of the usual one."""


@dataclass(frozen=True)
class Taken:
    """A completed step. The surface of a scheme with inertia moves at a finite speed; a massless punch on a machine's spring
    may jump."""

    is_jump: bool = False


class FixedSteps:
    """Takes steps of `step` [s] with an explicit scheme; every decision is the same on all ranks.

    The interface of every controller (base.StepController).
    """

    def __init__(self, scheme: ExplicitScheme, step: float):
        self.scheme, self.step = scheme, step

    def advance(self, state: State, phase: Phase, until: float = math.inf) -> tuple[Taken, str]:
        """Takes one step of the phase, at most to the time `until` [s] from now; returns it and why it ended.

        The second is "ending", "duration", "time" or "" as of `StepController.advance`.
        """
        step, why = self._fit(phase.duration - state.elapsed, until)
        before = self.scheme.values_of(state, phase) if phase.endings else []
        signs = signs_of(state, phase, before)
        if phase.endings:
            step, why = self._not_past_ending(state, phase, before, signs, step, why)
        jumps = state.counters.jumps
        self.scheme.step(state, phase, step)
        state.past_forces[:] = before
        if phase.endings and is_over(phase, self.scheme.values_of(state, phase), signs):
            why = "ending"
        return Taken(state.counters.jumps > jumps), why

    def _fit(self, end: float, until: float) -> tuple[float, str]:
        """Equal steps, no longer than the usual one, to the end of the phase or the requested time, whichever is
        first."""
        target, why = (end, "duration") if end <= until else (until, "time")
        if math.isinf(target):
            return self.step, ""
        count = max(1, math.ceil(target / self.step * (1.0 - 1e-9)))
        return target / count, why if count == 1 else ""

    def _not_past_ending(
        self, state: State, phase: Phase, values: list[float], signs: Sequence[int], step: float, why: str
    ) -> tuple[float, str]:
        """Shortens a step to end at a value that ends the phase, if it is about to be exceeded."""
        for k, (ending, value, sign) in enumerate(zip(phase.endings, values, signs, strict=True)):
            missing = sign * (ending.value - value)
            # Values of the step before, in the place of forces.
            known = len(state.past_forces) == len(values)
            rate = sign * (value - state.past_forces[k]) / state.last_step if known else 0.0
            if rate > 0.0 and missing < rate * step:
                step, why = min(step, max(missing / rate, LEAST_SHARE * self.step)), ""
        return step, why
