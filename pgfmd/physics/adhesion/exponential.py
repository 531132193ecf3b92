"""The universal binding curve, with the range rho at its largest traction, gamma/(e rho):

    Gamma(g) = -gamma (1 + g/rho) exp(-g/rho),    Gamma'(g) = gamma g/rho^2 exp(-g/rho)

Its largest stiffness is gamma/rho^2, at g = 0. It has a smooth cut-off at 12 rho (cut_off.py), where the energy is 8e-5
of gamma.
Source: J. H. Rose, J. Ferrante, J. R. Smith, Phys. Rev. Lett. 47 (1981) 675, doi:10.1103/PhysRevLett.47.675; as a law of
fracture X.-P. Xu, A. Needleman, J. Mech. Phys. Solids 42 (1994) 1397, doi:10.1016/0022-5096(94)90003-5.
"""

from __future__ import annotations

from typing import Any

from .cut_off import CUT_OFF, CutOffLaw, CutOffNumbers, constants_of, ended
from .functions import clipped, exponential_of


def shape(x: Any) -> Any:
    decay = exponential_of(x)
    return x * decay, (1.0 - x) * decay, -(1.0 + x) * decay


class ExponentialNumbers(CutOffNumbers):
    """The constants of this law."""


class Exponential(CutOffLaw):
    """The universal binding curve."""

    name = "exponential"
    meaning = "the universal binding curve g exp(-g/rho)"
    strength_note = "gamma/(e rho)"
    constants = constants_of(shape)
    kind = ExponentialNumbers


def attraction(gap: Any, law: Any) -> Any:
    x = clipped(gap * law.per_range, 0.0, CUT_OFF)
    height, slope, area = shape(x)
    return ended(gap, x, height, slope, area, law)


def energy(gap: Any, law: Any) -> Any:
    return attraction(gap, law)[2:]


def stiffness(gap: Any, law: Any) -> Any:
    return attraction(gap, law)[1]
