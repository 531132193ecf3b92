"""What a scheme can do and needs, as plain data, and where its code is. Nothing of that code is loaded for it.

Whoever asks about a scheme asks its entry: the reader of scenes, `pgfmd check` and `status`, forecasts, results. So the
entry states abilities, and reasons as texts for messages; what has to be computed is named as "module:function", and is
imported when it is called for.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.errors import Problem
    from pgfmd.forecast.effort import Effort
    from pgfmd.forecast.estimate import Memory
    from pgfmd.forecast.progress import Moment, Way
    from pgfmd.scene import Scene

    from .base import Scheme, StepController

PRECISIONS = ("double", "mixed", "single")
Overrides = list[str]
"""Keys of a scene with other values, as the command line takes them: "grid.n=20"."""


@dataclass(frozen=True, kw_only=True)
class SchemeEntry:
    """A scheme as the rest of pgfmd knows it.

    name: as in `solver.scheme`; meaning: what it is, in a few words, for the reference page.

    explicit: its steps have a known length, and solve nothing.
    whole_plane: its transforms have all rows of the cell, which the ranks share out one by one, not in pairs.
    timeless: time only counts how far the machine has gone; nothing relaxes, and nothing is held.
    inertia: an elastic surface dissipates, too.
    jumps: the surface may jump within a step; jumps are found and noted.
    has_machine: knows a machine with a spring, and loads that are controlled. has_modulus: reads `solver.modulus`.
    section: of the scene that it alone reads, empty for none.
    precisions: those it has. only_double: why `auto` means double precision, empty where it may mean a mixed one.
    periodic_only: why it can't have a free surface, empty where it can.
    whole_only: why mirror images can't be left out, empty where they can.
    coarse_grid: whether conjugate gradients may use a coarser grid.
    ahead: the scheme that runs coarse approaches ahead of it, by default itself.
    unread: keys of scenes that it has no use for, each with the reason. `solver.accuracy` and `solver.order` among them
    tell that its steps follow no accuracy, and have one order.

    References, "module:function": build makes scheme and controller; memory, effort and steps_left foretell what a run costs;
    numerics is what the record says of the steps; warm_up the scenes that use every kernel. These can be left out: problems
    of a scene that only its files tell, lines of `pgfmd check` about the rheology, remarks.
    """

    name: str
    meaning: str
    build: str
    memory: str
    warm_up: str
    explicit: bool = False
    whole_plane: bool = False
    timeless: bool = False
    inertia: bool = False
    jumps: bool = True
    has_machine: bool = False
    has_modulus: bool = False
    section: str = ""
    precisions: tuple[str, ...] = PRECISIONS
    only_double: str = ""
    periodic_only: str = ""
    whole_only: str = ""
    coarse_grid: bool = False
    ahead: str = ""
    unread: Mapping[str, str] = field(default_factory=dict)
    effort: str = "pgfmd.forecast.effort:fitted_effort"
    steps_left: str = "pgfmd.forecast.progress:steps_by_way"
    numerics: str = "pgfmd.output.record:accuracy_and_order"
    problems: str = ""
    lines: str = ""
    remarks: str = ""

    @property
    def has_accuracy(self) -> bool:
        """Whether its steps follow `solver.accuracy`."""
        return "solver.accuracy" not in self.unread

    @property
    def has_orders(self) -> bool:
        """Whether its steps are of `solver.order`."""
        return "solver.order" not in self.unread

    def new(self, scene: Scene, comm: Intracomm, mirror: str) -> tuple[Scheme, StepController]:
        """Scheme and controller of a scene; mirror: the axes whose mirror images are not stepped. Collective."""
        return _load(self.build)(scene, comm, mirror)

    def memory_of(self, scene: Scene, ranks: int) -> Memory:
        """Memory of the rank with the largest share, out of `ranks`."""
        return _load(self.memory)(scene, ranks)

    def effort_of(self, scene: Scene) -> Effort:
        """Expected steps and transform pairs of a run."""
        return _load(self.effort)(scene)

    def steps_left_of(self, scene: Scene, moment: Moment, way: Way) -> tuple[float, str]:
        """About how many steps are left of a run, from where it is, and what they leave out."""
        return _load(self.steps_left)(scene, moment, way)

    def numerics_of(self, scene: Scene) -> dict[str, float]:
        """What `run.json` tells of how steps were made."""
        return _load(self.numerics)(scene)

    def scenes_to_warm_up(self, precision: str) -> Iterable[Overrides]:
        """Changes of a small scene, several of them, whose runs together use every kernel in this precision."""
        return _load(self.warm_up)(precision)

    def problems_of(self, scene: Scene) -> list[Problem]:
        """Why the scheme can't step this scene, whose files are there."""
        return _load(self.problems)(scene) if self.problems else []

    def lines_of(self, scene: Scene) -> Iterator[tuple[str, float, str, str]]:
        """What `pgfmd check` tells of the scheme beside the rheology: name, value, unit, note."""
        return _load(self.lines)(scene) if self.lines else iter(())

    def remarks_on(self, scene: Scene) -> Iterator[str]:
        """What is good to know before a scene is run by this scheme."""
        return _load(self.remarks)(scene) if self.remarks else iter(())


def _load(reference: str) -> Callable[..., Any]:
    """The function that "module:function" names."""
    module, _, name = reference.partition(":")
    return getattr(importlib.import_module(module), name)
