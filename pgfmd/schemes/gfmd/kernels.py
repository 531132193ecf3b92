"""Compiled kernels of the scheme `gfmd`. Complex arrays come as their real view, (..., 2 columns): all coefficients are
real, and the loops vectorise. See kernels.py for the conventions of sums."""

from __future__ import annotations

import math

import numpy as np

from pgfmd.physics.adhesion.base import Numbers
from pgfmd.solver.compiled import compiled
from pgfmd.solver.contact_kernels import count_below
from pgfmd.solver.inlined_laws import attraction
from pgfmd.solver.kernels import _compile, _compile_maxima, _compile_sums


@_compile
def spread(traction: np.ndarray, offset: np.ndarray, first: np.ndarray, top: int, left: int, plane: np.ndarray) -> None:
    """Copies the traction of the points under the punch to the rows of the plane, zero elsewhere.

    top: the plane's local row of the first local row of the punch block; left: the block's first column.
    """
    for row in range(plane.shape[0]):
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
def touch(
    plane: np.ndarray, top: int, left: int, first: np.ndarray, height: np.ndarray, position: float,
    law: Numbers, levels: tuple[float, float, float], offset: np.ndarray, u: np.ndarray, f: np.ndarray,
    rows: np.ndarray,
) -> None:  # fmt: skip
    """The surface under the punch from the plane, and the traction there: u, f = Gamma'(d + z - u).

    rows: [0], [1], [2] points with a gap below each of the levels [m], [3] Gamma [J/m^2], [4] f [Pa], [5] minus the
    smallest gap [m].
    """
    for row in range(offset.size - 1):
        source = plane[top + row]
        begin = left + first[row]
        start = offset[row]
        energy, pull, closest = 0.0, 0.0, math.inf
        for i in range(np.uint64(offset[row + 1] - start)):
            here = source[begin + i]
            gap = position + height[start + i] - here
            overlap = min(gap, 0.0)
            drawn, _, depth, level = attraction(gap, law)
            near = gap < law.reach
            traction = law.overlap * overlap + (drawn if near else 0.0)
            u[start + i] = here
            f[start + i] = traction
            energy += 0.5 * law.overlap * overlap * overlap + (depth * level if near else 0.0)
            pull += traction
            closest = min(closest, gap)
        # In a separate loop, because otherwise the order of the sums above would change.
        rows[0, row], rows[1, row], rows[2, row] = count_below(height, position, u, start, offset[row + 1], levels)
        rows[3, row] = energy
        rows[4, row] = pull
        rows[5, row] = -closest


@_compile
def advance_modes(
    buffer: np.ndarray, compliance: np.ndarray, u: np.ndarray, v: np.ndarray, internal: np.ndarray,
    weights: np.ndarray, rates: np.ndarray, keep: float, kick: float, step: float, decay: np.ndarray,
    old_gain: np.ndarray, new_gain: np.ndarray, stiffness: float, fold: np.ndarray, sums: np.ndarray,
) -> None:  # fmt: skip
    """One step of every mode; `buffer` holds the traction and is given the new u, both (n, 2 columns).

    v = keep v + kick (G0 f + sum_m kappa_m u_m - kappa_inf u);  u_new = u + step v
    u_m = decay_m u_m + old_gain_m u + new_gain_m u_new        exact for a u that is linear within the step
    compliance G0 / n^2, (n//2 + 1, 2 columns): even in ky, each column twice. internal (N, n, 2 columns); weights:
    kappa_m. Where `sums` (3, columns) is not empty, it is given the sums over each column, with k_0 = 1/G0, of
    [0] k_0 (|u|^2 + sum_m kappa_m |u - u_m|^2) / 2,  [1] k_0 |v|^2,  [2] sum_m k_0 kappa_m |u - u_m|^2 rates_m
    after the step; fold (columns,) says how often a column counts, rates are 1/tau_m. Modes without compliance don't
    move.
    """
    n, width = buffer.shape
    sums[:] = 0.0
    work, loss = np.empty(width), np.empty(width)
    for k in range(n // 2 + 1):
        # Rows ky and -ky share their compliance.
        for sign in range(1 if k == 0 or 2 * k == n else 2):
            i = n - k if sign else k
            _advance_row(
                buffer[i], compliance[k], u[i], v[i], internal, i, weights, keep, kick, step, decay, old_gain, new_gain,
                stiffness, work,
            )  # fmt: skip
            if sums.shape[1] > 0:
                _add_energies(compliance[k], u[i], v[i], internal, i, weights, rates, fold, work, loss, sums)


@compiled(fastmath={"contract"})
def _advance_row(
    buffer: np.ndarray, compliance: np.ndarray, u: np.ndarray, v: np.ndarray, internal: np.ndarray, i: int,
    weights: np.ndarray, keep: float, kick: float, step: float, decay: np.ndarray, old_gain: np.ndarray,
    new_gain: np.ndarray, stiffness: float, work: np.ndarray,
) -> None:  # fmt: skip
    width = buffer.size
    for c in range(width):
        work[c] = compliance[c] * buffer[c] - stiffness * u[c]
    for m in range(weights.size):
        branch, weight = internal[m, i], weights[m]
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
    for m in range(weights.size):
        branch, kept, a, b = internal[m, i], decay[m], old_gain[m], new_gain[m]
        for c in range(width):
            branch[c] = kept * branch[c] + a * work[c] + b * u[c]


@_compile_sums
def _add_energies(
    compliance: np.ndarray, u: np.ndarray, v: np.ndarray, internal: np.ndarray, i: int, weights: np.ndarray,
    rates: np.ndarray, fold: np.ndarray, stored: np.ndarray, loss: np.ndarray, sums: np.ndarray,
) -> None:  # fmt: skip
    width = u.size
    for c in range(width):
        stored[c] = u[c] * u[c]
        loss[c] = 0.0
    for m in range(weights.size):
        branch, weight, rate = internal[m, i], weights[m], rates[m]
        for c in range(width):
            apart = weight * (u[c] - branch[c]) ** 2
            stored[c] += apart
            loss[c] += rate * apart
    for j in range(width // 2):
        a, b = 2 * j, 2 * j + 1
        stiffness = fold[j] / compliance[a] if compliance[a] > 0.0 else 0.0
        sums[0, j] += 0.5 * stiffness * (stored[a] + stored[b])
        sums[1, j] += stiffness * (v[a] ** 2 + v[b] ** 2)
        sums[2, j] += stiffness * (loss[a] + loss[b])
