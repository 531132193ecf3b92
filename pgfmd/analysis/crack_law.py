"""Speed of the edge of a contact on a viscoelastic elastomer, for a given energy release rate.

Persson and Brener's theory of an opening crack: with g = G/gamma, the crack's speed v, and a process zone that grows
with the energy release rate, a = g a_0,

    1/g = 1 - (2/pi) int_0^(2 pi v/a) sqrt(1 - (w a/(2 pi v))^2) E(0) Im[-1/E(w)] dw/w

For the creep form of a Prony series, 1/E = (J_inf + sum_m J_m/(1 + i w lambda_m))/E(0), the integral is elementary:

    1/g = 1 - sum_m J_m (sqrt(1 + X_m^2) - 1)/X_m,      X_m = 2 pi v lambda_m/a

g goes from 1 at rest to kappa_inf. For a closing crack, g is taken as the inverse of that of an opening one at the same
speed: an estimate with the right limits, 1 and 1/kappa_inf. (A zone that shrinks with the closing crack's own g was
tried: with a
single relaxation time there is then a speed which no edge exceeds, and contacts that snap in at once with the full
solution hardly grow.) The zone at rest belongs to the cohesive stress that the
law can bear, here between an elastomer and a rigid punch, a_0 = E* gamma/(pi sigma_th^2).

The elastomer further away is assumed to be relaxed: 2 pi v lambda small against the contact's radius.

Source: B. N. J. Persson, E. A. Brener, Phys. Rev. E 71 (2005) 036123, doi:10.1103/PhysRevE.71.036123.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from pgfmd.physics.rheology import PronySeries
from pgfmd.results.curve import Array

DECADES = 6
"""Factor by which the table extends beyond the longest and the shortest retardation time."""
POINTS_PER_DECADE = 60


class CrackLaw:
    """Speeds of a contact's edge, and effective works of adhesion.

    Attributes:
        zone: length a_0 [m] of the process zone at rest.
        stiffest: kappa_inf, the largest g.
    """

    def __init__(self, series: PronySeries, contact_modulus: float, work_of_adhesion: float, strength: float):
        """series: the elastomer's, with at least one element; contact_modulus: static E* [Pa]; work_of_adhesion: gamma
        [J/m^2]; strength: sigma_th [Pa].

        Raises:
            ValueError: for an elastic series, where no speed belongs to an energy release rate.
        """
        if not series.elements:
            raise ValueError("an elastic series has no crack law: expected at least one element")
        creep = series.to_creep()
        self.zone = contact_modulus * work_of_adhesion / (math.pi * strength**2)
        self.stiffest = series.kappa_inf
        slowest = 10.0**-DECADES / creep.retardation_times.max()
        fastest = 10.0**DECADES / creep.retardation_times.min()
        points = math.ceil(POINTS_PER_DECADE * math.log10(fastest / slowest))
        rate = np.geomspace(slowest, fastest, points)  # 2 pi v/a [1/s]
        x = np.multiply.outer(rate, creep.retardation_times)
        root = np.sqrt(1 + x**2)
        # (sqrt(1 + X^2) - 1)/X and what is missing from it to 1, both without cancellation.
        taken, left = (x / (1 + root)) @ creep.J, ((1 + root - x) / (1 + root)) @ creep.J
        excess = taken / (creep.J_inf + left)
        self._excess, self._rate = np.log(excess), np.log(rate)
        gain = 1 + excess
        self._speed = np.log(rate * gain * self.zone / (2 * math.pi))

    def opening_energy(self, speed: ArrayLike) -> Array:
        """g = G/gamma of a crack that opens at this speed [m/s] > 0; that of a closing one is the inverse."""
        return 1 + np.exp(self._look_up(np.log(np.asarray(speed, dtype=float)), self._speed, self._excess))

    def edge_speed(self, g: ArrayLike) -> Array:
        """Speed [m/s] of the edge, positive where the contact grows (g < 1), negative where it shrinks.

        Beyond kappa_inf, and below its inverse, the speed of the table's end, which is practically infinite.
        """
        rate = np.maximum(np.asarray(g, dtype=float), 1e-300)
        excess = np.where(rate > 1, rate, 1 / rate) - 1
        with np.errstate(divide="ignore"):
            logarithm = np.log(excess)
        speed = np.exp(self._look_up(logarithm, self._excess, self._speed))
        return np.where(excess == 0, 0.0, np.where(rate > 1, -speed, speed))

    @staticmethod
    def _look_up(value: Array, known: Array, wanted: Array) -> Array:
        """Linear interpolation of logarithms; below the table both go with the first power of each other."""
        found = np.interp(value, known, wanted)
        return np.where(value < known[0], wanted[0] + value - known[0], found)
