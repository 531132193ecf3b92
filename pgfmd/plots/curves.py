"""Curves of runs: force and contact against indentation, both against time, any column against any other, energies.

Several runs share a picture, each with its own colour and line style. Reads files only, no MPI.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import ResultError
from pgfmd.results.caption import about
from pgfmd.results.curve import Array, Loop, Measures, branches, column, measure
from pgfmd.results.reading import Results, Run, opened
from pgfmd.units import handy

from .drawing import (
    DASHES,
    GREY,
    LINES,
    OCHRE,
    PALETTE,
    RED,
    TURQUOISE,
    VIOLET,
    energy_unit,
    footer,
    literal,
    new_figure,
    picture,
    room,
    seen,
    signed,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ZOOM_BELOW = 0.1
"""A tension below this fraction of the largest force gets a separate panel."""
USUAL = {"m": (1e-6, "µm"), "N": (1e-3, "mN"), "m^2": (1e-6, "mm²")}
"""Default units of pictures, unless their numbers would be very small or large."""


@dataclass(frozen=True)
class Quantity:
    """A quantity of a curve: label of the axis, SI unit, and its rows in a run."""

    name: str
    unit: str
    rows: Callable[[Results, Loop], Array]


def _of_loop(name: str, unit: str, attribute: str) -> Quantity:
    return Quantity(name, unit, lambda results, loop: getattr(loop, attribute))


def _of_energy(name: str) -> Quantity:
    def rows(results: Results, loop: Loop) -> Array:
        if results.energy is None or len(results.energy) != len(loop.force):
            raise ResultError(
                f"{results.directory}: no {name} for every row of its curve; output.energy writes the audit"
            )
        return column(results.energy, f"{name} [J]")

    return Quantity("work of the punch" if name == "work" else f"{name} energy", "J", rows)


def _area(kind: str) -> Quantity:
    def rows(results: Results, loop: Loop) -> Array:
        if kind not in loop.areas:
            raise ResultError(
                f"{results.directory}: a run of version 0.1, which knows no {kind} area; draw its overlap"
            )
        return loop.areas[kind]

    return Quantity(f"{kind} area", "m^2", rows)


QUANTITIES: dict[str, Quantity] = {
    "time": _of_loop("time", "s", "time"),
    "displacement": _of_loop("displacement", "m", "displacement"),
    "indentation": _of_loop("indentation", "m", "indentation"),
    "force": _of_loop("force", "N", "force"),
    "u_inf": _of_loop("u_inf", "m", "u_inf"),
    "step": Quantity("length of the step", "s", lambda results, loop: column(results.curve, "step [s]")),
    **{kind: _area(kind) for kind in ("contact", "overlap", "near")},
    **{name: _of_energy(name) for name in ("work", "elastic", "adhesive", "viscous", "released", "residual")},
}
"""Columns of a run by their names for `pgfmd plot --x` and `--y`."""


def axis_unit(values: Sequence[Array], unit: str) -> tuple[float, str]:
    """Factor and name of the unit of an axis: the default one, unless numbers would be very small or large in it."""
    largest = max((float(np.nanmax(np.abs(each), initial=0.0)) for each in values), default=0.0)
    if unit in USUAL:
        factor, name = USUAL[unit]
        if largest == 0.0 or 0.02 <= largest / factor < 2e4:
            return factor, name
    return handy([largest], unit)


def labelled(name: str, unit: str) -> str:
    """The label of an axis."""
    return f"{name} ({unit})" if unit else name


def names_of(runs: Sequence[Results]) -> list[str]:
    """Names of runs in a legend: their folders, with parent folders if names are equal."""
    names = [run.directory.name for run in runs]
    if len(set(names)) < len(names):
        names = [f"{run.directory.parent.name}/{run.directory.name}" for run in runs]
    for number, name in enumerate(names):
        if name in names[:number]:
            names[number] = f"{name} ({number + 1})"
    return names


def at_foot(figure: Figure, runs: Sequence[Results]) -> None:
    """Writes the line at the foot of a figure: the run, or the number of runs."""
    text = about(runs[0])
    footer(figure, text if len(runs) == 1 else f"{len(runs)} runs; the first: {text}")


@contextmanager
def opened_together(runs: Sequence[Run]) -> Iterator[tuple[list[Results], list[Loop]]]:
    """The results and loops of runs, which stay open while they are drawn. ResultError if one can't be read, or is
    empty."""
    if not runs:
        raise TypeError("expected at least one run: its results, or its folder")
    with ExitStack() as stack:
        results = [stack.enter_context(opened(run)) for run in runs]
        yield results, [Loop.of(found) for found in results]


@picture
def plot_force(*runs: Run) -> Figure:
    """Force and, below, contact area against indentation; approach dashed, retraction solid.

    If the tension is below a tenth of the largest force, a third panel shows forces around zero. For a single run,
    preload, pull-off and snap-in are marked. For a run that counted only overlap, the overlap area is shown, and named
    so.

    runs: results, or folders. Raises ResultError if one can't be read, or has no rows yet.
    """
    with opened_together(runs) as (results, loops):
        lowest, highest = min(loop.force.min() for loop in loops), max(loop.force.max() for loop in loops)
        figure, upper, lower, close = _panels(0.0 < -lowest < ZOOM_BELOW * highest)
        across = axis_unit([loop.indentation for loop in loops], "m")
        along = axis_unit([loop.force for loop in loops], "N")
        areas = [next(iter(loop.areas.values())) for loop in loops]
        area_axis = axis_unit(areas, "m^2")
        shown = [(upper, along, [loop.force for loop in loops]), (lower, area_axis, areas)]
        if close is not None:
            shown.append((close, along, [loop.force for loop in loops]))
        for axis, unit, values in shown:
            for number, (loop, rows, name) in enumerate(zip(loops, values, names_of(results), strict=True)):
                draw_branches(axis, loop, loop.indentation / across[0], rows / unit[0], number, len(loops), name)
        for axis in [upper] if close is None else [upper, close]:
            axis.axhline(0, color="0.8", linewidth=0.8, zorder=0)
            axis.set_ylabel(labelled("force", along[1]))
        if len(loops) == 1:
            for text, marker, x, y in _marks(loops[0], measure(loops[0]), along):
                place: dict[str, Any] = {"color": RED, "markersize": 5, "linestyle": "none", "label": text}
                upper.plot(x / across[0], y / along[0], marker, **place)
                if close is not None:
                    close.plot(x / across[0], y / along[0], marker, **place)
        else:
            _thin_is_approach(upper)
        upper.margins(y=0.08)
        if close is not None:
            zoom_on_tension(close, loops, across[0], along[0], float(-lowest))
            close.set_xlabel(labelled("indentation", across[1]))
        kinds = " or ".join(dict.fromkeys(next(iter(loop.areas)) for loop in loops))
        lower.set(xlabel=labelled("indentation", across[1]), ylabel=labelled(kinds, area_axis[1]))
        lower.set_ylim(bottom=0)
        upper.legend(loc="best")
        figure.align_ylabels([upper, lower])
        at_foot(figure, results)
    return figure


def _panels(zoomed: bool) -> tuple[Figure, Axes, Axes, Axes | None]:
    """A figure, and its axes: forces, areas below, and forces around zero to the right, or below on a narrow page."""
    if not zoomed:
        figure = new_figure(5.2, 5.2)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1.2))
        return figure, upper, lower, None
    if room(2.6, 2) == 2:
        figure = new_figure(8.6, 5.2)
        grid = figure.add_gridspec(2, 2, height_ratios=(3, 1.2), width_ratios=(1.35, 1))
        places = grid[0, 0], grid[1, 0], grid[:, 1]
    else:
        figure = new_figure(5.2, 8.0)
        grid = figure.add_gridspec(3, 1, height_ratios=(3, 1.2, 2.2))
        places = grid[0], grid[1], grid[2]
    upper = figure.add_subplot(places[0])
    lower = figure.add_subplot(places[1], sharex=upper)
    upper.tick_params(labelbottom=False)
    return figure, upper, lower, figure.add_subplot(places[2])


def draw_branches(axis: Axes, loop: Loop, x: Array, y: Array, number: int, of: int, name: str) -> None:
    """Draws the approach, dashed and grey, or thin if there are several runs, and the retraction."""
    colour, line = PALETTE[number % len(PALETTE)], LINES[number % len(LINES)]
    alone: dict[str, dict[str, Any]] = {
        "approach": {"color": GREY, "linestyle": DASHES, "label": "approach"},
        "retraction": {"color": TURQUOISE, "label": "retraction"},
    }
    several: dict[str, dict[str, Any]] = {
        "approach": {"color": colour, "linestyle": line, "linewidth": 0.6},
        "retraction": {"color": colour, "linestyle": line, "label": literal(name)},
    }
    labelled_already: set[str] = set()
    for branch, rows in _strokes(loop):
        style = dict((alone if of == 1 else several)[branch])
        if branch in labelled_already:
            style.pop("label", None)
        if len(rows) > 1:
            axis.plot(*seen(x[rows], y[rows]), **style)
            labelled_already.add(branch)


def _strokes(loop: Loop) -> Iterator[tuple[str, NDArray[np.intp]]]:
    """Approach and retraction of each cycle, with their rows; both have the turning row, and an approach the last row of the
    cycle before."""
    cycle = np.ones(len(loop.force)) if loop.cycle is None else loop.cycle
    for number in np.unique(cycle):
        rows = np.flatnonzero(cycle == number)
        for branch, part in branches(loop.displacement[rows], loop.phase[rows]).items():
            before = rows[:1] - 1 if branch == "approach" and rows[0] > 0 else rows[:0]
            yield branch, np.concatenate((before, rows[part]))


def _thin_is_approach(axis: Axes) -> None:
    """Adds a legend entry for the approach."""
    axis.plot([], [], color="0.3", linewidth=0.6, label="approach")


def _marks(loop: Loop, found: Measures, unit: tuple[float, str]) -> Iterator[tuple[str, str, float, float]]:
    """Text, marker, indentation [m] and force [N] of the marks on the curve: the numbers of `run.json`, if it exists
    (results/curve.py)."""
    factor, name = unit
    if found.preload is not None and found.preload > 0.0:
        yield (
            f"preload  {signed(found.preload / factor)} {name}",
            "^",
            loop.indentation[loop.preload_row],
            found.preload,
        )
    markers = {"pull-off": "v", "snap-in": "o"}
    for mark, dip in found.landmarks.items():
        spread = f" ± {dip.uncertainty / factor:.2g}" if dip.uncertainty else ""
        place = -dip.displacement - loop.offset
        yield f"{mark}  {signed(-dip.tension / factor)}{spread} {name}", markers[mark], place, -dip.tension


def zoom_on_tension(axis: Axes, loops: Sequence[Loop], across: float, along: float, tension: float) -> None:
    """Limits the axes to forces from the largest tension to twice as much compression, and their indentations."""
    most = 2.0 * tension
    places = np.concatenate([loop.indentation[loop.force <= most] for loop in loops]) / across
    margin = 0.04 * float(np.ptp(places))
    axis.set(xlim=(places.min() - margin, places.max() + margin), ylim=(-1.2 * tension / along, most / along))
    axis.set_title("tension")


@picture
def plot_time(*runs: Run) -> Figure:
    """Force and indentation against time. Ticks at the bottom of the forces mark jumps of the surface.

    runs: results, or folders. Raises ResultError if one can't be read, or has no rows yet.
    """
    with opened_together(runs) as (results, loops):
        figure = new_figure(5.2, 4.6)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.6, 1))
        when = handy([float(loop.time[-1]) for loop in loops], "s")
        along, across = (axis_unit([getattr(loop, name) for loop in loops], unit)
                         for name, unit in (("force", "N"), ("indentation", "m")))  # fmt: skip
        for number, (loop, name) in enumerate(zip(loops, names_of(results), strict=True)):
            look = {"color": PALETTE[number % len(PALETTE)], "linestyle": LINES[number % len(LINES)]}
            time = loop.time / when[0]
            upper.plot(*seen(time, loop.force / along[0]), label=literal(name), **look)
            lower.plot(*seen(time, loop.indentation / across[0]), **look)
            if loop.jump.any():
                at = {"transform": upper.get_xaxis_transform(), "color": look["color"], "markersize": 7}
                jumps = time[loop.jump]
                upper.plot(
                    jumps, np.full(jumps.size, 0.02 + 0.03 * number), "|", label="jumps" if not number else None, **at
                )
        for axis in (upper, lower):
            axis.axhline(0, color="0.8", linewidth=0.8, zorder=0)
        upper.set_ylabel(labelled("force", along[1]))
        lower.set(xlabel=labelled("time", when[1]), ylabel=labelled("indentation", across[1]))
        if len(loops) > 1 or loops[0].jump.any():
            upper.legend(loc="best")
        figure.align_ylabels()
        at_foot(figure, results)
    return figure


@picture
def plot_curve(*runs: Run, x: str = "indentation", y: str = "force", log: str = "") -> Figure:
    """One column of runs against another.

    Args:
        runs: results, or folders.
        x, y: of QUANTITIES, such as "time", "force", "contact", "viscous".
        log: axes with a logarithmic scale: "x", "y" or "xy". Numbers up to zero are then not drawn.

    Raises:
        ResultError: if a run can't be read, has no such column, or nothing above zero for a logarithmic axis.
        ValueError: for another name.
    """
    for name in (x, y):
        if name not in QUANTITIES:
            raise ValueError(f"{name!r}: expected one of {', '.join(QUANTITIES)}")
    with opened_together(runs) as (results, loops):
        pairs = [[QUANTITIES[name].rows(*run) for name in (x, y)] for run in zip(results, loops, strict=True)]
        units = [axis_unit([pair[k] for pair in pairs], QUANTITIES[name].unit) for k, name in enumerate((x, y))]
        figure = new_figure(5.2, 4.0)
        axis = figure.subplots()
        for number, (loop, pair, name) in enumerate(zip(loops, pairs, names_of(results), strict=True)):
            across, along = (rows / factor for rows, (factor, _) in zip(pair, units, strict=True))
            for letter, rows, called in (("x", across, x), ("y", along, y)):
                if letter in log and not (rows > 0.0).any():
                    raise ResultError(
                        f"{loop.name}: its {called} is nowhere above zero, as a logarithmic axis needs it"
                    )
            draw_branches(axis, loop, across, along, number, len(loops), name)
        for letter, name, (_, unit) in zip("xy", (x, y), units, strict=True):
            axis.set(**{f"{letter}label": labelled(QUANTITIES[name].name, unit)})
            if letter in log:
                axis.set(**{f"{letter}scale": "log"})
        if len(loops) > 1:
            _thin_is_approach(axis)
        axis.legend(loc="best")
        at_foot(figure, results)
    return figure


@picture
def plot_energy(run: Run) -> Figure:
    """The terms of the energy audit against time, and the residual below.

    run: results, or their folder. Raises ResultError if it can't be read, or has no audit.
    """
    with opened(run) as results:
        energy = results.energy
        if energy is None or not len(energy):
            raise ResultError(f"{results.directory}: has no energies; output.energy writes the audit")
        factor, when = handy([float(column(energy, "time [s]")[-1])], "s")
        time = column(energy, "time [s]") / factor
        looks: dict[str, dict[str, Any]] = {
            "work": {"color": "black", "linewidth": 1.8},
            "elastic": {"color": TURQUOISE},
            "adhesive": {"color": OCHRE, "linestyle": LINES[4]},
            "viscous": {"color": RED, "linestyle": LINES[3]},
            "released": {"color": VIOLET, "linestyle": LINES[1]},
        }
        terms = {name: column(energy, f"{name} [J]") for name in looks}
        residual = column(energy, "residual [J]")
        figure = new_figure(5.2, 4.6)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        factor, unit = energy_unit(max(np.nanmax(np.abs(values)) for values in terms.values()))
        for name, values in terms.items():
            label = "work of the punch" if name == "work" else name
            upper.plot(*seen(time, values / factor), label=label, **looks[name])
        upper.axhline(0, color="0.8", linewidth=0.8, zorder=0)
        upper.set_ylabel(labelled("energy", unit))
        upper.legend(loc="best")
        factor, unit = energy_unit(np.nanmax(np.abs(residual)))
        lower.axhline(0, color="0.8", linewidth=0.8, zorder=0)
        lower.plot(*seen(time, residual / factor), color="0.35", linewidth=1.0)
        lower.set(xlabel=labelled("time", when), ylabel=labelled("residual", unit))
        figure.align_ylabels()
        at_foot(figure, [results])
    return figure
