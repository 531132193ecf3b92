"""Work-precision studies: runs without files, their errors against a reference, and what they have cost.

Cost is counted in transform pairs and in core-seconds: processor time of a run without its set-up, on kernels that are
compiled already, summed over the ranks.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pgfmd.errors import RunError, SceneError
from pgfmd.output.recorder import Recorder
from pgfmd.physics.drive import DETACHED
from pgfmd.results.curve import Loop
from pgfmd.schemes import registry

from .curve_errors import errors

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.scene import Scene

SHORT, COARSE = ("grid.n=32", "solver.max_steps=40"), ("grid.n=32", "solver.accuracy=0.1")
"""What makes a run short that only has to compile the kernels of a scheme: of explicit steps, and of steps with an accuracy."""


@dataclass(frozen=True)
class Outcome:
    """A run: its curve, the preload [N] that it was asked for, what it has cost, how it ended. seconds: of all cores;
    share: of the time outside transforms."""

    curve: Loop
    preload: float
    pairs: int
    steps: int
    refused: int
    iterations: int
    seconds: float
    share: float
    finished: str


class Laboratory:
    """Runs scenes on a communicator, without files; each only once. All ranks call alike.

    base: overrides of every run. Each goes on until the punch is free: gfmd takes millions of steps. A run is named by
    its scene and overrides; `outcome` returns it from memory if it has been made already.
    """

    def __init__(self, comm: Intracomm, base: Sequence[str] = ("output.energy=false", "solver.max_steps=1000000000")):
        self.comm, self.base = comm, tuple(base)
        self._known: dict[tuple[str, ...], Outcome] = {}
        self._warm: set[tuple[str, str]] = set()

    def outcome(self, scene: str, overrides: Sequence[str]) -> Outcome:
        """The run of a shipped scene, or a file. Collective.

        Raises SceneError for what the scene can't be, RunError for a run that did not come to its end.
        """
        from pgfmd.parts import confirm
        from pgfmd.scene import load_scene

        name = (scene, *overrides)
        if name not in self._known:
            loaded = load_scene(scene, [*self.base, *overrides])
            confirm(loaded, scene, self.comm.size)
            self._warm_up(scene, overrides, loaded.solver)
            outcome = run(loaded, self.comm)
            if outcome.finished != DETACHED:
                raise RunError(f"{', '.join(name)}: {outcome.finished}, so that its curve is not whole")
            self._known[name] = outcome
        return self._known[name]

    def _warm_up(self, scene: str, overrides: Sequence[str], solver: Any) -> None:
        """Compiles the kernels that a run needs, or reads them from their cache, before anything is timed."""
        from pgfmd.runner import compile_kernels
        from pgfmd.scene import load_scene

        kind = (solver.scheme, solver.precision)
        if kind not in self._warm:
            compile_kernels(self.comm, load_scene(scene, [*self.base, *overrides]))
            short = COARSE if registry.named(solver.scheme).has_accuracy else SHORT
            run(load_scene(scene, [*self.base, *overrides, *short]), self.comm)
            self._warm.add(kind)


def run(scene: Scene, comm: Intracomm) -> Outcome:
    """Runs a scene on a communicator. Collective; the same on every rank."""
    from pgfmd.assemble import assemble

    simulation, recorder = assemble(scene, comm), Recorder()
    simulation.observers.append(recorder)
    start, wall = time.process_time(), time.perf_counter()
    state = simulation.run()
    spent, wall = time.process_time() - start, time.perf_counter() - wall
    inside = simulation.scheme.transform_seconds
    counters = state.counters
    return Outcome(
        recorder.loop(simulation), scene.drive.preload, simulation.scheme.pairs, counters.steps,
        counters.rejected_steps, counters.newton_iterations,
        sum(comm.allgather(spent)), 1.0 - max(comm.allgather(inside)) / max(comm.allgather(wall)),
        state.finished,
    )  # fmt: skip


@dataclass(frozen=True)
class Setting:
    """A point of a line: overrides of the scene, what varies along the line (`x`), and how to call it."""

    line: str
    label: str
    x: float
    overrides: tuple[str, ...]


def implicit(line: str, accuracies: Iterable[float], *overrides: str) -> list[Setting]:
    """A line of the scheme inertialess over `solver.accuracy`."""
    return [
        Setting(line, f"accuracy {value:g}", value, (f"solver.accuracy={value:g}", *overrides)) for value in accuracies
    ]


def explicit(line: str, omega_taus: Iterable[float], omega_dts: Iterable[float], *overrides: str) -> list[Setting]:
    """A line of the scheme gfmd; omega tau_min and omega dt as multiples of pi, the shorter of the two repeated."""
    omega_taus, omega_dts = list(omega_taus), list(omega_dts)
    count = max(len(omega_taus), len(omega_dts))
    settings = []
    for wt, wd in zip(omega_taus * (count // len(omega_taus)), omega_dts * (count // len(omega_dts)), strict=True):
        keys = (f"solver.gfmd.omega_tau={math.pi * wt!r}", f"solver.gfmd.steps_per_tau={wt / wd!r}")
        label = f"omega tau {wt:g} pi, dt tau/{wt / wd:.4g}"
        settings.append(Setting(line, label, wt / 2.0, ("solver.scheme=gfmd", *keys, *overrides)))
    return settings


@dataclass(frozen=True)
class Row:
    """A measured point: line and setting, errors, cost."""

    line: str
    label: str
    x: float
    force_error: float
    pull_off_error: float
    separation_error: float
    area_error: float
    pairs: int
    steps: int
    refused_steps: int
    newton_iterations: int
    core_seconds: float
    share_outside_transforms: float


def row_of(setting: Setting, outcome: Outcome, reference: Loop) -> Row:
    """The measured point of a run."""
    found = errors(outcome.curve, reference, outcome.preload)
    return Row(
        setting.line, setting.label, setting.x, found.force, found.pull_off, found.separation, found.area,
        outcome.pairs, outcome.steps, outcome.refused, outcome.iterations, outcome.seconds, outcome.share,
    )  # fmt: skip


def study(
    laboratory: Laboratory, scene: str, base: Sequence[str], settings: Iterable[Setting],
    reference: Loop, say: Callable[[str], None],
) -> Iterator[Row]:  # fmt: skip
    """Measures the settings one after another; one that the scene can't have is left out with a remark. Collective."""
    for setting in settings:
        try:
            outcome = laboratory.outcome(scene, [*base, *setting.overrides])
        except SceneError as error:
            say(f"{setting.line}, {setting.label}: left out: {' '.join(str(error).split())}")
            continue
        yield row_of(setting, outcome, reference)
