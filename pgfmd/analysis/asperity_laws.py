"""Laws of a single asperity: its force during the approach, and during the retraction from a given depth.

Depths count from the first touch of the undeformed surface, positive when pushed in. Each law has

    approach(depth)           force [N] for increasing depths, (rows,); 0 before the touch
    retraction(depth, turn)   force [N] for decreasing depths, from the depth `turn` [m] on

and knows the radius R [m] of its summit. Asperities are paraboloids on a half-space of their own.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from pgfmd.reference import jkr
from pgfmd.results.curve import Array, Loop

from .crack_law import CrackLaw

LEAST_RADIUS = 1e-3
"""A contact counts as open if its radius is below this fraction of the JKR radius at zero load."""
TOLERANCE = 1e-7


@dataclass(frozen=True)
class JkrAsperity:
    """Elastic, adhesion of zero range. It snaps in at the first touch, and out where JKR's branch ends under controlled
    displacement.

    radius: R [m]; contact_modulus: E* [Pa]; work_of_adhesion: [J/m^2].
    """

    radius: float
    contact_modulus: float
    work_of_adhesion: float

    def approach(self, depth: Array) -> Array:
        depth = np.asarray(depth, dtype=float)
        return np.where(depth >= 0, self._in_contact(np.maximum(depth, 0.0)), 0.0)

    def retraction(self, depth: Array, turn: float) -> Array:
        depth = np.asarray(depth, dtype=float)
        return np.nan_to_num(self._in_contact(depth)) if turn >= 0 else np.zeros(depth.shape)

    def _in_contact(self, depth: Array) -> Array:
        material = self.radius, self.contact_modulus, self.work_of_adhesion
        return jkr.force(jkr.contact_radius_at_indentation(depth, *material), *material)


def force_of(contact_radius: Array, depth: Array, radius: float, contact_modulus: float) -> Array:
    """Force [N] of a paraboloid with any contact radius a [m], in equilibrium or not: 2 E* a (delta - a^2/(3R))."""
    return 2 * contact_modulus * contact_radius * (depth - contact_radius**2 / (3 * radius))


def release_rate(contact_radius: Array, depth: Array, radius: float, contact_modulus: float) -> Array:
    """Energy release rate [J/m^2] at its edge: E* (a^2/R - delta)^2/(2 pi a), the work of adhesion in
    equilibrium."""
    return contact_modulus * (contact_radius**2 / radius - depth) ** 2 / (2 * math.pi * contact_radius)


@dataclass
class ViscoelasticAsperity:
    """A relaxed elastomer whose edge moves by a crack law: da/dt = speed(G(a, delta)/gamma).

    approach_speed, retraction_speed [m/s]: of the punch. The other arguments as in JkrAsperity.
    """

    radius: float
    contact_modulus: float
    work_of_adhesion: float
    crack: CrackLaw
    approach_speed: float
    retraction_speed: float
    _grown: dict = field(default_factory=dict, repr=False)
    _shrunk: dict = field(default_factory=dict, repr=False)

    @property
    def _scale(self) -> float:
        """The JKR contact radius at zero force [m]."""
        material = self.radius, self.contact_modulus, self.work_of_adhesion
        return float(jkr.contact_radius_at_force(0.0, *material))

    def approach(self, depth: Array) -> Array:
        depth = np.asarray(depth, dtype=float)
        deepest = float(depth.max(initial=0.0))
        if deepest <= 0.0:
            return np.zeros(depth.shape)
        grown = self._approach_to(deepest)
        inside = np.clip(depth, 0.0, deepest)
        force = force_of(grown(inside), inside, self.radius, self.contact_modulus)
        return np.where(depth > 0, force, 0.0)

    def retraction(self, depth: Array, turn: float) -> Array:
        depth = np.asarray(depth, dtype=float)
        if turn <= 0.0:
            return np.zeros(depth.shape)
        if turn not in self._shrunk:
            start = float(self._approach_to(turn)(np.array([turn]))[0])
            # An edge can't hold more than kappa_inf times the work of adhesion: a JKR contact with this value ends
            # there.
            strongest = self.work_of_adhesion * self.crack.stiffest
            last = jkr.displacement_controlled_pull_off(self.radius, self.contact_modulus, strongest).indentation
            longest = 2.0 * (turn - last)
            self._shrunk[turn] = self._solve(
                lambda travel: turn - travel, self.retraction_speed, start, longest, _opened
            )
        found = self._shrunk[turn]
        travel = turn - depth
        radius = found.sol(np.clip(travel, 0.0, found.t[-1]))[0] * self._scale
        force = force_of(radius, depth, self.radius, self.contact_modulus)
        return np.where(travel <= found.t[-1], force, 0.0)

    def _approach_to(self, depth: float):
        """Contact radius [m] at depths up to this one [m], as a function; known depths are not computed again."""
        known = max((reach for reach in self._grown if reach >= depth), default=None)
        if known is None:
            # An edge far from equilibrium moves very fast: the contact begins with the size of a glassy JKR contact.
            energy = self.work_of_adhesion / self.crack.stiffest
            first = float(jkr.contact_radius_at_indentation(0.0, self.radius, self.contact_modulus, energy))
            solution = self._solve(lambda travel: travel, self.approach_speed, first, depth, None).sol
            self._grown[known := depth] = lambda at: solution(at)[0] * self._scale
        return self._grown[known]

    def _solve(
        self, depth_of: Callable[[float], Any], speed: float, start: float, travel: float,
        event: Callable[[float, Array], float] | None,
    ) -> Any:  # fmt: skip
        """The contact radius over a travel [m] of the punch, from an initial radius [m]. Radii are in units of
        `_scale`."""

        def rate(travelled: float, a: Array) -> Array:
            radius = np.maximum(a, LEAST_RADIUS / 10) * self._scale
            energy = release_rate(radius, depth_of(travelled), self.radius, self.contact_modulus)
            return self.crack.edge_speed(energy / self.work_of_adhesion) / (speed * self._scale)

        settings: dict[str, Any] = {
            "method": "LSODA",
            "rtol": TOLERANCE,
            "atol": TOLERANCE,
            "dense_output": True,
            "events": event,
        }
        return solve_ivp(rate, (0.0, travel), np.array([start / self._scale]), **settings)


def _opened(travel: float, a: Array) -> float:
    return float(a[0]) - LEAST_RADIUS


setattr(_opened, "terminal", True)  # noqa: B010 - what scipy looks for, which no function has


@dataclass(frozen=True)
class MeasuredAsperity:
    """The curve of one isolated asperity, from a run of its own: rigid sphere of this radius R [m] on the same
    elastomer.

    The forces are those of the run's approach and retraction. For an asperity that turns at a smaller depth than the
    run, the retraction is not known, and the lower of both branches is taken. Beyond the depth of the run, the approach
    is extrapolated linearly.
    """

    radius: float
    loop: Loop

    def approach(self, depth: Array) -> Array:
        rows = slice(0, self.loop.preload_row + 1)
        place, force = self.loop.indentation[rows], self.loop.force[rows]
        return _followed(np.asarray(depth, dtype=float), place, force)

    def retraction(self, depth: Array, turn: float) -> Array:
        depth = np.asarray(depth, dtype=float)
        deepest = len(self.loop.force) - 1 - int(np.argmax(self.loop.indentation[::-1]))
        place, force = self.loop.indentation[deepest:][::-1], self.loop.force[deepest:][::-1]
        back = _followed(depth, place, force)
        if turn >= place[-1] * (1 - 1e-9):
            return back
        return np.where(depth <= turn, np.minimum(back, self.approach(depth)), self.approach(depth))

    @property
    def deepest(self) -> float:
        """The largest depth of the run [m]."""
        return float(np.max(self.loop.indentation))


def _followed(depth: Array, place: Array, force: Array) -> Array:
    """A branch interpolated at depths: zero at smaller depths, extrapolated linearly to larger ones."""
    place = np.maximum.accumulate(place)
    found = np.interp(depth, place, force, left=0.0)
    row = max(int(np.searchsorted(place, place[-1] - 0.02 * (place[-1] - place[0]))) - 1, 0)
    slope = (force[-1] - force[row]) / (place[-1] - place[row]) if place[-1] > place[row] else 0.0
    return found + np.maximum(depth - place[-1], 0.0) * slope
