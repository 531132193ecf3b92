"""The laws of adhesion that a scene can name. Each is a module (base.py) and a line here."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal

from .base import CohesiveLaw, range_of_adhesion
from .cosine import Cosine
from .dugdale import Dugdale
from .exponential import Exponential
from .lennard_jones import LennardJones
from .repulsive import Repulsive
from .table import Table

LAWS: dict[str, type[CohesiveLaw]] = {
    law.name: law for law in (Cosine, Repulsive, Dugdale, Exponential, LennardJones, Table)
}
"""The laws by their names in a scene, in the order of the page of its keys."""

DEFAULT_LAW = Cosine.name
"""The default law."""

if TYPE_CHECKING:
    LawName = str
else:
    LawName = Literal[tuple(LAWS)]
"""The type of a scene's `adhesion.law`."""


def range_by_rule(adhesion: Any, contact_modulus: float, range_factor: float, q_ref: float) -> float:
    """The range [m] that the law of a scene's [adhesion] has by the paper's rule, for E* [Pa] and a wavenumber [rad/m]."""
    number = LAWS[adhesion.law].stiffness_number(adhesion)
    return range_of_adhesion(adhesion.work_of_adhesion, contact_modulus, range_factor, q_ref, number)


def law_of(adhesion: Any) -> CohesiveLaw:
    """The law of a scene's [adhesion]."""
    return LAWS[adhesion.law].of(adhesion)


def length_of(adhesion: Any) -> float:
    """The typical length [m] of the law of a scene's [adhesion] (CohesiveLaw.length); its range without attraction."""
    return law_of(adhesion).length if 0.0 < adhesion.range < math.inf else adhesion.range


def clearance_of(adhesion: Any) -> float:
    """A gap [m] that is just out of reach of the law of a scene's [adhesion]."""
    return max(law_of(adhesion).reach, length_of(adhesion)) if 0.0 < adhesion.range < math.inf else adhesion.range


def meanings() -> str:
    """The names of the laws with a few words for each."""
    return "; ".join(f"`{name}`: {law.meaning}" for name, law in LAWS.items())
