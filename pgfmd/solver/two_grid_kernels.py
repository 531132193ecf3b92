"""Compiled kernels between points and the cells of a coarser grid, m x m points each (two_grid.py).

Points are point vectors (grid.py). `begin`: the first local row, in points from the upper edge of the coarse block; `first`
(rows,): the column of each row's first point, in points from its left edge. Numbers of cells are (coarse rows, coarse
columns). Sums within a row of points run in an order that depends on the row alone, in loops that write nothing: what is
compiled may take another order where it finds two vectors side by side in memory. Sums of several rows are added in the
order of these. So they have the same bits for any number of ranks.
"""

from __future__ import annotations

import numpy as np

from .compiled import compiled, inlined

_compile = compiled(fastmath={"reassoc", "contract", "nsz"})


@_compile
def sum_in_rows(v: np.ndarray, offset: np.ndarray, first: np.ndarray, m: int, sums: np.ndarray) -> None:
    """sums[c, row]: of v over the points of a row that are in the coarse column c."""
    for row in range(offset.size - 1):
        sums[:, row] = 0.0
        start, stop = offset[row], offset[row + 1]
        column = first[row] // m
        end = start + (column + 1) * m - first[row]
        while start < stop:
            total = v[start]
            for i in range(np.uint64(start + 1), np.uint64(min(end, stop))):
                total += v[i]
            sums[column, row] = total
            start, end, column = end, end + m, column + 1


@_compile
def fold(sums: np.ndarray, begin: int, m: int, scale: float, cells: np.ndarray) -> None:
    """cells[I, c] = scale * sum of sums[c, row] over the rows of points in the coarse row I; sums of all ranks' rows, the
    first of which is `begin`."""
    cells[:] = 0.0
    count = sums.shape[1]
    for c in range(sums.shape[0]):
        row = 0
        while row < count:
            end = min(((begin + row) // m + 1) * m - begin, count)
            total = 0.0
            for i in range(row, end):
                total += sums[c, i]
            cells[(begin + row) // m, c] = scale * total
            row = end


@_compile
def turn_residual(
    r: np.ndarray, k: np.ndarray, offset: np.ndarray, first: np.ndarray, begin: int, m: int, s: np.ndarray,
    line: np.ndarray, d: np.ndarray, sums: np.ndarray,
) -> None:  # fmt: skip
    """d = r - K P s;  sums[c, row]: of -K P s, as of `sum_in_rows`.

    P is bilinear between the centres of cells, s (coarse rows + 2, coarse columns + 2) with a rim of one cell. line: room
    for a row of s.
    """
    for row in range(offset.size - 1):
        sums[:, row] = 0.0
        start, stop = offset[row], offset[row + 1]
        if start == stop:
            continue
        # Centres of cells are at m/2, 3 m/2, ... points, and that of the rim at -m/2.
        place = (begin + row + 0.5) / m + 0.5
        above = int(place)
        for c in range(line.size):
            line[c] = s[above, c] + (place - above) * (s[above + 1, c] - s[above, c])
        column = first[row] // m
        inside = first[row] - column * m
        while start < stop:
            end = min(start + m - inside, stop)
            middle = line[column + 1]
            down, up = (middle - line[column]) / m, (line[column + 2] - middle) / m
            total, shift = 0.0, inside + 0.5 - 0.5 * m - start
            for i in range(np.uint64(start), np.uint64(end)):
                x = np.float64(np.int64(i)) + shift
                total -= k[i] * (middle + x * (up if x > 0.0 else down))
            sums[column, row] = total
            for i in range(np.uint64(start), np.uint64(end)):
                x = np.float64(np.int64(i)) + shift
                d[i] = r[i] - k[i] * (middle + x * (up if x > 0.0 else down))
            start, inside, column = end, 0, column + 1


@_compile
def add_cells(cells: np.ndarray, offset: np.ndarray, first: np.ndarray, begin: int, m: int, d: np.ndarray) -> None:
    """d += the number of the cell that a point is in."""
    for row in range(offset.size - 1):
        here = cells[(begin + row) // m]
        start, stop = offset[row], offset[row + 1]
        column = first[row] // m
        end = start + (column + 1) * m - first[row]
        while start < stop:
            for i in range(np.uint64(start), np.uint64(min(end, stop))):
                d[i] += here[column]
            start, end, column = end, end + m, column + 1


@_compile
def roughness(
    r: np.ndarray, k: np.ndarray, cells: np.ndarray, offset: np.ndarray, first: np.ndarray, begin: int, m: int,
    rows: np.ndarray,
) -> None:  # fmt: skip
    """rows[0]: the largest |r - number of its cell| over points that interact (K != 0), row by row; found by the order of
    bits, as in `_told_of`."""
    for row in range(offset.size - 1):
        here = cells[(begin + row) // m]
        start, stop = offset[row], offset[row + 1]
        column = first[row] // m
        end = start + (column + 1) * m - first[row]
        largest = np.int64(0)
        while start < stop:
            value = here[column]
            for i in range(np.uint64(start), np.uint64(min(end, stop))):
                largest = max(largest, np.float64(abs(r[i] - value) if k[i] != 0.0 else 0.0).view(np.int64))
            start, end, column = end, end + m, column + 1
        rows[0, row] = np.int64(largest).view(np.float64)


@_compile
def survey(
    z: np.ndarray, d: np.ndarray, r: np.ndarray, k: np.ndarray, p: np.ndarray, y: np.ndarray, first: bool,
    offset: np.ndarray, rows: np.ndarray,
) -> None:  # fmt: skip
    """What a direction z with the dual d asks of all ranks. rows[0] of z (d + K z);  rows[1] of r z;  rows[2] of
    z (y + K p), zero in the first direction, which is p and y themselves."""
    for row in range(offset.size - 1):
        bend, down, along = 0.0, 0.0, 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            here = z[i]
            bend += here * (d[i] + k[i] * here)
            down += r[i] * here
        if not first:
            for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
                along += z[i] * (y[i] + k[i] * p[i])
        rows[0, row] = bend
        rows[1, row] = down
        rows[2, row] = along


@inlined
def _imbalance_and_size(
    r: np.ndarray, s: np.ndarray, k: np.ndarray, begin: np.uint64, end: np.uint64
) -> tuple[float, float]:
    """Sum of r, and the largest |s| over points that interact (K != 0), from begin to before end."""
    imbalance, size = 0.0, np.int64(0)
    for i in range(begin, end):
        imbalance += r[i]
    # Numbers without a sign are in the order of their bits, of which the largest is found many at a time.
    for i in range(begin, end):
        size = max(size, np.float64(abs(s[i]) if k[i] != 0.0 else 0.0).view(np.int64))
    return imbalance, np.int64(size).view(np.float64)


# One vector is written in a loop: with more, there are too many that might overlap for it to be vectorised.
@_compile
def begin_and_advance(
    alpha: float, p: np.ndarray, y: np.ndarray, k: np.ndarray, s: np.ndarray, t: np.ndarray, r: np.ndarray,
    offset: np.ndarray, rows: np.ndarray,
) -> None:  # fmt: skip
    """s = alpha p;  t = alpha y;  r -= alpha (y + K p).

    rows[0] of r;  rows[1]: the largest |s| over points that interact (K != 0), row by row.
    """
    alpha = p.dtype.type(alpha)
    for row in range(offset.size - 1):
        begin, end = np.uint64(offset[row]), np.uint64(offset[row + 1])
        for i in range(begin, end):
            s[i] = alpha * p[i]
        for i in range(begin, end):
            t[i] = alpha * y[i]
        for i in range(begin, end):
            r[i] -= t[i] + k[i] * s[i]
        rows[0, row], rows[1, row] = _imbalance_and_size(r, s, k, begin, end)


@_compile
def turn_and_advance(
    z: np.ndarray, d: np.ndarray, beta: float, alpha: float, k: np.ndarray, p: np.ndarray, y: np.ndarray,
    s: np.ndarray, t: np.ndarray, r: np.ndarray, offset: np.ndarray, rows: np.ndarray,
) -> None:  # fmt: skip
    """p = z + beta p;  y = d + beta y;  s += alpha p;  t += alpha y;  r -= alpha (y + K p). rows: as of
    `begin_and_advance`."""
    alpha, beta = p.dtype.type(alpha), p.dtype.type(beta)
    for row in range(offset.size - 1):
        begin, end = np.uint64(offset[row]), np.uint64(offset[row + 1])
        for i in range(begin, end):
            p[i] = z[i] + beta * p[i]
        for i in range(begin, end):
            y[i] = d[i] + beta * y[i]
        for i in range(begin, end):
            s[i] += alpha * p[i]
        for i in range(begin, end):
            t[i] += alpha * y[i]
        for i in range(begin, end):
            r[i] -= alpha * (y[i] + k[i] * p[i])
        rows[0, row], rows[1, row] = _imbalance_and_size(r, s, k, begin, end)
