"""Free (non-periodic) elastomers: displacement around one loaded square cell of the grid.

A traction that is constant on each cell displaces the centre of cell i by `u_i = sum_j kernel(x_i - x_j) f_j`, with the
surface far away at rest, u(r -> infinity) = 0. The kernels are even in dx and in dy.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .film import Base, ratio_deficit, require_film
from .halfspace import require_positive

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

FAR = 12.0  # cells; from here on a Gauss rule is closer to the integral of 1/r than Love's difference of large terms
FAR_NODES = 4  # per direction: error below 1e-13 at FAR

TABLE_REACH = 36.0  # film thicknesses; the slowest decay (bonded, incompressible) is exp(-0.78 r/h): 1e-13 is left
TABLE_STEP = 0.0125
HIGHEST_WAVE_NUMBER = 25.0  # times thickness: ratio_deficit is 1e-18 there
PANEL_WIDTH = 0.25
"""Width of a panel of the Hankel integral, over x = q h."""
PANEL_NODES = 14
"""Gauss nodes of a panel."""
COARSEST_CELL = 2.0
"""Largest grid spacing, in film thicknesses."""


def _corner(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Integral of 1/r over the rectangle from the origin to (x, y), odd in both: x asinh(y/|x|) + y asinh(x/|y|)."""
    safe_x, safe_y = np.where(x == 0, 1.0, np.abs(x)), np.where(y == 0, 1.0, np.abs(y))
    return x * np.arcsinh(y / safe_x) + y * np.arcsinh(x / safe_y)


def inverse_distance_over_cell(
    dx: NDArray[np.float64], dy: NDArray[np.float64], width: float, height: float
) -> NDArray[np.float64]:
    """Integral of 1/r over a rectangle (width along x, height along y) whose centre lies at (dx, dy) [length].

    Love, Phil. Trans. R. Soc. A 228 (1929) 377, close by; far away, where his four corner terms of size r must cancel
    to an area over r, a Gauss rule of positive terms. Shape of dx and dy, which must be equal; real space.
    """
    result = np.empty(dx.shape)
    near = np.hypot(dx, dy) < FAR * max(width, height)
    x, y = dx[near], dy[near]
    left, right, low, high = x - width / 2, x + width / 2, y - height / 2, y + height / 2
    result[near] = _corner(right, high) - _corner(left, high) - _corner(right, low) + _corner(left, low)
    x, y = dx[~near], dy[~near]
    far = np.zeros(x.shape)
    nodes, weights = np.polynomial.legendre.leggauss(FAR_NODES)
    for node_x, weight_x in zip(nodes, weights, strict=True):
        for node_y, weight_y in zip(nodes, weights, strict=True):
            far += weight_x * weight_y / np.hypot(x + node_x * width / 2, y + node_y * height / 2)
    result[~near] = width * height / 4 * far
    return result


@dataclass(frozen=True)
class FreeHalfSpace:
    """Half-space without periodic images: `u(r) = int f(r') / (pi E* sx sy |S^-1 (r - r')|) d^2r'`, S = diag(sx, sy).

    contact_modulus: E* [Pa]; prestrain: (sx, sy) as in HalfSpace, whose inverse Fourier transform this is.
    """

    contact_modulus: float
    prestrain: tuple[float, float] = (1.0, 1.0)
    is_free: ClassVar[bool] = True

    def __post_init__(self) -> None:
        require_positive(contact_modulus=self.contact_modulus)
        require_positive(**{f"prestrain[{axis}]": factor for axis, factor in enumerate(self.prestrain)})

    def kernel(self, dx: ArrayLike, dy: ArrayLike, spacing: float) -> NDArray[np.float64]:
        """Displacement [m/Pa] at the offset (dx, dy) from the centre of a cell under unit traction; real space.

        dx, dy: offsets [m], broadcast together to the shape of the result. spacing: side of the square cell [m].
        Relative error below 1e-12 at any distance.
        """
        require_positive(spacing=spacing)
        stretch_x, stretch_y = self.prestrain
        x, y = np.broadcast_arrays(np.asarray(dx, dtype=float) / stretch_x, np.asarray(dy, dtype=float) / stretch_y)
        cell = inverse_distance_over_cell(x, y, spacing / stretch_x, spacing / stretch_y)
        return cell / (math.pi * self.contact_modulus)


@lru_cache(maxsize=8)
def deficit_table(poisson_ratio: float, base: Base) -> BSpline:
    """Spline through `D(s) = int_0^inf (1 - R(x)) J0(x s) dx`, 0 <= s = r/h <= TABLE_REACH; tends to 1/s.

    Fifth order, because the function is analytic and the step may then be coarse: error below 1e-11. The table runs a
    few steps to s < 0, where the function is even, so that s = 0 is no end of the spline.
    """
    # Not at the top: a half-space need not load them.
    from scipy.interpolate import make_interp_spline
    from scipy.special import j0

    nodes, weights = np.polynomial.legendre.leggauss(PANEL_NODES)
    starts = np.arange(0, HIGHEST_WAVE_NUMBER, PANEL_WIDTH)
    x = (starts[:, np.newaxis] + PANEL_WIDTH * (1 + nodes) / 2).ravel()
    weighted = np.tile(weights * PANEL_WIDTH / 2, starts.size) * ratio_deficit(x, poisson_ratio, base)
    s = TABLE_STEP * np.arange(-6, math.ceil((TABLE_REACH + 2 * COARSEST_CELL) / TABLE_STEP))
    return make_interp_spline(s, np.array([j0(x * distance) @ weighted for distance in s]), k=5)


@dataclass(frozen=True)
class FreeFilm:
    """Film without periodic images: half-space kernel minus `spacing^2 / (pi E* h) D(r/h)`, averaged over the cell.

    D is the Hankel transform of the difference between the two compliances (see `deficit_table`). It is smooth on the
    scale of h, so a Gauss rule of few nodes averages it over the cell.

    youngs_modulus: E [Pa]; poisson_ratio: nu; thickness: h [m]; base: "bonded" or "sliding", as in Film.
    """

    youngs_modulus: float
    poisson_ratio: float
    thickness: float
    base: Base = "bonded"
    is_free: ClassVar[bool] = True

    def __post_init__(self) -> None:
        require_film(self.youngs_modulus, self.poisson_ratio, self.thickness, self.base)

    @property
    def contact_modulus(self) -> float:
        """E* = E/(1 - nu^2) [Pa]."""
        return self.youngs_modulus / (1 - self.poisson_ratio**2)

    def kernel(self, dx: ArrayLike, dy: ArrayLike, spacing: float) -> NDArray[np.float64]:
        """Displacement [m/Pa] at the offset (dx, dy) from the centre of a cell under unit traction; real space.

        dx, dy: offsets [m], broadcast together to the shape of the result. spacing: side of the square cell [m].
        Error below 1e-10 of the value at offset 0. Raises ValueError when the cell is wider than two thicknesses.
        """
        require_positive(spacing=spacing)
        if spacing > COARSEST_CELL * self.thickness:
            raise ValueError(
                f"spacing = {spacing:.6g} m: expected at most {COARSEST_CELL:g} film thicknesses "
                f"({COARSEST_CELL * self.thickness:.6g} m); refine the grid"
            )
        x, y = np.broadcast_arrays(np.asarray(dx, dtype=float), np.asarray(dy, dtype=float))
        result = np.zeros(x.shape)
        near = np.hypot(x, y) <= TABLE_REACH * self.thickness
        x, y = x[near], y[near]
        cell = inverse_distance_over_cell(x, y, spacing, spacing)
        cell -= spacing**2 / self.thickness * self._mean_deficit(x, y, spacing)
        result[near] = cell / (math.pi * self.contact_modulus)
        return result

    def _mean_deficit(self, x: NDArray[np.float64], y: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
        """Average of D(r/h) over the cell centred at (x, y)."""
        table = deficit_table(self.poisson_ratio, self.base)
        half = spacing / (2 * self.thickness)
        # D is analytic for |Im s| < 2, so n nodes leave an error of about (4/half)^(-2n)
        count = math.ceil(math.log(1e12) / (2 * math.log(4 / half)))
        nodes, weights = np.polynomial.legendre.leggauss(count)
        mean = np.zeros(x.shape)
        for node_x, weight_x in zip(nodes, weights, strict=True):
            for node_y, weight_y in zip(nodes, weights, strict=True):
                distance = np.hypot(x / self.thickness + half * node_x, y / self.thickness + half * node_y)
                mean += weight_x * weight_y / 4 * table(distance)
        return mean
