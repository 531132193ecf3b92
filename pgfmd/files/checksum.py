"""Checksums of arrays that ranks share out: sums of scrambled elements over fixed blocks of the whole.

Each element's bits, shifted by its place in the whole, go through a scrambling of 64-bit words that is one to one
(hashing.py); a block's checksum is the sum over its elements, modulo 2^64. So every change of a single element is
certain to change the sum, and one of many goes unseen with a chance of 2^-64. As sums can be added up in any order,
each rank adds up its own share, whatever the shares are. Plain NumPy.
"""

from __future__ import annotations

import numpy as np

from pgfmd.hashing import STRIDE, scrambled

BLOCK = 2**16
"""Elements of a block."""
_WORDS = {4: np.uint32, 8: np.uint64}
_SHIFTS = np.arange(BLOCK, dtype=np.uint64) * STRIDE


def block_count(size: int) -> int:
    """Blocks of an array of `size` elements."""
    return -(-size // BLOCK)


def block_sums(lines: np.ndarray, first: int, total: int) -> np.ndarray:
    """This share's part of the checksums of all blocks, (block_count,) uint64; those of the whole are the sum modulo
    2^64.

    lines: (any, width), contiguous, real, of 4 or 8 bytes an element: columns `first` ... of lines that are `total` long.
    """
    sums = np.zeros(block_count(len(lines) * total), dtype=np.uint64)
    for line, words in enumerate(lines.view(_WORDS[lines.itemsize])):
        begin = line * total + first
        for block in range(begin // BLOCK, block_count(begin + words.size)):
            low, high = max(begin, block * BLOCK), min(begin + words.size, (block + 1) * BLOCK)
            # Of an array, as NumPy warns of the overflow of a number, and it is meant.
            sums[block : block + 1] += _scrambled_sum(words[low - begin : high - begin], low)
    return sums


def whole_sum(share: np.ndarray, first: int) -> np.uint64:
    """This share's part of one checksum for the whole: elements `first` ... of it, in their order. Modulo 2^64."""
    words = share.reshape(-1).view(_WORDS[share.itemsize])
    sums = [_scrambled_sum(words[k : k + BLOCK], first + k) for k in range(0, words.size, BLOCK)]
    return np.uint64(np.array(sums, dtype=np.uint64).sum(dtype=np.uint64))


def _scrambled_sum(words: np.ndarray, place: int) -> np.uint64:
    shift = np.array([place & (2**64 - 1)], dtype=np.uint64) * STRIDE
    return np.uint64(scrambled(words + (_SHIFTS[: words.size] + shift)).sum(dtype=np.uint64))
