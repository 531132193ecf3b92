"""What the greys of a map of gaps mean: overlap, contact, near, open, by the thresholds of the run itself."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgfmd.units import handy_quantity

GREYS = ("#2b2b2b", "#9a9a9a", "#e9e9e9")
"""The paper's three: contact, near, open."""
FOUR_GREYS = ("#1c1c1c", "#606060", "#a5a5a5", "#ececec")
"""Overlap, contact, near, open. Their lightness L* rises in steps of 25 to 31 (10, 41, 68, 93), so that prints and
copies keep them apart."""
NEAR_LEVEL = 500e-9
"""Gap [m] below which the paper's figures are shaded."""


@dataclass(frozen=True)
class GapClass:
    """Points whose gap is below `below` [m], infinite for the rest, and not in the class before; the grey they get."""

    name: str
    below: float
    grey: str

    @property
    def label(self) -> str:
        """As a legend says it."""
        if math.isinf(self.below):
            return self.name
        bound = handy_quantity(self.below, "length").replace("um", "µm") if self.below else "0"
        return f"{self.name} (gap < {bound})"


def gap_classes(contact_gap: float, near_gap: float, counts_overlap: bool = False, greys: int = 4) -> list[GapClass]:
    """The classes of a map, from the smallest gaps to the largest; those that nothing can be in are left out.

    Args:
        contact_gap: [m], below which a point is in contact. At 0 contact and overlap are the same.
        near_gap: [m], below which a point is near. Nothing is only near where it is not above `contact_gap`.
        counts_overlap: whether nothing but overlap is known of the run (`Results.counts_overlap`): then there is no
            contact, unless `contact_gap` is above 0.
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
