"""Maps of the punch, one for each snapshot: overlap, contact, near and open in greys, with the thresholds of the run,
and the normal traction."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import ResultError
from pgfmd.results import Results
from pgfmd.results.reading import Run, opened
from pgfmd.units import UnitError, handy_quantity, parse_quantity

from .curves import at_foot
from .drawing import literal, new_figure, picture, room, signed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

MOST_PANELS = 12
"""Maps on a page."""
RANGE = "range"
"""Name of a threshold: the range of adhesion of the run, beyond which there is no attraction."""
OPEN = "#c4c9d6"
"""Colour of points without traction in maps of stress: bluish grey, which is not in the scale."""
NO_TRACTION = 1e-6
"""Fraction of the largest traction below which an open gap counts as having none."""
MOST_PIXELS = 1024
ROBUST_PERCENTILE = 99.5
LEGEND_LINE = 0.17
"""Height [inch] of a line of a legend."""
GREYS = ("#2b2b2b", "#9a9a9a", "#e9e9e9")
"""The paper's three: contact, near, open."""
FOUR_GREYS = ("#1c1c1c", "#606060", "#a5a5a5", "#ececec")
"""Overlap, contact, near, open. Their lightness L* rises in steps of 25 to 31 (10, 41, 68, 93), so that they differ in
prints and copies."""
NEAR_LEVEL = 500e-9
"""Gap [m] below which the paper's figures are shaded."""


@dataclass(frozen=True)
class GapClass:
    """Points whose gap is below `below` [m], infinite for the last class, and not in the previous class; and their
    grey."""

    name: str
    below: float
    grey: str

    @property
    def label(self) -> str:
        """The text of a legend."""
        if math.isinf(self.below):
            return self.name
        bound = handy_quantity(self.below, "length").replace("um", "µm") if self.below else "0"
        return f"{self.name} (gap < {bound})"


def gap_classes(contact_gap: float, near_gap: float, counts_overlap: bool = False, greys: int = 4) -> list[GapClass]:
    """The classes of a map, from the smallest gaps to the largest, without classes that are always empty.

    Args:
        contact_gap: [m], below which a point is in contact. At 0 contact and overlap are the same.
        near_gap: [m], below which a point is near. If it is not above `contact_gap`, there is no class near.
        counts_overlap: whether the run counted only overlap (`Results.counts_overlap`). Then there is no class contact,
            unless `contact_gap` is above 0.
        greys: 4; or 3, the paper's, which have no overlap of its own.
    """
    bounds = {"overlap": 0.0, "contact": contact_gap, "near": near_gap, "open": math.inf}
    shades = dict(zip(bounds, FOUR_GREYS, strict=True))
    if contact_gap <= 0.0:
        del bounds["contact" if counts_overlap else "overlap"]
    elif greys == 3:
        del bounds["overlap"]
    if not {"overlap", "contact"} <= bounds.keys():
        shades = dict(zip(bounds, GREYS, strict=True))
    if near_gap <= max(contact_gap, 0.0):
        del bounds["near"]
    return [GapClass(name, below, shades[name]) for name, below in bounds.items()]


def class_numbers(gap: NDArray[np.float64], classes: Sequence[GapClass]) -> NDArray[np.float64]:
    """The number of the class of each point, of gap's shape; NaN outside of the punch."""
    bounds = [each.below for each in classes[:-1]]
    return np.where(np.isnan(gap), np.nan, np.searchsorted(bounds, gap, side="right"))


def pages_of(run: Run) -> list[list[int]]:
    """The snapshots of a run, page by page: the smallest number of pages, filled evenly, in the order of time."""
    with opened(run) as results:
        # The surface of the largest tension is written last.
        order = (
            np.argsort(np.asarray(results.fields["time"]), kind="stable") if len(results.labels) else np.zeros(0, int)
        )
    pages = -(-len(order) // MOST_PANELS)
    return [list(map(int, part)) for part in np.array_split(order, pages)] if len(order) else []


def thinned(results: Results, name: str, snapshot: int) -> NDArray[np.float64]:
    """An array of a snapshot with at most MOST_PIXELS rows and columns, evenly chosen. Drawing every point of a fine
    grid takes minutes and makes no visible difference."""
    values = results.frame(name, snapshot)
    stride = -(-len(values) // MOST_PIXELS)
    return values[::stride, ::stride]


class Maps:
    """A page of square maps of the punch block, one for each snapshot, with label, time, force, and a scale bar.

    page: its number, from 1; right_margin: room [inch] for labels on the right. Raises ResultError if there is no such
    page.
    """

    def __init__(self, results: Results, page: int = 1, right_margin: float = 0.1):
        pages = pages_of(results)
        if not 1 <= page <= len(pages):
            there = f"{len(pages)} pages of maps" if pages else "no snapshots"
            raise ResultError(f"{results.directory}: has {there}, so no page {page}")
        self.results, self.snapshots = results, pages[page - 1]
        self.half = half_side(results)
        rows = -(-len(self.snapshots) // room(1.7, 4))
        self.rows, self.columns = rows, -(-len(self.snapshots) // rows)
        # A single map needs space for its colour bar and legend.
        self.figure = new_figure(max(1.9 * self.columns + 0.9, 4.0), 1.0)
        side = min(2.2, (self.figure.get_figwidth() - right_margin) / self.columns)
        self.figure.set_figheight((side + 0.55) * rows + 0.75)
        axes = self.figure.subplots(rows, self.columns, squeeze=False).ravel()
        for axis in axes[len(self.snapshots) :]:
            axis.remove()
        self.axes = list(axes[: len(self.snapshots)])
        for axis, snapshot in zip(self.axes, self.snapshots, strict=True):
            self._frame(axis, snapshot)
        draw_scale_bar(self.axes[(rows - 1) * self.columns], self.half)
        if len(pages) > 1:
            self.figure.suptitle(f"page {page} of {len(pages)}", fontsize=8.5, color="0.4")

    def values(self, name: str, snapshot: int) -> NDArray[np.float64]:
        """An array of a snapshot, `thinned`."""
        return thinned(self.results, name, snapshot)

    def draw(self, axis: Axes, values: np.ndarray, **options: Any) -> AxesImage:
        """Show an array with y upward, and the outline of the punch where it does not fill the block."""
        draw_outline(axis, values, self.half)
        return draw_image(axis, np.ma.masked_invalid(values), self.half, **options)

    def _frame(self, axis: Axes, snapshot: int) -> None:
        fields, label = self.results.fields, self.results.labels[snapshot]
        label = shortened(label, 30)
        time, force = float(fields["time"][snapshot]), 1e3 * float(fields["force"][snapshot])
        axis.set_title(f"{literal(label)}\n{time:.4g} s,  {signed(force)} mN", linespacing=1.3)
        bare(axis)


def shortened(label: str, most: int) -> str:
    """What is shown of the label of a snapshot beside its time: nothing if that is all it says; at most so many letters."""
    try:
        parse_quantity(label.removeprefix("t = "), "time")
    except UnitError:
        return label if len(label) <= most else label[: most - 1] + "…"
    return ""


def half_side(results: Results) -> float:
    """Half the side [µm] of the square of grid points that holds the punch."""
    x = np.asarray(results.fields["x"])
    return 1e6 * (0.5 * (x[-1] - x[0]) * (1 + 1 / (x.size - 1)) if x.size > 1 else 1e-6)


def bare(axis: Axes) -> None:
    """Leaves out the frame of a map, and its ticks: a bar shows the scale."""
    axis.set_aspect("equal")
    axis.set_xticks([])
    axis.set_yticks([])
    for spine in axis.spines.values():
        spine.set_visible(False)


def draw_image(axis: Axes, image: np.ndarray, half: float, **options: Any) -> AxesImage:
    """Shows values, or colours, of the square of half side `half`, with y upward."""
    options |= {"origin": "lower", "extent": (-half, half, -half, half), "interpolation": "nearest"}
    shown = axis.imshow(image, **options)
    margin = 1.03 * half
    axis.set(xlim=(-margin, margin), ylim=(-margin, margin))
    return shown


def draw_outline(axis: Axes, values: np.ndarray, half: float) -> Any:
    """Draws the outline of the punch, beyond which values are NaN; returns it, or None where it fills the square."""
    outside = np.isnan(values)
    if outside.all() or not outside.any():
        return None
    middle = (np.arange(len(values)) + 0.5) / len(values) * 2 * half - half
    # Padded, so that the outline closes where the punch touches the edge of the block.
    step = middle[1] - middle[0] if len(middle) > 1 else half
    wide = np.concatenate(([middle[0] - step], middle, [middle[-1] + step]))
    return axis.contour(wide, wide, np.pad(outside, 1, constant_values=True), [0.5], colors="0.25", linewidths=0.7)


def draw_scale_bar(axis: Axes, half: float) -> None:
    """Draws a bar of a round length below a map of half side `half` [µm]."""
    length = round_length(0.6 * half)
    start, height = -half, -1.12 * half
    line: dict[str, Any] = {"color": "black", "linewidth": 2, "solid_capstyle": "butt", "clip_on": False}
    axis.plot([start, start + length], [height, height], **line)
    text = f"{length:g} µm" if length < 1000 else f"{length / 1000:g} mm"
    axis.text(start + length / 2, height - 0.06 * half, text, ha="center", va="top", fontsize=8)


def round_length(largest: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `largest`."""
    power = 10.0 ** math.floor(math.log10(largest))
    return max(factor * power for factor in (1, 2, 5) if factor * power <= largest * (1 + 1e-12))


@picture
def plot_contact_maps(
    run: Run,
    greys: int = 4,
    contact_gap: float | None = None,
    near_gap: float | str | None = None,
    page: int = 1,
) -> Figure:
    """The punch's gaps in four greys, overlap, contact, near and open, or in the paper's three (`gap_classes`).

    Args:
        run: results, or their folder.
        greys: 4; or 3, the paper's, which have no overlap of its own.
        contact_gap, near_gap: thresholds [m], None for those of the run. near_gap may be "range", the range of
            adhesion: then all points that are not open are attracted.
        page: of the snapshots, from 1; `pages_of` has their number.

    Raises:
        ResultError: if the run can't be read, or has no snapshots, or no such page.
    """
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    with opened(run) as results:
        contact_gap = results.contact_gap if contact_gap is None else contact_gap
        near = results.near_gap if near_gap is None else range_of(results) if near_gap == RANGE else float(near_gap)
        classes = gap_classes(contact_gap, near, results.counts_overlap, greys)
        shades = [each.grey for each in classes]
        look = {"cmap": ListedColormap(shades), "norm": BoundaryNorm(np.arange(len(shades) + 1) - 0.5, len(shades))}
        maps = Maps(results, page)
        for axis, snapshot in zip(maps.axes, maps.snapshots, strict=True):
            maps.draw(axis, class_numbers(maps.values("gap", snapshot), classes), **look)
        patches = [Patch(facecolor=each.grey, edgecolor="0.25", linewidth=0.5, label=each.label) for each in classes]
        _legend_below(maps, patches)
        at_foot(maps.figure, [results])
    return maps.figure


def range_of(results: Results) -> float:
    """The range of adhesion [m] of a run. ResultError if its scene does not have it."""
    text = results.scene.get("adhesion", {}).get("range")
    if text is None:
        raise ResultError(f"{results.directory}: its scene tells no range of adhesion; give a gap instead")
    return parse_quantity(text, "length")


def _legend_below(maps: Maps, patches: list[Any]) -> None:
    """A legend at the foot of a page, which becomes taller by it."""
    columns = len(patches) if len(maps.axes) > 2 else 2
    columns = min(columns, room(1.2, columns))
    maps.figure.set_figheight(maps.figure.get_figheight() + LEGEND_LINE * -(-len(patches) // columns))
    maps.figure.legend(handles=patches, loc="outside lower center", ncols=columns, handlelength=1.2, columnspacing=1.4)


@picture
def plot_stress_maps(run: Run, page: int = 1, limit: float | None = None) -> Figure:
    """Normal traction under the punch, tension positive, with one symmetric scale for all snapshots of the page. Points
    with an open gap and without attraction are bluish grey, which differs from the colour of zero traction in the
    scale.

    Args:
        run: results, or their folder.
        page: of the snapshots, from 1.
        limit: end of the scale [Pa], such as that of another run; None for `stress_limit` of the page.

    Raises:
        ResultError: if the run can't be read, or has no snapshots, or no such page.
    """
    from cmcrameri import cm
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    with opened(run) as results:
        maps = Maps(results, page, 0.9)
        frames = {snapshot: maps.values("traction", snapshot) for snapshot in maps.snapshots}
        own, _ = robust_limit(frames.values())
        limit = own if limit is None else limit
        clipped = any(np.nanmax(np.abs(each), initial=0.0) > 1.001 * limit for each in frames.values())
        factor, unit = stress_unit(limit)
        image: Any = None
        any_open = False
        for axis, (snapshot, traction) in zip(maps.axes, frames.items(), strict=True):
            image = maps.draw(axis, traction / factor, cmap=cm.vik, vmin=-limit / factor, vmax=limit / factor)
            is_open = nothing_pulls(maps.values("gap", snapshot), traction, limit)
            if is_open.any():
                any_open = True
                extent = {"origin": "lower", "extent": image.get_extent(), "interpolation": "nearest"}
                axis.imshow(
                    np.ma.masked_where(~is_open, np.zeros(is_open.shape)), cmap=ListedColormap([OPEN]), **extent
                )
        extend = "both" if clipped else "neither"
        bar = maps.figure.colorbar(
            image, ax=maps.axes, shrink=0.8, aspect=12.5 * max(2, maps.rows), pad=0.02, extend=extend
        )
        bar.set_label(f"normal traction ({unit}), tension > 0")
        bar.outline.set_linewidth(0.5)
        if any_open:
            _legend_below(maps, [Patch(facecolor=OPEN, edgecolor="0.25", linewidth=0.5, label="open, no traction")])
        at_foot(maps.figure, [results])
    return maps.figure


def stress_unit(limit: float) -> tuple[float, str]:
    """Factor [Pa] and name of the unit of a scale that ends at `limit` [Pa]."""
    return (1e6, "MPa") if limit >= 1e6 else (1e3, "kPa") if limit >= 1e3 else (1.0, "Pa")


def nothing_pulls(gap: NDArray[np.float64], traction: NDArray[np.float64], limit: float) -> NDArray[np.bool_]:
    """Where a gap [m] is open and the traction [Pa] no noticeable part of the scale's end."""
    return (gap > 0.0) & (np.abs(traction) <= NO_TRACTION * limit)


def stress_limit(run: Run) -> float:
    """End [Pa] of a scale for all snapshots of a run: the largest limit of its pages. The run must have snapshots."""
    with opened(run) as results:
        pages = pages_of(results)
        return max(robust_limit(thinned(results, "traction", k) for k in page)[0] for page in pages)


def robust_limit(arrays: Iterable[NDArray[np.float64]]) -> tuple[float, bool]:
    """A symmetric colour limit that is not determined by a few extreme points, and whether values exceed it.

    The 99.5th percentile of the absolute values of all points above 1 % of the largest, so that snapshots without
    contact do not count.
    """
    size = np.concatenate([np.abs(array[np.isfinite(array)]) for array in arrays] or [np.empty(0)])
    largest = float(size.max(initial=0.0))
    if largest == 0:
        return 1.0, False
    limit = float(np.percentile(size[size > 0.01 * largest], ROBUST_PERCENTILE))
    return limit, largest > 1.001 * limit
