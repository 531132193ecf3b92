"""The paper's two corrugations: summits, saddles and the energy of full contact.

    z_hex(x, y - sqrt(3) l/4)/z0 = (4/9) {3/2 + 2 cos(q x) cos(q y/sqrt(3)) + cos(2 q y/sqrt(3))}
    z_tri(x, y)/z0 = 2 - z_hex(x, y)/z0

with q = 2 pi/l. Both are three cosines of amplitude (4/9) z0 and true wave number Q = 2 q/sqrt(3), range 0 to 2 z0. The
punch hangs above the elastomer, so its summits, which touch first, are the points z = 0. There the height of
"hex" has two summits per cell (an open honeycomb with near saddles) and "tri" has one.
Amplitude z0 in m, wave_number q in rad/m, E* in Pa. Source: the paper, section "Reference model".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

# Q^2 = 4 q^2/3 and S = sum of the three cosines: S = 3 at its maximum (curvature -3 Q^2/2), -3/2 at its two minima
# (curvature +3 Q^2/4), -1 at its saddles; z_hex/z0 = (4/9)(3/2 + S).
SUMMIT_CURVATURE = {"tri": 8 / 9, "hex": 4 / 9}
SADDLE_HEIGHT = {"tri": 16 / 9, "hex": 2 / 9}
MEAN_HEIGHT = {"tri": 4 / 3, "hex": 2 / 3}


def _of_pattern(table: dict[str, float], pattern: str) -> float:
    if pattern not in table:
        raise ValueError(f"pattern must be one of {sorted(table)}, got {pattern!r}")
    return table[pattern]


def summit_radius(pattern: str, amplitude: float, wave_number: float) -> float:
    """Curvature radius (m) of the touching summits: 9/(8 z0 q^2) for "tri", 9/(4 z0 q^2) for "hex"."""
    return 1 / (_of_pattern(SUMMIT_CURVATURE, pattern) * amplitude * wave_number**2)


def saddle_height(pattern: str, amplitude: float) -> float:
    """How far (m) the saddles lie behind the summits: (16/9) z0 for "tri", (2/9) z0 for "hex"."""
    return _of_pattern(SADDLE_HEIGHT, pattern) * amplitude


def mean_height(pattern: str, amplitude: float) -> float:
    """Mean of z (m) over a cell: (4/3) z0 for "tri", (2/3) z0 for "hex"."""
    return _of_pattern(MEAN_HEIGHT, pattern) * amplitude


def full_contact_energy(amplitude: float, wave_number: float, contact_modulus: float) -> float:
    """Elastic energy per area (J/m^2) in static full contact, the same for both patterns: 4 E* q z0^2/(27 sqrt(3))."""
    height = 2 / 9 * amplitude
    return spectrum_energy(np.full(6, height), np.full(6, 2 * wave_number / np.sqrt(3)), contact_modulus)


def spectrum_energy(height_amplitudes: ArrayLike, wave_numbers: ArrayLike, contact_modulus: float) -> float:
    """(E*/4) sum_q q |z_q|^2 (J/m^2) over all waves, q and -q counted separately; z = sum_q z_q exp(i q.r) (m)."""
    heights = np.abs(np.asarray(height_amplitudes))
    return float(contact_modulus / 4 * np.sum(np.asarray(wave_numbers) * heights**2))


def reduced_surface_energy(
    amplitude: float, wave_number: float, contact_modulus: float, work_of_adhesion: float
) -> float:
    """Work of adhesion over the energy of full contact (dimensionless); below about 1/2 a surface isn't sticky."""
    return work_of_adhesion / full_contact_energy(amplitude, wave_number, contact_modulus)


def full_contact_pressure(pattern: str, amplitude: float, wave_number: float, contact_modulus: float) -> float:
    """Mean pressure (Pa) that just closes a static non-adhesive contact: (E* Q/2) (2 z0 - mean z), Q = 2 q/sqrt(3)."""
    depth = 2 * amplitude - mean_height(pattern, amplitude)
    return contact_modulus * wave_number / np.sqrt(3) * depth
