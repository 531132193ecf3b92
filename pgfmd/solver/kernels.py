"""Compiled kernels: one pass over memory where NumPy needs several. Each stands beside the line of mathematics it
evaluates.

Sums are left as one partial sum a row of the punch block (`offset` marks the rows in a point vector);
`PunchPoints.total_of` adds them in an order that does not depend on the number of ranks. Loops over a row's points run
over unsigned indices, as the test for negative ones keeps them from being vectorised. One thread a rank.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from .compiled import compiled

_compile = compiled()
# Sums over a row may be vectorised; the order within a row then depends on its length alone.
_compile_sums = compiled(fastmath={"reassoc", "contract", "nsz"})

# Maxima and minima vectorise only where NaN is ruled out: `observe`, which looks at every accepted step, is not among
# these.
_compile_maxima = compiled(fastmath={"reassoc", "contract", "nsz", "nnan"})


# Cohesion and the incremental potential ------------------------------------------------------------------------------
_COSINE = tuple((-1) ** k * math.pi ** (2 * k) / math.factorial(2 * k) for k in range(12))
_SINE = tuple((-1) ** k * math.pi ** (2 * k + 1) / math.factorial(2 * k + 1) for k in range(12))


def _horner(coefficients: tuple[float, ...], variable: str) -> str:
    """The polynomial as nested products, as text: a loop over a tuple would not vectorise."""
    text = repr(coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        text = f"{coefficient!r} + {variable} * ({text})"
    return text


def _compiled_polynomial(coefficients: tuple[float, ...]):
    return numba.njit(inline="always")(eval(f"lambda q: {_horner(coefficients, 'q')}"))  # noqa: S307


# cos(pi y) and sin(pi y)/y as functions of y^2, |y| <= 1/2, by their Taylor series to rounding: no branch, no call.
_cosine_of = _compiled_polynomial(_COSINE)
_sine_of = _compiled_polynomial(_SINE)


@_compile_maxima
def evaluate(height, position, u, w, s, t, step, weight, history, compliance, law, offset, f, k, r, rows):
    """Traction, stiffness and out-of-balance stress of one implicit step, at the trial u + step s, w + weight t.

    gap = d + z - u;  f = Gamma'(gap);  K = Gamma''(gap);  r = f - (w - history) / J
    rows[0] of f, rows[1] of r [Pa];  rows[2] of Gamma(gap), rows[3] of step s ((w + trial's w)/2 - history) / J, by
    which the rest of the incremental potential grows along s, as A is symmetric [Pa m].
    law = (stiffness K_0, range rho, attractive 0 or 1).
    """
    stiffness, reach, attractive = law
    strength = attractive * stiffness * reach / math.pi
    depth = strength * reach / math.pi
    per_range = 1.0 / reach
    limit = reach if attractive > 0.0 else 0.0
    inverse = 1.0 / compliance
    for row in range(offset.size - 1):
        pull, imbalance, potential, growth = 0.0, 0.0, 0.0, 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            move = step * s[i]
            here = u[i] + move
            load = w[i] + weight * t[i]
            gap = position + height[i] - here
            overlap = min(gap, 0.0)
            # pi gap/rho = pi y + pi/2, within reach of the attraction.
            y = min(max(gap * per_range, 0.0), 1.0) - 0.5
            sine, minus_cosine = _cosine_of(y * y), y * _sine_of(y * y)
            near = gap < limit
            traction = stiffness * overlap + (strength * sine if near else 0.0)
            bend = -stiffness * minus_cosine if near else 0.0
            f[i] = traction
            k[i] = bend
            rest = traction - (load - history[i]) * inverse
            r[i] = rest
            energy = 0.5 * stiffness * overlap * overlap + (depth * (minus_cosine - 1.0) if near else 0.0)
            pull += traction
            imbalance += rest
            potential += energy
            growth += move * (0.5 * (w[i] + load) - history[i]) * inverse
        rows[0, row] = pull
        rows[1, row] = imbalance
        rows[2, row] = potential
        rows[3, row] = growth


@_compile_sums
def observe(height, position, u, f, weights, law, offset, rows):
    """What a curve row needs. rows: [0] points with gap < 0, [1] Gamma [J/m^2], [2] weights f, [3] minus the smallest
    gap."""
    stiffness, reach, attractive = law
    depth = attractive * stiffness * reach * reach / math.pi**2
    per_range = 1.0 / reach
    limit = reach if attractive > 0.0 else 0.0
    weighted = weights.size == u.size
    for row in range(offset.size - 1):
        contact, energy, far, closest = 0.0, 0.0, 0.0, math.inf
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            gap = position + height[i] - u[i]
            closest = min(closest, gap)
            overlap = min(gap, 0.0)
            y = min(max(gap * per_range, 0.0), 1.0) - 0.5
            contact += 1.0 if gap < 0.0 else 0.0
            energy += 0.5 * stiffness * overlap * overlap
            energy += depth * (y * _sine_of(y * y) - 1.0) if gap < limit else 0.0
        if weighted:
            for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
                far += weights[i] * f[i]
        rows[0, row] = contact
        rows[1, row] = energy
        rows[2, row] = far
        rows[3, row] = -closest


# Conjugate gradients
# ---------------------------------------------------------------------------------------------------
@_compile_sums
def dot(a, b, offset, rows):
    """rows[0] of a b."""
    for row in range(offset.size - 1):
        total = 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            total += a[i] * b[i]
        rows[0, row] = total


@_compile_sums
def turn_direction(z, r, beta, k, p, y, offset, rows):
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
def survey(z, r, k, offset, rows):
    """What a correction z = A r of CG asks of all ranks. rows[0] of r z;  rows[1] of z K z;  rows[2] of K z;  rows[3]:
    the largest |z| over points that interact (K != 0), row by row."""
    for row in range(offset.size - 1):
        energy, bend, pull, largest = 0.0, 0.0, 0.0, 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            here = z[i]
            stiff = k[i] * here
            energy += r[i] * here
            bend += here * stiff
            pull += stiff
            largest = max(largest, abs(here) if k[i] != 0.0 else 0.0)
        rows[0, row] = energy
        rows[1, row] = bend
        rows[2, row] = pull
        rows[3, row] = largest


@_compile_maxima
def turn_and_advance(z, beta, alpha, k, p, y, s, t, r, first, offset, rows):
    """p = z + beta p;  y = r + beta y;  s += alpha p;  t += alpha y;  r -= alpha (y + K p), in one pass; the first one
    begins with all of them zero, whatever is in them.

    rows[0], rows[1]: the largest |p| and |s| over points that interact (K != 0), row by row.
    """
    for row in range(offset.size - 1):
        turn, size = 0.0, 0.0
        if first:
            for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
                a, b = z[i], r[i]
                p[i] = a
                y[i] = b
                s[i] = alpha * a
                t[i] = alpha * b
                r[i] = b - alpha * (b + k[i] * a)
                interacting = k[i] != 0.0
                turn = max(turn, abs(a) if interacting else 0.0)
                size = max(size, abs(s[i]) if interacting else 0.0)
        else:
            for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
                a = z[i] + beta * p[i]
                b = r[i] + beta * y[i]
                p[i] = a
                y[i] = b
                s[i] += alpha * a
                t[i] += alpha * b
                r[i] -= alpha * (b + k[i] * a)
                interacting = k[i] != 0.0
                turn = max(turn, abs(a) if interacting else 0.0)
                size = max(size, abs(s[i]) if interacting else 0.0)
        rows[0, row] = turn
        rows[1, row] = size


@_compile_maxima
def advance(alpha, p, y, k, s, t, r, offset, rows):
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
def largest_in_rows(values, k, offset, rows):
    """rows[0]: the largest |value| over points that interact (K != 0), row by row."""
    for row in range(offset.size - 1):
        largest = 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            if k[i] != 0.0:
                largest = max(largest, abs(values[i]))
        rows[0, row] = largest


@_compile
def move(u, w, s, t, step, weight):
    """u += step s;  w += weight t."""
    for i in range(u.size):
        u[i] += step * s[i]
        w[i] += weight * t[i]


# Prediction and its error
# ----------------------------------------------------------------------------------------------
@_compile
def combine(c0, a0, c1, a1, c2, a2, out):
    """out = c0 a0 + c1 a1 + c2 a2."""
    for i in range(out.size):
        out[i] = c0 * a0[i] + c1 * a1[i] + c2 * a2[i]


@_compile
def largest_difference_near(c0, a0, c1, a1, c2, a2, u, height, position, reach):
    """max |u - (c0 a0 + c1 a1 + c2 a2)| and max |u - a0| over points whose gap, by one or the other, is below reach; 0
    without any."""
    largest, change = 0.0, 0.0
    for i in range(u.size):
        other = c0 * a0[i] + c1 * a1[i] + c2 * a2[i]
        if position + height[i] - max(u[i], other) < reach:
            largest = max(largest, abs(u[i] - other))
            change = max(change, abs(u[i] - a0[i]))
    return largest, change


# Retardation ----------------------------------------------------------------------------------------------------------
# Whole branches one after another, although stages and sums are read anew for each: going through all branches a
# stretch at a time, to keep those in cache, took half as long again.
@_compile
def weigh_branches(branches, weights, out):
    """out[i] = sum_m weights[i, m] branches[m], for 1 or 2 stages i in one pass over the branches, four at a time."""
    elements, size = branches.shape
    last = out.shape[0] - 1
    first_sum, last_sum = out[0], out[last]
    out[:] = 0.0
    fours = elements - elements % 4
    for m in range(0, fours, 4):
        w, x, y, z = branches[m], branches[m + 1], branches[m + 2], branches[m + 3]
        a0, a1, a2, a3 = weights[0, m], weights[0, m + 1], weights[0, m + 2], weights[0, m + 3]
        b0, b1, b2, b3 = weights[last, m], weights[last, m + 1], weights[last, m + 2], weights[last, m + 3]
        for p in range(size):
            # Both before either is written: with one stage they are the same.
            here_first = first_sum[p] + a0 * w[p] + a1 * x[p] + a2 * y[p] + a3 * z[p]
            here_last = last_sum[p] + b0 * w[p] + b1 * x[p] + b2 * y[p] + b3 * z[p]
            first_sum[p] = here_first
            last_sum[p] = here_last
    for m in range(fours, elements):
        row = branches[m]
        for i in range(out.shape[0]):
            weight, total = weights[i, m], out[i]
            for p in range(size):
                total[p] += weight * row[p]


@_compile
def advance_branches(branches, decay, stages, gain, count):
    """branches[m] = decay[m] branches[m] + sum_{j < count} gain[m, j] stages[j], with 1 or 2 stages.

    Two branches at a time, so that stages are read half as often; with four, it took longer again.
    """
    elements, size = branches.shape
    first, last, two = stages[0], stages[count - 1], count > 1
    twos = elements - elements % 2
    for m in range(0, twos, 2):
        a, b = branches[m], branches[m + 1]
        keep_a, first_a, last_a = decay[m], gain[m, 0], gain[m, 1] if two else 0.0
        keep_b, first_b, last_b = decay[m + 1], gain[m + 1, 0], gain[m + 1, 1] if two else 0.0
        for p in range(size):
            x, y = first[p], last[p]
            new_a = keep_a * a[p] + first_a * x + last_a * y
            new_b = keep_b * b[p] + first_b * x + last_b * y
            a[p] = new_a
            b[p] = new_b
    for m in range(twos, elements):
        row, keep, gain_first, gain_last = branches[m], decay[m], gain[m, 0], gain[m, 1] if two else 0.0
        for p in range(size):
            row[p] = keep * row[p] + gain_first * first[p] + gain_last * last[p]


@_compile_sums
def advance_branches_and_energy(
    phi, psi, decay, f, g, gain, rate_decay, rate_gain, quadrature, compliances, count, keep, offset, rows
):
    """`advance_branches` for phi and for psi = G0 phi, with the energies that they store and dissipate.

    The rates of stage i are k_i = f_i - phi_i = rate_decay[m, i] phi_n + sum_{j <= i} rate_gain[m, i, j] f_j, likewise
    for psi. Written out for two stages, as loops over them would not vectorise; a single one has no second term.
    Without `keep` phi and psi stay as they are.
    rows[0] of sum_m J_m phi_m psi_m / 2;  rows[1] of sum_m sum_i quadrature[m, i] k_i G0 k_i,  [Pa m].
    """
    two, last = count > 1, count - 1
    f0, f1, g0, g1 = f[0], f[last], g[0], g[last]
    rows[0] = 0.0
    rows[1] = 0.0
    for m in range(phi.shape[0]):
        a, b = phi[m], psi[m]
        half, fading, gain0, gain1 = 0.5 * compliances[m], decay[m], gain[m, 0], gain[m, last] if two else 0.0
        r0, r00, weight0 = rate_decay[m, 0], rate_gain[m, 0, 0], quadrature[m, 0]
        r1, r11, weight1 = rate_decay[m, last], rate_gain[m, last, last], quadrature[m, last] if two else 0.0
        r10 = rate_gain[m, last, 0] if two else 0.0
        for row in range(offset.size - 1):
            stored, lost = 0.0, 0.0
            for p in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
                x, y = a[p], b[p]
                new_x = fading * x + gain0 * f0[p] + gain1 * f1[p]
                new_y = fading * y + gain0 * g0[p] + gain1 * g1[p]
                lost += weight0 * (r0 * x + r00 * f0[p]) * (r0 * y + r00 * g0[p])
                lost += weight1 * (r1 * x + r10 * f0[p] + r11 * f1[p]) * (r1 * y + r10 * g0[p] + r11 * g1[p])
                stored += new_x * new_y
                if keep:
                    a[p], b[p] = new_x, new_y
            rows[0, row] += half * stored
            rows[1, row] += lost
