"""Multipliers G(kx, ky) of a Convolution. Each rank computes its own columns, with little additional memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from .grid import share
from .transform import MakeMultiplier, Spectrum

Compliance = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""The compliance G0(qx, qy) [m/Pa] of a periodic surface, for wave numbers [rad/m] of compatible shapes."""


class FreeCompliance(Protocol):
    """The compliance of a free surface (physics/free_kernel.py)."""

    def kernel(self, dx: np.ndarray, dy: np.ndarray, spacing: float) -> np.ndarray:
        """Displacement [m/Pa] at these offsets [m] due to a unit traction on a square with this side [m]."""
        ...


FEW = 1 << 13
"""Numbers that are computed at a time."""


def periodic_multiplier(compliance: Compliance, length: float) -> MakeMultiplier:
    """Multiplier of a compliance G0(qx, qy) in a cell of this length [m]: fills the columns of a Spectrum."""

    def fill(spectrum: Spectrum, multiplier: np.ndarray) -> None:
        unit, some = 2.0 * np.pi / length, max(1, FEW // spectrum.width)
        # A few columns at a time, because some compliances need a dozen arrays.
        for begin in range(0, spectrum.column_count, some):
            kx = spectrum.kx[begin : begin + some, None]
            multiplier[begin : begin + some] = compliance(unit * kx, unit * spectrum.ky[None, :]) / spectrum.n**2

    return fill


def free_multiplier(compliance: FreeCompliance, spacing: float) -> MakeMultiplier:
    """Multiplier of a free surface: the transform of its kernel on the doubled domain; fills the columns of a Spectrum.

    compliance: with `kernel(dx, dy, spacing)`, even in both offsets, so that one quadrant is enough. Each rank
    transforms its share of the kernel's rows, and then its columns. Collective.
    """

    def fill(spectrum: Spectrum, multiplier: np.ndarray) -> None:
        n = spectrum.n
        fold = np.minimum(np.arange(n), n - np.arange(n))
        offsets = np.arange(spectrum.width) * spacing
        first, count = share(spectrum.width, spectrum.comm.size, spectrum.comm.rank)
        along_x = np.empty((count, spectrum.width))
        for row, dy in enumerate(offsets[first : first + count]):
            values = compliance.kernel(offsets, np.full_like(offsets, dy), spacing)
            along_x[row] = np.fft.rfft(values[fold]).real
        for column, along_y in enumerate(spectrum.columns_of(along_x)):
            multiplier[column] = np.fft.rfft(along_y[fold]).real / n**2

    return fill
