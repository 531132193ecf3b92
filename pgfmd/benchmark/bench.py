"""How fast this machine is: pairs of transforms, and the errors that either scheme makes for its cost."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pgfmd.physics.halfspace import HalfSpace
from pgfmd.schemes import registry
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.multiplier import periodic_multiplier
from pgfmd.solver.transform import Convolution, plain_pair

from .curve_errors import cost_at
from .work_precision import Laboratory, Row, explicit, implicit, study

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

LENGTH, RADIUS = 1.5e-3, 375e-6
"""The paper's cell and punch [m]: L = 4a."""
SHARE_OF_A_ROUND = 0.5
"""Time [s] that one side measures before the other's turn comes."""


def transform(comm: Intracomm, n: int, effort: str = "estimate", rounds: int = 4) -> dict[str, int | float | str]:
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


def _one(comm: Intracomm, action: Callable[[], object]) -> float:
    """Time [s] of one call, the longest of all ranks, the same on each of them."""
    comm.Barrier()
    start = time.perf_counter()
    action()
    return max(comm.allgather(time.perf_counter() - start))


SCENE, SMALL = "tri-tack", ("grid.n=64", "drive.speed=200 um/s", "solver.gfmd.fast_pull=1")
"""The scene of the small work-precision study: so fast that gfmd, too, takes seconds. Its step follows omega alone."""
REFERENCE = "solver.accuracy=1e-5"
OURS, PAPERS, LONGEST = registry.DEFAULT, "gfmd, omega dt = pi/10", "gfmd, omega dt = pi/2"
TARGET = 0.01
"""Error of the force curve, relative to the preload, at which the schemes are compared."""


def work_precision(
    comm: Intracomm,
    say: Callable[[str], None],
    base: Sequence[str] = SMALL,
    omega_taus: Sequence[float] = (2, 4, 8, 16, 32),
) -> list[Row]:
    """Errors and costs of `inertialess` over accuracies, and of `gfmd` over omega. Collective.

    gfmd has the paper's omega dt, and one five times as large; the reference is inertialess with `REFERENCE`.

    base: overrides of tri-tack; omega_taus: omega tau_min in units of pi. `say` is given a line as each is measured.
    scripts/studies/work_precision/run.py is the full study.
    """
    laboratory = Laboratory(comm)
    settings = [
        *implicit(OURS, (0.3, 0.1, 0.03, 0.01, 1e-3)),
        *explicit(PAPERS, omega_taus, [0.1]),
        *explicit(LONGEST, omega_taus, [0.5]),
    ]
    reference = laboratory.outcome(SCENE, (*base, REFERENCE)).curve
    head = ("scheme", "setting", "force", "pull-off", "work", "area", "pairs", "steps", "core-s")
    say("errors in % of: force curve (rms, of the preload), pull-off force, work of separation, contact area (rms)")
    say("{:24s}{:34s}{:>9s}{:>9s}{:>9s}{:>9s}{:>9s}{:>9s}{:>10s}".format(*head))
    rows = []
    for row in study(laboratory, SCENE, base, settings, reference, say):
        rows.append(row)
        errors = (row.force_error, row.pull_off_error, row.separation_error, row.area_error)
        shown = "".join(f"{100 * error:9.3g}" for error in errors)
        say(f"{row.line:24s}{row.label:34s}{shown}{row.pairs:9d}{row.steps:9d}{row.core_seconds:10.3g}")
    return rows


def comparison(rows: Sequence[Row]) -> list[str]:
    """By how much inertialess is cheaper at an error of `TARGET` in the force curve, a line for each kind of gfmd."""
    lines = []
    for other in (PAPERS, LONGEST):
        seconds, pairs = (
            _at_target(rows, other, cost) / _at_target(rows, OURS, cost) for cost in ("core_seconds", "pairs")
        )
        if math.isfinite(seconds):
            lines.append(
                f"at {100 * TARGET:g} % in the force curve, {OURS} needs 1/{seconds:.3g} of the core-seconds and "
                f"1/{pairs:.3g} of the transform pairs of {other}"
            )
        else:
            lines.append(f"{other} does not come down to {100 * TARGET:g} % in the force curve with these settings")
    return lines


def _at_target(rows: Sequence[Row], line: str, cost: str) -> float:
    """Cost of a line of settings at `TARGET`, interpolated."""
    mine = [row for row in rows if row.line == line]
    return cost_at(TARGET, [row.force_error for row in mine], [getattr(row, cost) for row in mine])
