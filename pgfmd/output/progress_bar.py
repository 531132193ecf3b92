"""The progress of a run on a terminal: a bar with rate and time left, below the lines that a run says."""

from __future__ import annotations

import os
import sys
import time
from collections import deque
from typing import TYPE_CHECKING, Any, Self

from pgfmd.files.table_reading import RISE
from pgfmd.forecast.progress import Moment, Outlook, outlook
from pgfmd.host.launchers import is_launched
from pgfmd.host.streams import say
from pgfmd.solver.simulation import Observer

from .observers import progress_line

if TYPE_CHECKING:
    from pgfmd.scene import Scene
    from pgfmd.solver.simulation import Event, Simulation

EVERY = 0.5
"""Least time [s] between two drawings."""
PATIENCE = 50.0
"""Least time between two estimates of what is left, in times that one of them takes: so they cost 2 % of the run."""
SPAN = 10.0
"""Time [s] over which the rate is averaged."""
ROWS = 512
"""Steps of the approach that are kept for the slope of the force."""


def is_wanted() -> bool:
    """Whether standard output is a terminal that can draw a bar.

    Not under a launcher: some give each rank a terminal of its own, also where what it prints goes to a file.
    """
    return sys.stdout.isatty() and os.environ.get("TERM", "dumb") not in ("dumb", "unknown") and not is_launched()


class ProgressBar(Observer):
    """The bar of one run; within `with`, `say` prints lines above it. Serial."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

        # Its own thread would take turns with the kernels; and messages on stderr stay there.
        self.bar = Progress(
            TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TextColumn("{task.fields[told]}"),
            console=Console(highlight=False), auto_refresh=False, transient=True, redirect_stdout=False,
            redirect_stderr=False,
        )  # fmt: skip
        self.task = self.bar.add_task("starts", total=None, told="")
        self.scene: Scene | None = None
        self.last, self.shown = 0.0, False
        self.marks: deque[tuple[float, int]] = deque()
        self.approach: deque[tuple[float, float]] = deque(maxlen=ROWS)
        self.dwell_steps = 0
        self.ahead, self.asked, self.next = Outlook(), 0, 0.0

    def __enter__(self) -> Self:
        self.bar.start()
        self.shown = True
        return self

    def __exit__(self, *_: object) -> None:
        self.hide()

    def hide(self) -> None:
        """Takes the bar away. Never raises."""
        if self.shown:
            self.shown = False
            try:
                self.bar.stop()
            except (OSError, ValueError):
                # The terminal is gone: what is said next finds that out.
                return

    def say(self, line: str) -> None:
        """A line above the bar, as `streams.say` prints it."""
        if not self.shown:
            say(line)
            return
        try:
            self.bar.console.print(line, markup=False, soft_wrap=True)
            self.bar.refresh()
        except (OSError, ValueError):
            self.hide()
            say(line)

    def of(self, scene: Scene) -> ProgressBar:
        """The observer of a run of this scene."""
        self.scene = scene
        return self

    def observe(self, simulation: Simulation, event: Event) -> None:
        state, now = simulation.state, time.monotonic()
        if event.kind == "step":
            if simulation.phase.name == "approach":
                self.approach.append((simulation.punch_position, state.force))
            self.dwell_steps += simulation.phase.name == "dwell"
        if now - self.last < EVERY and event.kind not in ("preload", "end"):
            return
        self.last = now
        rate = self._rate(now, state.counters.steps)
        if event.kind in ("preload", "end"):
            self.say(progress_line(simulation, event, rate or 0.0))
        if self.shown and event.kind != "end":
            self._draw(simulation, rate)

    def _rate(self, now: float, steps: int) -> float | None:
        """Steps per second of late; None at first."""
        self.marks.append((now, steps))
        while len(self.marks) > 2 and now - self.marks[1][0] >= SPAN:
            self.marks.popleft()
        since, before = self.marks[0]
        return (steps - before) / (now - since) if steps > before and now > since else None

    def _draw(self, simulation: Simulation, rate: float | None) -> None:
        state, ahead = simulation.state, self._outlook(simulation)
        told = [f"F {1e3 * state.force + 0.0:.3f} mN", f"{state.counters.steps} steps"]
        if rate:
            told.append(f"{rate:.1f}/s")
            if ahead.steps is not None:
                left = max(ahead.steps - (state.counters.steps - self.asked), 0.0) / rate
                told.append(f"about {_clock(left)} left{f' {ahead.remark}' if ahead.remark else ''}")
            elif ahead.remark:
                told.append(ahead.remark)
        fields: dict[str, Any] = {"description": _where(simulation), "told": "  ".join(told)}
        if ahead.progress is not None:
            fields |= {"total": 1.0, "completed": ahead.progress}
        try:
            self.bar.update(self.task, refresh=True, **fields)
        except (OSError, ValueError):
            self.hide()

    def _outlook(self, simulation: Simulation) -> Outlook:
        """The estimate of what is left, as it was when `asked` steps had been made."""
        assert self.scene is not None, "`of` comes first"
        began = time.monotonic()
        if began < self.next:
            return self.ahead
        state, met = simulation.state, simulation.state.preload_time is not None
        self.ahead = outlook(self.scene, Moment(
            simulation.phase.name, state.time, simulation.punch_position, state.force, state.last_step,
            state.counters.steps, stiffness=self._stiffness(), dwell_steps=self.dwell_steps,
            preload_time=state.preload_time, depth=-state.preload_displacement if met else None,
            cycle=simulation.phase.cycle, stage=simulation.phase.stage,
        ))  # fmt: skip
        self.asked, now = state.counters.steps, time.monotonic()
        self.next = now + PATIENCE * (now - began)
        return self.ahead

    def _stiffness(self) -> float | None:
        """Slope [N/m] of the force over the indentation at the end of the approach, as `CurveTail.stiffness`."""
        if not self.approach or self.approach[-1][1] <= 0.0:
            return None
        place, force = self.approach[-1]
        before = next((row for row in reversed(self.approach) if row[1] <= RISE * force), self.approach[0])
        way = before[0] - place
        return (force - before[1]) / way if way > 0.0 and force > before[1] else None


def _where(simulation: Simulation) -> str:
    """The phase, and in a programme with repeats the cycle."""
    phase = simulation.phase
    return f"{phase.cycle} {phase.name}" if simulation.has_cycles else phase.name


def _clock(seconds: float) -> str:
    """A time as h:mm:ss."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"
