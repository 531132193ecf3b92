"""Traction to displacement on the punch block by one fused, pruned pair of distributed Fourier transforms.

The only module that imports mpi4py-fft. A traction that lives on `nb` rows and columns is convolved with an even
kernel, whose multiplier G(kx, ky) is real and even, and the result is wanted on `out` rows and columns:

1. real-to-complex along x, for the occupied rows only (rows.py), and transposition to columns (node.py, tiles.py);
2. for a few columns at a time, in cache: pad with zeros, complex transform along y, times G, back, keep wanted rows;
3. transposition of the wanted rows back, and complex-to-real along x.

No array of the whole plane exists. The order of all sums does not depend on the number of ranks, and plans are made
with FFTW_ESTIMATE by default, so the result has the same bits for any number of ranks.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
from mpi4py_fft import PFFT, fftw, newDistArray
from mpi4py_fft.pencil import Pencil, Subcomm

from . import transform_kernels as kernels
from .grid import PunchPoints, share
from .node import Node, Transposition
from .rows import ComplexLines, PackedRows, RealLines, RealRows
from .tiles import PairOperator, Tiles

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm
    from numpy.typing import DTypeLike

EFFORTS = {"estimate": fftw.FFTW_ESTIMATE, "measure": fftw.FFTW_MEASURE}
_COLUMN_BYTES = 1 << 18
"""Working set of one batch of columns: a quarter of a usual second-level cache."""
ROW_BYTES = 1 << 19
"""Working set of one batch of rows. Larger batches are written into tiles in longer stretches (n = 4096, double: 8
instead of 4 rows make them 1.5 times as fast)."""
_LARGEST_BATCH = 16
"""Most transforms in a batch. With 8, transforms below n = 1024 take 4 to 25 % longer; with more than 16, ranks with
few columns perform unnecessary transforms."""
_CACHE_LINE = 64
"""Bytes. A narrower group of columns reads the same cache lines several times."""


def _batch(length: int, itemsize: int, count: int, room: int) -> int:
    """Number of transforms of this length in a batch of about `room` bytes; a multiple of 4 if there are enough.

    count: of all ranks together. FFTW's algorithm may depend on the size of the batch, which therefore must not depend
    on the number of ranks.
    """
    fitting = max(_CACHE_LINE // itemsize, room // (length * itemsize))
    return max(1, min(fitting - fitting % 4, count, _LARGEST_BATCH))


def forget_plans() -> None:
    """Deletes FFTW's memory of earlier plans in this process, which would influence the choice of algorithms, and so
    the last bits. To be called before plans are made."""
    fftw.forget_wisdom()


def complex_lines(
    length: int, count: int, dtype: DTypeLike, flags: tuple[int, ...], room: int = _COLUMN_BYTES
) -> ComplexLines:
    """A buffer for a batch of complex lines of this length, and the in-place transforms forward and backward. count: of
    all ranks together. room [bytes]: largest size of a batch."""
    lines = fftw.aligned((_batch(length, np.dtype(dtype).itemsize, count, room), length), dtype=dtype, fill=0)
    forward = fftw.fftn(lines, axes=(1,), flags=flags, output_array=lines)
    return lines, forward, fftw.ifftn(lines, axes=(1,), flags=flags, output_array=lines)


def real_lines(length: int, count: int, dtype: DTypeLike, flags: tuple[int, ...]) -> RealLines:
    """Buffers for a batch of real lines of this length and for their half spectra, and the transforms between them.
    count: of all ranks together."""
    kind = np.result_type(dtype, np.complex64)
    batch = _batch(length, kind.itemsize, count, ROW_BYTES)
    lines = fftw.aligned((batch, length), dtype=dtype, fill=0)
    hat = fftw.aligned((batch, length // 2 + 1), dtype=kind, fill=0)
    forward = fftw.rfftn(lines, axes=(1,), flags=flags, output_array=hat)
    # Both directions use the same buffers. The second overwrites its input, which is filled again each time.
    return lines, hat, forward, fftw.irfftn(hat, s=(length,), axes=(1,), flags=flags, output_array=lines)


class Spectrum:
    """The columns of the half spectrum that this rank owns, for a transform of `n` points a side.

    shares: (first, count) of each rank's columns, even ones where there are none. `kx` (columns,) are its x-indices,
    out of 0 ... n//2; y-indices run over `ky` = 0 ... n//2, as G is even in them.
    """

    def __init__(self, n: int, comm: Intracomm, shares: list[tuple[int, int]] | None = None):
        self.n, self.width, self.comm = n, n // 2 + 1, comm
        self.shares = shares or [share(self.width, comm.size, rank) for rank in range(comm.size)]
        self.first_column, self.column_count = self.shares[comm.rank]
        self.kx = np.arange(self.first_column, self.first_column + self.column_count)
        self.ky = np.arange(self.width)

    def columns_of(self, rows: np.ndarray) -> Iterator[np.ndarray]:
        """This rank's columns (width,), one after the other, of a square real array whose rows are distributed evenly.
        Collective; has to be iterated to the end."""
        if self.comm.size == 1:
            yield from rows[:, : self.column_count].T
            return
        even = [share(self.width, self.comm.size, rank) for rank in range(self.comm.size)]
        transposition = Transposition(self.comm, even, self.shares, rows.dtype)
        for first, last, block in transposition.blocks:
            block[:] = rows[:, first:last]
        transposition.to_columns()
        yield from transposition.columns.T
        # Free the shared memory as soon as no rank needs it.
        del transposition, block
        Node.of(self.comm).trim()


MakeMultiplier = Callable[[Spectrum, np.ndarray], None]
"""Fills an array (columns, n//2 + 1) with G/n^2 for a Spectrum's columns (multiplier.py)."""


class Pruned(PairOperator):
    """Buffers and plans of transforms between point vectors and the columns of a Spectrum.

    points: PunchPoints; n: points a side of the transform; effort: of FFTW's planner; dtype: of real numbers.
    """

    def __init__(self, points: PunchPoints, n: int, effort: str, dtype: DTypeLike):
        self.points, self.n, self.comm = points, n, points.comm
        self.dtype, self.complex = np.dtype(dtype), np.result_type(dtype, np.complex64)
        self.spectrum, flags = Spectrum(n, points.comm), (EFFORTS[effort],)
        forget_plans()
        if self.dtype == np.float32:
            self._rows = PackedRows(points, complex_lines(n, (points.nb + 1) // 2, self.complex, flags, ROW_BYTES))
        else:
            self._rows = RealRows(points, real_lines(n, points.nb, self.dtype, flags))
        self._column, self._forward, self._backward = complex_lines(n, self.spectrum.width, self.complex, flags)
        self._parts = self._column.view(self.dtype)
        self._transposition = Tiles(
            self.comm, points.row_shares, self.spectrum.shares, self.complex, self._column.shape[0], n
        )  # fmt: skip


class Convolution(Pruned):
    """u = G * w between point vectors: one pair of transforms a call.

    points: the PunchPoints that the traction lives on. n: points a side of the transform, at least what the kernel
    needs not to wrap around. make_multiplier: fills an array with G/n^2 for a Spectrum's columns, (columns, n//2 + 1),
    as `periodic_multiplier`.
    """

    def __init__(
        self,
        points: PunchPoints,
        n: int,
        make_multiplier: MakeMultiplier,
        effort: str = "estimate",
        dtype: DTypeLike = np.float64,
    ):
        super().__init__(points, n, effort, dtype)
        assert min((points.nb + 1) // 2, self.spectrum.width) >= self.comm.size, (
            "more ranks than pairs of rows, or columns"
        )
        self.multiplier = np.empty((self.spectrum.column_count, self.spectrum.width), self.dtype)
        make_multiplier(self.spectrum, self.multiplier)
        # G at q = 0, the same on every rank.
        self.mean_compliance = self.comm.bcast(float(self.multiplier[0, 0])) * n**2

    def whole_cell(self, traction: np.ndarray) -> tuple[np.ndarray, int]:
        """Displacement of every point of the cell for a traction on the punch: (rows of this rank, n), first row;
        collective.

        The transform must be large enough for the whole cell: its n at least the cell's in a periodic cell, the cell's
        plus the block's for a free surface.
        """
        cell, start = self.points.grid.n, self.points.block_start
        rows = Pencil(Subcomm(self.comm, [0, 1]), (cell, self.spectrum.width), axis=1)
        columns = rows.pencil(0)
        assert columns.subshape[1] == self.spectrum.column_count, "mpi4py-fft shares columns otherwise"
        wide_columns = np.empty(columns.subshape, self.complex)
        wide_rows = np.empty(rows.subshape, self.complex)
        self._rows_forward(traction, 1.0)
        # Row and column 0 of the transform are the block's; the cell begins `start` before them.
        wanted = (np.arange(cell) - start) % self.n
        for column, count in self._convolved():
            wide_columns[:, column : column + count] = self._column[:count, wanted].T
        self._transposition.meet()
        rows.transfer(columns, self.complex).backward(wide_columns, wide_rows)
        surface = np.empty((rows.subshape[0], cell))
        forget_plans()
        line, hat, _, backward = real_lines(self.n, self.points.nb, self.dtype, (EFFORTS["estimate"],))
        for row in range(0, surface.shape[0], hat.shape[0]):
            count = min(hat.shape[0], surface.shape[0] - row)
            hat[:count] = wide_rows[row : row + count]
            backward()
            surface[row : row + count] = line[:count, wanted]
        self.pairs += 1
        return surface, rows.substart[0]

    def _convolve_columns(self) -> None:
        for column, _ in self._convolved():
            self._transposition.store(column, self._column)

    def _convolved(self) -> Iterator[tuple[int, int]]:
        """Yields (first, number) of batches of columns in the buffer, transformed along y, multiplied by G, and
        back."""
        for column in self._transposition.groups:
            count = self._transposition.load(column, self._column)
            self._forward()
            kernels.multiply_columns(self._parts, self.multiplier, column, count)
            self._backward()
            yield column, count


class Plane:
    """The whole plane in real and in spectral space, by mpi4py-fft's own slab-decomposed pair of transforms.

    `real` (rows of this rank, n) holds the rows from `row_start` on. `spectral` (n, columns of this rank) is the half
    spectrum from column `first_column` on, whole along axis 0. Both are the transform's own buffers: `forward` and
    `backward` overwrite one from the other, and destroy what they start from. Neither normalises, so that a backward
    after a forward multiplies by n^2. Counts pairs (as backward transforms) and the time of both.
    """

    def __init__(self, comm: Intracomm, n: int, effort: str = "estimate"):
        self.comm, self.n = comm, n
        forget_plans()
        self._plan = _whole_plane(comm, n, effort)
        self.real, self.spectral = self._plan.forward.input_array, self._plan.forward.output_array
        self.real[:] = 0.0
        self.spectral[:] = 0.0
        self.row_start = self._plan.local_slice(False)[0].start
        self.first_column = self._plan.local_slice(True)[1].start
        self.column_counts = np.array(comm.allgather(self.spectral.shape[1]))
        self.pairs, self.seconds = 0, 0.0

    @property
    def kx(self) -> np.ndarray:
        """Indices 0 ... n//2 of this rank's columns."""
        return np.arange(self.first_column, self.first_column + self.spectral.shape[1])

    def forward(self) -> None:
        """`spectral` = sum over points of `real` exp(-i q r). Collective."""
        start = time.perf_counter()
        self._plan.forward(normalize=False)
        self.seconds += time.perf_counter() - start

    def backward(self) -> None:
        """`real` = sum over modes of `spectral` exp(i q r). Collective."""
        start = time.perf_counter()
        self._plan.backward(normalize=False)
        self.pairs += 1
        self.seconds += time.perf_counter() - start

    def sum_over_ranks(self, values: np.ndarray) -> np.ndarray:
        """Sums of a few numbers over the ranks; of the same bits for any number of them if all but one are zero.
        Collective."""
        if self.comm.size == 1:
            return values
        total = np.empty_like(values)
        self.comm.Allreduce(values, total)
        return total

    def total_of(self, sums: np.ndarray) -> np.ndarray:
        """Sums over all columns of the half spectrum, of this rank's (kinds, columns); returns (kinds,). Collective.

        The order does not depend on the number of ranks.
        """
        if self.comm.size == 1:
            own: np.ndarray = sums.sum(axis=1)
            return own
        kinds = sums.shape[0]
        gathered = np.empty((self.column_counts.sum(), kinds))
        self.comm.Allgatherv(np.ascontiguousarray(sums.T), [gathered, self.column_counts * kinds])
        total: np.ndarray = np.ascontiguousarray(gathered.T).sum(axis=1)
        return total


def _whole_plane(comm: Intracomm, n: int, effort: str) -> PFFT:
    """mpi4py-fft's pair of transforms. By default it measures plans, and the last bits of a run would then depend on
    the load of the machine."""
    name = {"estimate": "FFTW_ESTIMATE", "measure": "FFTW_MEASURE"}[effort]
    return PFFT(comm, (n, n), axes=(0, 1), dtype=np.float64, grid=(-1, 1), planner_effort=name)


def plain_pair(comm: Intracomm, n: int, effort: str = "estimate") -> Callable[[], None]:
    """mpi4py-fft's own r2c + c2r pair on the whole n x n plane, for comparison: a function that does one."""
    plan = _whole_plane(comm, n, effort)
    real, spectral = newDistArray(plan, False), newDistArray(plan, True)
    real[:] = 1.0

    def pair() -> None:
        plan.forward(real, spectral)
        plan.backward(spectral, real)

    return pair
