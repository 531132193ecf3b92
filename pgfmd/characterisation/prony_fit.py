"""A Prony series through measured storage and loss moduli.

    E'(omega) = E_0 + sum_n E_n x^2/(1 + x^2),    E''(omega) = sum_n E_n x/(1 + x^2),    x = omega tau_n,  E_n >= 0

For given times this is linear with positive unknowns: non-negative least squares find the best weights. The times
are a geometric ladder of N rungs, whose two ends are moved for the least misfit. Against a ladder from one end of the
data to the other this gains a quarter for few elements and a lot for many (scripts/studies/rheology/prony_misfit.py); freeing all times
on top of it gained another tenth or less up to N = 10 over ten decades. All misfits are relative,
(fit - measured)/measured, of E' and of E'' alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize, nnls

from pgfmd.physics.rheology import PronySeries

FEWEST_FREQUENCIES = 3
MOST_ELEMENTS = 40
SMALLEST_TAN_DELTA = 1e-3
"""A loss modulus below this share of E' is compared with that share instead: instruments don't resolve it."""
GOOD_MISFIT = 0.01
"""An rms below which further elements are not looked for: the measurement itself is hardly better."""
BAD_MISFIT = 0.05
LARGEST_MARGIN = 1.0  # decades by which the ladder may reach beyond the data
STARTS, DESCENTS = 7, 4
PLATEAU_TAN_DELTA = 0.1


@dataclass(frozen=True, eq=False)
class PronyFit:
    """A fitted series, and how well it fits.

    series: the modulus ratio. static_modulus: E(0) in Pa. omega, storage, loss: what was fitted (rad/s, Pa, Pa), each
    (M,), sorted. misfit: (fit - measured)/measured of E' and E'', shape (2, M). automatic: whether the number of
    elements was found here.
    """

    series: PronySeries
    static_modulus: float
    omega: NDArray
    storage: NDArray
    loss: NDArray
    misfit: NDArray
    automatic: bool = False

    @property
    def rms(self) -> float:
        """Root mean square of all misfits."""
        return float(np.sqrt(np.mean(self.misfit**2)))

    @property
    def largest(self) -> tuple[float, str, float]:
        """Size of the largest misfit, the modulus ("E'" or "E''") and the angular frequency (rad/s) it belongs to."""
        row, column = np.unravel_index(np.argmax(np.abs(self.misfit)), self.misfit.shape)
        return float(np.abs(self.misfit[row, column])), ("E'", "E''")[row], float(self.omega[column])

    @property
    def decades(self) -> float:
        """Decades of frequency that the data cover."""
        return float(np.log10(self.omega[-1] / self.omega[0]))

    def report(self, master: bool) -> list[str]:
        """Range of the data, and how well they are fitted, a line each; master: whether it is a master curve."""
        size, modulus, omega = self.largest
        what = "master curve" if master else "frequencies"
        return [
            f"{what}: {self.omega[0]:.3g} to {self.omega[-1]:.3g} rad/s, {self.decades:.1f} decades",
            f"fit of {self.series.elements} elements: misfit {100 * self.rms:.2g} % rms, "
            f"largest {100 * size:.2g} % ({modulus} at {omega:.3g} rad/s)",
        ]

    def warnings(self) -> list[str]:
        """What a user should know before trusting the series."""
        texts = poor_fit(self.rms, self.automatic, "look for outliers, or for E' and E'' that don't belong together")
        low, high = self.loss[0] / self.storage[0], self.loss[-1] / self.storage[-1]
        if low > PLATEAU_TAN_DELTA:
            texts.append(
                f"at the lowest frequency tan delta is still {low:.2g}: E(0) is extrapolated; "
                "measure at lower frequencies or higher temperatures, down to the rubbery plateau"
            )
        if high > PLATEAU_TAN_DELTA:
            texts.append(
                f"at the highest frequency tan delta is still {high:.2g}: E(infinity) is the largest modulus that the "
                "data know of, the elastomer's own may be higher"
            )
        return texts


def poor_fit(rms: float, automatic: bool, cure: str) -> list[str]:
    """The warning for a fit with a misfit of rms. cure: advice if the number of elements was automatic."""
    if rms <= BAD_MISFIT:
        return []
    more = f"more elements don't help; {cure}"
    return [
        f"the fit is off by {100 * rms:.2g} % rms: "
        + (more if automatic else "choose more elements; without --elements as many are taken as serve")
    ]


def fit_series(omega: ArrayLike, storage: ArrayLike, loss: ArrayLike, elements: int | None = None) -> PronyFit:
    """The best series of `elements` Maxwell elements, or of as few as serve.

    omega: rad/s; storage, loss: Pa; each (M,), in any order. elements: rungs of the ladder, 1 to 40; a rung of weight 0
    is left out of the result. Without it the number grows until the rms misfit is below 1 %, or four more elements make
    it no better by a tenth; then the smallest number within a tenth of the best is taken.
    Raises ValueError for nonsense and for data without a static modulus.
    """
    omega, storage, loss = _checked(omega, storage, loss)
    times = best_times(omega, lambda times: weights_of(omega, storage, loss, times)[1], elements)
    weights, misfit = weights_of(omega, storage, loss, times)
    static, series = series_of_weights(weights, times)
    return PronyFit(series, static, omega, storage, loss, misfit, elements is None)


def best_times(omega: NDArray, misfit_of: Callable[[NDArray], NDArray], elements: int | None) -> NDArray:
    """Relaxation times (s), (N,), for which data fit best: of `elements` rungs, or of as few as serve (`fit_series`).

    omega: rad/s, sorted, between whose ends the ladder is looked for; of a relaxation 1/t. misfit_of: misfit of each
    datum for given times. Raises ValueError for a number of elements out of range.
    """
    if elements is not None and not 1 <= elements <= MOST_ELEMENTS:
        raise ValueError(f"elements = {elements}: expected a whole number from 1 to {MOST_ELEMENTS}")
    if elements is not None:
        return _best_ladder(omega, misfit_of, elements)[0]
    tried: list[tuple[float, int]] = []
    for count in range(1, min(MOST_ELEMENTS, np.unique(omega).size) + 1):
        tried.append((_best_ladder(omega, misfit_of, count)[1], count))
        # One element more can be worse: rungs of a ladder don't stay where they were.
        if tried[-1][0] < GOOD_MISFIT or (count > 5 and min(tried[-4:])[0] > 0.9 * min(tried[:-4])[0]):
            break
    enough = max(1.1 * min(tried)[0], GOOD_MISFIT)
    return _best_ladder(omega, misfit_of, next(count for rms, count in tried if rms <= enough))[0]


def series_of_weights(weights: NDArray, times: NDArray) -> tuple[float, PronySeries]:
    """E(0) [Pa] and the series of (E_0, E_1, ...) in Pa, (1 + N,), and times (N,). ValueError where E_0 = 0."""
    static = float(weights[0])
    if static <= 1e-12 * weights.sum():
        raise ValueError(
            "the best fit has no static modulus, E(0) = 0: this is a liquid, or the data end far above the rubbery "
            "plateau; measure at lower frequencies, for longer times, or at higher temperatures"
        )
    # What rounding leaves of elements that aren't there.
    return static, PronySeries(np.where(weights[1:] > 1e-9 * static, weights[1:] / static, 0.0), times)


def moduli_of(fit: PronyFit, omega: ArrayLike) -> tuple[NDArray, NDArray]:
    """Storage and loss modulus (Pa) of a fit at omega (rad/s)."""
    return fit.static_modulus * fit.series.storage(omega), fit.static_modulus * fit.series.loss(omega)


def ladder(omega: NDArray, elements: int, margins: Sequence[float] | NDArray = (0.0, 0.0)) -> NDArray:
    """Relaxation times (s), ascending, from 1/omega[-1] to 1/omega[0], moved outwards by margins (decades)."""
    shortest, longest = -np.log10(omega[-1]) - margins[0], -np.log10(omega[0]) + margins[1]
    if elements == 1:
        return np.array([10 ** (0.5 * (shortest + longest))])
    return np.logspace(shortest, longest, elements)


def weights_of(omega: NDArray, storage: NDArray, loss: NDArray, times: NDArray) -> tuple[NDArray, NDArray]:
    """(E_0, E_1, ...) in Pa, shape (1 + N,), >= 0, for given times (N,), and the misfit of E' and E'', shape (2, M)."""
    x = np.multiply.outer(omega, times)
    elastic, viscous = x**2 / (1 + x**2), x / (1 + x**2)
    measured = np.stack([storage, loss])
    scale = np.stack([storage, np.maximum(loss, SMALLEST_TAN_DELTA * storage)])
    static = np.stack([np.ones_like(omega), np.zeros_like(omega)])
    return positive_weights(np.concatenate([static[..., None], np.stack([elastic, viscous])], axis=-1), measured, scale)


def positive_weights(model: NDArray, measured: NDArray, scale: NDArray) -> tuple[NDArray, NDArray]:
    """Weights (K,), >= 0, for which model (..., K) @ weights is nearest to measured (...), and (model @ weights -
    measured)/scale; distances are measured in scale (...)."""
    matrix = (model / scale[..., None]).reshape(-1, model.shape[-1])
    # Columns of equal size, whatever the unit and the range of the moduli.
    size = np.linalg.norm(matrix, axis=0)
    weights, _ = nnls(matrix / size, (measured / scale).ravel(), maxiter=100 * model.shape[-1])
    weights = weights / size
    return weights, (model @ weights - measured) / scale


def _checked(omega: ArrayLike, storage: ArrayLike, loss: ArrayLike) -> tuple[NDArray, NDArray, NDArray]:
    omega, storage, loss = (np.asarray(values, dtype=float) for values in (omega, storage, loss))
    if omega.ndim != 1 or not omega.shape == storage.shape == loss.shape:
        raise ValueError(f"expected as many moduli as frequencies, got {omega.shape}, {storage.shape}, {loss.shape}")
    if not all(np.all(np.isfinite(values)) for values in (omega, storage, loss)):
        raise ValueError("expected finite frequencies and moduli")
    if np.any(omega <= 0) or np.any(storage <= 0) or np.any(loss < 0):
        raise ValueError("expected frequencies and storage moduli above 0, and loss moduli of at least 0")
    if np.unique(omega).size < FEWEST_FREQUENCIES:
        raise ValueError(f"expected at least {FEWEST_FREQUENCIES} frequencies, found {np.unique(omega).size}")
    order = np.argsort(omega, kind="stable")
    return omega[order], storage[order], loss[order]


def _best_ladder(omega: NDArray, misfit_of: Callable[[NDArray], NDArray], elements: int) -> tuple[NDArray, float]:
    """The ladder (N,) with the ends that fit best, and its rms misfit."""

    def rms(margins: Sequence[float] | NDArray) -> float:
        if max(margins) > LARGEST_MARGIN or (elements > 1 and sum(margins) < -0.95 * span):
            return np.inf
        return float(np.sqrt(np.mean(misfit_of(ladder(omega, elements, margins)) ** 2)))

    span = float(np.log10(omega[-1] / omega[0]))
    # The misfit has several minima where the data hold plateaus beyond the spectrum: start from the best of a grid.
    inside = -span * np.linspace(0.0, 0.75, STARTS)
    starts = [(fast, slow) for fast in inside for slow in inside] if elements > 1 else [(0.0, 0.0)]
    options = {"xatol": 1e-4, "fatol": 1e-7, "maxfev": 400}
    simplex = np.array([[0.0, 0.0], [-0.2, 0.0], [0.0, -0.2]])
    tries = [
        minimize(rms, start, method="Nelder-Mead", options=options | {"initial_simplex": start + simplex})
        for start in sorted(starts, key=rms)[:DESCENTS]
    ]
    found = min(tries, key=lambda result: result.fun)
    return ladder(omega, elements, found.x), float(found.fun)
