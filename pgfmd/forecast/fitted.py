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
    "viscoelastic": Numbers((14.3, 14.5), (21.1, 15.3), 0.996, 0.541, 0.453, 0.679, (2.51, 2.64), 0.84, 1.34),
    "flat, viscoelastic": Numbers((16.4, 9.64), (13.2, 7.06), 1.06, 0.204, 0.31, 2.54, (1.67, 3.04), 0.563, 1.65),
    "viscoelastic, two grids": Numbers((14.3, 14.5), (21.1, 15.3), 0.996, 0.541, 0.453, 2.0, (0.5, 0.5), 0.5, 1.5),
    "flat, viscoelastic, two grids": Numbers((16.4, 9.64), (13.2, 7.06), 1.06, 0.204, 0.31, 2.0, (0.5, 0.5), 0.5, 1.8),
    "repulsive": Numbers((13.1, 12.9), (6.15, 7.97), 0.0, 1.23, 0.211, 1.59, (1.66, 0.887), 1.11, 1.49),
    "elastic": Numbers((15.0, 18.6), (253.0, 142.0), 0.223, 0.0, 1.16, 2.25, (14.9, 12.1), 1.57, 1.66),
    "flat, elastic": Numbers((7.4, 10.0), (0.975, 1.09), 1.32, 0.0, 0.101, 1.95, (0.328, 1.74), 2.13, 1.73),
    "round, elastic": Numbers((14.5, 16.5), (70.6, 50.8), 0.802, 0.0, 1.12, 2.13, (8.55, 7.27), 1.67, 1.56),
    "round, quasi-static": Numbers((13.7, 15.3), (34.9, 31.6), 1.03, 0.0, 0.521, 1.89, (4.59, 4.38), 1.62, 2.01),
    "quasi-static": Numbers((14.7, 18.6), (159.0, 132.0), 0.714, 0.0, 0.874, 2.11, (9.08, 8.74), 1.8, 1.37),
    "flat, quasi-static": Numbers((14.9, 8.46), (1.01, 9.07), 0.989, 0.0, 0.114, 3.3, (1.31, 1.55), 1.1, 1.62),
    "smooth": Numbers((46.9, 40.0), (1.01, 1.02), 0.0, 0.0, 0.458, 5.74, (4.99, 3.38), 1.02, 1.46),
    "flat, smooth": Numbers((18.3, 20.7), (1.02, 1.02), 0.0, 0.0, 0.205, 7.06, (2.66, 2.05), 0.509, 1.56),
    "round, smooth": Numbers((53.5, 41.1), (1.01, 1.02), 0.0, 0.0, 0.468, 5.77, (5.71, 3.34), 1.01, 2.14),
}
"""By the kind of a scene (effort.kind_of)."""
# end of what is fitted
