"""Rigid power-law indenters, z(r) = (R/n) (r/R)^n as in the paper, on an elastic half-space; n = 2 is the paraboloid.

    delta_0(a) = sqrt(pi) Gamma(n/2 + 1)/Gamma((n + 1)/2) z(a),    F_0(a) = 2 n/(n + 1) E* a delta_0(a)
    with adhesion of zero range: delta = delta_0 - sqrt(2 pi w a/E*),  F = F_0 - sqrt(8 pi w E* a^3)

Lengths in m, E* in Pa, w in J/m^2, forces in N (compression positive); n > 1/2 (`exponent`).
Sources: I. N. Sneddon, Int. J. Eng. Sci. 3 (1965) 47, doi:10.1016/0020-7225(65)90019-4; for the adhesive term
D. Maugis, M. Barquins, J. Phys. D 16 (1983) 1843, doi:10.1088/0022-3727/16/10/010.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaln


def height(distance: ArrayLike, radius: float, exponent: float) -> NDArray:
    """Profile z(r) of the indenter (m)."""
    return radius / exponent * (np.asarray(distance, dtype=float) / radius) ** exponent


def indentation(
    contact_radius: ArrayLike,
    radius: float,
    exponent: float,
    contact_modulus: float = 1.0,
    work_of_adhesion: float = 0.0,
) -> NDArray:
    """Indentation (m) at a contact radius a (m); E* matters only with adhesion."""
    a = np.asarray(contact_radius, dtype=float)
    factor = np.sqrt(np.pi) * np.exp(gammaln(exponent / 2 + 1) - gammaln((exponent + 1) / 2))
    return factor * height(a, radius, exponent) - np.sqrt(2 * np.pi * work_of_adhesion * a / contact_modulus)


def force(
    contact_radius: ArrayLike, radius: float, exponent: float, contact_modulus: float, work_of_adhesion: float = 0.0
) -> NDArray:
    """Normal force (N) at a contact radius a (m)."""
    a = np.asarray(contact_radius, dtype=float)
    repulsive = 2 * exponent / (exponent + 1) * contact_modulus * a * indentation(a, radius, exponent)
    return repulsive - np.sqrt(8 * np.pi * work_of_adhesion * contact_modulus * a**3)


def pull_off_force(radius: float, exponent: float, contact_modulus: float, work_of_adhesion: float) -> float:
    """Smallest force (N, negative), where dF/da = 0: -S a^(3/2) (2n - 1)/(2n + 2), S^2 = 8 pi w E*.

    Raises ValueError for n <= 1/2, where there is no minimum.
    """
    if not exponent > 0.5:
        raise ValueError(f"exponent must be > 1/2 for a finite pull-off force, got {exponent}")
    adhesive = np.sqrt(8 * np.pi * work_of_adhesion * contact_modulus)
    repulsive = float(force(radius, radius, exponent, contact_modulus)) / radius ** (exponent + 1)
    a = (1.5 * adhesive / ((exponent + 1) * repulsive)) ** (1 / (exponent - 0.5))
    return -float(adhesive * a**1.5 * (2 * exponent - 1) / (2 * exponent + 2))
