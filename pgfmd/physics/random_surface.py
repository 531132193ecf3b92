"""A random self-affine face: plane waves with a given spectrum and random phases, whose sum is known at any point. Plain NumPy.

    z(x, y) = sum_k A_k cos(2 pi (i x + j y)/P + phi_k),   A_k^2/2 = 2 C(q_k)/P^2,   q_k = 2 pi sqrt(i^2 + j^2)/P

    C(q) = C_0 for q_L <= q < q_r,   C_0 (q/q_r)^(-2 - 2 H) for q_r <= q <= q_s,   0 elsewhere

with k = (i, j) over half of all integers, because k and -k are the same wave. P is the period of the face along x and
y; H
the Hurst exponent; q_L, q_r and q_s belong to the longest wave, the roll-off and the shortest one. C is the usual spectral
density of heights per area of wave vectors, <z^2> = (2 pi)^-2 int C(q) d^2q: Persson et al., J. Phys.: Condens. Matter 17
(2005) R1; Jacobs, Junge and Pastewka, Surf. Topogr. 5 (2017) 013001. Amplitudes follow the spectrum, and the uniform
phases are a hash of (seed, i, j). So rms height, slope and curvature over a period are exact sums, and another cut-off
does not change the other waves.

The face does not depend on the simulation grid. The waves are summed on a separate grid with at least four points per
shortest wave, and interpolated with a Kaiser-Bessel window whose effect on the amplitudes is corrected beforehand (a
non-uniform fast Fourier transform: Dutt and Rokhlin, SIAM J. Sci. Comput. 14 (1993) 1368), to 1e-12 of the rms height.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .asperities import site_uniforms

Array = NDArray[np.float64]

MOST_WAVES = 2048
"""Largest number of shortest waves along a period, at which the grid takes half a gigabyte."""
WIDTH = 14
"""Number of points of this grid, along a side, from which a height is interpolated."""
BETA = 0.75 * math.pi * WIDTH
"""Parameter of the Kaiser-Bessel window with four points per shortest wave."""
FEW = 1 << 16
"""Number of points whose heights are computed at a time."""
ROUNDING = 1e-9
"""Relative width by which a wave may be longer or shorter than the cut-offs."""


def automatic_period(radius: float | None, longest: float, side: float) -> float:
    """The default period [m] of a face: the side [m] of a cell that it fills; with an outline, twice the larger of the
    longest wave and the diameter, so that it only depends on the punch, and nothing is repeated under the punch."""
    return side if radius is None else 2.0 * max(2.0 * radius, longest)


@dataclass(frozen=True)
class Roughness:
    """Root mean squares: height [m] about its mean, slope |grad z|, curvature (z_xx + z_yy)/2 [1/m]; steepest: the largest
    slope, NaN where it is not known."""

    height: float
    slope: float
    curvature: float
    steepest: float = math.nan


@dataclass(frozen=True)
class RandomSurface:
    """A face as in the head of this module.

    hurst: H, 0 < H <= 1. longest, roll_off, shortest [m]: wavelengths 2 pi/q. period [m]: P. rms_height [m] or rms_slope: over a
    whole period; one of the two.

    Raises ValueError naming the field that is wrong, or if the period has no wave between the longest and the shortest.
    """

    hurst: float
    longest: float
    roll_off: float
    shortest: float
    period: float
    rms_height: float | None = None
    rms_slope: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0.0 < self.hurst <= 1.0:
            raise ValueError(f"hurst = {self.hurst!r}: expected 0 < hurst <= 1")
        if (self.rms_height is None) == (self.rms_slope is None):
            raise ValueError("expected rms_height or rms_slope, one of the two")
        if not self.shortest <= self.roll_off <= self.longest <= self.period * (1.0 + ROUNDING):
            raise ValueError("expected shortest <= roll_off <= longest <= period")
        if self.most > MOST_WAVES:
            least = f"{self.period / MOST_WAVES:.6g} m"
            raise ValueError(f"shortest = {self.shortest!r}: expected at least {least}, 1/{MOST_WAVES} of the period")
        if not self._lattice[0].size:
            raise ValueError(
                f"no wave of the period {self.period:.6g} m lies between {self.longest:.6g} m and {self.shortest:.6g} m; "
                "choose them further apart"
            )

    @property
    def most(self) -> int:
        """Waves of the shortest length along a period."""
        return math.floor(self.period / self.shortest * (1.0 + ROUNDING))

    @property
    def points(self) -> int:
        """Points along a side of the grid on which the waves are summed."""
        return points_for(self.period, self.shortest)

    def waves(self) -> tuple[Array, Array]:
        """Wave numbers q [1/m] and amplitudes A [m] of all waves, (count,)."""
        i, j, shape = self._lattice
        q = 2.0 * math.pi / self.period * np.hypot(i, j)
        return q, self._scale * shape

    @functools.cached_property
    def _lattice(self) -> tuple[Array, Array, Array]:
        """i, j and relative amplitude of the waves with i > 0, or i = 0 and j > 0; amplitudes are 1 on the plateau."""
        i, j = np.arange(self.most + 1.0), np.arange(-float(self.most), self.most + 1.0)[:, np.newaxis]
        waves = np.hypot(i, j)
        kept = (waves >= self.period / self.longest * (1.0 - ROUNDING)) & ((i > 0) | (j > 0))
        kept &= waves <= self.period / self.shortest * (1.0 + ROUNDING)
        row, column = np.nonzero(kept)
        shape = np.maximum(waves[kept] * (self.roll_off / self.period), 1.0) ** (-1.0 - self.hurst)
        return np.asarray(column, np.float64), np.asarray(row - self.most, np.float64), np.asarray(shape, np.float64)

    @functools.cached_property
    def _scale(self) -> float:
        """Amplitude [m] of a wave on the plateau of the spectrum."""
        i, j, shape = self._lattice
        if self.rms_height is not None:
            return self.rms_height / math.sqrt(0.5 * float(np.sum(shape**2)))
        assert self.rms_slope is not None, "one of the two is there"
        slopes = 2.0 * math.pi / self.period * np.hypot(i, j) * shape
        return self.rms_slope / math.sqrt(0.5 * float(np.sum(slopes**2)))

    def density(self, q: Array) -> Array:
        """C(q) [m^4] at wave numbers [1/m], any shape."""
        plateau = 0.25 * (self._scale * self.period) ** 2
        cut = 2.0 * math.pi / np.array([self.longest, self.roll_off, self.shortest])
        shape = np.maximum(np.asarray(q, float) / cut[1], 1.0) ** (-2.0 - 2.0 * self.hurst)
        within = (q >= cut[0] * (1.0 - ROUNDING)) & (q <= cut[2] * (1.0 + ROUNDING))
        return np.where(within, plateau * shape, 0.0)

    def moment(self, power: int) -> float:
        """Sum of A^2/2 q^power over all waves [m^(2 - power)]: 0 gives the mean square of heights, 2 of slopes."""
        q, amplitude = self.waves()
        return float(np.sum(0.5 * amplitude**2 * q**power))

    @property
    def expected(self) -> Roughness:
        """Statistics of a whole period, from the spectrum."""
        height, slope, bend = (math.sqrt(self.moment(power)) for power in (0, 2, 4))
        return Roughness(height, slope, 0.5 * bend)

    @property
    def summit_radius(self) -> float:
        """Inverse [m] of the mean curvature of the summits of such a Gaussian surface, 8/3 sqrt(m_4/pi) with m_4 = <z_xx^2> =
        3/8 of the fourth moment: Nayak, J. Lubr. Technol. 93 (1971) 398."""
        return 0.375 * math.sqrt(math.pi / (0.375 * self.moment(4)))

    def realised(self, radius: float | None = None) -> Roughness:
        """The same for the part under a punch of this radius [m], or a whole period without one, at the points of
        `points`."""
        across = (np.arange(self.points) / self.points + 0.5) % 1.0 - 0.5
        inside = np.ones((1, 1), bool)
        if radius is not None:
            across = across * self.period
            inside = np.hypot(across, across[:, np.newaxis]) <= radius
        inside = np.broadcast_to(inside, (self.points, self.points))
        slope = np.hypot(self._derivative(1, 0)[inside], self._derivative(0, 1)[inside])
        bend = 0.5 * (self._derivative(2, 0)[inside] + self._derivative(0, 2)[inside])
        height = self._derivative(0, 0)[inside]
        return Roughness(float(height.std()), _rms(slope), _rms(bend), float(slope.max()))

    def __call__(self, x: Array, y: Array) -> Array:
        """Heights [m] at points (x, y) [m] of equal shapes. A point's height does not depend on the others."""
        found = np.empty(x.size)
        x, y, shape = x.ravel(), y.ravel(), x.shape
        for start in range(0, x.size, FEW):
            some = slice(start, start + FEW)
            found[some] = self._some(x[some], y[some])
        return found.reshape(shape)

    def _some(self, x: Array, y: Array) -> Array:
        samples = self._samples
        row, of_row = self._window(y)
        column, of_column = self._window(x)
        lines, line_of = np.unique(y, return_inverse=True)
        total = np.zeros(x.size)
        # Both variants add in the same order and so give the same bits: first along a line of samples between the rows.
        if lines.size * len(samples) > x.size * WIDTH:
            for k in range(WIDTH):
                along = np.zeros(x.size)
                for m in range(WIDTH):
                    along += of_row[m] * samples[(row + m) % len(samples), (column + k) % len(samples)]
                total += of_column[k] * along
            return total
        order = np.argsort(line_of, kind="stable")
        for places in np.split(order, np.cumsum(np.bincount(line_of))[:-1]):
            one, line = places[0], np.zeros(len(samples))
            for m in range(WIDTH):
                line += of_row[m, one] * samples[(row[one] + m) % len(samples)]
            for k in range(WIDTH):
                total[places] += of_column[k, places] * line[(column[places] + k) % len(samples)]
        return total

    def _window(self, x: Array) -> tuple[NDArray[np.int64], Array]:
        """For coordinates [m], (count,): the first of the samples for each, and the weights of the samples (WIDTH,
        count)."""
        from scipy.special import i0

        place = (x / self.period - np.floor(x / self.period)) * self.points
        first = np.ceil(place - 0.5 * WIDTH)
        off = first - place + np.arange(WIDTH)[:, np.newaxis]
        inside = np.maximum(1.0 - (2.0 / WIDTH * off) ** 2, 0.0)
        return first.astype(np.int64), i0(BETA * np.sqrt(inside)) / i0(BETA)

    def _half_waves(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.complex128]]:
        """i, j and A exp(i phi)/2 [m] of all waves."""
        along_x, along_y, shape = self._lattice
        i, j = along_x.astype(np.int64), along_y.astype(np.int64)
        phase = 2.0 * math.pi * site_uniforms(self.seed, i, j)
        return i, j, 0.5 * self._scale * shape * np.exp(1j * phase)

    def _derivative(self, along_x: int, along_y: int) -> Array:
        """A derivative of the heights [m^(1 - order)] at the points of a period, [y, x], from the axis on."""
        i, j, waves = self._half_waves()
        unit = 2.0j * math.pi / self.period
        return _sum_on_grid(self.points, i, j, waves * (unit * i) ** along_x * (unit * j) ** along_y)

    @functools.cached_property
    def _samples(self) -> Array:
        """The samples that the window interpolates, [y, x], from the axis on."""
        i, j, waves = self._half_waves()
        count = self.points

        def response(index: NDArray[np.int64]) -> Array:
            """The factor by which the window changes the amplitude of a wave."""
            from scipy.special import i0

            root = np.sqrt(BETA**2 - (math.pi * WIDTH / count * index) ** 2)
            return np.asarray(WIDTH * np.sinh(root) / root / i0(BETA))

        return _sum_on_grid(count, i, j, waves / response(i) / response(j))


def points_for(period: float, shortest: float) -> int:
    """Points along a side of the grid on which waves down to `shortest` [m] are summed."""
    from scipy.fft import next_fast_len

    most = math.floor(period / shortest * (1.0 + ROUNDING))
    return int(next_fast_len(max(2 * (2 * most + 1), 2 * WIDTH), real=True))


def surface_bytes(period: float, shortest: float) -> float:
    """Largest memory [bytes] of such a face while heights are computed: amplitudes and their sum."""
    return 3.0 * 8.0 * points_for(period, shortest) ** 2


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _sum_on_grid(count: int, i: NDArray[np.int64], j: NDArray[np.int64], waves: NDArray[np.complex128]) -> Array:
    """The sum of waves with half amplitudes `waves` at count x count points of a period, [y, x], from the axis on."""
    from scipy.fft import irfft2

    spectrum = np.zeros((count, count // 2 + 1), complex)
    spectrum[j, i] = waves
    lone = i == 0
    spectrum[-j[lone], 0] = np.conj(waves[lone])
    return np.asarray(irfft2(spectrum, (count, count), norm="forward", overwrite_x=True))
