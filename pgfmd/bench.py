"""How fast this machine transforms: the fused pair of transform.py against mpi4py-fft's own."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from pgfmd.grid import Grid, PunchPoints
from pgfmd.halfspace import HalfSpace
from pgfmd.transform import Convolution, periodic_multiplier, plain_pair

LENGTH, RADIUS = 1.5e-3, 375e-6
"""The paper's cell and punch [m]: L = 4a."""
SHARE_OF_A_ROUND = 0.5
"""Time [s] that one side measures before the other's turn comes."""


def transform(comm, n: int, effort: str = "estimate", rounds: int = 4) -> dict[str, int | float | str]:
    """Time [ms] of a pair of n x n transforms, mpi4py-fft's own and the fused one, and the ratio fused/own. Collective.

    effort: of FFTW's planner, "estimate" or "measure", the same for both. The two take turns, `rounds` each, and the
    best of all calls counts, so that other load disturbs both alike; a call takes as long as its slowest rank.
    """
    points = PunchPoints(Grid(n, LENGTH), RADIUS, comm)
    fused = Convolution(points, n, periodic_multiplier(HalfSpace(2.65e6), LENGTH), effort)
    traction, displacement = np.ones(points.size), points.zeros()
    own = plain_pair(comm, n, effort)
    sides: dict[str, Callable[[], object]] = {"pfft": own, "fused": lambda: fused(traction, displacement)}
    best = {name: _one(comm, action) for name, action in sides.items()}
    for _ in range(rounds):
        for name, action in sides.items():
            spent = 0.0
            while spent < SHARE_OF_A_ROUND:
                seconds = _one(comm, action)
                spent, best[name] = spent + seconds, min(best[name], seconds)
    return {
        "n": n,
        "ranks": comm.size,
        "effort": effort,
        "pfft_pair_ms": 1e3 * best["pfft"],
        "fused_pair_ms": 1e3 * best["fused"],
        "ratio": best["fused"] / best["pfft"],
    }


def _one(comm, action: Callable[[], object]) -> float:
    """Time [s] of one call, the longest of all ranks, the same on each of them."""
    comm.Barrier()
    start = time.perf_counter()
    action()
    return max(comm.allgather(time.perf_counter() - start))
