"""Dugdale's law, a constant traction sigma_0 = gamma/rho up to a gap of about rho, with smooth ends of the width w:

    Gamma'(g) = sigma_0 sin(pi g / (2 w))                    0 <= g < w
              = sigma_0                                      w <= g < g_1
              = sigma_0 (1 + cos(pi (g - g_1) / w)) / 2      g_1 <= g < g_1 + w
              = 0                                            beyond,     g_1 = rho + w/2 - 2 w/pi

so that the work of adhesion is gamma = sigma_0 rho. Both ends are equally stiff, pi sigma_0 / (2 w), the largest stiffness.
With w -> 0 this is the law of D. S. Dugdale, J. Mech. Phys. Solids 8 (1960) 100, doi:10.1016/0022-5096(60)90013-2, by which
D. Maugis, J. Colloid Interface Sci. 150 (1992) 243, doi:10.1016/0021-9797(92)90285-T, solved the sphere
(pgfmd.reference.maugis).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

from .base import PRESENT, CohesiveLaw
from .functions import chosen, clipped, cosine_of, sine_of

SMOOTHING = 0.2
"""Default of w/rho."""


class DugdaleNumbers(NamedTuple):
    """K_o, the reach and the largest stiffness; sigma_0 [Pa], rho [m], w [m], and g_1 [m], where the traction begins to
    decrease."""

    overlap: float
    reach: float
    stiffness: float
    strength: float
    range: float
    width: float
    fall: float


@dataclass(frozen=True)
class Dugdale(CohesiveLaw):
    """Dugdale's law with smooth ends. smoothing: w/rho."""

    smoothing: float = SMOOTHING

    name = "dugdale"
    meaning = "a constant traction, smoothed at its ends"
    strength_note = "gamma/rho"
    optional = CohesiveLaw.optional | {"smoothing", "overlap_stiffness"}

    known = ("smoothing",)

    @classmethod
    def of(cls, adhesion: Any) -> Self:
        return cls(adhesion.work_of_adhesion, adhesion.range, adhesion.overlap_stiffness, adhesion.smoothing)

    @classmethod
    def own_values(cls, adhesion: Any) -> dict[str, float]:
        return {"smoothing": SMOOTHING}

    @classmethod
    def stiffness_number(cls, adhesion: Any) -> float:
        return float(math.pi / (2.0 * adhesion.smoothing))

    @cached_property
    def numbers(self) -> DugdaleNumbers:
        strength, width = self.work_of_adhesion / self.range, self.smoothing * self.range
        fall, stiffness = self.range + (0.5 - 2.0 / math.pi) * width, math.pi * strength / (2.0 * width)
        overlap = self.own_overlap_stiffness or stiffness
        return DugdaleNumbers(overlap, fall + width, stiffness, strength, self.range, width, fall)

    @property
    def strength(self) -> float:
        """sigma_0 = gamma/rho [Pa]."""
        return self.work_of_adhesion / self.range

    @property
    def contact_gap(self) -> float:
        """w [m]."""
        return self.smoothing * self.range

    def facts(self) -> Iterator[tuple[str, float, str, str]]:
        yield "smooth ends of the traction", self.smoothing * self.range, "m", f"smoothing = {self.smoothing:g} rho"


def attraction(gap: Any, law: Any) -> Any:
    # Half of the rise, and the fall, as angles over pi.
    rise = 0.5 * clipped(gap / law.width, 0.0, 1.0)
    fall = clipped((gap - law.fall) / law.width, 0.0, 1.0) - 0.5
    cosine_rise, cosine_fall = cosine_of(rise * rise), cosine_of(fall * fall)
    traction = law.strength * (rise * sine_of(rise * rise) - 0.5 * (1.0 + fall * sine_of(fall * fall)))
    bend = law.stiffness * (cosine_rise - cosine_fall + PRESENT)
    area = 2.0 / math.pi * (1.0 - cosine_rise) - 0.5 * (fall + 0.5) + cosine_fall / (2.0 * math.pi)
    opened = clipped(gap, law.width, law.reach) - law.width + law.width * area
    return traction, chosen(gap < 0.0, law.overlap, bend), law.strength, opened - law.range


def energy(gap: Any, law: Any) -> Any:
    return attraction(gap, law)[2:]


def stiffness(gap: Any, law: Any) -> Any:
    return attraction(gap, law)[1]
