"""Observers of the contact: patches in every snapshot, sites that join and leave, changes in a jump."""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING

import numpy as np

from pgfmd.files.table_writing import TableFile
from pgfmd.files.tables import JOINS, LEAVES, PatchRow, SiteRow
from pgfmd.physics.contact_sites import KINDS
from pgfmd.solver.grid import PunchPoints
from pgfmd.solver.patches import patches_of
from pgfmd.solver.simulation import Observer
from pgfmd.solver.sites import SitePoints

if TYPE_CHECKING:
    from pgfmd.solver.simulation import Event, Simulation
    from pgfmd.solver.state import State

SAME = 1e-6
"""Relative difference below which the changes of two tractions count as equal."""


class PatchTable:
    """Writes the rows of `patches.csv` for a snapshot. Collective."""

    def __init__(self, file: TableFile, points: PunchPoints, places: SitePoints, contact_gap: float, periodic: bool):
        self.file, self.points, self.places = file, points, places
        self.contact_gap, self.periodic = contact_gap, periodic

    def __call__(self, snapshot: int, time: float, gap: np.ndarray, traction: np.ndarray) -> None:
        """snapshot: its number, and time [s]; gap [m] and traction [Pa] of all points under the punch, (size,)."""
        found = patches_of(self.points, gap, traction, self.places, self.contact_gap, self.periodic)
        self.file.extend([PatchRow(snapshot, time, *astuple(patch)) for patch in found])


@dataclass(frozen=True)
class Change:
    """The changes in a jump: sites that joined and left, such as "1 summit; 3 saddle"; the point x, y [m] where the
    traction changed most, NaN if not determined; and the site nearest to it, such as "saddle 40"."""

    joined: str = ""
    left: str = ""
    x: float = math.nan
    y: float = math.nan
    at: str = ""


class ContactWatch(Observer):
    """Writes a row of `sites.csv` whenever a site joins the contact or leaves it. `change` has the changes in the last
    jump.

    A site is in contact if its grid point is, that is if its gap is below the contact_gap of the law. jumps: whether
    the scene may jump; only then the traction is kept from step to step. (The traction is used and not the
    displacement, because a machine's spring moves the whole surface.)

    The contact before a step follows from the state, so a checkpoint does not need it.
    """

    def __init__(self, file: TableFile, points: PunchPoints, places: SitePoints, jumps: bool):
        self.file, self.points, self.places, self.jumps = file, points, places, jumps
        self.change = Change()
        self._held: np.ndarray | None = None
        self._traction: np.ndarray | None = None

    def before_step(self, simulation: Simulation) -> None:
        if self._held is None:
            self._remember(simulation.state, self._look(simulation))

    def observe(self, simulation: Simulation, event: Event) -> None:
        if event.kind not in ("start", "step", "jump"):
            return
        # At the start, everything in contact joins it.
        before = np.zeros(len(self.places.sites), bool) if self._held is None else self._held
        held = self._look(simulation)
        joined, left = held & ~before, before & ~held
        self._write(simulation, joined, left, before)
        if event.kind == "jump":
            place = self._place(simulation.state)
            self.change = Change(
                self._counts_as_text(joined), self._counts_as_text(left), *place, self._nearest(*place)
            )
        self._remember(simulation.state, held)

    def _look(self, simulation: Simulation) -> np.ndarray:
        """Which sites are in contact now. Collective, unless there are no sites."""
        if not len(self.places.sites):
            return np.zeros(0, bool)
        state, local = simulation.state, self.places.local
        gap = np.float64(state.position) + simulation.scheme.height[local] - state.surface_displacement[local]
        return self.places.collect(gap < simulation.scheme.law.contact_gap)

    def _remember(self, state: State, held: np.ndarray) -> None:
        self._held = held
        if self.jumps:
            if self._traction is None:
                self._traction = np.empty_like(state.traction)
            self._traction[:] = state.traction

    def _write(self, simulation: Simulation, joined: np.ndarray, left: np.ndarray, before: np.ndarray) -> None:
        """A row for each site that changed, those that leave first."""
        if not (joined | left).any():
            return
        sites, state, now = self.places.sites, simulation.state, self.places.sites.count(before)
        rows, totals = [], sites.count()
        for changed, event, step in ((left, LEAVES, -1), (joined, JOINS, 1)):
            for site in np.flatnonzero(changed).tolist():
                kind = sites.kind[site]
                now[kind] += step
                rows.append(
                    SiteRow(
                        time=state.time, displacement=simulation.punch_position, force=state.force,
                        phase=simulation.phases[state.stepped].name, kind=KINDS[kind], site=site, x=sites.x[site], y=sites.y[site],
                        event=event, in_contact=now[kind], of=totals[kind],
                    )
                )  # fmt: skip
        self.file.extend(rows)

    def _counts_as_text(self, changed: np.ndarray) -> str:
        counts = self.places.sites.count(changed)
        return "; ".join(f"{count} {kind}" for count, kind in zip(counts, KINDS, strict=True) if count)

    def _nearest(self, x: float, y: float) -> str:
        sites = self.places.sites
        if not len(sites) or math.isnan(x):
            return ""
        site = int(np.argmin(np.hypot(sites.x - x, sites.y - y)))
        return f"{KINDS[sites.kind[site]]} {site}"

    def _place(self, state: State) -> tuple[float, float]:
        """x and y [m] of the point whose traction changed most in the last step, the first of equal ones.
        Collective."""
        if self._traction is None:
            return math.nan, math.nan
        points, changed = self.points.whole, self.points.unfold(np.abs(state.traction - self._traction))
        most = points.maximum_of(float(changed.max(initial=0.0)))
        # Mirror images differ by rounding.
        here = np.flatnonzero(changed >= (1.0 - SAME) * most)[:1]
        place = points.coordinate_of(int(here[0])) if here.size else None
        return next(found for found in points.comm.allgather(place) if found is not None)
