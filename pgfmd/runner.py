"""A whole run: from a scene to a folder of results."""

from __future__ import annotations

import importlib.metadata
import platform
import resource
import sys
import time
from pathlib import Path

from pgfmd import observers, storage
from pgfmd.assemble import assemble, convolution_of
from pgfmd.curve_file import CurveFile, EnergyFile, EventFile
from pgfmd.errors import RunError
from pgfmd.fields_file import FieldsFile
from pgfmd.parts import inertia_of_scene
from pgfmd.scene import load_scene

_LIBRARIES = ("pgfmd", "numpy", "numba", "mpi4py", "mpi4py-fft", "h5py")


def run_scene(scene, comm, directory: str | Path, say=print) -> dict:
    """Runs a scene on a communicator and writes its results into `directory`; returns the record that is in `run.json`.

    say: called on rank 0 with lines of progress. Collective. Raises SceneError before any field is allocated,
    ResultError when the folder can't be written, RunError when a step can't be solved: what was written before stays,
    and is valid.
    """
    began = time.perf_counter()
    compile_kernels(comm, scene)
    simulation = assemble(scene, comm)
    folder = storage.prepare_directory(directory, comm, say)
    text = scene.to_toml().encode()
    storage.on_root(comm, "the scene", lambda: storage.write_atomically(folder / storage.SCENE_FILE, text))
    files = _attach(simulation, scene, comm, folder, say)
    failure = None
    try:
        simulation.run()
    except RunError as error:
        failure = error
        simulation.state.finished = "failed"
    finally:
        for file in files:
            file.close()
    record = record_of(simulation, scene, comm, time.perf_counter() - began)
    storage.write_run_json(folder / storage.RUN_FILE, comm, record)
    if failure:
        raise failure
    return record


def compile_kernels(comm, scene) -> None:
    """Has rank 0 compile the kernels that the scene needs, by tiny tack tests, while the others wait.

    All ranks would otherwise compile the same at once, and race for numba's cache. One rank compiles when it gets
    there.
    """
    if comm.size > 1:
        if comm.rank == 0:
            warm_up(scene.solver.scheme, scene.solver.precision)
        comm.Barrier()


def warm_up(scheme: str = "inertialess", precision: str = "double") -> None:
    """Runs tiny tack tests that use every kernel of a scheme, so that numba has them in its cache."""
    from mpi4py import MPI

    common = [f"solver.scheme={scheme}", f"solver.precision={precision}", "grid.n=20", "drive.preload=1 mN"]
    tests = ([], ["output.energy=false"], ["rheology.model=elastic"])
    if scheme == "gfmd":
        tests = (["solver.max_steps=3"],)
    for changes in tests:
        assemble(load_scene("tri-tack", [*common, *changes]), MPI.COMM_SELF).run()


def _attach(simulation, scene, comm, folder: Path, say) -> list:
    """Gives the simulation its observers; returns the open tables."""
    output, points = scene.output, simulation.points
    curve = CurveFile(folder / storage.CURVE_FILE, comm, output.every)
    energy = EnergyFile(folder / storage.ENERGY_FILE, comm, output.every) if output.energy else None
    events = EventFile(folder / storage.EVENTS_FILE, comm)
    fields = FieldsFile(
        folder / storage.FIELDS_FILE, comm, points.grid.n, points.grid.length, points.block_start, points.nb,
        points.row_start, points.rows, points.inside(), surface=output.surface,
    )  # fmt: skip
    wanted = [(value, f"t = {value:g} s") for value, relative in output.snapshot_times if not relative]
    fractions = [value for value, relative in output.snapshot_times if relative]
    wanted += _scouted(scene, comm, [value for value in fractions if value < 1.0], say)
    later = [value for value in fractions if value > 1.0]
    surface = _surface(simulation, scene) if output.surface else None
    simulation.observers += [
        observers.Curve(curve, energy),
        observers.Events(events),
        observers.Snapshots(fields, wanted, later, surface),
        observers.Progress(comm, say),
    ]
    return [file for file in (curve, energy, events) if file]


SCOUT_ACCURACY = 0.1


def _scouted(scene, comm, fractions: list[float], say) -> list[tuple[float, str]]:
    """Times [s] and labels of snapshots within the approach, at fractions of t_pl below 1.

    How long the approach takes is known only at its end, so a coarse one is run ahead; its t_pl is good to a few tenths
    of a percent. Nothing is run where no such snapshot is asked for.
    """
    if not fractions:
        return []
    if comm.rank == 0:
        say("a coarse approach is run ahead to place the snapshots before the preload")
    accuracy = SCOUT_ACCURACY if scene.solver.scheme == "gfmd" else max(SCOUT_ACCURACY, scene.solver.accuracy)
    # Whatever the scheme: explicit steps can't be coarse.
    coarse = scene.solver.model_copy(update={"scheme": "inertialess", "accuracy": accuracy})
    quiet = scene.output.model_copy(update={"energy": False})
    state = assemble(scene.model_copy(update={"solver": coarse, "output": quiet}), comm).run(only_to_preload=True)
    if state.preload_time is None:
        return []
    return [(observers.time_of(state, value), f"{value:g} t_pl") for value in fractions]


def _surface(simulation, scene) -> observers.Surface:
    """How this scene's whole surface is had."""
    scheme = simulation.scheme
    if scene.solver.scheme == "gfmd":
        return observers.Surface(lambda state: scheme.plane.real.copy(), lambda rows: (rows, scheme.plane.row_start))
    if scene.substrate.boundary == "periodic":
        whole_cell = scheme.solver.convolve.whole_cell
    else:
        # A free surface needs a larger transform of its own.
        def whole_cell(load):
            return convolution_of(scene, simulation.points, whole_cell=True).whole_cell(load)

    return observers.Surface(lambda state: state.load.copy(), whole_cell)


def record_of(simulation, scene, comm, wall: float) -> dict:
    """The contents of `run.json` (docs: results). Collective."""
    state, scheme = simulation.state, simulation.scheme
    counters, energies = state.counters, state.energies
    memory = comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
    transform = max(comm.allgather(scheme.transform_seconds))
    audit = scene.output.energy and energies.work != 0.0
    return {
        "finished": state.finished,
        "scheme": scene.solver.scheme,
        "precision": scene.solver.precision,
        **_numerics(scene),
        "ranks": comm.size,
        "n": scene.grid.n,
        "range_m": scene.adhesion.range,
        "steps": counters.steps,
        "rejected_steps": counters.rejected_steps,
        "newton_iterations": counters.newton_iterations,
        "cg_iterations": counters.cg_iterations,
        "transform_pairs": scheme.pairs,
        "jumps": counters.jumps,
        "wall_s": wall,
        "transform_s": transform,
        "pull_off_force_N": -state.pull_off_force,
        "snap_in_force_N": -state.snap_in_force,
        "preload_N": state.preload,
        "time_to_preload_s": _span(state),
        "work_of_separation_J": energies.work_of_separation,
        "work_J": energies.work,
        "viscous_J": energies.viscous if scene.output.energy else None,
        "released_J": energies.released,
        "energy_residual": energies.largest_residual / abs(energies.work) if audit else None,
        "indentation_offset_m": observers.INDENTATION_OFFSET,
        "peak_rss_bytes": memory,
        "versions": versions(),
    }


def _numerics(scene) -> dict:
    """What the scheme was run with: its accuracy and order, or its inertia."""
    if scene.solver.scheme == "gfmd":
        inertia = inertia_of_scene(scene)
        return {"omega_rad_s": inertia.frequency, "dt_s": inertia.step}
    return {"accuracy": scene.solver.accuracy, "order": scene.solver.order}


def _span(state) -> float | None:
    """t_pl [s]: from first contact to the preload."""
    if state.preload_time is None or state.first_contact_time is None:
        return None
    return state.preload_time - state.first_contact_time


def versions() -> dict[str, str]:
    """Versions of Python, the libraries and MPI that this run used."""
    from mpi4py import MPI

    found = {"python": platform.python_version(), "platform": sys.platform}
    for name in _LIBRARIES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = "unknown"
    found["mpi"] = MPI.Get_library_version().splitlines()[0].split(",")[0]
    return found
