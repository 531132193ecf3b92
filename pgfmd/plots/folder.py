"""Pictures of a results folder: force and contact curves, maps, energy audit. Reads files only, no MPI."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.results import Results, load

from .drawing import drawing, elsewhere, target_folder, write_picture
from .maps import contact_figure, new_figure, signed, stress_figure
from .patches import site_figure
from .thinning import seen

TURQUOISE, RED, GREY = "#00798c", "#b3352b", "#8a8a8a"


def plot_results(directory: str | Path, out: str | Path | None = None) -> list[Path]:
    """Make every picture that the folder has data for; returns the PNG files written, in it or in the folder `out`.

    `force-displacement.png` always; `contact-maps.png`, `stress-maps.png` with snapshots; `energy.png` with an audit;
    `sites.png` where summits, saddles or valleys have met the elastomer.

    Raises:
        ResultError: if it is not a results folder, its table is still empty, or a picture can't be written.
    """
    with load(directory) as results, drawing():
        if not len(results.curve):
            raise ResultError(f"{results.directory}: nothing to plot yet, curve.csv has no rows")
        folder = target_folder(results.directory, out)
        figures = {"force-displacement.png": force_figure}
        if results.labels:
            figures |= {"contact-maps.png": contact_figure, "stress-maps.png": stress_figure}
        if results.energy is not None and len(results.energy):
            figures["energy.png"] = energy_figure
        if results.sites is not None and len(results.sites):
            figures["sites.png"] = site_figure
        return [
            write_picture(draw(results), folder / name, elsewhere(folder / name, results.directory))
            for name, draw in figures.items()
        ]


def column(table: Any, name: str) -> np.ndarray:
    """A column of a table as a plain array, whether or not pandas made it."""
    return np.asarray(table[name])


def branches(phase: np.ndarray) -> dict[str, slice]:
    """Rows of the way in and of the way out; both hold the point where one becomes the other."""
    out = np.flatnonzero(phase == "retract")
    first = max(int(out[0]) - 1, 0) if out.size else len(phase)
    return {"approach": slice(0, first + 1), "retraction": slice(first, len(phase))}


def landmarks(force: np.ndarray, phase: np.ndarray) -> dict[str, int]:
    """Rows of preload, pull-off and snap-in, each only if the run has it.

    Preload is the largest force. Pull-off is the lowest force of the retraction, snap-in the lowest one of the approach
    before the preload, each if it is tensile by more than 0.1 % of the largest force.
    """
    size = float(np.nanmax(np.abs(force)))
    found = {}
    if np.nanmax(force) > 0:
        found["preload"] = int(np.nanargmax(force))
    for name, rows in zip(("snap-in", "pull-off"), branches(phase).values()):
        # Before the preload only: a long dwell may end in tension too, which is no snap.
        stop = found.get("preload", len(force)) + 1 if name == "snap-in" else rows.stop
        part = force[rows.start : min(rows.stop, stop)]
        if part.size > 1 and np.nanmin(part) < -1e-3 * size:
            found[name] = rows.start + int(np.nanargmin(part))
    return found


def force_figure(results: Results) -> Any:
    """Force [mN] and, below, contact area [mm^2] against indentation [um]; approach dashed, retraction in colour."""
    curve = results.curve
    indentation, force = 1e6 * column(curve, "indentation [m]"), 1e3 * column(curve, "force [N]")
    area, phase = 1e6 * column(curve, "contact_area [m^2]"), column(curve, "phase")
    figure = new_figure(5.2, 5.2)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1.2))
    styles = {"approach": {"color": GREY, "linestyle": (0, (4, 2))}, "retraction": {"color": TURQUOISE}}
    for name, rows in branches(phase).items():
        if rows.stop - rows.start > 1:
            upper.plot(*seen(indentation[rows], force[rows]), label=name, **styles[name])
            lower.plot(*seen(indentation[rows], area[rows]), **styles[name])
    upper.axhline(0, color="0.8", linewidth=0.8, zorder=0)
    markers = {"preload": "^", "pull-off": "v", "snap-in": "o"}
    for name, row in sorted(landmarks(force, phase).items(), key=lambda item: list(markers).index(item[0])):
        text = f"{name}  {signed(force[row])} mN"
        upper.plot(indentation[row], force[row], markers[name], color=RED, markersize=5, linestyle="none", label=text)
    upper.legend(loc="best")
    upper.set_ylabel("force (mN)")
    upper.margins(y=0.08)
    lower.set(xlabel="indentation (µm)", ylabel="contact (mm²)")
    lower.set_ylim(bottom=0)
    figure.align_ylabels()
    return figure


def energy_figure(results: Results) -> Any:
    """The audit's terms against time, and what is left unexplained below."""
    energy = results.energy
    time = column(energy, "time [s]")
    styles = {
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


def energy_unit(size: float) -> tuple[float, str]:
    """Factor [J] and name of the unit that brings `size` [J] to between 1 and 1000."""
    for factor, unit in ((1.0, "J"), (1e-3, "mJ"), (1e-6, "µJ"), (1e-9, "nJ"), (1e-12, "pJ"), (1e-15, "fJ")):
        if size >= factor:
            return factor, unit
    return 1e-15, "fJ"
