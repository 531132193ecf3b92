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

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray


class States(NamedTuple):
    """Equilibria: force [N], positive in compression, indentation [m], radius a of contact [m], where the gap is zero,
    and outer radius c [m] of the cohesive zone, where it is the range."""

    force: NDArray
    indentation: NDArray
    contact_radius: NDArray
    outer_radius: NDArray


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


def states(
    cohesive_angle: ArrayLike, radius: float, contact_modulus: float, work_of_adhesion: float, cohesive_strength: float
) -> States:
    """Equilibria in SI units at cohesive angles theta in (0, pi/2), for R (m), E* (Pa), w (J/m^2), sigma_0 (Pa)."""
    stiffness = 4 / 3 * contact_modulus
    transition = transition_parameter(radius, contact_modulus, work_of_adhesion, cohesive_strength)
    a, force, indentation = curve(cohesive_angle, transition)
    contact_radius = a * np.cbrt(np.pi * work_of_adhesion * radius**2 / stiffness)
    return States(
        force * np.pi * work_of_adhesion * radius,
        indentation * np.cbrt((np.pi * work_of_adhesion / stiffness) ** 2 * radius),
        contact_radius,
        contact_radius / np.cos(np.asarray(cohesive_angle, dtype=float)),
    )


def state_at(
    radius: float, contact_modulus: float, work_of_adhesion: float, cohesive_strength: float, **given: float
) -> States:
    """The equilibrium with one given `force` (N), `indentation` (m), `contact_radius` or `outer_radius` (m), on the
    branch that is stable while this is what the machine holds.

    Raises ValueError where there is none, as beyond the pull-off, and TypeError unless one quantity is given.
    """
    if len(given) != 1 or not given.keys() <= set(States._fields):
        raise TypeError(f"give one of {', '.join(States._fields)}")
    ((name, wanted),) = given.items()

    def at(log_tangent: ArrayLike) -> States:
        angle = np.arctan(np.exp(log_tangent))
        return states(angle, radius, contact_modulus, work_of_adhesion, cohesive_strength)

    # Every quantity falls from a large contact, a small angle, to its least value: that branch is the stable one.
    scan = np.linspace(-9, 12, 2101)
    values = getattr(at(scan), name)
    least = int(np.argmin(values))
    if not values[least] <= wanted <= values[0]:
        raise ValueError(f"no equilibrium with {name} = {wanted:g}: expected {values[least]:g} to {values[0]:g}")
    # Not at the top, here and below: checks of a scene load this module, but don't need it.
    from scipy.optimize import brentq

    return at(brentq(lambda x: float(getattr(at(x), name)) - wanted, scan[0], scan[least], xtol=1e-13))


def pull_off_force(radius: float, work_of_adhesion: float, transition: float) -> float:
    """Smallest force (N, negative) under load control, for R (m), w (J/m^2) and lambda; between -2 and -1.5 pi w R.

    Raises ValueError unless lambda is in (0, 50]: beyond, the force is JKR's to 1e-3 and the root loses digits.
    """
    if not 0 < transition <= 50:
        raise ValueError(f"transition must lie in (0, 50], got {transition}; above, use jkr.load_controlled_pull_off")

    def force_at(log_tangent: float) -> float:
        return float(curve(np.arctan(np.exp(log_tangent)), transition)[1])

    from scipy.optimize import minimize_scalar

    # The curve is unimodal in log tan(theta), but flat at its ends: bracket the minimum on a coarse scan first.
    scan = np.linspace(-8, 12, 401)
    best = scan[int(np.argmin([force_at(x) for x in scan]))]
    found = minimize_scalar(force_at, bounds=(best - 0.05, best + 0.05), method="bounded", options={"xatol": 1e-10})
    return float(np.pi * work_of_adhesion * radius * min(found.fun, force_at(best)))
