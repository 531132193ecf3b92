"""A fit of a scene to a measured curve, from coarse grids to the scene's own, and what came of it. No MPI."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pgfmd.analysis.table import Table
from pgfmd.errors import ResultError, SceneError
from pgfmd.files.regular_files import write_atomically
from pgfmd.files.storage import plain, reason
from pgfmd.results.uncertainty import share_of
from pgfmd.scene import load_scene
from pgfmd.scene_objects import confirm

from .least_squares import ALIKE, UNKNOWN, Array, Certainty, Found, certainty, derivatives, search
from .parameters import FitError, MissingRun, Parameter
from .runs import TABLE, Runs

if TYPE_CHECKING:
    from pgfmd.results.curve import Loop

COARSEST = 32
"""Points along a side that a coarse level has at least."""
LEVELS = 3
"""Levels, at most, of which each is twice as fine as the one before."""
TOLERANCE, COARSE_TOLERANCE = 1e-3, 2e-2
"""Step of x with which a search ends, on the scene's grid and on coarser ones."""
MOST_STEPS, COARSE_STEPS = 30, 8
"""Steps that a search tries, likewise."""
CLOSER = 0.01
"""Share by which another run's misfit has to be smaller for the search to begin again from there."""
RECORD, SCENE, PICTURE = "fit.json", "fitted.toml", "fit.png"


@dataclass(frozen=True, eq=False)
class Fit:
    """A fit. x: where it ended; certainty: how well that is known; residuals [N]: there, at the places of the measured loop;
    levels: grids that were used, the scene's own last; loops: of the run at the start and at the end, on that grid."""

    runs: Runs
    levels: tuple[int, ...]
    x: Array
    residuals: Array
    certainty: Certainty
    converged: bool
    why: str
    start: Loop
    best: Loop

    @property
    def parameters(self) -> Sequence[Parameter]:
        """The numbers that were fitted."""
        return self.runs.parameters

    @property
    def values(self) -> tuple[float, ...]:
        """The fitted numbers in SI units."""
        return self.runs.values(self.x)

    @property
    def errors(self) -> tuple[float, ...]:
        """Their standard errors in SI units."""
        pairs = zip(self.parameters, self.x, self.certainty.errors, strict=True)
        return tuple(float(one.slope(place) * error) for one, place, error in pairs)

    @property
    def intervals(self) -> list[tuple[float, float]]:
        """Their 95 % intervals in SI units, as far as the bounds go."""
        half = self.certainty.factor * self.certainty.errors
        return [
            (one.value(place - width), one.value(place + width))
            for one, place, width in zip(self.parameters, self.x, half, strict=True)
        ]

    @property
    def misfit(self) -> float:
        """Root mean square of the residuals [N]."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    def doubts(self) -> list[str]:
        """What speaks against the numbers; empty where nothing does."""
        found, names = [], [one.key for one in self.parameters]
        for one, place, error in zip(self.parameters, self.x, self.certainty.errors, strict=True):
            low, high = one.place(one.low), one.place(one.high)
            if min(place - low, high - place) < 1e-2 * (high - low) / math.log(1e4):
                end = one.shown(one.low if place - low < high - place else one.high)
                found.append(f"{one.key} ended at its bound, {end}: its error says nothing; give other --bounds")
            elif error > UNKNOWN and one.limit is not None:
                found.append(
                    f"{one.key} is not determined by the curve: its standard error is a factor of {math.exp(error):.2g}"
                )
        for i in range(len(names)):
            for j in range(i):
                alike = self.certainty.correlation[i, j]
                if abs(alike) > ALIKE:
                    found.append(
                        f"{names[j]} and {names[i]} can't be told apart by this curve, correlation {alike:.4f}: leave one out"
                    )
        if not self.converged:
            found.append(f"the search did not come to its end ({self.why}): start again from {SCENE}")
        return found

    def table(self) -> Table:
        """The numbers for the eye and for fit.json."""
        table = Table(f"fit to {self.runs.misfit.measured.name}")
        rows = zip(self.parameters, self.values, self.errors, self.intervals, strict=True)
        for one, value, error, (low, high) in rows:
            note = f"95 %: {one.shown(low)} to {one.shown(high)}; started at {one.shown(one.start)}"
            table.add("Fitted", one.key, one.key, value, one.unit, note, error)
        names = [one.key for one in self.parameters]
        for i, row in enumerate(self.certainty.correlation):
            for j in range(i):
                table.add("Correlation", f"{names[j]}__{names[i]}", f"{names[j]}, {names[i]}", float(row[j]))
        scale = self.runs.misfit.scale
        section = "Misfit"
        table.add(
            section,
            "misfit",
            "root mean square of forces",
            self.misfit,
            "N",
            f"{100 * self.misfit / scale:.2g} % of the largest",
        )
        table.add(section, "places", "places on the curve", self.residuals.size)
        table.add(
            section,
            "independent",
            "of them independent",
            float(self.certainty.independent),
            "",
            "by their autocorrelation",
        )
        table.add(
            section, "runs", "runs", len(self.runs.by_name), "", f"on grids of n = {', '.join(map(str, self.levels))}"
        )
        table.remarks += self.doubts()
        return table

    def write(self) -> list[Path]:
        """Writes fit.json, fitted.toml and fit.png next to the table of the runs; returns all four. ResultError."""
        from pgfmd.plots.drawing import write_picture
        from pgfmd.plots.fitted_curve import fitted_figure

        out, n = self.runs.out, self.levels[-1]
        record = self.table().record()
        record["values"] = dict(zip([one.key for one in self.parameters], self.values, strict=True))
        record["standard_errors"] = dict(zip(record["values"], self.errors, strict=True))
        record["intervals_95"] = dict(zip(record["values"], self.intervals, strict=True))
        record["bounds"] = {one.key: (one.low, one.high) for one in self.parameters}
        record["correlation_matrix"] = self.certainty.correlation
        record["converged"], record["best_run"] = self.converged, self.runs.folder(n, self.x).name
        scene = load_scene(self.runs.source, self.runs.changes(n, self.values))
        for name, text in ((RECORD, json.dumps(plain(record), indent=2) + "\n"), (SCENE, scene.to_toml())):
            try:
                write_atomically(out / name, text.encode())
            except OSError as error:
                raise ResultError(f"{out / name}: could not be written: {reason(error)}") from error
        depth, simulated, measured = self.runs.misfit.forces(self.best)
        start, best = (self.runs.misfit.laid_over(loop) for loop in (self.start, self.best))
        branches = self.runs.misfit.branches
        figure = fitted_figure(best.loops[1], start.loops[0], best.loops[0], depth, simulated - measured, branches)
        return [out / TABLE, out / RECORD, out / SCENE, write_picture(figure, out / PICTURE)]


def levels_of(source: str, overrides: Sequence[str], coarsest: int | None = None) -> tuple[int, ...]:
    """Grids from coarse to fine: the scene's n, and halves of it as long as these are scenes of at least COARSEST points that
    nothing is missing from, at most LEVELS; down to `coarsest` where that is given.

    Raises SceneError if the scene itself can't be; FitError if `coarsest` is no half of a half of it.
    """
    n = load_scene(source, overrides).grid.n
    found = [n]
    while found[0] % 2 == 0 and (len(found) < LEVELS if coarsest is None else found[0] > coarsest):
        half = found[0] // 2
        try:
            if half < COARSEST and coarsest is None:
                break
            confirm(load_scene(source, [*overrides, f"grid.n={half}"]), source)
        except SceneError:
            break
        found.insert(0, half)
    if coarsest is not None and found[0] != coarsest:
        raise FitError(
            f"--from {coarsest}: expected one of {n}, {n // 2}, {n // 4} ..., fine enough for the scene; found {found}"
        )
    return tuple(found)


def fit(runs: Runs, levels: Sequence[int], say: Callable[[str], None] = print) -> Fit:
    """Fits on one level after the other, each from where the one before ended.

    Raises FitError if a number does not move the curve, if two can't be told apart at all; NotConverged if there are
    too many runs; Unfinished if the runs were stopped: the same call goes on.
    """
    parameters, misfit = runs.parameters, runs.misfit
    measured = misfit.forces_measured
    first = x = np.array([one.place(one.start) for one in parameters])
    for n in levels:
        last = n == levels[-1]
        say(
            f"n = {n}: "
            + ", ".join(
                f"{one.key} = {one.shown(value)}" for one, value in zip(parameters, runs.values(x), strict=True)
            )
        )
        try:
            found = _search_on(runs, n, measured, x, last)
        except MissingRun as error:
            raise FitError(f"{error}\n  {runs.last_trouble}") from None
        x = found.x
    evaluate, scale = partial(runs.residuals, levels[-1]), float(np.sqrt(np.mean(measured**2)))
    jacobian, bends = derivatives(evaluate, parameters, x, found.residuals, scale, central=True)
    share = share_of(load_scene(runs.source, runs.overrides).solver.model_dump())
    known = certainty(jacobian, found.residuals, measured, share, bends)
    evaluate([first], "start")
    start, best = runs.loop(levels[-1], first), runs.loop(levels[-1], x)
    return Fit(runs, tuple(levels), x, found.residuals, known, found.converged, found.why, start, best)


def _search_on(runs: Runs, n: int, measured: Array, x: Array, last: bool) -> Found:
    """Searches on a grid of n points from x on, and again from wherever a run has come closer than where the search ended: runs
    are a little rough as functions of their numbers, and a search by slopes may stop on a bump."""
    evaluate, scale = partial(runs.residuals, n), float(np.sqrt(np.mean(measured**2)))
    tolerance, most = (TOLERANCE, MOST_STEPS) if last else (COARSE_TOLERANCE, COARSE_STEPS)
    while True:
        found = search(evaluate, measured, runs.parameters, x, tolerance, most)
        if last:
            # The runs around the end, which its certainty needs in any case.
            derivatives(evaluate, runs.parameters, found.x, found.residuals, scale, central=True)
        best, misfit = runs.closest(n)
        if misfit >= (1.0 - CLOSER) * float(np.sqrt(np.mean(found.residuals**2))):
            return found
        x = best
