"""A rigid paraboloid on an elastic half-space with the cohesive law of the model, by rings: no lattice, no cell.

The traction is constant on each ring; displacements are exact sums of Love's uniformly loaded discs. With the gap
g = d + r^2/(2R) - u, the equations u = A Gamma'(g) at the middles of the rings are solved by Newton's method. What is
given is not the height d of the sphere but the radius at which the gap has a chosen value: then each contact radius has
one solution, as in JKR's theory, also where force and height turn round.

Sources: A. E. H. Love, Phil. Trans. R. Soc. A 228 (1929) 377, for the disc; J. A. Greenwood, Proc. R. Soc. A 453
(1997) 1277, for the self-consistent problem, there with Lennard-Jones forces.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ellipe, ellipk

from pgfmd.physics.adhesion.base import CohesiveLaw

from . import jkr

_GROWTH = 1.08
"""By how much rings widen from one to the next, away from the rim of the contact."""
_SHORTER = 0.85
"""Ratio of successive ranges on the way from a long one, which Newton's method solves at once, to the wanted one."""


class Equilibrium(NamedTuple):
    """Force [N], positive in compression; indentation [m]; radii [m] of the rings' middles, and their gaps [m]."""

    force: float
    indentation: float
    distance: NDArray
    gap: NDArray

    def radius_within(self, gap: float) -> float:
        """Radius [m] at which the gap, which grows outward, reaches a value [m]; 0 if none is that small."""
        if self.gap[0] >= gap:
            return 0.0
        beyond = int(np.argmax(self.gap >= gap))
        (r0, r1), (g0, g1) = self.distance[beyond - 1 : beyond + 1], self.gap[beyond - 1 : beyond + 1]
        return float(r0 + (gap - g0) / (g1 - g0) * (r1 - r0))


def equilibrium(
    contact_radius: float,
    gap: float,
    radius: float,
    contact_modulus: float,
    law: CohesiveLaw,
    rings_per_zone: int = 32,
) -> Equilibrium:
    """The equilibrium with a gap [m] at a radius [m], for R [m], E* [Pa] and an attractive law.

    The rim has `rings_per_zone` rings in the length rho^2 E*/w of a cohesive zone. Newton's method comes from a law of
    long range. Raises ArithmeticError where it finds none.
    """
    long = math.sqrt(contact_radius * law.work_of_adhesion / contact_modulus)
    steps = max(0, math.ceil(math.log(law.range / long) / math.log(_SHORTER)))
    found: Equilibrium | None = None
    last = law.range
    for reach in np.geomspace(long if steps else law.range, law.range, steps + 1):
        zone = reach**2 * contact_modulus / law.work_of_adhesion
        edges = rings(contact_radius, zone, rings_per_zone)
        sphere = CohesiveSphere(radius, contact_modulus, replace(law, range=float(reach)), edges)
        start = None if found is None else found._replace(gap=_shortened(found.gap, last, reach))
        found, last = sphere.at_ring(sphere.ring_at(contact_radius), gap * reach / law.range, start), reach
    assert found is not None, "there is at least one range"
    return found


def rings(contact_radius: float, zone: float, rings_per_zone: int = 32) -> NDArray:
    """Edges [m] of rings that are fine around a contact radius [m], on either side of it for three cohesive zones [m].

    One ring has the contact radius in its middle.
    """
    finest, widest = min(zone / rings_per_zone, contact_radius / 100), contact_radius / 40
    inner, outer = contact_radius - 0.5 * finest, max(2 * zone, 0.5 * contact_radius)

    def side(length: float) -> NDArray:
        """Distances from the middle ring's edge, up to a length [m], which the last one is stretched to."""
        widths = [finest] * math.ceil(min(3 * zone, 0.5 * contact_radius) / finest)
        while sum(widths) < length:
            widths.append(min(widths[-1] * _GROWTH, widest))
        places = np.cumsum(widths)
        places = places[: int(np.searchsorted(places, length)) + 1]
        places[-1] = length
        return places if len(places) < 2 or places[-1] - places[-2] > 0.5 * finest else np.delete(places, -2)

    edges = np.concatenate((inner - side(inner)[::-1], [inner, inner + finest], inner + finest + side(outer)))
    edges[0] = 0.0
    return edges


def disc_displacement(distance: ArrayLike, disc_radius: ArrayLike, contact_modulus: float) -> NDArray:
    """Displacement per pressure [m/Pa] at distances [m] from the axis of a disc [m] under uniform pressure."""
    r, b = np.broadcast_arrays(np.asarray(distance, float), np.asarray(disc_radius, float))
    larger = np.maximum(r, b)
    square = np.divide(np.minimum(r, b), larger, out=np.zeros(r.shape), where=larger > 0) ** 2
    # At the rim K is infinite, but its factor vanishes faster.
    outside = ellipe(square) - (1 - square) * ellipk(np.minimum(square, 1 - 1e-15))
    return 4 * larger / (np.pi * contact_modulus) * np.where(r <= b, ellipe(square), outside)


def _shortened(gap: NDArray, old: float, new: float) -> NDArray:
    """Gaps for a new range: in the old range they are scaled with it, outside they are moved."""
    return np.where(gap < old, gap * new / old, gap - old + new)


class CohesiveSphere:
    """Sphere of radius R [m] on a half-space of E* [Pa] under a law; `edges` [m] of the rings, the first one 0.

    compliance: displacement of each ring's middle by the traction of each [m/Pa]; area of the rings [m^2].
    """

    def __init__(self, radius: float, contact_modulus: float, law: CohesiveLaw, edges: ArrayLike):
        self.radius, self.contact_modulus, self.law, edges = radius, contact_modulus, law, np.asarray(edges, float)
        if edges[0] != 0.0 or np.any(np.diff(edges) <= 0.0):
            raise ValueError("edges of rings must begin with 0 and ascend")
        self.distance = 0.5 * (edges[1:] + edges[:-1])
        self.area = np.pi * np.diff(edges**2)
        discs = disc_displacement(self.distance[:, None], edges[None, 1:], contact_modulus)
        self.compliance = np.diff(discs, axis=1, prepend=0.0)

    def ring_at(self, distance: float) -> int:
        """The ring whose middle is nearest to a radius [m]."""
        return int(np.argmin(np.abs(self.distance - distance)))

    def at_ring(self, ring: int, gap: float, start: Equilibrium | None = None) -> Equilibrium:
        """The equilibrium whose gap [m] at a ring is the given one; Newton's method begins with another's gaps.

        Without a start it begins with JKR's gaps, near enough where the range is long. Raises ArithmeticError where
        none is found, or where the law reaches beyond the last ring.
        """
        shape, reach = self.distance**2 / (2 * self.radius), self.law.reach
        g = self._jkr(ring, gap) if start is None else np.interp(self.distance, start.distance, start.gap)
        for _ in range(100):
            # The height of the punch is the same at all rings; where the gap is given it is the unknown.
            height = g - shape + self.compliance @ self.law.traction(g)
            residual = height - height[ring]
            residual[ring] = g[ring] - gap
            jacobian = self.compliance * self.law.curvature(g)
            jacobian[np.diag_indices_from(jacobian)] += 1.0
            jacobian -= jacobian[ring].copy()
            jacobian[ring] = 0.0
            jacobian[ring, ring] = 1.0
            step = np.linalg.solve(jacobian, residual)
            largest = np.abs(step[g < 2 * reach]).max(initial=0.0)
            g = g - step * (1.0 if largest <= 0.3 * reach else 0.3 * reach / largest)
            if largest < 1e-10 * reach and g[-1] >= reach:
                return Equilibrium(-float(self.law.traction(g) @ self.area), -float(height[ring]), self.distance, g)
        raise ArithmeticError(f"no equilibrium with the gap {gap:g} m at {self.distance[ring]:g} m")

    def _jkr(self, ring: int, gap: float) -> NDArray:
        """JKR's gaps outside of the ring; inside, the gaps that carry JKR's pressure as far as the law can."""
        r, a, work = self.distance, float(self.distance[ring]), self.law.work_of_adhesion
        ratio = np.maximum(r / a, 1.0)
        angle = np.arccos(1 / ratio)
        hertzian = a**2 / (np.pi * self.radius) * (np.sqrt(ratio**2 - 1) + (ratio**2 - 2) * angle)
        outside = hertzian + 2 / np.pi * np.sqrt(2 * np.pi * work * a / self.contact_modulus) * angle
        pressure = jkr.pressure(np.minimum(r, 0.999 * a), a, self.radius, self.contact_modulus, work)
        return np.where(r < a, np.minimum(-pressure / self.law.overlap_stiffness, gap), gap + outside)
