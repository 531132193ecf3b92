"""The files of a run in progress: tables and snapshots, with the observers that fill them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pgfmd.assemble import convolution_of
from pgfmd.files import storage
from pgfmd.files.table_writing import TableFile
from pgfmd.files.tables import CURVE, ENERGY, EVENTS, PATCHES, SITES, Table
from pgfmd.host import launch
from pgfmd.physics.contact_sites import ContactSites, contact_sites
from pgfmd.scene_objects import topography_of
from pgfmd.schemes import registry
from pgfmd.solver.sites import SitePoints

from . import observers
from .fields_file import FieldsFile
from .patch_observer import ContactWatch, PatchTable
from .snapshot_times import run_ahead

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.scene import Scene
    from pgfmd.scene.output_section import Rhythm
    from pgfmd.solver.interruption import StopCondition
    from pgfmd.solver.simulation import Observer, Simulation
    from pgfmd.solver.state import State


class Outputs:
    """The open files of a run, and the observers that it adds to the simulation. Collective.

    Existing files are continued. First cut them back to the state of the checkpoint, by `cut_back`.
    """

    def __init__(
        self, simulation: Simulation, scene: Scene, comm: Intracomm, folder: Path, say: Callable[[str], None],
        guard: Callable[[], None] = lambda: None, progress: Observer | None = None,
    ):  # fmt: skip
        """guard: see FieldsFile. progress: what shows how far the run is; None for lines that are said."""
        output, points = scene.output, simulation.points.whole
        self.scene, self.comm, self.folder, self.say = scene, comm, folder, say
        self.tables: dict[str, TableFile] = {}
        curve = self._open(CURVE, output.every)
        energy = self._open(ENERGY, output.every) if output.energy else None
        events = self._open(EVENTS)
        self.fields = FieldsFile(
            folder / storage.FIELDS_FILE, comm, points.grid.n, points.grid.length, points.block_start, points.nb,
            points.row_start, points.rows, points.inside(), surface=output.surface, guard=guard,
            extra_attributes=observers.gaps_of(simulation, scene),
        )  # fmt: skip
        surface = _surface(simulation, scene) if output.surface else None
        watch, table = self._contact_observers(simulation) if output.patches else (None, None)
        self.snapshots = observers.Snapshots(self.fields, [], [], surface, table)
        simulation.observers += [
            observers.Curve(curve, energy),
            *([watch] if watch else []),
            observers.Events(events, watch),
            self.snapshots,
            progress or observers.Progress(comm, say),
        ]

    def _open(self, table: Table, every: int = 1) -> TableFile:
        """A table of the folder, known by its name to checkpoints."""
        self.tables[table.name] = TableFile(table, self.folder / table.file, self.comm, every)
        return self.tables[table.name]

    def _contact_observers(self, simulation: Simulation) -> tuple[ContactWatch, PatchTable]:
        """The observers of sites and patches, with their tables."""
        scene, comm, points = self.scene, self.comm, simulation.points
        patches, contacts = self._open(PATCHES), self._open(SITES)
        periodic = scene.punch.radius is None
        sites = launch.on_first(comm, lambda: _sites_of(scene))
        jumps = registry.scheme_of(scene).jumps
        watch = ContactWatch(contacts, points, SitePoints(points, sites), jumps)
        places = watch.places if points.whole is points else SitePoints(points.whole, sites)
        level = simulation.scheme.law.contact_gap
        return watch, PatchTable(patches, points.whole, places, level, periodic)

    def plan_snapshots(self, state: State, stop: StopCondition | None = None) -> None:
        """Plans the snapshots of the scene that are still to be taken.

        This may take long. stop: whether the run has to stop in the meantime; then Interrupted is raised.
        """
        self.snapshots.replan(state, *snapshots_wanted(self.scene, state, self.comm, self.say, stop))

    def marks(self) -> dict:
        """The sizes of the files for a checkpoint, after the files have been written to the disk. ResultError on every
        rank."""
        return {name: table.mark() for name, table in self.tables.items()} | {"fields": {"frames": self.fields.frames}}

    def cut_back(self, marks: dict) -> None:
        """Removes what was written after a checkpoint. ResultError on every rank."""
        for name, table in self.tables.items():
            table.cut_back(marks[name])
        self.fields.truncate(marks["fields"]["frames"])

    def close(self) -> None:
        """Closes the files. Nothing is lost if this is not called."""
        for table in self.tables.values():
            table.close()


def snapshots_wanted(
    scene: Scene, state: State, comm: Intracomm, say: Callable[[str], None], stop: StopCondition | None = None
) -> tuple[list[tuple[float, str]], list[float], list[Rhythm]]:
    """Times [s] with labels of the snapshots that a scene asks for; fractions of t_pl above 1, whose times are not known
    yet; and those at regular distances. See `Outputs.plan_snapshots`. Collective."""
    asked = scene.output.snapshot_times
    wanted = [(value, f"t = {value:g} s") for value, relative in asked if not relative]
    fractions = [value for value, relative in asked if relative]
    if state.preload_time is None:
        wanted += run_ahead(scene, comm, say, stop)
    return wanted, [value for value in fractions if value > 1.0], scene.output.rhythms


def _sites_of(scene: Scene) -> ContactSites:
    return contact_sites(topography_of(scene.punch), scene.grid.length)


def _surface(simulation: Simulation, scene: Scene) -> observers.Surface:
    """How the surface of the whole cell is computed for this scene."""
    scheme, points = simulation.scheme, simulation.points
    if scene.substrate.boundary == "periodic" and not points.mirror:
        return observers.Surface(scheme.surface_of, scheme.whole_cell)

    def whole_cell(effective_traction: np.ndarray) -> tuple[np.ndarray, int]:
        # A free surface needs a larger transform, and a symmetric scene needs one of the whole plane.
        return convolution_of(scene, points.whole, whole_cell=True).whole_cell(points.unfold(effective_traction))

    return observers.Surface(scheme.surface_of, whole_cell)
