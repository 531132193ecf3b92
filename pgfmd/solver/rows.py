"""Transforms of batches of rows of points to Fourier coefficients and back: three methods.

Each transforms up to `most` rows at a time, with coefficients in the first lines of `hat`, complex, (most, columns).
`forward(vector, row, count, scale)` computes `count` lines from the rows of a point vector, from `row` on, times scale;
`backward(row, count, vector)` computes the rows of a point vector, and overwrites the lines.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

import numpy as np

from . import mirrored_kernels
from . import transform_kernels as kernels

if TYPE_CHECKING:
    from .grid import PunchPoints

Transform = Callable[[], object]
"""A planned transform between buffers."""
ComplexLines = tuple[np.ndarray, Transform, Transform]
"""Buffer and transforms, forward and backward, of transform.complex_lines."""
RealLines = tuple[np.ndarray, np.ndarray, Transform, Transform]
"""The same of transform.real_lines, with a buffer for each side."""
_APART = 16
"""Unused numbers between the coefficients of consecutive rows."""


class Rows(Protocol):
    """The common interface of the three methods."""

    most: int
    hat: np.ndarray

    def forward(self, vector: np.ndarray, row: int, count: int, scale: float) -> None:
        """Rows of a point vector to coefficients."""

    def backward(self, row: int, count: int, vector: np.ndarray) -> None:
        """Coefficients to rows of a point vector."""


class RealRows:
    """Each row by a real-to-complex transform. lines: of transform.real_lines."""

    def __init__(self, points: PunchPoints, lines: RealLines) -> None:
        self._points, (self.line, self.hat, self._transform, self.transform_back) = points, lines
        self.most = self.hat.shape[0]

    def forward(self, vector: np.ndarray, row: int, count: int, scale: float) -> None:
        """Rows of a point vector to coefficients."""
        kernels.scatter_rows(vector, self._points.offset, self._points.first, row, count, scale, self.line)
        self._transform()

    def backward(self, row: int, count: int, vector: np.ndarray) -> None:
        """Coefficients to rows of a point vector."""
        self.transform_back()
        kernels.gather_rows(self.line, self._points.offset, self._points.first, row, count, vector)


class PackedRows:
    """Two rows by one complex transform, if FFTW's real-to-complex transform is slow. lines: of complex_lines."""

    def __init__(self, points: PunchPoints, lines: ComplexLines) -> None:
        self._points, (self.line, self._transform, self._transform_back) = points, lines
        self.most = 2 * self.line.shape[0]
        self.hat = np.zeros((self.most, self.line.shape[1] // 2 + 1), self.line.dtype)
        real = self.line.real.dtype
        self._line_parts, self._parts = self.line.view(real), self.hat.view(real)

    def forward(self, vector: np.ndarray, row: int, count: int, scale: float) -> None:
        """Rows of a point vector to coefficients."""
        kernels.scatter_packed(vector, self._points.offset, self._points.first, row, count, scale, self._line_parts)
        self._transform()
        kernels.separate_packed(self._line_parts, self._parts.dtype.type(0.5), self._parts)

    def backward(self, row: int, count: int, vector: np.ndarray) -> None:
        """Coefficients to rows of a point vector."""
        # The partner of a single row is zero: the rounding of the row must not depend on old contents.
        self.hat[count:] = 0.0
        kernels.join_packed(self._parts, self._line_parts)
        self._transform_back()
        kernels.gather_packed(self._line_parts, self._points.offset, self._points.first, row, count, vector)


class MirroredRows:
    """The right halves of two rows that are their own mirror images by one complex transform (mirrored_kernels.py).

    lines: of complex_lines, for n/2 points. columns: complex ones, of two real coefficients each. cosine, sine: of
    mirrored_transform.turns.
    """

    def __init__(
        self, points: PunchPoints, lines: ComplexLines, columns: int, cosine: np.ndarray, sine: np.ndarray
    ) -> None:
        self._points, (self._line, self._transform, self._transform_back) = points, lines
        self.most, real = 2 * self._line.shape[0], self._line.real.dtype
        # With an odd half, the neighbour of the last column is a column of zeros. Rows at a distance of a power of two would
        # compete for the same cache lines.
        self._parts = np.zeros((self.most, 2 * columns + _APART), real)
        self.hat, self._line_parts = self._parts.view(self._line.dtype), self._line.view(real)
        self._cosine, self._sine = cosine, sine

    def forward(self, vector: np.ndarray, row: int, count: int, scale: float) -> None:
        """Rows of a point vector to coefficients."""
        mirrored_kernels.scatter_pairs(vector, self._points.offset, row, count, scale, self._line_parts)
        self._transform()
        # Numbers after the last coefficient become part of columns, and must be zero for any distribution of rows.
        self._parts[:, self._line.shape[1] :] = 0.0
        mirrored_kernels.separate(self._line_parts, self._cosine, self._sine, self._parts)

    def backward(self, row: int, count: int, vector: np.ndarray) -> None:
        """Coefficients to rows of a point vector."""
        self._parts[count:] = 0.0
        mirrored_kernels.join(self._parts, self._cosine, self._sine, self._line_parts)
        self._transform_back()
        mirrored_kernels.gather_pairs(self._line_parts, self._points.offset, row, count, vector)
