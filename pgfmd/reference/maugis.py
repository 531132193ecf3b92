"""Maugis-Dugdale: a rigid paraboloid with a constant cohesive stress sigma_0 up to the range w/sigma_0.

In units of R, w and K = (4/3) E*, with A = a (K/(pi w R^2))^(1/3), m = c/a = sec(theta) (c: outer edge of the cohesive
zone) and lambda = 2 sigma_0 (R/(pi w K^2))^(1/3):

    1     = (lambda A^2/2) [tan + (m^2 - 2) theta] + (4 lambda^2 A/3) [tan theta - m + 1],   tan = sqrt(m^2 - 1)
    F     = pi w R {A^3 - lambda A^2 [tan + m^2 theta]}
    delta = (pi^2 w^2 R/K^2)^(1/3) {A^2 - (4/3) lambda A tan}

lambda -> 0 is DMT (pull-off force -2 pi w R), lambda -> inf is JKR (-1.5 pi w R).
Source: D. Maugis, J. Colloid Interface Sci. 150 (1992) 243, doi:10.1016/0021-9797(92)90285-T.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def transition_parameter(
    radius: float, contact_modulus: float, work_of_adhesion: float, cohesive_strength: float
) -> float:
    """lambda (dimensionless) for a cohesive strength sigma_0 (Pa), R (m), E* (Pa), w (J/m^2)."""
    stiffness = 4 / 3 * contact_modulus
    return 2 * cohesive_strength * float(np.cbrt(radius / (np.pi * work_of_adhesion * stiffness**2)))


def curve(cohesive_angle: ArrayLike, transition: float) -> tuple[NDArray, NDArray, NDArray]:
    """Dimensionless (A, F/(pi w R), delta/(pi^2 w^2 R/K^2)^(1/3)) at cohesive angles theta in (0, pi/2)."""
    theta = np.asarray(cohesive_angle, dtype=float)
    tangent, m = np.tan(theta), 1 / np.cos(theta)
    quadratic = transition / 2 * (tangent + (tangent**2 - 1) * theta)
    linear = 4 / 3 * transition**2 * (tangent * theta - m + 1)
    a = 2 / (linear + np.sqrt(linear**2 + 4 * quadratic))
    force = a**3 - transition * a**2 * (tangent + m**2 * theta)
    return a, force, a**2 - 4 / 3 * transition * a * tangent


def pull_off_force(radius: float, work_of_adhesion: float, transition: float) -> float:
    """Smallest force (N, negative) under load control, for R (m), w (J/m^2) and lambda; between -2 and -1.5 pi w R.

    Raises ValueError unless lambda is in (0, 50]: beyond, the force is JKR's to 1e-3 and the root loses digits.
    """
    if not 0 < transition <= 50:
        raise ValueError(f"transition must lie in (0, 50], got {transition}; above, use jkr.load_controlled_pull_off")

    def force_at(log_tangent: float) -> float:
        return float(curve(np.arctan(np.exp(log_tangent)), transition)[1])

    # Not at the top: checks of a scene load this module, but don't need it.
    from scipy.optimize import minimize_scalar

    # The curve is unimodal in log tan(theta), but flat at its ends: bracket the minimum on a coarse scan first.
    scan = np.linspace(-8, 12, 401)
    best = scan[int(np.argmin([force_at(x) for x in scan]))]
    found = minimize_scalar(force_at, bounds=(best - 0.05, best + 0.05), method="bounded", options={"xatol": 1e-10})
    return float(np.pi * work_of_adhesion * radius * min(found.fun, force_at(best)))
