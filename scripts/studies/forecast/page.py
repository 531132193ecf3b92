"""Judges the forecast by the rows of run.py, and fills docs/explanation/forecast.md."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pgfmd.forecast.effort import Effort, effort_of
from pgfmd.forecast.machine_profile import NoProfile, read
from pgfmd.forecast.run_times import problem_of

from ..pages import fill, page_named
from .fit import scene_of
from .scenes import FIT, JUDGE
from .table import TABLE, Row, rows_of

PAGE = page_named("forecast.md")
GOOD = 1.5
"""The factor that is wanted."""


@dataclass(frozen=True)
class Judged:
    """A row, and its forecast."""

    row: Row
    told: Effort

    @property
    def ratio(self) -> float:
        """Ratio of forecast to counted pairs."""
        return self.told.pairs / self.row.pairs


def judged(rows: list[Row]) -> list[Judged]:
    """All rows with their forecasts."""
    return [Judged(row, effort_of(scene_of(row))) for row in rows]


def summary(found: list[Judged]) -> str:
    """A line for each kind, and for those that were fitted and those that were not."""
    lines = [
        "| kind | scenes | runs | within 1.5 | smallest | median | largest | stated factor |", "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]  # fmt: skip
    kinds = list(dict.fromkeys(one.told.kind for one in found))
    for kind in kinds:
        for part, name in ((FIT, "fitted"), (JUDGE, "not fitted")):
            chosen = [one for one in found if one.told.kind == kind and one.row.part == part]
            if chosen:
                lines.append(_line(kind, name, chosen, f"{chosen[0].told.spread:.2g}"))
    for part, name in ((FIT, "fitted"), (JUDGE, "not fitted")):
        lines.append(_line("all", name, [one for one in found if one.row.part == part], ""))
    return "\n".join(lines)


def _line(kind: str, name: str, chosen: list[Judged], spread: str) -> str:
    ratios = np.array([one.ratio for one in chosen])
    within = int((np.abs(np.log(ratios)) <= math.log(GOOD)).sum())
    return (
        f"| {kind} | {name} | {len(chosen)} | {within} | {ratios.min():.2f} | {np.median(ratios):.2f} | {ratios.max():.2f} | "
        f"{spread} |"
    )


def outliers(found: list[Judged]) -> str:
    """Scenes that are off by more than is wanted."""
    lines = [
        "| scene | changes | | pairs | forecast / counted | stated factor |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for one in found:
        if abs(math.log(one.ratio)) > math.log(GOOD):
            row, name = one.row, "fitted" if one.row.part == FIT else "not fitted"
            lines.append(
                f"| {row.scene} | {row.changes} | {name} | {row.pairs} | {one.ratio:.2f} | {one.told.spread:.2g} |"
            )
    return "\n".join(lines) if len(lines) > 2 else "None."


def seconds(found: list[Judged]) -> str:
    """Processor time of the runs beside that of the machine's profile, of as many pairs as were counted."""
    try:
        profile = read()
    except NoProfile as problem:
        return f"The time of a pair was not judged with these runs: {problem}."
    ratios = []
    for one in found:
        scene = scene_of(one.row)
        if scene.solver.scheme == "gfmd" or one.row.seconds < 0.2:
            continue
        problem = problem_of(scene)
        if problem.kind in profile.costs:
            ratios.append((profile.run_seconds(problem, one.row.pairs, 1) - profile.start_seconds(1)) / one.row.seconds)
    if not ratios:
        return "No run was long enough to judge the time of a pair."
    low, middle, high = np.quantile(ratios, [0.05, 0.5, 0.95])
    return (
        f"Ratio of the time of a pair in the profile of the machine (`pgfmd bench ranks`) to the processor time of the {len(ratios)} runs that took "
        f"longer than 0.2 s: the median is {middle:.2f}, and 90 % of the runs are between {low:.2f} and {high:.2f}."
    )


def main() -> None:
    """Fills the page."""
    found = judged(rows_of(TABLE))
    blocks = {"summary": summary, "outliers": outliers, "seconds": seconds}
    fill(PAGE, "forecast", lambda name: blocks[name](found))


if __name__ == "__main__":
    main()
