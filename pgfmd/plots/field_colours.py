"""Colours of the fields of snapshots, on one scale for all snapshots that are shown together: gap, traction, displacement,
and the classes of contact. Reads files only, no MPI."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgfmd.results import Results

from .drawing import OCHRE, length_unit
from .maps import (
    OPEN,
    ROBUST_PERCENTILE,
    class_numbers,
    gap_classes,
    nothing_pulls,
    robust_limit,
    stress_unit,
    thinned,
)

if TYPE_CHECKING:
    from matplotlib.cm import ScalarMappable
    from matplotlib.patches import Patch

Paint = Callable[[int], NDArray[np.uint8]]
FLAT = 1e-3
"""Difference of gaps within a snapshot, as a share of the largest gap, below which a punch has no grooves."""
CLEAR = 1.001
"""How far beyond the end of a scale a value has to be to count as cut off."""


@dataclass(frozen=True)
class Colouring:
    """How a field is shown.

    paint: colours of a snapshot, (rows, columns, 4), transparent beyond the punch. scale: of the colour bar, None for
    classes; label: what the bar says; extend: its ends beyond which values go, as matplotlib names them. patches: what else a
    colour means.
    """

    paint: Paint
    scale: ScalarMappable | None
    label: str
    extend: str
    patches: list[Patch]


def contact_colours(results: Results, snapshots: Sequence[int], limit: float | None = None) -> Colouring:
    """The classes of `gap_classes` by the thresholds of the run, in greys. No scale, so no limit."""
    from matplotlib.colors import to_rgba_array

    classes = gap_classes(results.contact_gap, results.near_gap, results.counts_overlap)
    shades = _bytes_of(to_rgba_array([each.grey for each in classes]))

    def paint(snapshot: int) -> NDArray[np.uint8]:
        numbers = class_numbers(thinned(results, "gap", snapshot), classes)
        inside = np.isfinite(numbers)
        return _clear_outside(shades[np.where(inside, numbers, 0).astype(int)], inside)

    return Colouring(paint, None, "", "neither", [_patch(each.grey, each.label) for each in classes])


def gap_colours(results: Results, snapshots: Sequence[int], limit: float | None = None) -> Colouring:
    """Gaps from 0 to `limit` [m], and contact in a colour of its own.

    Without a limit the scale ends at the depth of the grooves: the largest difference of gaps within a snapshot, without the
    last half percent of the points.
    """
    from cmcrameri import cm
    from matplotlib.colors import to_rgba

    contact = gap_classes(results.contact_gap, 0.0, results.counts_overlap, greys=3)[0]
    depth, least, largest = 0.0, math.inf, 0.0
    for snapshot in snapshots:
        gap = thinned(results, "gap", snapshot)
        gap = gap[np.isfinite(gap)]
        depth = max(depth, float(np.percentile(gap, ROBUST_PERCENTILE) - max(gap.min(), 0.0)))
        least, largest = min(least, float(gap.min())), max(largest, float(gap.max()))
    # A flat punch has no grooves.
    limit = limit or (depth if depth > FLAT * largest else max(largest, 1e-9))
    factor, unit = length_unit(limit)
    scale = _scale(cm.devon, 0.0, limit / factor)
    touching = _bytes_of(np.array(to_rgba(OCHRE)))

    def paint(snapshot: int) -> NDArray[np.uint8]:
        gap = thinned(results, "gap", snapshot)
        colours = scale.to_rgba(gap / factor, bytes=True)
        colours[gap < contact.below] = touching
        return _clear_outside(colours, np.isfinite(gap))

    patches = [_patch(OCHRE, contact.label)] if least < contact.below else []
    return Colouring(paint, scale, f"gap ({unit})", _extend(limit, highest=largest), patches)


def traction_colours(results: Results, snapshots: Sequence[int], limit: float | None = None) -> Colouring:
    """Normal traction on a scale from -limit to limit [Pa], tension positive; open points without traction bluish grey.

    Without a limit, the largest `robust_limit` of the snapshots.
    """
    from cmcrameri import cm
    from matplotlib.colors import to_rgba

    largest = limits = 0.0
    for snapshot in snapshots:
        traction = thinned(results, "traction", snapshot)
        limits = max(limits, robust_limit([traction])[0]) if np.nanmax(np.abs(traction), initial=0.0) > 0.0 else limits
        largest = max(largest, float(np.nanmax(np.abs(traction), initial=0.0)))
    end = limit or limits or 1.0
    factor, unit = stress_unit(end)
    scale = _scale(cm.vik, -end / factor, end / factor)
    nothing = _bytes_of(np.array(to_rgba(OPEN)))

    def is_open(snapshot: int, traction: NDArray[np.float64]) -> NDArray[np.bool_]:
        return nothing_pulls(thinned(results, "gap", snapshot), traction, end)

    def paint(snapshot: int) -> NDArray[np.uint8]:
        traction = thinned(results, "traction", snapshot)
        colours = scale.to_rgba(traction / factor, bytes=True)
        colours[is_open(snapshot, traction)] = nothing
        return _clear_outside(colours, np.isfinite(traction))

    any_open = any(is_open(snapshot, thinned(results, "traction", snapshot)).any() for snapshot in snapshots)
    patches = [_patch(OPEN, "open, no traction")] if any_open else []
    extend = _extend(end, -end, largest, -largest)
    return Colouring(paint, scale, f"normal traction ({unit}), tension > 0", extend, patches)


def displacement_colours(results: Results, snapshots: Sequence[int], limit: float | None = None) -> Colouring:
    """Displacement of the surface, upward positive, from its lowest to its highest value; or from -limit to limit [m]."""
    from cmcrameri import cm

    ends = [(float(np.nanmin(each)), float(np.nanmax(each))) for each in
            (thinned(results, "displacement", snapshot) for snapshot in snapshots)]  # fmt: skip
    lowest, highest = min(low for low, _ in ends), max(high for _, high in ends)
    low, high = (-limit, limit) if limit else (lowest, highest)
    if low == high:
        low, high = low - 0.5e-9, high + 0.5e-9
    factor, unit = length_unit(max(abs(low), abs(high)))
    scale = _scale(cm.batlow, low / factor, high / factor)

    def paint(snapshot: int) -> NDArray[np.uint8]:
        values = thinned(results, "displacement", snapshot)
        return _clear_outside(scale.to_rgba(values / factor, bytes=True), np.isfinite(values))

    label = f"displacement of the surface ({unit}), upward > 0"
    return Colouring(paint, scale, label, _extend(high, low, highest, lowest), [])


COLOURINGS: dict[str, tuple[Callable[..., Colouring], str]] = {
    "contact": (contact_colours, ""),
    "gap": (gap_colours, "length"),
    "traction": (traction_colours, "modulus"),
    "displacement": (displacement_colours, "length"),
}
"""Fields that can be shown: what colours them, and the dimension of the end of their scale, "" without a scale."""


def _scale(colours: Any, low: float, high: float) -> ScalarMappable:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    return ScalarMappable(Normalize(low, high), colours)


def _patch(colour: str, label: str) -> Patch:
    from matplotlib.patches import Patch

    return Patch(facecolor=colour, edgecolor="0.25", linewidth=0.5, label=label)


def _bytes_of(colours: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.round(255 * np.asarray(colours)).astype(np.uint8)


def _clear_outside(colours: NDArray[np.uint8], inside: NDArray[np.bool_]) -> NDArray[np.uint8]:
    colours[~inside] = (255, 255, 255, 0)
    return colours


def _extend(high: float, low: float = 0.0, highest: float = 0.0, lowest: float = 0.0) -> str:
    """Which ends of a scale values go beyond."""
    margin = (CLEAR - 1.0) * (high - low)
    above, below = highest > high + margin, lowest < low - margin
    return "both" if above and below else "max" if above else "min" if below else "neither"
