"""Compiled kernels of the transform of mirror images (mirrored_transform.py): two cosine transforms in a complex line.

A line of N complex numbers z holds two real sequences a + i b of N points, in the order 0, 2, 4 ... 5, 3, 1 (Makhoul,
IEEE Trans. Acoust. Speech Signal Process. 28, 27 (1980)). With its transform Z and theta = pi k/(2 N),

    A_k = 2 sum_j a_j cos(pi k (j + 1/2)/N) = Re(exp(-i theta) (Z_k + conj Z_{N-k})),   B_k from -i (Z_k - conj Z_{N-k})

are the Fourier coefficients of all 2 N points, images included; exp(i theta) (A_k - i A_{N-k}) transforms back to N
times a_j. Lines are passed as real arrays, real and imaginary parts in turns.
"""

from __future__ import annotations

import numpy as np

from .compiled import compiled

# Products and sums may be contracted: that depends on the machine alone.
_compile = compiled(fastmath={"contract", "nsz"})


@_compile
def scatter_pairs(
    vector: np.ndarray, offset: np.ndarray, row: int, count: int, scale: float, lines: np.ndarray
) -> None:
    """Lines of scale * (row `row + 2 pair` + i times the next one), zero behind; `count` rows, the last maybe alone."""
    length = lines.shape[1] // 2
    for pair in range(lines.shape[0]):
        line = lines[pair]
        line[:] = 0
        for h in range(min(2, count - 2 * pair)):
            start, size = offset[row + 2 * pair + h], offset[row + 2 * pair + h + 1] - offset[row + 2 * pair + h]
            for j in range((size + 1) // 2):
                line[2 * j + h] = scale * vector[start + 2 * j]
            for j in range(size // 2):
                line[2 * (length - 1 - j) + h] = scale * vector[start + 2 * j + 1]


@_compile
def gather_pairs(lines: np.ndarray, offset: np.ndarray, row: int, count: int, vector: np.ndarray) -> None:
    """The inverse of `scatter_pairs`, without scale."""
    length = lines.shape[1] // 2
    for i in range(count):
        line, h = lines[i // 2], i % 2
        start, size = offset[row + i], offset[row + i + 1] - offset[row + i]
        for j in range((size + 1) // 2):
            vector[start + 2 * j] = line[2 * j + h]
        for j in range(size // 2):
            vector[start + 2 * j + 1] = line[2 * (length - 1 - j) + h]


@_compile
def separate(lines: np.ndarray, cosine: np.ndarray, sine: np.ndarray, rows: np.ndarray) -> None:
    """rows[2 pair], rows[2 pair + 1]: A and B of line `pair`; cosine, sine of theta, for k up to N/2."""
    length = lines.shape[1] // 2
    for pair in range(lines.shape[0]):
        z, a, b = lines[pair], rows[2 * pair], rows[2 * pair + 1]
        a[0], b[0] = z[0] + z[0], z[1] + z[1]
        for k in range(1, length // 2 + 1):
            m, c, s = length - k, cosine[k], sine[k]
            real, turned = z[2 * k] + z[2 * m], z[2 * k + 1] - z[2 * m + 1]
            other, another = z[2 * k + 1] + z[2 * m + 1], z[2 * m] - z[2 * k]
            a[k] = c * real + s * turned
            a[m] = s * real - c * turned
            b[k] = c * other + s * another
            b[m] = s * other - c * another


@_compile
def join(rows: np.ndarray, cosine: np.ndarray, sine: np.ndarray, lines: np.ndarray) -> None:
    """The inverse of `separate`, N times: what transforms back to the lines."""
    length = lines.shape[1] // 2
    for pair in range(lines.shape[0]):
        z, a, b = lines[pair], rows[2 * pair], rows[2 * pair + 1]
        z[0], z[1] = a[0], b[0]
        for k in range(1, length // 2 + 1):
            m, c, s = length - k, cosine[k], sine[k]
            real, turned = c * a[k] + s * a[m], s * a[k] - c * a[m]
            other, another = c * b[k] + s * b[m], s * b[k] - c * b[m]
            z[2 * k], z[2 * k + 1] = real - another, turned + other
            z[2 * m], z[2 * m + 1] = real + another, other - turned


@_compile
def halve_pairs(multiplier: np.ndarray) -> None:
    """Multipliers of two neighbouring columns become half their sum and half their difference, in their place."""
    for j in range(0, multiplier.shape[0], 2):
        first, second = multiplier[j], multiplier[j + 1]
        for k in range(multiplier.shape[1]):
            total, rest = 0.5 * (first[k] + second[k]), 0.5 * (first[k] - second[k])
            first[k], second[k] = total, rest


@_compile
def multiply_pairs(lines: np.ndarray, multiplier: np.ndarray, column: int, count: int) -> None:
    """Real columns a + i b in each of `count` lines, transformed along y: each times its own multiplier.

    Z'(q) = S Z(q) + D conj Z(-q), with S and D of `halve_pairs`.
    """
    n = lines.shape[1] // 2
    for j in range(count):
        z, total, rest = lines[j], multiplier[2 * (column + j)], multiplier[2 * (column + j) + 1]
        for k in range(1, n // 2):
            m, s, d = n - k, total[k], rest[k]
            real, imaginary, other, another = z[2 * k], z[2 * k + 1], z[2 * m], z[2 * m + 1]
            z[2 * k], z[2 * k + 1] = s * real + d * other, s * imaginary - d * another
            z[2 * m], z[2 * m + 1] = s * other + d * real, s * another - d * imaginary
        for k in (0, n // 2):
            z[2 * k], z[2 * k + 1] = (total[k] + rest[k]) * z[2 * k], (total[k] - rest[k]) * z[2 * k + 1]


@_compile
def multiply_mirrored(
    lines: np.ndarray, multiplier: np.ndarray, column: int, count: int, cosine: np.ndarray, sine: np.ndarray
) -> None:
    """Two columns in each of `count` lines, transformed along y: separated, times their multipliers, and joined."""
    length = lines.shape[1] // 2
    for j in range(count):
        z, first, second = lines[j], multiplier[2 * (column + j)], multiplier[2 * (column + j) + 1]
        z[0], z[1] = first[0] * (z[0] + z[0]), second[0] * (z[1] + z[1])
        for k in range(1, length // 2 + 1):
            m, c, s = length - k, cosine[k], sine[k]
            real, turned = z[2 * k] + z[2 * m], z[2 * k + 1] - z[2 * m + 1]
            other, another = z[2 * k + 1] + z[2 * m + 1], z[2 * m] - z[2 * k]
            low, high = first[k] * (c * real + s * turned), first[m] * (s * real - c * turned)
            real, turned = c * low + s * high, s * low - c * high
            low, high = second[k] * (c * other + s * another), second[m] * (s * other - c * another)
            other, another = c * low + s * high, s * low - c * high
            z[2 * k], z[2 * k + 1] = real - another, turned + other
            z[2 * m], z[2 * m + 1] = real + another, other - turned
