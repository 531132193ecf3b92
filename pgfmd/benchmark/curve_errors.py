"""How far one force curve is from another, and what an error costs. Plain NumPy.

Errors of a curve against a reference, all dimensionless:
- force: rms of the difference of the forces over time, relative to a preload. Over the time
  in which either punch feels the surface, so that a longer way there makes no error smaller; after its end a curve
  stays at zero. Curves are straight between the ends of steps, so sampling a curve too coarsely counts as an error.
- area: the same of the contact area, relative to the reference's largest.
- pull_off, separation: relative error of the largest tensile force after the preload, and of the work of separation, as
  both runs tell them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pgfmd.results.curve import Array, Loop, work_of_separation

PULL_OFF = "pull_off_force_N"
"""Key of the pull-off force among the numbers that a run records (Loop.recorded)."""


@dataclass(frozen=True)
class Errors:
    """Errors of a curve, as the head of this module defines them."""

    force: float
    pull_off: float
    separation: float
    area: float


def errors(curve: Loop, reference: Loop, preload: float) -> Errors:
    """Errors of a curve against a reference; see the head of this module. preload: force [N] that others are shares of.

    Both tell their pull-off force (`PULL_OFF`).
    """
    return Errors(
        rms_difference(curve, reference, "force") / preload,
        _relative(curve.recorded[PULL_OFF], reference.recorded[PULL_OFF]),
        _relative(work_of_separation(curve), work_of_separation(reference)),
        rms_difference(curve, reference, "area") / float(reference.area.max()),
    )


def _relative(ours: float, theirs: float) -> float:
    return abs(ours - theirs) / abs(theirs) if theirs else (math.inf if ours else 0.0)


def rms_difference(curve: Loop, reference: Loop, what: str) -> float:
    """Rms of the difference of two curves over the time in which either feels a force; `what`: "force" or "area".

    Exact for the broken lines that the curves are; a curve that has ended stays at zero. In the unit of `what`.
    """
    first = min(_onset(curve), _onset(reference))
    last = max(curve.time[-1], reference.time[-1])
    instants = np.union1d(curve.time, reference.time)
    instants = np.concatenate(([first], instants[(instants > first) & (instants < last)], [last]))
    difference = _at(curve, what, instants) - _at(reference, what, instants)
    a, b = difference[:-1], difference[1:]
    # Of a straight line from a to b.
    squares = (a * a + a * b + b * b) / 3.0
    return float(np.sqrt(np.sum(np.diff(instants) * squares) / (last - first)))


def _onset(curve: Loop) -> float:
    """Time [s] of the last row before the first force."""
    acting = np.flatnonzero(curve.force)
    return float(curve.time[max(acting[0] - 1, 0)]) if acting.size else float(curve.time[0])


def _at(curve: Loop, what: str, instants: Array) -> Array:
    return np.interp(instants, curve.time, getattr(curve, what), right=0.0)


def richardson(coarse: Loop, fine: Loop, ratio: float, order: float = 1.0) -> Loop:
    """The limit of two curves whose errors go with a power `order` of a parameter that is `ratio` times smaller in
    `fine`, at each instant of `fine`: of forces, areas, pull-off force and work of separation."""
    weight = 1.0 / (ratio**order - 1.0)

    def limit(there: Any, here: Any) -> Any:
        return here + weight * (here - there)

    force, area = (limit(_at(coarse, what, fine.time), getattr(fine, what)) for what in ("force", "area"))
    recorded = {PULL_OFF: limit(coarse.recorded[PULL_OFF], fine.recorded[PULL_OFF])}
    separation = limit(work_of_separation(coarse), work_of_separation(fine))
    return replace(fine, force=force, area=area, recorded=recorded, separation=separation)


def cost_at(target: float, errors: Iterable[float], costs: Iterable[float]) -> float:
    """Smallest cost at which a line of settings reaches an error; infinite where it does not.

    Between the cheapest setting that reaches it and the next cheaper one, which does not, errors are taken as a power
    of the cost. Where the cheapest setting of all reaches it already, its cost is an upper bound.
    """
    points = sorted(zip(costs, errors, strict=True))
    for i, (cost, error) in enumerate(points):
        if error <= target:
            if i == 0 or error == 0.0:
                return cost
            before, above = points[i - 1]
            share = math.log(above / target) / math.log(above / error)
            return before * (cost / before) ** share
    return math.inf
