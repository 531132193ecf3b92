"""The curve of a tack test, simulated or measured, and what it measures: the loop, its branches, works and landmarks.

All commands and pictures take their numbers from here (docs: reference, "Numbers"). A run that has ended says its
forces and works itself, in `run.json`: it knows what happened within its steps. What has to be read off rows (of a run
that goes on, a measured or a filtered curve) is found here by the same definitions.

Works from rows take forces between two rows to be linear in the displacement; a row at which the surface jumped is met
with the force of the row before where the punch goes up to a jump against that.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import ResultError
from pgfmd.files.tables import CURVE, EVENTS
from pgfmd.schemes import registry

from . import uncertainty
from .reading import Results

Array = NDArray[np.float64]
TOLD = (
    "preload_N", "largest_force_N", "pull_off_force_N", "snap_in_force_N", "pull_off_force_uncertainty_N",
    "snap_in_force_uncertainty_N", "time_to_preload_s", "work_of_separation_uncertainty_J", "work_uncertainty_J",
)  # fmt: skip
"""Keys of `run.json` whose numbers a loop takes over."""
KINDS_OF_AREA = ("contact", "overlap", "near")
SAME_STEP = ("time [s]", "displacement [m]", "force [N]")
"""Columns that curve and events write from the same numbers of a step."""
UNEVEN = 4.0
"""A parabola through three rows is trusted if neither step is so many times longer than the other."""
OVERSHOOT = 0.25
"""It is trusted if its vertex lies beyond the lowest row by no more than this share of the larger rise beside it."""
LEAST_TENSION = 1e-3
"""A tension is marked in a picture from this share of the largest force on."""
BETWEEN_ROWS = 0.5
"""Uncertainty of a force that is read off rows, as a share of the larger rise beside the lowest one."""


@dataclass(frozen=True, eq=False)
class Loop:
    """Rows of a tack test in the order of time; SI units; all arrays of shape (rows,).

    name: what a legend calls it. time [s]; displacement [m], negative when the punch is pushed in; force [N], positive
    in compression; area [m^2] of contact and u_inf [m], NaN where they are not known; overlap and near [m^2]: areas of
    the points with a negative gap, and below the near gap, None where they are not known; phase: part of the programme;
    jump: rows at whose end the surface jumped; held: whether the punch goes up to a jump against the force before it
    (in runs with time the jump comes at the end of its step, in quasi-static ones anywhere within it). offset [m]: k of
    indentation = -displacement - k.

    Of a run, what it knows better than its rows: work [J] of the loop and separation [J], the work of separation, None
    before the retraction, whatever filter the rows have gone through; told: other numbers of `run.json`, by their keys
    (TOLD). share: how far off forces may be for the errors of its steps (uncertainty.py). A measured loop has none of
    these. closed: whether the rows hold both ways; treated: what was done to a measured curve when it was read, in words;
    remarks: what else is to be known of it.
    """

    name: str
    time: Array
    displacement: Array
    force: Array
    area: Array
    u_inf: Array
    phase: NDArray[np.str_]
    jump: NDArray[np.bool_]
    offset: float = 0.0
    held: bool = True
    work: float | None = None
    separation: float | None = None
    told: Mapping[str, float] = field(default_factory=dict)
    share: float = 0.0
    overlap: Array | None = None
    near: Array | None = None
    closed: bool = True
    treated: str = ""
    remarks: tuple[str, ...] = ()

    @classmethod
    def of(cls, results: Results, name: str = "") -> Self:
        """The loop of a run, finished or not.

        Raises:
            ResultError: if a table can't be read, or has no rows yet.
        """
        curve = results.curve
        if not len(curve):
            raise ResultError(f"{results.directory}: nothing to analyse yet, curve.csv has no rows")
        columns = ("time [s]", "displacement [m]", "force [N]", "u_inf [m]")
        time, displacement, force, u_inf = (column(curve, title) for title in columns)
        areas = areas_of(results)
        area = areas.get("contact", np.full(len(curve), np.nan))
        jump = np.zeros(len(curve), bool)
        jump[rows_of_jumps(results)] = True
        offset = float(results.run.get("indentation_offset_m") or 0.0)
        phase = column(curve, "phase")
        scene = results.scene
        slow = registry.scheme_in(scene.get("solver", {})).timeless
        held = not slow or scene.get("drive", {}).get("control") == "load"
        name = name or results.directory.name
        loop = cls(
            name, time, displacement, force, area, u_inf, phase, jump, offset, held, overlap=areas.get("overlap"),
            near=areas.get("near"), share=uncertainty.share_of(scene.get("solver", {})),
        )  # fmt: skip
        return loop._told_by(results)

    def _told_by(self, results: Results) -> Self:
        """The same loop with what the run knows: from `run.json`, the work else from `energy.csv`, works else from
        rows."""
        record, energy = results.run, results.energy
        told = {key: record[key] for key in TOLD if record.get(key) is not None}
        work, separation = record.get("work_J"), record.get("work_of_separation_J")
        if work is None and energy is not None and len(energy):
            work = float(column(energy, "work [J]")[-1])
        loop = dataclasses.replace(self, told=told)
        if work is None:
            work = net_work_of_rows(loop)
        if separation is None and loop.retracted:
            separation = separation_of_rows(loop)
        return dataclasses.replace(loop, work=work, separation=separation)

    @property
    def indentation(self) -> Array:
        """How far the punch is pushed in [m]."""
        return -self.displacement - self.offset

    @property
    def areas(self) -> dict[str, Array]:
        """The areas [m^2] that are known, in the order of KINDS_OF_AREA; none of a measured loop."""
        found = {"contact": self.area, "overlap": self.overlap, "near": self.near}
        return {kind: area for kind, area in found.items() if area is not None and not np.isnan(area).all()}

    @property
    def branches(self) -> dict[str, slice]:
        """Rows of the "approach" and of the "retraction"; both hold the row where the punch turns round."""
        return branches(self.displacement, self.phase)

    @property
    def met_preload(self) -> bool:
        """Whether the approach has come to its end."""
        return "preload_N" in self.told or bool(np.any(self.phase != "approach"))

    @property
    def preload_row(self) -> int:
        """The last row of the approach; that of the largest force where the approach still goes on."""
        return end_of_approach(self.phase) if self.met_preload else int(np.argmax(self.force))

    @property
    def preload(self) -> float:
        """The force [N] at which the approach ended; the largest force where it still goes on."""
        return self.told.get("preload_N", float(self.force[self.preload_row]))

    @property
    def turning_row(self) -> int:
        """The row at which the punch turns round, see `turning_row`; the last one where it has not yet."""
        return min(turning_row(self.displacement, self.phase), len(self.force) - 1)

    @property
    def retracted(self) -> bool:
        """Whether the punch has begun to go up again."""
        # The step in which it turns may end deeper than it began.
        return "pull_off_force_N" in self.told or (self.met_preload and self.turning_row < len(self.force) - 1)

    def pushed_in_by(self, extra: Array | float) -> Self:
        """The same loop, pushed in further by `extra` [m], of shape (rows,) or a number."""
        moved = dataclasses.replace(self, displacement=self.displacement - extra)
        if self.work is None or np.ndim(extra) == 0:
            return moved
        # What the rows say of the difference is added to what the run knows of the whole.
        work = self.work + net_work_of_rows(moved) - net_work_of_rows(self)
        separation = self.separation
        if separation is not None:
            separation += separation_of_rows(moved) - separation_of_rows(self)
        return dataclasses.replace(moved, work=work, separation=separation)

    def with_force(self, force: Array) -> Self:
        """Another loop with the same displacements and these forces [N], of shape (rows,), and without jumps."""
        jump = np.zeros_like(self.jump)
        return dataclasses.replace(self, force=force, jump=jump, work=None, separation=None, told={})


def areas_of(results: Results) -> dict[str, Array]:
    """The areas [m^2] of the rows of a run by what they are, "contact" first: all of KINDS_OF_AREA, or "overlap" alone
    of a run that counted nothing else and called that its contact area."""
    if results.counts_overlap:
        return {"overlap": column(results.curve, "contact_area [m^2]")}
    return {kind: column(results.curve, f"{kind}_area [m^2]") for kind in KINDS_OF_AREA}


def column(table: Any, name: str) -> NDArray[Any]:
    """A column of a table as a plain array, whether or not pandas made it."""
    return np.asarray(table[name])


def end_of_approach(phase: NDArray[np.str_]) -> int:
    """The last row of the approach, the last of all where nothing comes after it."""
    later = np.flatnonzero(phase != "approach")
    return max(int(later[0]) - 1, 0) if later.size else len(phase) - 1


def turning_row(displacement: Array, phase: NDArray[np.str_]) -> int:
    """The row at which the punch turns round: the last of the deepest ones between the end of the approach and the
    retraction at constant speed, which is within the turn or at the end of a dwell. len(phase) during the approach."""
    first, out = end_of_approach(phase), np.flatnonzero(phase == "retract")
    if not np.any(phase != "approach"):
        return len(phase)
    between = np.asarray(displacement)[first : max(int(out[0]), first + 1) if out.size else len(phase)]
    return first + len(between) - 1 - int(np.argmin(between[::-1]))


def branches(displacement: Array, phase: NDArray[np.str_]) -> dict[str, slice]:
    """Rows of the way in and of the way out; both hold the row where one becomes the other."""
    turn = turning_row(displacement, phase)
    return {"approach": slice(0, turn + 1), "retraction": slice(turn, len(phase))}


def rows_of_jumps(results: Results) -> NDArray[np.intp]:
    """The numbers of the curve's rows at whose end the surface jumped, in order.

    A jump has a row of its own, whatever `output.every` leaves out, and both tables have the step's numbers with all
    their digits (files/tables.py): its row is that with the same ones in SAME_STEP. Where steps are so short that
    several rows have the same time, force and displacement tell them apart. Jumps after the last row are left out: a run
    that goes on may have made them since the curve was read.

    Raises:
        ResultError: for a jump that has no row, or if a table can't be read.
    """
    curve, events = results.curve, results.events
    if events is None or not len(events):
        return np.empty(0, np.intp)
    jumped = column(events, "event").astype(str) == "jump"
    rows, wanted = ([column(table, title) for title in SAME_STEP] for table in (curve, events))
    times, when = rows[0], wanted[0][jumped]
    found, end = (np.searchsorted(times, when, side) for side in ("left", "right"))

    def others() -> NDArray[np.bool_]:
        """Which jumps are not those of the rows where they are looked for, and may be those of the next."""
        at = np.minimum(found, len(times) - 1)
        same = [values[at] == of_jump[jumped] for values, of_jump in zip(rows, wanted, strict=True)]
        return ~np.logical_and.reduce(same) & (found < end)

    while (wrong := others()).any():
        found[wrong] += 1
    lost = (found == end) & (when <= times[-1])
    if lost.any():
        raise ResultError(
            f"{results.directory}: the jump at t = {float(when[np.argmax(lost)])!r} s in {EVENTS.file} has no row in "
            f"{CURVE.file}, so that works and forces would be wrong: if the run goes on, try again; else "
            "`pgfmd verify` says which table was changed"
        )
    return found[found < end]


def forces_met(loop: Loop) -> tuple[np.ndarray, np.ndarray]:
    """Forces [N] at the start and at the end of each step between rows, (rows - 1,), as the punch meets them."""
    before = loop.force[:-1]
    return before, np.where(loop.jump[1:] & loop.held, before, loop.force[1:])


def net_work_of_rows(loop: Loop) -> float:
    """Work of the punch [J] over all rows, -int F dd: the area of a closed loop."""
    before, after = forces_met(loop)
    return float(-0.5 * (before + after) @ np.diff(loop.displacement))


def separation_of_rows(loop: Loop) -> float:
    """Work [J] that the punch does while it goes up against a tensile force; of a step through zero force the part
    under tension."""
    before, after = forces_met(loop)
    start, end = np.maximum(-before, 0.0), np.maximum(-after, 0.0)
    mean = 0.5 * (start + end)
    crossing = before * after < 0.0
    span = np.abs(before - after)[crossing]
    mean[crossing] = 0.5 * np.maximum(start, end)[crossing] ** 2 / span
    moved = np.maximum(np.diff(loop.displacement), 0.0)
    return float(mean @ moved)


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
    goes up against a tensile force. hysteresis [J]: net work of the punch over all rows, None of one way alone. areas: by what they are, of
    "contact", "overlap" and "near" those that are known. *_uncertainty: of a work [J].
    """

    preload: float | None
    largest_force: float | None
    time_to_preload: float | None
    pull_off: Dip | None
    snap_in: Dip
    work_of_separation: float | None
    hysteresis: float | None
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
        size = max(self.largest_force or 0.0, self.pull_off.tension if self.pull_off else 0.0, self.snap_in.tension)
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
        hysteresis=net_work(loop) if loop.closed else None,
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
        known = loop.told.get(f"{key}_uncertainty_N", _known(spread))
        return dataclasses.replace(found, tension=told, uncertainty=known)
    spread = loop.share * abs(found.tension) + BETWEEN_ROWS * _rise_beside(loop, row)
    # Of a compression only what goes below zero is a tension.
    spread = max(0.0, spread + min(found.tension, 0.0)) if not math.isnan(spread) else spread
    if row == len(loop.force) - 1:
        # Nobody knows yet how far down it goes.
        spread = math.nan
    return dataclasses.replace(found, tension=max(found.tension, 0.0) + 0.0, uncertainty=_known(spread))


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
