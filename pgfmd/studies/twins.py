"""The quasi-static twins of the cases of a study: one for all cases that differ only in what a slow loop does not feel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from pgfmd.physics.drive import ENDED_WELL
from pgfmd.scene import load_scene
from pgfmd.scene.quasistatic_twin import CHANGES, NO_TIME, SAME_SECTIONS
from pgfmd.schemes import registry

from .cases import Case

if TYPE_CHECKING:
    from .table import Row

SHARE = "multistability_share [1]"
"""Column with the twin's loop over the case's own."""
PREFIX = "twin-"


def with_twins(cases: Sequence[Case]) -> list[Case]:
    """The cases, each with the name of its twin, and the twins as cases of their own; quasi-static cases have none.

    A twin has the accuracy of the first of its cases. Raises SceneError for a case that has no quasi-static twin.
    """
    named, twins = [], {}
    for case in cases:
        if registry.scheme_of(case.scene).timeless:
            named.append(case)
            continue
        tables = case.scene.tables()
        same = {section: tables[section] for section in SAME_SECTIONS}
        drive = {key: value for key, value in same["drive"].items() if key not in NO_TIME}
        key = repr(same | {"drive": drive})
        if key not in twins:
            overrides = (*case.overrides, *CHANGES)
            twins[key] = Case(PREFIX + case.name, case.source, overrides, load_scene(case.source, overrides))
        named.append(replace(case, twin=twins[key].name))
    return [*named, *twins.values()]


def add_shares(rows: Sequence[Row]) -> None:
    """Adds the share of multistability to the numbers of all rows, if there are twins: None where one of the two loops is
    not closed."""
    if not any(row.case.twin for row in rows):
        return
    loops = {row.case.name: _loop(row) for row in rows}
    for row in rows:
        own, slow = loops[row.case.name], loops.get(row.case.twin, math.nan)
        row.measured[SHARE] = slow / own if row.case.twin and own > 0.0 and not math.isnan(slow) else None


def _loop(row: Row) -> float:
    """Net work [J] of a closed loop; NaN of another one."""
    work = row.measured.get("work [J]")
    closed = (row.state.record or {}).get("finished") in ENDED_WELL
    return work if work is not None and closed else math.nan
