"""Contact stiffness: slope of the force over the indentation, at the start of unloading and at other loads."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pgfmd.results.curve import Array, Loop

WINDOW = 0.1
"""Range of forces of a slope, as a fraction of the preload."""
SAMPLES = 65
FRACTIONS = (0.25, 0.5, 0.75)


@dataclass(frozen=True)
class Stiffness:
    """dF/d(indentation) [N/m] around a load [N] on a branch."""

    branch: str
    load: float
    stiffness: float


def unloading_stiffness(loop: Loop) -> Stiffness | None:
    """The slope at the start of the retraction: from the force there to a tenth of the preload below it.

    None if the loop has no retraction that goes so far.
    """
    if not loop.retracted:
        return None
    force, indentation = _from_the_turn(loop, "retraction")
    return _between(loop, "retraction", force, indentation, float(force[0]))


def stiffness_at(loop: Loop, branch: str, load: float) -> Stiffness | None:
    """The slope around `load` [N] on the "approach" or the "retraction", over a tenth of the preload.

    If the branch passes this load several times, the passage nearest to the turning point counts. None if it does not.
    """
    force, indentation = _from_the_turn(loop, branch)
    return _between(loop, branch, force, indentation, load + 0.5 * WINDOW * loop.preload)


def stiffness_table(loop: Loop) -> list[Stiffness]:
    """Slopes of both branches at a quarter, half and three quarters of the preload, and at zero load."""
    preload = loop.preload
    rows = [stiffness_at(loop, branch, part * preload) for branch in loop.branches for part in (0.0, *FRACTIONS)]
    return [row for row in rows if row is not None]


def _from_the_turn(loop: Loop, branch: str) -> tuple[Array, Array]:
    """Force and indentation of a branch, beginning at the turning point: the approach is read backwards."""
    if branch == "approach":
        rows = slice(0, loop.preload_row + 1)
        return loop.force[rows][::-1], loop.indentation[rows][::-1]
    # From where the drive has its full speed: within the turn the force changes while the punch hardly moves.
    steady = np.flatnonzero(loop.phase == "retract")
    rows = slice(max(int(steady[0]) - 1, 0) if steady.size else loop.turning_row, None)
    return loop.force[rows], loop.indentation[rows]


def _between(loop: Loop, branch: str, force: Array, indentation: Array, upper: float) -> Stiffness | None:
    """Least-squares slope over equal steps of the travel, from the force `upper` to a window below."""
    preload = loop.preload
    lower = upper - WINDOW * preload
    if preload <= 0.0 or len(force) < 2 or force[0] < upper * (1 - 1e-12):
        return None
    found = [_crossing(force, indentation, level) for level in (upper, lower)]
    places = [place for place in found if place is not None]
    if len(places) < 2 or places[0] == places[1]:
        return None
    travel = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(indentation)))))
    start, end = (np.interp(place, np.arange(len(travel)), travel) for place in places)
    samples = np.linspace(start, end, SAMPLES)
    # Equal steps of the travel, because rows may be few, or dense where the run took short steps.
    x, f = np.interp(samples, travel, indentation), np.interp(samples, travel, force)
    x = x - x.mean()
    if not np.any(x):
        return None
    return Stiffness(branch, 0.5 * (upper + lower), float(x @ f / (x @ x)))


def _crossing(force: Array, indentation: Array, level: float) -> float | None:
    """The first place, in rows, at which the force falls to `level`."""
    below = np.flatnonzero(force <= level)
    if not below.size:
        return None
    row = int(below[0])
    if row == 0:
        return 0.0
    return row - (level - force[row]) / (force[row - 1] - force[row])
