"""Pictures of programmes with repeats: numbers of each cycle. Reads files only, no MPI."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.results.curve import measure
from pgfmd.results.cycles import count_of, cycles_of
from pgfmd.results.reading import Run

from .curves import at_foot, axis_unit, labelled, opened_together
from .drawing import PALETTE, literal, new_figure, picture
from .numbers import MARKERS, NUMBERS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANELS = ("pull-off", "separation", "loop")
"""Numbers that are drawn, by their names of NUMBERS."""


@picture
def plot_cycles(*runs: Run) -> Figure:
    """Pull-off force, work of separation and net work against the number of the cycle, a panel each.

    runs: results, or folders, of programmes with repeats. Raises ResultError if one can't be read, or has no cycles.
    """
    with opened_together(runs) as (results, loops):
        found = []
        for run, loop in zip(results, loops, strict=True):
            if count_of(loop) == 1:
                raise ResultError(f"{run.directory}: it has one cycle, so there is nothing to draw against its number")
            found.append([(cycle.number, measure(cycle.loop)) for cycle in cycles_of(run, loop)])
        figure = new_figure(7.2, 2.6)
        axes = figure.subplots(1, len(PANELS))
        for axis, name in zip(axes, PANELS, strict=True):
            number = NUMBERS[name]
            rows = [[(k, value) for k, each in run if (value := number.of(each)) is not None] for run in found]
            factor, unit = axis_unit([np.array([value for _, value in points]) for points in rows], number.unit)
            for k, points in enumerate(rows):
                if points:
                    cycles, values = zip(*points, strict=True)
                    label = literal(loops[k].name) if len(runs) > 1 else None
                    axis.plot(
                        cycles, np.array(values) / factor, marker=MARKERS[k % len(MARKERS)], markersize=4,
                        color=PALETTE[k % len(PALETTE)], label=label,
                    )  # fmt: skip
            axis.set(xlabel="cycle", ylabel=labelled(number.name, unit))
            axis.xaxis.get_major_locator().set_params(integer=True)
        if len(runs) > 1:
            axes[0].legend(loc="best")
        at_foot(figure, results)
    return figure
