"""The cycles of a programme with repeats, each as a loop of its own, and what was measured in each."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from pgfmd.errors import ResultError

from .curve import Loop
from .reading import Results

KEYS = (
    "preload_N", "largest_force_N", "snap_in_force_N", "pull_off_force_N", "contact_time_s", "work_J",
    "work_of_separation_J", "viscous_J", "released_J", "residual_J",
)  # fmt: skip
"""Numbers of a cycle in `run.json`, beside `cycle`, `start_s` and `end_s`."""
RECORDED = ("preload_N", "largest_force_N", "snap_in_force_N", "pull_off_force_N")
"""Those that the loop of a cycle uses."""


@dataclass(frozen=True)
class Cycle:
    """One cycle: its number, from 1; its rows as a loop; and its numbers of `run.json` by KEYS, empty before the end of the
    run."""

    number: int
    loop: Loop
    numbers: dict[str, float | None]


def count_of(loop: Loop) -> int:
    """The number of cycles that a curve has rows of."""
    return 1 if loop.cycle is None else int(loop.cycle.max())


def cycles_of(results: Results, loop: Loop) -> Iterator[Cycle]:
    """The cycles of a run, in their order; `loop` has all of its rows."""
    known = _recorded(results)
    for number in range(1, count_of(loop) + 1):
        yield _cycle(loop, number, known.get(number, {}))


def cycle_of(results: Results, loop: Loop, number: int) -> Cycle:
    """One of the cycles. Raises ResultError if there are no rows of it."""
    count = count_of(loop)
    if not 1 <= number <= count:
        raise ResultError(
            f"{results.directory}: there is no cycle {number}, the curve has {count}: choose 1 to {count}"
        )
    return _cycle(loop, number, _recorded(results).get(number, {}))


def _recorded(results: Results) -> dict[int, dict]:
    """The cycles of `run.json` by their numbers."""
    return {int(entry["cycle"]): entry for entry in results.run.get("cycles", [])}


def _cycle(loop: Loop, number: int, entry: dict) -> Cycle:
    """The rows of a cycle, with the numbers that the run found of it; works from rows where it has not said."""
    assert loop.cycle is not None or number == 1, "a curve without a column of cycles has one"
    rows = slice(None) if loop.cycle is None else loop.cycle == number
    arrays: dict[str, Any] = {
        field.name: value[rows]
        for field in dataclasses.fields(loop)
        if isinstance(value := getattr(loop, field.name), np.ndarray)
    }
    recorded = {key: entry[key] for key in RECORDED if entry.get(key) is not None}
    work, separation = entry.get("work_J"), entry.get("work_of_separation_J")
    name = f"{loop.name}, cycle {number}"
    part = dataclasses.replace(loop, name=name, work=work, separation=separation, recorded=recorded, **arrays)
    return Cycle(number, part, {key: entry.get(key) for key in KEYS})
