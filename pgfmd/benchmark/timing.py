"""Timing of a simulation's transform pairs, and counts of the communication between ranks."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pgfmd.solver.simulation import Simulation

PARTS = ("_rows_forward", "_convolve_columns", "_rows_backward")
"""What an operator does for a pair."""


class Watch:
    """Counts and times what the operators and sums of a simulation do, on this rank.

    clock: of the work in `calls`, without `outside`, what ranks wait for in it; processor time unless told otherwise, which
    other load disturbs less. A pair with all that goes with it is timed in the same way on one rank, and where there are
    others by the time of day.
    """

    def __init__(self, simulation: Simulation, clock: Callable[[], float] = time.process_time):
        self.simulation, self.points, self.work_clock = simulation, simulation.points, clock
        self.clock = clock if self.points.comm.size == 1 else time.perf_counter
        self.outside = 0.0
        self.spent = {"transforms": 0.0, "sums": 0, "reductions": 0}
        # For each operator: in mixed precision there are two.
        self.each: list[dict[str, list[float]]] = []
        solver: Any = simulation.scheme.solver
        for operator in solver.operators:
            calls: dict[str, list[float]] = {name: [] for name in PARTS}
            self.each.append(calls)
            for name, taken in calls.items():
                setattr(operator, name, self._timed(getattr(operator, name), taken))
            transposition = operator._transposition
            transposition.to_columns = self._left_out(transposition.to_columns)
            transposition.to_rows = self._left_out(transposition.to_rows)
        for name, kind in (("all_rows", "sums"), ("maxima_of", "reductions")):
            setattr(self.points, name, self._counted(getattr(self.points, name), kind))

    def now(self) -> dict[str, float]:
        """What there has been so far: counts, and seconds; what ranks of a node have passed to each other."""
        found = {"pairs": self.simulation.scheme.pairs, "pair": self.clock(), **self.spent}
        if self.points.comm.size > 1:
            from pgfmd.solver.node import Node

            node = Node.of(self.points.comm)
            found |= {name: getattr(node, name) for name in ("waited", "meetings", "messages", "sent", "gathers")}
        return found

    @property
    def calls(self) -> dict[str, list[float]]:
        """Seconds of each call, of all operators."""
        return {name: [taken for calls in self.each for taken in calls[name]] for name in PARTS}

    def usual(self) -> dict[str, float]:
        """Seconds of the rows and of the columns of a pair: the median of each operator, which counts as often as it was
        called."""
        total = dict.fromkeys(PARTS, 0.0)
        for calls in self.each:
            for name, taken in calls.items():
                total[name] += len(taken) * statistics.median(taken) if taken else 0.0
        there, columns, back = (total[name] / len(taken) for name, taken in self.calls.items())
        return {"rows": there + back, "columns": columns}

    def _timed(self, action: Callable[..., Any], taken: list[float]) -> Callable[..., Any]:
        def timed(*given: Any) -> Any:
            began, before = self.work_clock(), self.outside
            found = action(*given)
            seconds = self.work_clock() - began - (self.outside - before)
            taken.append(seconds)
            self.spent["transforms"] += seconds
            return found

        return timed

    def _left_out(self, action: Callable[[], None]) -> Callable[[], None]:
        def apart() -> None:
            began = self.work_clock()
            action()
            self.outside += self.work_clock() - began

        return apart

    def _counted(self, action: Callable[..., Any], part: str) -> Callable[..., Any]:
        def counted(*given: Any) -> Any:
            self.spent[part] += 1
            return action(*given)

        return counted
