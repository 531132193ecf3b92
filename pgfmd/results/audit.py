"""How far the energy audit of a run closes, measured by what is at stake. No MPI."""

from __future__ import annotations

import numpy as np

from .reading import Results

LEAST_LOOP = 0.1
"""A loop counts as this share of the largest work that the punch has done, if it is smaller."""


def at_stake(results: Results, work: float) -> float:
    """The energy [J] by which a residual is judged: net work of the loop [J], or a part of the work of the way in where
    little is lost. ResultError if `energy.csv` can't be read."""
    energy = results.energy
    most = float(np.max(np.abs(energy["work [J]"]))) if energy is not None and len(energy) else 0.0
    return max(abs(work), LEAST_LOOP * most)
