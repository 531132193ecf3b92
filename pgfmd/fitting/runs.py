"""The runs of a fit: each in a folder named after its numbers, so that what has been run once is found again. No MPI."""

from __future__ import annotations

import csv
import hashlib
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.errors import PgfmdError, ResultError, SceneError, Stopped
from pgfmd.files.regular_files import write_atomically
from pgfmd.files.storage import reason
from pgfmd.results import load
from pgfmd.results.curve import Loop
from pgfmd.scene import load_scene
from pgfmd.scene_objects import confirm
from pgfmd.studies.campaign import Campaign, Unfinished, Wishes, make_folder
from pgfmd.studies.case_state import CaseState
from pgfmd.studies.cases import Case
from pgfmd.studies.values import header, override_of

from .least_squares import Array
from .misfit import Misfit
from .parameters import Parameter

TABLE = "runs.csv"
MODULUS = "substrate.youngs_modulus"
REPORTED = {"pull_off_force [N]": "pull_off_force_N", "work [J]": "work_J", "steps": "steps", "wall [s]": "wall_s"}
"""Columns of the table with numbers of a run, by their keys in run.json."""


class NotConverged(PgfmdError):
    """A fit that gave up before it came to its end. The exit code is that of a run that could not go on."""

    exit_code = 3


@dataclass(frozen=True)
class FitRun:
    """A run of a fit. purpose: what it was made for; values: of the numbers in SI units; misfit [N]: root mean square; why: what is
    wrong with a run that counts for nothing."""

    name: str
    n: int
    purpose: str
    values: tuple[float, ...]
    misfit: float
    record: dict[str, Any]
    why: str = ""


@dataclass
class Runs:
    """Makes the runs that a fit asks for, and keeps the table of them in OUT/runs.csv.

    source, overrides: the scene, as `pgfmd run` is given it. out: folder of the runs. most: runs, after which the fit is ended.
    """

    source: str
    overrides: tuple[str, ...]
    parameters: Sequence[Parameter]
    misfit: Misfit
    out: Path
    ranks: int = 1
    jobs: int = 1
    checkpoint_every: str = "10min"
    most: int = 200
    say: Any = print
    by_name: dict[str, FitRun] = field(default_factory=dict)
    _residuals: dict[str, Array | None] = field(default_factory=dict)

    def residuals(self, n: int, places: Sequence[Array], purpose: str) -> list[Array | None]:
        """Residuals [N] at the places of the measured loop for each x, by runs on a grid of n points; None for a run that can't be
        made, or that has no whole loop.

        Raises Unfinished if the runs were stopped: the same call goes on. NotConverged if there would be too many.
        """
        cases: dict[str, Case] = {}
        names = []
        for x in places:
            values = self.values(x)
            names.append(self._name(n, values))
            if names[-1] in self._residuals or names[-1] in cases:
                continue
            try:
                cases[names[-1]] = self._case(names[-1], n, values)
            except SceneError as error:
                self._keep(names[-1], n, purpose, values, None, str(error))
        if cases:
            self._run(cases, n, purpose, {name: self.values(x) for name, x in zip(names, places, strict=True)})
        return [self._residuals[name] for name in names]

    def values(self, x: Array) -> tuple[float, ...]:
        """The numbers that x stands for, in SI units."""
        return tuple(parameter.value(place) for parameter, place in zip(self.parameters, x.tolist(), strict=True))

    @property
    def last_trouble(self) -> str:
        """Name of the last run that counts for nothing, and what is wrong with it; empty without one."""
        return next((f"{one.name}: {one.why}" for one in reversed(self.by_name.values()) if one.why), "")

    def closest(self, n: int) -> tuple[Array, float]:
        """x and misfit [N] of the run on a grid of n points that is closest to the measured loop."""
        best = min((one for one in self.by_name.values() if one.n == n and not one.why), key=lambda one: one.misfit)
        return np.array(
            [one.place(value) for one, value in zip(self.parameters, best.values, strict=True)]
        ), best.misfit

    def loop(self, n: int, x: Array) -> Loop:
        """The loop of a run that has been made."""
        with load(self.folder(n, x)) as results:
            return Loop.of(results)

    def folder(self, n: int, x: Array) -> Path:
        """Where a run is."""
        return self.out / self._name(n, self.values(x))

    def changes(self, n: int, values: Sequence[float]) -> tuple[str, ...]:
        """What makes the scene that of a run, as overrides."""
        own = [override_of(one.key, one.written(value)) for one, value in zip(self.parameters, values, strict=True)]
        return (*self.overrides, f"grid.n={n}", *own, *self._weights)

    @cached_property
    def _weights(self) -> tuple[str, ...]:
        """The weights of a Prony series whose modulus is fitted, as overrides. A scene that is read has both relaxed. With shares
        of the instantaneous modulus in the source, a fitted modulus would be taken for that one."""
        if MODULUS not in [one.key for one in self.parameters]:
            return ()
        rheology = load_scene(self.source, self.overrides).rheology
        if rheology.model != "prony":
            return ()
        return override_of("rheology.reference", "relaxed"), override_of("rheology.kappa", rheology.kappa)

    @staticmethod
    def _name(n: int, values: Sequence[float]) -> str:
        digest = hashlib.sha256(" ".join(map(repr, values)).encode()).hexdigest()[:10]
        return f"n{n}-{digest}"

    def _case(self, name: str, n: int, values: Sequence[float]) -> Case:
        changes = self.changes(n, values)
        scene = load_scene(self.source, changes)
        confirm(scene, name, self.ranks)
        return Case(name, self.source, changes, scene)

    def _run(self, cases: dict[str, Case], n: int, purpose: str, values: dict[str, tuple[float, ...]]) -> None:
        campaign = Campaign(
            list(cases.values()), self.out, Wishes(checkpoint_every=self.checkpoint_every), _say_nothing
        )
        make_folder(self.out)
        waiting = campaign.agenda(campaign.states())
        if len(self.by_name) + len(waiting) > self.most:
            raise NotConverged(
                f"--most-runs {self.most}: so many runs were made; give more, fewer numbers, or a better start"
            )
        try:
            campaign.run(self.ranks, self.jobs)
        except Unfinished as error:
            if error.exit_code == Stopped.exit_code:
                raise
        for name, case_state in campaign.states().items():
            self._take(name, n, purpose, values[name], case_state)
        self._write()

    def _take(self, name: str, n: int, purpose: str, values: tuple[float, ...], case_state: CaseState) -> None:
        """What a run that has ended says."""
        if not case_state.complete:
            self._keep(name, n, purpose, values, None, str(case_state), case_state.record)
            return
        with load(self.out / name) as results:
            loop = Loop.of(results)
        try:
            _, simulated, measured = self.misfit.forces(loop)
        except ValueError as error:
            self._keep(name, n, purpose, values, None, str(error), case_state.record)
            return
        self._keep(name, n, purpose, values, simulated - measured, "", case_state.record)

    def _keep(
        self,
        name: str,
        n: int,
        purpose: str,
        values: tuple[float, ...],
        residuals: Array | None,
        why: str,
        record: Any = None,
    ) -> None:
        misfit = math.nan if residuals is None else float(np.sqrt(np.mean(residuals**2)))
        self._residuals[name] = residuals
        self.by_name[name] = FitRun(name, n, purpose, values, misfit, record or {}, " ".join(why.split()))
        numbers = ", ".join(
            f"{one.key} = {one.shown(value)}" for one, value in zip(self.parameters, values, strict=True)
        )
        reported = f"misfit {1e3 * misfit:.4g} mN" if residuals is not None else why.splitlines()[0]
        self.say(f"[{len(self.by_name)}] n = {n}, {numbers}: {reported}")

    def _write(self) -> None:
        """The table of all runs, in the order in which they were made."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        heads = [header(one.key, one.unit) for one in self.parameters]
        writer.writerow(["run", "n", "purpose", *heads, "misfit [N]", *REPORTED, "trouble"])
        for one in self.by_name.values():
            reported = [one.record.get(key, "") for key in REPORTED.values()]
            misfit = "" if math.isnan(one.misfit) else repr(one.misfit)
            writer.writerow([one.name, one.n, one.purpose, *map(repr, one.values), misfit, *reported, one.why])
        try:
            write_atomically(self.out / TABLE, text.getvalue().encode())
        except OSError as error:
            raise ResultError(f"{self.out / TABLE}: could not be written: {reason(error)}") from error


def _say_nothing(line: str) -> None:
    """A fit tells of its runs itself."""
