"""Polynomials through a few points in time. Plain Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence

GAUSS = ((0.5 - 0.5 * 0.6**0.5, 5 / 18), (0.5, 8 / 18), (0.5 + 0.5 * 0.6**0.5, 5 / 18))


def lagrange_weights(times: Sequence[float], at: float) -> list[float]:
    """Weights of the polynomial through values at `times`, evaluated `at`; times must differ."""
    weights = []
    for i, here in enumerate(times):
        weight = 1.0
        for j, other in enumerate(times):
            if j != i:
                weight *= (at - other) / (here - other)
        weights.append(weight)
    return weights


def lagrange_slopes(times: Sequence[float], at: float) -> list[float]:
    """Weights of the slope of the polynomial through values at `times`, evaluated `at`; times must differ."""
    slopes = []
    for i, here in enumerate(times):
        slope = 0.0
        for k, left_out in enumerate(times):
            if k == i:
                continue
            term = 1.0 / (here - left_out)
            for j, other in enumerate(times):
                if j not in (i, k):
                    term *= (at - other) / (here - other)
            slope += term
        slopes.append(slope)
    return slopes


def integral(times: Sequence[float], values: Sequence[float], factor: Callable[[float], float], span: float) -> float:
    """Integral from 0 to `span` of the polynomial through values at `times` times a linear factor(time), exact up to a
    cubic: Gauss's three points."""
    total = 0.0
    for place, share in GAUSS:
        at = span * place
        here = sum(weight * value for weight, value in zip(lagrange_weights(times, at), values, strict=True))
        total += share * here * factor(at)
    return span * total
