"""The loading machine: a spring between what is driven and the punch.

The machine's end D(t) is driven; a spring of stiffness k_M carries the punch at d = D + F/k_M. Seen from the machine's
end, the surface u' = u - (d - D) = G0 w - (1/k_M) F is that of a body with one more compliance, the same everywhere:

    u' = G0' w,   G0' = G0 + 1 1^T h^2 / (J k_M),   w = J f

so everything about equilibria with G0 holds for G0'. Load control is the limit of a soft spring.

In a step of a viscoelastic body J is that of a stage, w = J f + w_hist, and the spring knows f alone. What a solve
changes is then the same: a change of w by J df moves u' by G0' of it. So a solve starts with the true surface and the
position of the punch that belongs to w at the start (`Machine.begin`). The elongation of the spring during the solve is
subtracted at its end (`Machine.end`). No field contains the displacement of the machine's end, which a soft spring makes
thousands of times larger than that of the punch. So rounding errors are those of a rigid machine.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pgfmd.physics.drive import LOAD

from . import kernels

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pgfmd.solver.grid import PunchPoints
    from pgfmd.solver.newton import NewtonSolver
    from pgfmd.solver.tiles import Convolves


class ConvolutionWithSpring:
    """G0' as a Convolution: u' = G0' * w between point vectors.

    convolve: the Convolution with G0. spring [m/N]: 1/k_M. compliance: J of the equilibria that it is used for; it may be
    changed.
    """

    def __init__(self, convolve: Convolves, spring: float, compliance: float):
        self.convolve, self.points, self.dtype = convolve, convolve.points, convolve.dtype
        self.mean_compliance = convolve.mean_compliance
        self._rows = np.zeros((1, self.points.rows))
        self.stiffen(spring, compliance)

    def stiffen(self, spring: float, compliance: float) -> None:
        """Sets the spring's compliance 1/k_M [m/N], 0 for none, and J of the body."""
        self.uniform = spring * self.points.grid.cell_area / compliance

    @property
    def pairs(self) -> int:
        """Pairs of transforms so far."""
        return self.convolve.pairs

    @property
    def seconds(self) -> float:
        """Time [s] spent in them."""
        return self.convolve.seconds

    def __call__(self, traction: np.ndarray, displacement: np.ndarray, scale: float = 1.0) -> np.ndarray:
        """displacement = scale * G0' * traction; collective."""
        self.convolve(traction, displacement, scale)
        if self.uniform:
            displacement += scale * self.uniform * total(self.points, traction, self._rows)
        return displacement

    def since(self, start: float, traction: np.ndarray, displacement: np.ndarray) -> None:
        """displacement = G0 * traction, and what the spring has given way since the sum of the traction was `start`: the
        elongation itself, far longer, is in no field. Collective."""
        self.convolve(traction, displacement)
        displacement += self.uniform * (total(self.points, traction, self._rows) - start)

    def whole_cell(self, traction: np.ndarray) -> tuple[np.ndarray, int]:
        """The true surface of the cell, without the spring (transform.Convolution)."""
        return self.convolve.whole_cell(traction)


def total(points: PunchPoints, values: np.ndarray, rows: np.ndarray) -> float:
    """Sum of a point vector over all ranks, the same bits on any number of them; rows: work array (1, rows).
    Collective."""
    kernels.sum_in_rows(values, points.offset, rows)
    return float(points.total_of(rows[:1])[0])


def nonzero(points: PunchPoints, values: np.ndarray, rows: np.ndarray) -> int:
    """How many points of the punch have a value other than zero; rows: work array (1, rows). Collective."""
    rows[:] = 0.0
    if points.rows:
        rows[0, 0] = np.count_nonzero(values)
    return int(points.total_of(rows)[0])


def with_spring(convolve: Convolves, spring: float, compliance: float) -> Convolves:
    """The convolution with the machine's spring in it; as it is where the machine is rigid."""
    return ConvolutionWithSpring(convolve, spring, compliance) if spring else convolve


MISPLACED = 1e-3
"""Ranges of adhesion by which the effective traction at the start of a solve may misplace the punch. If a soft spring turns a
small error of w into more, w is corrected beforehand. (With 0.1, solves of a contact about to be torn off went over to
the other side too early, those that follow a jump did not, and steps of 1e-10 s followed each other by the hundred.)"""


CLEAR = 1e-9
"""How far beyond the reach of the law a punch that a dead load has torn off is stopped, relative to that reach."""


def out_of_reach(points: PunchPoints, surface: np.ndarray, height: np.ndarray, reach: float) -> float:
    """The nearest position [m] at which a punch of this face no longer feels the surface, all [m]. Collective.

    A punch that a dead load has torn off is stopped there, because nothing else would stop it.
    """
    nearest = float((surface - height).max()) if points.size else -np.inf
    return points.maximum_of(nearest) + (1.0 + CLEAR) * reach


class Machine:
    """The spring of a machine, in solves whose surface u is the true one.

    solver: NewtonSolver, whose convolutions are `ConvolutionWithSpring`s. springs: compliance 1/k_M [m/N] by what the machine
    controls, 0 for none. stiffness [N/m]: of the contact of the whole punch on the relaxed body, about. compliance: that
    of the present phase (`control`). dead_load: whether the spring stands for a load that does not give way: such a spring
    pulls a punch that comes free far away. After solves, `fallen` [J] is by how much the energy of the spring fell in
    them, since it was last set to zero.
    """

    def __init__(self, solver: NewtonSolver, springs: Mapping[str, float], stiffness: float):
        assert isinstance(solver.convolve, ConvolutionWithSpring)
        self.solver, self.points, self._convolve = solver, solver.points, solver.convolve
        self.springs, self.stiffness = springs, stiffness
        self._rows = np.zeros((1, solver.points.rows))
        self._given = self._start = 0.0
        self.fallen = 0.0
        self.control(next(iter(springs)))

    def control(self, control: str) -> None:
        """Prepares for phases in which the machine controls this (drive.DISPLACEMENT or LOAD)."""
        self.compliance, self.dead_load = self.springs[control], control == LOAD
        self.solver.hold_up(self.compliance)
        self.solver.stiffen(self.compliance, 1.0)

    @property
    def is_soft(self) -> bool:
        """Whether the spring is softer than the contact."""
        return self.compliance * self.stiffness > 1.0

    def place(self, drive: float, force: float) -> float:
        """Position d of the punch [m], with the machine at `drive` [m] and this force [N]."""
        return drive + self.compliance * force

    def share(self, interacts: bool) -> float:
        """How many times farther the machine goes than the punch, where punch and elastomer hold each other."""
        return 1.0 + self.stiffness * self.compliance if interacts else 1.0

    def interacting(self, values: np.ndarray) -> int:
        """How many points of the punch have a value other than zero. Collective."""
        return nonzero(self.points, values, self._rows)

    def begin(
        self, drive: float, u: np.ndarray, w: np.ndarray, history: np.ndarray, compliance: float, expected: float,
        traction: np.ndarray, exactly: bool = False,
    ) -> tuple[float, bool]:  # fmt: skip
        """Before the solve of a stage with J = compliance and w = J f + history: the position [m] of the punch that
        belongs to w, and whether w and u were corrected so that it is close to `expected`. Collective.

        The correction is spread evenly over the points that interact, where `traction` is not zero. exactly: correct it
        however near it is, for a jump, whose energy is counted from there. A punch that is free is always where the machine
        is, or it would find or miss a contact that is not there yet.
        """
        solver, rows = self.solver, self._rows
        solver.stiffen(self.compliance, compliance)
        self._given = total(self.points, history, rows)
        self._start = total(self.points, w, rows)
        place, corrected = self.place(drive, self._force(self._start, compliance)), False
        count = self.interacting(traction)
        if abs(place - expected) > (MISPLACED * solver.law.length if count and not exactly else 0.0):
            self._correct(place - expected, u, w, history, compliance, traction, count)
            corrected = True
            place = self.place(drive, self._force(self._start, compliance))
        solver.start = self._start
        return place, corrected

    def end(self, drive: float, u: np.ndarray, w: np.ndarray, compliance: float) -> tuple[float, float]:
        """After the solve: makes u the true surface again; position of the punch [m] and force on it [N]. Collective."""
        now = total(self.points, w, self._rows)
        u -= self._convolve.uniform * (now - self._start)
        self.solver.start = None
        before, force = self._force(self._start, compliance), self._force(now, compliance)
        self.fallen += 0.5 * self.compliance * (before**2 - force**2)
        return self.place(drive, force), force

    def surface_of(self, w: np.ndarray, u: np.ndarray) -> None:
        """u = G0 w [m] of an effective traction w [Pa], without the spring. Collective."""
        self._convolve.convolve(w, u)

    def _force(self, sum_of_w: float, compliance: float) -> float:
        """Force on the punch [N] that belongs to an effective traction w, by its sum over the points."""
        return -(sum_of_w - self._given) / compliance * self.points.grid.cell_area

    def _correct(
        self, misplaced: float, u: np.ndarray, w: np.ndarray, history: np.ndarray, compliance: float, traction: np.ndarray,
        count: int,
    ) -> None:  # fmt: skip
        """Changes w until it fits the elongation of the spring, or to none if no point interacts. One transform."""
        if count:
            force = -misplaced / (self.compliance + compliance / self.stiffness)
            w[np.flatnonzero(traction)] -= compliance * force / (self.points.grid.cell_area * count)
        else:
            w[:] = history
        self.surface_of(w, u)
        self._start = total(self.points, w, self._rows)
