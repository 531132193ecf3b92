"""Connected patches of contact, found by all ranks together, and what each of them carries. Collective.

Contact is where the gap is below the law's contact_gap (cohesion.py), as in the contact area. Points are connected through the four sides of their
cells: two that share a corner only have no width of contact between them. Only where the punch fills the cell do
patches go on across its edges. Patches are numbered by their first points, row by row, whatever the number of ranks.

Each rank labels its rows. Labels that meet at the edge of two ranks' rows are joined on all ranks; one row a rank is
sent. Counts and positions are sums of whole numbers, forces are summed row by row in the order of the rows: the same
bits for any number of ranks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pgfmd.errors import RunError
from pgfmd.physics.contact_sites import KINDS, ContactSites

from .grid import PunchPoints

Numbers = NDArray[np.int64]

MERGED = "merged"
"""Kind of a patch that holds sites of several kinds."""

MOST = 2**31 - 1
"""What MPI counts to."""
TIE = 1e-6
"""Shift towards the axis, in grid spacings, by which a place half-way between two points is decided."""
ROUNDING = 1e-9
"""Distances that differ by less, in grid spacings, are the same: of such points the first is taken."""


@dataclass(frozen=True)
class Patch:
    """A connected patch of contact.

    area [m^2]; force [N], of the points in contact alone, positive in compression; x, y [m]: centre of its area.
    summits, saddles, valleys: how many of the punch's sites are in it. kind: theirs, "merged" if there are several,
    empty without any. nearest: kind of the site that is nearest to the centre; empty for a face without sites.
    """

    number: int
    area: float
    force: float
    x: float
    y: float
    summits: int
    saddles: int
    valleys: int
    kind: str
    nearest: str


@dataclass(frozen=True)
class Labels:
    """of_point: number of each local point's patch, -1 without contact (size,). first: first point of each patch, as
    row and column of the punch block, (2, count), the same on every rank."""

    of_point: Numbers
    first: Numbers

    @property
    def count(self) -> int:
        """Number of patches on all ranks."""
        return self.first.shape[1]


class SitePoints:
    """The grid points that stand for a face's sites: for each the nearest point under the punch, or its mirror image.
    Collective.

    Attributes: `index` (count,) of the point among those of all ranks; `mine`, the numbers of the sites whose points
    this rank has, and `local`, these points.
    """

    def __init__(self, points: PunchPoints, sites: ContactSites):
        self.sites, self.comm = sites, points.comm
        self.index = _nearest_points(points, *points.folded(sites.x, sites.y))
        local = self.index - points.first_point
        self.mine = np.flatnonzero((self.index >= 0) & (local >= 0) & (local < points.size))
        self.local = local[self.mine]

    def collect(self, values: NDArray) -> NDArray:
        """Of each site of the face, from those of this rank: a whole number, -1 without a point; or a truth value. Collective."""
        found = np.full(len(self.sites), -1, np.int64)
        found[self.mine] = values
        found = _reduced(self.comm, found, "MAX")
        return found > 0 if values.dtype == bool else found


def label_contact(points: PunchPoints, contact: NDArray[np.bool_], periodic: bool) -> Labels:
    """The patches of a contact (size,). periodic: whether the punch fills the cell, and patches go on across its edges.
    Collective."""
    comm, inside = points.comm, points.inside()
    rows = np.zeros(inside.shape, bool)
    rows[inside] = contact
    local, count = ndimage.label(rows) if rows.size else (np.zeros(rows.shape, np.int32), 0)
    place = np.flatnonzero(rows)
    _, begins = np.unique(local.ravel()[place], return_index=True)
    found = comm.allgather((points.rows, count))
    before = [0, *np.cumsum([count for _, count in found])]
    whole = np.where(local > 0, local + before[comm.rank] - 1, -1)
    pairs = [_across_ranks(comm, whole, [size for size, _ in found], periodic)]
    if periodic and rows.size:
        pairs.append(_meeting(whole[:, -1], whole[:, 0]))
    (firsts,) = _of_all(points, (place[begins] + points.row_start * points.nb)[np.newaxis])
    number_of, first = _joined(_of_all(points, np.concatenate(pairs, axis=1)), firsts)
    labels = whole[inside]
    held = labels >= 0
    labels[held] = number_of[labels[held]]
    return Labels(labels.astype(np.int64), np.array(np.divmod(first, points.nb)))


def _of_all(points: PunchPoints, mine: Numbers) -> Numbers:
    """Whole numbers (kinds, any) of all ranks side by side, in the order of the ranks. Collective. RunError on every
    rank where they are more than MPI can count."""
    comm = points.comm
    if comm.size == 1:
        return mine.astype(np.int64)
    counts = comm.allgather(mine.shape[1])
    if sum(counts) > MOST:
        raise RunError(
            f"the contact of {points.grid.n} x {points.grid.n} points has {sum(counts)} pieces on {comm.size} ranks, "
            f"and MPI can't gather more than {MOST}: set output.patches = false, or use fewer ranks"
        )
    whole = np.empty((len(mine), sum(counts)), np.int64)
    for values, every in zip(np.ascontiguousarray(mine, np.int64), whole):
        comm.Allgatherv(values, [every, counts])
    return whole


def _across_ranks(comm, whole: Numbers, sizes: list[int], periodic: bool) -> Numbers:
    """Pairs of labels that meet between this rank's first row and the last row of the rank before it, (2, pairs).

    Ranks without rows take no part. In a periodic cell, the last row meets the first.
    """
    occupied = [rank for rank, size in enumerate(sizes) if size]
    if comm.rank not in occupied:
        return np.zeros((2, 0), np.int64)
    place, last = occupied.index(comm.rank), len(occupied) - 1
    # Ring of the ranks, open between the last and the first unless the cell is periodic.
    to = occupied[(place + 1) % len(occupied)] if place < last or periodic else None
    of = occupied[place - 1] if place > 0 or periodic else None
    edge = np.ascontiguousarray(whole[-1], np.int64)
    above = edge
    if (to, of) != (comm.rank, comm.rank):
        request = comm.isend(edge, to) if to is not None else None
        above = comm.recv(source=of) if of is not None else None
        if request:
            request.wait()
    return np.zeros((2, 0), np.int64) if above is None else _meeting(above, whole[0])


def _meeting(one: Numbers, other: Numbers) -> Numbers:
    """The pairs of labels of two lines of points that lie side by side, each once, (2, pairs)."""
    both = (one >= 0) & (other >= 0)
    return np.unique(np.array([one[both], other[both]], np.int64), axis=1)


def _joined(pairs: Numbers, firsts: Numbers) -> tuple[Numbers, Numbers]:
    """Number of each label's patch, and the first point of each patch, by which patches are ordered."""
    total = firsts.size
    if not total:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    graph = coo_array((np.ones(pairs.shape[1], bool), (pairs[0], pairs[1])), shape=(total, total))
    count, group = connected_components(graph, directed=False)
    first = np.full(count, np.iinfo(np.int64).max)
    np.minimum.at(first, group, firsts)
    order = np.argsort(first)
    number = np.empty(count, np.int64)
    number[order] = np.arange(count)
    return number[group], first[order]


def patches_of(
    points: PunchPoints, gap: NDArray, traction: NDArray, places: SitePoints, contact_gap: float, periodic: bool = False
) -> list[Patch]:
    """The patches of a gap [m] under a traction [Pa] (size,), in order; contact: below contact_gap [m]. The same list
    on every rank. Collective."""
    labels = label_contact(points, gap < contact_gap, periodic)
    counts, x, y = centres(points, labels, periodic)
    forces = -points.grid.cell_area * _tractions(points, labels, traction)
    sites = places.sites
    patch_of_site = places.collect(labels.of_point[places.local])
    held = np.zeros((len(KINDS), labels.count), np.int64)
    hit = patch_of_site >= 0
    np.add.at(held, (sites.kind[hit], patch_of_site[hit]), 1)
    nearest = _nearest_kinds(sites, x, y, points.grid.length if periodic else None)
    areas = counts * points.grid.cell_area
    return [
        Patch(k, float(areas[k]), float(forces[k]), float(x[k]), float(y[k]), *held[:, k].tolist(), _kind(held[:, k]),
              nearest[k])
        for k in range(labels.count)
    ]  # fmt: skip


def _kind(held: Numbers) -> str:
    kinds = np.flatnonzero(held)
    return MERGED if kinds.size > 1 else KINDS[kinds[0]] if kinds.size else ""


def _nearest_kinds(sites: ContactSites, x: NDArray, y: NDArray, side: float | None) -> list[str]:
    if not len(sites):
        return [""] * x.size
    places, wanted = np.column_stack([sites.x, sites.y]), np.column_stack([x, y])
    if side is not None:
        # Measured around the cell, from its corner.
        places, wanted = np.mod(places + 0.5 * side, side), np.mod(wanted + 0.5 * side, side)
    _, nearest = cKDTree(places, boxsize=side).query(wanted)
    return [KINDS[kind] for kind in sites.kind[nearest]]


def centres(points: PunchPoints, labels: Labels, periodic: bool) -> tuple[Numbers, NDArray, NDArray]:
    """Number of points of each patch, and x and y [m] of the centre of its area. Collective.

    In a periodic cell distances from the patch's first point are counted the shorter way around; a patch that
    stretches over half the cell or more has no centre that means anything.
    """
    held = labels.of_point >= 0
    patch = labels.of_point[held]
    sums = np.zeros((3, labels.count), np.int64)
    sums[0] = np.bincount(patch, minlength=labels.count)
    n = points.grid.n
    for axis, index in enumerate(_rows_and_columns(points)):
        away = index[held] - labels.first[axis, patch]
        if periodic:
            away = (away + n // 2) % n - n // 2
        np.add.at(sums[1 + axis], patch, away)
    sums = _reduced(points.comm, sums, "SUM")
    middle = points.block_start + labels.first + sums[1:] / np.maximum(sums[0], 1)
    if periodic:
        middle = (middle + 0.5) % n - 0.5
    y, x = points.grid.coordinate(middle)
    return sums[0], x, y


def _rows_and_columns(points: PunchPoints) -> tuple[Numbers, Numbers]:
    """Row and column in the punch block of each local point, (size,) each."""
    rows, columns = np.nonzero(points.inside())
    return rows + points.row_start, columns


def _tractions(points: PunchPoints, labels: Labels, traction: NDArray) -> NDArray:
    """Sum of the traction [Pa] over each patch's points."""
    held = labels.of_point >= 0
    # A row belongs to one rank: sums over a row's points are the same for any number of ranks.
    keys, of_key = np.unique(
        labels.of_point[held] * points.nb + _rows_and_columns(points)[0][held], return_inverse=True
    )
    sums = np.bincount(of_key, weights=traction[held].astype(np.float64), minlength=keys.size)
    # From rank to rank, each adding its rows: no rank needs those of all.
    comm, total = points.comm, np.zeros(labels.count)
    if comm.rank > 0:
        comm.Recv(total, comm.rank - 1)
    np.add.at(total, keys // points.nb, sums)
    if comm.rank < comm.size - 1:
        comm.Send(total, comm.rank + 1)
    comm.Bcast(total, comm.size - 1)
    return total


def _nearest_points(points: PunchPoints, x: NDArray, y: NDArray) -> Numbers:
    """Index, among the points of all ranks, of the point under the punch that is nearest to each place [m]; -1 if there
    is none. Collective."""
    grid, best, index = points.grid, np.full(x.size, np.inf), np.full(x.size, -1, np.int64)
    # Of points that are equally far, the one nearer to the axis: places that mirror each other get points that do.
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
    # The ranks' points follow each other, so of those that are as near the first is that of the first rank.
    least = _reduced(points.comm, best, "MIN") + ROUNDING * grid.spacing
    none = np.iinfo(np.int64).max
    index = _reduced(points.comm, np.where((best <= least) & (index >= 0), index, none), "MIN")
    return np.where(index == none, -1, index)


def _reduced(comm, values: NDArray, operation: str) -> NDArray:
    """Numbers reduced over all ranks, by "SUM", "MIN" or "MAX"."""
    if comm.size == 1 or not values.size:
        return values
    from mpi4py import MPI

    result = np.empty_like(values)
    comm.Allreduce(np.ascontiguousarray(values), result, op=getattr(MPI, operation))
    return result
