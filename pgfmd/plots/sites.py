"""How many summits, saddles and valleys of the punch are in contact on the way in and out. Reads files only, no MPI."""

from __future__ import annotations

from typing import Any

from pgfmd.results import Results
from pgfmd.results.curve import Loop
from pgfmd.results.sites import site_histories

from .drawing import new_figure, seen

COLOURS = {"summit": "#00798c", "saddle": "#b3352b", "valley": "#d18f00"}
APPROACH = {"linestyle": (0, (4, 2)), "linewidth": 1.0}
PLURALS = {"summit": "summits", "saddle": "saddles", "valley": "valleys"}


def site_figure(results: Results) -> Any:
    """Sites in contact against force [mN] and, below, against indentation [um]; approach dashed, the rest full.

    Of a run that counted overlap alone, the sites that overlap, and the axes say so.
    """
    figure = new_figure(5.2, 5.6)
    upper, lower = figure.subplots(2, 1)
    for history in site_histories(results, Loop.of(results)):
        label, colour = f"{PLURALS[history.kind]}, of {history.of}", COLOURS[history.kind]
        for axis, across in ((upper, 1e3 * history.force), (lower, 1e6 * history.indentation)):
            # Both branches have the point where one becomes the other.
            way_in, rest = slice(0, history.turn), slice(history.turn - 1, None)
            axis.plot(*seen(across[way_in], history.count[way_in]), color=colour, **APPROACH)
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
    return figure
