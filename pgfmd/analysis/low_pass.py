"""A low-pass filter in displacement, for curves of a finite resolution such as the paper's measured ones (0.1 um).

The force is averaged over the displacement with a Gaussian weight,

    F_s(x) = int F(x') exp(-(x - x')^2/(2 s^2)) dx' / sqrt(2 pi s^2),   s = resolution/sqrt(12)

whose standard deviation is that of a uniform mean over `resolution`. It is symmetric and so has no delay. Each branch
is filtered separately, so that approach and retraction are not mixed. A wave of wavelength l is multiplied by exp(-2
pi^2 s^2/l^2), which is a half at 1.5 times the resolution. At its ends a branch is continued by reflection in the end
point, which preserves end points and straight lines. Jumps become steps as wide as the resolution.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import make_interp_spline
from scipy.ndimage import convolve1d

from pgfmd.results.curve import Array, Loop

PAPER_RESOLUTION = 1e-7
"""[m]: the resolution to which the paper filters its measured curves."""
CELLS = 8
"""Cells a standard deviation."""
REACH = 6
"""Standard deviations after which the weight is cut."""
MOST_CELLS = 10_000_000


def low_pass(displacement: ArrayLike, force: ArrayLike, resolution: float = PAPER_RESOLUTION) -> Array:
    """Filtered forces [N] of one branch, at its own rows.

    Args:
        displacement: [m], shape (rows,), in the order of the motion. Where it goes back, as noise does, the
            displacement counts as constant.
        force: [N], shape (rows,), linear in between.
        resolution: [m], above zero.

    Raises:
        ValueError: if the resolution is not positive, or so fine that the branch has more than 1e7 cells.
    """
    x, force = np.asarray(displacement, dtype=float), np.asarray(force, dtype=float)
    if not (math.isfinite(resolution) and resolution > 0):
        raise ValueError(f"resolution = {resolution!r} m: expected a positive length")
    if len(x) < 2 or x[0] == x[-1]:
        return force.copy()
    x = np.maximum.accumulate((x - x[0]) * np.sign(x[-1] - x[0]))
    width = resolution / math.sqrt(12)
    count = max(4, math.ceil(x[-1] * CELLS / width))
    if count > MOST_CELLS:
        raise ValueError(f"resolution = {resolution!r} m: expected at least {x[-1] * CELLS / MOST_CELLS:.3g} m here")
    edges = np.linspace(0.0, x[-1], count + 1)
    smooth = _smoothed(_cell_means(x, force, edges), (force[0], force[-1]), width / edges[1])
    middles = 0.5 * (edges[1:] + edges[:-1])
    knots = np.concatenate(([0.0], middles, [x[-1]]))
    return make_interp_spline(knots, np.concatenate((force[:1], smooth, force[-1:])), k=3)(x)


def _cell_means(x: Array, force: Array, edges: Array) -> Array:
    """Means over cells of the line through the rows: exact, so that no ripple finer than a cell turns into a wave."""
    steps = np.diff(x)
    integral = np.concatenate(([0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * steps)))
    row = np.clip(np.searchsorted(x, edges, side="right") - 1, 0, len(steps) - 1)
    into = edges - x[row]
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.where(steps[row] > 0, (force[row + 1] - force[row]) / steps[row], 0.0)
    return np.diff(integral[row] + into * (force[row] + 0.5 * slope * into)) / np.diff(edges)


def _smoothed(means: Array, ends: tuple[float, float], width: float) -> Array:
    """The Gaussian mean of cell values; width: standard deviation in cells; ends: values at the ends of the first and
    of the last cell."""
    reach = min(math.ceil(REACH * width), len(means))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    before = 2 * ends[0] - means[:reach][::-1]
    after = 2 * ends[1] - means[len(means) - reach :][::-1]
    padded = np.concatenate((before, means, after))
    return convolve1d(padded, weights / weights.sum(), mode="nearest")[reach : reach + len(means)]


def filtered(loop: Loop, resolution: float = PAPER_RESOLUTION) -> Loop:
    """A loop with the forces of each branch filtered; the turning point stays where it is. Raises ValueError.

    Works integrated by a run are kept, because filtered forces have no jumps and would give other works.
    """
    force = loop.force.copy()
    # Rows between the preload and the deepest point, in the turn or a dwell, keep their force.
    deepest = len(force) - 1 - int(np.argmin(loop.displacement[::-1]))
    for rows in (slice(0, loop.preload_row + 1), slice(max(deepest, loop.preload_row), len(force))):
        force[rows] = low_pass(loop.displacement[rows], loop.force[rows], resolution)
    recorded = {key: value for key, value in loop.recorded.items() if not key.endswith("_N")}
    return dataclasses.replace(loop.with_force(force), work=loop.work, separation=loop.separation, recorded=recorded)
