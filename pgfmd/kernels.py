"""Compiled kernels: one pass over memory where NumPy needs several. Each stands beside the line of mathematics it evaluates.

Sums are left as one partial sum a row of the punch block (`offset` marks the rows in a point vector); `PunchPoints.total_of`
adds them in an order that does not depend on the number of ranks. One thread a rank.
"""

from __future__ import annotations

import math

import numba
import numpy as np

_compile = numba.njit(cache=True, nogil=True)
# Sums over a row may be vectorised; the order within a row then depends on its length alone.
_compile_sums = numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})


# Transform: rows and columns in and out of the buffers of one batch --------------------------------------------------
@_compile
def scatter_rows(vector, offset, first, row, count, nb, scale, line):
    """line[i, first:last] = scale * (row `row + i` of the point vector), zero in the rest of the first nb columns."""
    for i in range(count):
        start, stop, column = offset[row + i], offset[row + i + 1], first[row + i]
        for j in range(column):
            line[i, j] = 0.0
        for j in range(stop - start):
            line[i, column + j] = scale * vector[start + j]
        for j in range(column + stop - start, line.shape[1]):
            line[i, j] = 0.0


@_compile
def gather_rows(line, offset, first, row, count, vector):
    """The inverse of `scatter_rows`, without scale."""
    for i in range(count):
        start, stop, column = offset[row + i], offset[row + i + 1], first[row + i]
        for j in range(stop - start):
            vector[start + j] = line[i, column + j]


@_compile
def load_columns(columns, column, count, buffer):
    """buffer[j, :nb] = columns[:, column + j], zeros behind."""
    nb = columns.shape[0]
    for i in range(nb):
        for j in range(count):
            buffer[j, i] = columns[i, column + j]
    for j in range(count):
        for i in range(nb, buffer.shape[1]):
            buffer[j, i] = 0.0


@_compile
def multiply_columns(buffer, multiplier, column, count):
    """buffer[j, ky] *= G(column + j, |ky|)."""
    n = buffer.shape[1]
    half = n // 2
    for j in range(count):
        row = multiplier[column + j]
        for k in range(half + 1):
            buffer[j, k] *= row[k]
        for k in range(half + 1, n):
            buffer[j, k] *= row[n - k]


@_compile
def store_columns(buffer, column, count, first, columns):
    """columns[i, column + j] = buffer[j, first + i], periodically."""
    n = buffer.shape[1]
    for i in range(columns.shape[0]):
        k = (first + i) % n
        for j in range(count):
            columns[i, column + j] = buffer[j, k]


# Cohesion and the incremental potential ------------------------------------------------------------------------------
@_compile_sums
def evaluate(height, position, u, w, s, t, step, weight, history, compliance, law, offset, f, k, r, rows):
    """Traction, stiffness and out-of-balance stress of one implicit step, at the trial u + step s, w + weight t.

    gap = d + z - u;  f = Gamma'(gap);  K = Gamma''(gap);  r = f - (w - history) / J
    rows[0] of the incremental potential u (w/2 - history) / J + Gamma(gap) [Pa m];  rows[1] of f, rows[2] of r [Pa].
    law = (stiffness K_0, range rho, attractive 0 or 1).
    """
    stiffness, reach, attractive = law
    strength = stiffness * reach / math.pi
    depth = attractive * strength * reach / math.pi
    per_range = math.pi / reach
    inverse = 1.0 / compliance
    for row in range(offset.size - 1):
        potential, pull, imbalance = 0.0, 0.0, 0.0
        for i in range(offset[row], offset[row + 1]):
            here = u[i] + step * s[i]
            load = w[i] + weight * t[i]
            gap = position + height[i] - here
            if gap < 0.0:
                traction = stiffness * gap
                curvature = stiffness
                energy = 0.5 * traction * gap - 2.0 * depth
            elif gap < reach and attractive > 0.0:
                angle = per_range * gap
                cosine = math.cos(angle)
                traction = strength * math.sin(angle)
                curvature = stiffness * cosine
                energy = -depth * (1.0 + cosine)
            else:
                traction, curvature, energy = 0.0, 0.0, 0.0
            f[i] = traction
            k[i] = curvature
            rest = traction - (load - history[i]) * inverse
            r[i] = rest
            imbalance += rest
            potential += here * (0.5 * load - history[i]) * inverse + energy
            pull += traction
        rows[0, row] = potential
        rows[1, row] = pull
        rows[2, row] = imbalance


@_compile_sums
def observe(height, position, u, f, weights, law, offset, rows):
    """What a curve row needs. rows: [0] points with gap < 0, [1] Gamma [J/m^2], [2] weights f, [3] minus the smallest gap."""
    stiffness, reach, attractive = law
    depth = attractive * stiffness * reach * reach / math.pi**2
    weighted = weights.size == u.size
    for row in range(offset.size - 1):
        contact, energy, far, closest = 0.0, 0.0, 0.0, math.inf
        for i in range(offset[row], offset[row + 1]):
            gap = position + height[i] - u[i]
            closest = min(closest, gap)
            if gap < 0.0:
                contact += 1.0
                energy += 0.5 * stiffness * gap * gap - 2.0 * depth
            elif gap < reach and attractive > 0.0:
                energy -= depth * (1.0 + math.cos(math.pi * gap / reach))
            if weighted:
                far += weights[i] * f[i]
        rows[0, row] = contact
        rows[1, row] = energy
        rows[2, row] = far
        rows[3, row] = -closest


# Conjugate gradients ---------------------------------------------------------------------------------------------------
@_compile_sums
def dot(a, b, offset, rows):
    """rows[0] of a b."""
    for row in range(offset.size - 1):
        total = 0.0
        for i in range(offset[row], offset[row + 1]):
            total += a[i] * b[i]
        rows[0, row] = total


@_compile_sums
def turn_direction(z, r, beta, k, p, y, offset, rows):
    """p = z + beta p;  y = r + beta y, so that A y = p;  rows[0] of p (y + K p)."""
    for row in range(offset.size - 1):
        total = 0.0
        for i in range(offset[row], offset[row + 1]):
            a = z[i] + beta * p[i]
            b = r[i] + beta * y[i]
            p[i] = a
            y[i] = b
            total += a * (b + k[i] * a)
        rows[0, row] = total


@_compile
def advance(alpha, p, y, k, s, t, r, offset, rows):
    """s += alpha p;  t += alpha y;  r -= alpha (y + K p).

    rows[0], rows[1]: the largest |alpha p| and |s| over points that interact (K != 0), row by row;  rows[2] of r.
    """
    for row in range(offset.size - 1):
        change, size, imbalance = 0.0, 0.0, 0.0
        for i in range(offset[row], offset[row + 1]):
            move = alpha * p[i]
            s[i] += move
            t[i] += alpha * y[i]
            rest = r[i] - (alpha * y[i] + k[i] * move)
            r[i] = rest
            imbalance += rest
            if k[i] != 0.0:
                change = max(change, abs(move))
                size = max(size, abs(s[i]))
        rows[0, row] = change
        rows[1, row] = size
        rows[2, row] = imbalance


@_compile
def largest_in_rows(values, k, offset, rows):
    """rows[0]: the largest |value| over points that interact (K != 0), row by row."""
    for row in range(offset.size - 1):
        largest = 0.0
        for i in range(offset[row], offset[row + 1]):
            if k[i] != 0.0:
                largest = max(largest, abs(values[i]))
        rows[0, row] = largest


@_compile
def move(u, w, s, t, step, weight):
    """u += step s;  w += weight t."""
    for i in range(u.size):
        u[i] += step * s[i]
        w[i] += weight * t[i]


# Prediction and its error ----------------------------------------------------------------------------------------------
@_compile
def combine(c0, a0, c1, a1, c2, a2, out):
    """out = c0 a0 + c1 a1 + c2 a2."""
    for i in range(out.size):
        out[i] = c0 * a0[i] + c1 * a1[i] + c2 * a2[i]


@_compile
def largest_difference_near(c0, a0, c1, a1, c2, a2, u, height, position, reach):
    """max |u - (c0 a0 + c1 a1 + c2 a2)| over points whose gap, by one or the other, is below reach; 0 where there is none."""
    largest = 0.0
    for i in range(u.size):
        other = c0 * a0[i] + c1 * a1[i] + c2 * a2[i]
        if position + height[i] - max(u[i], other) < reach:
            largest = max(largest, abs(u[i] - other))
    return largest


# Retardation ------------------------------------------------------------------------------------------------------------
@_compile
def weigh_branches(branches, weights, out):
    """out[i] = sum_m weights[i, m] branches[m], for all stages i in one pass over the branches."""
    elements, size = branches.shape
    out[:] = 0.0
    for m in range(elements):
        row = branches[m]
        for i in range(out.shape[0]):
            weight = weights[i, m]
            total = out[i]
            for p in range(size):
                total[p] += weight * row[p]


@_compile
def advance_branches(branches, decay, stages, gain, count):
    """branches[m] = decay[m] branches[m] + sum_{j < count} gain[m, j] stages[j]."""
    elements, size = branches.shape
    for m in range(elements):
        row = branches[m]
        keep = decay[m]
        for i in range(size):
            total = keep * row[i]
            for j in range(count):
                total += gain[m, j] * stages[j, i]
            row[i] = total


@_compile_sums
def advance_branches_and_energy(
    phi, psi, decay, f, g, gain, rate_decay, rate_gain, quadrature, compliances, count, offset, rows
):
    """`advance_branches` for phi and for psi = G0 phi, with the energies that they store and dissipate.

    The rates of stage i are k_i = f_i - phi_i = rate_decay[m, i] phi_n + sum_j rate_gain[m, i, j] f_j, likewise for psi.
    rows[0] of sum_m J_m phi_m psi_m / 2;  rows[1] of sum_m sum_i quadrature[m, i] k_i G0 k_i,  [Pa m].
    """
    elements = phi.shape[0]
    for row in range(offset.size - 1):
        stored, lost = 0.0, 0.0
        for m in range(elements):
            half = 0.5 * compliances[m]
            for p in range(offset[row], offset[row + 1]):
                a, b = phi[m, p], psi[m, p]
                new_a, new_b = decay[m] * a, decay[m] * b
                for i in range(count):
                    new_a += gain[m, i] * f[i, p]
                    new_b += gain[m, i] * g[i, p]
                    rate_a, rate_b = rate_decay[m, i] * a, rate_decay[m, i] * b
                    for j in range(i + 1):
                        rate_a += rate_gain[m, i, j] * f[j, p]
                        rate_b += rate_gain[m, i, j] * g[j, p]
                    lost += quadrature[m, i] * rate_a * rate_b
                phi[m, p], psi[m, p] = new_a, new_b
                stored += half * new_a * new_b
        rows[0, row] = stored
        rows[1, row] = lost
