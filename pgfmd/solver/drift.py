"""How far rounding has driven the surfaces u from their loads, u = G0 w.

Newton's corrections keep u = G0 w to rounding, and so does extrapolation; but where steps grow again and again after a
snap, extrapolation amplifies that rounding as it amplifies a parabola, by many orders. No local residual can see it. So
the variances and covariances of the drift of the known surfaces are followed through the very weights that extrapolate
them. Where they tell that a drift is about to matter, the scheme evaluates u = G0 w anew, for one transform pair.

The drifts of successive surfaces are nearly the same, and it is their small differences that extrapolation amplifies;
in the covariances C themselves these cancel to nothing after some hundred steps. So a factor of them is kept, L with
C = L L^T, the drifts being L xi with independent xi.
"""

from __future__ import annotations

import numpy as np

from . import drift_kernels as kernels

ROUNDING = 4e-16
"""Standard deviation of the drift of a freshly evaluated surface in double precision, relative to its size."""
SINGLE_ROUNDING = 2e-7
"""The same in single precision."""


class Drift:
    """Factor of the covariance of the drift [ranges of adhesion] of the known surfaces, newest first: lower triangular,
    (k, k).

    rounding: `ROUNDING`, or `SINGLE_ROUNDING` for surfaces in single precision.
    """

    def __init__(self, factor: np.ndarray | None = None, rounding: float = ROUNDING):
        self.factor = np.zeros((1, 1)) if factor is None else np.ascontiguousarray(factor)
        self.rounding = rounding

    def extrapolated(self, weights: list[float], size: float) -> Drift:
        """With a new surface in front that is the sum of weights * known surfaces. size: |u| in ranges of adhesion."""
        noise = self.rounding * size
        return Drift(kernels.extrapolated(self.factor, np.array(weights), noise), self.rounding)

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of the drifts [ranges of adhesion, squared], (k, k)."""
        return self.factor @ self.factor.T

    @property
    def newest(self) -> float:
        """Standard deviation of the newest surface's drift [ranges of adhesion]."""
        return abs(float(self.factor[0, 0]))

    def renewed(self, size: float) -> Drift:
        """After the newest surface has been evaluated anew."""
        return Drift(kernels.disturbed(self.factor, self.rounding * size, True), self.rounding)

    def disturbed(self, amount: float) -> Drift:
        """With an error of this standard deviation [ranges of adhesion] more in the newest surface."""
        if amount == 0.0:
            return self
        return Drift(kernels.disturbed(self.factor, amount, False), self.rounding)

    def kept(self, which: list[int]) -> Drift:
        """Of these surfaces alone, by position."""
        return Drift(kernels.lower_factor(self.factor[which]), self.rounding)
