"""The loading programme: approach, turn, hold, retract. Plain NumPy.

A programme is a list of phases, in each of which the punch's velocity changes linearly with time:

    d(t) = d_0 + v_0 t + (v_1 - v_0) t^2 / (2 T)        t counted from the start of the phase

A phase ends after its duration T, or, without a duration, with an event: the preload is reached, or the punch detaches.
The turn is as smooth as in the paper ("Refinements and corrections"): the velocity changes from -v_1 to +v_2 in the
time T. The punch moves on for T v_1/(v_1 + v_2), and up in the rest of the time, so that it

    overshoots by  v_1^2 T / (2 (v_1 + v_2)),  and has risen by  v_2^2 T / (2 (v_1 + v_2))  at the end:

both v T/4 at equal speeds. With a hold in the middle of the turn these are v_1 T/4 and v_2 T/4.
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

    reach: the range [m]; speeds [m/s]. T = 2 OVERSHOOT reach (v_1 + v_2) / max(v_1, v_2)^2, also with a hold in the
    middle. It follows the faster of the two speeds, so that the surface detaches at the full speed of the retraction.
    """
    slow, fast = sorted((speed, retract_speed))
    # Exactly 1 at equal speeds.
    share = 0.5 * (1.0 + slow / fast)
    return 4.0 * OVERSHOOT * reach / fast * share


@dataclass(frozen=True)
class Phase:
    """One phase: name as in curve.csv, velocities [m/s] at its start and end, duration [s] or infinity, and the event
    that ends it."""

    name: str
    velocity_start: float
    velocity_end: float
    duration: float = math.inf
    ends_with: str = ""

    def displacement(self, elapsed: float) -> float:
        """Displacement [m] of the punch since the start of the phase."""
        if math.isinf(self.duration):
            return self.velocity_start * elapsed
        acceleration = (self.velocity_end - self.velocity_start) / self.duration
        return (self.velocity_start + 0.5 * acceleration * elapsed) * elapsed

    def velocity(self, elapsed: float) -> float:
        """Velocity [m/s] of the punch at this time [s] after the start of the phase."""
        if math.isinf(self.duration):
            return self.velocity_start
        return self.velocity_start + (self.velocity_end - self.velocity_start) * elapsed / self.duration

    @property
    def fastest(self) -> float:
        """The largest speed [m/s] within the phase."""
        return max(abs(self.velocity_start), abs(self.velocity_end))

    def recedes(self, elapsed: float) -> bool:
        """Whether the punch moves up from this time [s] after the start of the phase to the end of the programme."""
        return self.velocity_end > 0.0 and self.velocity(elapsed) > 0.0


AT_REST = Phase("start", 0.0, 0.0)
"""The state before the programme, with the punch at its first position."""


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
        """Travel [m] of the punch after the preload."""
        share = 0.25 if self.dwell > 0.0 else 0.5 * self.speed / (self.speed + self.retract_speed)
        return share * self.speed * self.turn_time

    @property
    def rise(self) -> float:
        """Height [m] above the deepest point at which the punch reaches the speed of the retraction."""
        share = 0.25 if self.dwell > 0.0 else 0.5 * self.retract_speed / (self.speed + self.retract_speed)
        return share * self.retract_speed * self.turn_time

    @property
    def phases(self) -> tuple[Phase, ...]:
        """Approach up to the preload, turn (optionally with a hold in the middle), retract until the punch detaches."""
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
