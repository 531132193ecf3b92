"""How far rounding has driven the surfaces u from their loads, u = G0 w. Plain NumPy.

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
from scipy.linalg.lapack import dgeqrf

ROUNDING, SINGLE_ROUNDING = 4e-16, 2e-7
"""Standard deviation of the drift of a freshly evaluated surface, relative to its size, in double and single
precision."""


class Drift:
    """Factor of the covariance of the drift [ranges of adhesion] of the known surfaces, newest first: lower triangular,
    (k, k).

    rounding: `ROUNDING`, or `SINGLE_ROUNDING` for surfaces in single precision.
    """

    def __init__(self, factor: np.ndarray | None = None, rounding: float = ROUNDING):
        self.factor = np.zeros((1, 1)) if factor is None else factor
        self.rounding = rounding

    def extrapolated(self, weights: list[float], size: float) -> Drift:
        """With a new surface in front that is the sum of weights * known surfaces. size: |u| in ranges of adhesion."""
        known = self.factor.shape[0]
        c = np.zeros(known)
        c[: len(weights)] = weights
        wide = np.zeros((known + 1, known + 1))
        wide[0, 0] = self.rounding * size * np.sqrt(1.0 + c @ c)
        wide[0, 1:] = c @ self.factor
        wide[1:, 1:] = self.factor
        return Drift(_triangular(wide), self.rounding)

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
        known = self.factor.shape[0]
        wide = np.zeros((known, known + 1))
        wide[0, 0] = self.rounding * size
        wide[1:, 1:] = self.factor[1:]
        return Drift(_triangular(wide), self.rounding)

    def disturbed(self, amount: float) -> Drift:
        """With an error of this standard deviation [ranges of adhesion] more in the newest surface."""
        if amount == 0.0:
            return self
        # An error of its own is one more column of the newest row.
        wide = np.hstack([np.zeros((self.factor.shape[0], 1)), self.factor])
        wide[0, 0] = amount
        return Drift(_triangular(wide), self.rounding)

    def kept(self, which: list[int]) -> Drift:
        """Of these surfaces alone, by position."""
        return Drift(_triangular(self.factor[which]), self.rounding)


def _triangular(rows: np.ndarray) -> np.ndarray:
    """The lower triangular factor of the same covariance rows rows^T; the newest surface's row holds one entry."""
    # By LAPACK itself: what numpy.linalg.qr does around it takes ten times as long, several times a step.
    factors, _, _, _ = dgeqrf(rows.T)
    rows_of_factor = min(factors.shape)
    for column in range(rows_of_factor):
        factors[column + 1 :, column] = 0.0
    return factors[:rows_of_factor].T
