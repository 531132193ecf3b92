"""Newton's correction by conjugate gradients with a coarse-grid (two-grid) preconditioner (conjugate_gradients.py).

Preconditioned by A alone, conjugate gradients take one pair of transforms for each of the few long waves that a contact
stiffens. A grid of cells of m x m points represents these waves at little cost. So the direction is

    z = A d,   d = r - K P s_c + (a constant in each cell such that the cell means of d are t_c),

where s_c with its dual t_c solves (A_c^-1 + K_c) s_c = R r on the cells. R is the mean over cells, K_c = R K, A_c is
the same compliance on the coarse grid, and P is an interpolation. For long waves t_c = A^-1 s is the dual of the
solution. Short waves converge as in Picard's iteration, since A K is small for them. The dual d of z is known, so there
is still one pair per iteration, and A^-1 is never applied. s_c is an approximate solution, so that the preconditioner
changes in each iteration; therefore the direction is made conjugate to the last one by its curvature (flexible
conjugate gradients: Notay, SIAM J. Sci. Comput. 22, 1444 (2000)). The cells also give an estimate of the remaining
correction; if it is small, the iteration ends without another pair.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import kernels
from . import two_grid_kernels as between
from .conjugate_gradients import ConjugateGradients
from .grid import Grid, PunchPoints
from .tiles import Convolves

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.physics.adhesion.base import CohesiveLaw

    from .node import RowExchange

MARGIN = 1.5
"""Extension of the coarse grid beyond the punch, in its spacings, so that each point is between four coarse points."""
MOST = 30
"""Number of iterations after which conjugate gradients continue without the coarse grid; three are usual."""
ROUGH_SHARE = 0.25
"""Estimate of the remaining displacement within cells, as a fraction of the largest residual there times the compliance
of waves two cells long. (Waves within a cell are shorter, and signs differ.)"""
BALANCE_SHARE = 0.2
"""The same for the force imbalance."""
COARSE_SHARE = 0.3
"""Tolerance of the problem on the cells, relative to that of the correction."""


def coarse_points_of(points: PunchPoints, m: int, comm: Intracomm) -> PunchPoints:
    """The points of the coarse grid of cells of m x m points. n must be divisible by m, and by 2 m with mirror
    symmetry."""
    grid = Grid(points.grid.n // m, points.grid.length)
    radius = None if points.radius is None else points.radius + MARGIN * grid.spacing
    return PunchPoints(grid, radius, comm, mirror=points.mirror)


@dataclass(frozen=True)
class CoarseGrid:
    """points: of `coarse_points_of`, all of them on this rank; operator: the Convolution with G0 between them; shortest
    [m/Pa]: G0 of the shortest waves on this grid, two spacings long."""

    points: PunchPoints
    operator: Convolves
    shortest: float


class Cells:
    """Transfers numbers between the local points and all cells, (rows, columns), of a coarse grid. Each rank has all
    cells.

    points: PunchPoints; coarse: the PunchPoints of `coarse_points_of`, on one rank.
    """

    def __init__(self, points: PunchPoints, coarse: PunchPoints) -> None:
        self.points, self.coarse, self.m = points, coarse, points.grid.n // coarse.grid.n
        left = coarse.nb // 2 if coarse.mirror else 0
        top = (coarse.block_start + coarse.top) * self.m
        self._begin = points.block_start + points.row_start - top
        self._begin_of_all = points.block_start + points.top - top
        self._first = points.block_start + points.first - (coarse.block_start + left) * self.m
        self.shape = coarse.rows, coarse.nb - left
        self._sums = np.zeros((self.shape[1], points.rows))
        self._rim = np.zeros((self.shape[0] + 2, self.shape[1] + 2))
        self._line = np.zeros(self._rim.shape[1])
        row, column = np.nonzero(coarse.inside()[:, left:])
        self._index, self._inner = (row, column), (row + 1, column + 1)
        self._change = np.zeros(self.shape)
        self._exchange: RowExchange | None = None

    def means(self, v: np.ndarray, cells: np.ndarray) -> None:
        """Cell means of a point vector, zero in cells without points. Collective."""
        between.sum_in_rows(v, self.points.offset, self._first, self.m, self._sums)
        self._fold(cells)

    def at_points(self, cells: np.ndarray) -> np.ndarray:
        """Cells as a vector of the coarse points."""
        return cells[self._index]

    def roughness(self, r: np.ndarray, k: np.ndarray, cells: np.ndarray, rows: np.ndarray) -> float:
        """The largest |r - number of its cell| over all points with K != 0. Collective."""
        between.roughness(r, k, cells, self.points.offset, self._first, self._begin, self.m, rows)
        return float(self.points.all_rows(rows[:1]).max())

    def turn(
        self, r: np.ndarray, k: np.ndarray, s_c: np.ndarray, t_c: np.ndarray, means: np.ndarray, d: np.ndarray
    ) -> None:
        """d = r - K P s_c plus a constant in each cell such that the cell means of d are t_c; means: of r.
        Collective."""
        points, rim, mirror = self.points, self._rim, self.coarse.mirror
        rim[self._inner] = s_c
        if "y" in mirror:
            rim[0] = rim[1]
        if "x" in mirror:
            rim[:, 0] = rim[:, 1]
        between.turn_residual(
            r, k, points.offset, self._first, self._begin, self.m, rim, self._line, d, self._sums
        )  # fmt: skip
        self._fold(self._change)
        self._change += means
        np.negative(self._change, out=self._change)
        self._change[self._index] += t_c
        between.add_cells(self._change, points.offset, self._first, self._begin, self.m, d)

    def _fold(self, cells: np.ndarray) -> None:
        between.fold(self._of_all(self._sums), self._begin_of_all, self.m, 1.0 / self.m**2, cells)

    def _of_all(self, sums: np.ndarray) -> np.ndarray:
        """Sums of all ranks' rows (columns, rows)."""
        points = self.points
        if points.comm.size == 1:
            return sums
        if self._exchange is None:
            from .node import Node, RowExchange

            start, total = points.row_start - points.top, points.nb - points.top
            self._exchange = RowExchange(Node.of(points.comm), start, points.rows, total, self.shape[1])
        return self._exchange(sums)


class TwoGrid(ConjugateGradients):
    """Conjugate gradients with a coarse grid. Not if G0 is zero for a uniform traction.

    coarse: CoarseGrid. All ranks solve the same problem on its cells, and come to the same numbers. `coarse_pairs`
    counts its transforms.
    """

    def __init__(self, points: PunchPoints, operator: Convolves, law: CohesiveLaw, floating: bool, coarse: CoarseGrid):
        super().__init__(points, operator, law, floating)
        assert not floating, "the cells balance the mean load by its displacement"
        self.d = points.zeros(operator.dtype)
        self._cells = Cells(points, coarse.points)
        self._cg = ConjugateGradients(coarse.points, coarse.operator, law, False)
        self._shortest = coarse.shortest
        self._means = np.zeros(self._cells.shape)
        # A uniform unit traction, and its displacement.
        self._even = np.ones_like(self.d)
        self._sunk = operator(self._even, points.zeros(operator.dtype))
        # The same without a machine's spring, which may change.
        inner = getattr(operator, "convolve", None)
        self._own = self._sunk if inner is None else inner(self._even, points.zeros(operator.dtype))

    def stiffen(self, spring: float, compliance: float) -> None:
        """Puts another spring of the machine between the cells and the punch, too. Only with operators that have one."""
        from .machine import ConvolutionWithSpring

        here, there = self.operator, self._cg.operator
        assert isinstance(here, ConvolutionWithSpring) and isinstance(there, ConvolutionWithSpring)
        there.stiffen(spring, compliance)
        # Anew each time, for a run that goes on to have the same bits.
        np.add(self._own, here.uniform * self.points.total, out=self._sunk)

    @property
    def coarse_pairs(self) -> int:
        """Pairs of transforms on the cells so far."""
        return self._cg.operator.pairs

    def correct(
        self, compliance: float, tolerance: float, unbalanced: float, trust: float, imbalance: float
    ) -> tuple[int, float, bool]:
        """As that of ConjugateGradients; iterations are those on all points."""
        points, k, r, s, t, p, y, cg = self.points, self.curvature, self.r, self.s, self.t, self.p, self.y, self._cg
        offset, rows, cells, means = points.offset, self._rows, self._cells, self._means
        limits = compliance, tolerance, unbalanced, trust
        cells.means(k, means)
        cg.curvature[:] = cells.at_points(means)
        cells.means(r, means)
        self._solve_coarse(*limits)
        given, previous = imbalance, 1.0
        for count in range(1, MOST + 1):
            self.poll()
            first = count == 1
            # The first direction is not conjugated: it is written to its final array.
            z, d = (p, y) if first else (self.z, self.d)
            cells.turn(r, k, cg.s, cg.t, means, d)
            self.operator(d, z, compliance)
            between.survey(z, d, r, k, p, y, first, offset, rows)
            bend, down, along = points.total_of(rows[:3]).tolist()
            bend -= along * along / previous
            if down <= 0.0 or bend <= 0.0:
                break
            alpha, beta, previous = down / bend, -along / previous, bend
            if first:
                between.begin_and_advance(alpha, p, y, k, s, t, r, offset, rows)
            else:
                between.turn_and_advance(z, d, beta, alpha, k, p, y, s, t, r, offset, rows)
            numbers = points.all_rows(rows[:2])
            imbalance, size = float(points.summed(numbers[:1])[0]), float(numbers[1].max()) / self.law.length
            if size > 2.0 * trust or self._is_enough(limits, size, imbalance):
                return count, size, False
        if count > 1:
            # At negative curvature the result is discarded, because the last direction of plain CG is needed.
            r += t
            r += k * s
        used, size, bent = super().correct(*limits, given)
        return count + used, size, bent

    def _is_enough(self, limits: tuple[float, float, float, float], size: float, imbalance: float) -> bool:
        """Whether the remaining correction, estimated by the cells, is small compared with the tolerance or the
        correction so far (size, in ranges). If not, the coarse problem is solved for the next direction. Collective."""
        compliance, tolerance, unbalanced, _ = limits
        cg, cells, means = self._cg, self._cells, self._means
        small = max(self.linear_share * tolerance, 0.5 * self.forcing * size)
        cells.means(self.r, means)
        rough = cells.roughness(self.r, self.curvature, means, self._rows) / self.law.length
        rough *= ROUGH_SHARE * compliance * self._shortest
        if rough < small:
            # Usually one transform is enough.
            cg.r[:] = cells.at_points(means)
            cg.operator(cg.r, cg.z, compliance)
            kernels.largest_in_rows(cg.z, cg.curvature, cg.points.offset, cg._rows)
            left = rough + self._largest(float(cg._rows[0].max()) / self.law.length)
            if left < small and self._balance(compliance, small - left, 0.5 * unbalanced, imbalance):
                return True
        left = self._largest(self._solve_coarse(*limits)) + rough
        return left < small and self._balance(compliance, small - left, 0.5 * unbalanced, imbalance)

    def _largest(self, found: float) -> float:
        """A common value of a number that each rank has computed on all cells, because different processors may round
        differently. Collective."""
        return self.points.maximum_of(found)

    def _balance(self, compliance: float, most: float, unbalanced: float, imbalance: float) -> bool:
        """Whether the forces are in equilibrium, if necessary after adding a uniform traction that moves the surface by
        less than `most` ranges. Collective."""
        if abs(imbalance) <= unbalanced:
            return True
        points, rows = self.points, self._rows
        kernels.dot(self.curvature, self._sunk, points.offset, rows)
        kernels.largest_in_rows(self._sunk, self.curvature, points.offset, rows[1:])
        numbers = points.all_rows(rows[:2])
        held = points.total + compliance * float(points.summed(numbers[:1])[0])
        uniform = imbalance / held if held > 0.0 else math.inf
        if not abs(uniform) * compliance * float(numbers[1].max()) < most * self.law.length:
            return False
        kernels.move(self.s, self.t, self._sunk, self._even, uniform * compliance, uniform)
        return True

    def _solve_coarse(self, compliance: float, tolerance: float, unbalanced: float, trust: float) -> float:
        """Solves the problem on the cells, for the means of r; the largest |s_c| in ranges."""
        cg = self._cg
        cg.r[:] = self._cells.at_points(self._means)
        total = float(cg.r.sum(dtype=np.float64)) * cg.points.images
        # The imbalance is a sum over points; over cells it is m^2 times smaller.
        return cg.correct(
            compliance, COARSE_SHARE * tolerance, BALANCE_SHARE * unbalanced / self._cells.m**2, trust, total
        )[1]
