"""Static compliance u/f of a film of thickness h on a rigid base, by solving the elastic problem, and its limits.

Plane strain, wave number q, zeta = q times the height above the base, H = q h. With the Airy function
phi(zeta) cos(q x)/q^2: sigma_zz = -phi, sigma_xz = phi', 2 mu u_z = [(1 - nu) phi''' - (2 - nu) phi']/q and
2 mu u_x = [(1 - nu) phi'' + nu phi]/q (each times cos or sin); phi is a sum of exp(+-zeta) and zeta exp(+-zeta). At the
top sigma_zz = 1, sigma_xz = 0; at the base u_z = 0 and u_x = 0 ("bonded") or sigma_xz = 0 ("sliding").
The four-by-four system is an independent check of closed forms in hyperbolic functions. Compliances in m/Pa, E in Pa.
Source: any text on plane elasticity; for the results G. Carbone, L. Mangialardi, J. Mech. Phys. Solids 56 (2008) 684,
doi:10.1016/j.jmps.2007.05.009.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def half_space(wave_number: float, youngs_modulus: float, poisson_ratio: float) -> float:
    """Limit q h -> inf of either base: 2 (1 - nu^2)/(q E)."""
    return 2 * (1 - poisson_ratio**2) / (wave_number * youngs_modulus)


def oedometric(thickness: float, youngs_modulus: float, poisson_ratio: float) -> float:
    """Bonded film, q h -> 0, and any film at q = 0 in a periodic cell: h (1 + nu)(1 - 2 nu)/(E (1 - nu))."""
    nu = poisson_ratio
    return thickness * (1 + nu) * (1 - 2 * nu) / (youngs_modulus * (1 - nu))


def sliding_long_wave(thickness: float, youngs_modulus: float, poisson_ratio: float) -> float:
    """Sliding film, q h -> 0 (but q > 0, so that it can spread sideways): h (1 - nu^2)/E."""
    return thickness * (1 - poisson_ratio**2) / youngs_modulus


def incompressible_bonded_long_wave(wave_number: float, thickness: float, youngs_modulus: float) -> float:
    """Bonded film with nu = 1/2, q h -> 0: q^2 h^3/E, as in lubrication theory with the shear modulus E/3."""
    return wave_number**2 * thickness**3 / youngs_modulus


def _functions(zeta: float, top: float) -> NDArray:
    """phi, phi', phi'', phi''' (rows) of the four solutions (columns), scaled to be at most of order `top`."""
    growing, decaying = np.exp(zeta - top), np.exp(-zeta)
    rows = []
    for order in range(4):
        sign = (-1) ** order
        rows.append([growing, (zeta + order) * growing, sign * decaying, sign * (zeta - order) * decaying])
    return np.array(rows)


def compliance(wave_number: float, thickness: float, youngs_modulus: float, poisson_ratio: float, base: str) -> float:
    """Static compliance (m/Pa) at a wave number q > 0 (rad/m); base "bonded" or "sliding".

    Rounding grows for long waves, to about 1e-12 at q h = 0.01 (5e-10 where bonded and nu = 1/2), and as 1e-16 q h for
    short ones. Raises ValueError for another base or q <= 0.
    """
    if base not in ("bonded", "sliding"):
        raise ValueError(f"base must be 'bonded' or 'sliding', got {base!r}")
    if not wave_number > 0:
        raise ValueError(f"wave_number must be > 0, got {wave_number}; at q = 0 use oedometric")
    nu = poisson_ratio
    top = wave_number * thickness

    def vertical(phi: NDArray) -> NDArray:
        return (1 - nu) * phi[3] - (2 - nu) * phi[1]

    surface, bottom = _functions(top, top), _functions(0.0, top)
    side = bottom[1] if base == "sliding" else (1 - nu) * bottom[2] + nu * bottom[0]
    system = np.array([-surface[0], surface[1], vertical(bottom), side])
    coefficients = np.linalg.solve(system, [1.0, 0.0, 0.0, 0.0])
    shear_modulus = youngs_modulus / (2 * (1 + nu))
    return float(vertical(surface) @ coefficients / (2 * shear_modulus * wave_number))
