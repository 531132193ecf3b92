"""The loading programme: approach, turn round, hold, retract. Plain NumPy.

A programme is a list of phases, in each of which the punch's velocity changes linearly with time:

    d(t) = d_0 + v_0 t + (v_1 - v_0) t^2 / (2 T)        t counted from the start of the phase

A phase ends after its duration T, or, where it has none, with an event: the preload is reached, or the punch is free.
The turn-round is as smooth as in the paper ("Refinements and corrections"): the velocity goes from -v_1 to +v_2 over
the time T. Of it the punch spends T v_1/(v_1 + v_2) on going on, and the rest on coming back, so that it

    overshoots by  v_1^2 T / (2 (v_1 + v_2)),  and has risen by  v_2^2 T / (2 (v_1 + v_2))  at the end:

both v T/4 at equal speeds. A hold in the middle of the turn parts it in halves, and makes that v_1 T/4 and v_2 T/4.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

PRELOAD = "preload"
"""Event that ends the approach."""
DETACHED = "detached"
"""Event that ends the retraction, and with it the programme: the state, the tables and `run.json` then say so."""

OVERSHOOT = 0.02
"""Travel of the punch in the automatic turn before or after the deepest point, whichever is longer, in ranges of
adhesion."""


def automatic_turn(reach: float, speed: float, retract_speed: float) -> float:
    """Time [s] of a turn within which the punch overshoots, and rises, by at most `OVERSHOOT` ranges of adhesion.

    reach: the range [m]; speeds [m/s]. What follows the faster of the two: a surface that lets go does so at the speed
    that was asked for, and not on the way to it. T = 2 OVERSHOOT reach (v_1 + v_2) / max(v_1, v_2)^2, which a hold in
    the middle makes no longer.
    """
    slow, fast = sorted((speed, retract_speed))
    # Exactly 1 at equal speeds.
    share = 0.5 * (1.0 + slow / fast)
    return 4.0 * OVERSHOOT * reach / fast * share


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

    def recedes(self, elapsed: float) -> bool:
        """Whether the punch moves away from the surface, this long after the phase began, and to the end of the
        programme."""
        return self.velocity_end > 0.0 and self.velocity(elapsed) > 0.0


AT_REST = Phase("start", 0.0, 0.0)
"""What is before the programme: the punch is where it begins."""


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
    def overshoot(self) -> float:
        """How far [m] the punch goes on after the preload."""
        share = 0.25 if self.dwell > 0.0 else 0.5 * self.speed / (self.speed + self.retract_speed)
        return share * self.speed * self.turn_time

    @property
    def rise(self) -> float:
        """How far [m] above its deepest point the punch is when it has reached the speed of the retraction."""
        share = 0.25 if self.dwell > 0.0 else 0.5 * self.retract_speed / (self.speed + self.retract_speed)
        return share * self.retract_speed * self.turn_time

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
