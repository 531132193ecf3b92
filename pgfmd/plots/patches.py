"""How many summits, saddles and valleys of the punch are in contact on the way in and out. Reads files only, no MPI."""

from __future__ import annotations

from typing import Any

import numpy as np

from pgfmd.physics.contact_sites import KINDS
from pgfmd.results import Results
from pgfmd.results.curve import turning_row

from .maps import new_figure
from .thinning import seen

COLOURS = {"summit": "#00798c", "saddle": "#b3352b", "valley": "#d18f00"}
APPROACH = {"linestyle": (0, (4, 2)), "linewidth": 1.0}
PLURALS = {"summit": "summits", "saddle": "saddles", "valley": "valleys"}


def site_history(results: Results, kind: str) -> dict[str, np.ndarray]:
    """How many sites of a kind are in contact along the run: `count`, `time` [s], `displacement` [m] and `force` [N] of
    every row of the curve, and of every join and leave before and after it."""
    curve, sites = results.curve, results.sites
    chosen = np.flatnonzero(np.asarray(sites["kind"]) == kind)
    after = np.asarray(sites["in_contact"])[chosen]
    before = np.concatenate(([0], after[:-1]))
    found = {}
    for name, column in (("time", "time [s]"), ("displacement", "displacement [m]"), ("force", "force [N]")):
        here = np.asarray(sites[column])[chosen]
        found[name] = np.concatenate([np.repeat(here, 2), np.asarray(curve[column])])
    change = np.asarray(sites["time [s]"])[chosen]
    between = np.searchsorted(change, np.asarray(curve["time [s]"]), side="right")
    steady = np.concatenate(([0], after))[between]
    found["count"] = np.concatenate([np.column_stack([before, after]).ravel(), steady])
    # A row of the curve at the time of a change shows what there is after it.
    order = np.argsort(found["time"], kind="stable")
    return {name: values[order] for name, values in found.items()}


def site_figure(results: Results) -> Any:
    """Sites in contact against force [mN] and, below, against indentation [um]; approach dashed, the rest full.

    Of a run that counted overlap alone, the sites that overlap, and the axes say so.
    """
    figure = new_figure(5.2, 5.6)
    upper, lower = figure.subplots(2, 1)
    phase, time = np.asarray(results.curve["phase"]), np.asarray(results.curve["time [s]"])
    turn = time[min(turning_row(np.asarray(results.curve["displacement [m]"]), phase), len(time) - 1)]
    kinds, totals = np.asarray(results.sites["kind"]), np.asarray(results.sites["of"])
    offset = float(results.curve["indentation [m]"][0] + results.curve["displacement [m]"][0])
    for kind in KINDS:
        if kind not in kinds:
            continue
        history = site_history(results, kind)
        indentation = 1e6 * (offset - history["displacement"])
        end = int(np.searchsorted(history["time"], turn, side="right"))
        label = f"{PLURALS[kind]}, of {totals[kinds == kind][0]}"
        for axis, across in ((upper, 1e3 * history["force"]), (lower, indentation)):
            count = history["count"]
            axis.plot(*seen(across[:end], count[:end]), color=COLOURS[kind], **APPROACH)
            # Both branches have the point where one becomes the other.
            axis.plot(*seen(across[end - 1 :], count[end - 1 :]), color=COLOURS[kind], label=label)
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
