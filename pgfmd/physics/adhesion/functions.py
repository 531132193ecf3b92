"""Elementary functions for the laws. In NumPy they take arrays, in kernels single numbers (solver/inlined_laws.py).

There are no branches in them and no calls of a library, so that loops over points are vectorised.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np


def clipped(value: Any, least: float, most: float) -> Any:
    """The value, limited to an interval."""
    return np.minimum(np.maximum(value, least), most)


def chosen(condition: Any, one: Any, other: Any) -> Any:
    """The first value if the condition holds, else the second."""
    return np.where(condition, one, other)


def piece_of(value: Any, knots: Any) -> Any:
    """Index of the piece between two ascending knots (m,) that contains a value; the first or the last one if it is
    outside."""
    return np.clip(np.searchsorted(knots, value, side="right") - 1, 0, knots.size - 2)


def exponential_of(x: Any) -> Any:
    """exp(-x) to rounding, 0 <= x <= 12: the Taylor series of its sixteenth root, squared four times."""
    root = _root_of(x * 0.0625)
    square = root * root
    fourth = square * square
    eighth = fourth * fourth
    return eighth * eighth


def _horner(coefficients: tuple[float, ...], variable: str) -> str:
    """The polynomial as nested products, as text: a loop over a tuple would not vectorise."""
    text = repr(coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        text = f"{coefficient!r} + {variable} * ({text})"
    return text


def _polynomial(coefficients: tuple[float, ...]) -> Callable[[Any], Any]:
    polynomial: Callable[[Any], Any] = eval(f"lambda q: {_horner(coefficients, 'q')}")
    return polynomial


_root_of = _polynomial(tuple((-1) ** k / math.factorial(k) for k in range(18)))
# cos(pi y) and sin(pi y)/y as functions of y^2, |y| <= 1/2, by their Taylor series to rounding: no branch, no call.
cosine_of = _polynomial(tuple((-1) ** k * math.pi ** (2 * k) / math.factorial(2 * k) for k in range(12)))
sine_of = _polynomial(tuple((-1) ** k * math.pi ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(12)))
