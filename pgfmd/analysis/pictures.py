"""Pictures of an analysis and of a comparison: loops, the fit of u_inf, parts of the hysteresis, the bearing-area
model."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.plots.drawing import (
    DASHES,
    GREY,
    PALETTE,
    RED,
    TURQUOISE,
    VIOLET,
    energy_unit,
    footer,
    literal,
    new_figure,
    picture,
    seen,
    signed,
)
from pgfmd.results.curve import Loop

from .bulges import Bulge
from .compliance import CellCompliance
from .hysteresis import Audit, Twin

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .comparison import Comparison
    from .summary import Analysis

MEASURED = ("black", "0.45", "0.65")
"""Colours of measured loops."""
LEGEND_WIDTH = 75
"""Number of characters in a line of a legend above the curves."""
LEGEND_LINE = 0.17
"""Height [inch] of a line of the legend."""
PARTS = (("viscous", RED), ("released in jumps", VIOLET), ("stored or unexplained", "#c9c9c9"))
TWIN_PARTS = (("multistability (twin)", VIOLET), ("viscous and coaction", RED))


def plot_comparison(found: Comparison) -> Figure:
    """Curves of `compare`, force against indentation. Measured curves are black and grey."""
    return _with_footer(overlay_figure(found.loops, found.measured, found.changes), found.about)


def plot_bulges(analysis: Analysis) -> Figure:
    """The retraction with its minima and inflections. ResultError where there are none."""
    if not analysis.bulges:
        raise _lacking(analysis, "bulges")
    return _with_footer(bulge_figure(analysis.loop, analysis.bulges), analysis.about)


def plot_compliance(analysis: Analysis) -> Figure:
    """u_inf against force, and k_cc. ResultError where it can't be fitted."""
    if analysis.cell is None:
        raise _lacking(analysis, "compliance of its cell")
    return _with_footer(compliance_figure(analysis.loop, analysis.cell), analysis.about)


def plot_hysteresis(analysis: Analysis) -> Figure:
    """The parts of the work of the loop, by the audit and in comparison with the twin. ResultError without either."""
    if analysis.audit is None and analysis.twin is None:
        raise _lacking(analysis, "audit and no twin")
    return _with_footer(hysteresis_figure(analysis.audit, analysis.twin), analysis.about)


def plot_twin(analysis: Analysis) -> Figure:
    """The loop and that of its quasi-static twin. ResultError without one."""
    if analysis.twin_loop is None:
        raise _lacking(analysis, "twin; name its folder to `analyse`")
    return _with_footer(overlay_figure([analysis.loop, analysis.twin_loop]), analysis.about)


def plot_bearing_area(analysis: Analysis) -> Figure:
    """The loop and the predictions for independent asperities. ResultError if there are none."""
    if not analysis.predictions:
        raise _lacking(analysis, "bearing-area model; ask `analyse` for it")
    loops = [analysis.loop, *(prediction.loop for prediction in analysis.predictions)]
    return _with_footer(overlay_figure(loops), analysis.about)


def _lacking(analysis: Analysis, name: str) -> ResultError:
    return ResultError(f"{analysis.directory}: this analysis has no {name}")


def _with_footer(figure: Figure, text: str) -> Figure:
    footer(figure, text)
    return figure


@picture
def overlay_figure(loops: list[Loop], measured: int | None = None, changes: Sequence[str] = ()) -> Figure:
    """Force [mN] against indentation [um]: approaches thin and dashed, retractions in colour.

    measured: number of the first measured loop; measured loops are black and grey. changes: corrections of each curve,
    for its legend.
    """
    labelled_loops = zip(loops, changes, strict=True) if changes else ()
    labels = [textwrap.wrap(f"{loop.name}: {change}", LEGEND_WIDTH) for loop, change in labelled_loops]
    figure = new_figure(5.6, 4.0 + LEGEND_LINE * sum(map(len, labels)))
    axis = figure.subplots()
    axis.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    for number, loop in enumerate(loops):
        own = None if measured is None or number < measured else number - measured
        colour = PALETTE[number % len(PALETTE)] if own is None else MEASURED[own % len(MEASURED)]
        x, force = 1e6 * loop.indentation, 1e3 * loop.force
        rows = loop.branches["retraction"]
        before = slice(0, rows.start + 1)
        if rows.start > 1:
            axis.plot(*seen(x[before], force[before]), color=colour, linestyle=DASHES, linewidth=0.8)
        width = 1.4 if own is None else 1.0
        label = literal("\n".join(labels[number]) if changes else loop.name)
        axis.plot(*seen(x[rows], force[rows]), color=colour, linewidth=width, label=label)
    # The text about corrections may be long. Above the axes it hides no curve.
    figure.legend(loc="outside upper left") if changes else axis.legend(loc="upper left")
    axis.set(xlabel="indentation (µm)", ylabel="force (mN)")
    return figure


@picture
def bulge_figure(loop: Loop, found: list[Bulge]) -> Figure:
    """The retraction, force [mN] against indentation [um], with its minima and inflections marked."""
    figure = new_figure(5.2, 3.6)
    axis = figure.subplots()
    rows = loop.branches["retraction"]
    axis.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    x, force = seen(1e6 * loop.indentation[rows], 1e3 * loop.force[rows])
    axis.plot(x, force, color=TURQUOISE, label="retraction")
    for kind, marker in (("minimum", "v"), ("inflection", "d")):
        own = [bulge for bulge in found if bulge.kind == kind]
        if own:
            places = [1e6 * (-bulge.displacement - loop.offset) for bulge in own]
            y = [1e3 * bulge.force for bulge in own]
            axis.plot(places, y, marker, color=RED, markersize=5, linestyle="none", label=kind)
    axis.legend(loc="upper left")
    axis.set(xlabel="indentation (µm)", ylabel="force (mN)")
    return figure


@picture
def compliance_figure(loop: Loop, cell: CellCompliance) -> Figure:
    """u_inf [um] against force [mN], and the line whose slope is 1/k_cc."""
    figure = new_figure(4.6, 3.6)
    axis = figure.subplots()
    for name, rows in loop.branches.items():
        colour = GREY if name == "approach" else TURQUOISE
        style: dict[str, Any] = {"linestyle": DASHES if name == "approach" else "-", "label": name}
        axis.plot(*seen(1e3 * loop.force[rows], 1e6 * loop.u_inf[rows]), color=colour, **style)
    ends = np.array([loop.force.min(), loop.force.max()])
    label = f"F/k_cc,  k_cc = {cell.stiffness / 1e3:.4g} kN/m"
    axis.plot(1e3 * ends, 1e6 * ends / cell.stiffness, color="black", linewidth=0.8, label=label)
    axis.set(xlabel="force (mN)", ylabel="u_inf (µm)")
    axis.legend(loc="upper left")
    axis.set_title(f"fit through the origin, {cell.rows} rows", color="0.35")
    return figure


@picture
def hysteresis_figure(audit: Audit | None, twin: Twin | None) -> Figure:
    """Bars of the loop's energy by the audit, and in comparison with the quasi-static twin."""
    bars: list[tuple[str, list[tuple[str, str, float]]]] = []
    if audit is not None:
        values = (audit.viscous, audit.released, audit.work - audit.viscous - audit.released)
        bars.append(("energy audit", [(name, colour, v) for (name, colour), v in zip(PARTS, values, strict=True)]))
    if twin is not None:
        of_twin = (twin.twin_loop, twin.rest)
        parts = [(name, colour, v) for (name, colour), v in zip(TWIN_PARTS, of_twin, strict=True)]
        bars.append(("against the\nquasi-static twin", parts))
    largest = max(abs(value) for _, parts in bars for _, _, value in parts)
    factor, unit = energy_unit(largest)
    figure = new_figure(2.6 + 1.6 * len(bars), 3.8)
    axis = figure.subplots()
    axis.axhline(0, color="0.5", linewidth=0.8)
    for place, (_, parts) in enumerate(bars):
        above = below = 0.0
        for name, colour, value in parts:
            bottom = above if value >= 0 else below
            axis.bar(place, value / factor, bottom=bottom, color=colour, width=0.55, edgecolor="white", linewidth=0.6)
            if abs(value) > 0.06 * largest:
                text = f"{name}\n{signed(value / factor)}"
                ink = "white" if colour != PARTS[2][1] else "black"
                axis.text(place, bottom + value / factor / 2, text, ha="center", va="center", fontsize=7.5, color=ink)
            above, below = above + max(value / factor, 0), below + min(value / factor, 0)
    axis.set_xticks(range(len(bars)), [name for name, _ in bars])
    axis.set_xlim(-0.6, len(bars) - 0.4)
    axis.set_ylabel(f"energy of the loop ({unit})")
    return figure
