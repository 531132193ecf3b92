"""The auxiliary inertia of the scheme `gfmd`: its frequency, time step, and limit of stability. Plain NumPy.

Source: the paper, "Reproducing viscoelastic properties using GFMD". Every mode u(q) carries a mass m = k_inf / omega^2
and the damping eta_0 = 2 m omega, critical for its stiffness k_inf = kappa_inf / G0(q). The step resolves omega,
and omega resolves the shortest relaxation time; for a fast punch, both follow its motion.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from pgfmd.physics.adhesion.base import CohesiveLaw
    from pgfmd.physics.drive import Drive
    from pgfmd.physics.rheology import PronySeries
    from pgfmd.scene.solver_section import GfmdKeys
    from pgfmd.solver.multiplier import Compliance

STABLE = 2.0
"""Leapfrog steps of a mode with eigenfrequency W are stable while W dt is below this, whatever the damping."""


@dataclass(frozen=True)
class Inertia:
    """frequency omega [rad/s] and step dt [s]; `limited_by`: what set them, "relaxation", "motion" or "scene"."""

    frequency: float
    step: float
    limited_by: str = "scene"

    def stiffest(self, contact_stiffness: float, kappa_inf: float) -> float:
        """omega dt sqrt(1 + s/kappa_inf), to stay below `STABLE`; s = `contact_stiffness` (dimensionless).

        A surface whose every point is pressed against the punch has the stiffness A = k_inf + K_0 at most, in terms of
        modes k_inf (1 + K_0 G0/kappa_inf); its largest eigenvalue is below that of the largest G0. Its mass is
        k_inf/omega^2. Leapfrog with central damping gives z^2 (1 + omega dt) - z (2 - W^2 dt^2) + (1 - omega dt) = 0,
        whose roots are inside the unit circle exactly while W dt < 2.
        """
        return self.frequency * self.step * math.sqrt(1.0 + contact_stiffness / kappa_inf)

    def added_viscosity(self, series: PronySeries) -> float:
        """The additional viscosity at low frequencies, 2 kappa_inf/omega, relative to that of the material, sum kappa_n
        tau_n."""
        return 2.0 * series.kappa_inf / self.frequency / float((series.kappa * series.tau).sum())


def inertia_of(keys: GfmdKeys, series: PronySeries, law: CohesiveLaw, drive: Drive) -> Inertia:
    """The inertia for a scene's [solver.gfmd].

    keys: the section (omega_tau, steps_per_tau, fast_pull; omega and dt, given both, overrule them). series:
    PronySeries; law: CohesiveLaw; drive: Drive. Raises ValueError for an elastic substrate without omega and dt.
    """
    if keys.omega is not None and keys.dt is not None:
        return Inertia(keys.omega, keys.dt)
    if not series.elements:
        raise ValueError("an elastic substrate has no relaxation time to derive omega and dt from")
    shortest = float(series.tau.min())
    by_time = shortest / keys.steps_per_tau
    by_motion = keys.fast_pull * law.length / max(drive.speed, drive.retract_speed)
    # omega dt is the same by either rule, pi/10 with the paper's numbers.
    step, limited_by = (by_time, "relaxation") if by_time <= by_motion else (by_motion, "motion")
    return Inertia(keys.omega_tau / keys.steps_per_tau / step, step, limited_by)


def contact_stiffness(compliance: Compliance, law: CohesiveLaw, n: int, length: float) -> float:
    """K_0 max G0(q): stiffness of contact, relative to that of the softest wave of the cell (dimensionless). K_0: the
    largest stiffness of the law, overlaps included.

    compliance: G0(qx, qy) of a periodic cell of side `length` [m] with n points a side. Along the axes, as |q| decides,
    and a prestrain has its extremes there.
    """
    q = 2.0 * np.pi / length * np.arange(n // 2 + 1)
    zero = np.zeros_like(q)
    return max(law.stiffness, law.overlap_stiffness) * float(max(compliance(q, zero).max(), compliance(zero, q).max()))


def instability(inertia: Inertia, stiffness: float, kappa_inf: float) -> str:
    """What to change if the step is too long for stability; empty if it is not."""
    number = inertia.stiffest(stiffness, kappa_inf)
    if number < STABLE:
        return ""
    largest = 0.99 * inertia.step * STABLE / number
    return (
        f"omega dt sqrt(1 + K_0 G0/kappa_inf) is {number:.3g}: the step {inertia.step:.3g} s would make contacts "
        f'explode. Set solver.gfmd.omega = "{inertia.frequency:.6g} rad/s" and solver.gfmd.dt = "{largest:.3g} s", '
        "or raise steps_per_tau, lower omega, or raise adhesion.range"
    )
