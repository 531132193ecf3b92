"""Which rows of a long curve a picture needs. Plain NumPy."""

from __future__ import annotations

import numpy as np

PARTS = 2000
"""Parts of a curve of which the lowest and highest points are drawn: more than a picture has columns of pixels."""


def seen_rows(*curves: np.ndarray) -> np.ndarray:
    """Numbers of the rows with which a line looks as with all of them, in their order: of each of `PARTS` equal parts
    the first row, and where each of the curves, (rows,), is lowest and highest. All rows where they are not many."""
    count = len(curves[0])
    size = -(-count // PARTS)
    if count <= 2 * PARTS * (1 + len(curves)):
        return np.arange(count)
    starts = np.arange(0, count, size)
    found = [starts, [count - 1]]
    whole = count // size * size
    for curve in curves:
        parts = np.asarray(curve)[:whole].reshape(-1, size)
        rest = np.asarray(curve)[whole:]
        for place in (np.argmin, np.argmax):
            found.append(starts[: len(parts)] + place(parts, axis=1))
            if rest.size:
                found.append([whole + place(rest)])
    return np.unique(np.concatenate(found))


def seen(*curves: np.ndarray) -> tuple[np.ndarray, ...]:
    """The curves, (rows,) each, at their `seen_rows`."""
    rows = seen_rows(*curves)
    return tuple(np.asarray(curve)[rows] for curve in curves)
