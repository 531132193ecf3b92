"""Levels of a refinement of a scene: finer grids with a shorter or a constant range of adhesion, or smaller tolerances.

The automatic range goes as n^-1/2: halving it takes a grid four times as fine, so that two doublings of n halve rho.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from dataclasses import dataclass

from pgfmd.errors import Problem, SceneError
from pgfmd.forecast.estimate import memory_of
from pgfmd.scene import Scene, load_scene
from pgfmd.scene_objects import confirm
from pgfmd.schemes import registry

from .cases import Case
from .study_file import Axis

RHO, N, ACCURACY = "rho", "n", "accuracy"
HYSTERESIS_POWER = 1.0 / 3.0
"""Adhesion hysteresis converges with the cube root of the linear mesh size (paper, after Wang et al. 2021)."""
FACTORS = {RHO: 2.0, N: 2.0, ACCURACY: math.sqrt(10.0)}
"""Default ratio of the sizes of two levels."""
LARGEST_FACTOR = 1000.0
KEYS = {RHO: Axis("grid.n"), N: Axis("grid.n"), ACCURACY: Axis("solver.accuracy")}
FEWEST = 2
SHARE_OF_MEMORY = 0.8
MEASURES = {
    "loop": ("work [J]", "J", "work of the loop"),
    "work": ("work_of_separation [J]", "J", "work of separation"),
    "pull-off": ("pull_off_force [N]", "N", "pull-off force"),
}
"""Quantities by the names of `pgfmd converge`: column of the table, unit, words."""


@dataclass(frozen=True)
class Levels:
    """Cases from coarse to fine, and remarks about them. axis: "rho", "n" or "accuracy"."""

    axis: str
    cases: list[Case]
    remarks: list[str]

    @property
    def key(self) -> Axis:
        """The key that differs between levels."""
        return KEYS[self.axis]

    def lines(self) -> list[str]:
        """The label of each level."""
        found = [(case.name, case.scene) for case in self.cases]
        return [
            f"{name}: n = {scene.grid.n}, rho = {scene.adhesion.range * 1e6:.4g} um, accuracy {scene.solver.accuracy:.3g}"
            for name, scene in found
        ]

    def size_of(self, case: Case) -> float:
        """The size that decreases from level to level: the grid spacing h = L/n [m], or the accuracy."""
        scene = case.scene
        return scene.solver.accuracy if self.axis == ACCURACY else scene.grid.length / scene.grid.n


def levels_of(
    source: str, overrides: Iterable[str], axis: str, count: int = 4, start: str | None = None,
    factor: float | None = None, largest_n: int | None = None, ranks: int = 1,
) -> Levels:  # fmt: skip
    """The levels of a scene, coarsest first, as many as asked for, memory and `largest_n` allow.

    start: n, or the accuracy, of the coarsest level; by default that of the scene. Raises SceneError for a scene that
    can't be run, or if fewer than two levels are possible.
    """
    common = list(overrides)
    coarse = load_scene(source, common)
    scheme = registry.scheme_of(coarse)
    if axis == ACCURACY and not scheme.has_accuracy:
        problem = Problem("solver.scheme", scheme.name, "a scheme with an accuracy", scheme.unread["solver.accuracy"])
        raise SceneError(source, [problem])
    factor, remarks = factor or FACTORS[axis], []
    cases: list[Case] = []
    for place in _places(coarse, axis, count, start, factor):
        at_accuracy = [*common, f"solver.accuracy={place!r}"]
        changes = at_accuracy if axis == ACCURACY else _grid_overrides(source, common, axis, place, cases)
        case = _case(source, changes, axis, place, ranks)
        refusal = _refusal(case, largest_n, ranks)
        if refusal:
            remarks.append(f"{len(cases)} of {count} levels: {refusal}")
            break
        cases.append(case)
    if len(cases) < FEWEST:
        cure = "; ".join(remarks) or "ask for more --levels"
        raise SceneError(source, [Problem("--levels", len(cases), f"at least {FEWEST} levels", cure)])
    return Levels(axis, cases, remarks)


def _places(coarse: Scene, axis: str, count: int, start: str | None, factor: float) -> list:
    """n or the accuracy of each level."""
    kind, words = (float, "a number above 0") if axis == ACCURACY else (int, "a number of grid points")
    first = coarse.solver.accuracy if axis == ACCURACY else coarse.grid.n
    if start is not None:
        try:
            first = kind(start)
        except ValueError:
            raise SceneError("command line", [Problem("--from", start, words)]) from None
    if not 1.0 < factor <= LARGEST_FACTOR or not 0 < first < math.inf:
        words = f"a factor above 1, at most {LARGEST_FACTOR:g}, and a start above 0"
        raise SceneError("command line", [Problem("--factor, --from", (factor, first), words)])
    places = _rounded(axis, first, factor, count)
    if len(set(places)) < count:
        raise SceneError("command line", [_coincidence(axis, places, factor)])
    return places


def _rounded(axis: str, first: float, factor: float, count: int) -> list:
    """The values of levels by a constant factor."""
    if axis == ACCURACY:
        return [float(f"{first / factor**k:.6g}") for k in range(count)]
    # Even, because transforms are fastest and grids are symmetric there.
    return [first, *(2 * round(first * factor**k / 2.0) for k in range(1, count))]


def _coincidence(axis: str, places: list, factor: float) -> Problem:
    """The message for levels that coincide, with the smallest factor, in hundredths, at which they differ."""
    repeated = [place for place in dict.fromkeys(places) if places.count(place) > 1]
    key = KEYS[axis].name
    same = [", ".join(f"{k}" for k, other in enumerate(places, 1) if other == place) for place in repeated]
    repetitions = "; ".join(f"levels {k} have {key} = {place:.6g}" for k, place in zip(same, repeated, strict=True))
    first, count = places[0], len(places)
    enough = next(k / 100 for k in range(101, 301) if len(set(_rounded(axis, first, k / 100, count))) == count)
    return Problem("--factor", factor, "levels that differ", f"{repetitions}; --factor {enough:.4g} would do")


def _grid_overrides(source: str, common: list[str], axis: str, n: int, before: list[Case]) -> list[str]:
    """The scene on a grid: with the shortest range that it can carry, or with the range that the coarsest one has."""
    here = [*common, f"grid.n={n}"]
    if axis == RHO:
        return [*here, "adhesion.range=auto", "adhesion.q_ref=grid"]
    reach = before[0].scene.adhesion.range if before else load_scene(source, here).adhesion.range
    return [*here, f"adhesion.range={reach!r} m"]


def _case(source: str, overrides: list[str], axis: str, place: float, ranks: int) -> Case:
    name = f"{KEYS[axis].name.rpartition('.')[2]}-{place:.6g}"
    scene = load_scene(source, overrides)
    confirm(scene, name, ranks)
    return Case(name, source, tuple(overrides), scene, {KEYS[axis].name: f"{place:.6g}"})


def _refusal(case: Case, largest_n: int | None, ranks: int) -> str:
    """Why a level is too large; empty if it is not."""
    n = case.scene.grid.n
    if largest_n is not None and n > largest_n:
        return f"n = {n} is above --largest-n {largest_n}"
    needed = memory_of(case.scene, ranks).in_all(ranks)
    present = float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    if needed > SHARE_OF_MEMORY * present:
        return f"n = {n} takes {needed / 1e9:.3g} GB, this machine has {present / 1e9:.3g} GB"
    return ""


def expected_power(axis: str, quantity: str) -> float | None:
    """The power of the grid spacing that the paper expects; None if it expects none."""
    return HYSTERESIS_POWER if (axis, quantity) == (RHO, "loop") else None
