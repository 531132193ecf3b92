"""Compiled kernels of the law of adhesion: traction and energy between surface and punch (kernels.py).

Each is documented by the mathematics it evaluates.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pgfmd.physics.adhesion.base import Numbers

from .compiled import inlined
from .inlined_laws import attraction, energy
from .kernels import _compile_maxima, _compile_sums, bits_of, number_of

BLOCK = 64
"""Points of a row that are looked at together: where none of them is attracted, all in contact or out of reach, nothing of
the law has to be computed."""


@_compile_maxima
def evaluate(
    height: np.ndarray, position: float, u: np.ndarray, w: np.ndarray, s: np.ndarray, t: np.ndarray, step: float,
    weight: float, history: np.ndarray, compliance: float, law: Numbers, offset: np.ndarray,
    f: np.ndarray, k: np.ndarray, r: np.ndarray, rows: np.ndarray,
) -> None:  # fmt: skip
    """Traction, stiffness and out-of-balance stress of one implicit step, at the trial u + step s, w + weight t.

    gap = d + z - u;  f = Gamma'(gap);  K = Gamma''(gap);  r = f - (w - history) / J
    rows[0] of f, rows[1] of r [Pa];  rows[2] of Gamma(gap), rows[3] of step s ((w + trial's w)/2 - history) / J, by
    which the rest of the incremental potential grows along s, as A is symmetric [Pa m].
    law: its Numbers.
    """
    _, _, depth, lowest = attraction(0.0, law)
    inverse, deepest = 1.0 / compliance, depth * lowest
    # Of a block: its gaps, and potentials of attraction. Attractions themselves are left in f.
    gaps, depths = np.empty(BLOCK), np.empty(BLOCK)
    for row in range(offset.size - 1):
        pull, imbalance, potential, growth = 0.0, 0.0, 0.0, 0.0
        for begin in range(offset[row], offset[row + 1], BLOCK):
            start, count, attracted = np.uint64(begin), np.uint64(min(BLOCK, offset[row + 1] - begin)), 0
            for j in range(count):
                gap = position + height[start + j] - (u[start + j] + step * s[start + j])
                gaps[j] = gap
                attracted += 1 if (gap > 0.0) & (gap < law.reach) else 0
            if attracted:
                for j in range(count):
                    near = gaps[j] < law.reach
                    drawn, bend, depth, level = attraction(gaps[j], law)
                    f[start + j] = drawn if near else 0.0
                    k[start + j] = bend if near else 0.0
                    depths[j] = depth * level if near else 0.0
            else:
                # What is in contact is as deep as at the end of the attraction.
                for j in range(count):
                    f[start + j] = 0.0
                    k[start + j] = law.overlap if gaps[j] < law.reach else 0.0
                    depths[j] = deepest if gaps[j] < law.reach else 0.0
            for j in range(count):
                i = start + j
                overlap = min(gaps[j], 0.0)
                traction, effective = law.overlap * overlap + f[i], w[i] + weight * t[i]
                rest = traction - (effective - history[i]) * inverse
                f[i] = traction
                r[i] = rest
                pull += traction
                imbalance += rest
                potential += 0.5 * law.overlap * overlap * overlap + depths[j]
                growth += s[i] * (0.5 * (w[i] + effective) - history[i])
        rows[0, row] = pull
        rows[1, row] = imbalance
        rows[2, row] = potential
        rows[3, row] = step * inverse * growth


@inlined
def count_below(
    height: np.ndarray, position: float, u: np.ndarray, start: int, stop: int, levels: tuple[float, float, float]
) -> tuple[float, float, float]:
    """How many points of a row, from start to stop, have a gap below each of three levels [m]."""
    first, second, third = levels
    below_first, below_second, below_third = 0.0, 0.0, 0.0
    for i in range(np.uint64(start), np.uint64(stop)):
        gap = position + height[i] - u[i]
        below_first += 1.0 if gap < first else 0.0
        below_second += 1.0 if gap < second else 0.0
        below_third += 1.0 if gap < third else 0.0
    return below_first, below_second, below_third


@inlined
def place_of(number: Any) -> Any:
    """An integer that is in the order of double numbers, those below zero included."""
    bits = bits_of(number)
    return bits ^ ((bits >> np.int64(63)) & np.int64(0x7FFFFFFFFFFFFFFF))


@inlined
def number_at(place: Any) -> Any:
    """The number of a place."""
    return number_of(place ^ ((place >> np.int64(63)) & np.int64(0x7FFFFFFFFFFFFFFF)))


@_compile_sums
def observe(
    height: np.ndarray, position: float, u: np.ndarray, f: np.ndarray, weights: np.ndarray, law: Numbers,
    levels: tuple[float, float, float], offset: np.ndarray, rows: np.ndarray,
) -> None:  # fmt: skip
    """What a curve row needs. rows: [0], [1], [2] points with a gap below each of the levels [m], [3] Gamma [J/m^2],
    [4] weights f, [5] minus the smallest gap."""
    weighted = weights.size == u.size
    first, second, third = levels
    for row in range(offset.size - 1):
        adhesive, far, closest = 0.0, 0.0, place_of(math.inf)
        below_first, below_second, below_third = 0, 0, 0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            gap = position + height[i] - u[i]
            closest = min(closest, place_of(gap))
            below_first += 1 if gap < first else 0
            below_second += 1 if gap < second else 0
            below_third += 1 if gap < third else 0
            overlap = min(gap, 0.0)
            adhesive += 0.5 * law.overlap * overlap * overlap
            depth, level = energy(gap, law)
            adhesive += depth * level if gap < law.reach else 0.0
        if weighted:
            for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
                far += weights[i] * f[i]
        rows[0, row] = below_first
        rows[1, row] = below_second
        rows[2, row] = below_third
        rows[3, row] = adhesive
        rows[4, row] = far
        rows[5, row] = -number_at(closest)
