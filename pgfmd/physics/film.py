"""Elastomer film of finite thickness on a rigid base: compliance of one wave number, in a periodic cell.

Plane strain, x = q h, free of shear at the top; the base either sticks (no displacement) or slides (no normal
displacement, no shear). Solving Navier's equations with those four conditions gives the film's compliance relative to
the half-space's 2/(q E*):

    bonded   R(x) = ((3 - 4 nu) sinh 2x - 2x) / ((3 - 4 nu) cosh 2x + 2 x^2 + 5 - 12 nu + 8 nu^2)
    sliding  R(x) = (cosh 2x - 1) / (sinh 2x + 2x)

(Carbone and Mangialardi, J. Mech. Phys. Solids 56 (2008) 684, write the bonded form). Here both are multiplied
through with 2 exp(-2x), so that nothing overflows, and arranged so that no difference of nearly equal terms is left.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .halfspace import require_positive

Base = Literal["bonded", "sliding"]
BASES: tuple[str, ...] = ("bonded", "sliding")


def require_film(youngs_modulus: float, poisson_ratio: float, thickness: float, base: str) -> None:
    """Raise ValueError naming the argument that does not describe a film."""
    require_positive(youngs_modulus=youngs_modulus, thickness=thickness)
    if not -1 < poisson_ratio <= 0.5:
        raise ValueError(f"poisson_ratio = {poisson_ratio!r}: expected -1 < poisson_ratio <= 0.5")
    if base not in BASES:
        raise ValueError(f"base = {base!r}: expected one of {', '.join(BASES)}")


def _sinh_excess(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """2 exp(-2x) (sinh 2x - 2x) for x >= 0; by its series below x = 1/2, where the difference would cancel."""
    y = 2 * x
    y2 = np.minimum(y, 1.0) ** 2
    series = np.ones_like(y2)
    for divisor in (272, 210, 156, 110, 72, 42, 20):  # 2k (2k + 1) for k = 8 to 2; the rest is below 1e-16
        series = 1 + y2 / divisor * series
    decay = np.exp(-y)
    return np.where(y < 1, decay * y * y2 / 3 * series, -np.expm1(-2 * y) - 2 * y * decay)


def _bonded_denominator(x: NDArray[np.float64], poisson_ratio: float) -> NDArray[np.float64]:
    decay = np.exp(-2 * x)
    offset = 5 - 12 * poisson_ratio + 8 * poisson_ratio**2
    return (3 - 4 * poisson_ratio) * (1 + decay**2) + 2 * decay * (2 * x**2 + offset)


def ratio_over_x(x: NDArray[np.float64], poisson_ratio: float, base: Base) -> NDArray[np.float64]:
    """R(x)/x, dimensionless, for x = q h > 0: compliance of the film in units of 2h/E*. Any shape."""
    decay = np.exp(-2 * x)
    if base == "bonded":
        stiffening = (3 - 4 * poisson_ratio) * _sinh_excess(x) / x + 8 * (1 - 2 * poisson_ratio) * decay
        return stiffening / _bonded_denominator(x, poisson_ratio)
    rise = -np.expm1(-2 * x)
    return rise / x * rise / (-np.expm1(-4 * x) + 4 * x * decay)


def ratio_deficit(x: NDArray[np.float64], poisson_ratio: float, base: Base) -> NDArray[np.float64]:
    """1 - R(x) for x = q h > 0, without the cancellation of that difference: 1 at x = 0, O(x^2 exp(-2x)) far out."""
    decay = np.exp(-2 * x)
    if base == "bonded":
        offset = 5 - 12 * poisson_ratio + 8 * poisson_ratio**2
        numerator = (3 - 4 * poisson_ratio) * decay + 2 * x * (1 + x) + offset
        return 2 * decay * numerator / _bonded_denominator(x, poisson_ratio)
    return 2 * decay * (2 * x - np.expm1(-2 * x)) / (-np.expm1(-4 * x) + 4 * x * decay)


@dataclass(frozen=True)
class Film:
    """Periodic film, `G0(q) = 2 R(q h) / (q E*)`; `G0(0) = h (1 + nu)(1 - 2 nu) / (E (1 - nu))`.

    The value at q = 0 is oedometric for both bases: a periodic cell can't widen as a whole. A bonded film tends to it
    as q -> 0; a sliding one tends to h (1 - nu^2)/E instead, because a long wave has room to flow sideways.

    youngs_modulus: E [Pa]; poisson_ratio: nu, at most 0.5; thickness: h [m]; base: "bonded" or "sliding".
    """

    youngs_modulus: float
    poisson_ratio: float
    thickness: float
    base: Base = "bonded"
    is_free: ClassVar[bool] = False

    def __post_init__(self) -> None:
        require_film(self.youngs_modulus, self.poisson_ratio, self.thickness, self.base)

    @property
    def contact_modulus(self) -> float:
        """E* = E/(1 - nu^2) [Pa], of the half-space that short waves see."""
        return self.youngs_modulus / (1 - self.poisson_ratio**2)

    @property
    def uniform_compliance(self) -> float:
        """G0(0) [m/Pa]: thickness over the oedometric modulus; zero when the film is incompressible."""
        nu = self.poisson_ratio
        return self.thickness * (1 + nu) * (1 - 2 * nu) / (self.youngs_modulus * (1 - nu))

    def __call__(self, qx: ArrayLike, qy: ArrayLike) -> NDArray[np.float64]:
        """Compliance [m/Pa], shape of qx and qy broadcast together; qx, qy: wave vector [rad/m], spectral space."""
        x = self.thickness * np.hypot(np.asarray(qx, dtype=float), np.asarray(qy, dtype=float))
        ratio = ratio_over_x(np.where(x > 0, x, 1.0), self.poisson_ratio, self.base)
        return np.where(x > 0, 2 * self.thickness / self.contact_modulus * ratio, self.uniform_compliance)
