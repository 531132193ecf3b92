"""The cohesive law between punch and elastomer (paper, "Modeling adhesion").

Potential per area of a gap g, with the work of adhesion gamma and the range rho:

    Gamma(g) = -gamma (1 + cos(pi g / rho)) / 2       0 <= g < rho
             = -gamma (1 - (pi g / rho)^2 / 4)        g < 0
             = 0                                      g >= rho

The traction on the elastomer is f = Gamma'(g), positive when it pulls the surface up; the stiffness is K = Gamma''(g).
Gamma' and Gamma'' are continuous at g = 0; Gamma'' jumps at g = rho. `repulsive` keeps the harmonic overlap alone:
Gamma = K_0 g^2 / 2 for g < 0 with the same K_0 = gamma pi^2 / (2 rho^2).

A point is in contact where its gap is below `CohesiveLaw.contact_gap`, the gap of the largest traction: there the
surface is held, pulled harder the further it is drawn away (K > 0). This is the one place that says so.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

LAWS = {"cosine": True, "repulsive": False}
"""Names of the laws, and whether they attract."""


def range_of_adhesion(work_of_adhesion: float, contact_modulus: float, range_factor: float, q_ref: float) -> float:
    """The range rho [m] at which the law's largest stiffness is `range_factor * q_ref * contact_modulus`.

    work_of_adhesion [J/m^2], contact_modulus [Pa], q_ref [rad/m]. Source: the rule of the paper's "Modeling adhesion",
    gamma pi^2 / (2 rho^2) = c q_ref E*, solved for rho. With c = 0.156 and q_ref = 2 pi n / L it gives the paper's
    0.264 um (n = 2048) and 0.187 um (n = 4096); the factor 0.2 of its text does not.
    """
    return math.pi * math.sqrt(work_of_adhesion / (2.0 * range_factor * q_ref * contact_modulus))


@dataclass(frozen=True)
class CohesiveLaw:
    """Gamma, its slope and its curvature, for arrays of gaps [m]; plain NumPy, the oracle of the compiled kernels."""

    work_of_adhesion: float
    range: float
    attractive: bool = True

    def __post_init__(self) -> None:
        if not (self.work_of_adhesion > 0 and self.range > 0):
            raise ValueError("work_of_adhesion and range must be positive")

    @property
    def stiffness(self) -> float:
        """K_0 = gamma pi^2 / (2 rho^2) [Pa/m], the curvature for every g <= 0 and the largest anywhere."""
        return self.work_of_adhesion * math.pi**2 / (2.0 * self.range**2)

    @property
    def strength(self) -> float:
        """sigma_th = pi gamma / (2 rho) [Pa], the largest attractive traction of the cosine law."""
        return math.pi * self.work_of_adhesion / (2.0 * self.range)

    @property
    def reach(self) -> float:
        """The gap [m] from which on there is no traction."""
        return self.range if self.attractive else 0.0

    @property
    def contact_gap(self) -> float:
        """The gap [m] of the largest traction, below which a point is in contact: rho/2, or 0 for `repulsive`.

        Below it the law is on its stable side, Gamma'' > 0, and holds the surface; beyond it the traction falls as the
        gap grows. A surface that is held under tension has a gap between 0 and this one.
        """
        return 0.5 * self.range if self.attractive else 0.0

    def potential(self, gap: np.ndarray) -> np.ndarray:
        """Gamma(g) [J/m^2]; 0 out of reach, -gamma (cosine) or 0 (repulsive) at g = 0."""
        gap = np.asarray(gap, dtype=float)
        overlap = 0.5 * self.stiffness * np.minimum(gap, 0.0) ** 2
        if not self.attractive:
            return overlap
        near = -0.5 * self.work_of_adhesion * (1.0 + np.cos(math.pi * np.clip(gap / self.range, 0.0, 1.0)))
        return near + overlap

    def traction(self, gap: np.ndarray) -> np.ndarray:
        """f = Gamma'(g) [Pa]."""
        gap = np.asarray(gap, dtype=float)
        overlap = self.stiffness * np.minimum(gap, 0.0)
        if not self.attractive:
            return overlap
        return overlap + self.strength * np.sin(math.pi * np.clip(gap / self.range, 0.0, 1.0))

    def curvature(self, gap: np.ndarray) -> np.ndarray:
        """K = Gamma''(g) [Pa/m]."""
        gap = np.asarray(gap, dtype=float)
        if not self.attractive:
            return np.where(gap < 0.0, self.stiffness, 0.0)
        near = self.stiffness * np.cos(math.pi * np.clip(gap / self.range, 0.0, 1.0))
        return np.where(gap < self.range, near, 0.0)
