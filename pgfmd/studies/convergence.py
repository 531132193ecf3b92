"""Fit of a power law to a quantity over a refinement, its extrapolation, and whether the data support it. Plain NumPy.

    q(h) = q_0 + c (h/h_1)^p          h_1: the coarsest h

p is fitted by least squares, or given. Then q_0 and c follow from a linear problem. Standard errors follow from the
residuals and the Jacobian of the fit. With only one point more than parameters they are uncertain, which the interval
by Student's t takes into account. These errors assume that the points scatter about a power law. The spread on leaving
out one point does not assume this, and the doubts show where the assumption fails.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

LOWEST, HIGHEST = 0.05, 6.0
"""Range of powers of a fit."""
AT_BOUND = 1.02
DRIFT = 0.4
"""Spread of the powers between levels, relative to their mean, above which a single power is doubtful."""
LARGE_RESIDUAL = 0.05
"""Residual, relative to the range of the data, above which a power law is doubtful."""
CONFIDENCE = 0.95


Numbers = Sequence[float] | np.ndarray
"""Arrays with one number for each level."""


@dataclass(frozen=True)
class Fit:
    """A power law through points.

    limit: q_0; amplitude: c; power: p. *_error: standard errors, NaN where there are as many parameters as points.
    limit_interval: 95 % by Student's t. left_out: smallest and largest q_0 when one point is left out, NaN if too few
    points are left. residual: root mean square of the residuals. free: whether p was fitted.
    """

    limit: float
    amplitude: float
    power: float
    limit_error: float
    amplitude_error: float
    power_error: float
    limit_interval: tuple[float, float]
    left_out: tuple[float, float]
    residual: float
    free: bool

    def __call__(self, share: np.ndarray) -> np.ndarray:
        """The law at h/h_1."""
        return self.limit + self.amplitude * np.asarray(share) ** self.power


def fit_power_law(sizes: Numbers, values: Numbers, power: float | None = None) -> Fit:
    """The law through `values` [any unit] at `sizes` (mesh size, tolerance; any unit, > 0), its power given or fitted.

    Raises ValueError for fewer than 2 different sizes, 3 where the power is fitted, for numbers that are not finite,
    and sizes that are not positive.
    """
    h, q = np.asarray(sizes, float), np.asarray(values, float)
    free = power is None
    if h.shape != q.shape or h.ndim != 1 or not (np.isfinite(h).all() and np.isfinite(q).all() and (h > 0.0).all()):
        raise ValueError("sizes and values must be finite and as many of each, sizes above 0")
    if np.unique(h).size < (3 if free else 2):
        raise ValueError(f"{3 if free else 2} different sizes are needed, there are {np.unique(h).size}")
    share = h / h.max()
    best = _best_power(share, q) if power is None else float(power)
    limit, amplitude, residuals = _linear(share, q, best)
    errors = _errors(share, amplitude, best, residuals, free)
    spare = h.size - (3 if free else 2)
    factor = _student(spare)
    interval = (limit - factor * errors[0], limit + factor * errors[0])
    return Fit(
        limit, amplitude, best, errors[0], errors[1], errors[2], interval, _left_out(h, q, power),
        float(np.sqrt(np.mean(residuals**2))), free,
    )  # fmt: skip


def _linear(share: np.ndarray, q: np.ndarray, power: float) -> tuple[float, float, np.ndarray]:
    """q_0, c and the residuals for a given power."""
    basis = np.column_stack([np.ones_like(share), share**power])
    (limit, amplitude), *_ = np.linalg.lstsq(basis, q, rcond=None)
    return float(limit), float(amplitude), q - basis @ (limit, amplitude)


def _best_power(share: np.ndarray, q: np.ndarray) -> float:
    """The power with the least sum of squares between LOWEST and HIGHEST: the best of a sequence of values, then of
    finer ones around it."""
    low, high, count = math.log(LOWEST), math.log(HIGHEST), 400
    while high - low > 1e-10:
        row = np.linspace(low, high, count)
        k = int(np.argmin(_misfits(share, q, np.exp(row))))
        low, high, count = row[max(k - 1, 0)], row[min(k + 1, count - 1)], 40
    return math.exp(0.5 * (low + high))


def _misfits(share: np.ndarray, q: np.ndarray, powers: np.ndarray) -> np.ndarray:
    """Sum of squares of the residuals for the best q_0 and c, for each power."""
    basis = share ** powers[:, None]
    basis -= basis.mean(axis=1, keepdims=True)
    centred = q - q.mean()
    slopes = basis @ centred / np.sum(basis**2, axis=1)
    return np.sum((centred - slopes[:, None] * basis) ** 2, axis=1)


def _errors(share: np.ndarray, amplitude: float, power: float, residuals: np.ndarray, free: bool) -> tuple[float, ...]:
    """Standard errors of q_0, c and p (0 where it is given) from the covariance of the fit."""
    columns = [np.ones_like(share), share**power]
    if free:
        columns.append(amplitude * share**power * np.log(share))
    jacobian = np.column_stack(columns)
    spare = share.size - len(columns)
    if spare < 1:
        return math.nan, math.nan, math.nan if free else 0.0
    try:
        covariance = np.linalg.inv(jacobian.T @ jacobian) * float(residuals @ residuals) / spare
    except np.linalg.LinAlgError:
        return math.nan, math.nan, math.nan if free else 0.0
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist()
    return tuple(errors) if free else (*errors, 0.0)


def _student(spare: int) -> float:
    """Half the width of the 95 % interval in standard errors; NaN if there are as many parameters as points."""
    from scipy.special import stdtrit

    return float(stdtrit(spare, 0.5 + 0.5 * CONFIDENCE)) if spare > 0 else math.nan


def _left_out(h: np.ndarray, q: np.ndarray, power: float | None) -> tuple[float, float]:
    """Smallest and largest limit of the fits to all points but one."""
    if h.size <= (3 if power is None else 2):
        return math.nan, math.nan
    limits = []
    for k in range(h.size):
        share, rest = np.delete(h, k) / h.max(), np.delete(q, k)
        limits.append(_linear(share, rest, _best_power(share, rest) if power is None else power)[0])
    return min(limits), max(limits)


def local_powers(sizes: Numbers, values: Numbers) -> list[float]:
    """The power between each three successive levels, coarsest first: ln of the ratio of the two differences over ln of
    the ratio of the sizes. NaN where the differences have different signs, or one is 0. Sizes should decrease by a
    constant factor."""
    order = np.argsort(np.asarray(sizes, float))[::-1]
    h, steps = np.asarray(sizes, float)[order], np.diff(np.asarray(values, float)[order])
    return [
        math.log(steps[k] / steps[k + 1]) / math.log(h[k] / h[k + 1]) if steps[k] * steps[k + 1] > 0.0 else math.nan
        for k in range(steps.size - 1)
    ]


def finest_limit(sizes: Numbers, values: Numbers, power: float) -> float:
    """The limit from the two finest levels alone, with a given power."""
    order = np.argsort(np.asarray(sizes, float))[:2]
    return fit_power_law(np.asarray(sizes)[order], np.asarray(values)[order], power).limit


def doubts(sizes: Numbers, values: Numbers, fit: Fit, noise: float = 0.0) -> list[str]:
    """Reasons to doubt the law, or its extrapolation; empty if there are none.

    noise: independently known error of each value, in the unit of the values.
    """
    return list(_doubts(np.asarray(sizes, float), np.asarray(values, float), fit, noise))


def _doubts(sizes: np.ndarray, values: np.ndarray, fit: Fit, noise: float) -> Iterator[str]:
    order = np.argsort(sizes)[::-1]
    q = values[order]
    steps, spread = np.diff(q), float(np.ptp(q))
    if spread <= 1e-12 * float(np.abs(q).max(initial=0.0)):
        yield "the values are equal: there is nothing to extrapolate"
        return
    if q.size < 4:
        yield f"only {q.size} levels: the power itself can't be tested"
    if (steps > 0).any() and (steps < 0).any():
        yield "the values do not go one way: they rise and fall from level to level"
    elif q.size > 2 and abs(steps[-1]) >= abs(steps[0]):
        yield "the differences between levels do not shrink: the range where a power law holds is not reached"
    else:
        local = local_powers(sizes, values)
        if len(local) > 1 and max(local) - min(local) > DRIFT * abs(np.mean(local)):
            yield (
                f"the power between levels drifts, {', '.join(f'{power:.2g}' for power in local)}: one power does not "
                "hold for all of them; leave out coarse ones (--from), or add finer ones"
            )
    if fit.free and not LOWEST * AT_BOUND < fit.power < HIGHEST / AT_BOUND:
        yield f"the fitted power is at the end of what was looked for, {LOWEST:g} to {HIGHEST:g}"
    if fit.residual > LARGE_RESIDUAL * spread:
        yield f"the residuals are {100 * fit.residual / spread:.2g} % of the range of the values"
    if abs(fit.limit - q[-1]) > spread:
        yield "the extrapolation goes further than all that was computed"
    if (q > 0.0).all() and fit.limit < 0.0:
        yield "the limit is negative, where every value is positive"
    last = abs(steps[-1])
    if noise > last:
        yield f"the error of the values, {noise:.2g}, is larger than the last difference between levels, {last:.2g}"


def disagreement(free: Fit, expected: float) -> str:
    """Reasons to doubt the expected power; empty if the fitted one agrees with it within two standard errors."""
    if math.isnan(free.power_error) or abs(free.power - expected) <= 2.0 * free.power_error:
        return ""
    return f"the fitted power, {free.power:.3g} ± {free.power_error:.2g}, is not the expected {expected:.3g}"
