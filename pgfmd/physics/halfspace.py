"""Static compliance of the elastomer: the multiplier G0 that turns traction [Pa] into displacement [m].

Periodic cells apply it mode by mode, `u_hat(q) = G0(q) f_hat(q)`; `film.py` holds the film of finite thickness and
`free_kernel.py` the non-periodic solids, which are convolutions in real space instead. Every compliance says which of
the two it is through `is_free`.

The rule at q = 0, stated here only: a half-space gives way without bound to a mean traction, so in a periodic cell its
mean displacement is the reference, `u_hat(q = 0) = 0`, and G0(0) is returned as zero. A film has a finite uniform
compliance, and that is its G0(0).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pgfmd.files.text import read_numbers

RANGE_SLACK = 1e-9  # relative; wave vectors at the very end of a table differ from it by rounding


def require_positive(**values: float) -> None:
    """Raise ValueError naming the first argument that is not a positive finite number."""
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} = {value!r}: expected a positive finite number")


@dataclass(frozen=True)
class HalfSpace:
    """Periodic half-space, `G0(q) = 2 / (E* sqrt((sx qx)^2 + (sy qy)^2))`, and G0(0) = 0.

    contact_modulus: E* = E/(1 - nu^2) [Pa].
    prestrain: (sx, sy), factors that scale the wave vector in an elastomer that is stretched differently in x and y;
        (1, 1) is the isotropic solid (paper, "Reproducing viscoelastic properties using GFMD").
    """

    contact_modulus: float
    prestrain: tuple[float, float] = (1.0, 1.0)
    is_free: ClassVar[bool] = False

    def __post_init__(self) -> None:
        require_positive(contact_modulus=self.contact_modulus)
        require_positive(**{f"prestrain[{axis}]": factor for axis, factor in enumerate(self.prestrain)})

    def __call__(self, qx: ArrayLike, qy: ArrayLike) -> NDArray[np.float64]:
        """Compliance [m/Pa], shape of qx and qy broadcast together; qx, qy: wave vector [rad/m], spectral space."""
        stretch_x, stretch_y = self.prestrain
        q = np.hypot(stretch_x * np.asarray(qx, dtype=float), stretch_y * np.asarray(qy, dtype=float))
        return np.divide(2 / self.contact_modulus, q, out=np.zeros_like(q), where=q > 0)


@dataclass(frozen=True, eq=False)
class TabulatedCompliance:
    """Isotropic compliance from a table, `log G0` linear in `log q`: exact for power laws, never negative.

    q: wave numbers [rad/m], strictly increasing, at least two positive ones. A first row q = 0 sets G0(0); without it
        the periodic rule G0(0) = 0 holds.
    G0: compliances [m/Pa], positive (G0 at q = 0 may be zero), same length as q.
    """

    q: NDArray[np.float64]
    G0: NDArray[np.float64]
    is_free: ClassVar[bool] = False

    def __post_init__(self) -> None:
        q, compliance = (np.array(column, dtype=float) for column in (self.q, self.G0))
        if q.ndim != 1 or q.shape != compliance.shape:
            raise ValueError(f"compliance table: shapes {q.shape} and {compliance.shape}, expected two equal columns")
        if not (np.all(np.isfinite(q)) and np.all(np.isfinite(compliance))):
            raise ValueError("compliance table: found a number that is not finite")
        if np.any(np.diff(q) <= 0) or np.any(q < 0):
            raise ValueError("compliance table: expected q >= 0, strictly increasing")
        if np.count_nonzero(q) < 2:
            raise ValueError("compliance table: expected at least two rows with q > 0")
        if np.any(compliance[q > 0] <= 0) or np.any(compliance < 0):
            raise ValueError("compliance table: expected G0 > 0")
        for name, column in (("q", q), ("G0", compliance)):
            column.setflags(write=False)
            object.__setattr__(self, name, column)

    @classmethod
    def from_file(cls, path: str | Path) -> TabulatedCompliance:
        """Read a text file with the columns q [rad/m] and G0 [m/Pa]; # starts a comment. Raises ValueError, OSError."""
        try:
            table = read_numbers(path)
        except ValueError as error:
            raise ValueError(f"{path}: expected two columns of numbers, q [rad/m] and G0 [m/Pa]; {error}") from error
        if table.shape[1] != 2:
            raise ValueError(f"{path}: found {table.shape[1]} columns, expected two, q [rad/m] and G0 [m/Pa]")
        return cls(table[:, 0], table[:, 1])

    def __call__(self, qx: ArrayLike, qy: ArrayLike) -> NDArray[np.float64]:
        """Compliance [m/Pa], shape of qx and qy broadcast together; qx, qy: wave vector [rad/m], spectral space.

        Raises ValueError, naming the range needed, where the table does not reach.
        """
        wave_number = np.hypot(np.asarray(qx, dtype=float), np.asarray(qy, dtype=float))
        q, compliance = self.q[self.q > 0], self.G0[self.q > 0]
        asked = wave_number[wave_number > 0]
        if asked.size and (asked.min() < q[0] * (1 - RANGE_SLACK) or asked.max() > q[-1] * (1 + RANGE_SLACK)):
            raise ValueError(
                f"compliance table: covers q = {q[0]:.6g} to {q[-1]:.6g} rad/m, "
                f"but {asked.min():.6g} to {asked.max():.6g} rad/m are needed; extend the table"
            )
        uniform = self.G0[0] if self.q[0] == 0 else 0.0
        result: NDArray[np.float64] = np.full_like(wave_number, uniform)
        result[wave_number > 0] = np.exp(np.interp(np.log(asked), np.log(q), np.log(compliance)))
        return result
