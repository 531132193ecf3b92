"""Compiled kernels: one pass over memory where NumPy needs several. Each is documented by the mathematics it
evaluates.

Sums are left as one partial sum a row of the punch block (`offset` marks the rows in a point vector);
`PunchPoints.total_of` adds them in an order that does not depend on the number of ranks. Loops over a row's points run
over unsigned indices, as the test for negative ones keeps them from being vectorised. One thread a rank.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from .compiled import compiled, overloading

_compile = compiled()
# Sums over a row may be vectorised; the order within a row then depends on its length alone.
_compile_sums = compiled(fastmath={"reassoc", "contract", "nsz"})

# Maxima and minima vectorise only where NaN is ruled out: `observe`, which looks at every accepted step, is not among
# these.
_compile_maxima = compiled(fastmath={"reassoc", "contract", "nsz", "nnan"})


# Numbers of no sign are in the order of their bits. The largest of these is found many at a time, of the numbers
# themselves one by one.
def bits_of(number: Any) -> Any:
    """The bits of a number, in either precision, as an integer."""
    return number.view(np.int32 if number.dtype == np.float32 else np.int64)


def number_of(bits: Any) -> Any:
    """The number of these bits."""
    return bits.view(np.float32 if bits.dtype == np.int32 else np.float64)


@overloading(bits_of, inline="always")
def _bits_of(number: Any) -> Callable[[Any], Any]:
    if number == numba.types.float32:
        return lambda number: np.float32(number).view(np.int32)
    return lambda number: np.float64(number).view(np.int64)


@overloading(number_of, inline="always")
def _number_of(bits: Any) -> Callable[[Any], Any]:
    if bits == numba.types.int32:
        return lambda bits: np.int32(bits).view(np.float32)
    return lambda bits: np.int64(bits).view(np.float64)


# Conjugate gradients
# ---------------------------------------------------------------------------------------------------
@_compile_sums
def sum_in_rows(values: np.ndarray, offset: np.ndarray, rows: np.ndarray) -> None:
    """rows[0] of the values."""
    for row in range(offset.size - 1):
        total = 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            total += values[i]
        rows[0, row] = total


@_compile_sums
def dot(a: np.ndarray, b: np.ndarray, offset: np.ndarray, rows: np.ndarray) -> None:
    """rows[0] of a b."""
    for row in range(offset.size - 1):
        total = 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            total += a[i] * b[i]
        rows[0, row] = total


@_compile_sums
def turn_direction(
    z: np.ndarray, r: np.ndarray, beta: float, k: np.ndarray, p: np.ndarray, y: np.ndarray, offset: np.ndarray,
    rows: np.ndarray,
) -> None:  # fmt: skip
    """p = z + beta p;  y = r + beta y, so that A y = p;  rows[0] of p (y + K p)."""
    for row in range(offset.size - 1):
        total = 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            a = z[i] + beta * p[i]
            b = r[i] + beta * y[i]
            p[i] = a
            y[i] = b
            total += a * (b + k[i] * a)
        rows[0, row] = total


@_compile_maxima
def survey(z: np.ndarray, r: np.ndarray, k: np.ndarray, offset: np.ndarray, rows: np.ndarray) -> None:
    """What a correction z = A r of CG asks of all ranks. rows[0] of r z;  rows[1] of z K z;  rows[2] of K z;  rows[3]:
    the largest |z| over points that interact (K != 0), row by row."""
    none = bits_of(z.dtype.type(0.0))
    for row in range(offset.size - 1):
        energy, bend, pull, largest = 0.0, 0.0, 0.0, none
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            here = np.float64(z[i])
            stiff = k[i] * here
            energy += r[i] * here
            bend += here * stiff
            pull += stiff
            largest = max(largest, bits_of(abs(z[i])) if k[i] != 0.0 else none)
        rows[0, row] = energy
        rows[1, row] = bend
        rows[2, row] = pull
        rows[3, row] = number_of(largest)


# Rows do not matter here, so the last bits of a number must not depend on where it stands: no sum may be contracted.
@_compile
def turn_and_advance(
    z: np.ndarray, beta: float, alpha: float, k: np.ndarray, p: np.ndarray, y: np.ndarray, s: np.ndarray,
    t: np.ndarray, r: np.ndarray, first: bool, last: bool, rows: np.ndarray,
) -> None:  # fmt: skip
    """p = z + beta p;  y = r + beta y;  s += alpha p;  t += alpha y;  r -= alpha (y + K p), in one pass, in the precision
    of the vectors; the first one begins with all of them zero, whatever is in them, the last one leaves p, y and r.

    rows[0], rows[1]: the largest |p| and |s| over points that interact (K != 0), in the first row, zero in the others; the
    first not of the last pass, the second not of one that is first and last.
    """
    real = p.dtype.type
    beta, alpha, none = real(beta), real(alpha), bits_of(real(0.0))
    turn, size = none, none
    if first and last:
        for i in range(p.size):
            s[i] = alpha * z[i]
            t[i] = alpha * r[i]
    elif first:
        for i in range(p.size):
            a, b = z[i], r[i]
            moved = alpha * a
            p[i] = a
            y[i] = b
            s[i] = moved
            t[i] = alpha * b
            r[i] = b - alpha * (b + k[i] * a)
            interacts = k[i] != 0.0
            turn = max(turn, bits_of(abs(a)) if interacts else none)
            size = max(size, bits_of(abs(moved)) if interacts else none)
    elif last:
        for i in range(p.size):
            moved = s[i] + alpha * (z[i] + beta * p[i])
            s[i] = moved
            t[i] += alpha * (r[i] + beta * y[i])
            size = max(size, bits_of(abs(moved)) if k[i] != 0.0 else none)
    else:
        for i in range(p.size):
            a = z[i] + beta * p[i]
            b = r[i] + beta * y[i]
            moved = s[i] + alpha * a
            p[i] = a
            y[i] = b
            s[i] = moved
            t[i] += alpha * b
            r[i] -= alpha * (b + k[i] * a)
            interacts = k[i] != 0.0
            turn = max(turn, bits_of(abs(a)) if interacts else none)
            size = max(size, bits_of(abs(moved)) if interacts else none)
    rows[:2] = 0.0
    if rows.shape[1]:
        rows[0, 0] = number_of(turn)
        rows[1, 0] = number_of(size)


@_compile_maxima
def advance(
    alpha: float, p: np.ndarray, y: np.ndarray, k: np.ndarray, s: np.ndarray, t: np.ndarray, r: np.ndarray,
    offset: np.ndarray, rows: np.ndarray,
) -> None:  # fmt: skip
    """s += alpha p;  t += alpha y;  r -= alpha (y + K p).

    rows[0], rows[1]: the largest |alpha p| and |s| over points that interact (K != 0), row by row;  rows[2] of r.
    """
    for row in range(offset.size - 1):
        change, size, imbalance = 0.0, 0.0, 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            move = alpha * p[i]
            s[i] += move
            t[i] += alpha * y[i]
            rest = r[i] - (alpha * y[i] + k[i] * move)
            r[i] = rest
            imbalance += rest
            interacting = k[i] != 0.0
            change = max(change, abs(move) if interacting else 0.0)
            size = max(size, abs(s[i]) if interacting else 0.0)
        rows[0, row] = change
        rows[1, row] = size
        rows[2, row] = imbalance


@_compile
def largest_in_rows(values: np.ndarray, k: np.ndarray, offset: np.ndarray, rows: np.ndarray) -> None:
    """rows[0]: the largest |value| over points that interact (K != 0), row by row."""
    for row in range(offset.size - 1):
        largest = 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            if k[i] != 0.0:
                largest = max(largest, abs(values[i]))
        rows[0, row] = largest


@_compile
def move(u: np.ndarray, w: np.ndarray, s: np.ndarray, t: np.ndarray, step: float, weight: float) -> None:
    """u += step s;  w += weight t."""
    for i in range(u.size):
        u[i] += step * s[i]
        w[i] += weight * t[i]


# Prediction and its error
# ----------------------------------------------------------------------------------------------
@_compile
def combine(c0: float, a0: np.ndarray, c1: float, a1: np.ndarray, c2: float, a2: np.ndarray, out: np.ndarray) -> None:
    """out = c0 a0 + c1 a1 + c2 a2."""
    for i in range(out.size):
        out[i] = c0 * a0[i] + c1 * a1[i] + c2 * a2[i]


@_compile
def largest_difference_near(
    c0: float, a0: np.ndarray, c1: float, a1: np.ndarray, c2: float, a2: np.ndarray, u: np.ndarray,
    height: np.ndarray, position: float, reach: float,
) -> tuple[float, float]:  # fmt: skip
    """max |u - (c0 a0 + c1 a1 + c2 a2)| and max |u - a0| over points whose gap, by one or the other, is below reach; 0
    without any."""
    none = bits_of(0.0)
    largest, change = none, none
    for i in range(u.size):
        here, before = np.float64(u[i]), np.float64(a0[i])
        other = c0 * before + c1 * a1[i] + c2 * a2[i]
        near = (position + height[i] - here < reach) | (position + height[i] - other < reach)
        largest = max(largest, bits_of(abs(here - other)) if near else none)
        change = max(change, bits_of(abs(here - before)) if near else none)
    return number_of(largest), number_of(change)


# Sums over rows
# ----------------------------------------------------------------------------------------------
@_compile_sums
def reduce_rows(rows: np.ndarray, sums: int, images: int, out: np.ndarray) -> None:
    """out: `images` times the sums over all rows of the first `sums` kinds of numbers, the largest of the others."""
    for kind in range(sums):
        total = 0.0
        for i in range(rows.shape[1]):
            total += rows[kind, i]
        out[kind] = images * total
    for kind in range(sums, rows.shape[0]):
        largest = -math.inf
        for i in range(rows.shape[1]):
            largest = max(largest, rows[kind, i])
        out[kind] = largest
