"""At which loads summits, saddles and valleys join the contact on the way in, and leave it on the way out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pgfmd.physics.contact_sites import KINDS
from pgfmd.results import Results
from pgfmd.results.curve import Loop, column


@dataclass(frozen=True)
class SiteLoads:
    """Of one kind of site: how many there are, how many were in contact at most, and forces [N] on the punch.

    first_joins, last_joins: on the way in, until the punch turns round. first_leaves, last_leaves: on the way out. None
    where none did.
    """

    kind: str
    of: int
    most: int
    first_joins: float | None
    last_joins: float | None
    first_leaves: float | None
    last_leaves: float | None


def site_loads(results: Results, loop: Loop) -> list[SiteLoads]:
    """The loads of each kind of site that ever touched; empty where the run kept no `sites.csv`.

    Of a run that counted overlap alone, those at which sites begin and end to overlap.
    """
    sites = results.sites
    if sites is None or not len(sites):
        return []
    turn = loop.time[loop.turning_row]
    time, force = column(sites, "time [s]"), column(sites, "force [N]")
    kind, event = column(sites, "kind").astype(str), column(sites, "event").astype(str)
    before = time <= turn
    found = []
    for name in KINDS:
        own = kind == name
        if not own.any():
            continue
        joins, leaves = force[own & before & (event == "joins")], force[own & ~before & (event == "leaves")]
        loads = (_end(joins, 0), _end(joins, -1), _end(leaves, 0), _end(leaves, -1))
        most = int(np.max(column(sites, "in_contact")[own]))
        found.append(SiteLoads(name, int(column(sites, "of")[own][0]), most, *loads))
    return found


def _end(forces: np.ndarray, which: int) -> float | None:
    return float(forces[which]) if forces.size else None
