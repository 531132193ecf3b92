"""The loading programme: approach, turn round, hold, retract. Plain NumPy.

A programme is a list of phases, in each of which the punch's velocity changes linearly with time:

    d(t) = d_0 + v_0 t + (v_1 - v_0) t^2 / (2 T)        t counted from the start of the phase

A phase ends after its duration T, or, where it has none, with an event: the preload is reached, or the punch is free.
The turn-round is as smooth as in the paper ("Refinements and corrections"): the velocity goes from -v to +v over the
time T, the punch overshoots its turning point by v T / 4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

PRELOAD, DETACHED = "preload", "detached"
"""Events that end the phases without a duration."""

OVERSHOOT = 0.02
"""Largest overshoot v T / 4 of the automatic turn, in ranges of adhesion (v: speed of the approach)."""


@dataclass(frozen=True)
class Phase:
    """One phase: name as in curve.csv, velocities [m/s] at its start and end, duration [s] or infinity, event that ends
    it."""

    name: str
    velocity_start: float
    velocity_end: float
    duration: float = math.inf
    ends_with: str = ""

    def displacement(self, elapsed: float) -> float:
        """How far [m] the punch has moved since the phase began."""
        if math.isinf(self.duration):
            return self.velocity_start * elapsed
        acceleration = (self.velocity_end - self.velocity_start) / self.duration
        return (self.velocity_start + 0.5 * acceleration * elapsed) * elapsed

    def velocity(self, elapsed: float) -> float:
        """Velocity [m/s] of the punch, this long after the phase began."""
        if math.isinf(self.duration):
            return self.velocity_start
        return self.velocity_start + (self.velocity_end - self.velocity_start) * elapsed / self.duration

    @property
    def fastest(self) -> float:
        """The largest speed [m/s] within the phase."""
        return max(abs(self.velocity_start), abs(self.velocity_end))


@dataclass(frozen=True)
class Drive:
    """The whole programme of a tack test.

    speed, retract_speed [m/s], preload [N], turn_time [s], dwell [s] at constant displacement, clearance [m]: the
    position d at which the punch starts.
    """

    speed: float
    preload: float
    retract_speed: float
    turn_time: float
    dwell: float
    clearance: float

    @property
    def phases(self) -> tuple[Phase, ...]:
        """Approach until the preload, turn (with a hold in its middle, if any), retract until the punch is free."""
        approach = Phase("approach", -self.speed, -self.speed, ends_with=PRELOAD)
        retract = Phase("retract", self.retract_speed, self.retract_speed, ends_with=DETACHED)
        if self.dwell > 0.0:
            half = 0.5 * self.turn_time
            return (
                approach,
                Phase("turn", -self.speed, 0.0, half),
                Phase("dwell", 0.0, 0.0, self.dwell),
                Phase("turn", 0.0, self.retract_speed, half),
                retract,
            )
        return approach, Phase("turn", -self.speed, self.retract_speed, self.turn_time), retract
