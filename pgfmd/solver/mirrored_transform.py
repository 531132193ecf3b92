"""The same convolution where all fields are their own mirror images: on a half or a quarter of the points.

With x -> -x, a row is known by its right half. Its Fourier transform is real: a cosine transform of n/2 points, two
rows of which are one complex transform of n/2 (mirrored_kernels.py). So columns are real, and two of them are one complex
column. With y -> -y as well, columns are known by their lower halves, and become cosine transforms like the rows. All
rows and columns go in fixed pairs, so the result has the same bits for any number of ranks.
"""

from __future__ import annotations

import numpy as np

from . import mirrored_kernels as kernels
from . import transform_kernels
from .grid import share
from .node import Transposition
from .transform import EFFORTS, PairOperator, Spectrum, complex_lines, forget_plans


class MirroredConvolution(PairOperator):
    """u = G * w between point vectors that stand for their mirror images: a half or a quarter of a pair of transforms.

    points: PunchPoints with a `mirror`. n: points a side of the whole transform, even, and at least what the kernel
    needs not to wrap around. make_multiplier, effort, dtype, `pairs`, `seconds`, `mean_compliance`: as of
    transform.Convolution.
    """

    def __init__(self, points, n: int, make_multiplier, effort: str = "estimate", dtype=np.float64):
        assert n % 2 == 0 and points.mirror
        self.points, self.n, self.comm = points, n, points.comm
        self.dtype, self.complex = np.dtype(dtype), np.result_type(dtype, np.complex64)
        self._half = n // 2
        # Complex columns: the real ones with kx = 2 j and 2 j + 1 side by side, as they lie in memory.
        ranks = range(self.comm.size)
        shares = [share((self._half + 1) // 2, self.comm.size, rank) for rank in ranks]
        self._count = shares[self.comm.rank][1]
        self.spectrum = Spectrum(n, self.comm, [(2 * first, 2 * count) for first, count in shares])
        self._transposition = Transposition(self.comm, points.row_shares, shares, self.complex)
        self._columns = self._transposition.columns
        self._plan((EFFORTS[effort],), sum(count for _, count in shares))
        self.multiplier = np.empty((self.spectrum.column_count, self.spectrum.width), self.dtype)
        make_multiplier(self.spectrum, self.multiplier)
        # More ranks than pairs of columns leave some without.
        mean = float(self.multiplier[0, 0]) if self.comm.rank == 0 else 0.0
        self.mean_compliance = self.comm.bcast(mean) * n**2
        if "y" not in points.mirror:
            kernels.halve_pairs(self.multiplier)

    def _plan(self, flags, columns: int) -> None:
        forget_plans()
        half, points = self._half, self.points
        pairs = (points.nb - points.top + 1) // 2
        self._line, self._forward_line, self._backward_line = complex_lines(half, pairs, self.complex, flags)
        length = half if "y" in points.mirror else self.n
        self._column, self._forward, self._backward = complex_lines(length, columns, self.complex, flags)
        self._line_parts, self._column_parts = self._line.view(self.dtype), self._column.view(self.dtype)
        theta = 0.5 * np.pi * np.arange(half // 2 + 1) / half
        self._cosine, self._sine = np.cos(theta).astype(self.dtype), np.sin(theta).astype(self.dtype)
        # With an odd half the last column has no neighbour but a column of zeros.
        self._rows = np.zeros((2 * self._line.shape[0], 2 * columns), self.dtype)

    def _rows_forward(self, traction: np.ndarray, scale: float) -> None:
        """Point vector -> cosine transformed along x, columns whole on each rank."""
        points, most, pairs = self.points, self._rows.shape[0], self._rows.view(self.complex)
        scale = self.dtype.type(scale)
        for row in range(0, points.rows, most):
            count = min(most, points.rows - row)
            kernels.scatter_pairs(traction, points.offset, row, count, scale, self._line_parts)
            self._forward_line()
            kernels.separate(self._line_parts, self._cosine, self._sine, self._rows)
            for first, last, block in self._transposition.blocks:
                block[row : row + count] = pairs[:count, first:last]
        self._transposition.to_columns()

    def _rows_backward(self, values: np.ndarray) -> None:
        """Columns -> point vector."""
        self._transposition.to_rows()
        points, most, pairs = self.points, self._rows.shape[0], self._rows.view(self.complex)
        for row in range(0, points.rows, most):
            count = min(most, points.rows - row)
            for first, last, block in self._transposition.blocks:
                pairs[:count, first:last] = block[row : row + count]
            # A row without a partner must not be rounded to what another left there.
            pairs[count:] = 0.0
            kernels.join(self._rows, self._cosine, self._sine, self._line_parts)
            self._backward_line()
            kernels.gather_pairs(self._line_parts, points.offset, row, count, values)

    def _convolve_columns(self) -> None:
        """Pairs of columns: transform along y, times G, back; what is beyond the punch is left out."""
        batch, columns = self._column.shape[0], self._columns
        for column in range(0, self._count, batch):
            count = min(batch, self._count - column)
            if "y" in self.points.mirror:
                kernels.load_mirrored(columns, column, count, self._column)
                self._forward()
                kernels.multiply_mirrored(
                    self._column_parts, self.multiplier, column, count, self._cosine, self._sine
                )  # fmt: skip
                self._backward()
                kernels.store_mirrored(self._column, column, count, columns)
            else:
                transform_kernels.load_columns(columns, column, count, self._column)
                self._forward()
                kernels.multiply_pairs(self._column_parts, self.multiplier, column, count)
                self._backward()
                transform_kernels.store_columns(self._column, column, count, 0, columns)
