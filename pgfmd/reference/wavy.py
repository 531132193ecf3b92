"""A rigid one-dimensional sinusoid pressed on an elastic half-space: Westergaard without, Johnson with adhesion.

Punch profile of amplitude A and wave number q = 2 pi/l (m, rad/m), E* in Pa. Contact strips of half-width b around the
summits, contact fraction c = 2 b/l; mean pressure P, and the pressure p* = E* q A/2 that closes the contact completely:

    P = p* sin^2(pi c/2) - sqrt((2 E* w/l) tan(pi c/2))
    p(x) = 2 P cos(q x/2) / sin^2(pi c/2) sqrt(sin^2(pi c/2) - sin^2(q x/2))        (w = 0)

Sources: H. M. Westergaard, J. Appl. Mech. 6 (1939) A49; K. L. Johnson, Int. J. Solids Struct. 32 (1995) 423,
doi:10.1016/0020-7683(94)00111-9.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def full_contact_pressure(amplitude: float, wave_number: float, contact_modulus: float) -> float:
    """Mean pressure p* (Pa) that just closes a non-adhesive contact; also the amplitude of the pressure then."""
    return contact_modulus * wave_number * amplitude / 2


def contact_fraction(mean_pressure: ArrayLike, amplitude: float, wave_number: float, contact_modulus: float) -> NDArray:
    """Contact fraction c in [0, 1] without adhesion at a mean pressure (Pa)."""
    ratio = np.asarray(mean_pressure, dtype=float) / full_contact_pressure(amplitude, wave_number, contact_modulus)
    return 2 / np.pi * np.arcsin(np.sqrt(np.clip(ratio, 0, 1)))


def mean_pressure(
    contact_fraction: ArrayLike,
    amplitude: float,
    wave_number: float,
    contact_modulus: float,
    work_of_adhesion: float = 0.0,
) -> NDArray:
    """Mean pressure (Pa), compression positive, at a contact fraction in (0, 1); w in J/m^2."""
    angle = np.pi * np.asarray(contact_fraction, dtype=float) / 2
    adhesion = np.sqrt(contact_modulus * work_of_adhesion * wave_number / np.pi * np.tan(angle))
    return full_contact_pressure(amplitude, wave_number, contact_modulus) * np.sin(angle) ** 2 - adhesion


def pressure(
    position: ArrayLike, mean_pressure: float, amplitude: float, wave_number: float, contact_modulus: float
) -> NDArray:
    """Contact pressure (Pa) without adhesion at x (m) measured from a summit; partial or complete contact."""
    half_phase = wave_number * np.asarray(position, dtype=float) / 2
    closing = full_contact_pressure(amplitude, wave_number, contact_modulus)
    if mean_pressure >= closing:
        return mean_pressure + closing * np.cos(2 * half_phase)
    if mean_pressure <= 0:
        return np.zeros_like(half_phase)
    edge = mean_pressure / closing
    root = np.sqrt(np.maximum(edge - np.sin(half_phase) ** 2, 0))
    return 2 * mean_pressure * np.abs(np.cos(half_phase)) / edge * root
