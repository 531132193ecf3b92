"""What a tack test measures: pull-off force, snap-in, work of separation, hysteresis.

Works are those that the run integrated, where it tells them; else, as of a measured curve, they come from the rows
(works.py). Forces come from the rows, which a filter may have changed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pgfmd.plots.folder import landmarks

from .loop import Loop
from .works import net_work_of_rows, separation_of_rows

UNEVEN, OVERSHOOT = 4.0, 0.25
"""A parabola through three rows is trusted if neither step is so many times longer than the other, and if its vertex lies
beyond the lowest row by no more than this share of the larger rise beside it."""
LEAST_TENSION = 1e-3
"""A tension is one from this share of the largest force on."""


@dataclass(frozen=True)
class Dip:
    """The lowest force of a branch: tension [N], positive, displacement [m] of the punch and time [s]."""

    tension: float
    displacement: float
    time: float


@dataclass(frozen=True)
class Measures:
    """Numbers of one loop; None where the loop has no such thing, or does not get there.

    largest_force [N], the preload and what the turn adds to it; pull_off and snap_in: lowest forces of the retraction,
    and of the approach before the preload. work_of_separation [J]: that the punch does while it goes up against a
    tensile force. hysteresis [J]: net work of the punch over all rows. largest_area [m^2]; area_at_pull_off [m^2].
    """

    largest_force: float | None
    pull_off: Dip | None
    snap_in: Dip | None
    work_of_separation: float | None
    hysteresis: float
    largest_area: float | None
    area_at_pull_off: float | None


def measure(loop: Loop) -> Measures:
    """The measures of a loop."""
    found = landmarks(loop.force, loop.phase)
    row = found.get("pull-off", _row_of_tension(loop))
    pull_off = dip(loop, row) if row is not None else None
    if pull_off and loop.tension is not None:
        pull_off = replace(pull_off, tension=loop.tension)
    area_there = float(loop.area[row]) if pull_off else None
    return Measures(
        largest_force=float(loop.force[found["preload"]]) if "preload" in found else None,
        pull_off=pull_off,
        snap_in=dip(loop, found["snap-in"]) if "snap-in" in found else None,
        work_of_separation=work_of_separation(loop) if loop.retracted else None,
        hysteresis=net_work(loop),
        largest_area=_known(np.max(loop.area)),
        area_at_pull_off=_known(area_there),
    )


def _row_of_tension(loop: Loop) -> int | None:
    """The row nearest to a pull-off that the run knows of, where all rows under tension are left out of the curve."""
    if not loop.retracted or (loop.tension or 0.0) <= LEAST_TENSION * np.max(np.abs(loop.force)):
        return None
    rows = loop.branches["retraction"]
    return rows.start + int(np.argmin(loop.force[rows]))


def _known(value: float | None) -> float | None:
    return None if value is None or np.isnan(value) else float(value)


def dip(loop: Loop, row: int) -> Dip:
    """The lowest force near its lowest row, by the parabola in the displacement through that row and its neighbours.

    The row itself where it has a jump beside it, is at an end, or the punch turns round there: no parabola belongs to
    these.
    """
    alone = Dip(-float(loop.force[row]), float(loop.displacement[row]), float(loop.time[row]))
    if not 0 < row < len(loop.force) - 1 or loop.jump[row] or loop.jump[row + 1]:
        return alone
    rows = slice(row - 1, row + 2)
    x, f = loop.displacement[rows] - loop.displacement[row], loop.force[rows]
    if not np.all(np.diff(x) * np.sign(x[2] - x[0]) > 0):
        return alone
    left, right = (f[1] - f[0]) / (x[1] - x[0]), (f[2] - f[1]) / (x[2] - x[1])
    curvature = (right - left) / (x[2] - x[0])
    if curvature <= 0.0 or max(abs(x[1] - x[0]), abs(x[2] - x[1])) > UNEVEN * min(abs(x[1] - x[0]), abs(x[2] - x[1])):
        return alone
    place = 0.5 * (x[0] + x[1]) - left / (2.0 * curvature)
    depth = f[1] + place * (left + curvature * (place - x[0]))
    if f[1] - depth > OVERSHOOT * max(f[0] - f[1], f[2] - f[1]):
        return alone
    when = float(np.interp(place, np.sort(x), loop.time[rows][np.argsort(x)]))
    return Dip(-float(depth), float(loop.displacement[row] + place), when)


def net_work(loop: Loop) -> float:
    """Work of the punch [J] over the loop: as the run integrated it, or else from the rows."""
    return net_work_of_rows(loop) if loop.work is None else loop.work


def work_of_separation(loop: Loop) -> float:
    """Work [J] that the punch does while it goes up against a tensile force; of a step through zero force the part
    under tension.

    `work_of_separation_J` of `run.json`, or the same from the rows where there is none.
    """
    return separation_of_rows(loop) if loop.separation is None else loop.separation
