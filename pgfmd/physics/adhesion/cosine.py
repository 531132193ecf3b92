"""The paper's law ("Modeling adhesion"), with the work of adhesion gamma and the range rho:

    Gamma(g) = -gamma (1 + cos(pi g / rho)) / 2       0 <= g < rho
             = -gamma (1 - (pi g / rho)^2 / 4)        g < 0
             = 0                                      g >= rho

Gamma' and Gamma'' are continuous at g = 0; Gamma'' jumps at g = rho. The largest stiffness, and that of overlaps, is
K_0 = gamma pi^2 / (2 rho^2), the strength pi gamma / (2 rho), at rho/2.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from .base import CohesiveLaw
from .functions import clipped, cosine_of, sine_of


class CosineNumbers(NamedTuple):
    """K_0 [Pa/m], of overlaps too, rho [m], and K_0 rho^2 [J/m^2]."""

    overlap: float
    reach: float
    stiffness: float
    scale: float


class Cosine(CohesiveLaw):
    """The paper's law."""

    name = "cosine"
    meaning = "the paper's law"
    strength_note = "pi gamma/(2 rho)"

    @classmethod
    def stiffness_number(cls, adhesion: Any) -> float:
        return math.pi**2 / 2.0

    @property
    def numbers(self) -> CosineNumbers:
        stiffness = self.work_of_adhesion * math.pi**2 / (2.0 * self.range**2)
        return CosineNumbers(stiffness, self.range, stiffness, self.range * stiffness * self.range)

    @property
    def length(self) -> float:
        """rho [m]."""
        return self.range

    @property
    def strength(self) -> float:
        """sigma_th = pi gamma / (2 rho) [Pa]."""
        return math.pi * self.work_of_adhesion / (2.0 * self.range)

    @property
    def contact_gap(self) -> float:
        """rho/2 [m]."""
        return 0.5 * self.range


def attraction(gap: Any, law: Any) -> Any:
    strength = law.stiffness * law.reach / math.pi
    depth = strength * law.reach / math.pi
    # pi gap/rho = pi y + pi/2, within reach of the attraction.
    y = clipped(gap * (1.0 / law.reach), 0.0, 1.0) - 0.5
    sine, minus_cosine = cosine_of(y * y), y * sine_of(y * y)
    return strength * sine, -law.stiffness * minus_cosine, depth, minus_cosine - 1.0


def energy(gap: Any, law: Any) -> Any:
    y = clipped(gap * (1.0 / law.reach), 0.0, 1.0) - 0.5
    return law.scale / math.pi**2, y * sine_of(y * y) - 1.0


def stiffness(gap: Any, law: Any) -> Any:
    y = clipped(gap / law.reach, 0.0, 1.0) - 0.5
    return -law.stiffness * (y * sine_of(y * y))
