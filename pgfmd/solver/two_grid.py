"""Newton's correction by conjugate gradients with a second, coarser grid (newton.py, conjugate_gradients.py)."""

from __future__ import annotations

import numpy as np

from . import kernels
from . import two_grid_kernels as between
from .conjugate_gradients import ConjugateGradients
from .grid import Grid, PunchPoints

HUGE = 1e30


class TwoGrid(ConjugateGradients):
    m = 8
    coarse_forcing = 0.1
    coarse_share = 0.3
    rough_share = 0.25

    def __init__(self, points, operator, law, floating, coarse_points, coarse_operator, rough_compliance):
        super().__init__(points, operator, law, floating)
        m = points.grid.n // coarse_points.grid.n
        self.m = m
        self.rough_compliance = rough_compliance
        self.coarse = ConjugateGradients(coarse_points, coarse_operator, law, False)
        self.coarse.forcing = self.coarse_forcing
        self.d = points.zeros(operator.dtype)
        cp = coarse_points
        self.begin = points.block_start + points.row_start - (cp.block_start + cp.top) * m
        left = cp.block_start + (cp.nb // 2 if cp.mirror else 0)
        self.first = points.block_start + points.first - left * m
        columns = cp.nb - (cp.nb // 2 if cp.mirror else 0)
        shape = (cp.rows, columns)
        self.cells = np.zeros(shape, operator.dtype)
        self.extra = np.zeros(shape, operator.dtype)
        self.sums = np.zeros((points.rows, columns), operator.dtype)
        self.rim = np.zeros((cp.rows + 2, columns + 2), operator.dtype)
        self.line = np.zeros(columns + 2, operator.dtype)
        row = np.searchsorted(cp.offset, np.arange(cp.size), side="right") - 1
        column = cp.first[row] + np.arange(cp.size) - cp.offset[row] - (cp.nb // 2 if cp.mirror else 0)
        self.index = row * columns + column
        self.padded = (row + 1) * (columns + 2) + column + 1
        self.stat = dict(coarse=0, fine=0, est=0, quick=0, bent=0, n=0)
        self.its=[]

    def restrict(self, v, cells, scale):
        between.sum_in_cells(v, self.points.offset, self.first, self.m, self.sums)
        between.fold(self.sums, self.begin, self.m, np.float32(scale), cells)

    def widen(self):
        rim, cp = self.rim, self.coarse.points
        rim.ravel()[self.padded] = self.coarse.s
        if "y" in cp.mirror:
            rim[0] = rim[1]
        if cp.mirror:
            rim[:, 0] = rim[:, 1]

    def coarse_solve(self, compliance, tolerance, unbalanced):
        """from self.cells = R r"""
        c = self.coarse
        c.r[:] = self.cells.ravel()[self.index]
        self.stat["coarse"] -= c.operator.pairs
        used, size, bent = c.correct(compliance, self.coarse_share * tolerance, self.unb * unbalanced / self.m**2, self.trust, float(c.r.sum(dtype=np.float64)) * c.points.images)
        self.stat["coarse"] += c.operator.pairs
        self.stat["bent"] += bent
        self.its.append(used)
        if bent and used == 1:
            pass
        return size
    unb = 1.0

    def rough(self, compliance):
        between.roughness(self.r, self.curvature, self.cells, self.points.offset, self.first, self.begin, self.m, self._rows)
        largest = float(self.points.all_rows(self._rows[:1]).max())
        return self.rough_share * compliance * self.rough_compliance * largest / self.law.range

    def correct(self, compliance, tolerance, unbalanced, trust, imbalance):
        points, s, t, p, y, z, r, d = self.points, self.s, self.t, self.p, self.y, self.z, self.r, self.d
        k, offset, rows, m = self.curvature, points.offset, self._rows, self.m
        c = self.coarse
        inv = 1.0 / m**2
        self.trust = trust
        self.restrict(k, self.cells, inv)
        c.curvature[:] = self.cells.ravel()[self.index]
        self.restrict(r, self.cells, inv)
        estimate = self.coarse_solve(compliance, tolerance, unbalanced)
        previous, size = 1.0, 0.0
        for count in range(1, self.largest_count + 1):
            self.poll()
            # t = r - K P s_c, its coarse part that of the coarse solution
            self.widen()
            between.turn_residual(r, k, offset, self.first, self.begin, m, self.rim, self.line, d, self.sums)
            between.fold(self.sums, self.begin, m, np.float32(inv), self.extra)
            self.cells += self.extra
            flat = np.zeros_like(self.cells).ravel()
            flat[self.index] = c.t
            self.cells -= flat.reshape(self.cells.shape)
            np.negative(self.cells, out=self.cells)
            between.add_cells(self.cells, offset, self.first, self.begin, m, d)
            self.operator(d, z, compliance)
            first = count == 1
            between.survey(z, d, r, k, p, y, first, offset, rows)
            bend, down, along = points.total_of(rows[:3]).tolist()
            beta = 0.0 if first else -along / previous
            bend -= 0.0 if first else along * along / previous
            if down <= 0.0 or bend <= 0.0:
                self.stat["n"] += 1
                if first: return self.fallback(compliance, tolerance, unbalanced, trust, imbalance, count)
                if bend <= 0.0:
                    return self.fallback(compliance, tolerance, unbalanced, trust, imbalance, count)
                return count, size, False
            alpha = down / bend
            between.turn_and_advance(z, d, beta, alpha, k, p, y, s, t, r, first, offset, rows)
            previous = bend
            numbers = points.all_rows(rows)
            size = float(numbers[1].max()) / self.law.range
            imbalance = float(points.summed(numbers[2:3])[0])
            self.stat["fine"] += 1
            if size > 2.0 * trust:
                break
            limit = max(self.linear_share * tolerance, 0.5 * self.forcing * size)
            self.restrict(r, self.cells, inv)
            rough = self.rough(compliance)
            self.stat["est"] += 1
            if rough < limit and abs(imbalance) <= 0.5 * unbalanced:
                c.r[:] = self.cells.ravel()[self.index]
                c.operator(c.r, c.z, compliance)
                self.stat["coarse"] += 1
                kernels.largest_in_rows(c.z, c.curvature, c.points.offset, c._rows)
                if rough + c._rows[0].max() / self.law.range < limit:
                    self.stat["quick"] += 1
                    break
            estimate = self.coarse_solve(compliance, tolerance, unbalanced) + rough
            if estimate < limit and abs(imbalance) <= 0.5 * unbalanced:
                break
        return count, size, False

    def fallback(self, compliance, tolerance, unbalanced, trust, imbalance, count):
        if count > 1:
            # residual belongs to s: solve again from r0 by plain CG
            self.r += self.t + self.curvature * self.s
        used, size, bent = super().correct(compliance, tolerance, unbalanced, trust, float(points_total(self.points, self.r)))
        return used + count, size, bent


def points_total(points, v):
    return v.sum(dtype=np.float64) * points.images


def install(sim, scene, m, **opts):
    from pgfmd import parts
    from pgfmd.solver.mirrored_transform import MirroredConvolution
    from pgfmd.solver.transform import Convolution
    from pgfmd.solver.multiplier import periodic_multiplier
    from types import SimpleNamespace

    solver = sim.scheme.solver
    points = solver.points
    h = points.grid.spacing
    cp = PunchPoints(Grid(points.grid.n // m, points.grid.length), points.radius + 1.5 * m * h, points.comm, mirror=points.mirror)
    comp = parts.compliance_of(scene)
    kind = MirroredConvolution if points.mirror else Convolution
    op = kind(cp, cp.grid.n, periodic_multiplier(comp, scene.grid.length), dtype=solver.rough.dtype)
    tg = TwoGrid(points, solver.rough, solver.law, solver.cg.floating, cp, op, float(comp(np.pi / (m * h), 0.0)))
    tg.patience = solver.cg.patience
    for a, b in opts.items():
        setattr(tg, a, b)
    tg.coarse.forcing = tg.coarse_forcing
    solver.cg = tg
    solver.curvature = tg.curvature
    return tg
