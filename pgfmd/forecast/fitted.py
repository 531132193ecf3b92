"""The numbers of the forecast of steps and transform pairs (effort.py), as found by scripts/forecast_cost.py. No MPI."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Numbers:
    """Of one kind of scenes, as in effort.py; pairs (in, out) are those of the two ways.

    least: steps that any way takes. rate: of steps for each range of adhesion of the way, to the power `travel`. slow:
    power p of the slowness. refinement: power q of the accuracy. pairs_least, pairs_rate: pairs a step. stiff: power m of
    the law's stiffness. spread: factor within which 19 of 20 scenes are, those included that were not fitted to.
    """

    least: tuple[float, float]
    rate: tuple[float, float]
    travel: float
    slow: float
    refinement: float
    pairs_least: float
    pairs_rate: tuple[float, float]
    stiff: float
    spread: float


# fitted
FITTED = {
    "viscoelastic": Numbers((14.0, 16.0), (20.0, 13.0), 1.0, 0.526, 0.44, 2.0, (1.4, 2.0), 1.0, 1.5),
    "flat, viscoelastic": Numbers((14.0, 16.0), (10.0, 4.0), 1.0, 0.25, 0.44, 2.0, (1.4, 2.0), 0.5, 1.5),
    "repulsive": Numbers((14.0, 17.0), (28.0, 20.0), 0.01, 1.0, 0.33, 2.0, (1.4, 1.4), 1.0, 1.5),
    "elastic": Numbers((14.0, 16.0), (60.0, 30.0), 1.0, 0.01, 1.0, 2.0, (5.0, 5.0), 1.0, 2.0),
    "flat, elastic": Numbers((8.0, 10.0), (1.0, 2.0), 1.0, 0.01, 0.1, 2.0, (1.0, 4.0), 1.0, 2.0),
    "quasi-static": Numbers((14.0, 16.0), (60.0, 40.0), 1.0, 0.01, 0.8, 2.0, (5.0, 5.0), 1.0, 2.0),
    "flat, quasi-static": Numbers((14.0, 10.0), (1.0, 8.0), 1.0, 0.01, 0.1, 2.0, (1.0, 1.0), 0.5, 2.0),
    "smooth": Numbers((20.0, 16.0), (1.0, 1.0), 1.0, 0.01, 0.5, 2.0, (3.0, 3.0), 1.0, 1.5),
}
"""By the kind of a scene (effort.kind_of)."""
# end of what is fitted
