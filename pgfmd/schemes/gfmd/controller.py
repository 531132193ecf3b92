"""Steps of constant length for explicit schemes, slightly shortened to end at the end of a phase or at a requested
time."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pgfmd.physics.drive import PRELOAD, Phase
from pgfmd.schemes.base import ExplicitScheme
from pgfmd.solver.state import State

LEAST_SHARE = 0.02
"""Shortest step to meet the preload, as a fraction of the usual one."""


@dataclass(frozen=True)
class Taken:
    """A completed step. The surface of a scheme with inertia moves at a finite speed; a massless punch on a machine's spring
    may jump."""

    is_jump: bool = False


class FixedSteps:
    """Takes steps of `step` [s] with an explicit scheme; every decision is the same on all ranks.

    The interface of every controller (base.StepController). preload [N]: the force that ends an approach.
    """

    def __init__(self, scheme: ExplicitScheme, step: float, preload: float):
        self.scheme, self.step, self.preload = scheme, step, preload

    def advance(self, state: State, phase: Phase, until: float = math.inf) -> tuple[Taken, str]:
        """Takes one step of the phase, at most to the time `until` [s] from now; returns it and why it ended.

        The second is "preload", "duration", "time" or "" as of `StepController.advance`.
        """
        step, why = self._fit(phase.duration - state.elapsed, until)
        if phase.ends_with == PRELOAD:
            step, why = self._not_past_preload(state, step, why)
        force, jumps = state.force, state.counters.jumps
        self.scheme.step(state, phase, step)
        state.past_forces[:] = [force]
        if phase.ends_with == PRELOAD and state.force >= self.preload:
            why = "preload"
        return Taken(state.counters.jumps > jumps), why

    def _fit(self, end: float, until: float) -> tuple[float, str]:
        """Equal steps, no longer than the usual one, to the end of the phase or the requested time, whichever is
        first."""
        target, why = (end, "duration") if end <= until else (until, "time")
        if math.isinf(target):
            return self.step, ""
        count = max(1, math.ceil(target / self.step * (1.0 - 1e-9)))
        return target / count, why if count == 1 else ""

    def _not_past_preload(self, state: State, step: float, why: str) -> tuple[float, str]:
        """Shortens a step to end at the preload, if the force is about to exceed it."""
        missing = self.preload - state.force
        rate = (state.force - state.past_forces[0]) / state.last_step if state.past_forces else 0.0
        if rate <= 0.0 or missing >= rate * step:
            return step, why
        return min(step, max(missing / rate, LEAST_SHARE * self.step)), ""
