"""The energy audit of the massless model: energies stored and dissipated in a step, compared with the work of the
punch.

It needs no transform: the displacements psi_m = G0 phi_m of the internal variables are stored, and all energies are sums over
points (docs: model).
"""

from __future__ import annotations

import math
from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from pgfmd.physics.rheology import CreepSeries
from pgfmd.schemes.path_following import SINGLE_NOISE
from pgfmd.solver.extrapolation import GAUSS, integral, lagrange_slopes
from pgfmd.solver.state import Energies, State
from pgfmd.solver.trial_step import Trial

from . import retardation_kernels
from .retardation import StagedTrial, StepWeights, Tableau

if TYPE_CHECKING:
    from numpy.typing import DTypeLike

    from pgfmd.physics.adhesion.base import CohesiveLaw
    from pgfmd.solver.grid import PunchPoints

FINE = 1.5e-3
"""At tolerances below this, the audit's residual of a step limits the step as well."""
ENERGY_SHARE = 7.0
"""Largest residual of a step at these tolerances, relative to the dissipated energy, as a multiple of the tolerance."""
LEAST_SHARE = 1e-3
"""Lower bound of this limit."""
LEAST_TRAVEL = 1e-3
"""Added to the fraction of the punch's travel that a step covers, for the errors of the solves in short steps."""
SMALLEST_LOOP = 1e-7
"""Least energy that a loop is assumed to dissipate, as a fraction of the elastic energy and of the adhesive energy of
full contact."""
POINTS_OF_WORK = 3
"""Most forces from which the work of a step is interpolated."""
NEAREST_PAST = 0.2
"""The start of the last step is one of them if that step was at least this fraction of the present one: a closer point
does not determine a slope."""
TENSION_SAMPLES = 65
"""Points of a step at which its force is examined for tension."""
SPENT_SHARPNESS = 5.0
"""The error of the forces enters the work of the punch, and would dominate a nearly elastic loop, whose work is
thousands of times smaller than the stored energies. So fine steps are solved to a smaller fraction of the tolerance if
less than 1/SPENT_SHARPNESS of the stored energy has been dissipated. (With 50 instead of 5, a spectrum of two elements
twelve decades apart took three times the steps, and its audit did not close.)"""
FINE_SHARPNESS = 0.1
"""Smallest fraction of the tolerance used for this reason."""


class EnergyAudit:
    """Computes stored and dissipated energy; optionally limits the residual of each step.

    points: PunchPoints; law: CohesiveLaw; tableau: of the steps; tolerance: of a step, in ranges of adhesion; dtype of
    the fields. spring [m/N]: compliance of the machine's. force_error [N]: up to which steps are solved. bounds_steps: whether
    steps of this tolerance are limited.
    """

    def __init__(
        self,
        points: PunchPoints,
        creep: CreepSeries,
        law: CohesiveLaw,
        tableau: Tableau,
        tolerance: float,
        dtype: DTypeLike,
        force_error: float = 0.0,
    ):
        self.spring, self.force_error = 0.0, force_error
        self.points, self.creep, self.law, self.tableau, self.tolerance = points, creep, law, tableau, tolerance
        # Without attraction and retardation there is no dissipation to which an error could be compared.
        self.bounds_steps = tolerance <= FINE and (creep.elements > 0 or law.attractive)
        # In single precision the energies have an error that does not shrink with the step.
        self._noise = SINGLE_NOISE if np.dtype(dtype) == np.float32 else 0.0
        self._rows = np.zeros((3, points.rows))

    def sharpness(self, energies: Energies) -> float:
        """Fraction of the tolerance to which steps have to be solved for the audit; 1 without a requirement."""
        stored = energies.elastic + abs(energies.adhesive)
        if not self.bounds_steps or stored <= 0.0:
            return 1.0
        spent = energies.viscous + energies.released
        return max(FINE_SHARPNESS, min(1.0, SPENT_SHARPNESS * spent / stored))

    def error(self, state: State, trial: StagedTrial, u: list[np.ndarray], f: np.ndarray, adhesive: float) -> float:
        """The step's contribution to the residual of the audit, relative to the allowed one.

        A small fraction of the energy dissipated in the step is allowed, plus the same fraction of all dissipated
        energy in proportion to the travel of the punch. u [m], f [Pa] at the stages; adhesive [J]: energy of the
        interface at the end of the step. Collective.
        """
        energies, reach = state.energies, self.law.length
        elastic, viscous = self.energies(state, trial.weights, u, f, keep=False)
        gained = elastic - energies.elastic + adhesive - energies.adhesive
        residual = work_of(state, trial, self.tableau, self.spring) - gained - viscous
        at_stake = elastic + self.law.work_of_adhesion * self.points.total * self.points.grid.cell_area
        spent = max(energies.viscous + energies.released, SMALLEST_LOOP * at_stake)
        # A machine's phases begin where the machine is, not the punch.
        origin = state.preload_displacement if self.spring and state.preload_time is not None else state.phase_start
        travel = abs(trial.position - state.position) / (reach + abs(trial.position - origin))
        allowed = max(ENERGY_SHARE * self.tolerance, LEAST_SHARE) * (viscous + spent * (travel + LEAST_TRAVEL))
        allowed += self._noise * at_stake
        if self.spring:
            # An error of the force displaces the punch on its spring, however short the step.
            allowed += self.force_error * min(self.spring * self.force_error, self.tolerance * reach)
        return abs(residual) / allowed if allowed > 0.0 else 0.0

    def energies(
        self, state: State, weights: StepWeights, u: list[np.ndarray], f: np.ndarray, keep: bool
    ) -> tuple[float, float]:
        """Elastic energy at the end of a step, and energy dissipated in it [J].

        u [m], f [Pa] at the stages; keep: advance the internal variables phi_m and their displacements G0 phi_m to the end
        of the step. No transform: G0 f = (u - G0 w_hist) / J. Collective.
        """
        final, area = self.tableau.stages - 1, self.points.grid.cell_area
        retardation_kernels.advance_branches_and_energy(
            state.internal_variables, state.internal_displacements, f, u[0], u[final], weights.internal_weight, weights.stage_weight[final, 0],
            weights.compliance, weights.decay, weights.gain, weights.rate_decay, weights.rate_gain, weights.quadrature,
            self.creep.J, keep, self.points.offset, self._rows,
        )  # fmt: skip
        stored, lost, instantaneous = self.points.reduced(self._rows, 3)
        stored += 0.5 * self.creep.J_inf * instantaneous
        return stored * area, lost * area


def work_of(
    state: State, trial: Trial, tableau: Tableau, compliance: float = 0.0, stiffness: float = math.inf
) -> float:
    """Work of the punch [J] over the step: the machine's velocity times the polynomial through the forces at the start,
    at the stages, and at ends of steps before, less what its spring has stored, whose compliance [m/N] is 1/k_M;
    stiffness [N/m]: of the contact, about.

    A jump is taken to happen at the new positions, and its released energy is counted from there: up to each of them,
    the force is that of the old surface. A dead load that has torn off the punch does work over the whole travel.
    """
    h, start, phase = trial.step, state.elapsed, trial.phase
    if trial.runaway:
        return -state.force * (trial.position - state.position)
    stored = 0.5 * compliance * (trial.force**2 - state.force**2)
    times, forces = [0.0, *(node * h for node in tableau.nodes)], [state.force, *trial.forces]
    if trial.is_jump and compliance:
        # Until the jump the spring has taken its share of what was driven.
        travel = phase.displacement(start + h) - phase.displacement(start)
        before = state.force - travel / (compliance + 1.0 / stiffness) if state.force else 0.0
        return -stored - 0.5 * (state.force + before) * travel
    if trial.is_jump:
        places = [phase.displacement(start + time) for time in times]
        return -stored - sum(force * (b - a) for force, a, b in zip(forces[:-1], places[:-1], places[1:], strict=True))
    for span, force in zip(accumulate(state.past_steps), state.past_forces, strict=True):
        if len(times) < POINTS_OF_WORK and span > NEAREST_PAST * h:
            times.append(-span)
            forces.append(force)
    if compliance * stiffness > 1.0:
        return _work_of_place(state, trial, times, forces, compliance)
    return -stored - integral(times, forces, lambda time: phase.velocity(start + time), h)


def _work_of_place(state: State, trial: Trial, times: list[float], forces: list[float], compliance: float) -> float:
    """The same where the spring is softer than the contact: then the punch's displacement is the smooth one, and the force
    follows from it and the drive, F = (d - D)/k_M^-1, however far that goes. times [s], forces [N]: of the polynomial."""
    start, phase, first = state.elapsed, trial.phase, state.force

    def driven(time: float) -> float:
        return phase.displacement(start + time) - phase.displacement(start)

    moved = [driven(time) + compliance * (force - first) for time, force in zip(times, forces, strict=True)]
    end = driven(trial.step) + compliance * (trial.force - first)
    shared = 0.0
    for place, share in GAUSS:
        at = place * trial.step
        rate = sum(weight * travel for weight, travel in zip(lagrange_slopes(times, at), moved, strict=True))
        shared += share * trial.step * driven(at) * rate
    return -first * end - (0.5 * end**2 - shared) / compliance


def tension_of(
    state: State, trial: Trial, tableau: Tableau, work: float, compliance: float = 0.0
) -> tuple[float, float]:
    """Lowest force [N] within a step, and the work [J] of a retracting punch under tension; work [J]: of the whole
    step; compliance [m/N]: of the machine's spring.

    From the parabola through the forces at the start, at the first stage and at the end, because a step may be as long
    as the pull-off peak is wide. For a jump, or a step of one stage, from the ends only.
    """
    start, phase = state.elapsed, trial.phase
    lowest, highest = min(state.force, *trial.forces), max(state.force, *trial.forces)
    if lowest > highest - lowest or lowest == highest == 0.0:
        # Far from tension, or free.
        return lowest, 0.0
    if trial.runaway:
        return lowest, work
    places = np.linspace(0.0, 1.0, TENSION_SAMPLES)
    known = [0.0, *tableau.nodes], [state.force, *trial.forces]
    if trial.is_jump:
        known = [0.0, 1.0], [state.force, trial.force]
    curve = np.polyval(np.polyfit(*known, len(known[0]) - 1), places)
    dip = float(curve.min())
    # Exclude rounding errors of a parabola that ends at zero.
    lowest = dip if dip < lowest - 1e-9 * (highest - lowest) else lowest
    if not phase.may_let_go or lowest >= 0.0:
        return lowest, 0.0
    if curve.max() <= 0.0 and phase.velocity(start) >= 0.0:
        return lowest, work
    moved = np.diff([phase.displacement(start + place * trial.step) for place in places])
    if compliance:
        moved += compliance * np.diff(curve)
    pull = np.maximum(-curve, 0.0)
    return lowest, float(0.5 * (pull[1:] + pull[:-1]) @ np.maximum(moved, 0.0))
