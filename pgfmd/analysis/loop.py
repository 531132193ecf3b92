"""The loop of a tack test, simulated or measured: force against displacement, on the way in and on the way out."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import ResultError
from pgfmd.plots.folder import branches, column
from pgfmd.results import Results

from .works import net_work_of_rows, separation_of_rows

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Loop:
    """Rows of a tack test in the order of time; SI units; all arrays of shape (rows,).

    name: what a legend calls it. time [s]; displacement [m], negative when the punch is pushed in; force [N], positive
    in compression; area [m^2] of contact and u_inf [m], NaN where they are not known; phase: part of the programme;
    jump: rows at whose end the surface jumped; held: whether the punch goes up to a jump against the force before it (in
    runs with time the jump comes at the end of its step, in quasi-static ones anywhere within it). offset [m]: k of
    indentation = -displacement - k.

    Of a run, what it knows better than its rows, whatever filter they have gone through: work [J] of the loop,
    separation [J], the work of separation, None before the retraction; tension [N] of the pull-off, where rows are left
    out of the curve. None of a measured loop.
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
    tension: float | None = None

    @classmethod
    def of(cls, results: Results, name: str = "") -> Self:
        """The loop of a run, finished or not.

        Raises:
            ResultError: if a table can't be read, or has no rows yet.
        """
        curve = results.curve
        if not len(curve):
            raise ResultError(f"{results.directory}: nothing to analyse yet, curve.csv has no rows")
        columns = ("time [s]", "displacement [m]", "force [N]", "contact_area [m^2]", "u_inf [m]")
        time, displacement, force, area, u_inf = (column(curve, title) for title in columns)
        jump = np.isin(time, _jump_times(results))
        offset = float(results.run.get("indentation_offset_m") or 0.0)
        phase = column(curve, "phase")
        scene = results.scene
        slow = scene.get("solver", {}).get("scheme") == "quasistatic"
        held = not slow or scene.get("drive", {}).get("control") == "load"
        name = name or results.directory.name
        loop = cls(name, time, displacement, force, area, u_inf, phase, jump, offset, held)
        return dataclasses.replace(loop, **_known_to_the_run(results, loop))

    @property
    def indentation(self) -> Array:
        """How far the punch is pushed in [m]."""
        return -self.displacement - self.offset

    @property
    def branches(self) -> dict[str, slice]:
        """Rows of the "approach" and of the "retraction"; both hold the row where one becomes the other."""
        return branches(self.phase)

    @property
    def preload_row(self) -> int:
        """The row of the largest force."""
        return int(np.argmax(self.force))

    @property
    def retracted(self) -> bool:
        """Whether the punch has begun to go up again."""
        return bool(np.any(self.phase == "retract"))

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
        return dataclasses.replace(self, force=force, jump=jump, work=None, separation=None, tension=None)


def _known_to_the_run(results: Results, loop: Loop) -> dict[str, float | None]:
    """Work, separation and tension of a Loop: from `run.json`, the work else from `energy.csv`, both else from rows."""
    record, energy = results.run, results.energy
    work, separation, tension = (record.get(key) for key in ("work_J", "work_of_separation_J", "pull_off_force_N"))
    if work is None and energy is not None and len(energy):
        work = float(column(energy, "work [J]")[-1])
    if work is None:
        work = net_work_of_rows(loop)
    if separation is None and loop.retracted:
        separation = separation_of_rows(loop)
    thinned = results.scene.get("output", {}).get("every", 1) > 1
    return {"work": work, "separation": separation, "tension": tension if thinned else None}


def _jump_times(results: Results) -> Array:
    """Times [s] of the jumps that the run lists."""
    events = results.events
    if events is None or not len(events):
        return np.empty(0)
    return column(events, "time [s]")[column(events, "event").astype(str) == "jump"]
