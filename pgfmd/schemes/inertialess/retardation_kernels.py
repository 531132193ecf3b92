"""Compiled kernels of retardation: weighted sums and the time step of the internal variables (kernels.py).

Each is documented by the mathematics it evaluates.
"""

from __future__ import annotations

import numpy as np

from pgfmd.solver.kernels import _compile, _compile_sums


@_compile
def weights_of(
    a: np.ndarray, compliances: np.ndarray, times: np.ndarray, instantaneous: float, step: float
) -> tuple[np.ndarray, ...]:
    """The fields of StepWeights (retardation.py), in its order. a (s, s); compliances J_m and retardation times (N,)."""
    count, elements = a.shape[0], times.size
    last = count - 1
    weighted = np.zeros((count, count))
    internal_weight, decay, gain = np.empty((count, elements)), np.empty(elements), np.zeros((elements, count))
    rate_decay, rate_gain = np.empty((elements, count)), np.zeros((elements, count, count))
    quadrature = np.empty((elements, count))
    for m in range(elements):
        speed, weight = step / times[m], compliances[m]
        for i in range(count):
            denominator = 1.0 / (1.0 + speed * a[i, i])
            pulled, total = speed * denominator, 0.0
            for j in range(i):
                total += a[i, j] * rate_decay[m, j]
            rate_decay[m, i] = -denominator - pulled * total
            rate_gain[m, i, i] = denominator
            for k in range(i):
                total = 0.0
                for j in range(k, i):
                    total += a[i, j] * rate_gain[m, j, k]
                rate_gain[m, i, k] = -pulled * total
            # phi_i = f_i - k_i, without the cancellation that this has for slow elements.
            total = 0.0
            for j in range(i + 1):
                total += a[i, j] * rate_decay[m, j]
            decay[m] = 1.0 + speed * total
            internal_weight[i, m] = weight * decay[m]
            for k in range(i + 1):
                total = 0.0
                for j in range(k, i + 1):
                    total += a[i, j] * rate_gain[m, j, k]
                gain[m, k] = speed * total
                weighted[i, k] += weight * gain[m, k]
            quadrature[m, i] = weight * speed * a[last, i]
    compliance = np.empty(count)
    for i in range(count):
        compliance[i] = instantaneous + weighted[i, i]
        weighted[i, i:] = 0.0
    return compliance, internal_weight, weighted, decay, gain, rate_decay, rate_gain, quadrature


# Whole internal variables one after another, although stages and sums are read again for each: going through all of them a
# stretch at a time, to keep those in cache, took half as long again.
@_compile
def weigh_internal_variables(internal: np.ndarray, weights: np.ndarray, out: np.ndarray) -> None:
    """out[i] = sum_m weights[i, m] internal[m], for 1 or 2 stages i in one pass over them, four at a time."""
    elements, size = internal.shape
    last = out.shape[0] - 1
    first_sum, last_sum = out[0], out[last]
    fours = elements - elements % 4
    if fours or not elements:
        out[:] = 0.0
    for m in range(0, fours, 4):
        w, x, y, z = internal[m], internal[m + 1], internal[m + 2], internal[m + 3]
        a0, a1, a2, a3 = weights[0, m], weights[0, m + 1], weights[0, m + 2], weights[0, m + 3]
        b0, b1, b2, b3 = weights[last, m], weights[last, m + 1], weights[last, m + 2], weights[last, m + 3]
        for p in range(size):
            # Both before either is written: with one stage they are the same.
            here_first = first_sum[p] + a0 * w[p] + a1 * x[p] + a2 * y[p] + a3 * z[p]
            here_last = last_sum[p] + b0 * w[p] + b1 * x[p] + b2 * y[p] + b3 * z[p]
            first_sum[p] = here_first
            last_sum[p] = here_last
    if not fours and elements:
        row, a0, b0 = internal[0], weights[0, 0], weights[last, 0]
        for p in range(size):
            first_sum[p] = a0 * row[p]
            last_sum[p] = b0 * row[p]
    for m in range(max(fours, 1), elements):
        row = internal[m]
        for i in range(out.shape[0]):
            weight, total = weights[i, m], out[i]
            for p in range(size):
                total[p] += weight * row[p]


@_compile
def stage_of(total: np.ndarray, history: np.ndarray, compliance: float, out: np.ndarray) -> None:
    """out = (total - history) / compliance: the f_i of w_i = J_i f_i + history_i."""
    inverse = 1.0 / compliance
    for p in range(out.size):
        out[p] = (total[p] - history[p]) * inverse


@_compile
def stage_and_history(
    total: np.ndarray, history: np.ndarray, compliance: float, weight: float, out: np.ndarray, following: np.ndarray
) -> None:
    """out = (total - history) / compliance, as `stage_of`, and its contribution to the history of the next stage:
    following += weight out."""
    inverse = 1.0 / compliance
    for p in range(out.size):
        stage = (total[p] - history[p]) * inverse
        out[p] = stage
        following[p] += weight * stage


@_compile
def advance_internal_variables(
    internal: np.ndarray, decay: np.ndarray, stages: np.ndarray, gain: np.ndarray, count: int
) -> None:
    """internal[m] = decay[m] internal[m] + sum_{j < count} gain[m, j] stages[j], with 1 or 2 stages.

    Two at a time, so that stages are read half as often; four at a time are slower.
    """
    elements, size = internal.shape
    first, last, two = stages[0], stages[count - 1], count > 1
    twos = elements - elements % 2
    for m in range(0, twos, 2):
        a, b = internal[m], internal[m + 1]
        keep_a, first_a, last_a = decay[m], gain[m, 0], gain[m, 1] if two else 0.0
        keep_b, first_b, last_b = decay[m + 1], gain[m + 1, 0], gain[m + 1, 1] if two else 0.0
        for p in range(size):
            x, y = first[p], last[p]
            new_a = keep_a * a[p] + first_a * x + last_a * y
            new_b = keep_b * b[p] + first_b * x + last_b * y
            a[p] = new_a
            b[p] = new_b
    for m in range(twos, elements):
        row, keep, gain_first, gain_last = internal[m], decay[m], gain[m, 0], gain[m, 1] if two else 0.0
        for p in range(size):
            row[p] = keep * row[p] + gain_first * first[p] + gain_last * last[p]


PIECE = 1024
"""Points that are processed by all passes of the audit together, in cache: whole rows, at least one."""


@_compile
def _images(
    psi: np.ndarray, internal_weight: np.ndarray, stage_weight: float, compliance: np.ndarray, first: np.ndarray,
    last: np.ndarray, begin: int, end: int, g: np.ndarray,
) -> None:  # fmt: skip
    """g[i, p]: the images G0 f_i of the stages at the points from begin to end, by u_i and the displacements psi of the internal variables.

    history_i = sum_m internal_weight[i, m] psi_m;  g_0 = (u_0 - history_0) / J_0;
    g_1 = (u_1 - history_1 - stage_weight g_0) / J_1
    """
    size, final = end - begin, g.shape[0] - 1
    a, b, u, v = g[0], g[final], first[begin:end], last[begin:end]
    for p in range(size):
        a[p] = u[p]
        b[p] = v[p]
    for m in range(psi.shape[0]):
        image, x, y = psi[m, begin:end], internal_weight[0, m], internal_weight[final, m]
        # Both before either is written: with one stage they are the same.
        for p in range(size):
            here, there = a[p] - x * image[p], b[p] - y * image[p]
            a[p] = here
            b[p] = there
    inverse, inverse_last = 1.0 / compliance[0], 1.0 / compliance[final]
    for p in range(size):
        a[p] *= inverse
    if final:
        for p in range(size):
            b[p] = (b[p] - stage_weight * a[p]) * inverse_last


@_compile_sums
def advance_branches_and_energy(
    phi: np.ndarray, psi: np.ndarray, f: np.ndarray, first: np.ndarray, last: np.ndarray, internal_weight: np.ndarray,
    stage_weight: float, compliance: np.ndarray, decay: np.ndarray, gain: np.ndarray, rate_decay: np.ndarray,
    rate_gain: np.ndarray, quadrature: np.ndarray, compliances: np.ndarray, keep: bool, offset: np.ndarray,
    rows: np.ndarray,
) -> None:  # fmt: skip
    """`advance_internal_variables` for phi and for psi = G0 phi, with the energies that they store and dissipate. No transform: the
    images g_i = G0 f_i of the stages follow from their surfaces u_i, `first` and `last`, the same for one stage.

    The rates of stage i are k_i = f_i - phi_i = rate_decay[m, i] phi_n + sum_{j <= i} rate_gain[m, i, j] f_j, likewise
    for psi. Written out for two stages, because loops over them would not vectorise; a single one has no second term.
    Without `keep`, phi and psi do not change.
    rows[0] of sum_m J_m phi_m psi_m / 2;  rows[1] of sum_m sum_i quadrature[m, i] k_i G0 k_i;  rows[2] of f g of the last
    stage,  [Pa m].
    """
    count = f.shape[0]
    two, final, all_rows, longest = count > 1, count - 1, offset.size - 1, 0
    for row in range(all_rows):
        longest = max(longest, offset[row + 1] - offset[row])
    images = np.empty((count, max(PIECE, longest)), psi.dtype)
    g0, g1 = images[0], images[final]
    row_begin = 0
    while row_begin < all_rows:
        begin, row_end = offset[row_begin], row_begin + 1
        while row_end < all_rows and offset[row_end + 1] - begin <= PIECE:
            row_end += 1
        end = offset[row_end]
        _images(psi, internal_weight, stage_weight, compliance, first, last, begin, end, images)
        f0, f1 = f[0, begin:end], f[final, begin:end]
        for row in range(row_begin, row_end):
            total = 0.0
            for p in range(np.uint64(offset[row] - begin), np.uint64(offset[row + 1] - begin)):
                total += f1[p] * g1[p]
            rows[0, row] = 0.0
            rows[1, row] = 0.0
            rows[2, row] = total
        for m in range(phi.shape[0]):
            a, b = phi[m, begin:end], psi[m, begin:end]
            half, fading, gain0, gain1 = 0.5 * compliances[m], decay[m], gain[m, 0], gain[m, final] if two else 0.0
            r0, r00, weight0 = rate_decay[m, 0], rate_gain[m, 0, 0], quadrature[m, 0]
            r1, r11, weight1 = rate_decay[m, final], rate_gain[m, final, final], quadrature[m, final] if two else 0.0
            r10 = rate_gain[m, final, 0] if two else 0.0
            for row in range(row_begin, row_end):
                stored, lost = 0.0, 0.0
                for p in range(np.uint64(offset[row] - begin), np.uint64(offset[row + 1] - begin)):
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
        row_begin = row_end
