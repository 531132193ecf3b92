"""How far a run has come, and what is left of it: guesses from its scene and the end of its curve. No MPI, no fields.

What is left is counted in steps, of which a punch needs about as many for each metre of its way:

    left = (1 - p) ((1 - p) E + s)

p: share of the way, in and out, that is done; s: steps so far; E: steps of the whole run as estimated beforehand
(estimate.effort_of). So the estimate counts at the start, and later what the way behind has taken. Where the punch is
slower a metre takes more steps, as in the estimate. The depth at the preload is the estimated one until the force has
risen; then its slope tells. Explicit steps have one length: there the time counts.

Nine times out of ten this is right within a factor of two (tests/unit/test_status.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pgfmd.parts import deepest_indentation
from pgfmd.schemes import registry

from .effort import effort_of
from .indentation import depth_at_preload, pull_off_height

if TYPE_CHECKING:
    from pgfmd.scene import Scene


@dataclass(frozen=True)
class Moment:
    """Where a run is. Phase, time [s], displacement [m], force [N] and step length [s] as in a row of curve.csv.

    stiffness [N/m]: of the recent approach, None if the force has not risen. steps: so far; dwell_steps: those of them
    within the dwell. preload_time [s] and depth [m]: when the preload was met and the indentation there; None before,
    or if not known.
    """

    phase: str
    time: float
    displacement: float
    force: float
    step: float
    steps: int
    stiffness: float | None = None
    dwell_steps: int = 0
    preload_time: float | None = None
    depth: float | None = None


@dataclass(frozen=True)
class Outlook:
    """progress: about which share of the punch's way is done. steps: about how many are left, None if that can't be
    said. remark: why not, or what they leave out."""

    progress: float | None = None
    steps: float | None = None
    remark: str = ""


@dataclass(frozen=True)
class Way:
    """The punch's way [m], in and out, behind it and ahead of it."""

    in_done: float
    in_left: float
    out_done: float
    out_left: float

    def share(self, out_weight: float = 1.0) -> float:
        """What is done of it; a metre out counts as `out_weight` metres in."""
        done = self.in_done + out_weight * self.out_done
        return done / (done + self.in_left + out_weight * self.out_left)


def outlook(scene: Scene, moment: Moment) -> Outlook:
    """What is left of a run, from where it is."""
    if moment.phase != "approach" and moment.depth is None:
        return Outlook(remark="where the preload was met is not known")
    way = _way(scene, moment)
    progress = way.share()
    if way.out_left < scene.adhesion.range and moment.phase == "retract":
        # Estimates of the last jump are no better than this.
        return Outlook(progress, remark="the punch may come off at any moment")
    steps, remark = registry.scheme_of(scene).steps_left_of(scene, moment, way)
    allowed = scene.solver.max_steps - moment.steps
    if steps > allowed:
        return Outlook(progress, max(0.0, allowed), "until solver.max_steps is reached")
    return Outlook(progress, steps, remark)


def _way(scene: Scene, moment: Moment) -> Way:
    clearance, position = scene.drive.clearance, moment.displacement
    beyond = pull_off_height(scene)
    if moment.phase == "approach":
        depth = max(_depth_ahead(scene, moment), -position)
        return Way(clearance - position, depth + position, 0.0, depth + beyond)
    back = moment.depth + position if moment.phase == "retract" else 0.0
    return Way(clearance + moment.depth, 0.0, max(back, 0.0), max(moment.depth + beyond - back, 0.0))


def _depth_ahead(scene: Scene, moment: Moment) -> float:
    """Indentation [m] at which the preload is going to be met."""
    told, preload = depth_at_preload(scene), scene.drive.preload
    if moment.stiffness is None or moment.stiffness <= 0.0:
        return told
    # Force and slope tell nothing at first touch, and everything at the end: fast punches meet a stiffer elastomer.
    share = math.sqrt(min(max(moment.force / preload, 0.0), 1.0))
    ahead = -moment.displacement + max(preload - moment.force, 0.0) / moment.stiffness
    return min((1.0 - share) * told + share * ahead, deepest_indentation(scene))


def steps_by_way(scene: Scene, moment: Moment, way: Way) -> tuple[float, str]:
    """Steps that are left where their length follows the error, and what they leave out."""
    drive = scene.drive
    viscous = scene.adhesion.law != "repulsive" and scene.rheology.model != "elastic"
    share = way.share(math.sqrt(drive.speed / drive.retract_speed) if viscous else 1.0)
    steps = (1.0 - share) * ((1.0 - share) * effort_of(scene).steps + moment.steps - moment.dwell_steps)
    if moment.phase == "dwell" and moment.preload_time is not None:
        return steps + _dwell_steps(scene, moment), ""
    coming = moment.preload_time is None or moment.time < moment.preload_time + drive.dwell
    return steps, f"and what the dwell of {drive.dwell:g} s takes" if coming and drive.dwell > 0.0 else ""


def _dwell_steps(scene: Scene, moment: Moment) -> float:
    """Steps to the end of the dwell, if they go on growing in proportion to its time."""
    elapsed = max(moment.time - moment.preload_time - 0.5 * scene.drive.turn_time, moment.step)
    return elapsed / moment.step * math.log(max(scene.drive.dwell / elapsed, 1.0))


def time_left(scene: Scene, moment: Moment, way: Way) -> float:
    """Time [s] until the punch is off."""
    drive = scene.drive
    left = way.in_left / drive.speed + way.out_left / drive.retract_speed
    if moment.phase == "approach":
        left += drive.turn_time + drive.dwell
    elif moment.phase != "retract" and moment.preload_time is not None:
        left += max(0.0, drive.turn_time + drive.dwell - (moment.time - moment.preload_time))
    return left
