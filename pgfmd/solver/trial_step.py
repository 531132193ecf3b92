"""A trial step and its error estimate. Plain Python."""

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
    """The change in a step. Surface: largest over interacting points, in ranges of adhesion; force: relative to the
    largest so far or the preload, whichever is larger.

    surface, force: changes over the step. surface_distance, force_distance: distances from the polynomial through the
    last ends of steps, whose `times` [s] are relative to the start of the step (0, then negative). step [s].
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
        """Error of the end of a step of this order: that of the surface or of the force, whichever is larger.

        The distance is the error of the extrapolating polynomial plus that of the step. If the polynomial goes through
        order + 1 ends of steps, both are proportional to the same derivative, and error_constant (retardation.Tableau)
        is their ratio. An error is hardly more than half of the change itself, whereas extrapolated errors of earlier
        solves may be.
        """
        share = FEW_STEPS_SHARE
        if len(self.times) == order + 1:
            polynomial = math.prod(self.step - time for time in self.times) / math.factorial(order + 1)
            own = error_constant * self.step ** (order + 1)
            share = max(SMALLEST_SHARE, own / (polynomial + own))
        surface = min(share * self.surface_distance, 0.5 * self.surface)
        return max(surface, min(share * self.force_distance, 0.5 * self.force))

    def elastic_error(self, attractive: bool) -> float:
        """The same for steps that end in equilibrium: a measure of how closely the path is followed, and how smooth the
        curve is.

        Without attraction the equilibrium is unique, and the path to it does not matter.
        """
        path = SURFACE_SHARE * self.surface_distance if attractive else 0.0
        return max(path, min(CURVE_SHARE * self.force_distance, 0.5 * self.force))


@dataclass
class Trial:
    """The result of a trial step, which has not changed the State yet.

    error: see Change. energy_error: see EnergyAudit.error, zero if it limits nothing.
    potential_drop [J]: decrease of the potentials of the stages from their starting points.
    forces [N], positions [m]: of the punch, at the stages. Fields belong to the scheme and are valid until the next trial.
    uncertainty [J]: of the energy released in a quasi-static jump, because its place within the step is unknown.
    runaway: whether a controlled force has detached the punch; parted [m]: where it had done the work of that.
    left_over: see newton.Outcome, of the last solve.
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
    runaway: bool = False
    parted: float = -math.inf
    left_over: float = 0.0
    change: Change | None = None
    forces: list[float] = field(default_factory=list)
    positions: list[float] = field(default_factory=list)
