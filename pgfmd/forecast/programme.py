"""Cost and progress of programmes of steps, roughly. No MPI.

A pair of an approach and a retraction is taken to cost as much as that of a simple tack test.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pgfmd.physics.programme import Winding
from pgfmd.scene_objects import drive_of

from .indentation import travels_of

if TYPE_CHECKING:
    from pgfmd.scene import Scene


@dataclass(frozen=True)
class ProgrammeSize:
    """loops: number of pairs of an approach and a retraction. steps: of oscillations and followed files, which have a
    known number. time [s]: of all phases with a known duration. stages: number of
    steps of the programme, repeats included."""

    loops: float
    steps: float
    time: float
    stages: int


def size_of(scene: Scene) -> ProgrammeSize:
    """The size of a scene's programme. Raises MeasurementError or OSError for a file to follow that can't be read."""
    phases = drive_of(scene).phases
    travels = sum(math.isinf(phase.duration) for phase in phases)
    told = (phase for phase in phases if isinstance(phase, Winding))
    steps = sum(phase.duration / phase.longest_step for phase in told)
    time = sum(phase.duration for phase in phases if math.isfinite(phase.duration))
    stages = sum(phase.name != "turn" for phase in phases)
    return ProgrammeSize(max(0.5 * travels, 0.5), steps, time, stages)


def share_done(scene: Scene, cycle: int, stage: int) -> float:
    """About which share of the programme is over in a step of it: by the number of steps."""
    order = [(phase.cycle, phase.stage) for phase in drive_of(scene).phases]
    return order.index((cycle, stage)) / len(order) if (cycle, stage) in order else 0.0


def snapshot_count(scene: Scene) -> int:
    """About how many snapshots a run writes, beside those at the preload and at the largest tension."""
    output, count = scene.output, float(len(scene.output.snapshot_times))
    if not output.rhythms:
        return round(count)
    size = size_of(scene)
    into, out = travels_of(scene)
    loops = size.loops if scene.drive.step else 1.0
    known = size.time if scene.drive.step else scene.drive.dwell
    extents = {
        "displacement": loops * (into.length + out.length),
        "force": loops * 2.0 * scene.drive.preload,
        "time": loops * (into.time + out.time) + known,
        "t_pl": 1.0 + (out.time + known) / max(into.time, 1e-300),
        "step ends": float(size.stages),
    }
    for rhythm in output.rhythms:
        count += extents[rhythm.kind] / (rhythm.size or 1.0)
    return math.ceil(count)
