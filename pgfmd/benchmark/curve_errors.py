"""How far one force curve is from another, and what an error costs. Plain NumPy.

Errors of a curve against a reference, all dimensionless:
- force: rms of the difference of the forces over time, relative to the preload that the scene asks for. Over the time
  in which either punch feels the surface, so that a longer way there makes no error smaller; after its end a curve
  stays at zero. Curves are straight between the ends of steps, so sampling a curve too coarsely counts as an error.
- area: the same of the contact area, relative to the reference's largest.
- pull_off, separation: relative error of the largest tensile force after the preload, and of the work of separation.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Curve:
    """time [s], force [N], contact area [m^2] at the ends of steps, each (rows,); preload [N], as the scene asks for
    it; pull_off_force [N], > 0 in tension; work_of_separation [J]."""

    time: np.ndarray
    force: np.ndarray
    area: np.ndarray
    preload: float
    pull_off_force: float
    work_of_separation: float


@dataclass(frozen=True)
class Errors:
    """Errors of a curve, as the head of this module defines them."""

    force: float
    pull_off: float
    separation: float
    area: float


def errors(curve: Curve, reference: Curve) -> Errors:
    """Errors of a curve against a reference; see the head of this module."""
    return Errors(
        rms_difference(curve, reference, "force") / reference.preload,
        _relative(curve.pull_off_force, reference.pull_off_force),
        _relative(curve.work_of_separation, reference.work_of_separation),
        rms_difference(curve, reference, "area") / float(reference.area.max()),
    )


def _relative(ours: float, theirs: float) -> float:
    return abs(ours - theirs) / abs(theirs) if theirs else (math.inf if ours else 0.0)


def rms_difference(curve: Curve, reference: Curve, what: str) -> float:
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


def _onset(curve: Curve) -> float:
    """Time [s] of the last row before the first force."""
    acting = np.flatnonzero(curve.force)
    return float(curve.time[max(acting[0] - 1, 0)]) if acting.size else float(curve.time[0])


def _at(curve: Curve, what: str, instants: np.ndarray) -> np.ndarray:
    return np.interp(instants, curve.time, getattr(curve, what), right=0.0)


def richardson(coarse: Curve, fine: Curve, ratio: float, order: float = 1.0) -> Curve:
    """The limit of two curves whose errors go with a power `order` of a parameter that is `ratio` times smaller in
    `fine`, at each instant of `fine`."""
    weight = 1.0 / (ratio**order - 1.0)

    def limit(there, here):
        return here + weight * (here - there)

    force, area = (limit(_at(coarse, what, fine.time), getattr(fine, what)) for what in ("force", "area"))
    return Curve(
        fine.time, force, area, fine.preload, limit(coarse.pull_off_force, fine.pull_off_force),
        limit(coarse.work_of_separation, fine.work_of_separation),
    )  # fmt: skip


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
