"""Pictures of a results folder: force and contact curves, maps, energy audit. Reads files only, no MPI."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.results import Results, load
from pgfmd.results.curve import Loop, Measures, column, measure

from .drawing import (
    GREY,
    RED,
    TURQUOISE,
    drawing,
    elsewhere,
    energy_unit,
    new_figure,
    seen,
    signed,
    target_folder,
    write_picture,
)
from .maps import contact_figure, stress_figure
from .sites import site_figure


def plot_results(
    directory: str | Path,
    out: str | Path | None = None,
    greys: int = 4,
    contact_gap: float | None = None,
    near_gap: float | None = None,
) -> list[Path]:
    """Make every picture that the folder has data for; returns the PNG files written, in it or in the folder `out`.

    `force-displacement.png` always; `contact-maps.png`, `stress-maps.png` with snapshots; `energy.png` with an audit;
    `sites.png` where summits, saddles or valleys have met the elastomer.

    Args:
        greys: of the maps of contact: 4 (overlap, contact, near, open), or the paper's 3 (contact, near, open).
        contact_gap, near_gap: gaps [m] below which these maps show contact, and near; None for those of the run.

    Raises:
        ResultError: if it is not a results folder, its table is still empty, or a picture can't be written.
    """
    with load(directory) as results, drawing():
        if not len(results.curve):
            raise ResultError(f"{results.directory}: nothing to plot yet, curve.csv has no rows")
        folder = target_folder(results.directory, out)
        figures = {"force-displacement.png": force_figure}
        if results.labels:
            contact = partial(contact_figure, greys=greys, contact_gap=contact_gap, near_gap=near_gap)
            figures |= {"contact-maps.png": contact, "stress-maps.png": stress_figure}
        if results.energy is not None and len(results.energy):
            figures["energy.png"] = energy_figure
        if results.sites is not None and len(results.sites):
            figures["sites.png"] = site_figure
        return [
            write_picture(draw(results), folder / name, elsewhere(folder / name, results.directory))
            for name, draw in figures.items()
        ]


def force_figure(results: Results) -> Any:
    """Force [mN] and, below, contact area [mm^2] against indentation [um]; approach dashed, retraction in colour.

    Of a run that counted overlap alone, that area instead, by its name.
    """
    loop = Loop.of(results)
    indentation, force = 1e6 * loop.indentation, 1e3 * loop.force
    kind, area = next(iter(loop.areas.items()))
    figure = new_figure(5.2, 5.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1.2))
    styles: dict[str, dict[str, Any]] = {
        "approach": {"color": GREY, "linestyle": (0, (4, 2))}, "retraction": {"color": TURQUOISE},
    }  # fmt: skip
    for name, rows in loop.branches.items():
        if rows.stop - rows.start > 1:
            upper.plot(*seen(indentation[rows], force[rows]), label=name, **styles[name])
            lower.plot(*seen(indentation[rows], 1e6 * area[rows]), **styles[name])
    upper.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    for text, marker, x, y in _marks(loop, measure(loop)):
        upper.plot(1e6 * x, 1e3 * y, marker, color=RED, markersize=5, linestyle="none", label=text)
    upper.legend(loc="best")
    upper.set_ylabel("force (mN)")
    upper.margins(y=0.08)
    lower.set(xlabel="indentation (µm)", ylabel=f"{kind} (mm²)")
    lower.set_ylim(bottom=0)
    figure.align_ylabels()
    return figure


def _marks(loop: Loop, found: Measures) -> Iterator[tuple[str, str, float, float]]:
    """Text, marker, indentation [m] and force [N] of what is marked on the curve: the numbers of `run.json`, where
    there is one (results/curve.py)."""
    if found.preload is not None and found.preload > 0.0:
        yield f"preload  {signed(1e3 * found.preload)} mN", "^", loop.indentation[loop.preload_row], found.preload
    markers = {"pull-off": "v", "snap-in": "o"}
    for name, dip in found.landmarks.items():
        spread = f" ± {1e3 * dip.uncertainty:.2g}" if dip.uncertainty else ""
        place = -dip.displacement - loop.offset
        yield f"{name}  {signed(-1e3 * dip.tension)}{spread} mN", markers[name], place, -dip.tension


def energy_figure(results: Results) -> Any:
    """The audit's terms against time, and what is left unexplained below."""
    energy = results.energy
    time = column(energy, "time [s]")
    styles: dict[str, dict[str, Any]] = {
        "work": {"color": "black", "linewidth": 1.8},
        "elastic": {"color": TURQUOISE},
        "adhesive": {"color": "#d18f00"},
        "viscous": {"color": RED},
        "released": {"color": "#6a4c93", "linestyle": (0, (4, 2))},
    }
    terms = {name: column(energy, f"{name} [J]") for name in styles}
    residual = column(energy, "residual [J]")
    figure = new_figure(5.2, 4.6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    factor, unit = energy_unit(max(np.nanmax(np.abs(values)) for values in terms.values()))
    for name, values in terms.items():
        upper.plot(*seen(time, values / factor), label="work of the punch" if name == "work" else name, **styles[name])
    upper.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    upper.set_ylabel(f"energy ({unit})")
    upper.legend(loc="best")
    factor, unit = energy_unit(np.nanmax(np.abs(residual)))
    lower.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    lower.plot(*seen(time, residual / factor), color="0.35", linewidth=1.0)
    lower.set(xlabel="time (s)", ylabel=f"residual ({unit})")
    figure.align_ylabels()
    return figure
