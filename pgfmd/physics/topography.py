"""Punch topography: height z(x, y) [m] of the rigid punch's lower face above its lowest plane; lowest z touches first.

The corrugation of the paper ("Reference model") in its own formula, lateral shift included:

    z_hex(x, y - sqrt(3) lambda/4) = (4/9) z0 (3/2 + 2 cos(qx) cos(qy/sqrt(3)) + cos(2qy/sqrt(3))),  q = 2 pi/lambda
    z_tri = 2 z0 - z_hex

The summits, where z = 0, of "triangular" form a triangular lattice of spacing lambda, and those of "hexagonal" a
honeycomb of spacing lambda/sqrt(3) with twice as many. The shift puts the punch axis half-way between two rows of the
triangular lattice, on its mirror line x = 0: neither a summit nor a saddle, but a slope at the saddles' height, 2/9 z0
(hex) or 16/9 z0 (tri).

Additions, in this order: macroscopic curvature, height jitter of the asperities, printing layers. Heights are raw:
the plane z = 0 is that of the pattern's formula. The programme needs min z = 0 over the punch. Since the points are
distributed over ranks, the caller subtracts the minimum over all points with r <= a, on all ranks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgfmd.maps.raw import MapKeys, Peaks

from .asperities import Lattice, lattice_normals
from .heightfile import HeightMap, MapRequest, height_map
from .random_surface import RandomSurface

Array = NDArray[np.float64]
UNUSED: Any = None
"""Placeholder for fields that the pattern of a face does not need. Code that reads them has checked the pattern."""


def _hexagonal(punch: Topography, x: Array, y: Array) -> Array:
    q = 2 * math.pi / punch.wavelength
    y = y + math.sqrt(3) * punch.wavelength / 4
    waves = 1.5 + 2 * np.cos(q * x) * np.cos(q * y / math.sqrt(3)) + np.cos(2 * q * y / math.sqrt(3))
    # rounding must not push a summit below the plane z = 0
    return np.clip(4 / 9 * punch.amplitude * waves, 0, 2 * punch.amplitude)


def _triangular(punch: Topography, x: Array, y: Array) -> Array:
    return 2 * punch.amplitude - _hexagonal(punch, x, y)


def _flat(punch: Topography, x: Array, y: Array) -> Array:
    return np.zeros(x.shape)


def _sphere(punch: Topography, x: Array, y: Array) -> Array:
    return (x * x + y * y) / (2 * punch.curvature_radius)


def _power(punch: Topography, x: Array, y: Array) -> Array:
    return punch.curvature_radius * (np.hypot(x, y) / punch.curvature_radius) ** punch.exponent / punch.exponent


def _sinusoid(punch: Topography, x: Array, y: Array) -> Array:
    return punch.amplitude * (1 + np.cos(2 * math.pi / punch.wavelength * x))


def _file(punch: Topography, x: Array, y: Array) -> Array:
    return punch.map(x, y, radius=punch.radius)


def _rough(punch: Topography, x: Array, y: Array) -> Array:
    return punch.random(x, y)


def _triangular_lattice(punch: Topography) -> Lattice:
    wavelength = punch.wavelength
    shift = (0.0, -math.sqrt(3) / 4 * wavelength)
    return Lattice(shift, (wavelength, 0.0), (wavelength / 2, math.sqrt(3) / 2 * wavelength))


def _hexagonal_lattice(punch: Topography) -> Lattice:
    # the honeycomb of summits with its hollows filled in: the hollows get offsets as well, but never touch
    spacing = punch.wavelength / math.sqrt(3)
    shift = (0.0, -math.sqrt(3) / 4 * punch.wavelength)
    return Lattice(shift, (0.0, spacing), (math.sqrt(3) / 2 * spacing, spacing / 2))


def _sinusoid_lattice(punch: Topography) -> Lattice:
    wavelength = punch.wavelength
    return Lattice((wavelength / 2, 0.0), (wavelength, 0.0), (wavelength / 2, math.sqrt(3) / 2 * wavelength), row=True)


@dataclass(frozen=True)
class Pattern:
    """One row of the table: formula, the fields of Topography it needs, where its asperities sit, their summits.

    round: curvature_radius belongs to the formula, so it is no macroscopic curvature on top. sampled: the face has no
    regular summits, and they are searched for on a grid.
    """

    heights: Callable[[Topography, Array, Array], Array]
    needs: tuple[str, ...]
    summit_radius: Callable[[Topography], float]
    lattice: Callable[[Topography], Lattice] | None = None
    round: bool = False
    sampled: bool = False


def _wave_radius(factor: float) -> Callable[[Topography], float]:
    return lambda punch: factor * (punch.wavelength / (2 * math.pi)) ** 2 / punch.amplitude


def _power_radius(punch: Topography) -> float:
    return punch.curvature_radius if punch.exponent == 2 else (0.0 if punch.exponent < 2 else math.inf)


WAVE = ("wavelength", "amplitude")
PATTERNS: dict[str, Pattern] = {
    "triangular": Pattern(_triangular, WAVE, _wave_radius(9 / 8), _triangular_lattice),
    "hexagonal": Pattern(_hexagonal, WAVE, _wave_radius(9 / 4), _hexagonal_lattice),
    "flat": Pattern(_flat, (), lambda punch: math.inf),
    "sphere": Pattern(_sphere, ("curvature_radius",), lambda punch: punch.curvature_radius, round=True),
    "power": Pattern(_power, ("curvature_radius", "exponent"), _power_radius, round=True),
    "sinusoid": Pattern(_sinusoid, WAVE, _wave_radius(1.0), _sinusoid_lattice),
    "file": Pattern(_file, ("file",), lambda punch: math.nan, sampled=True),
    "rough": Pattern(
        _rough, ("hurst", "longest", "shortest", "period"), lambda punch: punch.random.summit_radius, sampled=True
    ),
}


def layered(z: Array, layer_step: float, smoothing: float) -> Array:
    """Heights printed in layers: plateaus at the multiples of layer_step, joined by ramps of continuous curvature.

    z: heights [m], any shape. layer_step: [m]. smoothing: fraction of each layer's height range that its ramp takes,
    0 < smoothing <= 1. Monotone in z; moves no height by more than half a step.
    """
    level = np.floor(z / layer_step)
    t = np.clip(((z / layer_step - level) - (1 - smoothing) / 2) / smoothing, 0, 1)
    return layer_step * (level + t * t * t * (10 + t * (6 * t - 15)))


@dataclass(frozen=True)
class Topography:
    """Lower face of the punch, `z = layers(pattern(x, y) + r^2/(2 R_m) + jitter(x, y))`, raw (see the module).

    pattern: a key of PATTERNS. radius: punch radius a [m], None when the scene fills the plane.
    wavelength [m], amplitude [m]: lambda and z0 of the corrugation; maximum minus minimum is 2 z0.
        sinusoid: `z0 (1 + cos qx)`.
    curvature_radius [m]: R of sphere, `r^2/(2R)`, and power, `R (r/R)^p / p`; for every other pattern R_m of the
        macroscopic curvature, negative for a concave punch, infinite for none. exponent: p > 0.
    layer_step [m]: height of a printing layer, 0 for none; layer_smoothing: see `layered`.
    height_jitter [m]: standard deviation of the asperities' heights, 0 for none; needs a pattern with asperities.
    seed: any integer; the offset of an asperity follows from the seed and the asperity's lattice indices alone, as does the
        phase of a wave of "rough".
    hurst, rms_height [m], rms_slope, longest, roll_off, shortest, period [m]: of "rough", see `pgfmd.physics.random_surface`;
        one of rms_height and rms_slope; roll_off is `longest` by default.
    file, file_size (x, y) [m], file_periodic, file_order: see `pgfmd.physics.heightfile`; a map is periodic by default
    if there is no radius. file_unit: name of the unit of its heights, None for that of the file, or metres if it has
    none. file_peaks: "up" if larger heights touch first, "down" if lower ones do, None for the sense given in the file,
    or "down" if it has none. file_detrend: what is subtracted, "none", "tilt" or "curvature". file_missing: whether
    missing heights are refused ("refuse") or interpolated ("fill"). file_missing_value: numbers that mean missing.
    file_relief [m]: least height by which a summit or valley of a map stands out (`contact_sites`), without effect on
    the heights; None, as for "rough", for a fraction of the height range.

    Raises ValueError naming the field that is wrong or missing.
    """

    pattern: str
    radius: float | None = None
    wavelength: float = UNUSED
    amplitude: float = UNUSED
    curvature_radius: float = math.inf
    exponent: float = UNUSED
    layer_step: float = 0.0
    layer_smoothing: float = 0.5
    height_jitter: float = 0.0
    seed: int = 0
    file: str | Path = UNUSED
    file_size: tuple[float, float] | None = None
    file_periodic: bool | None = None
    file_order: Literal[1, 3] = 1
    file_relief: float | None = None
    file_unit: str | None = None
    file_peaks: Peaks | None = None
    file_detrend: Literal["none", "tilt", "curvature"] = "none"
    file_missing: Literal["refuse", "fill"] = "refuse"
    file_missing_value: tuple[float, ...] | None = None
    hurst: float = UNUSED
    rms_height: float | None = None
    rms_slope: float | None = None
    longest: float = UNUSED
    roll_off: float | None = None
    shortest: float = UNUSED
    period: float = UNUSED

    def __post_init__(self) -> None:
        if self.pattern not in PATTERNS:
            raise ValueError(f"pattern = {self.pattern!r}: expected one of {', '.join(PATTERNS)}")
        for name in PATTERNS[self.pattern].needs:
            if getattr(self, name) is None:
                raise ValueError(f"{name}: missing, pattern {self.pattern!r} needs it")
        lengths = (
            "radius wavelength amplitude exponent file_relief rms_height rms_slope longest roll_off shortest period"
        )
        for name in lengths.split():
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} = {value!r}: expected a positive finite number")
        if PATTERNS[self.pattern].round and not 0 < self.curvature_radius < math.inf:
            raise ValueError(f"curvature_radius = {self.curvature_radius!r}: expected a positive finite number")
        if self.curvature_radius == 0 or math.isnan(self.curvature_radius):
            raise ValueError(f"curvature_radius = {self.curvature_radius!r}: expected a number other than 0")
        for name in ("layer_step", "height_jitter"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise ValueError(f"{name} = {getattr(self, name)!r}: expected a finite number >= 0")
        if not 0 < self.layer_smoothing <= 1:
            raise ValueError(f"layer_smoothing = {self.layer_smoothing!r}: expected 0 < layer_smoothing <= 1")
        if self.height_jitter > 0 and PATTERNS[self.pattern].lattice is None:
            raise ValueError(f"height_jitter = {self.height_jitter!r}: pattern {self.pattern!r} has no asperities")

    @cached_property
    def map(self) -> HeightMap:
        """The map of a face with the pattern "file", read once. Raises ValueError, OSError."""
        return height_map(self.map_request)

    @property
    def map_request(self) -> MapRequest:
        """The request for the map of a face with the pattern "file"."""
        keys = MapKeys(
            self.file_size,
            self.file_unit,
            self.file_peaks,
            self.file_detrend,
            self.file_missing,
            self.file_missing_value,
        )
        periodic = self.radius is None if self.file_periodic is None else self.file_periodic
        return MapRequest(str(self.file), keys, self.radius, periodic, self.file_order)

    @cached_property
    def random(self) -> RandomSurface:
        """The waves of a face with the pattern "rough". Raises ValueError."""
        roll_off = self.longest if self.roll_off is None else self.roll_off
        lengths = (self.longest, roll_off, self.shortest, self.period)
        return RandomSurface(self.hurst, *lengths, self.rms_height, self.rms_slope, self.seed)

    @property
    def summit_radius(self) -> float:
        """Curvature radius [m] of the pattern's summits, additions left out; infinite when flat, NaN for a file, of "rough" that
        of its mean summit."""
        return PATTERNS[self.pattern].summit_radius(self)

    def heights(self, x: ArrayLike, y: ArrayLike) -> Array:
        """Raw heights [m] at the points (x, y) [m] relative to the punch axis; shape of x and y broadcast together.

        Pointwise: a point's height does not depend on the other points of the call. Finite everywhere, also at
        r > a, which the caller masks. Raises ValueError, OSError for a file that can't be used.
        """
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        pattern = PATTERNS[self.pattern]
        z = pattern.heights(self, x, y)
        if math.isfinite(self.curvature_radius) and not pattern.round:
            z = z + (x * x + y * y) / (2 * self.curvature_radius)
        if self.height_jitter > 0 and pattern.lattice is not None:
            z = z + self.height_jitter * lattice_normals(pattern.lattice(self), self.seed, x, y)
        if self.layer_step > 0:
            z = layered(z, self.layer_step, self.layer_smoothing)
        return z
