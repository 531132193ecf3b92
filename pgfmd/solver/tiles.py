"""The half spectrum between the transforms of rows and of columns, in tiles that both can access efficiently.

Stored by rows, a column would be read with a stride of a whole row: one cache line for each number. So a block (the
rows of one rank by the columns of another) consists of groups of as many columns as are transformed at a time, and a
group has its rows one after the other. A batch of columns is then contiguous for each rank that has rows, a batch of
rows writes stretches of several cache lines, and a block is one piece that can be sent unchanged.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Protocol

import numpy as np

from . import transform_kernels as kernels
from .node import Transposition

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm
    from numpy.typing import DTypeLike

    from .grid import PunchPoints
    from .rows import Rows


class Tiles(Transposition):
    """A Transposition whose blocks and columns consist of tiles.

    comm, rows, columns, dtype: as in Transposition. width: columns of a group. length: numbers of a transformed column.
    places: positions of the rows in it, (all rows,), by default the first ones.
    """

    def __init__(
        self, comm: Intracomm, rows: list[tuple[int, int]], columns: list[tuple[int, int]], dtype: DTypeLike, width: int,
        length: int, places: np.ndarray | None = None,
    ):  # fmt: skip
        super().__init__(comm, rows, columns, dtype)
        total, self.count = self.columns.shape
        self.rows, self.width = rows[comm.rank][1], width
        self._tiles = self.columns.reshape(-1)
        self._ends = np.array([0, *(start + count for start, count in rows)])
        self._places = np.arange(total) if places is None else places
        free = np.ones(length, bool)
        free[self._places] = False
        # They are next to each other.
        self._free = int(np.argmax(free)), int(np.argmax(free) + free.sum())
        self._blocks = [(first, last - first, block.reshape(-1)) for first, last, block in self.blocks]

    def put(self, hat: np.ndarray, row: int, count: int) -> None:
        """Stores the first `count` lines of `hat`, (any, all columns), as this rank's rows from `row` on."""
        for first, columns, block in self._blocks:
            kernels.put_rows(hat, count, first, row, self.rows, columns, self.width, block)

    def take(self, row: int, count: int, hat: np.ndarray) -> None:
        """The inverse of `put`."""
        for first, columns, block in self._blocks:
            kernels.take_rows(block, count, first, row, self.rows, columns, self.width, hat)

    @property
    def groups(self) -> range:
        """The first column of each group of this rank's columns."""
        return range(0, self.count, self.width)

    def load(self, column: int, buffer: np.ndarray) -> int:
        """Copies the group of columns that begins with this one to the first lines of a buffer (width, length); returns
        their number."""
        return kernels.load_columns(
            self._tiles, self._ends, self.count, self.width, column, self._places, *self._free, buffer
        )  # fmt: skip

    def store(self, column: int, buffer: np.ndarray, places: np.ndarray | None = None) -> None:
        """The inverse of `load`. places: positions of the rows, if they differ from those of `load`."""
        places = self._places if places is None else places
        kernels.store_columns(buffer, self._ends, self.count, self.width, column, places, self._tiles)


class Convolves(Protocol):
    """An operator between point vectors, u = G * w, as solvers use it (transform.Convolution).

    pairs: number of transforms so far. seconds [s]: time spent in them. mean_compliance: G of a uniform traction."""

    points: PunchPoints
    dtype: np.dtype
    mean_compliance: float

    @property
    def pairs(self) -> int: ...

    @property
    def seconds(self) -> float: ...

    def __call__(self, traction: np.ndarray, displacement: np.ndarray, scale: float = 1.0) -> np.ndarray:
        """displacement = scale * G * traction, point vectors (size,) in real space; collective."""
        ...

    def whole_cell(self, traction: np.ndarray) -> tuple[np.ndarray, int]:
        """Displacement of every point of the cell, where the traction is that of the whole punch (transform.py)."""
        ...


class PairOperator:
    """An operator between point vectors with one pair of transforms per call: rows forward, columns, rows backward.
    Counts its calls in `pairs` and their time [s] in `seconds`.

    `_rows` (rows.py) transforms rows, `_transposition` (tiles.py) transposes, and `_convolve_columns` convolves
    columns.
    """

    points: PunchPoints
    dtype: np.dtype
    mean_compliance: float
    _rows: Rows
    _transposition: Tiles
    pairs, seconds = 0, 0.0

    def __call__(self, traction: np.ndarray, displacement: np.ndarray, scale: float = 1.0) -> np.ndarray:
        """displacement = scale * G * traction, point vectors (size,) in real space; collective."""
        start = time.perf_counter()
        self._rows_forward(traction, scale)
        self._convolve_columns()
        self._rows_backward(displacement)
        self.pairs += 1
        self.seconds += time.perf_counter() - start
        return displacement

    def _convolve_columns(self) -> None:
        raise NotImplementedError

    def whole_cell(self, traction: np.ndarray) -> tuple[np.ndarray, int]:
        """Of an operator between the points of the whole punch: see transform.Convolution."""
        raise NotImplementedError

    def _rows_forward(self, traction: np.ndarray, scale: float) -> None:
        """From a point vector to complete columns, transformed along x."""
        rows, scale = self._rows, self.dtype.type(scale)
        for row in range(0, self.points.rows, rows.most):
            count = min(rows.most, self.points.rows - row)
            rows.forward(traction, row, count, scale)
            self._transposition.put(rows.hat, row, count)
        self._transposition.to_columns()

    def _rows_backward(self, values: np.ndarray) -> None:
        """From columns to a point vector, transformed along x."""
        self._transposition.to_rows()
        rows = self._rows
        for row in range(0, self.points.rows, rows.most):
            count = min(rows.most, self.points.rows - row)
            self._transposition.take(row, count, rows.hat)
            rows.backward(row, count, values)
