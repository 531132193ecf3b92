"""A batch of rows of points, to their Fourier coefficients and back: three ways.

Each takes `most` rows at a time, and has their coefficients in the first lines of `hat`, complex, (most, columns).
`forward(vector, row, count, scale)` fills `count` of them from row `row` of a point vector on, times a number;
`backward(row, count, vector)` fills a point vector from them, and destroys them.
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
"""A transform that is planned, from buffer to buffer."""
ComplexLines = tuple[np.ndarray, Transform, Transform]
"""Buffer and transforms, forward and backward, of transform.complex_lines."""
RealLines = tuple[np.ndarray, np.ndarray, Transform, Transform]
"""The same of transform.real_lines, with a buffer for each side."""
_APART = 16
"""Numbers between the coefficients of one row and of the next."""


class Rows(Protocol):
    """What the following three have in common."""

    most: int
    hat: np.ndarray

    def forward(self, vector: np.ndarray, row: int, count: int, scale: float) -> None:
        """Rows of a point vector to coefficients."""

    def backward(self, row: int, count: int, vector: np.ndarray) -> None:
        """Coefficients to rows of a point vector."""


class RealRows:
    """Each row by a transform from real to complex numbers. lines: of transform.real_lines."""

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
    """Two rows by one complex transform: where FFTW is slow from real to complex numbers. lines: of complex_lines."""

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
        # A row without a partner must not be rounded to what another left there.
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
        # With an odd half the last column has no neighbour but a column of zeros. Rows whose distance is a power of two would
        # push each other out of the cache.
        self._parts = np.zeros((self.most, 2 * columns + _APART), real)
        self.hat, self._line_parts = self._parts.view(self._line.dtype), self._line.view(real)
        self._cosine, self._sine = cosine, sine

    def forward(self, vector: np.ndarray, row: int, count: int, scale: float) -> None:
        """Rows of a point vector to coefficients."""
        mirrored_kernels.scatter_pairs(vector, self._points.offset, row, count, scale, self._line_parts)
        self._transform()
        # What is behind the last coefficient goes into the columns beside it, and must be nothing: ranks have other rows.
        self._parts[:, self._line.shape[1] :] = 0.0
        mirrored_kernels.separate(self._line_parts, self._cosine, self._sine, self._parts)

    def backward(self, row: int, count: int, vector: np.ndarray) -> None:
        """Coefficients to rows of a point vector."""
        self._parts[count:] = 0.0
        mirrored_kernels.join(self._parts, self._cosine, self._sine, self._line_parts)
        self._transform_back()
        mirrored_kernels.gather_pairs(self._line_parts, self._points.offset, row, count, vector)
