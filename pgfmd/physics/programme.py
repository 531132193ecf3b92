"""Programmes of any steps: approach, hold, retract, ramp, oscillate, follow, and repeats of them. Plain NumPy.

`phases_of` turns the steps into phases (drive.py), with smooth turns between steps whose velocities differ. Where the
machine changes from displacement to load or back, or a load has torn off the punch, the punch stays where it is, and its
velocity is not given: there is no turn from what was before.

Under load control the drive is the far end of a soft spring of compliance c, so a load rate R is a velocity of the
drive,  -R (c + 1/k)  with the stiffness k of the contact: 1/(c k) is the small share of R that this depends on k.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from .drive import (
    AREA,
    DETACHED,
    DISPLACEMENT,
    FORCE,
    LOAD,
    PLACE,
    PRELOAD,
    TRAVEL,
    Ending,
    Phase,
    automatic_turn,
)  # fmt: skip

POINTS_A_CYCLE = 64
"""Fewest steps in a cycle of an oscillation."""
STEEPEST = 1.5
"""Largest rate of the envelope of an oscillation, per cycle."""
ENDS = 2.0
"""Cycles of an oscillation in which its amplitude rises and falls."""


@dataclass(frozen=True)
class Winding(Phase):
    """A phase in which the drive may go both ways."""

    def recedes(self, elapsed: float) -> bool:
        """Whether the drive moves up at this time [s] after the start of the phase."""
        return self.velocity(elapsed) > 0.0

    @property
    def may_let_go(self) -> bool:
        """Whether the punch may come off in this phase."""
        return True


@dataclass(frozen=True)
class Oscillation(Winding):
    """A phase in which the drive oscillates about its position, at first inward: D = D_0 - A e(t) sin(omega t).

    amplitude [m]: A, of the drive; swing [m]: of the punch, about. frequency [Hz]. The envelope e rises smoothly from 0 to
    1 in the first cycle, and falls back in the last one, so that the drive starts and ends at rest: full cycles are all
    but these two.
    """

    amplitude: float = 0.0
    frequency: float = 1.0
    swing: float = 0.0

    @property
    def small_travel(self) -> float:
        """The amplitude of the punch [m], about: solves have to tell parts of it."""
        return self.swing

    def displacement(self, elapsed: float) -> float:
        """Displacement [m] of the drive since the start of the phase."""
        return -self.amplitude * self._envelope(elapsed)[0] * math.sin(2.0 * math.pi * self.frequency * elapsed)

    def velocity(self, elapsed: float) -> float:
        """Velocity [m/s] of the drive at this time [s] after the start of the phase."""
        omega = 2.0 * math.pi * self.frequency
        size, rate = self._envelope(elapsed)
        return -self.amplitude * (size * omega * math.cos(omega * elapsed) + rate * math.sin(omega * elapsed))

    def _envelope(self, elapsed: float) -> tuple[float, float]:
        """The envelope, and its rate of change [1/s]."""
        left = self.duration - elapsed
        x = min(self.frequency * min(elapsed, left), 1.0)
        rate = 6.0 * x * (1.0 - x) * self.frequency
        return x * x * (3.0 - 2.0 * x), rate if elapsed < left else -rate

    @property
    def fastest(self) -> float:
        """The largest speed [m/s] within the phase, and a little more."""
        return (2.0 * math.pi + STEEPEST) * self.frequency * self.amplitude

    @property
    def longest_step(self) -> float:
        """Longest step [s]."""
        return 1.0 / (POINTS_A_CYCLE * self.frequency)


@dataclass(frozen=True)
class Path:
    """Positions [m] of a drive at times [s], of shape (rows,), and what lies between: a monotone cubic through each
    three of them (PCHIP), whose velocity is continuous.

    Source: F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300, by SciPy.
    """

    times: tuple[float, ...]
    places: tuple[float, ...]

    @cached_property
    def _curve(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        # Not at the top: only scenes with a measured path need it.
        from scipy.interpolate import PchipInterpolator

        found = PchipInterpolator(self.times, self.places)
        return np.asarray(found.x), np.asarray(found.c)

    def _piece(self, time: float) -> tuple[float, NDArray[np.float64]]:
        """Time [s] since the last knot, and the coefficients of the cubic there, highest power first."""
        knots, coefficients = self._curve
        k = min(max(int(np.searchsorted(knots, time, "right")) - 1, 0), len(knots) - 2)
        return time - float(knots[k]), coefficients[:, k]

    def place(self, time: float) -> float:
        """Position [m] at a time [s]."""
        t, (a, b, c, d) = self._piece(time)
        return float(((a * t + b) * t + c) * t + d)

    def velocity(self, time: float) -> float:
        """Velocity [m/s] at a time [s]."""
        t, (a, b, c, _) = self._piece(time)
        return float((3.0 * a * t + 2.0 * b) * t + c)

    @cached_property
    def spacing(self) -> float:
        """The usual distance of the times [s]."""
        return float(np.median(np.diff(self.times)))

    @cached_property
    def fastest(self) -> float:
        """The largest speed [m/s]: at a knot, or where the acceleration of a piece is zero."""
        knots, (a, b, c, _) = self._curve
        spans = np.diff(knots)
        with np.errstate(divide="ignore", invalid="ignore"):
            still = np.where(a != 0.0, -b / (3.0 * a), 0.0)
        still = np.clip(np.nan_to_num(still), 0.0, spans)
        speeds = [np.abs((3.0 * a * t + 2.0 * b) * t + c).max() for t in (0.0 * spans, still, spans)]
        return float(max(speeds))


@dataclass(frozen=True)
class Following(Winding):
    """A phase in which the drive follows a path from where it is. first [N]: of a load to follow, what the punch has to
    carry at the start; NaN for a displacement, which is counted from where the punch is."""

    path: Path = Path((0.0, 1.0), (0.0, 0.0))
    first: float = math.nan

    def displacement(self, elapsed: float) -> float:
        """Displacement [m] of the drive since the start of the phase."""
        return self.path.place(elapsed)

    def velocity(self, elapsed: float) -> float:
        """Velocity [m/s] of the drive at this time [s] after the start of the phase."""
        return self.path.velocity(elapsed)

    @property
    def fastest(self) -> float:
        """The largest speed [m/s] within the phase."""
        return self.path.fastest

    @property
    def starts_at(self) -> float:
        """The force [N] that the punch has to carry at the start; NaN for any."""
        return self.first

    @property
    def longest_step(self) -> float:
        """Longest step [s]: the usual distance of the rows."""
        return self.path.spacing


@dataclass(frozen=True)
class Step:
    """A step of a programme.

    do: "approach", "hold", "retract", "ramp", "oscillate" or "follow". control: of displacement or load. rate: of the
    displacement [m/s] or of the load [N/s]; positive where the punch is pressed in. duration [s]: or infinity. until:
    pairs of a quantity and its value [N, m or m^2], or of DETACHED. amplitude [m or N], frequency [Hz], cycles: of an
    oscillation. table: times [s] and displacements [m] or loads [N] to follow. turn_time [s]: of the turn before the
    step; None for the automatic one.
    """

    do: str
    control: str
    rate: float = 0.0
    duration: float = math.inf
    until: tuple[tuple[str, float], ...] = ()
    amplitude: float = 0.0
    frequency: float = 1.0
    cycles: float = 0.0
    table: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
    turn_time: float | None = None

    @property
    def is_free(self) -> bool:
        """Whether the step lasts until the punch is free."""
        return (DETACHED, 0.0) in self.until


@dataclass(frozen=True)
class Machine:
    """What a programme needs to know of its machine. soft [m/N]: compliance of the spring that controls a load;
    stiffness [N/m]: of the contact of the whole punch, about; reach [m]: range of adhesion; timeless: whether time is
    only a measure of travel, so that nothing is held; settled [s]: time after which nothing moves any more."""

    soft: float
    stiffness: float
    reach: float
    timeless: bool = False
    settled: float = 1.0

    @property
    def ahead(self) -> float:
        """How many times farther the drive goes than the punch, if a load is controlled."""
        return 1.0 + self.soft * self.stiffness

    def drive_velocity(self, control: str, rate: float) -> float:
        """Velocity [m/s] of the drive, for a rate of displacement [m/s] or load [N/s], positive inward."""
        return -rate if control == DISPLACEMENT else -rate / self.stiffness * self.ahead

    def punch_speed(self, control: str, velocity: float) -> float:
        """Speed [m/s] of the punch in contact, about."""
        return abs(velocity) / (1.0 if control == DISPLACEMENT else self.ahead)


@lru_cache(maxsize=16)
def phases_of(
    steps: tuple[Step, ...], machine: Machine, times: int = 1, first: int = 1, last: int | None = None
) -> tuple[Phase, ...]:
    """The phases of a programme, in which the steps from `first` to `last`, counted from 1, are done so many times."""
    found: list[Phase] = []
    # There may be many cycles: what they share, such as a path, is made once.
    alike: dict[int, Phase] = {}
    velocity, control = 0.0, ""
    order = list(_order(len(steps), times, first, last or len(steps)))
    for cycle, number in order:
        step = steps[number - 1]
        if machine.timeless and step.do == "hold":
            continue
        if number not in alike:
            alike[number] = _phase_of(step, machine, cycle, number)
        phase = replace(alike[number], cycle=cycle)
        if found:
            before = velocity if control == step.control else 0.0
            # A turn before a file would shift all of it.
            if before != phase.velocity_start and step.do != "follow":
                found.append(_turn(before, phase, step, machine))
        found.append(phase)
        velocity, control = phase.velocity_end, step.control
        if control == LOAD and step.is_free:
            # The load that has torn off the punch is gone: going on with its rate would fling the punch away.
            velocity = 0.0
    _without_passed_preloads(found)
    for k in reversed(range(len(found))):
        if not _only_out(found[k]):
            # Up to here the punch comes back; after this, a punch that is free stays so.
            found[: k + 1] = [replace(phase, final=False) for phase in found[: k + 1]]
            break
    return tuple(found)


def _without_passed_preloads(phases: list[Phase]) -> None:
    """A step that presses the punch in ends with the preload only if the next one does not press it in further."""
    for k, phase in enumerate(phases[:-1]):
        following = next((later for later in phases[k + 1 :] if later.name != "turn"), None)
        if phase.ends_with == PRELOAD and following is not None and following.velocity_end < 0.0:
            phases[k] = replace(phase, ends_with="")


def _order(count: int, times: int, first: int, last: int) -> Iterator[tuple[int, int]]:
    """Cycle and number of the steps in the order in which they are done."""
    yield from ((1, number) for number in range(1, first))
    yield from ((cycle, number) for cycle in range(1, times + 1) for number in range(first, last + 1))
    yield from ((times, number) for number in range(last + 1, count + 1))


def _only_out(phase: Phase) -> bool:
    """Whether a phase retracts, or holds a load, and nothing else."""
    return phase.may_let_go and not isinstance(phase, Winding)


def _turn(before: float, phase: Phase, step: Step, machine: Machine) -> Phase:
    """The turn before a phase, from a velocity [m/s] of the drive."""
    speeds = (machine.punch_speed(phase.control, velocity) for velocity in (before, phase.velocity_start))
    time = step.turn_time if step.turn_time is not None else automatic_turn(machine.reach, *speeds)
    return Phase(
        "turn", before, phase.velocity_start, time, control=phase.control, cycle=phase.cycle, stage=phase.stage
    )


def _phase_of(step: Step, machine: Machine, cycle: int, number: int) -> Phase:
    """The phase of a step."""
    control, endings = step.control, _endings(step)
    if step.do == "oscillate":
        return Oscillation(
            step.do, 0.0, 0.0, (step.cycles + ENDS) / step.frequency, control=control, cycle=cycle, stage=number,
            amplitude=abs(machine.drive_velocity(control, step.amplitude)), frequency=step.frequency,
            swing=step.amplitude / (1.0 if control == DISPLACEMENT else machine.stiffness),
        )  # fmt: skip
    if step.do == "follow":
        times, values = (np.array(column) for column in step.table)
        sign = 1.0 if control == DISPLACEMENT else machine.drive_velocity(control, 1.0)
        path = Path(tuple((times - times[0]).tolist()), tuple((sign * (values - values[0])).tolist()))
        ends = path.velocity(0.0), path.velocity(path.times[-1])
        return Following(
            step.do,
            *ends,
            path.times[-1],
            endings=endings,
            control=control,
            cycle=cycle,
            stage=number,
            path=path,
            first=float(values[0]) if control == LOAD else math.nan,
        )
    name, velocity = step.do, machine.drive_velocity(control, step.rate)
    if step.do == "hold":
        name, velocity = "dwell" if control == DISPLACEMENT else "hold", 0.0
    # Where a step stops pressing the punch in is the preload, whatever ends it.
    ends_with = PRELOAD if step.rate > 0.0 else DETACHED if step.is_free else ""
    waits = step.do == "hold" and math.isinf(step.duration)
    duration = machine.settled if waits else step.duration
    return Phase(
        name, velocity, velocity, duration, ends_with, endings, control, settles=waits, cycle=cycle, stage=number
    )


def _endings(step: Step) -> tuple[Ending, ...]:
    """The endings of a step, whose values are reached from the side that it comes from."""
    inward = (step.rate > 0.0) - (step.rate < 0.0)
    signs = {FORCE: inward, AREA: inward, PLACE: -inward, TRAVEL: 1}
    return tuple(Ending(quantity, value, signs[quantity]) for quantity, value in step.until if quantity in signs)
