"""Maps of the punch, one a snapshot: overlap, contact, near and open in greys, and the normal traction."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pgfmd.results import Results

from .drawing import literal
from .gap_classes import class_numbers, gap_classes

MOST_PANELS = 12
MOST_PIXELS = 1024
ROBUST_PERCENTILE = 99.5
LEGEND_LINE = 0.17
"""Height [inch] of a line of a legend."""


def new_figure(width: float, height: float) -> Any:
    """An empty figure, width and height in inches, that belongs to no window."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def signed(value: float) -> str:
    """A number of three digits with a true minus sign."""
    return f"{value:.3g}".replace("-", "\N{MINUS SIGN}")


def chosen_snapshots(count: int) -> list[int]:
    """All snapshots, or evenly chosen ones, with the first and the last, where there are too many for one page."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, MOST_PANELS))})


class Maps:
    """A page of square maps of the punch block, one a snapshot, with label, time, force, and a scale bar."""

    def __init__(self, results: Results, name: str):
        fields = results.fields
        self.results, self.name = results, name
        self.snapshots = chosen_snapshots(len(results.labels))
        x = np.asarray(fields["x"])
        # Drawing every point of a fine grid takes minutes and can't be seen: thin it out evenly.
        self.stride = -(-x.size // MOST_PIXELS)
        half = 0.5 * (x[-1] - x[0]) * (1 + 1 / max(x.size - 1, 1))
        self.half = 1e6 * (half if x.size > 1 else 1e-6)
        rows = -(-len(self.snapshots) // 4)
        self.columns = -(-len(self.snapshots) // rows)
        # A single map needs room for its colour bar and legend.
        self.figure = new_figure(max(1.9 * self.columns + 0.9, 4.0), 2.45 * rows + 0.75)
        axes = self.figure.subplots(rows, self.columns, squeeze=False).ravel()
        for axis in axes[len(self.snapshots) :]:
            axis.remove()
        self.axes = list(axes[: len(self.snapshots)])
        for axis, snapshot in zip(self.axes, self.snapshots):
            self._frame(axis, snapshot)
        self._scale_bar(self.axes[(rows - 1) * self.columns])
        if len(self.snapshots) < len(results.labels):
            note = f"{len(self.snapshots)} of {len(results.labels)} snapshots"
            self.figure.suptitle(note, fontsize=8.5, color="0.4")

    def values(self, snapshot: int) -> np.ndarray:
        """The map's array, thinned out."""
        return self.results.frame(self.name, snapshot)[:: self.stride, :: self.stride]

    def draw(self, axis: Any, values: np.ndarray, **options: Any) -> Any:
        """Show an array with y upward, and the outline of the punch where it does not fill the block."""
        extent = (-self.half, self.half, -self.half, self.half)
        outside = np.isnan(values)
        if outside.any() and not outside.all():
            middle = (np.arange(len(values)) + 0.5) / len(values) * 2 * self.half - self.half
            # Padded, so that the outline closes where the punch touches the edge of the block.
            step = middle[1] - middle[0] if len(middle) > 1 else self.half
            wide = np.concatenate(([middle[0] - step], middle, [middle[-1] + step]))
            axis.contour(wide, wide, np.pad(outside, 1, constant_values=True), [0.5], colors="0.25", linewidths=0.7)
        options |= {"origin": "lower", "extent": extent, "interpolation": "nearest"}
        image = axis.imshow(np.ma.masked_invalid(values), **options)
        margin = 1.03 * self.half
        axis.set(xlim=(-margin, margin), ylim=(-margin, margin))
        return image

    def _frame(self, axis: Any, snapshot: int) -> None:
        fields, label = self.results.fields, self.results.labels[snapshot]
        label = label if len(label) <= 30 else label[:29] + "…"
        time, force = float(fields["time"][snapshot]), 1e3 * float(fields["force"][snapshot])
        axis.set_title(f"{literal(label)}\n{time:.4g} s,  {signed(force)} mN", linespacing=1.3)
        axis.set_aspect("equal")
        axis.set_xticks([])
        axis.set_yticks([])
        for spine in axis.spines.values():
            spine.set_visible(False)

    def _scale_bar(self, axis: Any) -> None:
        length = round_length(0.6 * self.half)
        start, height = -self.half, -1.12 * self.half
        line = {"color": "black", "linewidth": 2, "solid_capstyle": "butt", "clip_on": False}
        axis.plot([start, start + length], [height, height], **line)
        text = f"{length:g} µm" if length < 1000 else f"{length / 1000:g} mm"
        axis.text(start + length / 2, height - 0.06 * self.half, text, ha="center", va="top", fontsize=8)


def round_length(largest: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above `largest`."""
    power = 10.0 ** math.floor(math.log10(largest))
    return max(factor * power for factor in (1, 2, 5) if factor * power <= largest * (1 + 1e-12))


def contact_figure(
    results: Results, greys: int = 4, contact_gap: float | None = None, near_gap: float | None = None
) -> Any:
    """The punch's gaps in four greys, overlap, contact, near and open, or in the paper's three (`gap_classes`).

    contact_gap, near_gap: thresholds [m] by hand, None for those of the run.
    """
    from matplotlib.colors import BoundaryNorm, ListedColormap
    from matplotlib.patches import Patch

    contact_gap = results.contact_gap if contact_gap is None else contact_gap
    near_gap = results.near_gap if near_gap is None else near_gap
    classes = gap_classes(contact_gap, near_gap, results.counts_overlap, greys)
    shades = [each.grey for each in classes]
    look = {"cmap": ListedColormap(shades), "norm": BoundaryNorm(np.arange(len(shades) + 1) - 0.5, len(shades))}
    maps = Maps(results, "gap")
    for axis, snapshot in zip(maps.axes, maps.snapshots):
        maps.draw(axis, class_numbers(maps.values(snapshot), classes), **look)
    patches = [Patch(facecolor=each.grey, edgecolor="0.25", linewidth=0.5, label=each.label) for each in classes]
    columns = len(patches) if len(maps.axes) > 2 else 2
    maps.figure.set_figheight(maps.figure.get_figheight() + LEGEND_LINE * -(-len(patches) // columns))
    maps.figure.legend(handles=patches, loc="outside lower center", ncols=columns, handlelength=1.2, columnspacing=1.4)
    return maps.figure


def stress_figure(results: Results) -> Any:
    """Normal traction under the punch, tension positive; one symmetric scale for all snapshots."""
    from cmcrameri import cm

    maps = Maps(results, "traction")
    frames = {snapshot: maps.values(snapshot) for snapshot in maps.snapshots}
    limit, clipped = robust_limit(frames.values())
    factor, unit = (1e6, "MPa") if limit >= 1e6 else (1e3, "kPa") if limit >= 1e3 else (1.0, "Pa")
    image = None
    for axis, (snapshot, traction) in zip(maps.axes, frames.items()):
        image = maps.draw(axis, traction / factor, cmap=cm.vik, vmin=-limit / factor, vmax=limit / factor)
    extend = "both" if clipped else "neither"
    bar = maps.figure.colorbar(image, ax=maps.axes, shrink=0.8, aspect=25, pad=0.02, extend=extend)
    bar.set_label(f"normal traction ({unit}), tension > 0")
    bar.outline.set_linewidth(0.5)
    return maps.figure


def robust_limit(arrays: Any) -> tuple[float, bool]:
    """A symmetric colour limit that a few extreme points do not set, and whether it leaves values out.

    The 99.5th percentile of the absolute values of all points that carry a noticeable part (over 1 %) of the largest,
    so that snapshots without contact do not count.
    """
    size = np.concatenate([np.abs(array[np.isfinite(array)]) for array in arrays] or [np.empty(0)])
    largest = float(size.max(initial=0.0))
    if largest == 0:
        return 1.0, False
    limit = float(np.percentile(size[size > 0.01 * largest], ROBUST_PERCENTILE))
    return limit, largest > 1.001 * limit
