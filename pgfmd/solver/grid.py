"""The cell, the punch block in it, and the distribution of its points over the ranks.

The cell is a square of side L with n x n points at x_i = (i + 1/2) h - L/2, h = L/n, centred on the punch's axis, so
that a mirror-symmetric scene stays symmetric on the grid for even and odd n. Axis 0 is y, axis 1 is x. Only points
under the punch carry tractions. They fill, row by row, one interval of columns: fields live in *point vectors* that
hold these points only, in row order, the rows shared evenly over the ranks. A point vector's order does not depend on
the number of ranks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm
    from numpy.typing import DTypeLike

    from .node import RowExchange


MOST_KINDS = 12
"""Most numbers per row that are gathered on all ranks at a time."""


@dataclass(frozen=True)
class Grid:
    """A square cell: `n` points a side, `length` [m]."""

    n: int
    length: float

    @property
    def spacing(self) -> float:
        """h = L/n [m]."""
        return self.length / self.n

    @property
    def cell_area(self) -> float:
        """Area [m^2] of one grid cell."""
        return self.spacing**2

    def coordinate(self, index: np.ndarray | np.integer | int) -> np.ndarray:
        """Position [m] of the points with this index, relative to the punch's axis."""
        # Integers and halves first, which are exact, so that mirror images have the same coordinates except for the sign.
        return (np.asarray(index) + 0.5 - 0.5 * self.n) * self.spacing

    def block(self, radius: float | None) -> tuple[int, int]:
        """(start, nb): the smallest centred block of rows and columns that contains every point with r <= radius.

        The whole cell if the radius [m] is None.
        """
        if radius is None:
            return 0, self.n
        inside = np.flatnonzero(np.abs(self.coordinate(np.arange(self.n))) <= radius * (1 + 1e-12))
        if inside.size == 0:
            return (self.n - 1) // 2, 1 + (self.n + 1) % 2
        return int(inside[0]), int(inside.size)


def share(count: int, parts: int, part: int) -> tuple[int, int]:
    """(start, size) of one part of `count` items distributed evenly; the first parts get the remainder."""
    size, extra = divmod(count, parts)
    return part * size + min(part, extra), size + (part < extra)


def shares_of_rows(count: int, parts: int) -> list[tuple[int, int]]:
    """(start, size) of each part of `count` rows of points, distributed evenly in pairs, which are transformed
    together."""
    pairs = [share((count + 1) // 2, parts, part) for part in range(parts)]
    ends = [min(2 * (start + size), count) for start, size in pairs]
    return [(start, end - start) for start, end in zip([0, *ends[:-1]], ends, strict=True)]


class PunchPoints:
    """The points under the punch, and this rank's share of them.

    slab: this rank's rows of the whole cell, (first, count), if these determine which rows of the block it owns
    (possibly none). Without a slab, ranks own pairs of rows, for the transform (rows.py).
    mirror: axes of mirror symmetry: "x" for x -> -x, or "xy" for both. Only points with x > 0 (and y > 0) are stored,
    which represent their images; n is even.

    Attributes: `block_start`, `nb` (first row and column of the block in the cell, its side), `row_start`, `rows`
    (this rank's rows within the block), `top` (the first row of all ranks), `first`, `last` (rows,) the interval of
    columns under the punch in each local row, `offset` (rows + 1,) where each local row begins in the point vector,
    `size` local points, `images` number of points that each of them represents, `total` points and images on all ranks.
    """

    def __init__(
        self, grid: Grid, radius: float | None, comm: Intracomm, slab: tuple[int, int] | None = None, mirror: str = ""
    ):  # fmt: skip
        assert mirror in ("", "x", "xy") and not (mirror and grid.n % 2), "points on an axis have fewer images"
        self.grid, self.radius, self.comm, self.mirror = grid, radius, comm, mirror
        self.images = 2 ** len(mirror)
        self.block_start, self.nb = grid.block(radius)
        self.top = self.nb // 2 if "y" in mirror else 0
        if slab is None:
            start, self.rows = self.row_shares[comm.rank]
            self.row_start = self.top + start
        else:
            ends = np.clip([slab[0] - self.block_start, sum(slab) - self.block_start], 0, self.nb)
            self.row_start, self.rows = int(ends[0]), int(ends[1] - ends[0])
        self._exchange: RowExchange | None = None
        first, last = self._columns(radius)
        self._widths = last - first
        counts = np.concatenate(([0], np.cumsum(self._widths[self.top :])))
        self.total = self.images * int(counts[-1])
        mine = slice(self.row_start, self.row_start + self.rows)
        self.first, self.last = first[mine], last[mine]
        begin = self.row_start - self.top
        self.offset = counts[begin : begin + self.rows + 1] - counts[begin]
        self.first_point = int(counts[begin])
        self.size = int(self.offset[-1])

    @property
    def row_shares(self) -> list[tuple[int, int]]:
        """(start, count) of each rank's rows, relative to `top`, for the even distribution in pairs."""
        return self.shares_among(self.comm.size)

    def shares_among(self, parts: int) -> list[tuple[int, int]]:
        """The same for any number of ranks, which may exceed the number of rows."""
        return shares_of_rows(self.nb - self.top, parts)

    def _columns(self, radius: float | None) -> tuple[np.ndarray, np.ndarray]:
        """First and one-past-last block column of the points, for every row of the block."""
        if radius is None:
            first, last = np.zeros(self.nb, dtype=np.int64), np.full(self.nb, self.nb, dtype=np.int64)
        else:
            position = self.grid.coordinate(self.block_start + np.arange(self.nb))
            half_width = np.sqrt(np.maximum((radius * (1 + 1e-12)) ** 2 - position**2, 0.0))
            first = np.searchsorted(position, -half_width, side="left").astype(np.int64)
            last = np.maximum(first, np.searchsorted(position, half_width, side="right").astype(np.int64))
        if self.mirror:
            first = np.maximum(first, self.nb // 2)
            last = np.maximum(first, last)
        return first, last

    def zeros(self, dtype: DTypeLike = np.float64) -> np.ndarray:
        """A new point vector of zeros (size,)."""
        return np.zeros(self.size, dtype)

    def coordinates(self, first: int = 0, last: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        """x and y [m] of the local points, or of those from `first` to before `last`, relative to the punch's axis,
        each (count,)."""
        point = np.arange(first, self.size if last is None else min(last, self.size))
        row = np.searchsorted(self.offset, point, side="right") - 1
        column = self.first[row] + point - self.offset[row]
        x, y = (self.grid.coordinate(self.block_start + index) for index in (column, self.row_start + row))
        return x, y

    def coordinate_of(self, point: int) -> tuple[float, float]:
        """x and y [m] of one local point, by its index in a point vector."""
        x, y = self.coordinates(point, point + 1)
        return float(x[0]), float(y[0])

    def folded(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Positions x, y [m], mapped by the mirror symmetry to the stored part."""
        return (np.abs(x) if "x" in self.mirror else x), (np.abs(y) if "y" in self.mirror else y)

    def inside(self) -> np.ndarray:
        """Which of the local rows' points are under the punch, (rows, nb) bool."""
        column = np.arange(self.nb)
        return (column >= self.first[:, None]) & (column < self.last[:, None])

    def to_rows(self, values: np.ndarray, outside: float = np.nan) -> np.ndarray:
        """A point vector as rows of the block, (rows, nb), with `outside` beyond the punch."""
        rows = np.full((self.rows, self.nb), outside)
        for row, (begin, end) in enumerate(pairwise(self.offset)):
            rows[row, self.first[row] : self.last[row]] = values[begin:end]
        return rows

    @cached_property
    def whole(self) -> PunchPoints:
        """All points under the punch including images, with an even distribution of rows."""
        return PunchPoints(self.grid, self.radius, self.comm) if self.mirror else self

    def unfold(self, values: np.ndarray) -> np.ndarray:
        """A point vector (size,) completed by mirror images: a point vector of `whole`; unchanged without symmetry.
        Collective."""
        if not self.mirror:
            return values
        whole = self.whole
        wanted = [start + np.arange(count) for start, count in whole.row_shares]
        if "y" in self.mirror:
            wanted = [np.maximum(rows, self.nb - 1 - rows) for rows in wanted]
        mine, result = wanted[self.comm.rank], np.empty(whole.size, values.dtype)
        # Halves of rows are sent from the ranks that have them to those that need them, in the order of the latter, row by
        # row: indices of points would take more memory than the points.
        for (start, count), part in zip(self.row_shares, self._halves(values, wanted), strict=True):
            there, end = np.flatnonzero((mine >= self.top + start) & (mine < self.top + start + count)), 0
            for row in there:
                begin, end = end, end + self._widths[mine[row]]
                middle = whole.offset[row] + end - begin
                result[whole.offset[row] : middle] = part[begin:end][::-1]
                result[middle : whole.offset[row + 1]] = part[begin:end]
        return result

    def _halves(self, values: np.ndarray, wanted: list[np.ndarray]) -> list[np.ndarray]:
        """The rows that this rank wants (by index in the block), from the ranks that own them; wanted: for every rank.
        Collective."""
        parts = []
        for rows in wanted:
            here = rows[(rows >= self.row_start) & (rows < self.row_start + self.rows)] - self.row_start
            if here.size and (np.diff(here) == 1).all():
                parts.append(values[self.offset[here[0]] : self.offset[here[-1] + 1]])
            else:
                parts.append(
                    np.concatenate([values[:0], *(values[self.offset[row] : self.offset[row + 1]] for row in here)])
                )
        if self.comm.size == 1:
            return parts
        from mpi4py import MPI

        received, requests = [], []
        for rank, (start, count) in enumerate(self.row_shares):
            mine = wanted[self.comm.rank]
            mine = mine[(mine >= self.top + start) & (mine < self.top + start + count)]
            received.append(np.empty(self._widths[mine].sum(), values.dtype) if rank != self.comm.rank else parts[rank])
            if rank != self.comm.rank and received[rank].size:
                requests.append(self.comm.Irecv(received[rank], rank))
        others = [(rank, part) for rank, part in enumerate(parts) if rank != self.comm.rank and part.size]
        requests += [self.comm.Isend(part, rank) for rank, part in others]
        MPI.Request.Waitall(requests)
        return received

    def all_rows(self, local: np.ndarray) -> np.ndarray:
        """Numbers per row, for the local rows (kinds, rows), gathered from all ranks: (kinds, all rows).

        Sums and maxima over the result have the same bits on every rank and for any number of ranks. Valid until the
        next call. Collective.
        """
        if self.comm.size == 1:
            return local
        if self._exchange is None:
            from .node import Node, RowExchange

            self._exchange = RowExchange(
                Node.of(self.comm), self.row_start - self.top, self.rows, self.nb - self.top, MOST_KINDS
            )
        return self._exchange(local)

    def summed(self, rows: np.ndarray) -> np.ndarray:
        """Sums (kinds,) over all points under the punch including images, from partial sums as returned by `all_rows`."""
        sums: np.ndarray = rows.sum(axis=1)
        return self.images * sums if self.images > 1 else sums

    def total_of(self, local: np.ndarray) -> np.ndarray:
        """Sums over all points under the punch including images, from partial sums (kinds, rows); returns (kinds,).
        Collective."""
        return self.summed(self.all_rows(local))

    def reduced(self, local: np.ndarray, sums: int) -> list[float]:
        """Reduces numbers per row, (kinds, rows): the first `sums` kinds to sums over all points under the punch
        including images, the others to maxima. The same bits on every rank and for any number of ranks. Collective."""
        out = np.empty(local.shape[0])
        self._reduce(self.all_rows(local), sums, self.images, out)
        return out.tolist()

    @cached_property
    def _reduce(self) -> Callable[[np.ndarray, int, int, np.ndarray], None]:
        # Points are also counted by programs that compute nothing.
        from .kernels import reduce_rows

        return reduce_rows

    def maximum_of(self, local: float) -> float:
        """The maximum of one number per rank, the same on every rank. Collective."""
        return self.maxima_of(local)[0]

    def maxima_of(self, *local: float) -> list[float]:
        """The maxima over all ranks of each number, the same on every rank. Collective."""
        if self.comm.size == 1:
            return [float(value) for value in local]
        from mpi4py import MPI

        largest = np.empty(len(local))
        self.comm.Allreduce(np.array(local, dtype=float), largest, op=MPI.MAX)
        return largest.tolist()
