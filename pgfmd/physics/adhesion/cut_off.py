"""Laws of infinite reach with a smooth cut-off. The traction is a multiple of h(x), x = g/rho, with h(0) = 0. A term is
subtracted so that the traction and its slope vanish at the cut-off x = X. It is negligible far below X:

    Gamma'(g) = (a/rho) (h(x) - y^7 (P + Q y)),              y = x/X,  P = 8 h(X) - X h'(X),  Q = X h'(X) - 7 h(X)
    A(g)      = a (H(x) - X y^8 (P/8 + Q y/9) - H_X),        H' = h,   H_X such that A = 0 at X

and a is such that A(0) = -gamma, the work of adhesion. A law is a module with the function `shape` (base.py).
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from .base import CohesiveLaw
from .functions import chosen

CUT_OFF = 12.0
"""X, the reach of these laws in ranges."""


class CutOffNumbers(NamedTuple):
    """K_o, the reach and the largest stiffness; 1/rho [1/m], a [J/m^2], P, Q and H_X."""

    overlap: float
    reach: float
    stiffness: float
    per_range: float
    depth: float
    first: float
    second: float
    end: float


class Constants(NamedTuple):
    """Of a shape, all in units of gamma and rho: P, Q and H_X; a; the largest stiffness, and the gap of the largest traction."""

    first: float
    second: float
    end: float
    depth: float
    stiffness: float
    peak: float


def constants_of(shape: Callable[[Any], Any]) -> Constants:
    """The constants of a shape, (h, h', H) of x, whose slope is largest at 0 and changes its sign once between 0 and
    2."""
    height, slope, area = shape(CUT_OFF)
    first, second = 8.0 * height - CUT_OFF * slope, CUT_OFF * slope - 7.0 * height
    end = area - CUT_OFF * (first / 8.0 + second / 9.0)
    _, steepest, start = shape(0.0)
    depth = 1.0 / (end - start)
    low, high = 0.0, 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        part = middle / CUT_OFF
        rising = shape(middle)[1] > part**6 * (7.0 * first + 8.0 * second * part) / CUT_OFF
        low, high = (middle, high) if rising else (low, middle)
    return Constants(*(float(one) for one in (first, second, end, depth, depth * steepest, low)))


@dataclass(frozen=True)
class CutOffLaw(CohesiveLaw):
    """A law of infinite reach with a smooth cut-off at `CUT_OFF` ranges."""

    optional = CohesiveLaw.optional | {"overlap_stiffness"}
    constants: ClassVar[Constants]
    """Constants of its shape."""
    kind: ClassVar[type[CutOffNumbers]]
    """The NamedTuple of its module, by which kernels find its functions."""

    @classmethod
    def stiffness_number(cls, adhesion: Any) -> float:
        return cls.constants.stiffness

    @functools.cached_property
    def numbers(self) -> CutOffNumbers:
        found, range_, gamma = self.constants, self.range, self.work_of_adhesion
        stiffness = gamma * found.stiffness / range_**2
        overlap = self.own_overlap_stiffness or stiffness
        shape = found.first, found.second, found.end
        return self.kind(overlap, CUT_OFF * range_, stiffness, 1.0 / range_, gamma * found.depth, *shape)

    @property
    def contact_gap(self) -> float:
        return self.constants.peak * self.range

    @property
    def strength(self) -> float:
        return float(self.traction(self.contact_gap))


def ended(gap: Any, x: Any, height: Any, slope: Any, area: Any, law: Any) -> Any:
    """Traction, stiffness and the factors of the energy at a gap, for h, h' and H at x."""
    y = x * (1.0 / CUT_OFF)
    sixth = y * y * y * (y * y * y)
    pull = law.depth * law.per_range * (height - sixth * y * (law.first + law.second * y))
    steepness = slope - sixth * (7.0 * law.first + 8.0 * law.second * y) * (1.0 / CUT_OFF)
    bend = law.depth * law.per_range * law.per_range * steepness
    level = area - CUT_OFF * sixth * y * y * (law.first / 8.0 + law.second * y / 9.0) - law.end
    return pull, chosen(gap < 0.0, law.overlap, bend), law.depth, level
