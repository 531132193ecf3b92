"""The rounding error of u = G0 w, the relation between surface displacement and effective traction ("drift").

Newton's corrections and extrapolation preserve u = G0 w up to rounding. But if steps grow repeatedly after a snap,
extrapolation amplifies the rounding error by many orders of magnitude, and no local residual can detect it. So the
covariances of the drift of the known surfaces are propagated with the same weights that extrapolate the surfaces.
Before a drift matters, the scheme evaluates u = G0 w again, with one pair of transforms.

The drifts of successive surfaces are nearly equal, and extrapolation amplifies their small differences. In the
covariance matrix C these cancel numerically after some hundred steps. So a factor L with C = L L^T is stored: the
drifts are L xi with independent xi.
"""

from __future__ import annotations

import numpy as np

from . import drift_kernels as kernels

ROUNDING = 4e-16
"""Standard deviation of the drift of a freshly evaluated surface in double precision, relative to its size."""
SINGLE_ROUNDING = 2e-7
"""The same in single precision."""


class Drift:
    """Factor L of the covariance of the drift [ranges of adhesion] of the known surfaces, newest first: lower
    triangular, (k, k).

    rounding: `ROUNDING`, or `SINGLE_ROUNDING` for surfaces in single precision.
    """

    def __init__(self, factor: np.ndarray | None = None, rounding: float = ROUNDING):
        self.factor = np.zeros((1, 1)) if factor is None else np.ascontiguousarray(factor)
        self.rounding = rounding

    def extrapolated(self, weights: list[float], size: float) -> Drift:
        """With a new surface first, the sum of weights * known surfaces. size: |u| in ranges of adhesion."""
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
        """After the newest surface has been evaluated again."""
        return Drift(kernels.disturbed(self.factor, self.rounding * size, True), self.rounding)

    def disturbed(self, amount: float) -> Drift:
        """With an additional error of this standard deviation [ranges of adhesion] in the newest surface."""
        if amount == 0.0:
            return self
        return Drift(kernels.disturbed(self.factor, amount, False), self.rounding)

    def kept(self, which: list[int]) -> Drift:
        """Restricted to these surfaces, by position."""
        return Drift(kernels.lower_factor(self.factor[which]), self.rounding)
