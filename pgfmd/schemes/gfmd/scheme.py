"""The paper's scheme: every mode of the surface is a mass on springs and dashpots, stepped explicitly (docs: model).

    m u'' + eta_0 u' + k_inf u = f + sum_m k_m u_m,   tau_m u_m' = u - u_m      for each mode u(q), all k ~ k_0 = 1/G0

with m = k_inf / omega^2 and eta_0 = 2 m omega. The integrator is leapfrog with central damping; the elements are
integrated exactly for a u that is linear within the step. One forward and one backward transform of the whole plane per
step. Source: the paper,
"Reproducing viscoelastic properties using GFMD".
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pgfmd.physics.drive import LOAD, Phase
from pgfmd.physics.rheology import PronySeries
from pgfmd.solver.ending_search import values_of
from pgfmd.solver.far_field import FarPoints
from pgfmd.solver.machine import out_of_reach
from pgfmd.solver.multiplier import FEW
from pgfmd.solver.state import State

from . import kernels
from .inertia import Inertia

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pgfmd.physics.adhesion.base import CohesiveLaw
    from pgfmd.solver.grid import PunchPoints
    from pgfmd.solver.multiplier import Compliance
    from pgfmd.solver.transform import Plane


Coefficients = tuple[float, float, np.ndarray, np.ndarray, np.ndarray]


PLACED = 1e-10
"""To which share of the range of adhesion the punch is placed at the end of a machine's spring."""
NEAR = 1e-4
"""Share of the range by which the punch is moved to see how stiff the contact is."""
MOST_SECANTS = 8
"""Secants after which the place is bracketed instead."""
JUMPED = 0.05
"""How far a punch on a spring goes in a step, in lengths of the law, that has jumped: a step of the drive is far shorter."""


class Gfmd:
    """Steps of the paper's scheme. `step` advances a state by one step of given length.

    points: PunchPoints whose rows are those of `plane`'s slab; plane: transform.Plane; compliance: the periodic
    G0(qx, qy); height z [m] (size,); law: CohesiveLaw; series: PronySeries; inertia: Inertia. audit: whether to compute
    energies. near_gap [m]: below which a point is near. springs: compliance 1/k_M [m/N] by what the machine controls, 0
    for a rigid one.
    """

    machine_compliance = 0.0
    solver = None
    cure = "Try a shorter step: a smaller solver.gfmd.dt, or more steps_per_tau."

    def __init__(
        self,
        points: PunchPoints,
        plane: Plane,
        compliance: Compliance,
        height: np.ndarray,
        law: CohesiveLaw,
        series: PronySeries,
        inertia: Inertia,
        audit: bool,
        near_gap: float,
        springs: Mapping[str, float],
    ):
        self.points, self.plane, self.height, self.law = points, plane, height, law
        self.series, self.inertia, self.audit = series, inertia, audit
        self._springs = springs
        self.control(next(iter(springs)))
        self.law_numbers = law.numbers
        grid = points.grid
        unit = 2.0 * np.pi / grid.length
        # Of the un-normalised transform, for the real view of the spectrum: each column twice.
        self._compliance = np.empty((grid.n // 2 + 1, 2 * plane.kx.size))
        some = max(1, FEW // max(1, plane.kx.size))
        for begin in range(0, grid.n // 2 + 1, some):
            ky = np.arange(begin, min(begin + some, grid.n // 2 + 1))[:, None]
            values = compliance(unit * plane.kx[None, :], unit * ky) / grid.n**2
            self._compliance[begin : begin + some] = np.repeat(values, 2, axis=1)
        self._fold = np.where((plane.kx == 0) | (2 * plane.kx == grid.n), 1.0, 2.0)
        self._top, self._left = points.block_start + points.row_start - plane.row_start, points.block_start
        self._levels = law.contact_gap, 0.0, near_gap
        self._rows = np.zeros((6, points.rows))
        self._sums, self._rates = np.zeros((3, plane.kx.size if audit else 0)), 1.0 / series.tau
        self._far = FarPoints(plane)
        self._lengths: tuple[float, float] | None = None

    @property
    def pairs(self) -> int:
        """Pairs of transforms so far."""
        return self.plane.pairs

    @property
    def transform_seconds(self) -> float:
        """Time [s] that this rank has spent in transforms."""
        return self.plane.seconds

    def place(self, state: State) -> float:
        """Displacement d of the punch [m]."""
        return state.position

    def control(self, control: str, state: State | None = None) -> None:
        """Prepares for phases in which the machine controls this: with its spring, the soft one of a load, or none."""
        self.spring, self.dead_load = self._springs[control], control == LOAD

    def values_of(self, state: State, phase: Phase, trial: None = None) -> list[float]:
        """The values of the quantities that may end the phase."""
        if not phase.endings:
            return []
        area = state.contact_points * self.points.grid.cell_area
        return values_of(phase, state, state.force, state.position, lambda: area)

    def drive_at(self, state: State) -> float:
        """Position D [m] of what is driven: the punch, or the machine's end of its spring."""
        return state.position - self.spring * state.force

    def surface_of(self, state: State) -> np.ndarray:
        """The surface of the whole cell, this rank's rows of it."""
        rows: np.ndarray = self.plane.real.ravel()
        return rows

    def whole_cell(self, kept: np.ndarray) -> tuple[np.ndarray, int]:
        """The surface as rows, and the index of the first one."""
        return kept.reshape(self.plane.real.shape), self.plane.row_start

    def new_state(self, position: float) -> State:
        """A state with the surface at rest, and the punch at `position` [m] beyond the range of adhesion."""
        points, shape = self.points, self.plane.spectral.shape
        zeros = points.zeros
        state = State(
            zeros(), np.zeros(0), zeros(), np.zeros((self.series.elements, *shape), complex), np.zeros((0, 0)), position,
            phase_start=position,
        )  # fmt: skip
        state.modes, state.mode_velocities = np.zeros(shape, complex), np.zeros(shape, complex)
        return state

    def start(self, state: State) -> float:
        """Initialises the surface at rest; returns the force on the punch [N], zero beyond the range of adhesion."""
        self.plane.real[:] = 0.0
        return self._touch(state)

    def step(self, state: State, phase: Phase, step: float) -> None:
        """Advances the state by `step` [s] within the phase. Collective."""
        points, plane, energies = self.points, self.plane, state.energies
        kernels.spread(state.traction, points.offset, points.first, self._top, self._left, plane.real)
        plane.forward()
        self._advance(state, step)
        plane.backward()
        before, force, adhesive = state.position, state.force, energies.adhesive
        state.elapsed += step
        state.time += step
        drive = state.phase_start + phase.displacement(state.elapsed)
        if self.spring:
            fallen = self._meet(state, drive)
        else:
            state.position, fallen = drive, 0.0
            state.force = self._touch(state)
        state.least_force = state.force
        moved = state.position - before
        if self.dead_load and phase.may_let_go and state.smallest_gap >= self.law.reach:
            self._fling(state, before, force, adhesive)
            moved = 0.0
        elif fallen:
            energies.released += fallen
            state.counters.jumps += 1
        energies.work -= 0.5 * (force + state.force) * moved
        if phase.may_let_go and moved > 0.0:
            # Steps are short: the force is linear within a step, and work under tension in a step through zero is negligible.
            energies.work_of_separation -= 0.5 * (min(force, 0.0) + min(state.force, 0.0)) * moved
        if self.audit:
            self._follow_energies(state, step)
        state.last_step = step
        state.counters.steps += 1

    def measure(self, state: State) -> None:
        """What the curve holds of the present surface: contact, overlap, near points, smallest gap, far displacement,
        adhesive energy.

        Found along with the traction at the end of the step; nothing is left to do.
        """

    def _advance(self, state: State, step: float) -> None:
        """Advances modes, velocities (of the middle of the step) and elements; writes the new modes to the transform's
        buffer."""
        series = self.series
        # The velocity advances from the middle of the last step to the middle of this one.
        lengths = step, 0.5 * (step + (state.last_step or step))
        if lengths != self._lengths:
            self._lengths, self._coefficients = lengths, self._coefficients_of(*lengths)
        assert state.modes is not None and state.mode_velocities is not None, "states are those of `new_state`"
        keep, kick, decay, old_gain, new_gain = self._coefficients
        kernels.advance_modes(
            _real(self.plane.spectral), self._compliance, _real(state.modes), _real(state.mode_velocities),
            _real(state.internal_variables), series.kappa, self._rates, keep, kick, step, decay, old_gain, new_gain, series.kappa_inf,
            self._fold, self._sums,
        )  # fmt: skip

    def _coefficients_of(self, step: float, between: float) -> Coefficients:
        """Coefficients of the velocity (decay, gain from the force) and of the elements; between: time [s] between the
        middles."""
        damping = self.inertia.frequency * between
        keep = (1.0 - damping) / (1.0 + damping)
        kick = damping * self.inertia.frequency / (self.series.kappa_inf * (1.0 + damping))
        x = step / self.series.tau
        decay, mean = np.exp(-x), -np.expm1(-x) / x
        return keep, kick, decay, mean - decay, 1.0 - mean

    def _touch(self, state: State) -> float:
        """Copies the surface under the punch from the plane, and computes the traction; returns the force on the punch
        [N]."""
        points = self.points
        kernels.touch(
            self.plane.real, self._top, self._left, points.first, self.height, state.position, self.law_numbers,
            self._levels, points.offset, state.surface_displacement, state.traction, self._rows,
        )  # fmt: skip
        rows = points.all_rows(self._rows)
        contact, overlap, near, energy, pull = rows[:5].sum(axis=1)
        state.contact_points, state.overlap_points, state.near_points = int(contact), int(overlap), int(near)
        state.smallest_gap = -rows[5].max()
        state.far_displacement = self._far.displacement()
        state.energies.adhesive = energy * points.grid.cell_area
        force: float = -pull * points.grid.cell_area
        return force

    def _meet(self, state: State, drive: float) -> float:
        """Moves the punch to where the spring carries the force on it, with the machine at `drive` [m]; the energy [J] that
        is released where it jumps there.

        d = D + F(d)/k_M at the surface as it is: by the secant method from where the punch was, and where that does not
        settle, because the law lets go, by Brent's method between places on either side. Collective.
        """
        spring, exact = self.spring, PLACED * self.law.length

        def missing(place: float) -> float:
            state.position = place
            state.force = self._touch(state)
            return place - drive - spring * state.force

        old = before = state.position
        value = first = missing(old)
        stored = state.energies.adhesive
        if first == 0.0:
            return 0.0
        near = missing(old + NEAR * self.law.length)
        slope = (near - value) / (NEAR * self.law.length)
        new = old - value / slope if slope > 0.0 else old
        for _ in range(MOST_SECANTS if slope > 0.0 else 0):
            last, value = value, missing(new)
            if abs(new - old) <= exact:
                jumped = abs(state.position - before) > JUMPED * self.law.length
                return self._fallen(state, before, stored, drive) if jumped else 0.0
            slope = (value - last) / (new - old)
            if slope <= 0.0:
                break
            old, new = new, new - value / slope
        from scipy.optimize import brentq

        # The nearest place on the side that the first one asks for.
        sign, travel, low, high = (-1.0 if first > 0.0 else 1.0), JUMPED * self.law.length, before, before
        while missing(high) * first > 0.0:
            low, high, travel = high, high + sign * travel, 2.0 * travel
        missing(brentq(missing, min(low, high), max(low, high), xtol=exact, rtol=1e-15))
        return self._fallen(state, before, stored, drive)

    def _fallen(self, state: State, before: float, stored: float, drive: float) -> float:
        """By how much [J] spring and interface have fallen, the surface being as it is, since the punch was at `before` [m]
        and the interface had `stored` [J]."""
        if not stored and not state.energies.adhesive:
            # Nothing held the punch, which went with the drive.
            return 0.0
        travel = state.position - before
        return stored - state.energies.adhesive - 0.5 * travel * (state.position + before - 2.0 * drive) / self.spring

    def _fling(self, state: State, before: float, force: float, adhesive: float) -> None:
        """Stops a punch that a dead load has torn off just out of reach. The load does work up to there, and what is left of it is
        released."""
        clear = out_of_reach(self.points, state.surface_displacement, self.height, self.law.reach)
        state.position = min(state.position, max(clear, before))
        state.force = self._touch(state)
        moved, energies = state.position - before, state.energies
        if force < 0.0:
            energies.work -= force * moved
            energies.work_of_separation -= force * moved
            energies.released += -force * moved + adhesive - energies.adhesive
            state.counters.jumps += 1

    def _follow_energies(self, state: State, step: float) -> None:
        """Computes the stored energy (including kinetic energy), and the dissipation by the trapezoidal rule."""
        series, omega = self.series, self.inertia.frequency
        area = self.points.grid.length**2
        stored, moving, lost = self.plane.total_of(self._sums) * (area / self.points.grid.n**2)
        state.energies.elastic = stored + 0.5 * series.kappa_inf / omega**2 * moving
        state.energies.viscous += step * (2.0 * series.kappa_inf / omega * moving + 0.5 * (lost + state.power))
        state.power = lost


def _real(array: np.ndarray) -> np.ndarray:
    """The real view of a complex array: real and imaginary parts alternate along the last axis."""
    return array.view(float)
