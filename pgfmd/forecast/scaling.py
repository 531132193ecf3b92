"""Parallel scaling of a pair of transforms and of the work per pair: exact counts of communication, and a model of the
time. No MPI.

A step consists of pairs (transform.py) and, for each pair, pointwise work and sums over all rows (grid.py). At each
synchronisation every rank waits for the slowest, so each part takes as long as on the rank with the largest share.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pgfmd.solver.grid import PunchPoints, share, shares_of_rows

KINDS = 6
"""Numbers per row in a sum over all ranks: those of an iteration of conjugate gradients."""

SUMS = 3.0
"""Number of sums over all rows per pair: 2.6 to 3.8 in runs of the shipped scenes, more for short steps."""


PARTS_OF = {"": "whole", "x": "half", "xy": "quarter"}
"""Part of the punch that is computed, by the axes of mirror symmetry."""


@dataclass(frozen=True)
class Problem:
    """The data that are distributed over ranks.

    side: points per side of the whole transform. rows: number of rows of points, without mirror images. ends (rows +
    1,): number of points before each row, and in total. mirror: as in PunchPoints. precision: of the scene; in mixed
    precision nearly all transforms are single, and are counted as such.
    """

    side: int
    rows: int
    ends: np.ndarray
    mirror: str = ""
    precision: str = "double"

    @classmethod
    def of(cls, points: PunchPoints, side: int, precision: str = "double") -> Problem:
        """For the points under a punch, which are all on one rank."""
        return cls(side, points.rows, points.offset, points.mirror, precision)

    @property
    def kind(self) -> str:
        """Precision and part of the punch, as "mixed half": problems of a kind have the same costs."""
        return f"{self.precision} {PARTS_OF[self.mirror]}"

    @property
    def itemsize(self) -> int:
        """Bytes of a complex number."""
        return 16 if self.precision == "double" else 8

    @property
    def columns(self) -> int:
        """Complex columns between the transforms of rows and of columns: of mirror images, two real ones each."""
        columns = self.side // 2 + 1
        return columns // 2 if self.mirror else columns

    @property
    def length(self) -> int:
        """Complex numbers of a column that is transformed."""
        return self.side // 2 if "y" in self.mirror else self.side

    @property
    def most_ranks(self) -> int:
        """Largest number of ranks that have at least a pair of rows and a column each."""
        return min((self.rows + 1) // 2, self.columns)

    def shares(self, ranks: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Numbers of rows, columns and points of each rank, (ranks,)."""
        rows = np.array([size for _, size in shares_of_rows(self.rows, ranks)])
        columns = np.array([share(self.columns, ranks, rank)[1] for rank in range(ranks)])
        return rows, columns, np.diff(self.ends[np.cumsum(rows)], prepend=0)


@dataclass(frozen=True)
class Traffic:
    """Communication of a rank.

    shared: bytes written to or read from memory of other ranks of its node. sent: bytes in messages to other nodes;
    messages: their number. meetings: synchronisations of the ranks of its node. gathers: collective calls with one rank
    per node.
    """

    shared: int = 0
    sent: int = 0
    messages: int = 0
    meetings: int = 0
    gathers: int = 0


def nodes_of(ranks: int, per_node: int) -> list[int]:
    """The node of each rank, if nodes are filled one after another."""
    return [rank // per_node for rank in range(ranks)]


def traffic_of_pair(problem: Problem, nodes: Sequence[int], rank: int) -> Traffic:
    """Communication of a rank for one pair of transforms (node.Transposition).

    nodes: that of each rank. There, its rows become others' columns; back, its columns become others' rows.
    """
    ranks, here = len(nodes), np.asarray(nodes) == nodes[rank]
    rows, columns, _ = problem.shares(ranks)
    there, back = rows[rank] * columns, rows * columns[rank]
    mine = here.copy()
    mine[rank] = False
    # In shared memory a rank does both directions itself: it writes its rows, and reads them again.
    shared = 2 * int(there[mine].sum()) * problem.itemsize
    sent = int(there[~here].sum() + back[~here].sum()) * problem.itemsize
    messages = int((there[~here] > 0).sum() + (back[~here] > 0).sum())
    return Traffic(shared, sent, messages, 2 if here.sum() > 1 else 0)


def traffic_of_sum(nodes: Sequence[int], rank: int) -> Traffic:
    """Communication of a rank for one sum over all rows (node.RowExchange), without the few bytes."""
    here, several = sum(node == nodes[rank] for node in nodes), len(set(nodes)) > 1
    leads = rank == min(other for other, node in enumerate(nodes) if node == nodes[rank])
    meetings = (1 + several) if here > 1 else 0
    return Traffic(meetings=meetings, gathers=int(several and leads))


@dataclass(frozen=True)
class Network:
    """Between nodes. latency [s]: of a message. message [s]: of a rank's own time for each. bandwidth [bytes/s]: of a
    node, which its ranks share."""

    latency: float = 1.5e-6
    message: float = 0.3e-6
    bandwidth: float = 12e9


@dataclass(frozen=True)
class Costs:
    """What the work of one kind of problem costs on a machine, measured by benchmark/ranks.py.

    sizes: points a side, rising, for which one rank has been measured: `row` and `column`, seconds of the transforms of
    one, both ways; and, with as many `points` on the rank, `point`, seconds for each point of the passes over the
    fields that come with a sum. pair_overhead, sum_overhead [s]: of a pair's transforms, and of a sum with its passes,
    what no rank takes off another. sums: over all rows, a pair. adding [s]: for each row in all and sum. crowding: by
    which factor work takes longer where 1, 2, ... ranks of a node work side by side. meeting [s]: of two ranks; look
    [s]: for each further rank. shared [s]: for each byte in the memory of another rank.
    """

    sizes: tuple[int, ...]
    row: tuple[float, ...]
    column: tuple[float, ...]
    points: tuple[int, ...]
    point: tuple[float, ...]
    pair_overhead: float
    sum_overhead: float
    sums: float = SUMS
    adding: float = 0.0
    crowding: tuple[float, ...] = (1.0,)
    meeting: float = 0.0
    look: float = 0.0
    shared: float = 0.0

    def of_line(self, measured: tuple[float, ...], side: int) -> float:
        """Seconds of a row's or column's transforms of this length: n log n between and beyond those measured."""
        lengths = np.array(self.sizes, dtype=float)
        factors = np.array(measured) / (lengths * np.log2(lengths))
        return float(np.interp(math.log(side), np.log(lengths), factors)) * side * math.log2(side)

    def of_point(self, points: int) -> float:
        """Seconds for each of so many points on a rank, a sum."""
        return float(np.interp(math.log(max(points, 1)), np.log(self.points), self.point))

    def crowd(self, ranks: int) -> float:
        """The factor of so many ranks on a node: between those measured, and beyond them that of the most."""
        return float(np.interp(ranks, np.arange(1, len(self.crowding) + 1), self.crowding))


PARTS = ("rows", "columns", "pointwise", "overhead", "imbalance", "sums", "shared memory", "latency", "bandwidth")
"""Parts of the time of a pair: work for an even distribution, and losses."""
STRETCHES = ((0.5, 0.0, 0.4), (0.0, 1.0, 0.0), (0.5, 0.0, 0.1), (0.0, 0.0, 0.5))
"""Shares of the transforms of rows, of columns, and of the pointwise work that are done from one meeting of all ranks
to the next. Conjugate gradients turn their direction (12 vectors are read or written) before the rows are transformed,
look at the result (3) after they have come back; all else comes with sums of its own."""


def pair_seconds(
    problem: Problem, ranks: int, costs: Costs, per_node: int | None = None, network: Network = Network(),
    shares: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None,
) -> dict[str, float]:  # fmt: skip
    """Time [s] of a pair with all other work per pair, by `PARTS`.

    per_node: ranks on a node, all of them if None. shares: rows, columns and points of each rank, if different from the
    distribution of a run.
    """
    per_node = min(per_node or ranks, ranks)
    shares = shares or problem.shares(ranks)
    each = (
        costs.of_line(costs.row, problem.side), costs.of_line(costs.column, problem.side),
        costs.sums * costs.of_point(int(problem.ends[-1]) // ranks),
    )  # fmt: skip
    work = [costs.crowd(per_node) * seconds * counts for seconds, counts in zip(each, shares, strict=True)]
    stretches = [[share * part for share, part in zip(stretch, work, strict=True)] for stretch in STRETCHES]
    slowest = sum([float(sum(parts[1:], start=parts[0]).max()) for parts in stretches])
    fair = [float(part.sum()) / ranks for part in work]
    nodes = nodes_of(ranks, per_node)
    # The first rank has one more row and column if there is a remainder.
    pair, one = traffic_of_pair(problem, nodes, 0), traffic_of_sum(nodes, 0)
    meeting = costs.meeting + (per_node - 2) * costs.look if per_node > 1 else 0.0
    sums, latency, bandwidth = _between_nodes(problem, shares, pair, per_node, network)
    sums += one.meetings * meeting + (costs.adding * problem.rows if ranks > 1 else 0.0)
    found = (
        *fair, costs.pair_overhead + costs.sums * costs.sum_overhead, slowest - sum(fair), costs.sums * sums,
        pair.shared * costs.shared + pair.meetings * meeting, latency, bandwidth,
    )  # fmt: skip
    return dict(zip(PARTS, found, strict=True))


def _between_nodes(
    problem: Problem, shares: tuple[np.ndarray, np.ndarray, np.ndarray], pair: Traffic, per_node: int, network: Network
) -> tuple[float, float, float]:
    """Time [s] of communication between nodes: of a sum, and of a pair's messages, by latency and by bandwidth."""
    rows, columns, _ = shares
    count = -(-rows.size // per_node)
    if count == 1:
        return 0.0, 0.0, 0.0
    # Bytes that a node sends, in both directions of the transposition; it receives as many at the same time.
    rows_here, columns_here = rows[:per_node].sum(), columns[:per_node].sum()
    sent = float(problem.itemsize) * (
        rows_here * (columns.sum() - columns_here) + columns_here * (rows.sum() - rows_here)
    )
    bytes_of_sum = 8.0 * KINDS * problem.rows * (count - 1) / count
    of_sum = math.ceil(math.log2(count)) * network.latency + bytes_of_sum / network.bandwidth
    return of_sum, pair.messages * network.message + 2.0 * network.latency, sent / network.bandwidth


def total_seconds(
    problem: Problem, ranks: int, costs: Costs, per_node: int | None = None, network: Network = Network(),
    sums: float | None = None,
) -> float:  # fmt: skip
    """Total time [s] of a pair. sums: number of sums over all rows per pair, if different from the costs."""
    costs = costs if sums is None else replace(costs, sums=sums)
    return sum(pair_seconds(problem, ranks, costs, per_node, network).values())
