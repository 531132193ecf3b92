"""Compiled kernels of the two-grid correction (two_grid.py): between points and coarse cells of m x m of them.

`first` (rows,): the column of a row's first point, counted in points from the left edge of the coarse block; coarse
arrays are rectangular, (coarse rows, coarse columns), or (rows, coarse columns) for what one row of points adds.
"""

from __future__ import annotations

import numpy as np

from .compiled import compiled

_compile = compiled(fastmath={"reassoc", "contract", "nsz"})
_compile_maxima = compiled(fastmath={"reassoc", "contract", "nsz", "nnan"})


@_compile
def sum_in_cells(v, offset, first, m, sums):
    """sums[row, c]: sum of v over the points of a row in the coarse column c."""
    for row in range(offset.size - 1):
        here = sums[row]
        here[:] = 0
        start, stop = offset[row], offset[row + 1]
        column = first[row] // m
        end = start + (column + 1) * m - first[row]
        while start < stop:
            total = np.float32(0.0)
            for i in range(np.uint64(start), np.uint64(min(end, stop))):
                total += v[i]
            here[column] = total
            start, end, column = end, end + m, column + 1


@_compile
def fold(sums, begin, m, scale, cells):
    """cells[I]: scale * the sum of the rows of `sums` in the coarse row I; begin: the first row, in points from the top
    of the coarse block."""
    cells[:] = 0
    for row in range(sums.shape[0]):
        target = cells[(begin + row) // m]
        for c in range(target.size):
            target[c] += sums[row, c]
    cells *= scale


@_compile
def turn_residual(r, k, offset, first, begin, m, s, line, t, sums):
    """t = r - K P s, with P bilinear between the centres of cells; sums[row, c]: of -K P s. s has a rim of one cell all
    around; `line` one row of it."""
    per_cell = np.float32(1.0 / m)
    half = np.float32(0.5)
    for row in range(offset.size - 1):
        here = sums[row]
        here[:] = 0
        start, stop = offset[row], offset[row + 1]
        if start == stop:
            continue
        place = (begin + row + 0.5) / m + 0.5
        above = int(place)
        weight = np.float32(place - above)
        for c in range(line.size):
            line[c] = s[above, c] + weight * (s[above + 1, c] - s[above, c])
        column = first[row] // m
        inside = first[row] - column * m
        while start < stop:
            end = min(start + m - inside, stop)
            left, mid, right = line[column], line[column + 1], line[column + 2]
            down, up = mid - left, right - mid
            total = np.float32(0.0)
            for i in range(np.uint64(0), np.uint64(end - start)):
                x = (np.float32(i) + np.float32(inside) + half) * per_cell - half
                value = -k[start + i] * (mid + x * (up if x > 0 else down))
                t[start + i] = r[start + i] + value
                total += value
            here[column] = total
            start, inside, column = end, 0, column + 1


@_compile
def add_cells(cells, offset, first, begin, m, t):
    """t += the value of the cell that a point is in."""
    for row in range(offset.size - 1):
        here = cells[(begin + row) // m]
        start, stop = offset[row], offset[row + 1]
        column = first[row] // m
        end = start + (column + 1) * m - first[row]
        while start < stop:
            value = here[column]
            for i in range(np.uint64(start), np.uint64(min(end, stop))):
                t[i] += value
            start, end, column = end, end + m, column + 1


@_compile_maxima
def roughness(r, k, cells, offset, first, begin, m, rows):
    """rows[0]: the largest |r - value of its cell| over points that interact (K != 0), row by row."""
    for row in range(offset.size - 1):
        here = cells[(begin + row) // m]
        start, stop = offset[row], offset[row + 1]
        column = first[row] // m
        end = start + (column + 1) * m - first[row]
        largest = np.float32(0.0)
        while start < stop:
            value = here[column]
            for i in range(np.uint64(start), np.uint64(min(end, stop))):
                largest = max(largest, abs(r[i] - value) if k[i] != 0.0 else np.float32(0.0))
            start, end, column = end, end + m, column + 1
        rows[0, row] = largest


@_compile
def survey(z, d, r, k, p, y, first, offset, rows):
    """rows[0] of z (d + K z);  rows[1] of r z;  rows[2] of z (y + K p), nothing in the first direction."""
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


@_compile_maxima
def turn_and_advance(z, d, beta, alpha, k, p, y, s, t, r, first, offset, rows):
    """p = z + beta p;  y = d + beta y;  s += alpha p;  t += alpha y;  r -= alpha (y + K p), in one pass; the first one
    begins with all but r zero, whatever is in them.

    rows[0], rows[1]: the largest |p| and |s| over points that interact (K != 0), row by row; rows[2] of r.
    """
    for row in range(offset.size - 1):
        turn, size, imbalance = 0.0, 0.0, 0.0
        for i in range(np.uint64(offset[row]), np.uint64(offset[row + 1])):
            if first:
                a, b = z[i], d[i]
                s[i] = alpha * a
                t[i] = alpha * b
            else:
                a = z[i] + beta * p[i]
                b = d[i] + beta * y[i]
                s[i] += alpha * a
                t[i] += alpha * b
            p[i] = a
            y[i] = b
            rest = r[i] - alpha * (b + k[i] * a)
            r[i] = rest
            imbalance += rest
            interacting = k[i] != 0.0
            turn = max(turn, abs(a) if interacting else 0.0)
            size = max(size, abs(s[i]) if interacting else 0.0)
        rows[0, row] = turn
        rows[1, row] = size
        rows[2, row] = imbalance
