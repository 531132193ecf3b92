"""Least squares over a model that is dear and a little noisy: the search, and how well its answer is known. Plain SciPy.

    minimise sum_k r_k(x)^2,   r = F_run - F_measured at places k

The search is a trust-region method with bounds (scipy.optimize.least_squares, "trf"), its derivatives differences over STEP.
The covariance of x is that of linear least squares,

    C = (J^T J)^-1 s^2 t,   s^2 t = r^T r t/(n - p t),

with n places and p numbers, but for t: residuals of neighbouring places are alike, so that of t of them only one counts; t is
their autocorrelation, summed up to its first negative value (Sokal's integrated autocorrelation time). What the errors of a
run's own steps may add, a share of all its forces, is the shift (J^T J)^-1 J^T (share F) of x, and is added in squares. So is
what is rough in the runs as functions of x: the second differences of r over STEP, as if they were noise of the runs alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .parameters import FitError, MissingRun, Parameter

Array = NDArray[np.float64]
Evaluate = Callable[[Sequence[Array], str], list[Array | None]]
"""Residuals r [N], (places,), for each x, (numbers,); None where a run could not be made. The text says what for."""

STEP = 0.1
"""Step of x for derivatives, 10 % of a number: smaller ones are lost in what the runs' own steps do to the curve."""
LEAST_GAIN = 1e-3
"""Share of the sum of squares by which a step has to make it smaller for the search to go on."""
UNMOVED = 1e-5
"""Change of the curve by such a step, as a fraction of its forces, up to which a number counts as without effect."""
ALIKE = 0.99
"""Correlation above which two numbers count as indistinguishable."""
UNKNOWN = math.log(10.0)
"""Standard error of x, a factor of ten, above which a number counts as undetermined."""
CONFIDENCE = 0.95


@dataclass(frozen=True, eq=False)
class Found:
    """Where a search ended. x, (numbers,); residuals [N] there, (places,). converged: whether it came to its end by itself; why:
    scipy's words."""

    x: Array
    residuals: Array
    converged: bool
    why: str


@dataclass(frozen=True, eq=False)
class Certainty:
    """How well x is known. errors: standard errors, (numbers,); of them `numerical` from the errors of the runs' steps.
    correlation: (numbers, numbers). factor: half the width of the 95 % interval in standard errors, by Student's t. independent:
    about how many places count."""

    errors: Array
    numerical: Array
    correlation: Array
    factor: float
    independent: float


def search(
    evaluate: Evaluate, measured: Array, parameters: Sequence[Parameter], start: Array, tolerance: float, most: int
) -> Found:
    """Searches from `start` on until a step is below `tolerance` in x, or `most` steps have been tried.

    measured [N]: the forces that residuals are judged by, (places,). Raises FitError if the model can't be had at the start or
    beside it, or if a number does not move it.
    """
    from scipy.optimize import least_squares

    scale = float(np.sqrt(np.mean(measured**2)))
    known: dict[bytes, Array] = {}
    # scipy judges a step by the size of its variable, here about 1.
    origin = start - 1.0

    def residuals(moved: Array) -> Array:
        x = origin + moved
        found = evaluate([x], "search")[0]
        if found is None:
            if not known:
                raise MissingRun("the run at the start could not be made, or has no whole loop; start elsewhere")
            # The search comes back from there.
            return np.full(measured.size, np.nan)
        known[x.tobytes()] = found
        return found / scale

    def jacobian(moved: Array) -> Array:
        x = origin + moved
        return derivatives(evaluate, parameters, x, known[x.tobytes()], scale)[0] / scale

    low, high = (np.array([one.place(getattr(one, side)) for one in parameters]) - origin for side in ("low", "high"))
    result = least_squares(
        residuals,
        start - origin,
        jacobian,
        (low, high),
        "trf",
        ftol=LEAST_GAIN,
        xtol=tolerance,
        gtol=None,
        max_nfev=most,
    )
    x = origin + result.x
    return Found(x, known[x.tobytes()], result.status > 0, result.message)


def derivatives(
    evaluate: Evaluate,
    parameters: Sequence[Parameter],
    x: Array,
    residuals: Array,
    scale: float,
    central: bool = False,
) -> tuple[Array, Array]:
    """J [N]: derivatives of the residuals, (places, numbers), by differences to one side, or to both; and the second differences
    [N], (places, numbers), 0 of one side alone.

    residuals [N]: at x. scale [N]: of the forces. Raises FitError for a number that does not move the curve.
    """
    ends = [_ends(parameter, place, central) for parameter, place in zip(parameters, x, strict=True)]
    units = np.eye(x.size)
    wanted = [x + (end - x[k]) * units[k] for k, both in enumerate(ends) for end in both if end != x[k]]
    found = iter(evaluate(wanted, "derivative"))
    columns, bends = [], []
    for k, parameter in enumerate(parameters):
        one, other = (residuals if end == x[k] else next(found) for end in ends[k])
        if one is None or other is None:
            raise MissingRun("a run next to the present numbers could not be made; give narrower --bounds")
        change, step = one - other, ends[k][0] - ends[k][1]
        if np.sqrt(np.mean(change**2)) <= UNMOVED * scale:
            raise FitError(
                f"--free {parameter.key}: changed by {100 * abs(step):.2g} %, it does not move the curve, so that no "
                "curve can tell it: leave it out"
            )
        columns.append(change / step)
        bends.append(one + other - 2.0 * residuals if x[k] not in ends[k] else np.zeros_like(residuals))
    return np.column_stack(columns), np.column_stack(bends)


def _ends(parameter: Parameter, place: float, central: bool) -> tuple[float, float]:
    """The two x between which a derivative is taken, within the bounds; one of them is `place` itself unless `central`."""
    up, down = min(place + STEP, parameter.place(parameter.high)), max(place - STEP, parameter.place(parameter.low))
    if central:
        return up, down
    return (up, place) if up - place >= 0.5 * STEP else (down, place)


def certainty(
    jacobian: Array, residuals: Array, measured: Array, share: float, bends: Array | None = None, branches: int = 2
) -> Certainty:
    """How well x is known at the end of a search.

    jacobian [N], residuals [N], measured forces [N], second differences `bends` [N]: see the head. share: by which forces of a
    run may be off, NaN where nothing is known of it. branches: equal parts of the places that are not neighbours. Raises FitError
    if different numbers move the curve in the same way.
    """
    count, numbers = jacobian.shape
    sizes = np.linalg.norm(jacobian, axis=0)
    _, singular, directions = np.linalg.svd(jacobian / sizes, full_matrices=False)
    if singular[-1] < 1e-6 * singular[0]:
        both = np.sort(np.argsort(-np.abs(directions[-1]))[:2])
        raise FitError(
            f"numbers {both[0] + 1} and {both[1] + 1} of --free move the curve in the same way: leave one out"
        )
    inverse = np.linalg.inv((jacobian / sizes).T @ (jacobian / sizes)) / np.outer(sizes, sizes)
    times = np.mean([autocorrelation_time(part) for part in np.split(residuals, branches)])
    independent = max(count / times, numbers + 1.0)
    variance = float(residuals @ residuals) / (independent - numbers) * independent / count
    statistical = inverse * variance * (count / independent)
    shift = inverse @ jacobian.T @ measured * (share if math.isfinite(share) else 0.0)
    # The second difference of noise has six times its variance.
    rough = inverse @ jacobian.T @ (np.zeros((count, 1)) if bends is None else bends) / math.sqrt(6.0)
    numerical = np.sqrt(shift**2 + np.mean(rough**2, axis=1))
    errors = np.sqrt(np.diag(statistical) + numerical**2)
    spread = np.sqrt(np.diag(inverse))
    factor = _student(independent - numbers)
    return Certainty(errors, numerical, inverse / np.outer(spread, spread), factor, float(independent))


def autocorrelation_time(values: Array) -> float:
    """How many neighbours of a series say the same: 1 for white noise; 1 + 2 sum of its autocorrelation until that is first
    negative."""
    values = values - values.mean()
    power = float(values @ values)
    if power == 0.0:
        return 1.0
    found = np.correlate(values, values, "full")[values.size - 1 :] / power
    negative = np.flatnonzero(found <= 0.0)
    return 1.0 + 2.0 * float(found[1 : negative[0] if negative.size else None].sum())


def _student(spare: float) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(spare, 0.5 + 0.5 * CONFIDENCE))
