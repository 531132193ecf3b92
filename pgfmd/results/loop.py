"""The loop of a tack test, simulated or measured: force against displacement, on the way in and on the way out."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import ResultError

from .reading import Results
from .uncertainty import share_of
from .works import net_work_of_rows, separation_of_rows

Array = NDArray[np.float64]
WHOLE = "detached"
"""How a run finishes whose loop is closed (`finished` in `run.json`)."""
TOLD = (
    "preload_N", "largest_force_N", "pull_off_force_N", "snap_in_force_N", "pull_off_force_uncertainty_N",
    "snap_in_force_uncertainty_N", "time_to_preload_s", "work_of_separation_uncertainty_J", "work_uncertainty_J",
)  # fmt: skip
"""Keys of `run.json` whose numbers a loop takes over."""
KINDS_OF_AREA = ("contact", "overlap", "near")


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
    these.
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
        jump = np.isin(time, _jump_times(results))
        offset = float(results.run.get("indentation_offset_m") or 0.0)
        phase = column(curve, "phase")
        scene = results.scene
        slow = scene.get("solver", {}).get("scheme") == "quasistatic"
        held = not slow or scene.get("drive", {}).get("control") == "load"
        name = name or results.directory.name
        loop = cls(name, time, displacement, force, area, u_inf, phase, jump, offset, held)
        others = {"overlap": areas.get("overlap"), "near": areas.get("near")}
        return dataclasses.replace(loop, **others, **_known_to_the_run(results, loop))

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


def column(table: Any, name: str) -> Array:
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


def _known_to_the_run(results: Results, loop: Loop) -> dict[str, Any]:
    """Work, separation, told and share of a Loop: from `run.json`, the work else from `energy.csv`, works else from
    rows."""
    record, energy = results.run, results.energy
    work, separation = record.get("work_J"), record.get("work_of_separation_J")
    if work is None and energy is not None and len(energy):
        work = float(column(energy, "work [J]")[-1])
    if work is None:
        work = net_work_of_rows(loop)
    if separation is None and loop.retracted:
        separation = separation_of_rows(loop)
    told = {key: record[key] for key in TOLD if record.get(key) is not None}
    return {"work": work, "separation": separation, "told": told, "share": share_of(results.scene.get("solver", {}))}


def _jump_times(results: Results) -> Array:
    """Times [s] of the jumps that the run lists."""
    events = results.events
    if events is None or not len(events):
        return np.empty(0)
    return column(events, "time [s]")[column(events, "event").astype(str) == "jump"]
