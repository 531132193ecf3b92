"""Compiled kernels of the transform: rows and columns in and out of the buffers of one batch.

A point vector's row `i` runs from `offset[i]` to `offset[i + 1]` and begins at column `first[i]` of the punch block
(grid.py). Complex lines are passed as real arrays where rows are packed, real and imaginary parts in turns. Between rows and
columns lie tiles (tiles.py).
"""

from __future__ import annotations

import numpy as np

from .compiled import compiled

_compile = compiled()


@_compile
def scatter_rows(
    vector: np.ndarray, offset: np.ndarray, first: np.ndarray, row: int, count: int, scale: float, line: np.ndarray
) -> None:
    """line[i, first:last] = scale * (row `row + i` of the point vector), zero in the rest."""
    for i in range(count):
        start, stop, column = offset[row + i], offset[row + i + 1], first[row + i]
        target, source = line[i], vector[start:stop]
        target[:column] = 0.0
        inside = target[column : column + source.size]
        for j in range(source.size):
            inside[j] = scale * source[j]
        target[column + source.size :] = 0.0


@_compile
def gather_rows(
    line: np.ndarray, offset: np.ndarray, first: np.ndarray, row: int, count: int, vector: np.ndarray
) -> None:
    """The inverse of `scatter_rows`, without scale."""
    for i in range(count):
        start, stop, column = offset[row + i], offset[row + i + 1], first[row + i]
        vector[start:stop] = line[i, column : column + stop - start]


@_compile
def scatter_packed(
    vector: np.ndarray, offset: np.ndarray, first: np.ndarray, row: int, count: int, scale: float, lines: np.ndarray
) -> None:
    """Lines of scale * (row `row + 2 pair` + i times the next one), zero in the rest; `count` rows, the last maybe alone."""
    for pair in range(lines.shape[0]):
        line = lines[pair]
        line[:] = 0
        for h in range(min(2, count - 2 * pair)):
            start, stop, column = offset[row + 2 * pair + h], offset[row + 2 * pair + h + 1], first[row + 2 * pair + h]
            for j in range(stop - start):
                line[2 * (column + j) + h] = scale * vector[start + j]


@_compile
def gather_packed(
    lines: np.ndarray, offset: np.ndarray, first: np.ndarray, row: int, count: int, vector: np.ndarray
) -> None:
    """The inverse of `scatter_packed`, without scale."""
    for i in range(count):
        line, h = lines[i // 2], i % 2
        start, stop, column = offset[row + i], offset[row + i + 1], first[row + i]
        for j in range(stop - start):
            vector[start + j] = line[2 * (column + j) + h]


@_compile
def separate_packed(lines: np.ndarray, half: float, rows: np.ndarray) -> None:
    """rows[2 pair], rows[2 pair + 1]: half spectra of the two rows a + i b in line pair, from Z_k = A_k + i B_k. half: 1/2, in their precision."""
    n = lines.shape[1] // 2
    for pair in range(lines.shape[0]):
        z, a, b = lines[pair], rows[2 * pair], rows[2 * pair + 1]
        a[0], a[1], b[0], b[1] = z[0], 0, z[1], 0
        for k in range(1, n // 2 + 1):
            m = n - k
            a[2 * k], a[2 * k + 1] = half * (z[2 * k] + z[2 * m]), half * (z[2 * k + 1] - z[2 * m + 1])
            b[2 * k], b[2 * k + 1] = half * (z[2 * k + 1] + z[2 * m + 1]), half * (z[2 * m] - z[2 * k])


@_compile
def join_packed(rows: np.ndarray, lines: np.ndarray) -> None:
    """The inverse of `separate_packed`; imaginary parts of a real row's first and middle number don't count."""
    n = lines.shape[1] // 2
    for pair in range(lines.shape[0]):
        z, a, b = lines[pair], rows[2 * pair], rows[2 * pair + 1]
        z[0], z[1] = a[0], b[0]
        for k in range(1, (n + 1) // 2):
            m = n - k
            z[2 * k], z[2 * k + 1] = a[2 * k] - b[2 * k + 1], a[2 * k + 1] + b[2 * k]
            z[2 * m], z[2 * m + 1] = a[2 * k] + b[2 * k + 1], b[2 * k] - a[2 * k + 1]
        if n % 2 == 0:
            z[n], z[n + 1] = a[n], b[n]


@_compile
def put_rows(
    hat: np.ndarray, count: int, first: int, row: int, rows: int, columns: int, width: int, block: np.ndarray
) -> None:
    """Some rows, from column `first` on, into the tiles of a block: rows `row` to `row + count` of its `rows`."""
    for start in range(0, columns, width):
        wide = min(width, columns - start)
        for i in range(count):
            source, target = hat[i, first + start : first + start + wide], start * rows + (row + i) * wide
            for j in range(wide):
                block[target + j] = source[j]


@_compile
def take_rows(
    block: np.ndarray, count: int, first: int, row: int, rows: int, columns: int, width: int, hat: np.ndarray
) -> None:
    """The inverse of `put_rows`."""
    for start in range(0, columns, width):
        wide = min(width, columns - start)
        for i in range(count):
            target, source = hat[i, first + start : first + start + wide], start * rows + (row + i) * wide
            for j in range(wide):
                target[j] = block[source + j]


@_compile
def load_columns(
    tiles: np.ndarray, ends: np.ndarray, columns: int, width: int, column: int, places: np.ndarray, begin: int,
    end: int, buffer: np.ndarray,
) -> int:  # fmt: skip
    """buffer[j, places[i]] = row i of column `column + j`, for one group of columns; zeros from `begin` to `end`.

    Rows of rank s: `ends[s]` to `ends[s + 1]`. Returns how many columns there are.
    """
    wide = min(width, columns - column)
    for s in range(ends.size - 1):
        top, rows = ends[s], ends[s + 1] - ends[s]
        base = top * columns + column * rows
        tile = tiles[base : base + rows * wide].reshape(rows, wide)
        # Four columns at a time: a cache line of the source, and few enough targets, whose distance is a power of two.
        fours = wide - wide % 4
        for j in range(0, fours, 4):
            one, two, three, four = buffer[j], buffer[j + 1], buffer[j + 2], buffer[j + 3]
            for i in range(rows):
                k = places[top + i]
                one[k], two[k], three[k], four[k] = tile[i, j], tile[i, j + 1], tile[i, j + 2], tile[i, j + 3]
        for j in range(fours, wide):
            for i in range(rows):
                buffer[j, places[top + i]] = tile[i, j]
    for j in range(wide):
        buffer[j, begin:end] = 0
    return wide


@_compile
def store_columns(
    buffer: np.ndarray, ends: np.ndarray, columns: int, width: int, column: int, places: np.ndarray, tiles: np.ndarray
) -> None:
    """The inverse of `load_columns`: what is beyond the places is left out."""
    wide = min(width, columns - column)
    for s in range(ends.size - 1):
        top, rows = ends[s], ends[s + 1] - ends[s]
        base = top * columns + column * rows
        tile = tiles[base : base + rows * wide].reshape(rows, wide)
        fours = wide - wide % 4
        for j in range(0, fours, 4):
            one, two, three, four = buffer[j], buffer[j + 1], buffer[j + 2], buffer[j + 3]
            for i in range(rows):
                k = places[top + i]
                tile[i, j], tile[i, j + 1], tile[i, j + 2], tile[i, j + 3] = one[k], two[k], three[k], four[k]
        for j in range(fours, wide):
            for i in range(rows):
                tile[i, j] = buffer[j, places[top + i]]


@_compile
def multiply_columns(lines: np.ndarray, multiplier: np.ndarray, column: int, count: int) -> None:
    """Lines of complex numbers, as real ones in turns: of index ky times G(column + j, |ky|)."""
    n = lines.shape[1] // 2
    for j in range(count):
        line, row = lines[j], multiplier[column + j]
        for k in range(n // 2 + 1):
            line[2 * k] *= row[k]
            line[2 * k + 1] *= row[k]
        for k in range(n // 2 + 1, n):
            line[2 * k] *= row[n - k]
            line[2 * k + 1] *= row[n - k]
