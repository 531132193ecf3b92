"""Compiled kernels of the descent (descent.py), as those of kernels.py: sums are left as one partial sum a row."""

from __future__ import annotations

import math

import numpy as np

from .compiled import compiled
from .kernels import _cosine_of, _sine_of

_compile = compiled()
_compile_sums = compiled(fastmath={"reassoc", "contract", "nsz"})
_compile_maxima = compiled(fastmath={"reassoc", "contract", "nsz", "nnan"})

INDEPENDENT = 1e-8
"""A direction whose part independent of the others is smaller than this, squared and relative, is left out."""
SWEEPS = 12
"""Of Jacobi's method, which converges quadratically: three by three is done after four or five."""


@_compile_sums
def products(k, x, dx, z, dz, p, dp, offset, rows):
    """rows[0..5] of v K v' and rows[6..11] of v (dual of v'), for the pairs xx, xz, xp, zz, zp, pp of x, z, p;
    rows[12..13] of x dz and p dz, the slopes of Phi along x and p, as dz is the residual. x: of size 0 where there is
    none."""
    with_mode = x.size > 0
    for row in range(offset.size - 1):
        kzz, kzp, kpp, mzz, mzp, mpp, slope = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            b, c, bend = z[i], p[i], k[i]
            kzz += bend * b * b
            kzp += bend * b * c
            kpp += bend * c * c
            mzz += b * dz[i]
            mzp += b * dp[i]
            mpp += c * dp[i]
            slope += c * dz[i]
        kxx, kxz, kxp, mxx, mxz, mxp, turn = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        if with_mode:
            for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
                a, bend = x[i], k[i]
                kxx += bend * a * a
                kxz += bend * a * z[i]
                kxp += bend * a * p[i]
                mxx += a * dx[i]
                mxz += z[i] * dx[i]
                mxp += p[i] * dx[i]
                turn += a * dz[i]
        rows[0, row], rows[1, row], rows[2, row] = kxx, kxz, kxp
        rows[3, row], rows[4, row], rows[5, row] = kzz, kzp, kpp
        rows[6, row], rows[7, row], rows[8, row] = mxx, mxz, mxp
        rows[9, row], rows[10, row], rows[11, row] = mzz, mzp, mpp
        rows[12, row], rows[13, row] = turn, slope


@_compile_maxima
def probe(height, position, u, w, a, x, dx, b, z, dz, c, p, dp, history, compliance, law, offset, f, k, r, rows):
    """As kernels.evaluate, at u + s and w + J t with s = a x + b z + c p and t = a dx + b dz + c dp.

    rows[0..3] as there; rows[4..6] of x r, z r, p r; rows[7..12] of v K v' as in `products`; rows[13]: the largest |s|
    over points that are within reach, before or after, row by row.
    """
    stiffness, reach, attractive = law
    strength = attractive * stiffness * reach / math.pi
    depth = strength * reach / math.pi
    per_range = 1.0 / reach
    limit = reach if attractive > 0.0 else 0.0
    inverse = 1.0 / compliance
    with_mode = x.size > 0
    for row in range(offset.size - 1):
        pull, imbalance, potential, growth, largest = 0.0, 0.0, 0.0, 0.0, 0.0
        gz, gp, kzz, kzp, kpp = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            move = b * z[i] + c * p[i]
            turn = b * dz[i] + c * dp[i]
            if with_mode:
                move += a * x[i]
                turn += a * dx[i]
            load = w[i] + compliance * turn
            gap_before = position + height[i] - u[i]
            gap = gap_before - move
            overlap = min(gap, 0.0)
            y = min(max(gap * per_range, 0.0), 1.0) - 0.5
            sine, minus_cosine = _cosine_of(y * y), y * _sine_of(y * y)
            near = gap < limit
            traction = stiffness * overlap + (strength * sine if near else 0.0)
            bend = -stiffness * minus_cosine if near else 0.0
            interacting = near or gap_before < limit
            rest = traction - (load - history[i]) * inverse
            f[i] = traction
            k[i] = bend
            r[i] = rest
            pull += traction
            imbalance += rest
            potential += 0.5 * stiffness * overlap * overlap + (depth * (minus_cosine - 1.0) if near else 0.0)
            growth += move * (0.5 * (w[i] + load) - history[i]) * inverse
            largest = max(largest, abs(move) if interacting else 0.0)
            gz += z[i] * rest
            gp += p[i] * rest
            kzz += bend * z[i] * z[i]
            kzp += bend * z[i] * p[i]
            kpp += bend * p[i] * p[i]
        gx, kxx, kxz, kxp = 0.0, 0.0, 0.0, 0.0
        if with_mode:
            for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
                gx += x[i] * r[i]
                kxx += k[i] * x[i] * x[i]
                kxz += k[i] * x[i] * z[i]
                kxp += k[i] * x[i] * p[i]
        rows[0, row], rows[1, row], rows[2, row], rows[3, row] = pull, imbalance, potential, growth
        rows[4, row], rows[5, row], rows[6, row] = gx, gz, gp
        rows[7, row], rows[8, row], rows[9, row] = kxx, kxz, kxp
        rows[10, row], rows[11, row], rows[12, row] = kzz, kzp, kpp
        rows[13, row] = largest


@_compile
def move_on(step, weights, x, dx, z, dz, p, dp, compliance, u, w):
    """p = s = a x + b z + c p by the weights `step`, its dual t likewise;  u += s;  w += J t;  and x by `weights`."""
    a, b, c = step[0], step[1], step[2]
    i0, i1, i2 = weights[0], weights[1], weights[2]
    with_mode = x.size > 0
    for i in range(u.size):
        s, t = b * z[i] + c * p[i], b * dz[i] + c * dp[i]
        if with_mode:
            s, t = s + a * x[i], t + a * dx[i]
            x[i] = i0 * x[i] + i1 * z[i] + i2 * p[i]
            dx[i] = i0 * dx[i] + i1 * dz[i] + i2 * dp[i]
        u[i] += s
        w[i] += compliance * t
        p[i], dp[i] = s, t


@_compile
def _independent(norm, base):
    """Orthonormal directions, in the columns of base, of those whose products are `norm`; their number."""
    count = 0
    for j in range(3):
        if not norm[j, j] > 0.0:
            continue
        v = np.zeros(3)
        v[j] = 1.0 / math.sqrt(norm[j, j])
        for _ in range(2):
            for m in range(count):
                share = 0.0
                for a in range(3):
                    for b in range(3):
                        share += base[a, m] * norm[a, b] * v[b]
                for a in range(3):
                    v[a] -= share * base[a, m]
        left = 0.0
        for a in range(3):
            for b in range(3):
                left += v[a] * norm[a, b] * v[b]
        if left > INDEPENDENT:
            for a in range(3):
                base[a, count] = v[a] / math.sqrt(left)
            count += 1
    return count


@_compile
def _diagonal(small, turn, count):
    """Jacobi's method: turns the symmetric `small` (its first `count` rows and columns) until it is diagonal."""
    for _ in range(SWEEPS):
        for m in range(count):
            for n in range(m + 1, count):
                if small[m, n] == 0.0:
                    continue
                theta = 0.5 * (small[n, n] - small[m, m]) / small[m, n]
                t = 1.0 / (abs(theta) + math.sqrt(theta * theta + 1.0))
                t = t if theta >= 0.0 else -t
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for a in range(3):
                    one, two = small[a, m], small[a, n]
                    small[a, m], small[a, n] = c * one - s * two, s * one + c * two
                for a in range(3):
                    one, two = small[m, a], small[n, a]
                    small[m, a], small[n, a] = c * one - s * two, s * one + c * two
                for a in range(3):
                    one, two = turn[a, m], turn[a, n]
                    turn[a, m], turn[a, n] = c * one - s * two, s * one + c * two


@_compile
def modes_of(bend, norm, values, vectors):
    """Eigenvalues (3,), lowest first, and vectors (3, 3), in columns, of bend v = value norm v; returns their number.
    Directions of nothing, or that hardly differ from those before, are left out.

    Both matrices are symmetric, (3, 3). Compiled by hand, as LAPACK's start costs more than a small transform.
    """
    base, small, turn = np.zeros((3, 3)), np.zeros((3, 3)), np.eye(3)
    count = _independent(norm, base)
    for m in range(count):
        for n in range(count):
            for a in range(3):
                for b in range(3):
                    small[m, n] += base[a, m] * bend[a, b] * base[b, n]
    _diagonal(small, turn, count)
    for place in range(count):
        best = -1
        for m in range(count):
            if best < 0 or small[m, m] < small[best, best]:
                best = m
        values[place] = small[best, best]
        for a in range(3):
            vectors[a, place] = 0.0
            for m in range(count):
                vectors[a, place] += base[a, m] * turn[m, best]
        small[best, best] = np.inf
    return count
