"""Runs the coarse approaches that place snapshots before the preload (run_ahead.py)."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

from pgfmd.assemble import assemble
from pgfmd.errors import RunError
from pgfmd.forecast.effort import ahead_summary
from pgfmd.run_ahead import Met, coarse_scenes, met_by, moments
from pgfmd.scene_objects import shared_out
from pgfmd.solver.interruption import Interrupted
from pgfmd.solver.node import Node
from pgfmd.symmetry import points_of

from .observers import Progress

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.scene import Scene
    from pgfmd.solver.interruption import StopCondition
    from pgfmd.solver.simulation import Simulation


def run_ahead(
    scene: Scene, comm: Intracomm, say: Callable[[str], None], stop: StopCondition | None = None
) -> list[tuple[float, str]]:
    """Times [s] and labels of snapshots within the approach, at fractions of t_pl below 1.

    The duration of the approach is only known at its end, so coarse approaches are run first to estimate it. Without
    such snapshots nothing is run. stop: as in Outputs.plan_snapshots. Collective. Raises Interrupted if the run has to
    stop in the meantime.
    """
    coarse = coarse_scenes(scene)
    if not coarse:
        return []
    tell = say if comm.rank == 0 else (lambda line: None)
    if comm.rank == 0:
        tell(f"run ahead to place the snapshots before the preload: about {', '.join(ahead_summary(scene))}")
    began = time.perf_counter()
    found, pairs = _shared(coarse, comm, say, stop)
    if len(found) < len(coarse):
        tell("the coarse approach has not met the preload: no snapshots before it")
        return []
    times = moments(scene, met_by(scene, found))
    when = ", ".join(f"{label} at t = {instant:.6g} s" for instant, label in times)
    tell(f"run ahead: {pairs} transform pairs, {time.perf_counter() - began:.2g} s; {when}")
    return times


def _shared(
    coarse: list, comm: Intracomm, say: Callable[[str], None], stop: StopCondition | None
) -> tuple[list[Met], int]:
    """The result of `_run`, on every rank. Only ranks for which the coarse grids have rows and columns compute it."""
    most = min(_most_ranks(one) for one in coarse)
    if comm.size <= most:
        found = _run(coarse, comm, say, stop)
        if comm.size > 1:
            # The run does not need their shared memory.
            gc.collect()
            Node.of(comm).trim()
        return found
    some = cast("Intracomm", comm.Split(0 if comm.rank < most else 1, comm.rank))
    outcome: tuple[list[Met], int] | Exception | None = None
    try:
        if comm.rank < most:
            outcome = _run(coarse, some, say, stop)
    except (Interrupted, RunError) as error:
        # Without its traceback, whose frames would keep the simulation in memory.
        outcome = error.with_traceback(None)
    finally:
        Node.leave(some)
        some.Free()
    shared: tuple[list[Met], int] | Exception = comm.bcast(outcome, 0)
    if isinstance(shared, Exception):
        raise shared
    return shared


def _most_ranks(scene: Scene) -> int:
    """Number of ranks that can each have a pair of rows and a column of a scene's transforms."""
    return min(shared_out(scene, points_of(scene, "").nb))


def _run(
    coarse: list, comm: Intracomm, say: Callable[[str], None], stop: StopCondition | None
) -> tuple[list[Met], int]:
    """First contact and preload of the coarse approaches, up to the first that met neither, and their transform
    pairs."""
    heed: dict[str, Any] = {}
    if stop:
        # Some ranks may not be here, so that `stop.has_to_stop`, which asks all ranks, can't be used.
        heed = {"attend": lambda _: any(comm.allgather(stop.interrupts())), "interrupt": stop.interrupts}
    found: list[Met] = []
    pairs = 0
    for one in coarse:
        simulation = assemble(one, comm)
        simulation.observers.append(Progress(comm, lambda line: say(f"ahead: {line}")))
        state = simulation.run(only_to_preload=True, **heed)
        if state.preload_time is None and not state.finished:
            raise Interrupted
        pairs += simulation.scheme.pairs
        if state.preload_time is None:
            break
        found.append(met(simulation))
    return found, pairs


def met(simulation: Simulation) -> Met:
    """Position of the machine at the first contact and at the preload, for a simulation that has met both."""
    state, drive = simulation.state, simulation.drive
    first = state.first_contact_time if state.first_contact_time is not None else 0.0
    speed = drive.phases[0].fastest
    assert state.preload_time is not None, "asked for without a preload"
    contact, preload = (drive.clearance - speed * time for time in (first, state.preload_time))
    return Met(simulation.scheme.law.range, contact, preload)
