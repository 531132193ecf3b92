"""How far a simulated loop is from a measured one: differences of forces at places along the measured branches. Plain NumPy.

Both are brought together as `pgfmd compare` does it (analysis/comparison.py). The places are evenly spaced in the measured
indentation, from where a force begins in the approach to where it ends in the retraction. Between its rows a run's force
is a monotone cubic (PCHIP). Where the run has no row it has no contact, and no force; deeper than it went, its force is continued
with the stiffness that it had there. A branch of next to no rows, as one that was not measured, does not count.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from pgfmd.analysis.comparison import Overlay, overlay
from pgfmd.analysis.measured_checks import LEAST_ROWS
from pgfmd.errors import MeasurementError
from pgfmd.results.curve import Array, Loop

SAMPLES = 100
"""Places on each branch."""
FELT = 0.02
"""Share of the largest force from which on a force is felt."""
MARGIN = 0.1
"""How far a branch is looked at before and after that, as a share of the depth."""
END = 0.1
"""Fraction of the approach, at its end, from which the stiffness for its continuation is taken."""


@dataclass(frozen=True)
class Corrections:
    """What `pgfmd compare` does to curves, see `comparison.overlay`: machine_stiffness [N/m]; resolution [m] of the low-pass
    filter, None for none; offset [m], None to fit it."""

    correct: str = "none"
    machine_stiffness: float = math.inf
    resolution: float | None = None
    offset: float | None = 0.0


@dataclass(frozen=True, eq=False)
class Misfit:
    """Differences of runs from a measured loop."""

    measured: Loop
    corrections: Corrections = Corrections()

    @property
    def scale(self) -> float:
        """The largest measured force [N], of either sign."""
        return float(np.max(np.abs(self.measured.force)))

    @cached_property
    def _places(self) -> dict[str, Array]:
        """Rows of the measured loop, with fractions, by branch. Raises MeasurementError where it has no branch."""
        loop, found = self.measured, {}
        depth = loop.indentation
        felt = np.abs(loop.force) > FELT * self.scale
        for name, rows in loop.branches.items():
            if depth[rows].size < LEAST_ROWS:
                continue
            inward = name == "approach"
            place = np.maximum.accumulate(depth[rows] if inward else depth[rows][::-1])
            number = np.arange(rows.start, rows.start + depth[rows].size, dtype=float)
            number = number if inward else number[::-1]
            where = depth[rows][felt[rows]]
            first = where.min() - MARGIN * (place[-1] - where.min()) if where.size else place[0]
            found[name] = np.interp(np.linspace(max(place[0], first), place[-1], SAMPLES), place, number)
        if not found:
            raise MeasurementError(
                f"{loop.name}: expected at least {LEAST_ROWS} rows in the approach, or in the retraction, found "
                f"{len(loop.force)} in all"
            )
        return found

    @property
    def branches(self) -> tuple[str, ...]:
        """The branches that count, in the order of the places."""
        return tuple(self._places)

    @property
    def forces_measured(self) -> Array:
        """Measured forces [N] at all places, (SAMPLES for each branch,), as they were measured."""
        rows = np.arange(len(self.measured.force), dtype=float)
        return np.concatenate([np.interp(places, rows, self.measured.force) for places in self._places.values()])

    def laid_over(self, run: Loop) -> Overlay:
        """The run and the measured loop as they are compared. ValueError if they can't be."""
        corrections = self.corrections
        return overlay(
            [run],
            [self.measured],
            corrections.correct,
            corrections.machine_stiffness,
            corrections.resolution,
            corrections.offset,
        )

    def forces(self, run: Loop) -> tuple[Array, Array, Array]:
        """Indentations [m], forces [N] of the run and measured forces [N] at all places, (SAMPLES for each branch,), the way
        in first.

        Raises ValueError if the two can't be laid over each other.
        """
        simulated, measured = self.laid_over(run).loops
        rows = np.arange(len(measured.force), dtype=float)
        depths, forces, wanted = [], [], []
        for name, places in self._places.items():
            depth = np.interp(places, rows, measured.indentation)
            depths.append(depth)
            wanted.append(np.interp(places, rows, measured.force))
            forces.append(_force_at(simulated, name, depth))
        return np.concatenate(depths), np.concatenate(forces), np.concatenate(wanted)


def _force_at(loop: Loop, branch: str, depth: Array) -> Array:
    """Forces [N] of a run's branch at indentations [m]."""
    rows = loop.branches["approach"]
    inward, force_in = np.maximum.accumulate(loop.indentation[rows]), loop.force[rows]
    deepest = inward[-1]
    end = inward >= deepest - END * (deepest - inward[0])
    stiffness = np.polyfit(inward[end], force_in[end], 1)[0] if np.ptp(inward[end]) > 0.0 else 0.0
    rows = loop.branches[branch]
    place, force = loop.indentation[rows], loop.force[rows]
    if branch != "approach":
        place, force = place[::-1], force[::-1]
    place, first = np.unique(np.maximum.accumulate(place), return_index=True)
    if place.size < 2:
        return np.zeros_like(depth)
    # Steps are long where the force is smooth: lines between their ends would be too coarse.
    found = PchipInterpolator(place, force[first])(np.clip(depth, place[0], place[-1]))
    return np.where(depth < place[0], 0.0, found + stiffness * np.maximum(depth - place[-1], 0.0))
