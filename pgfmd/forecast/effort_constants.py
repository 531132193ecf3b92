"""The numbers of the forecast of steps and transform pairs (effort.py), as found by scripts/studies/forecast/run.py. No MPI."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Numbers:
    """Constants of one kind of scenes, as in effort.py. Pairs (in, out) are for approach and retraction.

    least: steps of any approach or retraction. rate: steps for each range of adhesion of the travel, to the power `travel`. slow:
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
    "viscoelastic": Numbers((14.6, 14.5), (20.0, 14.0), 1.03, 0.55, 0.457, 0.743, (2.42, 2.57), 0.872, 1.32),
    "flat, viscoelastic": Numbers((15.8, 9.36), (13.9, 7.52), 1.02, 0.199, 0.31, 2.58, (1.77, 3.08), 0.534, 1.69),
    "viscoelastic, two grids": Numbers(
        (13.6, 16.8), (26.0, 22.1), 0.921, 0.539, 0.335, 1.53, (0.624, 0.686), 0.91, 1.34
    ),
    "flat, viscoelastic, two grids": Numbers(
        (19.1, 18.3), (8.11, 6.21), 1.16, 0.242, 0.251, 2.72, (0.91, 0.463), 0.657, 1.44
    ),
    "repulsive": Numbers((13.5, 13.1), (7.29, 9.09), 0.0, 1.32, 0.21, 1.5, (1.72, 0.956), 1.07, 1.46),
    "elastic": Numbers((14.9, 18.5), (256.0, 149.0), 0.233, 0.0, 1.18, 2.24, (14.2, 11.9), 1.65, 1.62),
    "flat, elastic": Numbers((7.48, 11.2), (0.979, 1.11), 1.25, 0.0, 0.0992, 1.91, (0.351, 1.69), 2.15, 1.73),
    "round, elastic": Numbers((14.5, 16.6), (73.7, 51.1), 0.804, 0.0, 1.13, 2.16, (9.18, 7.99), 1.57, 1.56),
    "round, quasi-static": Numbers((13.3, 15.2), (32.5, 27.4), 1.14, 0.0, 0.622, 1.69, (3.75, 3.19), 1.4, 2.09),
    "quasi-static": Numbers((14.4, 18.4), (192.0, 142.0), 0.538, 0.0, 0.901, 1.91, (5.91, 4.72), 1.58, 1.47),
    "flat, quasi-static": Numbers((13.8, 7.41), (0.998, 6.91), 1.11, 0.0, 0.0915, 1.83, (0.823, 1.34), 0.705, 1.62),
    "smooth": Numbers((46.6, 39.3), (1.01, 1.02), 0.0, 0.0, 0.458, 2.6, (4.31, 3.17), 1.01, 1.46),
    "flat, smooth": Numbers((17.7, 20.4), (1.02, 1.02), 0.0, 0.0, 0.197, 2.2, (2.72, 1.8), 0.518, 1.56),
    "round, smooth": Numbers((45.8, 34.4), (1.01, 1.02), 0.0, 0.0, 0.398, 2.55, (4.91, 3.03), 1.01, 1.87),
}
"""By the kind of a scene (effort.kind_of)."""
# end of what is fitted
