"""Connected patches of contact: labelling by all ranks together, areas and forces. Collective.

Contact is where the gap is below the law's contact_gap, as for the contact area. Points are connected through the four
sides of their grid cells, not through corners. Patches continue across the edges of the cell only if the punch fills
it. Patches are numbered by their first points, row by row, for any number of ranks.

Each rank labels its rows. Labels that touch at the boundary of two ranks are joined on all ranks; each rank sends one
row. Counts and positions are sums of integers, and forces are summed row by row in the order of the rows, so they have
the same bits for any number of ranks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pgfmd.errors import RunError
from pgfmd.physics.contact_sites import KINDS, ContactSites

from .grid import PunchPoints
from .sites import SitePoints, reduced

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

Numbers = NDArray[np.int64]
Array = NDArray[np.floating]

MERGED = "merged"
"""Kind of a patch that contains sites of several kinds."""

MOST = 2**31 - 1
"""Largest count of MPI."""


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
        return int(self.first.shape[1])


def label_contact(points: PunchPoints, contact: NDArray[np.bool_], periodic: bool) -> Labels:
    """The patches of a contact (size,). periodic: whether the punch fills the cell, and patches go on across its edges.
    Collective."""
    comm, rows = points.comm, points.to_rows(contact, outside=False)
    local: NDArray[np.int32]
    local, count = ndimage.label(rows) if rows.size else (np.zeros(rows.shape, np.int32), 0)
    del rows
    found = comm.allgather((points.rows, count))
    before = sum(count for _, count in found[: comm.rank])

    def everywhere(line: NDArray[np.int32]) -> Numbers:
        """The labels of a line of points among those of all ranks; -1 without contact."""
        return np.where(line > 0, line + np.int64(before - 1), -1)

    edges = everywhere(local[[0, -1]] if len(local) else np.zeros((2, points.nb), np.int32))
    pairs = [_across_ranks(comm, edges, [size for size, _ in found], periodic)]
    if periodic and local.size:
        pairs.append(_meeting(everywhere(local[:, -1]), everywhere(local[:, 0])))
    (firsts,) = _of_all(points, _first_points(points, local, count)[np.newaxis])
    number_of, first = _joined(_of_all(points, np.concatenate(pairs, axis=1)), firsts)
    number = np.concatenate(([-1], number_of[before : before + count]))
    labels = np.empty(points.size, np.int64)
    for row, line in enumerate(local):
        labels[points.offset[row] : points.offset[row + 1]] = number[line[points.first[row] : points.last[row]]]
    return Labels(labels, np.array(np.divmod(first, points.nb)))


def _first_points(points: PunchPoints, local: NDArray[np.int32], count: int) -> Numbers:
    """Where in the punch block, row by row, the first point of each label 1 ... count of this rank is."""
    first = np.zeros(count, np.int64)
    # From behind: what is first comes last.
    for row in reversed(range(len(local))):
        columns = np.flatnonzero(local[row])[::-1]
        first[local[row, columns] - 1] = (points.row_start + row) * points.nb + columns
    return first


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
    for values, every in zip(np.ascontiguousarray(mine, np.int64), whole, strict=True):
        comm.Allgatherv(values, [every, counts])
    return whole


def _across_ranks(comm: Intracomm, edges: Numbers, sizes: list[int], periodic: bool) -> Numbers:
    """Pairs of labels that meet between this rank's first row and the last row of the rank before it, (2, pairs).

    edges: the labels of this rank's first and last row.

    Ranks without rows take no part. In a periodic cell, the last row meets the first.
    """
    occupied = [rank for rank, size in enumerate(sizes) if size]
    if comm.rank not in occupied:
        return np.zeros((2, 0), np.int64)
    place, last = occupied.index(comm.rank), len(occupied) - 1
    # Ring of the ranks, open between the last and the first unless the cell is periodic.
    to = occupied[(place + 1) % len(occupied)] if place < last or periodic else None
    of = occupied[place - 1] if place > 0 or periodic else None
    edge = above = edges[1]
    if (to, of) != (comm.rank, comm.rank):
        request = comm.isend(edge, to) if to is not None else None
        above = comm.recv(source=of) if of is not None else None
        if request:
            request.wait()
    return np.zeros((2, 0), np.int64) if above is None else _meeting(above, edges[0])


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
    points: PunchPoints,
    gap: Array,
    traction: Array,
    places: SitePoints,
    contact_gap: float,
    periodic: bool = False,
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
        Patch(k, float(areas[k]), float(forces[k]), float(x[k]), float(y[k]), int(held[0, k]), int(held[1, k]),
              int(held[2, k]), _kind(held[:, k]), nearest[k])
        for k in range(labels.count)
    ]  # fmt: skip


def _kind(held: Numbers) -> str:
    kinds = np.flatnonzero(held)
    return MERGED if kinds.size > 1 else KINDS[kinds[0]] if kinds.size else ""


def _nearest_kinds(sites: ContactSites, x: Array, y: Array, side: float | None) -> list[str]:
    if not len(sites):
        return [""] * x.size
    places, wanted = np.column_stack([sites.x, sites.y]), np.column_stack([x, y])
    if side is not None:
        # Measured around the cell, from its corner.
        places, wanted = np.mod(places + 0.5 * side, side), np.mod(wanted + 0.5 * side, side)
    _, nearest = cKDTree(places, boxsize=side).query(wanted)
    return [KINDS[kind] for kind in sites.kind[nearest]]


def centres(points: PunchPoints, labels: Labels, periodic: bool) -> tuple[Numbers, Array, Array]:
    """Number of points of each patch, and x and y [m] of the centre of its area. Collective.

    In a periodic cell distances from the patch's first point are counted the shorter way around; a patch that
    stretches over half the cell or more has no centre that means anything.
    """
    sums: Numbers = np.zeros((3, labels.count), np.int64)
    n = points.grid.n
    # Row by row, here and below: indices of all points would take more memory than the fields.
    for row, patch, columns, _ in _rows_in_contact(points, labels):
        np.add.at(sums[0], patch, 1)
        for axis, index in enumerate((points.row_start + row, columns)):
            away = index - labels.first[axis, patch]
            if periodic:
                away = (away + n // 2) % n - n // 2
            np.add.at(sums[1 + axis], patch, away)
    sums = reduced(points.comm, sums, "SUM")
    middle = points.block_start + labels.first + sums[1:] / np.maximum(sums[0], 1)
    if periodic:
        middle = (middle + 0.5) % n - 0.5
    y, x = points.grid.coordinate(middle)
    return sums[0], x, y


def _rows_in_contact(points: PunchPoints, labels: Labels) -> Iterator[tuple[int, Numbers, Numbers, Numbers]]:
    """Of each local row with contact, its index among these, and of its points in contact: patches, columns in the
    punch block, indices."""
    for row, (begin, end) in enumerate(pairwise(points.offset)):
        held = np.flatnonzero(labels.of_point[begin:end] >= 0)
        if held.size:
            yield row, labels.of_point[begin + held], points.first[row] + held, begin + held


def _tractions(points: PunchPoints, labels: Labels, traction: Array) -> Array:
    """Sum of the traction [Pa] over each patch's points."""
    # A row belongs to one rank: sums over a row's points are the same for any number of ranks. From rank to rank, each
    # adding its rows: no rank needs those of all.
    comm, total = points.comm, np.zeros(labels.count)
    if comm.rank > 0:
        comm.Recv(total, comm.rank - 1)
    for _, patch, _, held in _rows_in_contact(points, labels):
        patches, of_patch = np.unique(patch, return_inverse=True)
        total[patches] += np.bincount(of_patch, weights=traction[held].astype(np.float64))
    if comm.rank < comm.size - 1:
        comm.Send(total, comm.rank + 1)
    comm.Bcast(total, comm.size - 1)
    return total
