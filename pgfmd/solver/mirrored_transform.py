"""The convolution for mirror-symmetric fields, on a half or a quarter of the points.

With symmetry under x -> -x, only the right half of a row is stored. Its Fourier transform is real: a cosine transform
of n/2 points; two rows are one complex transform of n/2 (mirrored_kernels.py). So columns are real, and two of them are
combined into one complex column. With symmetry under y -> -y as well, only half of each column is stored, and columns
are cosine transforms like the rows. Rows and columns are combined in fixed pairs, so the result has the same bits for
any number of ranks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from . import mirrored_kernels as kernels
from .grid import PunchPoints, share
from .rows import MirroredRows
from .tiles import PairOperator, Tiles
from .transform import EFFORTS, ROW_BYTES, Spectrum, complex_lines, forget_plans

if TYPE_CHECKING:
    from numpy.typing import DTypeLike

    from .transform import MakeMultiplier


class MirroredConvolution(PairOperator):
    """u = G * w between point vectors with mirror symmetry: a half or a quarter of the work of a pair of transforms.

    points: PunchPoints with a `mirror`. n: points a side of the whole transform, even, and at least what the kernel
    needs not to wrap around. make_multiplier, effort, dtype, `pairs`, `seconds`, `mean_compliance`: as of
    transform.Convolution.
    """

    def __init__(
        self,
        points: PunchPoints,
        n: int,
        make_multiplier: MakeMultiplier,
        effort: str = "estimate",
        dtype: DTypeLike = np.float64,
    ):
        assert n % 2 == 0 and points.mirror
        self.points, self.n, self.comm = points, n, points.comm
        self.dtype, self.complex = np.dtype(dtype), np.result_type(dtype, np.complex64)
        self._half = n // 2
        # Complex columns: the real ones with kx = 2 j and 2 j + 1, which are adjacent in memory.
        ranks = range(self.comm.size)
        shares = [share((self._half + 1) // 2, self.comm.size, rank) for rank in ranks]
        self.spectrum = Spectrum(n, self.comm, [(2 * first, 2 * count) for first, count in shares])
        self._plan((EFFORTS[effort],), shares)
        self.multiplier = np.empty((self.spectrum.column_count, self.spectrum.width), self.dtype)
        make_multiplier(self.spectrum, self.multiplier)
        # With more ranks than pairs of columns, some ranks have none.
        mean = float(self.multiplier[0, 0]) if self.comm.rank == 0 else 0.0
        self.mean_compliance = self.comm.bcast(mean) * n**2
        if "y" not in points.mirror:
            kernels.halve_pairs(self.multiplier)

    def _plan(self, flags: tuple[int, ...], shares: list[tuple[int, int]]) -> None:
        """Buffers and plans for these shares of the complex columns."""
        forget_plans()
        half, points, columns = self._half, self.points, sum(count for _, count in shares)
        rows, both = points.nb - points.top, "y" in points.mirror
        theta = 0.5 * np.pi * np.arange(half // 2 + 1) / half
        self._cosine, self._sine = np.cos(theta).astype(self.dtype), np.sin(theta).astype(self.dtype)
        lines = complex_lines(half, (rows + 1) // 2, self.complex, flags, ROW_BYTES)
        self._rows = MirroredRows(points, lines, columns, self._cosine, self._sine)
        length = half if both else self.n
        self._column, self._forward, self._backward = complex_lines(length, columns, self.complex, flags)
        self._parts, row = self._column.view(self.dtype), np.arange(rows)
        # Makhoul's order, of columns as of rows.
        places = np.where(row % 2, half - 1 - row // 2, row // 2) if both else None
        self._transposition = Tiles(
            self.comm, points.row_shares, shares, self.complex, self._column.shape[0], length, places
        )  # fmt: skip

    def _convolve_columns(self) -> None:
        """For pairs of columns: transforms along y, times G, and back; omits points beyond the punch."""
        both = "y" in self.points.mirror
        for column in self._transposition.groups:
            count = self._transposition.load(column, self._column)
            self._forward()
            if both:
                kernels.multiply_mirrored(self._parts, self.multiplier, column, count, self._cosine, self._sine)
            else:
                kernels.multiply_pairs(self._parts, self.multiplier, column, count)
            self._backward()
            self._transposition.store(column, self._column)
