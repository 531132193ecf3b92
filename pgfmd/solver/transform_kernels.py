"""Compiled kernels of the transform: rows and columns in and out of the buffers of one batch.

A point vector's row `i` runs from `offset[i]` to `offset[i + 1]` and begins at column `first[i]` of the punch block
(grid.py).
"""

from __future__ import annotations

from .compiled import compiled

_compile = compiled()


@_compile
def scatter_rows(vector, offset, first, row, count, nb, scale, line):
    """line[i, first:last] = scale * (row `row + i` of the point vector), zero in the rest of the first nb columns."""
    for i in range(count):
        start, stop, column = offset[row + i], offset[row + i + 1], first[row + i]
        target, source = line[i], vector[start:stop]
        target[:column] = 0.0
        inside = target[column : column + source.size]
        for j in range(source.size):
            inside[j] = scale * source[j]
        target[column + source.size :] = 0.0


@_compile
def gather_rows(line, offset, first, row, count, vector):
    """The inverse of `scatter_rows`, without scale."""
    for i in range(count):
        start, stop, column = offset[row + i], offset[row + i + 1], first[row + i]
        vector[start:stop] = line[i, column : column + stop - start]


@_compile
def load_columns(columns, column, count, buffer):
    """buffer[j, :nb] = columns[:, column + j], zeros behind."""
    nb, n = columns.shape[0], buffer.shape[1]
    # Four columns at a time: a cache line of the source, and few enough targets, whose distance is a power of two.
    for start in range(0, count, 4):
        stop = min(start + 4, count)
        for i in range(nb):
            for j in range(start, stop):
                buffer[j, i] = columns[i, column + j]
        for j in range(start, stop):
            for i in range(nb, n):
                buffer[j, i] = 0.0


@_compile
def multiply_columns(buffer, multiplier, column, count):
    """buffer[j, ky] *= G(column + j, |ky|)."""
    n = buffer.shape[1]
    half = n // 2
    for j in range(count):
        row = multiplier[column + j]
        for k in range(half + 1):
            buffer[j, k] *= row[k]
        for k in range(half + 1, n):
            buffer[j, k] *= row[n - k]


@_compile
def store_columns(buffer, column, count, first, columns):
    """columns[i, column + j] = buffer[j, first + i], periodically."""
    n = buffer.shape[1]
    for start in range(0, count, 4):
        stop = min(start + 4, count)
        k = first % n
        for i in range(columns.shape[0]):
            for j in range(start, stop):
                columns[i, column + j] = buffer[j, k]
            k = k + 1 if k + 1 < n else 0
