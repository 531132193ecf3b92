"""Compiled kernels of drift.py: matrices of a few rows, for which any call of a library takes longer than its work."""

from __future__ import annotations

import math

import numpy as np

from .compiled import compiled

_compile = compiled()


@_compile
def lower_factor(rows: np.ndarray) -> np.ndarray:
    """The lower triangular factor L (k, min(k, m)) of rows (k, m) with the same covariance, L L^T = rows rows^T. By
    Householder's reflections from the right."""
    count, length = rows.shape
    a = rows.copy()
    size = min(count, length)
    for i in range(size):
        square = 0.0
        for j in range(i + 1, length):
            square += a[i, j] * a[i, j]
        if square == 0.0:
            continue
        norm = math.sqrt(square + a[i, i] * a[i, i])
        end = -norm if a[i, i] > 0.0 else norm
        a[i, i] -= end
        scale = 2.0 / (square + a[i, i] * a[i, i])
        for row in range(i + 1, count):
            along = 0.0
            for j in range(i, length):
                along += a[i, j] * a[row, j]
            for j in range(i, length):
                a[row, j] -= scale * along * a[i, j]
        a[i, i] = end
    lower = np.zeros((count, size))
    for i in range(count):
        for j in range(min(i + 1, size)):
            lower[i, j] = a[i, j]
    return lower


@_compile
def extrapolated(factor: np.ndarray, weights: np.ndarray, noise: float) -> np.ndarray:
    """The factor with a row in front: weights factor, and a noise of its own, `noise` sqrt(1 + weights^2)."""
    known = factor.shape[0]
    wide = np.zeros((known + 1, factor.shape[1] + 1))
    square = 1.0
    for i in range(weights.size):
        square += weights[i] * weights[i]
        for j in range(factor.shape[1]):
            wide[0, j + 1] += weights[i] * factor[i, j]
    wide[0, 0] = noise * math.sqrt(square)
    wide[1:, 1:] = factor
    return lower_factor(wide)


@_compile
def disturbed(factor: np.ndarray, amount: float, renewed: bool) -> np.ndarray:
    """The factor with a noise of its own in the first row, instead of what was there where that is renewed."""
    wide = np.zeros((factor.shape[0], factor.shape[1] + 1))
    wide[:, 1:] = factor
    if renewed:
        wide[0, 1:] = 0.0
    # An error of its own is one more column of the newest row.
    wide[0, 0] = amount
    return lower_factor(wide)
