"""Summits, saddles and valleys of the punch during a run: numbers in contact, and the forces at which they change.

For a run that only recorded overlap, contact means overlap throughout.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pgfmd.physics.contact_sites import KINDS

from .curve import Array, Loop, column
from .reading import Results


@dataclass(frozen=True)
class SiteHistory:
    """How many sites of a kind, `of` there are, are in contact along the run: at every row of the curve, and before and
    after every join and leave, in the order of time.

    count, time [s], indentation [m] of the punch and force [N]: of shape (points,). turn: how many of these points
    belong to the approach, which includes the turning point.
    """

    kind: str
    of: int
    count: Array
    time: Array
    indentation: Array
    force: Array
    turn: int


@dataclass(frozen=True)
class SiteLoads:
    """Of one kind of site: how many there are, how many were in contact at most, and forces [N] on the punch.

    first_joins, last_joins: in the approach, until the punch turns. first_leaves, last_leaves: in the retraction. None
    if there is none.
    """

    kind: str
    of: int
    most: int
    first_joins: float | None
    last_joins: float | None
    first_leaves: float | None
    last_leaves: float | None


def site_histories(results: Results, loop: Loop) -> list[SiteHistory]:
    """The history of each kind of site that ever touched; empty without `sites.csv`.

    loop: of the run, with the rows that it has. ResultError if a table can't be read.
    """
    return [_history(results, loop, kind) for kind in _kinds_of(results)]


def _history(results: Results, loop: Loop, kind: str) -> SiteHistory:
    sites = results.sites
    own = np.flatnonzero(column(sites, "kind") == kind)
    change, after = column(sites, "time [s]")[own], column(sites, "in_contact")[own]
    before = np.concatenate(([0], after[:-1]))
    steady = np.concatenate(([0], after))[np.searchsorted(change, loop.time, side="right")]
    place = -column(sites, "displacement [m]")[own] - loop.offset
    values = {
        "count": np.concatenate([np.column_stack([before, after]).ravel(), steady]),
        "time": np.concatenate([np.repeat(change, 2), loop.time]),
        "indentation": np.concatenate([np.repeat(place, 2), loop.indentation]),
        "force": np.concatenate([np.repeat(column(sites, "force [N]")[own], 2), loop.force]),
    }
    # A row of the curve at exactly the time of a change has the state after it.
    order = np.argsort(values["time"], kind="stable")
    values = {name: numbers[order] for name, numbers in values.items()}
    turn = int(np.searchsorted(values["time"], loop.time[loop.turning_row], side="right"))
    return SiteHistory(kind, int(column(sites, "of")[own][0]), **values, turn=turn)


def site_loads(results: Results, loop: Loop) -> list[SiteLoads]:
    """The forces for each kind of site that ever touched; empty without `sites.csv`.

    loop: of the run, with the rows that it has. ResultError if a table can't be read.
    """
    sites, found = results.sites, []
    for name in _kinds_of(results):
        own = column(sites, "kind") == name
        force, event = column(sites, "force [N]")[own], column(sites, "event")[own]
        on_approach = column(sites, "time [s]")[own] <= loop.time[loop.turning_row]
        joins, leaves = force[on_approach & (event == "joins")], force[~on_approach & (event == "leaves")]
        loads = (_end(joins, 0), _end(joins, -1), _end(leaves, 0), _end(leaves, -1))
        most, of = int(np.max(column(sites, "in_contact")[own])), int(column(sites, "of")[own][0])
        found.append(SiteLoads(name, of, most, *loads))
    return found


def _kinds_of(results: Results) -> list[str]:
    """The kinds of site that a run has rows of."""
    if results.sites is None:
        return []
    there = set(column(results.sites, "kind"))
    return [kind for kind in KINDS if kind in there]


def _end(forces: np.ndarray, which: int) -> float | None:
    return float(forces[which]) if forces.size else None
