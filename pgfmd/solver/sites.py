"""The grid points nearest to the sites of a punch's face: summits, saddles and valleys. Collective."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from pgfmd.physics.contact_sites import ContactSites

from .grid import PunchPoints

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

Numbers = NDArray[np.int64]
Kind = TypeVar("Kind", bound=np.ndarray)

TIE = 1e-6
"""Shift towards the axis, in grid spacings, that decides between two equally near points."""
ROUNDING = 1e-9
"""Distances that differ by less, in grid spacings, are equal: the first of such points is used."""


class SitePoints:
    """For each site of a face, the nearest grid point under the punch, or its mirror image. Collective.

    Attributes: `index` (count,) of the point among those of all ranks; `mine`, the numbers of the sites whose points
    this rank has, and `local`, these points.
    """

    def __init__(self, points: PunchPoints, sites: ContactSites):
        self.sites, self.comm = sites, points.comm
        self.index = _nearest_points(points, *points.folded(sites.x, sites.y))
        local = self.index - points.first_point
        self.mine = np.flatnonzero((self.index >= 0) & (local >= 0) & (local < points.size))
        self.local = local[self.mine]

    def collect(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values of all sites from those of this rank: integers, -1 without a point; or booleans. Collective."""
        found = np.full(len(self.sites), -1, np.int64)
        found[self.mine] = values
        whole = reduced(self.comm, found, "MAX")
        return whole > 0 if values.dtype == bool else whole


def _nearest_points(points: PunchPoints, x: NDArray[Any], y: NDArray[Any]) -> Numbers:
    """Index, among the points of all ranks, of the point under the punch that is nearest to each place [m]; -1 if there
    is none. Collective."""
    grid, best, index = points.grid, np.full(x.size, np.inf), np.full(x.size, -1, np.int64)
    # Of points at the same distance, the one nearer to the axis: mirrored positions get mirrored points.
    shift = TIE * grid.spacing
    x, y = (np.where(np.abs(place) < shift, 0.0, place - np.sign(place) * shift) for place in (x, y))
    column = np.rint((x + 0.5 * grid.length) / grid.spacing - 0.5).astype(np.int64) - points.block_start
    for row in np.flatnonzero(points.last > points.first):
        here = np.clip(column, points.first[row], points.last[row] - 1)
        away_x = grid.coordinate(points.block_start + here) - x
        away = np.hypot(away_x, grid.coordinate(points.block_start + points.row_start + row) - y)
        closer = away < best - ROUNDING * grid.spacing
        best[closer] = away[closer]
        index[closer] = (points.first_point + points.offset[row] + here - points.first[row])[closer]
    # Points are ordered by rank, so the first of equally near points is on the first rank.
    least = reduced(points.comm, best, "MIN") + ROUNDING * grid.spacing
    none = np.iinfo(np.int64).max
    index = reduced(points.comm, np.where((best <= least) & (index >= 0), index, none), "MIN")
    return np.where(index == none, -1, index)


def reduced(comm: Intracomm, values: Kind, operation: str) -> Kind:
    """Numbers reduced over all ranks, by "SUM", "MIN" or "MAX"."""
    if comm.size == 1 or not values.size:
        return values
    from mpi4py import MPI

    result: Kind = np.empty_like(values)
    comm.Allreduce(np.ascontiguousarray(values), result, op=getattr(MPI, operation))
    return result
