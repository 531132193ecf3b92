"""Bulges of the retraction: minima and plateaus of the force, where a part of the contact has opened."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from pgfmd.results.curve import Loop

from .low_pass import PAPER_RESOLUTION, low_pass

PROMINENCE = 0.02
"""A minimum counts if it is deeper than this fraction of the range of forces below the larger of zero and its load."""
SLOPE_PROMINENCE = 0.25
"""An inflection counts if the slope increases by this fraction of the median slope of the branch."""
FINEST = 5e-4
"""Smallest automatic resolution, as a fraction of the length of the retraction, so that noise of the grid does not
count as bulges."""
COARSEST = 0.02
"""Largest automatic resolution, as a fraction of the length of the retraction, so that bulges of a small punch are
kept."""


@dataclass(frozen=True)
class Bulge:
    """A "minimum" or an "inflection" of the retraction: displacement [m] of the punch, force [N] there."""

    kind: str
    displacement: float
    force: float


def bulges(loop: Loop, resolution: float | None = None) -> list[Bulge]:
    """The bulges of the retraction, in the order in which they come, the pull-off among them.

    The branch is filtered to `resolution` [m] first; None: to the paper's 0.1 um if that is between 1/2000 and 1/50 of
    the length of the retraction, else to the nearer of these limits. A minimum is a local one of the force over the
    displacement. At an inflection the force decreases, but less steeply than before and after. Empty without a
    retraction.
    """
    rows = loop.branches["retraction"]
    rows = slice(max(rows.start, loop.preload_row), rows.stop)
    x = np.maximum.accumulate(loop.displacement[rows])
    if not loop.retracted or len(x) < 4 or x[-1] <= x[0]:
        return []
    if resolution is None:
        resolution = min(max(PAPER_RESOLUTION, FINEST * (x[-1] - x[0])), COARSEST * (x[-1] - x[0]))
    force = low_pass(x, loop.force[rows], resolution)
    moving = np.concatenate(([True], np.diff(x) > 0))
    even = np.arange(x[0], x[-1], resolution / 4)
    if len(even) < 8:
        return []
    even_force = low_pass(even, np.interp(even, x[moving], force[moving]), resolution)
    slope = np.gradient(even_force, even)
    scale = PROMINENCE * max(-float(even_force.min()), 0.1 * float(even_force.max()))
    dips, _ = find_peaks(-even_force, prominence=max(scale, np.finfo(float).tiny))
    found = [Bulge("minimum", float(even[i]), float(even_force[i])) for i in dips]
    last = dips[-1] if dips.size else len(even) - 1
    falling = np.abs(slope[:last][slope[:last] < 0])
    if falling.size:
        limit = SLOPE_PROMINENCE * float(np.median(falling))
        halts, _ = find_peaks(slope[:last], prominence=limit)
        found += [Bulge("inflection", float(even[i]), float(even_force[i])) for i in halts if slope[i] < 0]
    return sorted(found, key=lambda bulge: bulge.displacement)
