"""A Prony series through a measured relaxation, the stress over a strain that is held.

    E(t) = E_0 + sum_n E_n exp(-t/tau_n),   E_n >= 0

The same search as for moduli over frequency (prony_fit.py), with misfits (fit - measured)/measured of E(t). The strain has
to be applied fast against the first time that is used: what relaxes before is not seen.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgfmd.physics.rheology import PronySeries

from .prony_fit import FEWEST_FREQUENCIES, best_times, poor_fit, positive_weights, series_of_weights

FLAT = 0.05
"""Slope d ln E/d ln t at an end of the data from which on more would come beyond."""


@dataclass(frozen=True, eq=False)
class RelaxationFit:
    """A fitted series, and how well it fits.

    series: the modulus ratio. static_modulus: E(0) in Pa, of long times. time (s), modulus (Pa), misfit: what was fitted
    and (fit - measured)/measured, each (M,), sorted. automatic: whether the number of elements was found here.
    """

    series: PronySeries
    static_modulus: float
    time: NDArray
    modulus: NDArray
    misfit: NDArray
    automatic: bool = False

    @property
    def rms(self) -> float:
        """Root mean square of all misfits."""
        return float(np.sqrt(np.mean(self.misfit**2)))

    @property
    def decades(self) -> float:
        """Decades of time that the data cover."""
        return float(np.log10(self.time[-1] / self.time[0]))

    def report(self, master: bool = False) -> list[str]:
        """Range of the data, and how well they are fitted, a line each; master: as for a `PronyFit`, without a use."""
        worst = int(np.argmax(np.abs(self.misfit)))
        return [
            f"times: {self.time[0]:.3g} to {self.time[-1]:.3g} s, {self.decades:.1f} decades",
            f"fit of {self.series.elements} elements: misfit {100 * self.rms:.2g} % rms, "
            f"largest {100 * abs(self.misfit[worst]):.2g} % (at {self.time[worst]:.3g} s)",
        ]

    def warnings(self) -> list[str]:
        """What a user should know before trusting the series."""
        texts = poor_fit(self.rms, self.automatic, "look for outliers")
        early, late = self._slope(slice(0, 3)), self._slope(slice(-3, None))
        if late > FLAT:
            texts.append(
                f"at the longest time E(t) still falls as t^-{late:.2g}: E(0) is extrapolated; measure for longer, or at a "
                "higher temperature"
            )
        if early > FLAT:
            texts.append(
                f"at the shortest time E(t) already falls as t^-{early:.2g}: E(infinity) is the largest modulus that the "
                "data know of, the elastomer's own may be higher"
            )
        return texts

    def _slope(self, rows: slice) -> float:
        """-d ln E/d ln t of the fit between the first and the last of some rows."""
        time = self.time[rows]
        modulus = self.series.relaxation(time)
        return float(-np.log(modulus[-1] / modulus[0]) / np.log(time[-1] / time[0])) if time[-1] > time[0] else 0.0


def fit_relaxation(time: ArrayLike, modulus: ArrayLike, elements: int | None = None) -> RelaxationFit:
    """The best series of `elements` Maxwell elements, or of as few as serve, as `prony_fit.fit_series` finds them.

    time: s, above 0; modulus: Pa, above 0; both (M,), in any order. Raises ValueError for nonsense and for data that fall
    to nothing.
    """
    time, modulus = np.asarray(time, dtype=float), np.asarray(modulus, dtype=float)
    if time.ndim != 1 or time.shape != modulus.shape:
        raise ValueError(f"expected as many moduli as times, got {time.shape} and {modulus.shape}")
    if not (np.all(np.isfinite(time)) and np.all(np.isfinite(modulus)) and np.all(time > 0) and np.all(modulus > 0)):
        raise ValueError("expected finite times and moduli above 0")
    if np.unique(time).size < FEWEST_FREQUENCIES:
        raise ValueError(f"expected at least {FEWEST_FREQUENCIES} times, found {np.unique(time).size}")
    order = np.argsort(time, kind="stable")
    time, modulus = time[order], modulus[order]

    def solve(times: NDArray) -> tuple[NDArray, NDArray]:
        decays = np.exp(-np.divide.outer(time, times))
        return positive_weights(np.concatenate([np.ones((time.size, 1)), decays], axis=1), modulus, modulus)

    times = best_times(1.0 / time[::-1], lambda times: solve(times)[1], elements)
    weights, misfit = solve(times)
    static, series = series_of_weights(weights, times)
    return RelaxationFit(series, static, time, modulus, misfit, elements is None)
