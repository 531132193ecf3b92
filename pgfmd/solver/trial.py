"""A step that was tried, and the error it is judged by. Plain Python."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from pgfmd.physics.drive import Phase

SAFETY = 0.85
"""The length of the next step is chosen for this fraction of the tolerance."""
LARGEST_GROWTH = 2.0
"""Largest ratio of the lengths of the next step and the last."""
STRONGEST_CUT = 0.2
"""Smallest ratio of the lengths of the next step and the last."""
SMALLEST_SHARE = 0.03
"""Lower bound of the error, as a fraction of the distance to the extrapolated surface. In steps much shorter than those
before, the error of a smooth motion is far smaller; but a jump does not shrink with the step, and must not be taken for
a smooth motion."""
FEW_STEPS_SHARE = 0.25
"""The same if fewer than three ends of steps are known: a conservative value, as the steps after a kink are small."""
SURFACE_SHARE = 0.05
"""Error of the surface in elastic scenes, as a fraction of the distance to the extrapolated surface."""
CURVE_SHARE = 0.25
"""Error of the force in elastic scenes, as a fraction of the distance to the extrapolated force."""


@dataclass(frozen=True)
class Change:
    """What a step has changed. Surface: largest over interacting points, in ranges of adhesion; force: relative to the
    largest so far, at least the preload.

    surface, force: over the step. surface_distance, force_distance: from the polynomial through the last ends of steps,
    whose `times` [s] count back from the start of the step, 0, ...; step [s].
    """

    surface: float
    surface_distance: float
    force: float
    force_distance: float
    times: tuple[float, ...]
    step: float

    @property
    def largest(self) -> float:
        """The larger of the two changes over the step."""
        return max(self.surface, self.force)

    def error(self, error_constant: float, order: int) -> float:
        """Error of the end of a step of this order, of surface or force, whichever is larger.

        The distance is the extrapolating polynomial's error plus the step's own; where that goes through order + 1 ends
        of steps, both go with the same derivative, and error_constant (retardation.Tableau) tells their ratio. An error
        is hardly more than half of the change itself, but extrapolated errors of earlier solves can be.
        """
        share = FEW_STEPS_SHARE
        if len(self.times) == order + 1:
            polynomial = math.prod(self.step - time for time in self.times) / math.factorial(order + 1)
            own = error_constant * self.step ** (order + 1)
            share = max(SMALLEST_SHARE, own / (polynomial + own))
        surface = min(share * self.surface_distance, 0.5 * self.surface)
        return max(surface, min(share * self.force_distance, 0.5 * self.force))

    def elastic_error(self, attractive: bool) -> float:
        """The same for steps that end in equilibrium: how well the path is followed, and how smooth the curve is.

        Without attraction the equilibrium is unique, and the path to it of no concern.
        """
        path = SURFACE_SHARE * self.surface_distance if attractive else 0.0
        return max(path, min(CURVE_SHARE * self.force_distance, 0.5 * self.force))


@dataclass
class Trial:
    """The outcome of a step that was tried: nothing of it is in the State yet.

    error: see Change. energy_error: see EnergyAudit.error, zero where it bounds nothing. potential_drop [J]: by how
    much the stages' potentials fell from their starting points. forces [N]: on the punch, at the stages. The
    fields belong to the scheme and live until the next trial. uncertainty [J]: how far, for not knowing where within
    the step the surface jumped, the energy that a quasi-static jump releases may be off. flung: whether a dead load has
    pulled the punch off. left_over: see newton.Outcome, of the last solve.
    """

    step: float
    position: float
    phase: Phase
    converged: bool
    error: float = math.inf
    energy_error: float = 0.0
    force: float = 0.0
    newton_iterations: int = 0
    cg_iterations: int = 0
    potential_drop: float = 0.0
    is_jump: bool = False
    uncertainty: float = 0.0
    flung: bool = False
    left_over: float = 0.0
    change: Change | None = None
    forces: list[float] = field(default_factory=list)
