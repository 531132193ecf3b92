"""Interpolation of height maps: the heights in a file (pgfmd.maps) as a function of x and y.

A map is a 2-D array z[iy, ix] in metres with its physical size (x, y), over the whole cell or over the punch. Axis 0
is y, axis 1 is x, and like the simulation grid's points the samples sit in the middle of their pixels, centred on the
punch axis: x = ((ix + 1/2)/nx - 1/2) size_x. As everywhere, lower z touches first.
"""

from __future__ import annotations

import math
import os
import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pgfmd.maps import raw as limits
from pgfmd.maps.preparing import MapFacts, Stripes, prepared
from pgfmd.maps.raw import MapKeys

Array = NDArray[np.float64]
ORDERS = (1, 3)
HIGHEST = 1e30
"""Largest allowed height [m], far beyond any real map. Squares of heights stay finite."""
RADIUS_SLACK = 1e-9  # relative; a punch point on the very edge of the map is inside
MARGIN = 48
"""Rows and columns around a stripe, more than EDGE. Over them, the influence of a sample on a cubic spline decreases to
1e-27."""

EDGE = 12
"""Number of samples beyond the edge of a map after which it is constant, as in map_coordinates."""


class MapRequest(NamedTuple):
    """The arguments for reading a map: the file; further keys of the scene; radius [m] of the punch, None if the whole
    map counts; whether it is periodic; order of the interpolation."""

    file: str
    keys: MapKeys
    radius: float | None
    periodic: bool
    order: int


def map_bytes(path: str | Path, order: int = 1) -> float:
    """Approximate memory [bytes] for the interpolation of a map, without reading it. A large map is kept in memory
    unless it is a .npy file. OSError."""
    path, copies = Path(path), 1 if order == 1 else 3
    samples = path.stat().st_size / 8
    if path.suffix == ".npz":
        with zipfile.ZipFile(path) as archive:
            samples = sum(entry.file_size for entry in archive.infolist()) / 8
    if samples <= limits.WHOLE:
        return 8.0 * samples * copies
    stripe = limits.WHOLE + 2.0 * MARGIN * math.sqrt(samples)
    return 8.0 * (stripe * copies + (0.0 if path.suffix == ".npy" else samples))


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Interpolated height map.

    heights: z[iy, ix] [m], at least 2 x 2, finite. size: (x, y) [m]. periodic: repeats over the plane, else it must
    cover every punch point and is continued by its edge values elsewhere. order: 1 bilinear, 3 bicubic spline. A large
    map may be on the disk (numpy.memmap): with more than `WHOLE` samples, only stripes are in memory. file_facts: facts
    found while reading, if it is from a file.
    """

    heights: Array | Stripes
    size: tuple[float, float]
    periodic: bool = False
    order: int = 1
    file_facts: MapFacts | None = None
    _kept: dict[str, Any] = field(default_factory=dict, init=False, repr=False)

    def __post_init__(self) -> None:
        if self.heights.ndim != 2 or min(self.heights.shape) < 2:
            raise ValueError(f"height map: found shape {self.heights.shape}, expected at least 2 x 2 samples")
        some = max(1, limits.WHOLE // self.heights.shape[1])
        for row in range(0, len(self.heights), some):
            part = self.heights[row : row + some]
            if not np.isfinite(part).all():
                raise ValueError("height map: found a height that is not finite; fill the gaps first")
            if max(abs(float(part.min())), abs(float(part.max()))) > HIGHEST:
                raise ValueError(f"height map: found a height above {HIGHEST:g} m; heights are in metres")
        if len(self.size) != 2 or not all(np.isfinite(side) and side > 0 for side in self.size):
            raise ValueError(f"size = {self.size!r}: expected two positive lengths (x, y)")
        if self.order not in ORDERS:
            raise ValueError(f"file_order = {self.order!r}: expected 1 (bilinear) or 3 (bicubic)")

    @property
    def facts(self) -> MapFacts:
        """Facts about the file. Raises ValueError for a map that is not from a file."""
        if self.file_facts is None:
            raise ValueError("height map: made of an array, so there is no file to tell of")
        return self.file_facts

    @property
    def on_disk(self) -> bool:
        """Whether it is a large map whose file stays open."""
        return isinstance(self.heights, (np.memmap, Stripes))

    @property
    def pixel(self) -> tuple[float, float]:
        """Size [m] of a pixel along x and y."""
        return self.size[0] / self.heights.shape[1], self.size[1] / self.heights.shape[0]

    def __call__(self, x: Array, y: Array, radius: float | None = None) -> Array:
        """Heights [m] at (x, y) [m] relative to the punch axis, of equal shapes.

        Raises ValueError when a map that is not periodic misses a point with r <= radius (any point if None).
        """
        size_x, size_y = self.size
        if not self.periodic:
            outside = (np.abs(x) > size_x / 2 * (1 + RADIUS_SLACK)) | (np.abs(y) > size_y / 2 * (1 + RADIUS_SLACK))
            if np.any(outside & (True if radius is None else np.hypot(x, y) <= radius * (1 + RADIUS_SLACK))):
                raise ValueError(f"height map: covers {size_x:.6g} m x {size_y:.6g} m, which is less than the punch")
        count_y, count_x = self.heights.shape
        rows, columns = (y / size_y + 0.5) * count_y - 0.5, (x / size_x + 0.5) * count_x - 0.5
        if self.heights.size > limits.WHOLE:
            return self._by_stripes(rows, columns)
        mode = "grid-wrap" if self.periodic else "nearest"
        pad, coefficients = self._whole(mode)
        places = np.stack([rows + pad, columns + pad])
        # Imported here and below, because only a map needs them.
        from scipy.ndimage import map_coordinates

        found: Array = map_coordinates(coefficients, places, order=self.order, mode=mode, prefilter=False)
        return found

    def _whole(self, mode: str) -> tuple[int, Array]:
        """The coefficients from which a small map is interpolated, computed once, and the number of samples added
        around it."""
        if self.order == 1:
            return 0, self.heights[:]
        from scipy.ndimage import spline_filter

        pad = 0 if self.periodic else EDGE
        if "coefficients" not in self._kept:
            samples = np.pad(self.heights[:], pad, mode="edge") if pad else self.heights[:]
            self._kept["coefficients"] = spline_filter(samples, self.order, output=float, mode=mode)
        return pad, self._kept["coefficients"]

    def _by_stripes(self, rows: Array, columns: Array) -> Array:
        """Heights at positions in pixels, from one stripe of the map after another.

        Stripes do not depend on the positions, so a height has the same bits on any rank.
        """
        if self.periodic:
            rows, columns = np.mod(rows, self.heights.shape[0]), np.mod(columns, self.heights.shape[1])
        else:
            # A few samples beyond the edge, the spline is constant.
            ends = ((-EDGE, count - 1 + EDGE) for count in self.heights.shape)
            rows, columns = (np.clip(place, *end) for place, end in zip((rows, columns), ends, strict=True))
        from scipy.ndimage import map_coordinates

        found, height = np.empty(rows.shape), max(1, limits.WHOLE // self.heights.shape[1])
        last = (self.heights.shape[0] - 1) // height
        stripe_of = np.clip(rows // height, 0, last).astype(np.int64)
        for stripe in np.unique(stripe_of).tolist():
            here = stripe_of == stripe
            places = np.stack([rows[here] - (stripe * height - MARGIN), columns[here] + MARGIN])
            coefficients = self._coefficients(stripe, height)
            found[here] = map_coordinates(coefficients, places, order=self.order, mode="nearest", prefilter=False)
        return found

    def _coefficients(self, stripe: int, height: int) -> Array:
        """The coefficients of a stripe of rows with its margin. The last one is kept."""
        if self._kept.get("stripe") != stripe:
            from scipy.ndimage import spline_filter

            self._kept.clear()
            row, column = (np.arange(-MARGIN, count + MARGIN) for count in (height, self.heights.shape[1]))
            places = [index % count if self.periodic else np.clip(index, 0, count - 1)
                      for index, count in zip((row + stripe * height, column), self.heights.shape, strict=True)]  # fmt: skip
            samples = self.heights[places[0]].astype(float)[:, places[1]]
            self._kept["coefficients"] = spline_filter(samples, self.order, output=float) if self.order > 1 else samples
            self._kept["stripe"] = stripe
        coefficients: Array = self._kept["coefficients"]
        return coefficients


Stamp = tuple[int, int]
"""Time [ns] of the last change of a file, and its size, which show that it has been rewritten."""
_KEPT: dict[MapRequest, tuple[HeightMap, Stamp]] = {}
"""The last map, with its request and stamp."""


def height_map(request: MapRequest) -> HeightMap:
    """The map of a file. The last one is kept, because a scene is examined several times before it runs (see `forget`).

    Raises ValueError (its subclass MapError names the wrong keys of a scene), OSError.
    """
    found = os.stat(request.file)
    stamp = found.st_mtime_ns, found.st_size
    if request in _KEPT and _KEPT[request][1] == stamp:
        return _KEPT[request][0]
    # Imported here, because only rank 0 of a run reads the file.
    from pgfmd.maps.reading import read_map

    heights, facts = prepared(read_map(request.file), request.keys, request.radius)
    height_map = HeightMap(heights, facts.size, request.periodic, request.order, facts)
    remember(request, height_map, stamp)
    return height_map


def kept(request: MapRequest) -> tuple[HeightMap, Stamp]:
    """The map of a file, and the stamp of the file. ValueError, OSError."""
    height_map(request)
    return _KEPT[request]


def remember(request: MapRequest, height_map: HeightMap, stamp: Stamp) -> None:
    """Keeps a map instead of the previous one."""
    _KEPT.clear()
    _KEPT[request] = height_map, stamp


def forget() -> None:
    """Drops the map, after a run has computed its heights."""
    _KEPT.clear()
