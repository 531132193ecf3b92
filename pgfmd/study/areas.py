"""The areas of the cases of a study: of contact, overlap and what is near, each by its own name. No MPI.

A case that counted overlap alone has numbers in the columns of overlap only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pgfmd.errors import ResultError
from pgfmd.results import load
from pgfmd.results.curve import KINDS_OF_AREA, Loop, measure

if TYPE_CHECKING:
    from .table import Row

AREAS = {
    f"{name.format(kind)} [m^2]": (kind, moment)
    for kind in KINDS_OF_AREA
    for moment, name in (
        ("at_preload", "{}_area_at_preload"), ("largest", "largest_{}_area"), ("at_pull_off", "{}_area_at_pull_off"),
    )
}  # fmt: skip
"""Columns of the table, and of which of `Measures.areas` they are at which moment."""
GAPS = {"contact_gap [m]": "contact", "near_gap [m]": "near"}
"""Columns with the gaps below which points count, and for which of the areas."""
COLUMNS = (*AREAS, *GAPS)
AT_PRELOAD = "{}_area_at_preload [m^2]"
MOST_NAMED = 5
"""Cases that a remark names."""


def areas_of(folder: Path) -> dict[str, float | None]:
    """Numbers by COLUMNS, None where they are not known; all are None where the curve can't be read."""
    try:
        with load(folder) as results:
            found = measure(Loop.of(results)).areas
            gaps = {"contact": results.contact_gap, "near": results.near_gap}
    except ResultError:
        return dict.fromkeys(COLUMNS)
    areas = {column: getattr(found.get(kind), moment, None) for column, (kind, moment) in AREAS.items()}
    return areas | {column: gaps[kind] if kind in found else None for column, kind in GAPS.items()}


def counted_overlap(numbers: Mapping[str, float | None]) -> bool:
    """Whether a case knows its overlap, but not its contact."""
    largest = "largest_{}_area [m^2]"
    return numbers.get(largest.format("overlap")) is not None and numbers.get(largest.format("contact")) is None


def remarks(rows: Sequence[Row]) -> list[str]:
    """What is to be said of cases that counted overlap alone."""
    old = [row.case.name for row in rows if counted_overlap(row.measured)]
    if not old:
        return []
    names = ", ".join(old[:MOST_NAMED]) + (f" and {len(old) - MOST_NAMED} more" if len(old) > MOST_NAMED else "")
    which = names if len(old) < len(rows) else "all cases"
    counted = "areas of overlap (gap < 0), not of contact"
    text = f"{which}: run by version 0.1 of pgfmd, which counted {counted}"
    if any(row.measured.get(AT_PRELOAD.format("contact")) is not None for row in rows):
        text += "; the other cases count contact: to compare them, move these folders away and run the study again"
    return [text]
