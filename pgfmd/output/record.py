"""The record of a run, `run.json`: how it ended, its main results, its cost, and the versions used."""

from __future__ import annotations

import importlib.metadata
import math
import platform
import resource
import sys
from typing import TYPE_CHECKING

from pgfmd import __version__
from pgfmd.files.storage import plain
from pgfmd.physics.drive import PRELOAD
from pgfmd.restart.history import History
from pgfmd.results import uncertainty
from pgfmd.schemes import registry
from pgfmd.solver.cycles import numbers_in_record

from . import observers

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.scene import Scene
    from pgfmd.solver.simulation import Simulation
    from pgfmd.solver.state import State

_LIBRARIES = ("numpy", "numba", "mpi4py", "mpi4py-fft", "h5py")


def record_of(simulation: Simulation, scene: Scene, comm: Intracomm, history: History) -> dict:
    """The contents of `run.json` (docs: results). Numbers that do not apply, or are unknown, are None. Collective."""
    state, scheme = simulation.state, simulation.scheme
    counters, energies = state.counters, state.energies
    memory = comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
    links = history.update(counters.steps, max(comm.allgather(scheme.transform_seconds)))
    audit = scene.output.energy and energies.work != 0.0
    record = {
        "finished": state.finished,
        "scheme": scene.solver.scheme,
        "precision": scene.solver.precision,
        **registry.scheme_of(scene).numerics_of(scene),
        "mirror": simulation.points.mirror,
        "ranks": comm.size,
        "n": scene.grid.n,
        "range_m": scene.adhesion.range,
        **observers.gaps_of(simulation, scene),
        "steps": counters.steps,
        "rejected_steps": counters.rejected_steps,
        "newton_iterations": counters.newton_iterations,
        "cg_iterations": counters.cg_iterations,
        "transform_pairs": counters.transform_pairs,
        "jumps": counters.jumps,
        "wall_s": history.total("wall_s"),
        "transform_s": history.total("transform_s"),
        "checkpoint_s": history.total("checkpoint_s"),
        **_forces(simulation, scene),
        **_works(simulation, scene),
        "viscous_J": energies.viscous if scene.output.energy else None,
        "released_J": energies.released,
        "energy_residual": energies.largest_residual / abs(energies.work) if audit else None,
        # Indentation counts from the first touch of the undeformed surface. Readers use this number, because other
        # zeros are possible.
        "indentation_offset_m": 0.0,
        **_cycles(simulation),
        "peak_rss_bytes": memory,
        "versions": history.now.versions,
        "links": links,
    }
    return plain(record)


def accuracy_and_order(scene: Scene) -> dict:
    """Entries for schemes whose steps follow an accuracy."""
    return {"accuracy": scene.solver.accuracy, "order": scene.solver.order}


def _forces(simulation: Simulation, scene: Scene) -> dict:
    """Forces (docs: reference, "Numbers") and their uncertainties."""
    state, share = simulation.state, uncertainty.share_of(vars(scene.solver))
    retracted = _has_retracted(simulation)
    pull_off = uncertainty.of_force(state.pull_off_force, state.pull_off_at_ends, share)
    snap_in = uncertainty.of_force(state.snap_in_force, state.snap_in_at_ends, share)
    return {
        "pull_off_force_N": 0.0 - state.pull_off_force if retracted else None,
        "pull_off_force_uncertainty_N": pull_off if retracted else None,
        "snap_in_force_N": 0.0 - state.snap_in_force,
        "snap_in_force_uncertainty_N": snap_in,
        "preload_N": state.preload if state.preload_time is not None else None,
        "largest_force_N": state.largest_force,
        "time_to_preload_s": _span(state),
    }


def _works(simulation: Simulation, scene: Scene) -> dict:
    """Works of the punch, with uncertainties if there is an audit."""
    energies, share = simulation.state.energies, uncertainty.share_of(vars(scene.solver))
    retracted, separation = _has_retracted(simulation), energies.work_of_separation
    residual = energies.largest_residual if simulation.scheme.audit else math.nan
    unbalanced, variance = energies.unbalanced, energies.jump_variance
    if unbalanced is None or variance is None:
        loop = uncertainty.of_work(energies.work, separation, residual, share)
    else:
        loop = uncertainty.of_loop(unbalanced, variance, residual)
    return {
        "work_of_separation_J": separation if retracted else None,
        "work_of_separation_uncertainty_J": (
            uncertainty.of_work(separation, separation, residual, share) if retracted else None
        ),
        "work_J": energies.work,
        "work_uncertainty_J": loop,
        "unbalanced_J": unbalanced,
        "jump_places_J": None if variance is None else math.sqrt(variance),
    }


def _cycles(simulation: Simulation) -> dict:
    """Of a programme: the numbers of each cycle, the present one included, if it has repeats; and steps that ended early."""
    state = simulation.state
    if not simulation.drive.programme:
        return {}
    unmet: dict = {"detached": state.has_detached}
    if state.unmet:
        unmet["unmet_ends"] = state.unmet
    if not simulation.has_cycles:
        return unmet
    rows = [*state.cycles, state.cycle.row(state)]
    return unmet | {"cycles": [numbers_in_record(row) for row in rows]}


def _has_retracted(simulation: Simulation) -> bool:
    """Whether the punch has gone up again since the preload; in a programme that has none, as where a file is followed,
    whether it has gone up at all."""
    state, phases = simulation.state, simulation.phases
    before = any(phase.may_let_go and not phase.holds_load for phase in phases[: state.phase])
    if simulation.drive.programme and all(phase.ends_with != PRELOAD for phase in phases):
        return simulation.retracting or before or state.pull_off_at_ends < 0.0
    return state.preload_time is not None and (simulation.retracting or before)


def _span(state: State) -> float | None:
    """t_pl [s]: from first contact to the preload."""
    if state.preload_time is None or state.first_contact_time is None:
        return None
    return state.preload_time - state.first_contact_time


def versions() -> dict[str, str]:
    """Versions of Python, the libraries and MPI that this run used."""
    from mpi4py import MPI

    # The metadata of an editable installation of pgfmd may be old.
    found = {"python": platform.python_version(), "platform": sys.platform, "pgfmd": __version__}
    for name in _LIBRARIES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "unknown"
    found["mpi"] = MPI.Get_library_version().splitlines()[0].split(",")[0]
    return found
