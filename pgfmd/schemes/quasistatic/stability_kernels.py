"""Compiled kernels of LOBPCG (lobpcg.py). As in kernels.py, sums are returned as one partial sum per row."""

from __future__ import annotations

import numpy as np

from pgfmd.hashing import STRIDE, scrambled
from pgfmd.physics.adhesion.base import Numbers
from pgfmd.solver.compiled import compiled, inlined
from pgfmd.solver.inlined_laws import stiffness

_compile = compiled()
_compile_sums = compiled(fastmath={"reassoc", "contract", "nsz"})
_scrambled = inlined(scrambled)
SEED_STRIDE = np.uint64(0xD1B54A32D192ED03)
"""An odd number, the distance of seeds."""
SOFTENED = 1e-6
"""Least softening of a point, relative to the law's stiffness; above the rounding of single precision."""


@inlined
def _hashed(point: int, seed: int) -> float:
    """A number between -1 and 1: a hash of the seed and of the point's global index, so that it does not depend on the
    distribution of points."""
    x = _scrambled(np.uint64(point) * STRIDE + np.uint64(seed) * SEED_STRIDE)
    return np.float64(np.int64(x >> np.uint64(12))) * 2.0**-51 - 1.0


@_compile
def noise(first_point: int, seed: int, k: np.ndarray, out: np.ndarray) -> None:
    """out = numbers between -1 and 1 at points that interact (K != 0), else 0. first_point: index of the first local
    point."""
    for i in range(out.size):
        out[i] = 0.0 if k[i] == 0.0 else _hashed(first_point + i, seed)


@_compile
def softened(
    first_point: int, seed: int, height: np.ndarray, position: float, u: np.ndarray, law: Numbers,
    k: np.ndarray, out: np.ndarray,
) -> None:  # fmt: skip
    """out = by how much the interface has softened at each point since the surface was u and the punch at `position`,
    max(K(d + z - u) - k, 0), times a random factor between 0.5 and 1.5; 0 within rounding. law: its Numbers."""
    least = SOFTENED * law.stiffness
    for i in range(out.size):
        gap = position + height[i] - u[i]
        before = stiffness(gap, law) if gap < law.reach else 0.0
        change = before - k[i]
        out[i] = change * (1.0 + 0.5 * _hashed(first_point + i, seed)) if change > least else 0.0


@_compile_sums
def pull_of(k: np.ndarray, x: np.ndarray, dual: np.ndarray, mu: float, amount: float, g: np.ndarray) -> None:
    """g = mu dual - K x + amount g: minus the gradient of the quotient x K x / (x dual), with what was in g as
    noise."""
    for i in range(x.size):
        g[i] = mu * dual[i] - k[i] * x[i] + amount * g[i]


@_compile_sums
def quotients(
    k: np.ndarray, x: np.ndarray, dx: np.ndarray, z: np.ndarray, dz: np.ndarray, p: np.ndarray, dp: np.ndarray,
    offset: np.ndarray, rows: np.ndarray,
) -> None:  # fmt: skip
    """rows[0..5] of v K v' and rows[6..11] of v (dual of v'), for the pairs xx, xz, xp, zz, zp, pp of x, z, p."""
    for row in range(offset.size - 1):
        kxx, kxz, kxp, kzz, kzp, kpp = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        mxx, mxz, mxp, mzz, mzp, mpp = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            a, b, c, bend = x[i], z[i], p[i], k[i]
            kxx += bend * a * a
            kxz += bend * a * b
            kxp += bend * a * c
            kzz += bend * b * b
            kzp += bend * b * c
            kpp += bend * c * c
            mxx += a * dx[i]
            mxz += a * dz[i]
            mxp += a * dp[i]
            mzz += b * dz[i]
            mzp += b * dp[i]
            mpp += c * dp[i]
        rows[0, row], rows[1, row], rows[2, row] = kxx, kxz, kxp
        rows[3, row], rows[4, row], rows[5, row] = kzz, kzp, kpp
        rows[6, row], rows[7, row], rows[8, row] = mxx, mxz, mxp
        rows[9, row], rows[10, row], rows[11, row] = mzz, mzp, mpp


@_compile
def recombine(a: float, b: float, c: float, x: np.ndarray, z: np.ndarray, p: np.ndarray) -> None:
    """p = b z + c p;  x = a x + p."""
    for i in range(x.size):
        change = b * z[i] + c * p[i]
        p[i] = change
        x[i] = a * x[i] + change
