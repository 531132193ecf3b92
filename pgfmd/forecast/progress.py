"""Estimates of the progress of a run and of the remaining steps, from its scene and the end of its curve. No MPI.

The remaining steps are estimated from the travel of what is driven, the punch or the end of its spring, with a constant
number of steps per metre:

    left = (1 - p) ((1 - p) E + s)

p: completed fraction of the travel, in and out; s: steps so far; E: forecast of the steps of the whole run
(effort.effort_of). So the forecast dominates at the start, and the steps so far later. A slower punch takes more steps
per metre, as in the forecast. The indentation at the preload is that of the forecast until the force has risen; then it
follows from the slope of the force. Explicit steps have a constant length, so there time is used instead of travel.

In nine of ten cases this is right within a factor of two (tests/unit/test_status.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pgfmd.physics.adhesion.registry import clearance_of
from pgfmd.scene_objects import deepest_indentation, drive_of, machine_compliance
from pgfmd.schemes import registry

from .effort import effort_of
from .indentation import depth_at_preload, pull_off_force, pull_off_height

if TYPE_CHECKING:
    from pgfmd.scene import Scene


@dataclass(frozen=True)
class Moment:
    """The present state of a run. Phase, time [s], displacement [m], force [N] and step [s] as in a row of curve.csv.

    stiffness [N/m]: of the recent approach, None if the force has not risen. steps: so far; dwell_steps: those within
    the dwell. preload_time [s] and depth [m]: time of the preload and indentation there; None before, or if unknown.
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
    """progress: estimated completed fraction of the travel of what is driven. steps: estimated number of remaining steps, None if
    unknown. remark: why it is unknown, or what it does not include."""

    progress: float | None = None
    steps: float | None = None
    remark: str = ""


@dataclass(frozen=True)
class TravelProgress:
    """The travel [m], in and out, completed and remaining, of what is driven: the punch, or the end of its spring."""

    in_done: float
    in_left: float
    out_done: float
    out_left: float

    def share(self, out_weight: float = 1.0) -> float:
        """The completed fraction; a metre out counts as `out_weight` metres in."""
        done = self.in_done + out_weight * self.out_done
        return done / (done + self.in_left + out_weight * self.out_left)


def outlook(scene: Scene, moment: Moment) -> Outlook:
    """The estimate for a run in this state."""
    if moment.phase != "approach" and moment.depth is None:
        return Outlook(remark="where the preload was met is not known")
    travel = _travel(scene, moment)
    progress = travel.share()
    nearly = travel.out_left < clearance_of(scene.adhesion) or _pulls_a_soft_spring(scene, moment)
    if nearly and moment.phase == "retract":
        # The place of the last jump is not known better than this.
        return Outlook(progress, remark="the punch may come off at any moment")
    steps, remark = registry.scheme_of(scene).steps_left_of(scene, moment, travel)
    allowed = scene.solver.max_steps - moment.steps
    if steps > allowed:
        return Outlook(progress, max(0.0, allowed), "until solver.max_steps is reached")
    return Outlook(progress, steps, remark)


def _pulls_a_soft_spring(scene: Scene, moment: Moment) -> bool:
    """Whether the punch comes off when its spring is pulled enough, at a force that is hardly known."""
    travel = machine_compliance(scene) * pull_off_force(scene)
    return moment.force < 0.0 and travel > clearance_of(scene.adhesion)


def _travel(scene: Scene, moment: Moment) -> TravelProgress:
    clearance, position = scene.drive.clearance, moment.displacement
    # How far the spring is, and will be, pressed.
    spring, preload = machine_compliance(scene), scene.drive.preload
    now, most = spring * moment.force, spring * preload
    beyond = pull_off_height(scene) + (spring * pull_off_force(scene) if spring else 0.0)
    if moment.phase == "approach":
        depth = max(_depth_ahead(scene, moment), -position)
        left = depth + position + max(most - now, 0.0)
        return TravelProgress(clearance - position + now, left, 0.0, depth + most + beyond)
    assert moment.depth is not None, "`outlook` has seen to that"
    met = moment.depth + most
    back = met + position - now if moment.phase == "retract" else 0.0
    return TravelProgress(clearance + met, 0.0, max(back, 0.0), max(met + beyond - back, 0.0))


def _depth_ahead(scene: Scene, moment: Moment) -> float:
    """Expected indentation [m] at the preload."""
    forecast, preload = depth_at_preload(scene), scene.drive.preload
    if moment.stiffness is None or moment.stiffness <= 0.0:
        return forecast
    # The slope of the force is meaningless at first touch and best at the end: fast punches meet a stiffer elastomer.
    share = math.sqrt(min(max(moment.force / preload, 0.0), 1.0))
    ahead = -moment.displacement + max(preload - moment.force, 0.0) / moment.stiffness
    return min((1.0 - share) * forecast + share * ahead, deepest_indentation(scene))


def steps_by_travel(scene: Scene, moment: Moment, travel: TravelProgress) -> tuple[float, str]:
    """Remaining steps for schemes with an accuracy, and what they do not include."""
    drive = scene.drive
    viscous = scene.adhesion.attractive and scene.rheology.model != "elastic"
    share = travel.share(math.sqrt(drive.speed / drive.retract_speed) if viscous else 1.0)
    steps = (1.0 - share) * ((1.0 - share) * effort_of(scene).steps + moment.steps - moment.dwell_steps)
    if moment.phase == "dwell" and moment.preload_time is not None:
        return steps + _dwell_steps(scene, moment, moment.preload_time), ""
    coming = moment.preload_time is None or moment.time < moment.preload_time + drive.dwell
    return steps, f"and what the dwell of {drive.dwell:g} s takes" if coming and drive.dwell > 0.0 else ""


def _dwell_steps(scene: Scene, moment: Moment, since: float) -> float:
    """Steps to the end of the dwell, if they go on growing in proportion to its time. since [s]: when it began."""
    elapsed = max(moment.time - since - 0.5 * scene.drive.turn_time, moment.step)
    return elapsed / moment.step * math.log(max(scene.drive.dwell / elapsed, 1.0))


def time_left(scene: Scene, moment: Moment, travel: TravelProgress) -> float:
    """Time [s] until the punch detaches."""
    drive = drive_of(scene)
    left = travel.in_left / drive.speed + travel.out_left / drive.retract_speed
    if moment.phase == "approach":
        left += drive.turn_time + drive.dwell
    elif moment.phase != "retract" and moment.preload_time is not None:
        left += max(0.0, drive.turn_time + drive.dwell - (moment.time - moment.preload_time))
    return left
