"""Cost and progress of programmes of steps, roughly. No MPI.

A pair of an approach and a retraction is taken to cost as much as that of a simple tack test.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pgfmd.physics.programme import Following, Oscillation
from pgfmd.scene_objects import drive_of

if TYPE_CHECKING:
    from pgfmd.scene import Scene


@dataclass(frozen=True)
class ProgrammeSize:
    """loops: number of pairs of an approach and a retraction. steps: of oscillations and followed files, which have a
    known number. time [s]: of all phases with a known duration."""

    loops: float
    steps: float
    time: float


def size_of(scene: Scene) -> ProgrammeSize:
    """The size of a scene's programme. Raises MeasurementError or OSError for a file to follow that can't be read."""
    phases = drive_of(scene).phases
    travels = sum(math.isinf(phase.duration) for phase in phases)
    told = (phase for phase in phases if isinstance(phase, (Oscillation, Following)))
    steps = sum(phase.duration / phase.longest_step for phase in told)
    time = sum(phase.duration for phase in phases if math.isfinite(phase.duration))
    return ProgrammeSize(max(0.5 * travels, 0.5), steps, time)


def share_done(scene: Scene, cycle: int, stage: int) -> float:
    """About which share of the programme is over in a step of it: by the number of steps."""
    order = [(phase.cycle, phase.stage) for phase in drive_of(scene).phases]
    return order.index((cycle, stage)) / len(order) if (cycle, stage) in order else 0.0
