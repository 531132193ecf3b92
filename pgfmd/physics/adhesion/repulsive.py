"""A wall without attraction: Gamma = K_0 g^2 / 2 for g < 0, else 0. K_0 = gamma pi^2 / (2 rho^2) as for overlaps of the
paper's law, or as given in the scene."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from .base import CohesiveLaw
from .functions import clipped, sine_of


class RepulsiveNumbers(NamedTuple):
    """K_o [Pa/m], a reach of 0, K_0 [Pa/m] and rho [m]; and a zero that is not a compile-time constant, because
    compilers would otherwise sum in another order."""

    overlap: float
    reach: float
    stiffness: float
    range: float
    nothing: float = 0.0


class Repulsive(CohesiveLaw):
    """Only the overlap of the paper's law."""

    name = "repulsive"
    meaning = "its harmonic overlap alone"
    attractive = False
    optional = CohesiveLaw.optional | {"overlap_stiffness"}

    @classmethod
    def stiffness_number(cls, adhesion: Any) -> float:
        return math.pi**2 / 2.0

    @property
    def numbers(self) -> RepulsiveNumbers:
        stiffness = self.work_of_adhesion * math.pi**2 / (2.0 * self.range**2)
        return RepulsiveNumbers(self.own_overlap_stiffness or stiffness, 0.0, stiffness, self.range)

    @property
    def length(self) -> float:
        """rho [m]."""
        return self.range

    @property
    def strength(self) -> float:
        return 0.0

    @property
    def contact_gap(self) -> float:
        return 0.0


def attraction(gap: Any, law: Any) -> Any:
    return law.nothing, law.overlap, law.nothing, 1.0


def energy(gap: Any, law: Any) -> Any:
    # Zero times the terms of the cosine. With fewer operations, compilers would sum overlaps in another order, and
    # change bits.
    y = clipped(gap * (1.0 / law.range), 0.0, 1.0) - 0.5
    return law.nothing, y * sine_of(y * y) - 1.0


def stiffness(gap: Any, law: Any) -> Any:
    return law.overlap
