"""A measured curve with the run that was fitted to it, and the residuals. No MPI."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pgfmd.results.curve import Loop

from .drawing import GREY, RED, TURQUOISE, new_figure, picture, seen

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]


@picture
def fitted_figure(
    measured: Loop,
    start: Loop,
    best: Loop,
    depth: Array,
    residuals: Array,
    branches: Sequence[str] = ("approach", "retraction"),
) -> Figure:
    """Force [mN] against indentation [um]: measured, at the start, and fitted. Below, the residuals, fitted minus
    measured. depth [m], residuals [N]: (points,), equally many on each of the branches, one branch after the other."""
    figure = new_figure(5.6, 5.4)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    styles = ((measured, "black", 2.2, "measured"), (start, GREY, 0.9, "start"), (best, RED, 1.2, "fitted"))
    for loop, colour, width, label in styles:
        upper.plot(*seen(1e6 * loop.indentation, 1e3 * loop.force), color=colour, linewidth=width, label=label)
    upper.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    upper.set_ylabel("force (mN)")
    upper.legend(loc="best")
    # The start may be far outside of the measured range.
    room = 0.08 * np.ptp(depth)
    upper.set_xlim(1e6 * (depth.min() - room), 1e6 * (depth.max() + room))
    lower.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    parts = (np.split(values, len(branches)) for values in (depth, residuals))
    for label, places, left in zip(branches, *parts, strict=True):
        colour = GREY if label == "approach" else TURQUOISE
        lower.plot(1e6 * places, 1e3 * left, color=colour, linewidth=1.0, label=label)
    lower.legend(loc="best", ncols=2)
    lower.set(xlabel="indentation (µm)", ylabel="fitted − measured\n(mN)")
    figure.align_ylabels()
    return figure
