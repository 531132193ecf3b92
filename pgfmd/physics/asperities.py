"""Random asperity heights: a standard normal number for each site of a lattice, interpolated smoothly.

A site's number is a hash of (seed, i, j), so it is the same on any grid, for any part of the punch, on any rank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgfmd.hashing import STRIDE, scrambled

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Lattice:
    """Triangular lattice of sites `origin + i first + j second` [m], |first| = |second| at 60 degrees.

    row: use only the sites j = 0, along the row through the origin (line asperities).
    """

    origin: tuple[float, float]
    first: tuple[float, float]
    second: tuple[float, float]
    row: bool = False


def site_normals(seed: int, i: NDArray[np.int64], j: NDArray[np.int64]) -> Array:
    """Standard normal number of each site (i, j), shape of i and j broadcast together."""
    # Not at the top: scenes without random numbers are read without it.
    from scipy.special import ndtri

    normal: Array = ndtri(site_uniforms(seed, i, j))
    return normal


def site_uniforms(seed: int, i: NDArray[np.int64], j: NDArray[np.int64]) -> Array:
    """A number of each site (i, j), uniform between 0 and 1, neither of which it is; shape of i and j broadcast together."""
    a, b = (np.atleast_1d(np.asarray(index, dtype=np.int64)).view(np.uint64) for index in (i, j))
    key = scrambled(np.full(1, seed & 0xFFFFFFFFFFFFFFFF, dtype=np.uint64) + STRIDE)
    key = scrambled(scrambled(key + STRIDE * (a + np.uint64(1))) + STRIDE * (b + np.uint64(1)))
    uniform: Array = ((key >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
    return uniform


def lattice_normals(lattice: Lattice, seed: int, x: Array, y: Array) -> Array:
    """A smooth field with each site's standard normal number at that site, dimensionless, shape of x and y.

    Weighted mean of the sites closer than the lattice spacing s, with weights (1 - (r/s)^2)^4. At a site every other
    weight vanishes with its first three derivatives, so that summits are lifted without being tilted or reshaped. In
    between the mean of two or three numbers varies a little less than at the sites.
    """
    (a, c), (b, d) = lattice.first, lattice.second
    determinant = a * d - b * c
    x, y = x - lattice.origin[0], np.zeros_like(y) if lattice.row else y - lattice.origin[1]
    i = np.floor((d * x - b * y) / determinant).astype(np.int64)
    j = np.floor((a * y - c * x) / determinant).astype(np.int64)
    if x.size == 0:
        return np.zeros(x.shape)
    low_i, low_j = i.min() - 1, j.min() - 1
    table = site_normals(seed, np.arange(low_i, i.max() + 3)[:, np.newaxis], np.arange(low_j, j.max() + 3))
    total, weights = np.zeros(x.shape), np.zeros(x.shape)
    for step_i in (-1, 0, 1, 2):
        for step_j in (-1, 0, 1, 2):
            site_i, site_j = i + step_i, j + step_j
            distance2 = (x - a * site_i - b * site_j) ** 2 + (y - c * site_i - d * site_j) ** 2
            weight = np.maximum(1 - distance2 / (a * a + c * c), 0) ** 4
            total += weight * table[site_i - low_i, site_j - low_j]
            weights += weight
    return total / weights
