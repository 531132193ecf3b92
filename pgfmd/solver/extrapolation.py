"""Polynomials through a few points in time. Plain Python."""

from __future__ import annotations

from collections.abc import Callable, Sequence

_GAUSS = ((0.5 - 0.5 * 0.6**0.5, 5 / 18), (0.5, 8 / 18), (0.5 + 0.5 * 0.6**0.5, 5 / 18))


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


def integral(times: Sequence[float], values: Sequence[float], factor: Callable[[float], float], span: float) -> float:
    """Integral from 0 to `span` of the polynomial through values at `times` times a linear factor(time), exact up to a
    cubic: Gauss's three points."""
    total = 0.0
    for place, share in _GAUSS:
        at = span * place
        here = sum(weight * value for weight, value in zip(lagrange_weights(times, at), values, strict=True))
        total += share * here * factor(at)
    return span * total
