"""The effective Tabor number: the corrugated punch regarded as a flat one with less adhesion.

Paper, "Modeling adhesion": the quasi-static pull-off force gives, by Kendall's law for a perfectly flat punch, an
effective work of adhesion, and that a Tabor number:

    F = sqrt(8 pi E* w_eff a^3),   mu = sqrt(a w_eff/E*)/rho   =>   mu = F/(sqrt(8 pi) a E* rho)

It is proportional to the force: a pull-off force that is 40 % smaller gives a number that is 40 % smaller, as the paper
says. Its 0.880 and 1.24 for the hexagonal punch at rho = 0.264 and 0.187 um belong to F = 1.15 mN, which it rounds to
1.2 mN.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pgfmd.reference import flat_punch, tabor


@dataclass(frozen=True)
class EffectiveTabor:
    """w_eff [J/m^2], relative to the nominal work of adhesion (None if unknown), and the Tabor number."""

    work_of_adhesion: float
    share: float | None
    number: float


def effective_tabor(
    pull_off_force: float,
    punch_radius: float,
    contact_modulus: float,
    range_of_adhesion: float,
    work_of_adhesion: float | None = None,
) -> EffectiveTabor:
    """The effective Tabor number of a quasi-static pull-off force.

    Args:
        pull_off_force: [N], either sign. It has to come from a run without viscous effects: the quasi-static scheme, an
            elastic scene, or one that is slow enough.
        punch_radius: a [m]. contact_modulus: E* [Pa], static. range_of_adhesion: rho [m].
        work_of_adhesion: the nominal one, [J/m^2].

    Raises:
        ValueError: if a length or a modulus is not positive.
    """
    for name, value in (("punch_radius", punch_radius), ("contact_modulus", contact_modulus),
                        ("range_of_adhesion", range_of_adhesion)):  # fmt: skip
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"{name} = {value!r}: expected a positive finite number")
    effective = flat_punch.effective_work_of_adhesion(pull_off_force, punch_radius, contact_modulus)
    number = tabor.flat_punch(punch_radius, contact_modulus, effective, range_of_adhesion)
    return EffectiveTabor(effective, effective / work_of_adhesion if work_of_adhesion else None, number)
