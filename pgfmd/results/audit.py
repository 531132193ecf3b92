"""How far the energy audit of a run closes, measured by what is at stake. No MPI."""

from __future__ import annotations

import numpy as np

from .reading import Results

LEAST_LOOP = 0.1
"""A loop counts as this share of the largest work that the punch has done, if it is smaller."""
UNBALANCED = 0.05
"""Residual of the energy audit, as a share of what is at stake, from which on a run is said not to be balanced."""


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
