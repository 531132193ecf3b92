"""Four checks for every measured curve, which find wrong signs, wrong orders and wrong zeros.

- One cycle: the punch goes in once. If there are several cycles, one has to be chosen.
- The deepest row lies inside, unless there is one branch alone, and the force is large there: both signs may be wrong
  without contradicting each other, but then the curve seems to end far away.
- The net work of the loop is positive: no elastomer gives energy.
- The force far away, if the rows reach that far, is zero or is subtracted.
"""

from __future__ import annotations

import numpy as np

from pgfmd.errors import MeasurementError
from pgfmd.results.curve import Array
from pgfmd.units import handy_quantity as shown

from .measured_columns import Rows

LEAST_ROWS = 4
LEAST_SWING = 0.1
"""Travel in and out, as a fraction of the stroke, that counts as a cycle."""
JUMP = 0.5
"""Step between two rows, as a fraction of the stroke, that no machine makes."""
NEAR_THE_DEEPEST, LARGE = 0.05, 0.5
"""Within this fraction of the stroke from the deepest row, the force reaches this fraction of its maximum."""
SMALLEST_LOSS = -0.005
"""Net work of a loop, as a fraction of all work, below which it can't be noise."""
FAR = (0.1, 0.05, 0.02, 0.01)
"""Outermost fractions of the stroke in which the force far away is searched for; the first one counts in which the
force is as constant as in the next interval of this width."""
LEVEL = 0.01
"""Change of the force, as a fraction of its range, from one tenth of the stroke to the next, up to which it counts as
constant."""
DRIFT = 0.1
"""Difference of the forces before and after the contact, as a fraction of the range, up to which it counts as a drift.
A larger one may be a contact that still holds at the end."""
LEAST_OUTSIDE = 3
"""Number of rows for the mean force far away."""
ZERO = 1e-3
"""Force far away, as a fraction of the range, that counts as zero."""
SIGNS = "--positive-displacement in|out, --positive-force compression|tension"


def confirm_signs(rows: Rows) -> None:
    """Whether the force rises as the punch goes in. Raises MeasurementError.

    In the rows up to the deepest one, the largest force comes after the smallest. In a single retraction it comes
    before. The whole curve is no criterion: with strong adhesion, the force is lower in contact than far away.
    """
    if len(rows.force) < LEAST_ROWS:
        raise MeasurementError(f"{rows.path}: expected at least {LEAST_ROWS} rows of numbers, found {len(rows.force)}")
    stroke = float(np.ptp(rows.indentation))
    if stroke == 0.0 or np.ptp(rows.force) == 0.0:
        raise MeasurementError(f"{rows.path}: expected a punch that moves and a force that changes, found neither")
    deepest = int(np.argmax(rows.indentation))
    span = next(span for span in _cycles(rows.indentation) if span.start <= deepest < span.stop)
    inward = np.ptp(rows.indentation[span.start : deepest + 1]) > LEAST_SWING * stroke
    force = rows.force[span.start : deepest + 1] if inward else rows.force[deepest : span.stop]
    smallest, largest = int(np.argmin(force)), int(np.argmax(force))
    if (largest < smallest) if inward else (smallest < largest):
        raise MeasurementError(
            f"{rows.path}: expected the force to rise as the punch is pushed in, but it falls ({rows.senses}); say which "
            f"way the columns count: {SIGNS}"
        )


def one_cycle(rows: Rows, cycle: int | None = None) -> Rows:
    """The rows of one cycle: the only one, or that with the number `cycle`, from 1. Raises MeasurementError."""
    _refuse_jumps(rows)
    if rows.cycle is not None and len(numbers := np.unique(rows.cycle)) > 1:
        listed = ", ".join(f"{number:g}" for number in numbers[:6]) + (", ..." if len(numbers) > 6 else "")
        if cycle is None or cycle not in numbers:
            raise MeasurementError(
                f"{rows.path}: expected one cycle, found the numbers {listed}; choose one: --cycle N"
            )
        rows.remarks.append(f"{rows.path.name}: cycle {cycle} of those with the numbers {listed}")
        return rows.of(rows.cycle == cycle)
    spans = _cycles(rows.indentation)
    if cycle is None and len(spans) > 1:
        ends = ", ".join(f"{rows.lines[span.start]} to {rows.lines[span.stop - 1]}" for span in spans[:4])
        more = ", ..." if len(spans) > 4 else ""
        raise MeasurementError(
            f"{rows.path}: expected one cycle, found {len(spans)} (lines {ends}{more}); choose one: --cycle 1 to {len(spans)}"
        )
    if cycle is None or (cycle == 1 and len(spans) == 1):
        return rows
    if not 1 <= cycle <= len(spans):
        raise MeasurementError(f"{rows.path}: expected a cycle from 1 to {len(spans)}, found --cycle {cycle}")
    rows.remarks.append(f"{rows.path.name}: cycle {cycle} of {len(spans)}")
    return rows.of(spans[cycle - 1])


def confirm_deepest(rows: Rows) -> None:
    """Whether the force is large where the punch is deepest, and not where it is farthest out. Raises MeasurementError."""
    indentation, force = rows.indentation, rows.force
    stroke, span = float(np.ptp(indentation)), float(np.ptp(force))
    near = indentation >= np.max(indentation) - NEAR_THE_DEEPEST * stroke
    deep, outer = (
        edge <= FAR[0] * stroke for edge in (np.max(indentation) - indentation, indentation - np.min(indentation))
    )
    is_level = [float(np.ptp(np.percentile(force[zone], [5, 95]))) <= LEVEL * span for zone in (deep, outer)]
    zero = float(np.mean(force[outer])) if is_level[1] else 0.0
    largest = float(np.max(force))
    fine = largest > zero and float(np.max(force[near])) - zero >= LARGE * (largest - zero)
    if not fine or (is_level[0] and not is_level[1]):
        deepest = int(np.argmax(indentation))
        raise MeasurementError(
            f"{rows.path}: expected the largest force where the punch is deepest, but in the deepest row (line "
            f"{rows.lines[deepest]}) it is {shown(float(force[deepest]), 'force')}, and the largest, "
            f"{shown(largest, 'force')}, is in line {rows.lines[int(np.argmax(force))]} ({rows.senses}); if both columns "
            "count the other way, give --positive-displacement out --positive-force tension, or what is true of each"
        )


def turn_of(rows: Rows) -> tuple[int, bool]:
    """The row of the largest force, which separates the branches, and whether both exist."""
    turn, stroke = int(np.argmax(rows.force)), float(np.ptp(rows.indentation))
    before, after = np.ptp(rows.indentation[: turn + 1]), np.ptp(rows.indentation[turn:])
    return turn, bool(min(before, after) > LEAST_SWING * stroke)


def confirm_loss(rows: Rows) -> None:
    """Whether the loop, where it has both branches, dissipates energy. Raises MeasurementError."""
    inner = np.maximum(rows.indentation, max(rows.indentation[0], rows.indentation[-1]))
    steps = 0.5 * (rows.force[1:] + rows.force[:-1]) * np.diff(inner)
    net, whole = float(np.sum(steps)), float(np.sum(np.abs(steps)))
    if net < SMALLEST_LOSS * whole:
        raise MeasurementError(
            f"{rows.path}: expected a loop that takes energy, but its net work is {_joule(net)}, {100 * net / whole:.2g} % "
            "of all work: no elastomer gives any. Do the rows run from the last to the first, or one branch against its way? "
            "Bring them into the order in which they were measured"
        )
    if net < 0.0:
        rows.remarks.append(f"{rows.path.name}: the net work of the loop, {_joule(net)}, is zero within the noise")


def without_baseline(rows: Rows, turn: int) -> tuple[Array, str]:
    """The forces [N] minus the force far away, and the correction in words, "" for none. turn: the row that separates
    the branches. A drift is linear in time, or in the number of rows if there is no time. If the rows don't reach far
    enough, a remark says so."""
    name, span = rows.path.name, float(np.ptp(rows.force))
    timed = bool(np.isfinite(rows.time).all() and (np.diff(rows.time) > 0.0).any())
    clock = rows.time if timed else np.arange(len(rows.force), dtype=float)
    ends = [_far(rows, clock, branch, span) for branch in (slice(0, turn + 1), slice(turn, None))]
    known = [end for end in ends if end is not None]
    if not known:
        outer = float(rows.force[int(np.argmin(rows.indentation))])
        if abs(outer) > 2.0 * LEVEL * span:
            rows.remarks.append(
                f"{name}: the rows do not show the force far away, as it is not level where they are outermost "
                f"({shown(outer, 'force')}); an offset, or a tilt over the way, would spoil forces and works: look at it, take a "
                "tilt off, or give --baseline"
            )
        return rows.force, ""
    values = [force for _, force in known]
    if max(map(abs, values)) <= ZERO * span:
        return rows.force, ""
    change = abs(values[1] - values[0]) if len(known) == 2 else 0.0
    if change > DRIFT * span:
        rows.remarks.append(
            f"{name}: the force far away is not known: it is {shown(values[0], 'force')} before the contact and "
            f"{shown(values[1], 'force')} at the end, too different for a drift; if the punch still sticks at the end, give the "
            "force before by --baseline"
        )
        return rows.force, ""
    if change > LEVEL * span:
        (first, before), (last, after) = known
        line = before + (after - before) * (clock - first) / (last - first)
        rows.remarks.append(
            f"{name}: the force far away drifts from {shown(before, 'force')} to {shown(after, 'force')}"
        )
        return rows.force - line, f"force far away, {shown(before, 'force')} to {shown(after, 'force')}, taken off"
    offset = float(np.mean(values))
    return rows.force - offset, f"force far away, {shown(offset, 'force', 4)}, taken off"


def _far(rows: Rows, clock: Array, branch: slice, span: float) -> tuple[float, float] | None:
    """Mean time and mean force of the outermost rows of a branch; None if the force is not constant there. span [N]:
    range of all forces."""
    depth, force = rows.indentation[branch], rows.force[branch]
    place = (depth - np.min(depth)) / max(float(np.ptp(depth)), np.finfo(float).tiny)
    for share in FAR:
        outer, inner = place <= share, (place > share) & (place <= 2.0 * share)
        if min(outer.sum(), inner.sum()) < LEAST_OUTSIDE:
            continue
        # With a contact of constant stiffness, the change would be ten times as large.
        if abs(np.mean(force[outer]) - np.mean(force[inner])) <= LEVEL * span * share / FAR[0]:
            both = outer | inner
            return float(np.mean(clock[branch][both])), float(np.mean(force[both]))
    return None


def _refuse_jumps(rows: Rows) -> None:
    """Raises MeasurementError where the punch seems to jump back: two branches, both sorted by position."""
    steps = np.diff(rows.indentation)
    stroke = float(np.ptp(rows.indentation))
    at = int(np.argmax(np.abs(steps)))
    if len(steps) > 2 * LEAST_ROWS and abs(steps[at]) > JUMP * stroke:
        raise MeasurementError(
            f"{rows.path}, line {rows.lines[at + 1]}: expected rows in the order in which they were measured, but from line "
            f"{rows.lines[at]} on the punch jumps by {shown(float(abs(steps[at])), 'length')}; are approach and retraction "
            "each sorted by position? turn the rows of one branch round, so that the punch goes in and then out"
        )


def _cycles(indentation: Array) -> list[slice]:
    """The rows of each cycle, from one outermost position of the punch to the next."""
    turns = _turning_points(indentation, LEAST_SWING * float(np.ptp(indentation)))
    deep = [row for number, row in enumerate(turns) if _is_peak(indentation, turns, number)]
    shallow = [row for row in turns if row not in deep]
    edges = [next(row for row in shallow if deep[n] < row < deep[n + 1]) for n in range(len(deep) - 1)]
    starts, stops = [0, *edges], [*(edge + 1 for edge in edges), len(indentation)]
    return [slice(start, stop) for start, stop in zip(starts, stops, strict=True)]


def _is_peak(values: Array, turns: list[int], number: int) -> bool:
    others = [turns[other] for other in (number - 1, number + 1) if 0 <= other < len(turns)]
    return all(values[turns[number]] > values[other] for other in others)


def _turning_points(values: Array, least: float) -> list[int]:
    """Rows of the extremes between which values change by at least this much, with the first and the last row."""
    low = high = 0
    turns: list[int] = []
    rising: bool | None = None
    for row, value in enumerate(values.tolist()):
        if value > values[high] or (rising is True and value == values[high]):
            high = row
        if value < values[low]:
            low = row
        if rising is not False and values[high] - value >= least:
            turns.append(high)
            rising, low = False, row
        elif rising is not True and value - values[low] >= least:
            turns.append(low)
            rising, high = True, row
    return [*turns, high if rising else low]


def _joule(work: float) -> str:
    return f"{1e9 * work:.3g} nJ"
