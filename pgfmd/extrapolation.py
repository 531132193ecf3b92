"""Polynomials through a few points in time. Plain Python."""

from __future__ import annotations

from collections.abc import Sequence


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


def parabola_integral(times: Sequence[float], values: Sequence[float], span: float) -> float:
    """Integral from 0 to `span` of the polynomial, at most of degree 3, through `values` at `times`: Gauss's two
    points."""
    total = 0.0
    for at in (0.5 * span * (1.0 - 3.0**-0.5), 0.5 * span * (1.0 + 3.0**-0.5)):
        total += sum(weight * value for weight, value in zip(lagrange_weights(times, at), values, strict=True))
    return 0.5 * span * total
