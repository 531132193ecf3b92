"""How far rounding has driven the surfaces u from their loads, u = G0 w. Plain NumPy.

Newton's corrections keep u = G0 w to rounding, and so does extrapolation; but where steps grow again and again after a
snap, extrapolation amplifies that rounding as it amplifies a parabola, by many orders. No local residual can see it. So
the variances and covariances of the drift of the known surfaces are followed through the very weights that extrapolate
them. Where they tell that a drift is about to matter, the scheme evaluates u = G0 w anew, for one transform pair.
"""

from __future__ import annotations

import numpy as np

ROUNDING, SINGLE_ROUNDING = 4e-16, 2e-7
"""Standard deviation of the drift of a freshly evaluated surface, relative to its size, in double and single precision."""


class Drift:
    """Covariance of the drift [ranges of adhesion, squared] of the known surfaces, newest first, (k, k).

    rounding: `ROUNDING`, or `SINGLE_ROUNDING` for surfaces in single precision.
    """

    def __init__(self, covariance: np.ndarray | None = None, rounding: float = ROUNDING):
        self.covariance = np.zeros((1, 1)) if covariance is None else covariance
        self.rounding = rounding

    def extrapolated(self, weights: list[float], size: float) -> Drift:
        """With a new surface in front that is the sum of weights * known surfaces. size: |u| in ranges of adhesion."""
        known = self.covariance.shape[0]
        c = np.zeros(known)
        c[: len(weights)] = weights
        shared = self.covariance @ c
        fresh = (self.rounding * size) ** 2 * (1.0 + c @ c)
        result = np.empty((known + 1, known + 1))
        result[0, 0] = c @ shared + fresh
        result[0, 1:] = result[1:, 0] = shared
        result[1:, 1:] = self.covariance
        return Drift(result, self.rounding)

    @property
    def newest(self) -> float:
        """Standard deviation of the newest surface's drift [ranges of adhesion]."""
        return float(np.sqrt(max(self.covariance[0, 0], 0.0)))

    def renewed(self, size: float) -> Drift:
        """After the newest surface has been evaluated anew."""
        result = self.covariance.copy()
        result[0, :] = result[:, 0] = 0.0
        result[0, 0] = (self.rounding * size) ** 2
        return Drift(result, self.rounding)

    def disturbed(self, amount: float) -> Drift:
        """With an error of this standard deviation [ranges of adhesion] more in the newest surface."""
        result = self.covariance.copy()
        result[0, 0] += amount**2
        return Drift(result, self.rounding)

    def kept(self, which: list[int]) -> Drift:
        """Of these surfaces alone, by position."""
        return Drift(self.covariance[np.ix_(which, which)], self.rounding)
