"""A whole run: from a scene to a folder of results."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from .assemble import assemble
from .errors import PgfmdError, ResultError, RunError, Stopped
from .files import storage
from .files.fields_layout import Layout
from .files.packing import arrays_of, unpack
from .files.regular_files import remove_unfinished, write_atomically
from .files.table_reading import count_ends
from .files.tables import CURVE
from .forecast import map_advice
from .forecast.advice import warnings
from .host import launch
from .host.run_lock import RunLock
from .host.stop_signals import StopSignals
from .output.outputs import Outputs
from .output.record import record_of, versions
from .physics.adhesion.registry import DEFAULT_LAW, LAWS
from .physics.heightfile import forget
from .restart import resume
from .restart.checkpoint_policy import CheckpointPolicy, Timing
from .restart.checkpoints import Checkpoints
from .restart.history import History
from .restart.scene_changes import contents_of, review
from .scene import load_scene
from .scene.fields import toml_text
from .schemes import registry
from .solver import compiled
from .solver.interruption import Interrupted
from .solver.node import Node
from .solver.simulation import STOPPED_STEPS

if TYPE_CHECKING:
    import numpy as np
    from mpi4py.MPI import Intracomm

    from .scene import Scene
    from .solver.simulation import Observer, Simulation

LEAST_STEPS = 2
"""Steps that a process must have made before its limit of time to call that progress."""
LINES_OF_START = 2
"""Lines of a curve whose run has not made a step: such a curve is replaced (resume.plan)."""


@dataclass(frozen=True)
class Options:
    """How a run deals with what is in its folder, and with limits of time.

    fresh: begin anew, and keep the old results aside. allow: keys of the scene, or sections, that may have changed
    since the run began. timing: of checkpoints (restart.checkpoint_policy.Timing). progress: an observer of a scene that
    shows how far the run is, on rank 0, instead of the lines that are said every few seconds (output.progress_bar).
    """

    fresh: bool = False
    allow: tuple[str, ...] = ()
    timing: Timing = field(default_factory=Timing)
    progress: Callable[[Scene], Observer] | None = None


def run_scene(
    scene: Scene,
    comm: Intracomm,
    directory: str | Path,
    say: Callable[[str], None] = print,
    options: Options = Options(),
) -> dict:
    """Runs a scene on a communicator and writes its results into `directory`, or goes on with the run that is there;
    returns the record that is in `run.json`.

    say: called on rank 0 with lines of progress. Collective. Raises SceneError and ResultError before any field is
    allocated, RunError when a step can't be solved, Stopped when a signal or a limit of time came first: what was
    written before stays, and is valid.
    """
    began = time.perf_counter()
    folder = Path(directory)
    lock = storage.on_root(comm, f"{folder}: can't be used as a results folder", lambda: _enter(folder, comm.size, say))
    try:
        plan = launch.on_first(comm, lambda: _planned(folder, scene, options))
        if comm.rank == 0:
            for line in plan.messages:
                say(line)
        if plan.record:
            if comm.rank == 0:
                say(f"{folder}: this run is finished ({plan.record['finished']}); --fresh starts it anew")
            return plan.record
        if not plan.go_on:
            storage.on_root(comm, "the scene", lambda: _warn(scene, comm.size, say))
        return _run(plan.scene_of(scene), comm, folder, say, options, plan, began, lock)
    finally:
        if lock:
            lock.release()


def _warn(scene: Scene, ranks: int, say: Callable[[str], None]) -> None:
    for text in map_advice.head(scene):
        say(text)
    for text in warnings(scene, ranks):
        say(f"warning: {text}")


def _enter(folder: Path, ranks: int, say: Callable[[str], None]) -> RunLock:
    storage.make_directory(folder)
    lock = RunLock.acquire(folder, ranks)
    if lock.recovered:
        say(lock.recovered)
    remove_unfinished(folder, set(storage.RESULTS) - {storage.ANALYSIS_FILE})
    return lock


def _planned(folder: Path, scene: Scene, options: Options) -> resume.Plan:
    def plan() -> resume.Plan:
        if not options.fresh:
            storage.require_regular_files(folder)
            _require_own(folder)
        return resume.plan(folder, scene, options.fresh, options.allow)

    found, error = storage.attempt(f"{folder}: can't be used as a results folder", plan)
    if error is not None or found is None:
        raise error or AssertionError("a plan is a plan")
    return found


def _require_own(folder: Path) -> None:
    """ResultError if a file in the folder has the name of a run's, but was not written by one."""
    # Raises where the record is none of ours.
    resume.finished_record(folder)
    curve = folder / storage.CURVE_FILE
    headers = [header.encode() for header in CURVE.headers]
    if curve.exists() and count_ends(curve) <= LINES_OF_START:
        with open(curve, "rb") as file:
            start = file.read(max(map(len, headers)))
        # A run that was killed at its very beginning may have written a part of it.
        if not any(header.startswith(start[: len(header)]) for header in headers):
            raise ResultError(
                f"{curve}: not written by a run, it does not begin with the columns of one. Choose another --out, or "
                "start with --fresh, which keeps it"
            )


def _run(
    scene: Scene,
    comm: Intracomm,
    folder: Path,
    say: Callable[[str], None],
    options: Options,
    plan: resume.Plan,
    began: float,
    lock: RunLock | None,
) -> dict:
    """From the first step, or from a checkpoint, to the end. lock: rank 0's."""
    guard = lock.require_held if lock else lambda: None
    compiled.hear(say if comm.rank == 0 else None)
    compile_kernels(comm, scene)
    simulation = assemble(scene, comm, plan.mirror)
    expected = _require_space(simulation, scene, comm, folder)
    text = scene.to_toml().encode()
    history = History(comm.size, versions(), began)
    progress = options.progress(scene) if options.progress and comm.rank == 0 else None
    outputs = Outputs(simulation, scene, comm, folder, say, guard, progress)
    try:
        with StopSignals(comm) as signals:
            files = storage.on_root(comm, "the scene's files", lambda: contents_of(scene))
            about = {
                "pgfmd": history.now.versions["pgfmd"], "scene": text.decode(), "files": files,
                "mirror": simulation.points.mirror,
            }  # fmt: skip
            checkpoints = Checkpoints(folder, comm, guard)
            policy = CheckpointPolicy(
                comm, checkpoints, outputs, signals, options.timing, about, history, expected, say
            )
            if plan.go_on:
                _restore(checkpoints, simulation, outputs, history, scene, options.allow, policy)
                policy.go_on(simulation)
            else:
                outputs.plan_snapshots(simulation.state, policy)
            storage.on_root(comm, "the scene", lambda: _write_scene(folder, text, guard))
            _to_the_end(simulation, policy, scene, folder, history)
            marks = outputs.marks()
    except Interrupted:
        raise _stopped_early(policy, folder) from None
    finally:
        outputs.close()
    record = record_of(simulation, scene, comm, history) | {"outputs": marks}
    storage.write_run_json(folder / storage.RUN_FILE, comm, record, guard)
    # What a finished run needs is its last state alone.
    checkpoints.drop_previous()
    return record


def _to_the_end(simulation: Simulation, policy: CheckpointPolicy, scene: Scene, folder: Path, history: History) -> None:
    """Steps, checkpoints, and what is left behind where it ends early."""
    state, comm = simulation.state, policy.comm
    forget()
    try:
        simulation.run(attend=policy.attend, interrupt=policy.interrupts)
    except RunError as error:
        state.finished = resume.FAILED
        record = record_of(simulation, scene, comm, history) | {"error": str(error)}
        storage.write_run_json(folder / storage.RUN_FILE, comm, record, policy.checkpoints.guard)
        raise
    if policy.out_of_time and state.counters.steps - history.now.first_step < LEAST_STEPS:
        # A chain of such links would go on for ever.
        raise RunError(
            f"{policy.why} came after {state.counters.steps - history.now.first_step} steps of this process: allow "
            f"more of it. There is a checkpoint in {folder}, from which the same command goes on"
        )
    if policy.why:
        raise Stopped(
            f"stopped by {policy.why} after step {state.counters.steps} ({simulation.phase.name}, t = {state.time:.6g} "
            f"s), with a checkpoint in {folder}: the same command goes on from there"
        )


def _write_scene(folder: Path, text: bytes, guard: Callable[[], None]) -> None:
    guard()
    write_atomically(folder / storage.SCENE_FILE, text)


def _stopped_early(policy: CheckpointPolicy, folder: Path) -> PgfmdError:
    """The end of a run that had to stop before a step of this process was made. Collective."""
    policy.has_to_stop()
    if policy.out_of_time:
        return RunError(f"{policy.why} came before the first step of this process: allow more of it")
    what = f"stopped by {policy.why} before the first step"
    return Stopped(f"{what}; {folder} is as it was: the same command starts again")


def _restore(
    checkpoints: Checkpoints, simulation: Simulation, outputs: Outputs, history: History, scene: Scene,
    allow: Sequence[str], policy: CheckpointPolicy,
) -> None:  # fmt: skip
    """Puts the simulation and its outputs where a checkpoint left them."""
    comm, state, found = checkpoints.comm, simulation.state, {}

    def apply(head: dict, read: Callable[[str, np.ndarray], None]) -> None:
        found["changed"] = launch.on_first(comm, lambda: review(head, scene, allow, checkpoints.newest.parent))
        found["head"] = head
        unpack(state, head["state"], lambda name, share: read(f"state/{name}", share))
        agenda = head["outputs"]["snapshots"]
        outputs.snapshots.recall(state, agenda, lambda name, share: read(f"snapshots/{name}", share))

    path = checkpoints.restore(apply, policy.say)
    head, changed = found["head"], found["changed"]
    outputs.cut_back(head["outputs"])
    storage.on_root(comm, "the old record", lambda: (path.parent / storage.RUN_FILE).unlink(missing_ok=True))
    history.go_on(head["links"], state.counters.steps, changed)
    if "solver.max_steps" in changed and state.finished == STOPPED_STEPS:
        state.finished = ""
    if any(
        key in ("output.snapshots", "drive.preload") or key.startswith(("drive.step", "drive.repeat"))
        for key in changed
    ):
        outputs.plan_snapshots(state, policy)
    for line in _restart_messages(simulation, path, changed, history) if comm.rank == 0 else []:
        policy.say(line)


def _restart_messages(simulation: Simulation, path: Path, changed: list[str], history: History) -> list[str]:
    """The messages when a run is continued."""
    state = simulation.state
    lines = [f"going on from {path.name}: step {state.counters.steps}, t = {state.time:.6g} s"]
    if changed:
        lines.append(f"changed from here on, as allowed: {', '.join(changed)}")
    others = history.other_versions()
    if others:
        lines.append(
            f"warning: other versions than before ({others}): last digits may differ from an uninterrupted run"
        )
    return lines


def _require_space(simulation: Simulation, scene: Scene, comm: Intracomm, folder: Path) -> int:
    """About how large a checkpoint is going to be [bytes]. ResultError on every rank if the disk has no room for
    checkpoints and snapshots."""
    state, points = simulation.state, simulation.points
    arrays = sum(array.nbytes for array in arrays_of(state).values())
    # Two surfaces and loads of the past, and a surface kept for a snapshot.
    later = (
        2 * (state.surface_displacement.nbytes + state.effective_traction.nbytes)
        + 3 * state.surface_displacement.nbytes
    )
    grid, count = points.grid, 2 + len(scene.output.snapshots)
    if scene.output.rhythms:
        # Not at the top: few scenes ask for regular ones.
        from .forecast.programme import snapshot_count

        count = 2 + snapshot_count(scene)
    checkpoint = comm.allreduce(arrays + later) + (8 * grid.n**2 if scene.output.surface else 0)
    frame = Layout(grid.n, grid.length, points.block_start, points.nb, scene.output.surface).frame_bytes
    storage.on_root(comm, f"{folder}", lambda: storage.require_space(folder, checkpoint, count * frame))
    return checkpoint


def compile_kernels(comm: Intracomm, scene: Scene) -> None:
    """Has one rank a node compile the kernels that the scene needs, by tiny tack tests, while the others wait.

    All ranks would otherwise compile the same at once, and race for numba's cache, which may be on the node's own disk.
    One rank compiles when it gets there, and so do all where the cache has the kernels.
    """
    if comm.size == 1:
        return
    scheme, precision, adhesion = scene.solver.scheme, scene.solver.precision, scene.adhesion
    node = Node.of(comm)
    if node.local.rank == 0 and not compiled.is_kept(f"{scheme}-{precision}-{adhesion.law}"):
        asked = LAWS[adhesion.law].required - {"work_of_adhesion"}
        warm_up(scheme, precision, adhesion.law, tuple((name, getattr(adhesion, name)) for name in sorted(asked)))
    node.local.Barrier()


@functools.cache
def warm_up(
    scheme: str = registry.DEFAULT,
    precision: str = "double",
    law: str = DEFAULT_LAW,
    keys: tuple[tuple[str, str], ...] = (),
) -> None:
    """Runs tiny tack tests that use every kernel of a scheme with a law of adhesion, so that numba has them in its cache. Once
    a process. keys: what the law asks for, texts by the names of keys of [adhesion]."""
    from mpi4py import MPI

    common = [f"solver.scheme={scheme}", f"solver.precision={precision}", "grid.n=20", "drive.preload=1 mN"]
    common += [f"adhesion.law={law}", *(f"adhesion.{name}={toml_text(text)}" for name, text in keys)]
    for changes in registry.named(scheme).scenes_to_warm_up(precision):
        assemble(load_scene("tri-tack", [*common, *changes]), MPI.COMM_SELF).run()
    compiled.remember(f"{scheme}-{precision}-{law}")
