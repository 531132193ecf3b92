"""The curve of a tack test, simulated or measured, and its numbers: loop, branches, works and landmarks.

All commands and pictures use these functions (docs: reference, "Numbers"). For a finished run, forces and works are
read from `run.json`, because they were integrated within the steps. For an unfinished run, and a measured or filtered
curve, they are computed from rows by the same definitions.

For works from rows, the force between two rows is linear in the displacement. At a row with a jump, the force is that
of the row before if the punch moved against it up to the jump.
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
RECORDED = (
    "preload_N", "largest_force_N", "pull_off_force_N", "snap_in_force_N", "pull_off_force_uncertainty_N",
    "snap_in_force_uncertainty_N", "time_to_preload_s", "work_of_separation_uncertainty_J", "work_uncertainty_J",
)  # fmt: skip
"""Keys of `run.json` that a loop uses."""
KINDS_OF_AREA = ("contact", "overlap", "near")
SAME_STEP = ("time [s]", "displacement [m]", "force [N]")
"""Columns with the same numbers in curve and events."""
BOTH_WAYS = ("ramp", "oscillate", "follow")
"""Phases in which the punch may go in or out."""
UNEVEN = 4.0
"""A parabola through three rows is used only if the ratio of the two steps is below this."""
OVERSHOOT = 0.25
"""It is used only if its minimum is below the lowest row by at most this fraction of the larger difference to its
neighbours."""
LEAST_TENSION = 1e-3
"""Smallest tension that is marked in a picture, as a fraction of the largest force."""
BETWEEN_ROWS = 0.5
"""Uncertainty of a force from rows, as a fraction of the larger difference between the lowest row and its
neighbours."""


@dataclass(frozen=True, eq=False)
class Loop:
    """Rows of a tack test in the order of time; SI units; all arrays of shape (rows,).

    name: for legends. time [s]. displacement [m]: of the punch, negative when it is pushed in. force [N]: positive in
    compression. area [m^2]: of contact, and u_inf [m]; NaN if unknown. overlap, near [m^2]: areas with a negative gap,
    and with a gap below the near gap; None if unknown. phase: of the programme. jump: rows at whose end the surface
    jumped. held: whether the punch moves against the old force up to a jump (in time-dependent runs a jump is at the
    end of its step, in quasi-static runs anywhere within it). offset [m]: k of indentation = -displacement - k.

    For runs only: work [J] of the loop, and separation [J], the work of separation (None before the retraction); both
    are independent of filters. recorded: other numbers of `run.json`, by key (RECORDED). share: relative uncertainty of forces
    due to the errors of steps (uncertainty.py). cycle, stage: numbers of the repeat and of the step of the programme, from
    1; None if unknown.

    For measured loops only: closed: whether the rows hold both ways. treated: what was done to the curve when it was read,
    in words. remarks: what else is to be known of it.
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
    recorded: Mapping[str, float] = field(default_factory=dict)
    share: float = 0.0
    overlap: Array | None = None
    near: Array | None = None
    cycle: Array | None = None
    stage: Array | None = None
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
        drive = scene.get("drive", {})
        held = drive.get("control") == "load" or not (slow or _has_spring(drive.get("machine_stiffness")))
        name = name or results.directory.name
        loop = cls(
            name, time, displacement, force, area, u_inf, phase, jump, offset, held, overlap=areas.get("overlap"),
            near=areas.get("near"), cycle=_numbers(curve, "cycle"), stage=_numbers(curve, "stage"),
            share=uncertainty.share_of(scene.get("solver", {})),
        )  # fmt: skip
        return loop._with_record(results)

    def _with_record(self, results: Results) -> Self:
        """The same loop with numbers of the run: from `run.json`, else the work from `energy.csv`, else works from
        rows."""
        record, energy = results.run, results.energy
        recorded = {key: record[key] for key in RECORDED if record.get(key) is not None}
        work, separation = record.get("work_J"), record.get("work_of_separation_J")
        if work is None and energy is not None and len(energy):
            work = float(column(energy, "work [J]")[-1])
        loop = dataclasses.replace(self, recorded=recorded)
        if work is None:
            work = net_work_of_rows(loop)
        if separation is None and loop.retracted:
            separation = separation_of_rows(loop)
        return dataclasses.replace(loop, work=work, separation=separation)

    @property
    def indentation(self) -> Array:
        """Indentation [m]."""
        return -self.displacement - self.offset

    @property
    def areas(self) -> dict[str, Array]:
        """The known areas [m^2], in the order of KINDS_OF_AREA; none for a measured loop."""
        found = {"contact": self.area, "overlap": self.overlap, "near": self.near}
        return {kind: area for kind, area in found.items() if area is not None and not np.isnan(area).all()}

    @property
    def branches(self) -> dict[str, slice]:
        """Rows of the "approach" and of the "retraction"; both include the turning row."""
        return branches(self.displacement, self.phase)

    @property
    def met_preload(self) -> bool:
        """Whether the approach has ended."""
        return "preload_N" in self.recorded or _after_approach(self.phase) is not None

    @property
    def preload_row(self) -> int:
        """The last row of the approach; that of the largest force if the approach has not ended."""
        return end_of_approach(self.phase) if self.met_preload else int(np.argmax(self.force))

    @property
    def preload(self) -> float:
        """The force [N] at the end of the approach; the largest force if it has not ended."""
        return self.recorded.get("preload_N", float(self.force[self.preload_row]))

    @property
    def turning_row(self) -> int:
        """The row at which the punch turns, see `turning_row`; the last one if it has not yet."""
        return min(turning_row(self.displacement, self.phase), len(self.force) - 1)

    @property
    def retracted(self) -> bool:
        """Whether the retraction has begun."""
        # The step in which the punch turns may end deeper than it began.
        return "pull_off_force_N" in self.recorded or (self.met_preload and self.turning_row < len(self.force) - 1)

    def pushed_in_by(self, extra: Array | float) -> Self:
        """The same loop, pushed in further by `extra` [m], of shape (rows,) or a number."""
        moved = dataclasses.replace(self, displacement=self.displacement - extra)
        if self.work is None or np.ndim(extra) == 0:
            return moved
        # The difference of the works from rows is added to the work of the run.
        work = self.work + net_work_of_rows(moved) - net_work_of_rows(self)
        separation = self.separation
        if separation is not None:
            separation += separation_of_rows(moved) - separation_of_rows(self)
        return dataclasses.replace(moved, work=work, separation=separation)

    def with_force(self, force: Array) -> Self:
        """A loop with the same displacements, these forces [N] (rows,), and no jumps."""
        jump = np.zeros_like(self.jump)
        return dataclasses.replace(self, force=force, jump=jump, work=None, separation=None, recorded={})


def areas_of(results: Results) -> dict[str, Array]:
    """The areas [m^2] of the rows of a run by kind, "contact" first: all of KINDS_OF_AREA, or only "overlap" for a run
    that recorded overlap as its contact area."""
    if results.counts_overlap:
        return {"overlap": column(results.curve, "contact_area [m^2]")}
    return {kind: column(results.curve, f"{kind}_area [m^2]") for kind in KINDS_OF_AREA}


def _has_spring(stiffness: Any) -> bool:
    """Whether a scene's machine has a spring: its stiffness is a number or a text, or none is given."""
    return stiffness is not None and str(stiffness).split()[0] != "inf"


def column(table: Any, name: str) -> NDArray[Any]:
    """A column of a table as a plain array, whether or not pandas made it."""
    return np.asarray(table[name])


def _numbers(curve: Any, name: str) -> Array | None:
    """A column of numbers of cycles or steps; None in a table of an earlier version, which has none."""
    found = np.asarray(column(curve, name), float)
    return None if np.isnan(found).any() else found


def _after_approach(phase: NDArray[np.str_]) -> int | None:
    """The first row after the approach, or after another first step of a programme; None if there is none. A turn that
    leads to it, from an earlier cycle, is passed over."""
    begun = np.flatnonzero(phase != "turn")
    if not begun.size:
        return None
    first = int(begun[0])
    later = np.flatnonzero(phase[first:] != phase[first])
    return first + int(later[0]) if later.size else None


def end_of_approach(phase: NDArray[np.str_]) -> int:
    """The last row of the approach, or of the whole curve if there is no other phase."""
    later = _after_approach(phase)
    return max(later - 1, 0) if later is not None else len(phase) - 1


def turning_row(displacement: Array, phase: NDArray[np.str_]) -> int:
    """The row at which the punch turns: the last of the rows with the largest indentation between the end of the
    approach and the retraction at constant speed; within the turn, or at the end of a dwell. len(phase) during the
    approach."""
    first, out = end_of_approach(phase), np.flatnonzero(phase == "retract")
    if _after_approach(phase) is None:
        return len(phase)
    between = np.asarray(displacement)[first : max(int(out[0]), first + 1) if out.size else len(phase)]
    return first + len(between) - 1 - int(np.argmin(between[::-1]))


def branches(displacement: Array, phase: NDArray[np.str_]) -> dict[str, slice]:
    """Rows of approach and retraction; both include the turning row."""
    turn = turning_row(displacement, phase)
    return {"approach": slice(0, turn + 1), "retraction": slice(turn, len(phase))}


def rows_of_jumps(results: Results) -> NDArray[np.intp]:
    """The numbers of the curve's rows at whose end the surface jumped, in order.

    Every jump has a row, independent of `output.every`, and both tables have all digits (files/tables.py): its row has
    the same numbers in SAME_STEP. If steps are so short that several rows have the same time, force and displacement
    distinguish them. Jumps after the last row are ignored: they may have happened after the curve was read.

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
        """Which jumps do not match their present rows, and may match the next ones."""
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
    """Forces [N] at the start and at the end of each interval between rows, (rows - 1,), with regard to jumps."""
    before = loop.force[:-1]
    return before, np.where(loop.jump[1:] & loop.held, before, loop.force[1:])


def net_work_of_rows(loop: Loop) -> float:
    """Work of the punch [J] over all rows, -int F dd: the area of a closed loop."""
    before, after = forces_met(loop)
    return float(-0.5 * (before + after) @ np.diff(loop.displacement))


def separation_of_rows(loop: Loop) -> float:
    """Work [J] of the punch while it moves up against a tensile force; of a step through zero force, the part under
    tension."""
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
    """The lowest force of a branch: tension [N], positive, or 0 if there is none; displacement [m] of the punch and
    time [s]; uncertainty [N] of the tension, None if unknown."""

    tension: float
    displacement: float
    time: float
    uncertainty: float | None = None


@dataclass(frozen=True)
class Areas:
    """An area [m^2] at the end of the approach, its maximum, and in the row nearest to the pull-off; None if the loop
    does not get there."""

    at_preload: float | None
    largest: float
    at_pull_off: float | None


@dataclass(frozen=True)
class Measures:
    """Numbers of one loop; None if the loop does not have them, or does not get there.

    preload [N]: force at the end of the approach. largest_force [N]: at any row, including the overshoot in the turn;
    None without compression. time_to_preload [s]: from the first contact. pull_off: lowest force of the retraction,
    from the turning point on; snap_in: that of the approach. work_of_separation [J]: of the punch while it moves up
    against a tensile force. hysteresis [J]: net work of the punch over all rows, None of one way alone. areas: the known ones of "contact",
    "overlap" and "near". *_uncertainty: of a work [J].
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
        """The largest contact area [m^2]; None if unknown."""
        return self.areas["contact"].largest if "contact" in self.areas else None

    @property
    def area_at_pull_off(self) -> float | None:
        """The contact area [m^2] in the row nearest to the pull-off; None if unknown."""
        return self.areas["contact"].at_pull_off if "contact" in self.areas else None

    @property
    def landmarks(self) -> dict[str, Dip]:
        """The marks of a picture: "pull-off" and "snap-in", each if its tension is not negligible."""
        size = max(self.largest_force or 0.0, self.pull_off.tension if self.pull_off else 0.0, self.snap_in.tension)
        found = {"pull-off": self.pull_off, "snap-in": self.snap_in}
        return {name: dip for name, dip in found.items() if dip and dip.tension > LEAST_TENSION * size}


def measure(loop: Loop) -> Measures:
    """The measures of a loop."""
    pull_off, row = None, None
    if loop.retracted:
        row = loop.turning_row + int(np.argmin(np.where(_may_pull_off(loop), loop.force[loop.turning_row :], np.inf)))
        pull_off = _tension(loop, row, "pull_off_force")
    inward = _inward_rows(loop)
    snap = int(inward[np.argmin(loop.force[inward])])
    largest = loop.recorded.get("largest_force_N", float(np.max(loop.force)))
    return Measures(
        preload=loop.preload if loop.met_preload else None,
        largest_force=largest if largest > 0.0 else None,
        time_to_preload=_time_to_preload(loop),
        pull_off=pull_off,
        snap_in=_tension(loop, snap, "snap_in_force"),
        work_of_separation=work_of_separation(loop) if loop.retracted else None,
        hysteresis=net_work(loop) if loop.closed else None,
        areas={kind: _areas(area, loop, row) for kind, area in loop.areas.items()},
        work_of_separation_uncertainty=loop.recorded.get("work_of_separation_uncertainty_J"),
        hysteresis_uncertainty=loop.recorded.get("work_uncertainty_J"),
    )


def _may_pull_off(loop: Loop) -> NDArray[np.bool_]:
    """Which rows from the turning row on belong to a way out: not those in which a programme presses the punch in again."""
    turn = loop.turning_row
    phase, moved = loop.phase[turn:], np.diff(loop.displacement[turn:], prepend=loop.displacement[turn])
    pressed = (phase == "approach") | (np.isin(phase, BOTH_WAYS) & (moved < 0.0))
    pressed[:1] = False
    return ~pressed


def _inward_rows(loop: Loop) -> NDArray[np.intp]:
    """The rows of the approach; of a programme with several cycles, those of all of them."""
    rows = np.arange(len(loop.force))
    approaching = rows <= loop.preload_row
    if loop.cycle is not None and loop.cycle[-1] > loop.cycle[0]:
        approaching |= loop.phase == loop.phase[loop.preload_row]
    return rows[approaching]


def _areas(area: Array, loop: Loop, pull_off_row: int | None) -> Areas:
    at_preload = float(area[loop.preload_row]) if loop.met_preload else None
    return Areas(at_preload, float(np.max(area)), float(area[pull_off_row]) if pull_off_row is not None else None)


def _tension(loop: Loop, row: int, key: str) -> Dip:
    """The tension at the lowest row of a branch: from the run (by its key, without unit), else from rows."""
    found = dip(loop, row)
    recorded = loop.recorded.get(f"{key}_N")
    if recorded is not None:
        # Records of version 0.1 have no uncertainties.
        spread = uncertainty.of_force(recorded, min(recorded, -float(loop.force[row])), loop.share)
        known = loop.recorded.get(f"{key}_uncertainty_N", _known(spread))
        return dataclasses.replace(found, tension=recorded, uncertainty=known)
    spread = loop.share * abs(found.tension) + BETWEEN_ROWS * _rise_near(loop, row)
    # Only a negative force is a tension.
    spread = max(0.0, spread + min(found.tension, 0.0)) if not math.isnan(spread) else spread
    if row == len(loop.force) - 1:
        # The minimum may not have been reached yet.
        spread = math.nan
    return dataclasses.replace(found, tension=max(found.tension, 0.0) + 0.0, uncertainty=_known(spread))


def _rise_near(loop: Loop, row: int) -> float:
    """The larger difference [N] between a row and its neighbours, excluding jumps."""
    sides = [(row - 1, loop.jump[row]), *([(row + 1, loop.jump[row + 1])] if row + 1 < len(loop.force) else [])]
    rises = [loop.force[other] - loop.force[row] for other, jumped in sides if other >= 0 and not jumped]
    return float(max(rises, default=0.0))


def _time_to_preload(loop: Loop) -> float | None:
    """Time [s] from the first contact to the end of the approach; None before, and if contact is unknown."""
    if "time_to_preload_s" in loop.recorded:
        return loop.recorded["time_to_preload_s"]
    # For a run that only recorded overlap, from the first overlap.
    touching = np.flatnonzero(next(iter(loop.areas.values()), loop.area) > 0.0)
    if not (loop.met_preload and touching.size):
        return None
    return _known(max(loop.time[loop.preload_row] - loop.time[touching[0]], 0.0))


def _known(value: float) -> float | None:
    return None if math.isnan(value) else float(value)


def dip(loop: Loop, row: int) -> Dip:
    """The lowest force near its lowest row, by the parabola in the displacement through that row and its neighbours.

    The row itself if it is next to a jump, at an end, or at the turning point, where a parabola makes no sense. The
    tension is negative in compression.
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
    """Work of the punch [J] over the loop: as integrated by the run, else from rows."""
    return net_work_of_rows(loop) if loop.work is None else loop.work


def work_of_separation(loop: Loop) -> float:
    """Work [J] that the punch does while it goes up against a tensile force; of a step through zero force the part
    under tension.

    `work_of_separation_J` of `run.json`, or the same from the rows where there is none.
    """
    return separation_of_rows(loop) if loop.separation is None else loop.separation
