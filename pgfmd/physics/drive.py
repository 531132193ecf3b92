"""The phases of a loading programme, and the short one: approach, turn, hold, retract. Plain NumPy.

A programme is a list of phases, in each of which the velocity of the drive changes linearly with time, unless it
oscillates or follows a table (programme.py):

    D(t) = D_0 + v_0 t + (v_1 - v_0) t^2 / (2 T)        t counted from the start of the phase

The drive moves the punch, or the machine's end of its spring; a load is controlled by a very soft spring. A phase ends
after its duration T, or with the first of its endings: a force, a displacement or a contact area is reached, or the
punch detaches. The turn is as smooth as in the paper ("Refinements and corrections"): the velocity changes from -v_1 to +v_2 in the
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
COMPLETED = "completed"
"""How a programme ends whose last step is not a retraction until the punch is free."""
ENDED_WELL = (DETACHED, COMPLETED)
"""How a run ends that has done its programme."""
STEP_END = "step end"
"""Event at the end of a step of a programme that is neither the preload nor the end of the run."""
DISPLACEMENT, LOAD = "displacement", "load"
"""What the machine controls in a phase."""

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


FORCE, PLACE, TRAVEL, AREA = "force", "displacement", "travel", "contact area"
"""Quantities whose value may end a phase: force on the punch, its displacement, its travel within the phase, contact
area."""


@dataclass(frozen=True)
class Ending:
    """A value that ends a phase: the quantity, the value [N, m or m^2], and whether it is reached from below (1), from above
    (-1), or from where it is at the start of the phase (0)."""

    quantity: str
    value: float
    sign: int


@dataclass(frozen=True)
class Phase:
    """One phase. name: as in curve.csv. velocity_start, velocity_end [m/s]: of the drive. duration [s]: or infinity.
    ends_with: the event that ends it, if not its duration. endings: values of which the first that is reached ends it.
    control: what the machine controls. final: whether the run ends if the punch detaches. settles:
    whether its duration is that after which nothing moves any more, because only a value was to end it. cycle, stage: numbers of the
    repeat and of the step of the programme, from 1."""

    name: str
    velocity_start: float
    velocity_end: float
    duration: float = math.inf
    ends_with: str = ""
    endings: tuple[Ending, ...] = ()
    control: str = DISPLACEMENT
    final: bool = True
    settles: bool = False
    cycle: int = 1
    stage: int = 1

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

    @property
    def small_travel(self) -> float:
        """A travel of the punch [m] that matters in this phase, if it may be small compared with the range of adhesion, as
        the amplitude of an oscillation; infinity for none."""
        return math.inf

    @property
    def starts_at(self) -> float:
        """The force [N] that the punch has to carry at the start; NaN for any."""
        return math.nan

    @property
    def longest_step(self) -> float:
        """Longest step [s] that still tells the motion of the drive; infinity where its velocity is linear in time."""
        return math.inf

    @property
    def may_let_go(self) -> bool:
        """Whether the punch may come off in this phase: it ends with the drive moving up, or holds a load."""
        return self.velocity_end > 0.0 or self.holds_load

    @property
    def holds_load(self) -> bool:
        """Whether the load is held, so that a punch under tension comes off by itself."""
        return self.control == LOAD and self.velocity_start == self.velocity_end == 0.0

    def recedes(self, elapsed: float) -> bool:
        """Whether the drive moves up from this time [s] after the start of the phase to its end."""
        return self.velocity_end > 0.0 and self.velocity(elapsed) > 0.0


AT_REST = Phase("start", 0.0, 0.0)
"""The state before the programme, with the punch at its first position."""


@dataclass(frozen=True)
class Drive:
    """The whole programme of a tack test.

    speed, retract_speed [m/s], preload [N], turn_time [s], dwell [s] at constant displacement, clearance [m]: the
    position d at which the punch starts. control: what the machine controls. programme: phases instead of those of
    approach, dwell and retraction; speeds and preload are then those that stand for it (scene/programme_section.py).
    """

    speed: float
    preload: float
    retract_speed: float
    turn_time: float
    dwell: float
    clearance: float
    control: str = DISPLACEMENT
    programme: tuple[Phase, ...] = ()

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
        """Approach up to the preload, turn (optionally with a hold in the middle), retract until the punch detaches; or
        the phases of the programme."""
        if self.programme:
            return self.programme
        preload, control, speed, out = (Ending(FORCE, self.preload, 1),), self.control, self.speed, self.retract_speed
        approach = Phase("approach", -speed, -speed, ends_with=PRELOAD, endings=preload, control=control)
        if self.dwell > 0.0:
            half = 0.5 * self.turn_time
            return (
                approach,
                Phase("turn", -speed, 0.0, half, control=control, stage=2),
                Phase("dwell", 0.0, 0.0, self.dwell, control=control, stage=2),
                Phase("turn", 0.0, out, half, control=control, stage=3),
                Phase("retract", out, out, ends_with=DETACHED, control=control, stage=3),
            )
        return (
            approach,
            Phase("turn", -speed, out, self.turn_time, control=control, stage=2),
            Phase("retract", out, out, ends_with=DETACHED, control=control, stage=2),
        )
