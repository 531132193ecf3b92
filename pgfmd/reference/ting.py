"""A rigid paraboloid pushed into a viscoelastic half-space (Lee and Radok; Ting), no adhesion, while the contact grows.

    F(t) = (4 sqrt(R)/3) int_0^t E*(t - s) d/ds[delta(s)^(3/2)] ds,   E*(t) = E* [1 + sum kappa_n exp(-t/tau_n)]

For delta = v t each element is a Dawson integral, with T = t/tau and y = sqrt(T):
int_0^t exp(-(t - s)/tau) (3/2) s^(1/2) ds = (3/2) tau^(3/2) [y - D(y)]. The contact radius is Hertz's, a^2 = R delta.
Sources: E. H. Lee, J. R. M. Radok, J. Appl. Mech. 27 (1960) 438, doi:10.1115/1.3644020; T. C. T. Ting, J. Appl. Mech.
33 (1966) 845, doi:10.1115/1.3625192.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import dawsn

from pgfmd.physics.rheology import PronySeries

# Below this t/tau, y - D(y) cancels; there so many terms of its series are exact to rounding.
SERIES_LIMIT = 1.0
SERIES_TERMS = 20


def _ramp_memory(ratio: NDArray) -> NDArray:
    """(3/2) [y - D(y)] / y^3 with y^2 = ratio = t/tau >= 0: 1 at 0, (3/2)/ratio for large ratios."""
    small = np.minimum(ratio, SERIES_LIMIT)
    # y - D(y) = sum_{k>=1} (-1)^(k+1) 2^k y^(2k+1)/(2k+1)!!
    term = np.ones_like(small)
    series = term.copy()
    for k in range(2, SERIES_TERMS):
        term = term * (-2 * small / (2 * k + 1))
        series = series + term
    large = np.maximum(ratio, SERIES_LIMIT)
    y = np.sqrt(large)
    return np.where(ratio < SERIES_LIMIT, series, 1.5 * (1 - dawsn(y) / y) / large)


def force(
    time: ArrayLike,
    velocity: float,
    radius: float,
    contact_modulus: float,
    series: PronySeries,
    approach_time: float = np.inf,
) -> NDArray:
    """Normal force (N) at `time` (s) after first touch, pushed in at v (m/s) until `approach_time` and then held.

    velocity: v (m/s); radius: R (m); contact_modulus: static E* (Pa). 0 before the touch. Exact to rounding, for any
    shape of `time`.
    """
    t = np.asarray(time, dtype=float)
    pushed = np.clip(t, 0, approach_time)
    held = np.maximum(t - approach_time, 0)
    memory = _ramp_memory(np.multiply.outer(pushed, 1 / series.tau))
    ratio = 1 + (memory * np.exp(-np.multiply.outer(held, 1 / series.tau))) @ series.kappa
    return 4 / 3 * contact_modulus * np.sqrt(radius) * (velocity * pushed) ** 1.5 * ratio


def contact_radius(time: ArrayLike, velocity: float, radius: float, approach_time: float = np.inf) -> NDArray:
    """Contact radius sqrt(R delta) (m) of the same programme; it knows nothing of the rheology."""
    return np.sqrt(radius * velocity * np.clip(np.asarray(time, dtype=float), 0, approach_time))
