"""Search for numbers that are not finite: array, entry and rank. Plain NumPy."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

PIECE = 2**17
"""Numbers examined at a time, to avoid a copy of a whole array."""


def lines_of(array: np.ndarray) -> np.ndarray:
    """A contiguous array as lines of real numbers, (lines, width), real and imaginary parts side by side. A view."""
    real = array.view(array.real.dtype)
    return real.reshape(math.prod(real.shape[:-1]), real.shape[-1])


def first_not_finite(lines: np.ndarray) -> tuple[int, int] | None:
    """(line, column) of the first number that is infinite or NaN; None if there is none."""
    for line, values in enumerate(lines):
        for start in range(0, values.size, PIECE):
            wrong = np.flatnonzero(~np.isfinite(values[start : start + PIECE]))
            if wrong.size:
                return line, start + int(wrong[0])
    return None


def not_finite_on(comm: Intracomm, arrays: dict[str, np.ndarray]) -> str:
    """The first number in the ranks' shares of these arrays that is not finite, as "name[line, column] = nan on rank
    1", with indices in the whole array; empty if all are finite. Collective.

    Shares are adjacent along the last axis, in the order of the ranks; lines run over all other axes.
    """
    found: tuple[str, int, tuple[int, int], float] | None = None
    for name, array in sorted(arrays.items()):
        lines = lines_of(array)
        index = first_not_finite(lines)
        if index is not None:
            found = name, lines.shape[1], index, float(lines[index])
            break
    reports = comm.allgather(found) if comm.size > 1 else [found]
    first = next(((rank, report) for rank, report in enumerate(reports) if report is not None), None)
    if first is None:
        return ""
    rank, (name, _, (line, column), value) = first
    # Other ranks may have stopped at another array, or found nothing: ask for this one.
    width = lines_of(arrays[name]).shape[1]
    widths = comm.allgather(width) if comm.size > 1 else [width]
    return f"{name}[{line}, {sum(widths[:rank]) + column}] = {value} on rank {rank}"
