"""What a tack test measures, defined once for all commands: forces, works, areas (docs: reference, "Numbers").

A run that has ended says its forces and works itself, in `run.json`: it knows what happened within its steps. What has
to be read off rows (of a run that goes on, a measured or a filtered curve) is found here by the same definitions.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from . import uncertainty
from .loop import Array, Loop
from .works import net_work_of_rows, separation_of_rows

UNEVEN = 4.0
"""A parabola through three rows is trusted if neither step is so many times longer than the other."""
OVERSHOOT = 0.25
"""It is trusted if its vertex lies beyond the lowest row by no more than this share of the larger rise beside it."""
LEAST_TENSION = 1e-3
"""A tension is marked in a picture from this share of the largest force on."""
BETWEEN_ROWS = 0.5
"""Uncertainty of a force that is read off rows, as a share of the larger rise beside the lowest one."""


@dataclass(frozen=True)
class Dip:
    """The lowest force of a branch: tension [N], positive, or 0 where it is a compression; displacement [m] of the
    punch and time [s]; uncertainty [N] of the tension, None where it is not known."""

    tension: float
    displacement: float
    time: float
    uncertainty: float | None = None


@dataclass(frozen=True)
class Areas:
    """An area [m^2] at the end of the approach, at its largest, and in the row nearest to the pull-off; None where the
    loop does not get there."""

    at_preload: float | None
    largest: float
    at_pull_off: float | None


@dataclass(frozen=True)
class Measures:
    """Numbers of one loop; None where the loop has no such thing, or does not get there.

    preload [N]: force at the end of the approach. largest_force [N]: at any row, what the turn adds included; None
    without compression. time_to_preload [s], from the first contact. pull_off: lowest force of the retraction, from
    where the punch turns round; snap_in: that of the approach. work_of_separation [J]: that the punch does while it
    goes up against a tensile force. hysteresis [J]: net work of the punch over all rows. areas: by what they are, of
    "contact", "overlap" and "near" those that are known. *_uncertainty: of a work [J].
    """

    preload: float | None
    largest_force: float | None
    time_to_preload: float | None
    pull_off: Dip | None
    snap_in: Dip | None
    work_of_separation: float | None
    hysteresis: float
    areas: Mapping[str, Areas]
    work_of_separation_uncertainty: float | None = None
    hysteresis_uncertainty: float | None = None

    @property
    def largest_area(self) -> float | None:
        """The largest contact area [m^2]; None where contact is not known."""
        return self.areas["contact"].largest if "contact" in self.areas else None

    @property
    def area_at_pull_off(self) -> float | None:
        """The contact area [m^2] in the row nearest to the pull-off; None where contact is not known."""
        return self.areas["contact"].at_pull_off if "contact" in self.areas else None

    @property
    def landmarks(self) -> dict[str, Dip]:
        """What a picture marks: "pull-off" and "snap-in", each if it is a tension worth the name."""
        size = max(self.largest_force or 0.0, *(dip.tension for dip in (self.pull_off, self.snap_in) if dip), 0.0)
        found = {"pull-off": self.pull_off, "snap-in": self.snap_in}
        return {name: dip for name, dip in found.items() if dip and dip.tension > LEAST_TENSION * size}


def measure(loop: Loop) -> Measures:
    """The measures of a loop."""
    pull_off, row = None, None
    if loop.retracted:
        row = loop.turning_row + int(np.argmin(loop.force[loop.turning_row :]))
        pull_off = _tension(loop, row, "pull_off_force")
    snap = int(np.argmin(loop.force[: loop.preload_row + 1]))
    largest = loop.told.get("largest_force_N", float(np.max(loop.force)))
    return Measures(
        preload=loop.preload if loop.met_preload else None,
        largest_force=largest if largest > 0.0 else None,
        time_to_preload=_time_to_preload(loop),
        pull_off=pull_off,
        snap_in=_tension(loop, snap, "snap_in_force"),
        work_of_separation=work_of_separation(loop) if loop.retracted else None,
        hysteresis=net_work(loop),
        areas={kind: _areas(area, loop, row) for kind, area in loop.areas.items()},
        work_of_separation_uncertainty=loop.told.get("work_of_separation_uncertainty_J"),
        hysteresis_uncertainty=loop.told.get("work_uncertainty_J"),
    )


def _areas(area: Array, loop: Loop, pull_off_row: int | None) -> Areas:
    at_preload = float(area[loop.preload_row]) if loop.met_preload else None
    return Areas(at_preload, float(np.max(area)), float(area[pull_off_row]) if pull_off_row is not None else None)


def _tension(loop: Loop, row: int, key: str) -> Dip:
    """The tension at the lowest row of a branch: what the run says (by its key, without unit), or else by rows."""
    found = dip(loop, row)
    told = loop.told.get(f"{key}_N")
    if told is not None:
        # Records of version 0.1 have no uncertainties.
        spread = uncertainty.of_force(told, min(told, -float(loop.force[row])), loop.share)
        return replace(found, tension=told, uncertainty=loop.told.get(f"{key}_uncertainty_N", _known(spread)))
    spread = loop.share * abs(found.tension) + BETWEEN_ROWS * _rise_beside(loop, row)
    # Of a compression only what goes below zero is a tension.
    spread = max(0.0, spread + min(found.tension, 0.0)) if not math.isnan(spread) else spread
    if row == len(loop.force) - 1:
        # Nobody knows yet how far down it goes.
        spread = math.nan
    return replace(found, tension=max(found.tension, 0.0) + 0.0, uncertainty=_known(spread))


def _rise_beside(loop: Loop, row: int) -> float:
    """The larger rise [N] from a row to its neighbours, jumps left out."""
    sides = [(row - 1, loop.jump[row]), *([(row + 1, loop.jump[row + 1])] if row + 1 < len(loop.force) else [])]
    rises = [loop.force[other] - loop.force[row] for other, jumped in sides if other >= 0 and not jumped]
    return float(max(rises, default=0.0))


def _time_to_preload(loop: Loop) -> float | None:
    """Time [s] from the first contact to the end of the approach; None before, and where contact is not known."""
    if "time_to_preload_s" in loop.told:
        return loop.told["time_to_preload_s"]
    # Of a run that counted overlap alone, from the first overlap.
    touching = np.flatnonzero(next(iter(loop.areas.values()), loop.area) > 0.0)
    if not (loop.met_preload and touching.size):
        return None
    return _known(max(loop.time[loop.preload_row] - loop.time[touching[0]], 0.0))


def _known(value: float) -> float | None:
    return None if math.isnan(value) else float(value)


def dip(loop: Loop, row: int) -> Dip:
    """The lowest force near its lowest row, by the parabola in the displacement through that row and its neighbours.

    The row itself where it has a jump beside it, is at an end, or the punch turns round there: no parabola belongs to
    these. Negative tension where it is a compression.
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
