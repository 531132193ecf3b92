"""Fits the numbers of pgfmd/forecast/effort_constants.py to the rows of run.py, and writes them there."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np
from scipy.optimize import least_squares

from pgfmd.forecast.effort import counts_of, kind_of, strokes_of
from pgfmd.forecast.effort_constants import FITTED, Numbers
from pgfmd.scene import load_scene

from ..pages import ROOT
from .scenes import FIT
from .table import TABLE, Row, rows_of

MODULE = ROOT / "pgfmd" / "forecast" / "effort_constants.py"
TRUST = 1.0
"""How far the logarithm of a number may be from its first guess before that counts as much as a row that is off by
`NOISE`: what few rows don't tell stays where it was."""
NOISE = 0.2
"""Of the logarithm of a count, about; larger ones count less and less."""
SHARE = 0.95
"""Of the scenes of a kind that the spread has to hold."""
LEAST_SPREAD = 1.3
"""Nothing is told better than this, however few the rows are."""
ANY = Numbers((14.0, 16.0), (15.0, 12.0), 1.0, 0.5, 0.45, 2.0, (1.5, 2.0), 1.0, 1.5)
"""The first guess of all kinds that snap at the speed of an elastomer."""
GUESSES = {
    "viscoelastic": ANY,
    "flat, viscoelastic": replace(ANY, rate=(8.0, 5.0), slow=0.25, stiff=0.5),
    "viscoelastic, two grids": replace(ANY, pairs_rate=(0.5, 0.5), stiff=0.5),
    "flat, viscoelastic, two grids": replace(ANY, rate=(8.0, 5.0), slow=0.25, pairs_rate=(0.5, 0.5), stiff=0.5),
    "repulsive": replace(ANY, rate=(28.0, 20.0), slow=1.0, travel=0.0, refinement=0.33),
    "elastic": replace(ANY, rate=(60.0, 30.0), slow=0.0, refinement=1.0, pairs_rate=(5.0, 5.0)),
    "flat, elastic": replace(ANY, least=(8.0, 10.0), rate=(1.0, 1.0), slow=0.0, refinement=0.1, pairs_rate=(0.5, 1.0)),
    "round, elastic": replace(ANY, rate=(60.0, 40.0), slow=0.0, refinement=0.8, pairs_rate=(5.0, 5.0)),
    "round, quasi-static": replace(ANY, rate=(40.0, 40.0), slow=0.0, refinement=0.5, pairs_rate=(5.0, 5.0)),
    "quasi-static": replace(ANY, rate=(60.0, 40.0), slow=0.0, refinement=0.8, pairs_rate=(5.0, 5.0)),
    "flat, quasi-static": replace(ANY, least=(14.0, 8.0), rate=(1.0, 8.0), slow=0.0, refinement=0.1, pairs_rate=(1.0, 1.0), stiff=0.5),
    "smooth": replace(ANY, least=(20.0, 16.0), rate=(1.0, 1.0), slow=0.0, travel=0.0, refinement=0.5, pairs_rate=(3.0, 3.0)),
    "flat, smooth": replace(ANY, least=(12.0, 12.0), rate=(1.0, 1.0), slow=0.0, travel=0.0, refinement=0.5, pairs_rate=(2.0, 2.0), stiff=0.5),
    "round, smooth": replace(ANY, least=(20.0, 16.0), rate=(1.0, 1.0), slow=0.0, travel=0.0, refinement=0.5, pairs_rate=(3.0, 3.0)),
}  # fmt: skip
"""First guesses; what is zero stays so."""


def scene_of(row: Row):
    """The scene of a row."""
    return load_scene(row.scene, row.changes.split("; "))


def fitted(rows: list[Row]) -> dict[str, Numbers]:
    """The numbers of all kinds, with the spread that all rows of the kind have, those that are only judged included."""
    kinds: dict[str, list] = {kind: [] for kind in GUESSES}
    for row in rows:
        scene = scene_of(row)
        if scene.solver.scheme != "gfmd":
            kinds[kind_of(scene)].append((row, strokes_of(scene)))
    return {kind: _fit(found, GUESSES[kind]) for kind, found in kinds.items() if found}


def _fit(found: list, guess: Numbers) -> Numbers:
    flat = _flat(guess)
    free = np.flatnonzero(flat > 0.0)
    fit = [one for one in found if one[0].part == FIT]

    def numbers(logarithms: np.ndarray) -> Numbers:
        changed = flat.copy()
        changed[free] = np.exp(logarithms)
        return _numbers(changed, guess)

    def residuals(logarithms: np.ndarray) -> np.ndarray:
        away = (logarithms - np.log(flat[free])) / TRUST
        return np.concatenate([away, *(np.array(list(_errors(*one, numbers(logarithms)))) / NOISE for one in fit)])

    best = numbers(least_squares(residuals, np.log(flat[free]), loss="soft_l1").x)
    ratios = [
        abs(math.log(sum(counts_of(stroke, best)[1] for stroke in strokes) / row.pairs)) for row, strokes in found
    ]
    # Few scenes tell little of others.
    spread = max(LEAST_SPREAD, math.exp(float(np.quantile(ratios, SHARE)))) * (1.0 + 1.0 / len(ratios))
    return replace(best, spread=spread)


def _errors(row: Row, strokes, numbers: Numbers) -> Iterator[float]:
    """Logarithms of foretold over counted: steps and pairs of both ways, and all pairs, which are what is asked for."""
    counted = (row.steps_in, row.pairs_in), (row.steps - row.steps_in, row.pairs - row.pairs_in)
    predicted = [counts_of(stroke, numbers) for stroke in strokes]
    for (steps, pairs), (steps_counted, pairs_counted) in zip(predicted, counted, strict=True):
        yield 0.5 * math.log(steps / max(1, steps_counted))
        yield 0.5 * math.log(pairs / max(1, pairs_counted))
    yield math.log(sum(pairs for _, pairs in predicted) / row.pairs)


def _flat(numbers: Numbers) -> np.ndarray:
    """All numbers but the spread, one after another."""
    values = [getattr(numbers, field.name) for field in fields(Numbers) if field.name != "spread"]
    return np.concatenate([np.atleast_1d(value) for value in values]).astype(float)


def _numbers(flat: np.ndarray, like: Numbers) -> Numbers:
    """The opposite of `_flat`."""
    values, place = {}, 0
    for field in fields(Numbers):
        if field.name == "spread":
            continue
        count = len(getattr(like, field.name)) if isinstance(getattr(like, field.name), tuple) else 1
        part = [float(value) for value in flat[place : place + count]]
        values[field.name] = tuple(part) if count > 1 else part[0]
        place += count
    return Numbers(**values, spread=like.spread)


def write(found: dict[str, Numbers]) -> None:
    """Writes the table of the module anew; kinds without rows keep what they had."""
    lines = ["FITTED = {"]
    for kind in GUESSES:
        numbers = found.get(kind, FITTED.get(kind, GUESSES[kind]))
        values = ", ".join(_written(getattr(numbers, field.name)) for field in fields(Numbers))
        lines.append(f'    "{kind}": Numbers({values}),')
    text = MODULE.read_text(encoding="utf-8")
    table = "\n".join([*lines, "}"])
    text = re.sub(r"(# fitted\n).*?\n\}\n", lambda match: f"{match[1]}{table}\n", text, count=1, flags=re.DOTALL)
    MODULE.write_text(text, encoding="utf-8")


def _written(value: float | tuple[float, ...]) -> str:
    """A number with three digits, or a pair of them."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_written, value))})"
    return repr(float(f"{value:.3g}"))


if __name__ == "__main__":
    write(fitted(rows_of(TABLE)))
