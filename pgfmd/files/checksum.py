"""Checksums of distributed arrays: sums of hashed elements over fixed blocks of the whole array.

The bits of each element, shifted by its global index, are hashed by a bijection of 64-bit words (hashing.py). The
checksum of a block is the sum over its elements, modulo 2^64. So a change of a single element always changes the sum,
and a change of several elements is undetected with a probability of 2^-64. Sums can be added in any order, so each rank
adds its own share, for any distribution. Plain NumPy.
"""

from __future__ import annotations

import numpy as np

from pgfmd.hashing import STRIDE, scrambled

BLOCK = 2**16
"""Elements of a block."""
_WORDS = {4: np.uint32, 8: np.uint64}
_SHIFTS = np.arange(BLOCK, dtype=np.uint64) * STRIDE


def block_count(size: int) -> int:
    """Number of blocks of an array of `size` elements."""
    return -(-size // BLOCK)


def block_sums(lines: np.ndarray, first: int, total: int) -> np.ndarray:
    """Contribution of this share to the checksums of all blocks, (block_count,) uint64; those of the whole array are
    the sums modulo 2^64.

    lines: (any, width), contiguous, real, of 4 or 8 bytes an element: columns `first` ... of lines that are `total`
    long.
    """
    sums = np.zeros(block_count(len(lines) * total), dtype=np.uint64)
    for line, words in enumerate(lines.view(_WORDS[lines.itemsize])):
        begin = line * total + first
        for block in range(begin // BLOCK, block_count(begin + words.size)):
            low, high = max(begin, block * BLOCK), min(begin + words.size, (block + 1) * BLOCK)
            # With an array, because NumPy warns of the intended overflow for a scalar.
            sums[block : block + 1] += _scrambled_sum(words[low - begin : high - begin], low)
    return sums


def whole_sum(share: np.ndarray, first: int) -> np.uint64:
    """Contribution of this share, elements from `first` on, to a single checksum of the whole array. Modulo 2^64."""
    words = share.reshape(-1).view(_WORDS[share.itemsize])
    sums = [_scrambled_sum(words[k : k + BLOCK], first + k) for k in range(0, words.size, BLOCK)]
    return np.uint64(np.array(sums, dtype=np.uint64).sum(dtype=np.uint64))


def _scrambled_sum(words: np.ndarray, place: int) -> np.uint64:
    shift = np.array([place & (2**64 - 1)], dtype=np.uint64) * STRIDE
    return np.uint64(scrambled(words + (_SHIFTS[: words.size] + shift)).sum(dtype=np.uint64))
