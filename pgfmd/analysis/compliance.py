"""Compliance corrections of displacements: for the periodic cell of a simulation, and for the machine of an experiment.

Paper, "Refinements and corrections", with indentations counted positive when the punch is pushed in:

    simulation   u_ideal = u_ind + F/k_cc      k_cc from the linear fit of u_inf = F/k_cc
    experiment   u_ideal = u_ind - F/k_M       k_M: stiffness of the machine

The surface far away of a periodic cell rises when the punch presses (u_inf > 0 for F > 0), and the ideal indentation
counts from there. The paper's figures do not correct the simulations, and subtract F/k_cc from the experiments: then
both are shown as in the cell. By default nothing is corrected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pgfmd.results.curve import Loop

LEAST_FORCE = 1e-3
"""Rows below this fraction of the largest force are left out of the fit of a stiffness."""
CORRECTIONS = ("experiment", "simulation", "none")
"""The curves that are corrected for the periodic cell."""


@dataclass(frozen=True)
class CellCompliance:
    """The fit u_inf = F/k_cc: stiffness k_cc [N/m] with its standard error, number of rows, and phases.

    scatter [m]: root mean square of u_inf - F/k_cc. span [m]: range of u_inf. offset [m]: where a line with an
    intercept crosses F = 0.
    """

    stiffness: float
    standard_error: float
    rows: int
    scatter: float
    span: float
    offset: float


def fit_cell_compliance(loop: Loop, phases: tuple[str, ...] | None = None) -> CellCompliance | None:
    """k_cc of a run, by least squares through the origin over all rows with a noticeable force.

    phases: only rows of these parts of the programme, such as ("approach",). None for a free boundary, where the
    surface far away is at rest, or fewer than three rows with a force.
    """
    size = float(np.max(np.abs(loop.force)))
    used = (np.abs(loop.force) > LEAST_FORCE * size) & np.isfinite(loop.u_inf)
    if phases is not None:
        used &= np.isin(loop.phase, phases)
    force, u_inf = loop.force[used], loop.u_inf[used]
    if force.size < 3 or not np.any(u_inf):
        return None
    slope = float(force @ u_inf / (force @ force))
    rest = u_inf - slope * force
    scatter = float(np.sqrt(np.mean(rest**2)))
    error = float(np.sqrt(rest @ rest / (force.size - 1) / (force @ force)))
    offset = float(np.polynomial.Polynomial.fit(force, u_inf, 1).convert().coef[0]) if np.ptp(force) > 0 else 0.0
    return CellCompliance(1.0 / slope, abs(error / slope**2), int(force.size), scatter, float(np.ptp(u_inf)), offset)


def corrected_simulation(loop: Loop, cell_stiffness: float) -> Loop:
    """A run as it is on an unbounded surface, u_ind + F/k_cc; cell_stiffness: k_cc [N/m], infinite for none."""
    return loop.pushed_in_by(loop.force / cell_stiffness)


def corrected_experiment(loop: Loop, machine_stiffness: float = np.inf, cell_stiffness: float = np.inf) -> Loop:
    """A measured loop corrected for the machine, u_ind - F/k_M, and, for comparison with an uncorrected run in a
    periodic cell, for the cell, - F/k_cc.

    machine_stiffness, cell_stiffness: k_M, k_cc [N/m], infinite for none.
    """
    return loop.pushed_in_by(-loop.force / machine_stiffness - loop.force / cell_stiffness)
