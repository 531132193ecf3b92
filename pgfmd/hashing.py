"""Scrambling of 64-bit words: random numbers that depend on a place alone, and checksums.

Source: the finaliser of SplitMix64, Steele, Lea and Flood, OOPSLA 2014. Plain NumPy, which numba compiles as it stands.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Words = TypeVar("Words", np.uint64, NDArray[np.uint64])
STRIDE = np.uint64(0x9E3779B97F4A7C15)
"""2^64 over the golden ratio: multiples of it lie evenly."""
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_30, _27, _31 = np.uint64(30), np.uint64(27), np.uint64(31)


def scrambled(words: Words) -> Words:
    """Words (any shape, uint64) with all order hidden, one to one; modulo 2^64."""
    words = (words ^ (words >> _30)) * _FIRST
    words = (words ^ (words >> _27)) * _SECOND
    return words ^ (words >> _31)
