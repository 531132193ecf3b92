"""One Fourier mode of a linear viscoelastic surface: responses to steps, ramps and oscillations.

The displacement u (m) follows the traction f (Pa) through u = G0 f/kappa(s), with the static compliance G0 (m/Pa) of
the mode (half-space: 2/(q E*)) and the modulus ratio kappa. Everything starts from rest at time 0 and is 0 before.
`time` (s) has any shape and the result has the same.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgfmd.physics.rheology import CreepSeries, PronySeries


def creep(time: ArrayLike, traction: float, compliance: float, series: CreepSeries) -> NDArray:
    """Displacement (m) after a traction step (Pa): G0 f [J_inf + sum J_m (1 - exp(-t/lambda_m))]."""
    return compliance * traction * series.creep(time)


def relaxation(time: ArrayLike, displacement: float, compliance: float, series: PronySeries) -> NDArray:
    """Traction (Pa) after a displacement step (m): u/G0 [1 + sum kappa_n exp(-t/tau_n)]."""
    return displacement / compliance * series.relaxation(time)


def traction_ramp(time: ArrayLike, traction_rate: float, compliance: float, series: CreepSeries) -> NDArray:
    """Displacement (m) when the traction grows at a constant rate (Pa/s): the integral of `creep`."""
    t = np.maximum(np.asarray(time, dtype=float), 0)
    decayed = -np.expm1(-np.multiply.outer(t, 1 / series.retardation_times))
    weights = series.J.sum() + series.J_inf
    return compliance * traction_rate * (weights * t - decayed @ (series.J * series.retardation_times))


def displacement_ramp(time: ArrayLike, velocity: float, compliance: float, series: PronySeries) -> NDArray:
    """Traction (Pa) when the displacement grows at a constant velocity (m/s): the integral of `relaxation`."""
    t = np.maximum(np.asarray(time, dtype=float), 0)
    decayed = -np.expm1(-np.multiply.outer(t, 1 / series.tau))
    return velocity / compliance * (t + decayed @ (series.kappa * series.tau))


def dissipation_per_cycle(displacement: float, omega: ArrayLike, compliance: float, series: PronySeries) -> NDArray:
    """Energy per area (J/m^2) lost in one cycle of u = U cos(omega t) cos(q x), averaged over x: (pi/2) U^2 E''/G0."""
    return np.pi / 2 * displacement**2 / compliance * series.loss(omega)


def gfmd_modulus(omega: ArrayLike, series: PronySeries, gfmd_frequency: float) -> NDArray:
    """Complex modulus ratio with the auxiliary mass and damping of the paper's scheme, critically damped.

    kappa(omega) - kappa_inf (omega/omega_G)^2 + 2 i kappa_inf omega/omega_G, with omega_G = sqrt(k_inf/m) =
    `gfmd_frequency` and omega in rad/s: the damping adds a dashpot 2 kappa_inf/omega_G to sum kappa_n tau_n.
    """
    ratio = np.asarray(omega, dtype=float) / gfmd_frequency
    return series.kappa_of(omega) + series.kappa_inf * (2j * ratio - ratio**2)


_COUNT = 30
# Nodes s t of a Talbot contour around the negative real axis (L. N. Trefethen, J. A. C. Weideman, T. Schmelzer, BIT 46
# (2006) 653, doi:10.1007/s10543-006-0077-9), and their weights. It converges like 3.89**-count; here 24 nodes left
# errors of 1e-10 at short times, where the response goes with t**2, and more than 30 amplify rounding. Responses are
# real, so that half of the nodes suffice.
_ANGLES = np.pi * np.arange(1, _COUNT, 2) / _COUNT
_NODES = _COUNT * (0.5017 * _ANGLES / np.tan(0.6407 * _ANGLES) - 0.6122 + 0.2645j * _ANGLES)
_SLOPES = 0.5017 / np.tan(0.6407 * _ANGLES) - 0.5017 * 0.6407 * _ANGLES / np.sin(0.6407 * _ANGLES) ** 2 + 0.2645j
_WEIGHTS = 2 * np.exp(_NODES) * _SLOPES


def gfmd_creep(time: ArrayLike, series: PronySeries, gfmd_frequency: float) -> NDArray:
    """k_0 u/f_0 of the paper's equations of motion after a traction step: the response its scheme implements.

    m u'' + eta_0 u' + k_inf u = f + sum k_n u_n, eta_n u_n' = k_n (u - u_n), with omega_G = sqrt(k_inf/m) =
    `gfmd_frequency` (rad/s) and eta_0 = 2 m omega_G; the limit omega_G -> inf is `CreepSeries.creep`. Relative accuracy
    about 1e-12 at any time, for any number of elements.

    The inverse Laplace transform of 1/(s kappa_GFMD(s)) on a contour that goes with 1/t: all poles lie within 30
    degrees of the negative real axis. Partial fractions cancel where the two fastest modes are nearly degenerate, as
    critical damping makes them.
    Raises ValueError for a frequency that is not positive and finite.
    """
    if not (np.isfinite(gfmd_frequency) and gfmd_frequency > 0):
        raise ValueError(f"gfmd_frequency must be finite and > 0 (rad/s), got {gfmd_frequency}")
    time = np.asarray(time, dtype=float)
    started = time > 0
    s = _NODES / np.where(started, time, 1.0)[..., None]
    x = np.multiply.outer(s, series.tau)
    ratio = s / gfmd_frequency
    modulus = 1.0 + (x / (1 + x)) @ series.kappa + series.kappa_inf * ratio * (2 + ratio)
    return np.where(started, np.imag(_WEIGHTS / (_NODES * modulus)).sum(axis=-1), 0.0)
