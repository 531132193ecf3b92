"""Downhill to a minimum of the incremental potential Phi (newton.py), by nonlinear conjugate gradients.

Each iteration takes the gradient r, preconditioned, z = A r, and goes to a lower place in the span of the softest mode x
that is known, of z, and of the last move p: Newton's method in three unknowns. As every vector has its dual with it,
A^-1 of it, that takes no transform; the one of z is the iteration's only pair. Close to a minimum these are the
conjugate gradients of conjugate_gradients.py, with x deflated. Far from one, no correction is solved for that is then
cut, and the curvature is always that of the surface as it is. If the span holds a softer mode, x moves on to it: in the
last iterations, where little but soft modes is left of r, that is a search for it without a pair of its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from . import descent_kernels as kernels
from .newton import NewtonSolver, Outcome
from .stagnation import MOST_IDLE, Progress

FAITHFUL = 0.25
"""Newton's method in three unknowns goes on where Phi fell by another amount than expected: relative to that, by more
than this."""
MOST_TURNS = 5
"""Its most iterations."""
FLAT = 1e-3
"""Curvatures nearer to zero than this are taken for this; how far to go is then up to the region of trust."""


@dataclass
class _Place:
    """What a probe gives: sums of f and r [Pa] and of Gamma, and by how much the rest of Phi has risen on the way there
    [Pa m]; slopes (3,) of Phi, downhill, and curvatures K (3, 3) along x, z, p; the largest move [ranges of adhesion]."""

    pull: float
    imbalance: float
    adhesive: float
    rise: float
    slope: np.ndarray
    bend: np.ndarray
    size: float

    @property
    def potential(self) -> float:
        """Phi, but for what u and w store at the start of the way."""
        return self.adhesive + self.rise


class Descent:
    """Moves surfaces downhill, on the work vectors of a NewtonSolver, whose `traction` and `curvature` are those of the
    solution afterwards."""

    largest_count, largest_jump_count = 600, 100_000
    """Iterations at which a solve gives up. In a jump a crack may run through the whole punch, a cell or so at a time."""
    patience = 2
    """So many moves in a row have to be below the tolerance: a small one may be followed by larger ones."""

    def __init__(self, solver: NewtonSolver):
        self.solver, self.points, self.law = solver, solver.points, solver.law
        self._no_mode = np.zeros(0, solver.rough.dtype)
        self._rows = np.zeros((14, solver.points.rows))
        self._modes = np.zeros((4, 3))

    @staticmethod
    def modes(solver: NewtonSolver) -> dict[str, np.ndarray]:
        """A softest mode and its dual that are still unknown, for `solve`; none without attraction."""
        names = ("mode", "dual") if solver.law.attractive else ()
        return {name: solver.points.zeros(solver.rough.dtype) for name in names}

    def solve(
        self, position: float, history: np.ndarray, compliance: float, u, w, tolerance: float, jump: bool = False,
        timid: bool = False, largest_force: float = 0.0, mode=None, dual=None,
    ) -> Outcome:  # fmt: skip
        """As NewtonSolver.solve. mode [m] and its dual [Pa] (size,), where given: the softest mode that is known, which
        moves on to the softest that is met."""
        solver = self.solver
        self._at = position, u, w, history, compliance
        self._mode = (self._no_mode, self._no_mode) if mode is None else (mode, dual)
        unbalanced = solver.force_share * tolerance * solver.force_scale / self.points.grid.cell_area
        progress, noise = Progress(tolerance, unbalanced), 0.0
        trust, way, drop, quiet, negative, turns = 1.0, 0.0, 0.0, 0, False, 0
        here, renewed, left_over, count = self._begin(), False, 0.0, 0
        converged = False
        for count in range(1, 1 + (self.largest_jump_count if jump else self.largest_count)):
            if not math.isfinite(here.adhesive):
                break
            solver.cg.poll()
            solver.rough(solver.cg.r, solver.cg.z, compliance)
            norm, start = self._products(here)
            if norm[1, 1] <= 0.0:
                # Nothing is out of balance.
                converged = True
                break
            slack = solver._slack_of(here.adhesive)
            there, step, bent, used = self._lower(norm, start, trust, slack, 1e-3 * tolerance)
            turns, negative = turns + used, negative or bent
            if timid and (bent or way + there.size > solver.timid_way):
                here = self._probe(np.zeros(3))
                break
            if used == 0:
                # Nowhere lower: u has drifted off G0 w, or rounding is reached.
                if renewed:
                    break
                solver.convolve(w, u)
                here, renewed = self._begin(), True
                continue
            self._move(step, there)
            gained = here.adhesive - there.potential
            drop, way, size = drop + gained, way + there.size, there.size
            unsettled = abs(there.pull - here.pull) if solver.floating else abs(there.imbalance)
            here = there
            trust = 2.0 * trust if size >= 0.99 * trust else trust
            quiet = quiet + 1 if size < tolerance and unsettled <= unbalanced and not bent else 0
            if quiet >= self.patience:
                converged = True
                break
            noise = solver._noise(compliance, u, w) if count == MOST_IDLE else noise
            if progress.stalls(drop, slack + noise, size, unsettled):
                converged, left_over = solver._settle_for(progress, bent, size, unsettled, here.pull, largest_force)
                break
        area = self.points.grid.cell_area
        return Outcome(
            converged, turns, count, -here.pull * area, drop * area, here.adhesive * area, negative, way, left_over, renewed
        )  # fmt: skip

    def _begin(self) -> _Place:
        """The place where the surface is, without a last move."""
        cg = self.solver.cg
        cg.p[:], cg.y[:], cg.z[:], cg.t[:] = 0.0, 0.0, 0.0, 0.0
        here = self._probe(np.zeros(3))
        self._level(here)
        return here

    def _products(self, here: _Place) -> tuple[np.ndarray, _Place]:
        """Products v A^-1 v' of x, z, p, and the place where the surface is, seen along these. Collective."""
        cg = self.solver.cg
        cg.r, cg.t = cg.t, cg.r
        kernels.products(cg.curvature, *self._mode, cg.z, cg.t, cg.p, cg.y, self.points.offset, self._rows)
        sums = self.points.total_of(self._rows)
        norm = _symmetric(sums[6:12])
        slope = np.array([sums[12], norm[1, 1], sums[13]])
        return norm, _Place(here.pull, here.imbalance, here.adhesive, 0.0, slope, _symmetric(sums[:6]), 0.0)

    def _probe(self, step: np.ndarray) -> _Place:
        """The place at u + step (x, z, p); sets traction, curvature and residual. Collective."""
        cg, (position, u, w, history, compliance) = self.solver.cg, self._at
        (x, dx), (a, b, c) = self._mode, step.tolist()
        kernels.probe(
            self.solver.height, position, u, w, a, x, dx, b, cg.z, cg.t, c, cg.p, cg.y, history, compliance,
            self.solver.law_numbers, self.points.offset, self.solver.traction, cg.curvature, cg.r, self._rows,
        )  # fmt: skip
        rows = self.points.all_rows(self._rows)
        sums = rows[:13].sum(axis=1)
        size = float(rows[13].max()) / self.law.range
        return _Place(*sums[:4].tolist(), sums[4:7].copy(), _symmetric(sums[7:13]), size)

    def _lower(
        self, norm: np.ndarray, start: _Place, trust: float, slack: float, least: float
    ) -> tuple[_Place, np.ndarray, bool, int]:
        """A lower place in the span: (it, the way (x, z, p) there, whether Phi bends down in the span, iterations of
        Newton's method, none where there is no lower place). trust, least: largest and smallest move [ranges]."""
        here, way, bent, used = start, np.zeros(3), False, 0
        for turn in range(MOST_TURNS):
            values, vectors = self._modes_of(norm + here.bend, norm)
            if turn == 0:
                self.lowest, self._softest, bent = float(values[0]), vectors[:, 0].copy(), bool(values[0] <= 0.0)
            slopes = vectors.T @ here.slope
            weights = slopes / np.maximum(np.abs(values), FLAT)
            there, scale = self._step_down(here, way, vectors @ weights, trust, slack, least)
            if scale == 0.0:
                here = self._probe(way)
                break
            used += 1
            gain, expected = here.potential - there.potential, 0.5 * float(slopes @ weights)
            here, way = there, way + scale * (vectors @ weights)
            if scale < 1.0 or abs(gain - expected) <= FAITHFUL * expected + slack:
                break
        return here, way, bent, used

    def _step_down(self, here: _Place, way, more, trust: float, slack: float, least: float) -> tuple[_Place, float]:
        """The place at `way` and a part of `more`, halved until Phi does not rise: (it, the part), 0 where it always
        does, or where the whole is too long and `way` not nothing."""
        scale = 1.0
        while True:
            there = self._probe(way + scale * more)
            if there.size > trust * (1.0 + 1e-9):
                if way.any():
                    return there, 0.0
                scale *= trust / there.size
            elif there.potential <= here.potential + slack:
                return there, scale
            elif there.size < least:
                return there, 0.0
            else:
                scale *= 0.5

    def _modes_of(self, bend: np.ndarray, norm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Curvatures of Phi in the span, lowest first, and their directions in columns; zeros where there are fewer than
        three. Collective."""
        told, comm = self._modes, self.points.comm
        if comm.rank == 0:
            told[:] = 0.0
            kernels.modes_of(bend, norm, told[0], told[1:])
        if comm.size > 1:
            # One rank decides: other processors may round in other ways.
            comm.Bcast(told)
        return told[0], told[1:]

    def _move(self, step: np.ndarray, there: _Place) -> None:
        """Moves the surface by a step (x, z, p), and the mode on to the softest."""
        cg, (_, u, w, _, compliance) = self.solver.cg, self._at
        kernels.move_on(step, self._softest, *self._mode, cg.z, cg.t, cg.p, cg.y, compliance, u, w)
        self._level(there)

    def _level(self, there: _Place) -> None:
        """Lets the mean load take up the mean residual where it moves nothing, A being singular there."""
        if self.solver.floating:
            mean = there.imbalance / self.points.total
            self.solver.cg.r -= mean
            w, compliance = self._at[2], self._at[4]
            w += compliance * mean


def _symmetric(six: np.ndarray) -> np.ndarray:
    """A symmetric 3 x 3 matrix of its entries 00, 01, 02, 11, 12, 22."""
    return six[np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])]
