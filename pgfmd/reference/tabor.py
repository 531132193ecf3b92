"""Tabor parameters: the reach at which adhesion turns from short- to long-ranged, over the actual range rho.

    mu_T = R^beta (w/E*)^(1 - beta) / rho,   beta = (n - 1)/(2n - 1) for a profile that grows like r^n

n = 2 gives Tabor's R^(1/3) (w/E*)^(2/3)/rho for an asperity, n -> inf sqrt(a w/E*)/rho for a flat punch of radius a.
Lengths in m, E* in Pa, w in J/m^2. Source: the paper, section "Modeling adhesion".
"""

from __future__ import annotations

import numpy as np


def power_law(
    radius: float, contact_modulus: float, work_of_adhesion: float, range_of_adhesion: float, exponent: float
) -> float:
    """Tabor parameter of an indenter with z = (R/n) (r/R)^n; `exponent` n may be infinite."""
    beta = 0.5 if np.isinf(exponent) else (exponent - 1) / (2 * exponent - 1)
    return float(radius**beta * (work_of_adhesion / contact_modulus) ** (1 - beta) / range_of_adhesion)


def asperity(radius: float, contact_modulus: float, work_of_adhesion: float, range_of_adhesion: float) -> float:
    """Tabor parameter of a parabolic summit with curvature radius R (m)."""
    return power_law(radius, contact_modulus, work_of_adhesion, range_of_adhesion, 2)


def flat_punch(punch_radius: float, contact_modulus: float, work_of_adhesion: float, range_of_adhesion: float) -> float:
    """Tabor parameter of a flat punch of radius a (m)."""
    return power_law(punch_radius, contact_modulus, work_of_adhesion, range_of_adhesion, np.inf)


def theoretical_strength(work_of_adhesion: float, range_of_adhesion: float) -> float:
    """Largest adhesive stress (Pa) of the paper's cohesive law, pi w/(2 rho)."""
    return np.pi * work_of_adhesion / (2 * range_of_adhesion)
