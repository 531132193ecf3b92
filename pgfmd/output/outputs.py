"""What a run writes while it goes on: the tables and the snapshots, with the observers that fill them."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pgfmd.assemble import assemble, convolution_of
from pgfmd.files import storage
from pgfmd.files.table_writing import TableFile
from pgfmd.files.tables import CURVE, ENERGY, EVENTS, PATCHES, SITES, Table
from pgfmd.host import launch
from pgfmd.parts import topography_of
from pgfmd.forecast.effort import told_of_ahead
from pgfmd.physics.contact_sites import ContactSites, contact_sites
from pgfmd.run_ahead import Met, coarse_scenes, met_by, moments
from pgfmd.solver.interruption import Interrupted
from pgfmd.solver.sites import SitePoints

from . import observers
from .fields_file import FieldsFile
from .patch_observer import ContactWatch, PatchTable

if TYPE_CHECKING:
    from mpi4py.MPI import Comm

    from pgfmd.restart.keeper import Keeper
    from pgfmd.scene import Scene
    from pgfmd.solver.simulation import Simulation
    from pgfmd.solver.state import State


class Outputs:
    """The open files of a run, and its observers, which are given to the simulation. Collective.

    Files that are there already are continued: cut them back first to what a checkpoint knows, by `cut_back`.
    """

    def __init__(
        self, simulation: Simulation, scene: Scene, comm: Comm, folder: Path, say: Callable[[str], None],
        guard: Callable[[], None] = lambda: None,
    ):  # fmt: skip
        """guard: see FieldsFile."""
        output, points = scene.output, simulation.points.whole
        self.scene, self.comm, self.folder, self.say = scene, comm, folder, say
        self.tables: dict[str, TableFile] = {}
        curve = self._open(CURVE, output.every)
        energy = self._open(ENERGY, output.every) if output.energy else None
        events = self._open(EVENTS)
        self.fields = FieldsFile(
            folder / storage.FIELDS_FILE, comm, points.grid.n, points.grid.length, points.block_start, points.nb,
            points.row_start, points.rows, points.inside(), surface=output.surface, guard=guard,
            told=observers.gaps_of(simulation, scene),
        )  # fmt: skip
        surface = _surface(simulation, scene) if output.surface else None
        watch, table = self._contact_observers(simulation) if output.patches else (None, None)
        self.snapshots = observers.Snapshots(self.fields, [], [], surface, table)
        simulation.observers += [
            observers.Curve(curve, energy),
            *([watch] if watch else []),
            observers.Events(events, watch),
            self.snapshots,
            observers.Progress(comm, say),
        ]

    def _open(self, table: Table, every: int = 1) -> TableFile:
        """A table of the folder, known by its name to checkpoints."""
        self.tables[table.name] = TableFile(table, self.folder / table.file, self.comm, every)
        return self.tables[table.name]

    def _contact_observers(self, simulation: Simulation) -> tuple[ContactWatch, PatchTable]:
        """Who watches the sites and the patches, with their tables."""
        scene, comm, points = self.scene, self.comm, simulation.points
        patches, contacts = self._open(PATCHES), self._open(SITES)
        periodic = scene.punch.radius is None
        sites = launch.on_first(comm, lambda: _sites_of(scene))
        # Explicit steps follow every motion of the surface: they know no jumps.
        jumps = scene.solver.scheme != "gfmd"
        watch = ContactWatch(contacts, points, SitePoints(points, sites), jumps)
        places = watch.places if points.whole is points else SitePoints(points.whole, sites)
        level = simulation.scheme.law.contact_gap
        return watch, PatchTable(patches, points.whole, places, level, periodic)

    def plan_snapshots(self, state: State, keeper: Keeper | None = None) -> None:
        """Has the snapshots taken that the scene asks for, as far as they are still to come.

        That may take long. keeper: who knows whether the run has to stop meanwhile; Interrupted is raised then.
        """
        self.snapshots.replan(state, *snapshots_wanted(self.scene, state, self.comm, self.say, keeper))

    def marks(self) -> dict:
        """What a checkpoint has to know of the files, which are brought to the disk for it. ResultError on every
        rank."""
        return {name: table.mark() for name, table in self.tables.items()} | {"fields": {"frames": self.fields.frames}}

    def cut_back(self, marks: dict) -> None:
        """Takes back what was written after a checkpoint. ResultError on every rank."""
        for name, table in self.tables.items():
            table.cut_back(marks[name])
        self.fields.truncate(marks["fields"]["frames"])

    def close(self) -> None:
        """Closes the files; nothing is lost without it."""
        for table in self.tables.values():
            table.close()


def snapshots_wanted(
    scene: Scene, state: State, comm: Comm, say: Callable[[str], None], keeper: Keeper | None = None
) -> tuple[list[tuple[float, str]], list[float]]:
    """Times [s] with labels of the snapshots that a scene asks for, and fractions of t_pl above 1, whose times are not
    known yet. See `Outputs.plan_snapshots`. Collective."""
    asked = scene.output.snapshot_times
    wanted = [(value, f"t = {value:g} s") for value, relative in asked if not relative]
    fractions = [value for value, relative in asked if relative]
    if state.preload_time is None:
        wanted += _run_ahead(scene, comm, say, keeper)
    return wanted, [value for value in fractions if value > 1.0]


def _run_ahead(
    scene: Scene, comm: Comm, say: Callable[[str], None], keeper: Keeper | None
) -> list[tuple[float, str]]:
    """Times [s] and labels of snapshots within the approach, at fractions of t_pl below 1.

    How long the approach takes is known only at its end, so coarse ones are run ahead (run_ahead.py); what they tell of t_pl
    is good to a few tenths of a percent. Nothing is run where no such snapshot is asked for.
    """
    coarse = coarse_scenes(scene)
    if not coarse:
        return []
    tell = say if comm.rank == 0 else (lambda line: None)
    tell(f"run ahead to place the snapshots before the preload: about {', '.join(told_of_ahead(scene))}")
    heed = {"attend": lambda _: keeper.has_to_stop(), "interrupt": keeper.interrupts} if keeper else {}
    found, pairs, began = [], 0, time.perf_counter()
    for one in coarse:
        ahead = assemble(one, comm)
        ahead.observers.append(observers.Progress(comm, lambda line: say(f"ahead: {line}")))
        state = ahead.run(only_to_preload=True, **heed)
        if state.preload_time is None and not state.finished:
            raise Interrupted
        if state.preload_time is None:
            tell("the coarse approach has not met the preload: no snapshots before it")
            return []
        pairs += ahead.scheme.pairs
        found.append(_met(ahead))
    times = moments(scene, met_by(scene, found))
    when = ", ".join(f"{label} at t = {instant:.6g} s" for instant, label in times)
    tell(f"run ahead: {pairs} transform pairs, {time.perf_counter() - began:.2g} s; {when}")
    return times


def _met(simulation) -> Met:
    """Where the machine of a simulation was at the first contact, and at the preload, which it has met."""
    state, drive = simulation.state, simulation.drive
    first = state.first_contact_time if state.first_contact_time is not None else 0.0
    speed = drive.phases[0].fastest
    contact, preload = (drive.clearance - speed * time for time in (first, state.preload_time))
    return Met(simulation.scheme.law.range, contact, preload)


def _sites_of(scene: Scene) -> ContactSites:
    return contact_sites(topography_of(scene.punch), scene.grid.length)


def _surface(simulation: Simulation, scene: Scene) -> observers.Surface:
    """How this scene's whole surface is had."""
    scheme = simulation.scheme
    if scene.solver.scheme == "gfmd":
        plane = scheme.plane
        return observers.Surface(
            lambda state: plane.real.ravel(), lambda rows: (rows.reshape(plane.real.shape), plane.row_start)
        )
    points = simulation.points
    if scene.substrate.boundary == "periodic" and not points.mirror:
        whole_cell = scheme.solver.convolve.whole_cell
    else:
        # A free surface needs a larger transform of its own, and mirror images one that knows of none.
        def whole_cell(load: np.ndarray) -> tuple[np.ndarray, int]:
            return convolution_of(scene, points.whole, whole_cell=True).whole_cell(points.unfold(load))

    return observers.Surface(lambda state: state.load, whole_cell)
