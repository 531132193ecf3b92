"""Base of all laws of adhesion between punch and elastomer.

A law is a potential per area Gamma of the gap g. The traction on the elastomer is f = Gamma'(g), positive when it pulls the
surface up; the stiffness is K = Gamma''(g). Every law is a harmonic overlap and an attraction:

    Gamma(g) = K_o min(g, 0)^2 / 2 + A(g),    A(g) = A(0) = -gamma for g < 0,    A(g) = 0 for g >= reach

with the work of adhesion gamma. A' is continuous, and A'(0) = 0: a surface without load has no gap.

A law is a module with a subclass of `CohesiveLaw`, its constants as numbers (a NamedTuple, see `Numbers`), and three
functions of a gap and these numbers, written with the functions of functions.py. They take arrays in NumPy, and are
compiled into the kernels' loops (solver/inlined_laws.py) for single points:

    attraction(gap, law)   A'(g) [Pa], Gamma''(g) [Pa/m], and A(g) as two factors, the first [J/m^2] the same for all gaps
    energy(gap, law)       the two factors of A(g) alone
    stiffness(gap, law)    Gamma''(g) alone

They are called for gaps below the reach, also negative ones. A stiffness of exactly 0 means that a point is out of
reach, so a law with a constant traction adds `PRESENT`. registry.py lists the laws.

A point is in contact if its gap is below `CohesiveLaw.contact_gap`, the gap of the largest traction. There adhesion
holds the surface: the traction increases with the gap (K > 0). Contact is defined only here.
"""

from __future__ import annotations

import math
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

PRESENT = 1e-30
"""Fraction of the largest stiffness that marks a point as within reach, and has no other effect."""


class Numbers(Protocol):
    """Numbers of every law that kernels use: K_o [Pa/m]; the gap [m] above which there is no traction; the largest
    stiffness of the attraction [Pa/m]."""

    @property
    def overlap(self) -> float: ...
    @property
    def reach(self) -> float: ...
    @property
    def stiffness(self) -> float: ...


def attraction(gap: Any, law: Any) -> Any:
    """A'(g) [Pa], Gamma''(g) [Pa/m] and the factors of A(g) [J/m^2] at gaps below the reach; law: its Numbers."""
    return function_of(type(law), "attraction")(gap, law)


def energy(gap: Any, law: Any) -> Any:
    """The factors of A(g) [J/m^2] at gaps below the reach; law: its Numbers."""
    return function_of(type(law), "energy")(gap, law)


def stiffness(gap: Any, law: Any) -> Any:
    """Gamma''(g) [Pa/m] at gaps below the reach; law: its Numbers."""
    return function_of(type(law), "stiffness")(gap, law)


def function_of(numbers: type, name: str) -> Callable[[Any, Any], Any]:
    """The function of this name of the law to which these numbers belong; it is in the same module."""
    found: Callable[[Any, Any], Any] = getattr(sys.modules[numbers.__module__], name)
    return found


def range_of_adhesion(
    work_of_adhesion: float,
    contact_modulus: float,
    range_factor: float,
    q_ref: float,
    stiffness_number: float = math.pi**2 / 2.0,
) -> float:
    """The range rho [m] at which the law's largest stiffness is `range_factor * q_ref * contact_modulus`.

    work_of_adhesion [J/m^2], contact_modulus [Pa], q_ref [rad/m], stiffness_number: the law's,
    that of the cosine by default. Source: the rule of the
    paper's "Modeling adhesion", gamma pi^2 / (2 rho^2) = c q_ref E*, solved for rho. With c = 0.156 and
    q_ref = 2 pi n / L it gives the paper's 0.264 um (n = 2048) and 0.187 um (n = 4096); the factor 0.2 of its text does
    not.
    """
    modulus = range_factor * q_ref * contact_modulus
    return math.sqrt(2.0 * stiffness_number) * math.sqrt(work_of_adhesion / (2.0 * modulus))


@dataclass(frozen=True)
class CohesiveLaw(ABC):
    """A law with its work of adhesion gamma [J/m^2] and its range rho [m], the unit of length of its shape."""

    work_of_adhesion: float
    range: float
    own_overlap_stiffness: float | None = None
    """K_o [Pa/m] if it is not the largest stiffness of the attraction."""

    name: ClassVar[str]
    """Its name in a scene."""
    meaning: ClassVar[str]
    """A few words for the page of the keys."""
    strength_note: ClassVar[str] = ""
    """How the strength follows from gamma and rho."""
    attractive: ClassVar[bool] = True
    """Whether anything attracts."""
    required: ClassVar[frozenset[str]] = frozenset({"work_of_adhesion"})
    """The required keys of [adhesion] for this law."""
    optional: ClassVar[frozenset[str]] = frozenset({"range", "range_factor", "q_ref"})
    """The optional keys of [adhesion] for this law."""

    def __post_init__(self) -> None:
        if not (self.work_of_adhesion > 0 and self.range > 0):
            raise ValueError("work_of_adhesion and range must be positive")
        if not (self.own_overlap_stiffness is None or self.own_overlap_stiffness > 0):
            raise ValueError("a stiffness of overlaps must be positive")

    known: ClassVar[tuple[str, ...]] = ()
    """The keys whose values follow from `own_values` if a scene does not give them."""

    @classmethod
    def of(cls, adhesion: Any) -> Self:
        """The law of a scene's [adhesion], its range resolved."""
        return cls(adhesion.work_of_adhesion, adhesion.range, adhesion.overlap_stiffness)

    @classmethod
    def own_values(cls, adhesion: Any) -> dict[str, float]:
        """The values of the `known` keys, in SI. Raises OSError, and ValueError if a file of the law is invalid."""
        return {}

    @classmethod
    @abstractmethod
    def stiffness_number(cls, adhesion: Any) -> float:
        """The largest stiffness in units of gamma/rho^2, for the keys of a scene's [adhesion]."""

    @property
    @abstractmethod
    def numbers(self) -> Numbers:
        """The constants for the functions of the law."""

    @property
    @abstractmethod
    def strength(self) -> float:
        """The largest traction [Pa]; 0 without attraction."""

    @property
    @abstractmethod
    def contact_gap(self) -> float:
        """The gap [m] of the largest traction, below which a point is in contact; 0 without attraction.

        Below it the law is on its stable side, Gamma'' > 0, and holds the surface; beyond it the traction falls as the
        gap grows. A surface that is held under tension has a gap between 0 and this one.
        """

    @property
    def stiffness(self) -> float:
        """K_0 [Pa/m], the largest stiffness without that of overlaps. It determines the range."""
        return self.numbers.stiffness

    @property
    def overlap_stiffness(self) -> float:
        """K_o [Pa/m], the stiffness for every g < 0."""
        return self.numbers.overlap

    @property
    def length(self) -> float:
        """The range [m] of the paper's law of the same work of adhesion and largest stiffness, pi sqrt(gamma/(2 K_0)):
        the typical length of changes of the traction. It is the unit of errors and steps."""
        return math.pi * math.sqrt(self.work_of_adhesion / (2.0 * self.stiffness))

    @property
    def reach(self) -> float:
        """The gap [m] above which there is no traction."""
        return self.numbers.reach

    def facts(self) -> Iterator[tuple[str, float, str, str]]:
        """Further lines about the law for `pgfmd check`: name, value, SI unit and meaning."""
        yield from ()

    def potential(self, gap: ArrayLike) -> Array:
        """Gamma(g) [J/m^2]; 0 out of reach, -gamma at g = 0 where there is an attraction."""
        law, gap = self.numbers, np.asarray(gap, dtype=float)
        depth, level = energy(gap, law)
        found: Array = 0.5 * law.overlap * np.minimum(gap, 0.0) ** 2 + np.where(gap < law.reach, depth * level, 0.0)
        return found

    def traction(self, gap: ArrayLike) -> Array:
        """f = Gamma'(g) [Pa]."""
        law, gap = self.numbers, np.asarray(gap, dtype=float)
        found: Array = law.overlap * np.minimum(gap, 0.0) + np.where(gap < law.reach, attraction(gap, law)[0], 0.0)
        return found

    def curvature(self, gap: ArrayLike) -> Array:
        """K = Gamma''(g) [Pa/m]."""
        law, gap = self.numbers, np.asarray(gap, dtype=float)
        found: Array = np.where(gap < law.reach, stiffness(gap, law), 0.0)
        return found
