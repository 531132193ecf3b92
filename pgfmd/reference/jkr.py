"""JKR: a rigid paraboloid on an elastic half-space, adhesion of zero range.

    F(a)     = 4 E* a^3/(3 R) - sqrt(8 pi w E* a^3)
    delta(a) = a^2/R - sqrt(2 pi w a/E*)
    p(r)     = (2 a E*/(pi R)) sqrt(1 - r^2/a^2) - sqrt(2 w E*/(pi a)) / sqrt(1 - r^2/a^2)

with the contact radius a as the parameter. Lengths in m, E* in Pa, w in J/m^2, forces in N (compression positive).
Source: K. L. Johnson, K. Kendall, A. D. Roberts, Proc. R. Soc. A 324 (1971) 301, doi:10.1098/rspa.1971.0141.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Instability(NamedTuple):
    """The last stable state before the contact breaks: force (N, < 0), indentation (m, < 0), contact radius (m)."""

    force: float
    indentation: float
    contact_radius: float


def force(contact_radius: ArrayLike, radius: float, contact_modulus: float, work_of_adhesion: float) -> NDArray:
    """Normal force (N) at a contact radius a (m)."""
    a = np.asarray(contact_radius, dtype=float)
    return 4 * contact_modulus * a**3 / (3 * radius) - np.sqrt(8 * np.pi * work_of_adhesion * contact_modulus * a**3)


def indentation(contact_radius: ArrayLike, radius: float, contact_modulus: float, work_of_adhesion: float) -> NDArray:
    """Indentation (m) at a contact radius a (m)."""
    a = np.asarray(contact_radius, dtype=float)
    return a**2 / radius - np.sqrt(2 * np.pi * work_of_adhesion * a / contact_modulus)


def pressure(
    distance: ArrayLike, contact_radius: float, radius: float, contact_modulus: float, work_of_adhesion: float
) -> NDArray:
    """Contact pressure (Pa), compression positive, at a distance r < a (m); -inf at the edge, 0 outside."""
    r = np.asarray(distance, dtype=float)
    a = float(contact_radius)
    root = np.sqrt(np.maximum(1 - (r / a) ** 2, 0))
    with np.errstate(divide="ignore"):
        edge = np.sqrt(2 * work_of_adhesion * contact_modulus / (np.pi * a)) / root
    return np.where(r <= a, 2 * a * contact_modulus / (np.pi * radius) * root - edge, 0.0)


def compressed_radius(
    contact_radius: ArrayLike, radius: float, contact_modulus: float, work_of_adhesion: float
) -> NDArray:
    """Radius (m) within which the contact is pressed, where p = 0: r^2 = a^2 (1 - sqrt(pi w R^2/(2 E* a^3))).

    The ring from there to a is pulled. 0 where all of the contact is.
    """
    a = np.asarray(contact_radius, dtype=float)
    pressed = 1 - np.sqrt(np.pi * work_of_adhesion * radius**2 / (2 * contact_modulus * a**3))
    return a * np.sqrt(np.maximum(pressed, 0.0))


def contact_radius_at_force(
    normal_force: ArrayLike, radius: float, contact_modulus: float, work_of_adhesion: float
) -> NDArray:
    """Contact radius (m) on the branch that is stable under a given force (N); nan below the pull-off force."""
    load = np.asarray(normal_force, dtype=float)
    adhesion = 3 * np.pi * work_of_adhesion * radius
    with np.errstate(invalid="ignore"):
        root = np.sqrt(2 * adhesion * load + adhesion**2)
    return np.cbrt(3 * radius / (4 * contact_modulus) * (load + adhesion + root))


def contact_radius_at_indentation(
    indentation: ArrayLike, radius: float, contact_modulus: float, work_of_adhesion: float
) -> NDArray:
    """Contact radius (m) on the branch that is stable at a given indentation (m); nan beyond the snap-off.

    With y = sqrt(a): y^4/R - c y - delta = 0, c^2 = 2 pi w/E*. The left side is convex, so Newton's method comes down
    monotonically from any point above the largest root.
    """
    delta = np.asarray(indentation, dtype=float)
    c = np.sqrt(2 * np.pi * work_of_adhesion / contact_modulus)
    stable = delta >= displacement_controlled_pull_off(radius, contact_modulus, work_of_adhesion).indentation
    y = np.maximum((2 * radius * np.maximum(delta, 0)) ** 0.25, np.cbrt(2 * radius * c))
    for _ in range(100):
        slope = 4 * y**3 / radius - c
        step = (y**4 / radius - c * y - delta) / np.where(slope > 0, slope, np.inf)
        if np.all((step <= 1e-15 * y) | ~stable):
            break
        y = np.where(stable, y - np.maximum(step, 0), y)
    return np.where(stable, y**2, np.nan)


def load_controlled_pull_off(radius: float, contact_modulus: float, work_of_adhesion: float) -> Instability:
    """Where dF/da = 0: F = -(3/2) pi w R, a^3 = 9 pi w R^2/(8 E*), delta = -a^2/(3 R)."""
    a = float(np.cbrt(9 * np.pi * work_of_adhesion * radius**2 / (8 * contact_modulus)))
    return Instability(-1.5 * np.pi * work_of_adhesion * radius, -(a**2) / (3 * radius), a)


def displacement_controlled_pull_off(radius: float, contact_modulus: float, work_of_adhesion: float) -> Instability:
    """Where d delta/da = 0: F = -(5/6) pi w R, a^3 = pi w R^2/(8 E*), delta = -3 a^2/R."""
    a = float(np.cbrt(np.pi * work_of_adhesion * radius**2 / (8 * contact_modulus)))
    return Instability(-5 / 6 * np.pi * work_of_adhesion * radius, -3 * a**2 / radius, a)
