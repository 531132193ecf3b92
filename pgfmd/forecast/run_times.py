"""Forecast of run times on several numbers of ranks of this machine. No MPI."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pgfmd import coarsening
from pgfmd.host.processes import cores
from pgfmd.scene_objects import transform_side
from pgfmd.schemes import registry
from pgfmd.symmetry import expected, points_of

from .effort import Effort, ahead_of, effort_of
from .estimate import guessed_seconds, pair_cost, pair_seconds
from .machine_profile import NoProfile, Profile, read
from .scaling import Problem

if TYPE_CHECKING:
    from pgfmd.scene import Scene

CELL_PAIRS = 10.0
"""Time of the coarse grid for each pair on all points, in pairs of a run on a grid as coarse, on one rank (each rank
solves the complete coarse problem). Fitted with COARSE_OVERHEAD to tri-tack at n = 1024 and 2048 on 1 and 2 ranks, where it is
within 5 % of whole runs. (4 pairs are counted, and there are fewer pairs per step.)"""
COARSE_OVERHEAD = 0.14
"""Further time of the coarse grid, as a fraction of the time of the pair itself."""
WORTH_TELLING = 1.1
"""Another number of ranks is recommended if it is faster by more than this factor."""
ROUGH = "a rough guess; `pgfmd bench ranks` measures this machine"


def ranks_of(count: int) -> str:
    """A number of ranks as text."""
    return "1 rank" if count == 1 else f"{count} ranks"


def run_times(scene: Scene, ranks: int) -> tuple[list[tuple[int, float, str]], list[str]]:
    """(times, advice): times as (ranks, seconds, note), and remarks on the number of ranks.

    From the profile of this machine; without a suitable profile, a guess for one rank.
    """
    effort, ahead = effort_of(scene), ahead_of(scene)
    guess = effort.seconds + sum(
        guessed_seconds(pairs, pair_seconds(coarse), pair_cost(coarse)) for coarse, pairs in ahead
    )
    rough = [(1, guess, ROUGH)]
    try:
        profile = read()
    except NoProfile as problem:
        unknown = f"what {ranks_of(ranks)} would take is not known: {problem}"
        return rough, [unknown] if ranks > 1 else []
    other = _not_measured(scene, profile)
    if other:
        rough = [(1, guess, f"a rough guess, {other}")]
        return rough, [f"what {ranks_of(ranks)} would take is not known: {other}"] if ranks > 1 else []
    return _by_profile(scene, profile, effort, ahead, ranks)


def problem_of(scene: Scene, mirror: str | None = None) -> Problem:
    """What a run of the scene shares out. mirror: the axes whose images it leaves out, those that it will find by
    default."""
    points = points_of(scene, expected(scene).mirror if mirror is None else mirror)
    return Problem.of(points, transform_side(scene, points.nb, mirror=points.mirror), scene.solver.precision)


def _not_measured(scene: Scene, profile: Profile) -> str:
    """Why a profile can't be used for such a scene; empty if it can."""
    if registry.scheme_of(scene).explicit:
        return "the machine is measured with implicit schemes only"
    if problem_of(scene).kind not in profile.costs:
        return f"the machine is not measured in {scene.solver.precision} precision"
    return ""


def _by_profile(
    scene: Scene, profile: Profile, effort: Effort, ahead: list, ranks: int
) -> tuple[list[tuple[int, float, str]], list[str]]:
    problem, pairs, usable = problem_of(scene), effort.pairs, min(cores(), profile.most_ranks)
    coarser = coarsening.scene_of_cells(scene)
    cells, others = coarser and problem_of(coarser), [(problem_of(coarse), wanted) for coarse, wanted in ahead]

    def more(count: int) -> float:
        """Time of the coarse grid and of coarse approaches."""
        taken = 0.0
        if cells and cells.kind in profile.costs:
            taken += COARSE_OVERHEAD * (profile.run_seconds(problem, pairs, count) - profile.start_seconds(count))
            taken += profile.run_seconds(cells, CELL_PAIRS * pairs, 1) - profile.start_seconds(1)
        for other, wanted in others:
            if other.kind in profile.costs:
                used = min(count, other.most_ranks)
                taken += profile.run_seconds(other, wanted, used) - profile.start_seconds(used)
        return taken

    def seconds(count: int) -> float:
        return profile.run_seconds(problem, pairs, count) + more(count)

    best = profile.best_ranks(problem, pairs, usable, more)
    fastest = seconds(best)
    note = f"as measured here on {profile.measured}; as good as the number of pairs"
    most = f"the best number of ranks for it on this machine, out of 1 to {usable}"
    if ranks > usable:
        # The model does not include ranks that share cores, and more ranks than were measured.
        own = f"this process may use {cores()} core{'s' * (cores() > 1)}, and more ranks than that wait for each other"
        if ranks <= cores():
            own = f"what {ranks_of(ranks)} would take is not known, this machine was measured with {profile.most_ranks} at most"
        return [(best, fastest, f"{most}; {note}")], [f"{own}; {ranks_of(best)} would do best here"]
    if ranks == best:
        return [(best, fastest, f"{most}; {note}")], []
    taken = seconds(ranks)
    times = [(ranks, taken, note), (best, fastest, most)]
    if taken > WORTH_TELLING * fastest:
        return times, [
            f"{ranks_of(best)} would take about {fastest / taken:.2g} times as long as {ranks_of(ranks)} here"
        ]
    if best < ranks:
        return times, [
            f"{ranks_of(best)} would take hardly longer than {ranks_of(ranks)} here, and leave cores to others"
        ]
    return times, []
