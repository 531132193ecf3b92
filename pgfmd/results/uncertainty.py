"""How far off the numbers of a run may be for its `solver.accuracy` (docs: reference, "Numbers"), and how far its
energy audit closes, measured by what is at stake. No MPI.

A step may be off by `accuracy`, of forces as a share of the largest so far. Errors of steps add up: of second order
hardly, of first order more, as all of them have one sign. What happened within a step is known by its dense output
alone, and that is trusted no better than by what it adds to the step's ends. These are estimates, no bounds. The
factors were found by runs at accuracies 10 to 100 times finer.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from pgfmd.schemes import registry

from .reading import Results

SECOND_ORDER = 2.0
"""Errors of a run's forces and works over `accuracy`, for steps of second order, and for equilibria."""
FIRST_ORDER = 4.0
"""The same for steps of first order."""
LEAST_LOOP = 0.1
"""A loop counts as this share of the largest work that the punch has done, if it is smaller."""
UNBALANCED = 0.05
"""Residual of the energy audit, as a share of what is at stake, from which on a run is said not to be balanced."""


def share_of(solver: Mapping[str, Any]) -> float:
    """By which share forces and works of a run may be off for the errors of its steps. NaN where nothing is known of
    them, as explicit steps have no accuracy.

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
    """Uncertainty [J] of a work; separation: the work of separation, the energy that comes and goes where the loop is
    small beside it; residual: largest one of the energy audit, all [J]."""
    return share * max(abs(work), abs(separation)) + abs(residual)


def largest_residual(results: Results) -> float:
    """The largest residual [J] of the audit at any step: as the run tells it, or of the rows that there are. 0 without
    an audit. ResultError if `energy.csv` can't be read."""
    record = results.run
    if record.get("energy_residual") is not None and record.get("work_J") is not None:
        return record["energy_residual"] * abs(record["work_J"])
    energy = results.energy
    return float(np.max(np.abs(energy["residual [J]"]))) if energy is not None and len(energy) else 0.0


def at_stake(results: Results, work: float) -> float:
    """The energy [J] by which a residual is judged: net work of the loop [J], or a part of the work of the way in where
    little is lost. ResultError if `energy.csv` can't be read."""
    energy = results.energy
    most = float(np.max(np.abs(energy["work [J]"]))) if energy is not None and len(energy) else 0.0
    return max(abs(work), LEAST_LOOP * most)
