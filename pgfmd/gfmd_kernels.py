"""Compiled kernels of the scheme `gfmd`. Complex arrays come as their real view, (..., 2 columns): all coefficients are
real, and the loops vectorise. See kernels.py for the conventions of sums."""

from __future__ import annotations

import math

import numba
import numpy as np

from pgfmd.kernels import _compile, _compile_maxima, _cosine_of, _sine_of

_compile_sums = numba.njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})


@_compile
def spread(traction, offset, first, top, left, plane):
    """The traction of the points under the punch on the rows of the plane, zero elsewhere.

    top: the plane's local row of the first local row of the punch block; left: the block's first column.
    """
    rows, columns = plane.shape
    for row in range(rows):
        target = plane[row]
        local = row - top
        if 0 <= local < offset.size - 1:
            count = offset[local + 1] - offset[local]
            begin = left + first[local]
            target[:begin] = 0.0
            target[begin : begin + count] = traction[offset[local] : offset[local + 1]]
            target[begin + count :] = 0.0
        else:
            target[:] = 0.0


@_compile_maxima
def touch(plane, top, left, first, height, position, law, offset, u, f, rows):
    """The surface under the punch, out of the plane, and the traction there: u, f = Gamma'(d + z - u).

    rows: [0] points with gap < 0, [1] Gamma [J/m^2], [2] f [Pa], [3] minus the smallest gap [m].
    """
    stiffness, reach, attractive = law
    strength = attractive * stiffness * reach / math.pi
    depth = strength * reach / math.pi
    per_range = 1.0 / reach
    limit = reach if attractive > 0.0 else 0.0
    for row in range(offset.size - 1):
        source = plane[top + row]
        begin = left + first[row]
        start = offset[row]
        contact, energy, pull, closest = 0.0, 0.0, 0.0, math.inf
        for i in range(np.uint64(offset[row + 1] - start)):
            here = source[begin + i]
            gap = position + height[start + i] - here
            overlap = min(gap, 0.0)
            y = min(max(gap * per_range, 0.0), 1.0) - 0.5
            sine, minus_cosine = _cosine_of(y * y), y * _sine_of(y * y)
            near = gap < limit
            traction = stiffness * overlap + (strength * sine if near else 0.0)
            u[start + i] = here
            f[start + i] = traction
            contact += 1.0 if gap < 0.0 else 0.0
            energy += 0.5 * stiffness * overlap * overlap + (depth * (minus_cosine - 1.0) if near else 0.0)
            pull += traction
            closest = min(closest, gap)
        rows[0, row] = contact
        rows[1, row] = energy
        rows[2, row] = pull
        rows[3, row] = -closest


@_compile
def advance_modes(buffer, compliance, u, v, branches, weights, keep, kick, step, decay, old_gain, new_gain, stiffness):
    """One step of every mode; `buffer` holds the traction and is given the new u, both (n, 2 columns).

    v = keep v + kick (G0 f + sum_m kappa_m u_m - kappa_inf u);  u_new = u + step v
    u_m = decay_m u_m + old_gain_m u + new_gain_m u_new        exact for a u that is linear within the step
    compliance G0 / n^2, (n//2 + 1, 2 columns): even in ky, each column twice. branches (N, n, 2 columns); weights:
    kappa_m.
    """
    n, width = buffer.shape
    elements = branches.shape[0]
    work = np.empty(width)
    for k in range(n // 2 + 1):
        other = n - k if 0 < k < n - k else k
        for i in (k, other):
            if i == k or other != k:
                _advance_row(
                    buffer[i], compliance[k], u[i], v[i], branches, i, weights, keep, kick, step, decay, old_gain,
                    new_gain, stiffness, elements, work,
                )  # fmt: skip
            if other == k:
                break


@numba.njit(cache=True, nogil=True, fastmath={"contract"})
def _advance_row(
    buffer, compliance, u, v, branches, i, weights, keep, kick, step, decay, old_gain, new_gain, stiffness, elements, work
):
    width = buffer.size
    for c in range(width):
        work[c] = compliance[c] * buffer[c] - stiffness * u[c]
    for m in range(elements):
        branch, weight = branches[m, i], weights[m]
        for c in range(width):
            work[c] += weight * branch[c]
    for c in range(width):
        old = u[c]
        speed = keep * v[c] + kick * work[c]
        new = old + step * speed
        v[c] = speed
        u[c] = new
        buffer[c] = new
        work[c] = old
    for m in range(elements):
        branch, kept, a, b = branches[m, i], decay[m], old_gain[m], new_gain[m]
        for c in range(width):
            branch[c] = kept * branch[c] + a * work[c] + b * u[c]


@_compile_sums
def mode_energies(compliance, u, v, branches, weights, rates, fold, sums):
    """Sums over the modes of each column, with k_0 = 1/G0; modes without compliance don't move.

    sums (3, columns): [0] k_0 (|u|^2 + sum_m kappa_m |u - u_m|^2) / 2, [1] k_0 |v|^2, [2] sum_m k_0 kappa_m |u -
    u_m|^2 / tau_m. rates: 1/tau_m. compliance (n//2 + 1, 2 columns) as `advance_modes` has it; fold (columns,): how
    often a column counts.
    """
    n, width = u.shape
    elements = branches.shape[0]
    sums[:] = 0.0
    half, loss = np.empty(width), np.empty(width)
    for i in range(n):
        k = min(i, n - i)
        row, speed = u[i], v[i]
        for c in range(width):
            half[c] = row[c] * row[c]
            loss[c] = 0.0
        for m in range(elements):
            branch, weight, rate = branches[m, i], weights[m], rates[m]
            for c in range(width):
                apart = weight * (row[c] - branch[c]) ** 2
                half[c] += apart
                loss[c] += rate * apart
        for j in range(width // 2):
            g = compliance[k, 2 * j]
            if g > 0.0:
                weight = fold[j] / g
                sums[0, j] += 0.5 * weight * (half[2 * j] + half[2 * j + 1])
                sums[1, j] += weight * (speed[2 * j] ** 2 + speed[2 * j + 1] ** 2)
                sums[2, j] += weight * (loss[2 * j] + loss[2 * j + 1])
