"""Cost and accuracy of quasi-static runs and of static states from rest.

    python -m scripts.studies.cost.quasistatic [--scene hex-tack] [--preload "5 mN"] [--n 64 128] [--accuracy 0.1 0.03 0.01]

Prints a table: steps, jumps, pairs of transforms, closed loop, energy released, residual of the audit, pull-off force;
of the scheme, and of the path of the elastic scene by the default scheme. With other options, other tables:

    --errors       the scheme against a run at accuracy 0.001: force curve, pull-off force, loop
    --causes       what the pairs of each run were for
    --rest         states from rest: pairs of the scheme, of Newton's method, and evaluations of scipy's L-BFGS
    --saddles      lowest curvatures at the ends of steps, of dense matrices, with the scheme's search and with less
"""

from __future__ import annotations

import argparse
import math
import time
from collections import Counter

import numpy as np
import scipy.fft
import scipy.linalg
import scipy.optimize
from mpi4py import MPI

from pgfmd import scene_objects
from pgfmd.assemble import assemble
from pgfmd.output.recorder import Recorder
from pgfmd.scene import load_scene
from pgfmd.schemes.quasistatic.lobpcg import SoftestMode
from tests.physics.dense import LowestCurvatures

SHARP = 0.001
"""Accuracy of references."""
PLACES = 20_001
"""At which forces are compared."""
CLEARANCES = ("-1 um", "-2 um", "-3 um")
"""Of states from rest: how deep the punch is pressed in."""


def forces_at(places: np.ndarray, recorder: Recorder) -> tuple[np.ndarray, np.ndarray]:
    """Forces [N] of a run on the way down and on the way up at places [m], nan beyond."""
    place, force = recorder.rows("displacement", "force").T
    turn = int(np.argmin(place))
    down = np.interp(-places, -place[: turn + 1], force[: turn + 1], left=0.0, right=np.nan)
    return down, np.interp(places, place[turn:], force[turn:], left=np.nan, right=0.0)


def finished(scene: str, n: int, changes: list[str], observer=None):
    """A run's simulation, done, and the time that it took [s]."""
    simulation = assemble(load_scene(scene, [f"grid.n={n}", *changes]), MPI.COMM_SELF)
    simulation.observers += [observer] if observer else []
    began = time.perf_counter()
    simulation.run()
    return simulation, time.perf_counter() - began


def row(label: str, scene: str, n: int, changes: list[str]) -> str:
    """One run as a line of the table."""
    simulation, seconds = finished(scene, n, changes)
    energies, counters = simulation.state.energies, simulation.state.counters
    residual = energies.residual / energies.work if energies.work else 0.0
    return (
        f"| {n} | {label} | {counters.steps} | {counters.jumps} | {counters.transform_pairs} | "
        f"{energies.work * 1e9:.4f} | {energies.released * 1e9:.4f} | {100 * residual:.1f} | "
        f"{-simulation.state.pull_off_force * 1e3:.4f} | {seconds:.1f} |"
    )


def runs(chosen) -> None:
    """The scheme, and the elastic scene by the default scheme."""
    print(
        "| n | scheme, accuracy | steps | jumps | pairs | loop (nJ) | released (nJ) | residual (%) | pull-off (mN) | s |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for n in chosen.n:
        for accuracy in chosen.accuracy:
            changes = [f"drive.preload={chosen.preload}", f"solver.accuracy={accuracy}"]
            for label, scheme in (
                ("quasistatic", ["solver.scheme=quasistatic"]),
                ("elastic", ["rheology.model=elastic"]),
            ):
                print(row(f"{label}, {accuracy}", chosen.scene, n, [*changes, *scheme]), flush=True)


def errors(chosen) -> None:
    """The scheme against itself at a sharp accuracy. Forces: root mean square, in percent of the preload."""
    print("| n | accuracy | pairs | force, approach (%) | force, retraction (%) | pull-off (%) | loop (%) |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    common = ["solver.scheme=quasistatic", f"drive.preload={chosen.preload}"]
    for n in chosen.n:
        reference = Recorder()
        sharp, _ = finished(chosen.scene, n, [*common, f"solver.accuracy={SHARP}"], reference)
        preload, exact = sharp.scheme.solver.force_scale, sharp.state
        for accuracy in chosen.accuracy:
            curve = Recorder()
            state = finished(chosen.scene, n, [*common, f"solver.accuracy={accuracy}"], curve)[0].state
            lowest = max(min(place for place, _ in each.rows) for each in (curve, reference))
            places = np.linspace(lowest, reference.rows[0][0], PLACES)
            pairs = zip(forces_at(places, curve), forces_at(places, reference), strict=True)
            off = [math.sqrt(np.nanmean((one - other) ** 2)) / preload for one, other in pairs]
            pull_off = state.pull_off_force / exact.pull_off_force - 1.0
            loop = state.energies.work / exact.energies.work - 1.0
            print(
                f"| {n} | {accuracy} | {state.counters.transform_pairs} | {100 * off[0]:.2f} | {100 * off[1]:.2f} | "
                f"{100 * pull_off:+.2f} | {100 * loop:+.1f} |", flush=True
            )  # fmt: skip


def causes(chosen) -> None:
    """What the pairs of a run were for."""
    kinds = ("jumps", "other steps", "given up at an instability", "refused for their error", "search for saddles")
    print(f"| n | accuracy | {' | '.join(kinds)} |")
    print(f"| --- | --- {'| --- ' * len(kinds)}|")
    for n in chosen.n:
        for accuracy in chosen.accuracy:
            changes = ["solver.scheme=quasistatic", f"drive.preload={chosen.preload}", f"solver.accuracy={accuracy}"]
            simulation = assemble(load_scene(chosen.scene, [f"grid.n={n}", *changes]), MPI.COMM_SELF)
            spent = counted(simulation.scheme)
            simulation.run()
            print(f"| {n} | {accuracy} | {' | '.join(str(spent[kind]) for kind in kinds)} |", flush=True)


def counted(scheme) -> Counter:
    """Pairs by what they were for, counted from here on."""
    spent, last = Counter(), {}
    search, try_step, accept = scheme.softest_mode.search, scheme.try_step, scheme.accept

    def counted_search(*arguments):
        found = search(*arguments)
        spent["search for saddles"] += found.iterations
        return found

    def counted_try(*arguments, **options):
        before, searched = scheme.pairs, spent["search for saddles"]
        trial = try_step(*arguments, **options)
        last["kind"] = "refused for their error" if trial.converged else "given up at an instability"
        last["pairs"] = scheme.pairs - before - spent["search for saddles"] + searched
        spent[last["kind"]] += last["pairs"]
        return trial

    def counted_accept(state, trial):
        spent[last["kind"]] -= last["pairs"]
        spent["jumps" if trial.is_jump else "other steps"] += last["pairs"]
        accept(state, trial)

    scheme.softest_mode.search, scheme.try_step, scheme.accept = counted_search, counted_try, counted_accept
    return spent


def rest(chosen) -> None:
    """States from rest, at the default accuracy: the punch of the scene pressed in at once."""
    print("| scene | n | pressed in | scheme | of these, search | Newton's method | L-BFGS |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for scene in ("tri-tack", "hex-tack"):
        for n in chosen.n:
            for clearance in CLEARANCES:
                changes = [f"grid.n={n}", f"drive.clearance={clearance}", "drive.preload=100 mN"]
                loaded = load_scene(scene, [*changes, "solver.scheme=quasistatic"])
                simulation = assemble(loaded, MPI.COMM_SELF)
                spent = counted(simulation.scheme)
                simulation.scheme.start(simulation.state)
                simulation.scheme.measure(simulation.state)
                found, pairs = simulation.state, simulation.scheme.pairs
                solver, nothing = simulation.scheme.solver, np.zeros(simulation.points.size)
                u, w, tolerance = np.zeros_like(nothing), np.zeros_like(nothing), 0.25 * simulation.scheme.tolerance
                solver.cg.patience = 2
                newton = solver.solve(found.position, nothing, 1.0, u, w, tolerance, True).cg_iterations
                energy = found.energies.elastic + found.energies.adhesive
                print(
                    f"| {scene} | {n} | {clearance[1:]} | {pairs} | {spent['search for saddles']} | {newton} | "
                    f"{evaluations(loaded, found.position, energy)} |", flush=True
                )  # fmt: skip


def evaluations(scene, position: float, energy: float) -> str:
    """Evaluations of the potential, of the whole cell and with nothing of pgfmd's solver, after which scipy's L-BFGS in
    the variables v = u / sqrt(G0) is as low as `energy` [J]; "-" where it comes to another, higher minimum."""
    n, length = scene.grid.n, scene.grid.length
    place = (np.arange(n) + 0.5) * length / n - 0.5 * length
    y, x = np.meshgrid(place, place, indexing="ij")
    inside = np.hypot(x, y) <= scene.punch.radius * (1 + 1e-12)
    height = scene_objects.topography_of(scene.punch).heights(x[inside], y[inside])
    height -= height.min()
    q = 2.0 * np.pi * np.fft.fftfreq(n, length / n)
    root = np.sqrt(scene_objects.compliance_of(scene)(np.abs(q[None, : n // 2 + 1]), q[:, None]))
    gamma, rho, values = scene.adhesion.work_of_adhesion, scene.adhesion.range, []

    def spread(values):
        return scipy.fft.irfft2(root * scipy.fft.rfft2(values.reshape(n, n)), s=(n, n))

    def potential(v):
        gap = position + height - spread(math.sqrt(gamma) * v)[inside]
        phase, overlap = np.pi * np.clip(gap, 0.0, rho) / rho, np.pi * np.minimum(gap, 0.0) / rho
        stored = (-0.5 * (1.0 + np.cos(phase)) + 0.25 * overlap**2).sum() + 0.5 * v @ v
        pulled = np.zeros((n, n))
        pulled[inside] = 0.5 * np.pi / rho * (np.sin(phase) + overlap)
        values.append(stored * gamma * (length / n) ** 2)
        return stored, v - spread(pulled).ravel() * math.sqrt(gamma)

    options = {"maxcor": 10, "ftol": 0.0, "gtol": 1e-12, "maxiter": 600, "maxfun": 700}
    scipy.optimize.minimize(potential, np.zeros(n * n), jac=True, method="L-BFGS-B", options=options)
    low = np.array(values) <= energy + 1e-6 * abs(values[0] - energy)
    return str(int(np.argmax(low)) + 1) if low.any() else "-"


def saddles(chosen) -> None:
    """How many steps end at a saddle, and how far below zero the lowest curvature is there."""
    print("| scene | accuracy | search | pairs | steps | below 0 | below -0.01 | lowest |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    softened, most = SoftestMode._softened, SoftestMode.most_iterations
    for scene in ("tri-tack", "hex-tack"):
        for n in chosen.n:
            for accuracy in chosen.accuracy:
                for label in ("as it is", "one iteration"):
                    if label == "one iteration":
                        SoftestMode._softened, SoftestMode.most_iterations = (lambda *_: False), 1
                    changes = ["solver.scheme=quasistatic", f"drive.preload={chosen.preload}"]
                    changes += [f"solver.accuracy={accuracy}", f"grid.n={n}"]
                    simulation = assemble(load_scene(scene, changes), MPI.COMM_SELF)
                    watch, before = LowestCurvatures(simulation), simulation.scheme.pairs
                    simulation.observers.append(watch)
                    pairs = simulation.run().counters.transform_pairs - before
                    lowest = np.array(watch.lowest)
                    print(
                        f"| {scene}, n = {n} | {accuracy} | {label} | {pairs} | {lowest.size} | {(lowest < 0).sum()} | "
                        f"{(lowest < -0.01).sum()} | {lowest.min():.3f} |", flush=True
                    )  # fmt: skip
                    SoftestMode._softened, SoftestMode.most_iterations = softened, most


def main() -> None:
    """The chosen table, a line as soon as its run is done."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--scene", default="hex-tack")
    options.add_argument("--preload", default="5 mN")
    options.add_argument("--n", type=int, nargs="+", default=[64, 128])
    options.add_argument("--accuracy", nargs="+", default=["0.1", "0.03", "0.01"])
    for table in (errors, causes, rest, saddles):
        options.add_argument(f"--{table.__name__}", action="store_const", dest="table", const=table, default=runs)
    chosen = options.parse_args()
    if chosen.table not in (rest, saddles):
        print(f"{chosen.scene}, preload {chosen.preload}")
    chosen.table(chosen)


if __name__ == "__main__":
    main()
