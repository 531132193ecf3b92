"""Compiled kernels of the descent (descent.py), as those of kernels.py: sums are left as one partial sum a row."""

from __future__ import annotations

import numpy as np

from pgfmd.physics.adhesion.base import Numbers

from .compiled import compiled
from .inlined_laws import attraction

_compile = compiled()
_compile_sums = compiled(fastmath={"reassoc", "contract", "nsz"})
_compile_maxima = compiled(fastmath={"reassoc", "contract", "nsz", "nnan"})


@_compile_sums
def products(
    k: np.ndarray, z: np.ndarray, dz: np.ndarray, p: np.ndarray, dp: np.ndarray, offset: np.ndarray, rows: np.ndarray
) -> None:
    """rows[0..2] of z K z, z K p, p K p; rows[3..5] of z dz, p dz, p dp: where dz is the residual, the first two of these
    are the slopes of Phi along z and p, downhill."""
    for row in range(offset.size - 1):
        kzz, kzp, kpp, mzz, mzp, mpp = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            b, c, bend = z[i], p[i], k[i]
            kzz += bend * b * b
            kzp += bend * b * c
            kpp += bend * c * c
            mzz += b * dz[i]
            mzp += c * dz[i]
            mpp += c * dp[i]
        rows[0, row], rows[1, row], rows[2, row] = kzz, kzp, kpp
        rows[3, row], rows[4, row], rows[5, row] = mzz, mzp, mpp


@_compile_maxima
def probe(
    height: np.ndarray, position: float, u: np.ndarray, w: np.ndarray, b: float, z: np.ndarray, dz: np.ndarray,
    c: float, p: np.ndarray, dp: np.ndarray, history: np.ndarray, compliance: float, law: Numbers,
    offset: np.ndarray, f: np.ndarray, k: np.ndarray, r: np.ndarray, rows: np.ndarray,
) -> None:  # fmt: skip
    """As kernels.evaluate, at u + s and w + J t with s = b z + c p and t = b dz + c dp.

    rows[0..3] as there; rows[4..5] of z r, p r; rows[6..8] of z K z, z K p, p K p; rows[9]: the largest |s| over points
    that are within reach, before or after, row by row.
    """
    inverse = 1.0 / compliance
    for row in range(offset.size - 1):
        pull, imbalance, potential, growth, largest = 0.0, 0.0, 0.0, 0.0, 0.0
        gz, gp, kzz, kzp, kpp = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            move = b * z[i] + c * p[i]
            effective = w[i] + compliance * (b * dz[i] + c * dp[i])
            gap_before = position + height[i] - u[i]
            gap = gap_before - move
            overlap = min(gap, 0.0)
            pressed, wall = law.overlap * overlap, 0.5 * law.overlap * overlap * overlap
            near = gap < law.reach
            if near:
                drawn, bend, depth, level = attraction(gap, law)
                traction, below = pressed + drawn, depth * level
            else:
                traction, bend, below = pressed, 0.0, 0.0
            interacting = near or gap_before < law.reach
            rest = traction - (effective - history[i]) * inverse
            f[i] = traction
            k[i] = bend
            r[i] = rest
            pull += traction
            imbalance += rest
            potential += wall + below
            growth += move * (0.5 * (w[i] + effective) - history[i]) * inverse
            largest = max(largest, abs(move) if interacting else 0.0)
            gz += z[i] * rest
            gp += p[i] * rest
            kzz += bend * z[i] * z[i]
            kzp += bend * z[i] * p[i]
            kpp += bend * p[i] * p[i]
        rows[0, row], rows[1, row], rows[2, row], rows[3, row] = pull, imbalance, potential, growth
        rows[4, row], rows[5, row] = gz, gp
        rows[6, row], rows[7, row], rows[8, row] = kzz, kzp, kpp
        rows[9, row] = largest


@_compile
def move_on(
    b: float, z: np.ndarray, dz: np.ndarray, c: float, p: np.ndarray, dp: np.ndarray, compliance: float,
    u: np.ndarray, w: np.ndarray,
) -> None:  # fmt: skip
    """p = s = b z + c p, its dual t likewise;  u += s;  w += J t."""
    for i in range(u.size):
        s, t = b * z[i] + c * p[i], b * dz[i] + c * dp[i]
        u[i] += s
        w[i] += compliance * t
        p[i], dp[i] = s, t
