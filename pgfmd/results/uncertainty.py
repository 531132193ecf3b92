"""Uncertainties of a run's numbers due to `solver.accuracy` (docs: reference, "Numbers"), and the relative residual of
its energy audit. No MPI.

The error of a step may be `accuracy`, for forces relative to the largest so far. Errors of steps of second order hardly
accumulate; those of first order do, because they have the same sign. The force within a step is only known from the
dense output, whose uncertainty is taken to be its difference from the ends of the step. These are estimates, not
bounds. The factors were determined with runs at accuracies 10 to 100 times finer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pgfmd.schemes import registry

from .reading import Results

SECOND_ORDER = 2.0
"""Ratio of errors of forces and works to `accuracy`, for steps of second order, and for equilibria."""
FIRST_ORDER = 4.0
"""The same for steps of first order."""
LEAST_LOOP = 0.1
"""A smaller loop is replaced by this fraction of the largest work of the punch."""
UNCERTAIN = 0.2
"""Relative uncertainty of the loop of a quasi-static run from which on there is a warning."""
UNBALANCED = 0.05
"""Relative residual of the energy audit from which on there is a warning."""


def share_of(solver: Mapping[str, Any]) -> float:
    """Relative uncertainty of forces and works of a run due to the errors of its steps. NaN if unknown, as for explicit
    steps, which have no accuracy.

    solver: `scheme`, `accuracy` and `order`, of the section `solver` of a scene, or of `run.json`.
    """
    accuracy, scheme = solver.get("accuracy"), registry.scheme_in(solver)
    if not scheme.has_accuracy or not isinstance(accuracy, (int, float)):
        return math.nan
    first = scheme.has_orders and solver.get("order", 2) == 1
    return (FIRST_ORDER if first else SECOND_ORDER) * accuracy


def of_force(force: float, at_ends: float, share: float) -> float:
    """Uncertainty [N] of the lowest force within steps; at_ends [N]: the lowest one at their ends."""
    return share * abs(force) + abs(force - at_ends)


def of_work(work: float, separation: float, residual: float, share: float) -> float:
    """Uncertainty [J] of a work. separation [J]: the work of separation, which is stored and returned in a small loop.
    residual [J]: the largest one of the energy audit."""
    return share * max(abs(work), abs(separation)) + abs(residual)


def of_loop(unbalanced: float, jump_variance: float, residual: float) -> float:
    """Uncertainty [J] of the loop of a quasi-static run, from what it found out on the way: the work [J] of the forces
    that its solves left without balance, which all widen the loop; the variance [J^2] of the energies of its jumps, whose
    errors are independent; and the largest residual [J] of the energy audit."""
    return unbalanced + math.sqrt(jump_variance) + abs(residual)


def largest_residual(results: Results) -> float:
    """The largest residual [J] of the audit at any step: from the record, else from the rows. 0 without an audit.
    Raises ResultError if `energy.csv` can't be read."""
    record = results.run
    if record.get("energy_residual") is not None and record.get("work_J") is not None:
        return record["energy_residual"] * abs(record["work_J"])
    energy = results.energy
    return float(np.max(np.abs(energy["residual [J]"]))) if energy is not None and len(energy) else 0.0


def at_stake(results: Results, work: float) -> float:
    """The energy [J] to which a residual is relative: net work of the loop [J], or a fraction of the largest work if
    that is more. Raises ResultError if `energy.csv` can't be read."""
    energy = results.energy
    most = float(np.max(np.abs(energy["work [J]"]))) if energy is not None and len(energy) else 0.0
    return max(abs(work), LEAST_LOOP * most)
