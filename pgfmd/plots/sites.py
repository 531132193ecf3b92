"""Numbers of summits, saddles and valleys of the punch in contact during approach and retraction. Reads files only, no
MPI."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pgfmd.errors import ResultError
from pgfmd.results.curve import Loop
from pgfmd.results.reading import Run, opened
from pgfmd.results.sites import site_histories

from .curves import at_foot
from .drawing import OCHRE, RED, TURQUOISE, new_figure, picture, seen

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {"summit": TURQUOISE, "saddle": RED, "valley": OCHRE}
APPROACH = {"linestyle": (0, (4, 2)), "linewidth": 1.0}
PLURALS = {"summit": "summits", "saddle": "saddles", "valley": "valleys"}


@picture
def plot_sites(run: Run) -> Figure:
    """Sites in contact against force [mN] and, below, against indentation [um]; approach dashed, the rest solid.

    For a run that counted only overlap, the sites in overlap, and the labels say so.

    run: results, or their folder. Raises ResultError if it can't be read, or no site was ever in contact.
    """
    with opened(run) as results:
        histories = site_histories(results, Loop.of(results))
        if not histories:
            raise ResultError(f"{results.directory}: no summit, saddle or valley that has met the elastomer")
        figure = new_figure(5.2, 5.6)
        upper, lower = figure.subplots(2, 1)
        for history in histories:
            label, colour = f"{PLURALS[history.kind]}, of {history.of}", COLOURS[history.kind]
            for axis, across in ((upper, 1e3 * history.force), (lower, 1e6 * history.indentation)):
                # Both branches include the turning point.
                approach, rest = slice(0, history.turn), slice(history.turn - 1, None)
                axis.plot(*seen(across[approach], history.count[approach]), color=colour, **APPROACH)
                axis.plot(*seen(across[rest], history.count[rest]), color=colour, label=label)
        upper.plot([], [], color="0.3", label="approach", **APPROACH)
        upper.axvline(0, color="0.8", linewidth=0.8, zorder=0)
        what = "overlapping (gap < 0)" if results.counts_overlap else "in contact"
        upper.set(xlabel="force (mN)", ylabel=what)
        lower.set(xlabel="indentation (µm)", ylabel=what)
        for axis in (upper, lower):
            axis.set_ylim(bottom=0)
            axis.yaxis.get_major_locator().set_params(integer=True)
        upper.legend(loc="best")
        at_foot(figure, [results])
    return figure
