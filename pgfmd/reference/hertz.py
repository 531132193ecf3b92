"""Hertz: a rigid paraboloid z = r^2/(2R) on an elastic half-space without adhesion.

a^2 = R delta,  F = (4/3) E* sqrt(R) delta^(3/2),  p(r) = (2 E*/(pi R)) sqrt(a^2 - r^2).
Source: K. L. Johnson, Contact Mechanics (1985), section 4.2, doi:10.1017/CBO9781139171731.
Lengths in m, moduli in Pa, forces in N; array arguments broadcast. Without contact (delta <= 0) everything is 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def force(indentation: ArrayLike, radius: float, contact_modulus: float) -> NDArray:
    """Normal force (N), compression positive, at an indentation delta (m)."""
    delta = np.maximum(np.asarray(indentation, dtype=float), 0)
    return 4 / 3 * contact_modulus * np.sqrt(radius) * delta**1.5


def indentation(normal_force: ArrayLike, radius: float, contact_modulus: float) -> NDArray:
    """Indentation (m) under a normal force (N); the inverse of `force`."""
    load = np.maximum(np.asarray(normal_force, dtype=float), 0)
    return (3 * load / (4 * contact_modulus * np.sqrt(radius))) ** (2 / 3)


def contact_radius(indentation: ArrayLike, radius: float) -> NDArray:
    """Contact radius a = sqrt(R delta) (m)."""
    return np.sqrt(radius * np.maximum(np.asarray(indentation, dtype=float), 0))


def pressure(distance: ArrayLike, indentation: float, radius: float, contact_modulus: float) -> NDArray:
    """Contact pressure (Pa), compression positive, at a `distance` r (m) from the axis; 0 outside the contact."""
    square = radius * max(float(indentation), 0.0) - np.asarray(distance, dtype=float) ** 2
    return 2 * contact_modulus / (np.pi * radius) * np.sqrt(np.maximum(square, 0))


def elastic_energy(indentation: ArrayLike, radius: float, contact_modulus: float) -> NDArray:
    """Stored elastic energy (J), (8/15) E* sqrt(R) delta^(5/2)."""
    delta = np.maximum(np.asarray(indentation, dtype=float), 0)
    return 8 / 15 * contact_modulus * np.sqrt(radius) * delta**2.5
