"""The results of a run in memory: rows of tables, and snapshots, without a folder."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from pgfmd.files.fields_layout import BLOCK_FIELDS, SNAPSHOT_NUMBERS
from pgfmd.files.tables import CURVE, ENERGY, EVENTS, Table
from pgfmd.physics.drive import STEP_END
from pgfmd.results.curve import Loop
from pgfmd.solver.grid import PunchPoints
from pgfmd.solver.simulation import Event, Observer, Simulation

from .observers import curve_row, energy_row, event_row

CODES = {float: "d", int: "q"}
"""Types of arrays, by the kind of a column. Texts are kept in a list."""
Given = np.ndarray | Callable[[], np.ndarray]
STEPS = ("start", "step", "jump")
"""Kinds of events that are ends of steps."""


class Rows:
    """Rows of a table (files/tables.py), stored by columns with eight bytes per entry, because explicit schemes have
    millions of rows."""

    def __init__(self, table: Table):
        self.table = table
        self._columns: dict[str, Any] = {
            each.name: array(CODES[each.kind]) if each.kind in CODES else [] for each in table.columns
        }

    def append(self, row: Any) -> None:
        """Adds a row."""
        for name, column in self._columns.items():
            column.append(getattr(row, name))

    def column(self, name: str) -> np.ndarray:
        """A field of all rows, (rows,): floats, integers, or texts as objects."""
        column = self._columns[name]
        return np.array(column, dtype=object if isinstance(column, list) else None)

    def columns(self) -> dict[str, np.ndarray]:
        """All columns, (rows,) each, by their name in the header."""
        return {each.title: self.column(each.name) for each in self.table.columns}

    def __len__(self) -> int:
        return len(next(iter(self._columns.values())))


class Recorder(Observer):
    """Keeps a row of the curve, and with the audit one of the energies, for each step, and a row for each event.

    measure: a function of the simulation; its values at the ends of steps are kept in the list `measured`, one for each
    row of the curve.
    """

    def __init__(self, measure: Callable[[Simulation], Any] | None = None) -> None:
        self.curve, self.energy, self.events = Rows(CURVE), Rows(ENERGY), Rows(EVENTS)
        self.measured: list[Any] = []
        self._measure, self._released = measure, array("d")
        self._jump = array("b")

    def observe(self, simulation: Simulation, event: Event) -> None:
        if event.kind in STEPS:
            self.curve.append(curve_row(simulation))
            self._jump.append(event.kind == "jump")
            self._released.append(event.released)
            if self._measure:
                self.measured.append(self._measure(simulation))
            if simulation.scheme.audit:
                self.energy.append(energy_row(simulation))
        if event.kind in ("jump", "preload", STEP_END, "end"):
            self.events.append(event_row(simulation, event))

    @property
    def jump(self) -> np.ndarray:
        """Which rows of the curve are the ends of jumps, (rows,)."""
        return np.array(self._jump, bool)

    @property
    def released(self) -> np.ndarray:
        """Energy [J] released in the step of each row of the curve, (rows,)."""
        return np.array(self._released)

    def rows(self, *names: str) -> np.ndarray:
        """Fields of the curve's rows that are numbers, (rows, names)."""
        return np.stack([self.curve.column(name) for name in names], axis=1)

    def loop(self, simulation: Simulation, name: str = "") -> Loop:
        """The loop so far, with the works and the pull-off force integrated by the run."""
        state = simulation.state
        columns = ("time", "displacement", "force", "contact_area", "u_inf", "phase")
        time, displacement, force, area, u_inf, phase = (self.curve.column(each) for each in columns)
        return Loop(
            name, time, displacement, force, area, u_inf, phase, self.jump, work=state.energies.work,
            separation=state.energies.work_of_separation, recorded={"pull_off_force_N": -state.pull_off_force},
        )  # fmt: skip


class FieldsInMemory(Mapping):
    """Snapshots in memory, with the names and axes of `fields.h5`: arrays (snapshots, y, x), NaN outside of the punch.

    points: PunchPoints of the whole punch. Every rank has all rows.
    """

    def __init__(self, points: PunchPoints):
        self._comm = points.comm
        place = points.grid.coordinate(points.block_start + np.arange(points.nb))
        self._axes = {"x": place, "y": place}
        self._numbers: dict[str, list] = {name: [] for name in ("label", *SNAPSHOT_NUMBERS)}
        self._arrays: dict[str, list[np.ndarray]] = {name: [] for name in BLOCK_FIELDS}
        self.units = {name: about[0] for name, about in {**SNAPSHOT_NUMBERS, **BLOCK_FIELDS}.items()}
        self.units |= dict.fromkeys(self._axes, "m")

    @property
    def frames(self) -> int:
        """How many snapshots there are."""
        return len(self._numbers["label"])

    def append(
        self, label: str, time: float, punch_position: float, force: float, gap: Given, traction: Given,
        displacement: Given, surface: tuple[np.ndarray, int] | None = None,
    ) -> None:  # fmt: skip
        """Adds a snapshot, given as this rank's rows or as functions that return them. Collective."""
        for name, value in zip(self._numbers, (label, time, punch_position, force), strict=True):
            self._numbers[name].append(value)
        for name, given in zip(self._arrays, (gap, traction, displacement), strict=True):
            rows = given() if callable(given) else given
            whole = rows if self._comm.size == 1 else np.concatenate(self._comm.allgather(rows))
            self._arrays[name].append(whole)

    def __getitem__(self, name: str) -> np.ndarray:
        if name in self._axes:
            return self._axes[name]
        if name == "snapshot":
            return np.arange(self.frames)
        if name == "label":
            return np.array(self._numbers[name], dtype=object)
        found: Any = {**self._numbers, **self._arrays}[name]
        return np.array(found)

    def __iter__(self) -> Iterator[str]:
        return iter(("snapshot", *self._numbers, *self._axes, *self._arrays))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def close(self) -> None:
        """Does nothing, because no file is open."""
