"""The entry of a scheme: its capabilities and needs as plain data, and the names of its functions.

The reader of scenes, `pgfmd check` and `status`, forecasts and results use the entry without loading the scheme's code.
So the entry states capabilities, and reasons as texts for messages. Functions are named as "module:function" and are
imported when they are called.
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
    from pgfmd.forecast.progress import Moment, TravelProgress
    from pgfmd.scene import Scene

    from .base import Scheme, StepController

PRECISIONS = ("double", "mixed", "single")
Overrides = list[str]
"""Changes of keys of a scene, in the form of the command line: "grid.n=20"."""


@dataclass(frozen=True, kw_only=True)
class SchemeEntry:
    """The description of a scheme for the rest of pgfmd.

    name: as in `solver.scheme`; meaning: what it is, in a few words, for the reference page.

    explicit: steps have a known length and need no solver.
    whole_plane: transforms have all rows of the cell, which are distributed over the ranks one by one, not in pairs.
    timeless: time is only a measure of the travel of the machine; there is no relaxation and no dwell.
    inertia: also an elastic surface dissipates energy.
    jumps: the surface may jump within a step; jumps are detected and recorded.
    has_machine: supports a machine with a spring, and a controlled force. has_modulus: reads `solver.modulus`.
    section: of the scene that only this scheme reads, empty for none.
    precisions: the supported ones. precisions_with_spring: those that are enough for a machine with a spring.
    only_double: why `auto` means double precision, empty if it may mean mixed.
    periodic_only: why a free surface is not supported, empty if it is.
    whole_only: why mirror symmetry is not used, empty if it is.
    coarse_grid: whether conjugate gradients may use a coarse grid.
    ahead: the scheme for the coarse approaches before a run, by default itself.
    unread: keys of scenes that are ignored, each with the reason. With `solver.accuracy` or `solver.order` among them,
    steps follow no accuracy, or have a fixed order.

    References, "module:function": build makes scheme and controller; memory, effort and steps_left forecast the cost of
    a run; numerics gives data on the steps for the record; warm_up gives scenes that use every kernel. Optional:
    problems gives problems of a scene that depend on its files; lines gives lines of `pgfmd check` about the rheology;
    remarks.
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
    precisions_with_spring: tuple[str, ...] = PRECISIONS
    only_double: str = ""
    periodic_only: str = ""
    whole_only: str = ""
    coarse_grid: bool = False
    ahead: str = ""
    unread: Mapping[str, str] = field(default_factory=dict)
    effort: str = "pgfmd.forecast.effort:fitted_effort"
    steps_left: str = "pgfmd.forecast.progress:steps_by_travel"
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
        """Whether its steps have the order `solver.order`."""
        return "solver.order" not in self.unread

    def new(self, scene: Scene, comm: Intracomm, mirror: str) -> tuple[Scheme, StepController]:
        """Scheme and controller of a scene; mirror: axes of the mirror symmetry that is used. Collective."""
        found: tuple[Scheme, StepController] = _load(self.build)(scene, comm, mirror)
        return found

    def memory_of(self, scene: Scene, ranks: int) -> Memory:
        """Memory of the rank with the largest share, out of `ranks`."""
        found: Memory = _load(self.memory)(scene, ranks)
        return found

    def effort_of(self, scene: Scene) -> Effort:
        """Expected steps and transform pairs of a run."""
        found: Effort = _load(self.effort)(scene)
        return found

    def steps_left_of(self, scene: Scene, moment: Moment, travel: TravelProgress) -> tuple[float, str]:
        """Estimated number of remaining steps of a run, and what it does not include."""
        found: tuple[float, str] = _load(self.steps_left)(scene, moment, travel)
        return found

    def numerics_of(self, scene: Scene) -> dict[str, float]:
        """Data on the steps for `run.json`."""
        found: dict[str, float] = _load(self.numerics)(scene)
        return found

    def scenes_to_warm_up(self, precision: str) -> Iterable[Overrides]:
        """Several changes of a small scene, whose runs together use every kernel in this precision."""
        found: Iterable[Overrides] = _load(self.warm_up)(precision)
        return found

    def problems_of(self, scene: Scene) -> list[Problem]:
        """Why the scheme can't run this scene, whose files exist."""
        return _load(self.problems)(scene) if self.problems else []

    def lines_of(self, scene: Scene) -> Iterator[tuple[str, float, str, str]]:
        """Lines of `pgfmd check` about the scheme, next to the rheology: name, value, unit, note."""
        return _load(self.lines)(scene) if self.lines else iter(())

    def remarks_on(self, scene: Scene) -> Iterator[str]:
        """Remarks for the user before a scene is run by this scheme."""
        return _load(self.remarks)(scene) if self.remarks else iter(())


def _load(reference: str) -> Callable[..., Any]:
    """The function named by "module:function"."""
    module, _, name = reference.partition(":")
    function: Callable[..., Any] = getattr(importlib.import_module(module), name)
    return function
