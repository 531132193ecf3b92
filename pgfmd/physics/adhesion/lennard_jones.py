"""The 3-9 law of two half-spaces of Lennard-Jones atoms. The range rho is their distance at zero traction:

    Gamma'(g) = (8 gamma / (3 rho)) (s^3 - s^9),    Gamma(g) = -(gamma/3) (4 s^2 - s^8),    s = rho/(rho + g)

Its largest traction is 16 gamma/(9 sqrt(3) rho), at g = (3^(1/6) - 1) rho = 0.2009 rho; its largest stiffness 16 gamma/rho^2,
at g = 0. For g < 0 the overlap is harmonic, as for all laws. It has a smooth cut-off at 12 rho (cut_off.py), where the
energy is 0.8 % of gamma. The rest is scaled so that the work of adhesion is gamma.
Source: J. A. Greenwood, Proc. R. Soc. A 453 (1997) 1277, doi:10.1098/rspa.1997.0070; V. M. Muller, V. S. Yushchenko,
B. V. Derjaguin, J. Colloid Interface Sci. 77 (1980) 91, doi:10.1016/0021-9797(80)90419-1.
"""

from __future__ import annotations

from typing import Any

from .cut_off import CUT_OFF, CutOffLaw, CutOffNumbers, constants_of, ended
from .functions import clipped


def shape(x: Any) -> Any:
    near = 1.0 / (1.0 + x)
    square = near * near
    sixth = square * square * square
    height = near * square * (1.0 - sixth)
    return height, square * square * (9.0 * sixth - 3.0), square * (0.125 * sixth - 0.5)


class LennardJonesNumbers(CutOffNumbers):
    """The constants of this law."""


class LennardJones(CutOffLaw):
    """Half-spaces of Lennard-Jones atoms."""

    name = "lennard-jones"
    meaning = "half-spaces of Lennard-Jones atoms, 3-9"
    strength_note = "16 gamma/(9 sqrt(3) rho)"
    constants = constants_of(shape)
    kind = LennardJonesNumbers


def attraction(gap: Any, law: Any) -> Any:
    x = clipped(gap * law.per_range, 0.0, CUT_OFF)
    height, slope, area = shape(x)
    return ended(gap, x, height, slope, area, law)


def energy(gap: Any, law: Any) -> Any:
    return attraction(gap, law)[2:]


def stiffness(gap: Any, law: Any) -> Any:
    return attraction(gap, law)[1]
