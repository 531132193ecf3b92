"""Curves of a page: the rows that are drawn, in the units of their axes, as data for charts.js."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pgfmd.files.tables import ENERGY
from pgfmd.plots.curves import axis_unit, labelled
from pgfmd.plots.drawing import seen_rows
from pgfmd.results import Results
from pgfmd.results.curve import Loop, Measures, column

Array = NDArray[np.float64]
MOST_POINTS = 12_000
"""Points of a chart: its curves share them."""
FEWEST_PARTS = 40
"""Parts of a curve, of which the lowest and the highest points are drawn, however many curves there are."""
DIGITS = 6
"""Of a point that is drawn."""
DOTS, SOLID, DASHED = "dots", "", "5 3"
ENERGIES = ("work", "elastic", "adhesive", "viscous", "released", "residual")


@dataclass
class Chart:
    """A chart: key in the page, title, labels of the axes, curves and marks, each with plain data for charts.js.

    note: what is to be said below it. cursor: whether the maps' slider has its mark on it. units: SI values of the units
    of x and y.
    """

    key: str
    title: str
    x: str
    y: str
    series: list[dict[str, Any]] = field(default_factory=list)
    marks: list[dict[str, Any]] = field(default_factory=list)
    note: str = ""
    cursor: bool = False
    units: tuple[float, float] = (1.0, 1.0)

    def add(self, name: str, x: Array, y: Array, colour: int, line: str = SOLID, parts: int | None = None,
            spread: Array | None = None) -> None:  # fmt: skip
        """A curve, or points with error bars where `spread` is given; x, y, spread: (rows,), in the axes' units."""
        if parts is not None and len(x):
            rows = seen_rows(x, y, parts=parts)
            if len(rows) < len(x):
                self.note = "Of long curves, the lowest and highest points are drawn."
            x, y = x[rows], y[rows]
        found: dict[str, Any] = {"name": name, "x": plain(x), "y": plain(y), "colour": colour, "line": line}
        if spread is not None:
            found["spread"] = plain(spread)
        self.series.append(found)

    def mark(self, text: str, x: float, y: float) -> None:
        """A named point."""
        self.marks.append({"text": text, "x": plain([x])[0], "y": plain([y])[0]})

    def data(self) -> dict[str, Any]:
        """Everything that charts.js needs."""
        return {
            "key": self.key, "x": self.x, "y": self.y, "series": self.series, "marks": self.marks, "cursor": self.cursor,
        }  # fmt: skip


def plain(values: Iterable[float]) -> list[float | None]:
    """Numbers for JSON with the digits that can be seen; None for what is not finite."""
    return [float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values]


def parts_of(curves: int) -> int:
    """Into how many parts each of so many curves of a chart is divided (drawing.seen_rows keeps five points of each)."""
    return max(MOST_POINTS // (5 * max(curves, 1)), FEWEST_PARTS)


def force_chart(loops: Sequence[Loop], found: Measures | None = None, measured: int = 0) -> Chart:
    """Force against indentation; one loop alone has its approach dashed, and its marks where `found` is given.

    measured: how many of the loops, the last ones, are measured; these are drawn as dots.
    """
    across, along = axis_unit([loop.indentation for loop in loops], "m"), axis_unit([loop.force for loop in loops], "N")
    chart = Chart("force", "Force against indentation", labelled("indentation", across[1]), labelled("force", along[1]),
                  cursor=True, units=(across[0], along[0]))  # fmt: skip
    runs = len(loops) - measured
    for number, loop in enumerate(loops):
        colour = number % 6
        for branch, rows in loop.branches.items():
            if rows.stop - rows.start < 2:
                continue
            name = branch if len(loops) == 1 else f"{loop.name}, {branch}"
            line = DOTS if number >= runs else DASHED if branch == "approach" else SOLID
            x, y = loop.indentation[rows] / across[0], loop.force[rows] / along[0]
            chart.add(name, x, y, colour, line, parts_of(2 * len(loops)))
    if found is not None:
        _mark(chart, loops[0], found, across[0], along[0])
    return chart


def _mark(chart: Chart, loop: Loop, found: Measures, across: float, along: float) -> None:
    if found.preload is not None and found.preload > 0.0:
        chart.mark("preload", float(loop.indentation[loop.preload_row]) / across, found.preload / along)
    for name, dip in found.landmarks.items():
        chart.mark(name, (-dip.displacement - loop.offset) / across, -dip.tension / along)


def time_charts(loops: Sequence[Loop]) -> list[Chart]:
    """Force, and indentation, against time."""
    when, charts = axis_unit([loop.time for loop in loops], "s"), []
    for name, unit in (("force", "N"), ("indentation", "m")):
        along = axis_unit([getattr(loop, name) for loop in loops], unit)
        chart = Chart(f"{name}-time", f"{name.capitalize()} against time", labelled("time", when[1]),
                      labelled(name, along[1]))  # fmt: skip
        for number, loop in enumerate(loops):
            x, y = loop.time / when[0], getattr(loop, name) / along[0]
            chart.add(loop.name if len(loops) > 1 else name, x, y, number % 6, SOLID, parts_of(len(loops)))
        charts.append(chart)
    return charts


def area_chart(loop: Loop) -> Chart:
    """The known areas of a run against indentation: the approach dashed."""
    areas = loop.areas
    across, along = axis_unit([loop.indentation], "m"), axis_unit(list(areas.values()), "m^2")
    title = "Areas against indentation" if len(areas) > 1 else f"Area of {next(iter(areas))} against indentation"
    chart = Chart("areas", title, labelled("indentation", across[1]), labelled("area", along[1]))
    for number, (kind, area) in enumerate(areas.items()):
        for branch, rows in loop.branches.items():
            if rows.stop - rows.start > 1:
                x, y = loop.indentation[rows] / across[0], area[rows] / along[0]
                line = DASHED if branch == "approach" else SOLID
                chart.add(f"{kind}, {branch}", x, y, number, line, parts_of(2 * len(areas)))
    return chart


def energy_chart(results: Results) -> Chart | None:
    """The terms of the energy audit against time; None without one."""
    table = results.energy
    if table is None or not len(table):
        return None
    time = column(table, ENERGY.titles[0])
    terms: Mapping[str, Array] = {name: column(table, f"{name} [J]") for name in ENERGIES}
    when, along = axis_unit([time], "s"), axis_unit(list(terms.values()), "J")
    chart = Chart("energy", "Terms of the energy audit", labelled("time", when[1]), labelled("energy", along[1]))
    for number, (name, values) in enumerate(terms.items()):
        line = DASHED if name == "residual" else SOLID
        chart.add(name, time / when[0], values / along[0], number, line, parts_of(len(terms)))
    return chart
