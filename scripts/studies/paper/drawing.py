"""What the figures share: claims of the paper beside our numbers, curves, captions, and reading of contact sites."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from matplotlib.colors import BoundaryNorm, ListedColormap

from pgfmd.parts import topography_of
from pgfmd.physics.contact_sites import KINDS, contact_sites
from pgfmd.plots.drawing import GREY, RED, TURQUOISE, new_figure
from pgfmd.plots.maps import MOST_PIXELS, NEAR_LEVEL, class_numbers, gap_classes
from pgfmd.results import Results
from pgfmd.results.curve import areas_of

from .pool import Run

OCHRE, VIOLET, GREEN = "#d18f00", "#6a4c93", "#4c9f38"
COLOURS = (TURQUOISE, RED, OCHRE, VIOLET, GREEN, "#303030")
NAN = math.nan
CONTACT, OVERLAP = "contact", "overlap"
"""What counts as contact: a gap below that of the largest traction, and in results of version 0.1 a negative one."""


@dataclass(frozen=True)
class Claim:
    """A number of the paper beside ours, both in `unit`. low, high: what the paper's words admit, NaN where it says
    nothing; told: its words. settings must be the same for all sizes.

    count: what counts as contact where ours depends on it, CONTACT or OVERLAP, by `count_of`; empty where it does not.
    before: the same of the same run with OVERLAP counted, None where the run does not tell. A number with a count must
    be of one run alone: it is replaced when the other runs of its figure are not there.
    """

    what: str
    settings: str
    ours: float
    unit: str = ""
    told: str = ""
    low: float = NAN
    high: float = NAN
    count: str = ""
    before: float | None = None


@dataclass(frozen=True)
class Drawing:
    """A figure with its caption and its rows of the table."""

    figure: Any
    caption: str
    claims: list[Claim] = field(default_factory=list)


def panels(
    columns: int, rows: int = 1, width: float = 7.4, height: float = 2.9, **options: Any
) -> tuple[Any, np.ndarray]:
    """A figure and its axes, of shape (rows, columns)."""
    figure = new_figure(width, height)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def time_text(seconds: float) -> str:
    """A time with a handy unit."""
    scales = ((1.0, "s"), (1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns"))
    factor, unit = next((scale for scale in scales if seconds >= scale[0]), scales[-1])
    return f"{seconds / factor:.4g} {unit}"


def settings_of(run: Run) -> str:
    """Grid, range and rheology of a run, for a caption."""
    scene = run.scene
    text = f"n = {scene.grid.n}, ρ = {scene.adhesion.range * 1e6:.3g} µm"
    if run.quasistatic:
        return f"{text}, quasi-static"
    name = "τ" if scene.rheology.model == "single" else "τ_min"
    return f"{text}, {name} = {time_text(scene.rheology.relaxation_time)}"


def draw_loop(axis: Any, run: Run, colour: Any, label: str | None = None, approach: bool = True, **style: Any) -> None:
    """Force [mN] against indentation [um]: the way in dashed grey, the way out in colour."""
    loop, rows = run.loop, run.loop.branches
    x, y = 1e6 * loop.indentation, 1e3 * loop.force
    if approach:
        axis.plot(x[rows["approach"]], y[rows["approach"]], color=GREY, ls=(0, (4, 2)), lw=0.9)
    axis.plot(x[rows["retraction"]], y[rows["retraction"]], **({"color": colour, "label": label, "lw": 1.1} | style))


def zero_line(axis: Any) -> None:
    """A thin line at force zero."""
    axis.axhline(0.0, color="0.8", lw=0.8, zorder=0)


def force_axes(axis: Any, title: str = "") -> None:
    """Labels of a force-displacement panel."""
    zero_line(axis)
    axis.set(xlabel="indentation −d (µm)", ylabel="force (mN)")
    axis.set_title(title, loc="left")


def zoom(axis: Any, runs: Iterable[Run], least: float = 15.0) -> None:
    """Shows the pull-off of these runs and the way back below `least` [mN], or four times their largest tension."""
    loops = [run.loop for run in runs]
    if not loops:
        return
    low = 1e3 * min(float(loop.force.min()) for loop in loops)
    most = 1e3 * max(float(loop.force.max()) for loop in loops)
    top = min(1.05 * most, max(least, -4.0 * low))
    seen = np.concatenate([1e6 * loop.indentation[1e3 * loop.force <= top] for loop in loops])
    margin = 0.05 * float(np.ptp(seen))
    axis.set(ylim=(1.25 * low, top), xlim=(seen.min() - margin, seen.max() + margin))


def pull_off(run: Run) -> float:
    """Pull-off force [mN]."""
    return 1e3 * (run.results.run.get("pull_off_force_N") or 0.0)


def in_contact(results: Results, time: float) -> dict[str, tuple[int, int]]:
    """Of each kind of site, how many are in contact at a time [s], and of how many; 0 where none ever touches."""
    sites = results.sites
    found = {}
    for kind in ("summit", "saddle", "valley"):
        rows = np.flatnonzero(np.asarray(sites["kind"]) == kind)
        before = rows[np.asarray(sites["time [s]"])[rows] <= time]
        total = int(np.asarray(sites["of"])[rows[0]]) if rows.size else 0
        found[kind] = (int(np.asarray(sites["in_contact"])[before[-1]]) if before.size else 0, total)
    return found


def percent(counts: tuple[int, int]) -> float:
    """A number out of a total [%]; 0 of nothing."""
    return 100.0 * counts[0] / max(counts[1], 1)


def joins(results: Results, kind: str) -> dict[str, np.ndarray]:
    """First joins of the sites of a kind on the way in: site, x, y, displacement [m] and force [N] of each."""
    sites = {name: np.asarray(results.sites[name]) for name in ("kind", "event", "phase", "site", "x [m]", "y [m]",
                                                                "displacement [m]", "force [N]", "of")}  # fmt: skip
    rows = np.flatnonzero((sites["kind"] == kind) & (sites["event"] == "joins") & (sites["phase"] == "approach"))
    _, first = np.unique(sites["site"][rows], return_index=True)
    rows = rows[first]
    return {name: sites[name][rows] for name in sites}


def closed_at(results: Results, kind: str) -> float:
    """Force [mN] at which all sites of a kind have come into contact on the way in, NaN if they never have."""
    found = joins(results, kind)
    if not found["of"].size or len(found["of"]) < found["of"][0]:
        return NAN
    return 1e3 * float(found["force [N]"].max())


def count_of(run: Run) -> str:
    """What counts as contact in the tables of a run."""
    return OVERLAP if run.results.counts_overlap else CONTACT


def share_below(run: Run, snapshot: int, kind: str, limit: float) -> float:
    """Share [%] of the sites of a kind whose gap is below a limit [m] in a snapshot."""
    sites = contact_sites(topography_of(run.scene.punch), run.scene.grid.length)
    chosen = np.flatnonzero(sites.kind == KINDS.index(kind))
    fields, gap = run.results.fields, run.results.frame("gap", snapshot)
    x, y = np.asarray(fields["x"][:]), np.asarray(fields["y"][:])
    columns, rows = (np.abs(line[:, None] - at[chosen]).argmin(axis=0) for line, at in ((x, sites.x), (y, sites.y)))
    return 100.0 * float(np.mean(gap[rows, columns] < limit)) if chosen.size else 0.0


def near(run: Run, snapshot: int, kind: str) -> float:
    """Share [%] of the sites of a kind whose gap is below 500 nm in a snapshot: what a camera takes for contact."""
    return share_below(run, snapshot, kind, NEAR_LEVEL)


def area_below(run: Run, snapshot: int, limit: float) -> float:
    """Area [m^2] in which the gap is below a limit [m] in a snapshot."""
    return float(np.sum(run.results.frame("gap", snapshot) < limit)) * (run.scene.grid.length / run.scene.grid.n) ** 2


def draw_gaps(axis: Any, run: Run, snapshot: int) -> None:
    """The gaps of a snapshot in greys: overlap, contact, near, open; nothing outside of the punch."""
    gap = thin(run.results.frame("gap", snapshot))
    classes = gap_classes(run.results.contact_gap, NEAR_LEVEL, run.results.counts_overlap)
    numbers = np.ma.masked_invalid(class_numbers(gap, classes))
    greys = ListedColormap([each.grey for each in classes])
    bounds = BoundaryNorm(np.arange(len(classes) + 1) - 0.5, len(classes))
    axis.imshow(numbers, origin="lower", interpolation="nearest", cmap=greys, norm=bounds)


def shades_of(runs: Iterable[Run]) -> str:
    """What the greys of `draw_gaps` mean, for a caption."""
    text = "From dark to light: gap below 0, contact, gap below 500 nm, open."
    if any(count_of(run) == OVERLAP for run in runs):
        text += " Where runs of version 0.1 are drawn, contact is not set off from gaps below 500 nm."
    return text


def thin(values: np.ndarray) -> np.ndarray:
    """A map with not many more points than can be seen."""
    stride = -(-4 * values.shape[0] // MOST_PIXELS)
    return values[::stride, ::stride]


def covered(run: Run, name: str = "contact", row: Any = None) -> Any:
    """Area of the kind "contact", "overlap" or "near" [% of all points of the punch] in rows of the curve, that of the
    preload by default. NaN where the run does not tell."""
    rows = run.loop.preload_row if row is None else row
    area = areas_of(run.results).get(name, np.full(len(run.loop.force), NAN))[rows]
    # Points are counted, not areas: all of them are 100 %, to the last digit.
    cell = (run.scene.grid.length / run.scene.grid.n) ** 2
    return 100 * np.round(area / cell) / np.count_nonzero(~np.isnan(run.results.frame("gap", 0)))


def times_of(results: Results) -> np.ndarray:
    """Times [s] of the snapshots."""
    return np.asarray(results.fields["time"][:]) if results.has_fields else np.empty(0)
