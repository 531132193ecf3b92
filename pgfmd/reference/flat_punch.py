"""A rigid, flat, cylindrical punch of radius a on an elastic half-space, with and without adhesion.

    F = 2 a E* delta,   p(r) = E* delta/(pi sqrt(a^2 - r^2)),   u(r >= a) = (2 delta/pi) arcsin(a/r)

The adhesive contact stays complete until F = -sqrt(8 pi E* w a^3) and then breaks at once. The work done until then is
w times twice the area, whatever E*: the elastic energy at the instability equals the energy of the new surfaces.
Lengths in m, E* in Pa, w in J/m^2, forces in N (compression positive).
Sources: K. L. Johnson, Contact Mechanics (1985), section 3.4; K. Kendall, J. Phys. D 4 (1971) 1186,
doi:10.1088/0022-3727/4/8/320.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def force(indentation: ArrayLike, punch_radius: float, contact_modulus: float) -> NDArray:
    """Normal force (N) in complete contact; negative indentations pull."""
    return 2 * punch_radius * contact_modulus * np.asarray(indentation, dtype=float)


def pressure(distance: ArrayLike, indentation: float, punch_radius: float, contact_modulus: float) -> NDArray:
    """Contact pressure (Pa), compression positive, at a distance r (m) from the axis; infinite at r = a, 0 outside."""
    square = punch_radius**2 - np.asarray(distance, dtype=float) ** 2
    with np.errstate(divide="ignore"):
        inside = contact_modulus * indentation / (np.pi * np.sqrt(np.maximum(square, 0)))
    return np.where(square >= 0, inside, 0.0)


def surface_displacement(distance: ArrayLike, indentation: float, punch_radius: float) -> NDArray:
    """Displacement of the surface into the elastomer (m) at a distance r (m) from the axis."""
    r = np.maximum(np.asarray(distance, dtype=float), punch_radius)
    return 2 * indentation / np.pi * np.arcsin(punch_radius / r)


def pull_off_force(punch_radius: float, contact_modulus: float, work_of_adhesion: float) -> float:
    """Kendall's force (N, negative) at which the contact breaks, under load and under displacement control alike."""
    return -float(np.sqrt(8 * np.pi * contact_modulus * work_of_adhesion * punch_radius**3))


def pull_off_indentation(punch_radius: float, contact_modulus: float, work_of_adhesion: float) -> float:
    """Indentation (m, negative) at which the contact breaks, -sqrt(2 pi w a/E*)."""
    return -float(np.sqrt(2 * np.pi * work_of_adhesion * punch_radius / contact_modulus))


def work_of_separation(punch_radius: float, work_of_adhesion: float) -> float:
    """Work (J) done on the punch from zero force to the break, 2 pi a^2 w."""
    return 2 * np.pi * punch_radius**2 * work_of_adhesion


def effective_work_of_adhesion(pull_off_force: float, punch_radius: float, contact_modulus: float) -> float:
    """Work of adhesion (J/m^2) with which a perfectly flat punch would break at `pull_off_force` (N, either sign)."""
    return pull_off_force**2 / (8 * np.pi * contact_modulus * punch_radius**3)
