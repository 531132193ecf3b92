"""Pictures of a study: all curves, and the measured numbers against an axis. Reads files only, no MPI.

curves.png: force against indentation; colour is the first axis, a panel the second, the style of the line the others.
measures.png: pull-off force, work of separation, work of the loop and contact area at the preload against the first
axis that has numbers.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.plots.drawing import LINES, drawing, footer, literal, new_figure, picture, place_ticks, seen, write_picture
from pgfmd.results import load
from pgfmd.results.curve import Loop
from pgfmd.units import handy

from .cases import short_names
from .study_file import Axis
from .table import AT_PRELOAD, Row, StudyTable, counted_overlap
from .values import unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CURVES, MEASURES = "curves.png", "measures.png"
MARKERS = "osD^vP"
SHOWN = {
    "pull-off force": ("pull_off_force [N]", "N"),
    "work of separation": ("work_of_separation [J]", "J"),
    "work of the loop": ("work [J]", "J"),
}
MOST_NAMED = 12
"""Largest number of lines in a legend. If there are more, it shows every second, third, ... colour."""
WIDE = 20.0
"""Ratio of the largest to the smallest value above which an axis is logarithmic."""


class Plan:
    """Styles of a study's rows, by their values on the axes.

    Attributes:
        colour_axis, panel_axis: the first and the second axis, None if there is none. styles: the combinations of
            values on all further axes, in order. singles: rows of cases outside of the grid.
    """

    def __init__(self, rows: Sequence[Row], axes: Sequence[Axis]):
        # Twins are no places on the axes.
        twins = {row.case.twin for row in rows}
        self.rows, self.axes = [row for row in rows if row.case.name not in twins], list(axes)
        self.grid = [row for row in self.rows if row.case.places]
        self.singles = [row for row in self.rows if not row.case.places]
        self.colour_axis = self.axes[0] if self.axes else None
        self.panel_axis = self.axes[1] if len(self.axes) > 1 else None
        self.names = short_names([axis for axis in axes if not axis.bundles])
        self.names |= {axis.name: axis.name for axis in axes if axis.bundles}

    def label(self, row: Row, axis: Axis) -> str:
        """A row's value on an axis, as in the file of the study."""
        return row.case.places[axis.name]

    def labels(self, axis: Axis | None) -> list[str]:
        """The values on an axis; numbers are sorted."""
        if axis is None:
            return []
        found: dict[str, Any] = {self.label(row, axis): row.places[axis.name] for row in self.grid}
        numbers = all(isinstance(place, (int, float)) for place in found.values())
        return sorted(found, key=found.__getitem__) if numbers else list(found)

    def rest(self, row: Row) -> str:
        """A row's values on the axes after the second."""
        return ", ".join(f"{self.names[axis.name]} {self.label(row, axis)}" for axis in self.axes[2:])

    def rests(self) -> list[str]:
        """Every combination of values on the axes after the second."""
        return list(dict.fromkeys(self.rest(row) for row in self.grid))


def colours(count: int) -> list[Any]:
    """A number of colours of a sequential map, dark to light, without its faint end."""
    from cmcrameri import cm

    return [cm.batlow(share) for share in np.linspace(0.0, 0.75, count)] if count > 1 else [cm.batlow(0.25)] * count


def draw_study(table: StudyTable) -> list[Path]:
    """Draws the results so far; returns the files. Raises ResultError if one can't be written."""
    plan = Plan(table.rows, table.axes)
    with drawing():
        figures = {CURVES: curves_figure(table.out, plan, table.title), MEASURES: measures_figure(plan, table.title)}
        return [
            write_picture(_with_footer(figure, table), table.out / name)
            for name, figure in figures.items()
            if figure is not None
        ]


def plot_study_curves(table: StudyTable) -> Figure:
    """Force against indentation of all cases that have a curve: colour is the first axis, a panel the second, the style of
    the line the others. ResultError if no case has one yet."""
    return _with_footer(curves_figure(table.out, Plan(table.rows, table.axes), table.title), table)


def plot_study_numbers(table: StudyTable) -> Figure:
    """Pull-off force, works and contact area, with their uncertainties, against the first axis that has numbers.
    ResultError if no case is finished yet, or the study has no axes."""
    return _with_footer(measures_figure(Plan(table.rows, table.axes), table.title), table)


def _with_footer(figure: Figure | None, table: StudyTable) -> Figure:
    if figure is None:
        raise ResultError(f"{table.out}: no case of this study has anything to draw yet")
    done = sum(row.state.complete for row in table.rows)
    with drawing():
        footer(figure, f"{table.out.name}  ·  {done} of {len(table.rows)} cases are finished")
    return figure


@picture
def curves_figure(out: Path, plan: Plan, title: str) -> Figure | None:
    """Every case's force [mN] against its indentation [um], approach thin; None if no case has a curve yet."""
    drawn = {row.case.name: loop for row in plan.rows if (loop := _loop(out / row.case.name)) is not None}
    if not drawn:
        return None
    panels = plan.labels(plan.panel_axis) or [""]
    single_rows = [row for row in plan.singles if row.case.name in drawn]
    if single_rows and plan.panel_axis is not None:
        panels = [*panels, "further cases"]
    columns = 2 if len(panels) == 4 else min(len(panels), 3)
    lines = -(-len(panels) // columns)
    figure = new_figure(3.3 * columns + 1.6, 2.9 * lines + 0.5)
    grid = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for axis in grid[len(panels) :]:
        axis.remove()
    places = dict(zip(panels, grid, strict=False))
    labels = plan.labels(plan.colour_axis)
    shades = dict(zip(labels, colours(len(labels)), strict=True))
    styles = {rest: LINES[k % len(LINES)] for k, rest in enumerate(plan.rests())}
    for row in plan.grid:
        if row.case.name in drawn:
            where = plan.label(row, plan.panel_axis) if plan.panel_axis else ""
            colour = shades[plan.label(row, plan.colour_axis)] if plan.colour_axis else None
            _draw_curve(places[where], drawn[row.case.name], colour, styles[plan.rest(row)])
    for number, row in enumerate(single_rows):
        axis = places[panels[-1]]
        _draw_curve(axis, drawn[row.case.name], "0.25", LINES[number % len(LINES)], row.case.name)
    if single_rows:
        grid[len(panels) - 1].legend(loc="best", fontsize=7.0)
    for number, (name, axis) in enumerate(places.items()):
        axis.axhline(0.0, color="0.8", linewidth=0.8, zorder=0)
        if plan.panel_axis is not None:
            axis.set_title(name if name == "further cases" else f"{plan.names[plan.panel_axis.name]}  {name}")
        if number >= len(panels) - columns:
            axis.set_xlabel("indentation (µm)")
            # Also if the panel below is empty.
            axis.tick_params(labelbottom=True)
        axis.set_ylabel("force (mN)" if number % columns == 0 else "")
    _legend(figure, plan, shades, styles)
    if title:
        figure.suptitle(literal(title), fontsize=9.5)
    return figure


def _draw_curve(axis: Axes, loop: Loop, colour: Any, style: Any, label: str | None = None) -> None:
    indentation, force = 1e6 * loop.indentation, 1e3 * loop.force
    for name, rows in loop.branches.items():
        look = {"linewidth": 1.3, "label": label} if name == "retraction" else {"linewidth": 0.6}
        axis.plot(*seen(indentation[rows], force[rows]), color=colour, linestyle=style, **look)


def _loop(folder: Path) -> Loop | None:
    """A case's curve; None if there is none, it is empty, or it can't be read, which the table says."""
    try:
        with load(folder) as results:
            return Loop.of(results)
    except ResultError:
        return None


def _legend(figure: Figure, plan: Plan, shades: dict[str, Any], styles: dict[str, Any]) -> None:
    """One legend for all panels: colours, then styles."""
    from matplotlib.lines import Line2D

    handles = []
    if len(shades) > 1:
        handles.append(
            Line2D([], [], linestyle="none", label=plan.names[plan.colour_axis.name if plan.colour_axis else ""])
        )
        every = -(-len(shades) // MOST_NAMED)
        handles += [Line2D([], [], color=shade, label=name) for name, shade in list(shades.items())[::every]]
    if len(styles) > 1:
        handles += [Line2D([], [], color="0.3", linestyle=style, label=name) for name, style in styles.items()]
    if handles:
        figure.legend(handles=handles, loc="outside right upper")


@picture
def measures_figure(plan: Plan, title: str) -> Figure | None:
    """Measured numbers against the first axis with numbers, a line for each combination of values on the others; None
    without such an axis."""
    done = [row for row in plan.rows if row.state.complete]
    if not done or not plan.axes:
        return None
    numeric = [axis for axis in plan.axes if all(isinstance(row.places[axis.name], (int, float)) for row in plan.grid)]
    across = numeric[0] if numeric else plan.axes[0]
    others = [axis for axis in plan.axes if axis is not across]
    shown = {**SHOWN, **_areas_shown(done)}
    figure = new_figure(2.8 * len(shown) + 1.2, 3.1)
    panels = figure.subplots(1, len(shown))
    lines = list(_lines(plan, done, others))
    shades = colours(len(lines))
    for panel, (name, (measure, unit)) in zip(panels, shown.items(), strict=True):
        factor, unit = handy([value for row in done if (value := row.measured[measure]) is not None], unit)
        panel.set_ylabel(f"{name} ({unit})")
        for number, (label, rows) in enumerate(lines):
            points = sorted(_points(plan, rows, across, bool(numeric), measure))
            if not points:
                continue
            places, values, spreads = (np.array(each) for each in zip(*points, strict=True))
            marker, look = MARKERS[number % len(MARKERS)], {"color": shades[number]}
            panel.plot(places, values / factor, marker + "-", label=label, markersize=4, **look)
            panel.errorbar(
                places, values / factor, yerr=spreads / factor, fmt="none", elinewidth=0.8, ecolor=shades[number]
            )
        _singles(panel, [row for row in done if not row.case.places], across, measure, factor, bool(numeric))
        _x_axis(panel, plan, across, bool(numeric), done)
        overlapping = sum(counted_overlap(row.measured) for row in done)
        if measure == AT_PRELOAD.format("contact") and overlapping:
            panel.set_title(f"without {overlapping} that counted overlap", fontsize=7.0)
    handles, names = panels[0].get_legend_handles_labels()
    if any(names):
        figure.legend(handles, names, loc="outside right upper")
    if title:
        figure.suptitle(literal(title), fontsize=9.5)
    return figure


def _areas_shown(done: Sequence[Row]) -> dict[str, tuple[str, str]]:
    """The panel of contact areas, or of overlap if no case has its contact; none if no area is known."""
    for kind in ("contact", "overlap"):
        if any(row.measured[AT_PRELOAD.format(kind)] is not None for row in done):
            return {f"{kind} area at the preload": (AT_PRELOAD.format(kind), "m^2")}
    return {}


def _lines(plan: Plan, done: Sequence[Row], others: Sequence[Axis]) -> Iterator[tuple[str, list[Row]]]:
    """Label and rows of every combination of values on the other axes."""
    groups: dict[str, list[Row]] = {}
    for row in done:
        if row.case.places:
            name = ", ".join(f"{plan.names[axis.name]} {plan.label(row, axis)}" for axis in others)
            groups.setdefault(name, []).append(row)
    yield from groups.items()


def _points(
    plan: Plan, rows: Sequence[Row], across: Axis, numeric: bool, measure: str
) -> Iterator[tuple[float, float, float]]:
    """Position, value and uncertainty, 0 if unknown, of the rows that have a position and a value."""
    known = measure.replace(" [", "_uncertainty [")
    for row in rows:
        place, value = _across(plan, row, across, numeric), row.measured[measure]
        if place is not None and value is not None:
            yield place, value, row.measured.get(known) or 0.0


def _across(plan: Plan, row: Row, axis: Axis, numeric: bool) -> float:
    """Where a row is drawn: at its SI number, or at the index of its name."""
    return row.places[axis.name] if numeric else plan.labels(axis).index(plan.label(row, axis))


def _singles(panel: Axes, rows: Sequence[Row], axis: Axis, measure: str, factor: float, numeric: bool) -> None:
    """Cases outside of the grid, as stars, if they have a number on the axis."""
    for number, row in enumerate(rows):
        value, place = row.measured[measure], row.places[axis.name]
        if numeric and value is not None and isinstance(place, (int, float)):
            grey = str(0.15 + 0.5 * number / max(len(rows), 1))
            panel.plot([place], [value / factor], "*", color=grey, markersize=8, label=row.case.name)


def _x_axis(panel: Axes, plan: Plan, axis: Axis, numeric: bool, done: Sequence[Row]) -> None:
    name = plan.names[axis.name]
    if not numeric:
        labels = plan.labels(axis)
        panel.set_xticks(range(len(labels)), labels, rotation=30, ha="right")
        panel.set_xlabel(name)
        return
    values = [row.places[axis.name] for row in done if isinstance(row.places[axis.name], (int, float))]
    factor, unit = handy(values, unit_of(axis.name))
    if min(values) > 0.0 and max(values) / min(values) >= WIDE:
        panel.set_xscale("log")
        place_ticks(panel, values)
        # Between the decades there would be powers of ten in SI units, and over each other.
        panel.xaxis.set_minor_formatter("")
    panel.xaxis.set_major_formatter(lambda value, position: f"{value / factor:g}")
    panel.set_xlabel(f"{name} ({unit})" if unit else name)
