"""pgfmd beside other programs: the same static states and loops in Adhesion, the same spheres in Tamaas.

    pip install --target FOLDER tamaas Adhesion ContactMechanics
    python -m scripts.studies.peers.run --peers FOLDER [states loops spheres creep]     five minutes; prints tables
    python -m scripts.studies.peers.run --peers FOLDER --page                           fills docs/evidence/peers.md too

The folder is searched after everything that pgfmd itself needs, so that both use the same NumPy and SciPy. All on one
core and in double precision. A part whose program is not installed is named and left out, and its table on the page kept.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

import numpy as np
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.output.recorder import Recorder
from pgfmd.scene import Scene, load_scene

from .. import pages
from . import spheres
from .half_space import Peer

SCENES = ("tri-tack", "hex-tack")
ACCURACY = 0.003
"""Of pgfmd's static states."""
CLEARANCES = ("-1 um", "-2 um", "-3 um")
"""Of static states from rest: how deep the punch is pressed in."""
COARSE, FINEST = 1e-4, 1e-6
"""Tolerances of the minimiser from rest, and where it refines pgfmd's states."""
TIMES = (1.0, 10.0, 20.0, 100.0)
"""Times [s] at which a force has been held; the retardation time is 10 s."""
OVERLAP = 100.0
"""Factor of the range of the repulsive law under a constant force: so stiff that overlaps do not count beside depths."""
SLACK = 1e-3
"""The force is reached when it is so close to that which is held."""
QUASISTATIC = ("solver.scheme=quasistatic", "solver.precision=double")


def states() -> str:
    """Equilibria from rest at several depths; and how far the peer goes down from each of pgfmd's."""
    lines = [
        "| scene, n | pressed in | force (mN) | pgfmd | L-BFGS (to its end) | memory of one | as it comes "
        "| difference, from rest | difference, refined |",
        "| --- |" + " --- |" * 8,
    ]
    for scene in SCENES:
        for n in (128, 256):
            rows = [_state(scene, n, clearance) for clearance in CLEARANCES]
            largest = max(abs(force) for force, *_ in rows)
            for clearance, (force, told, others) in zip(CLEARANCES, rows, strict=True):
                off = " | ".join(f"{abs(other - force) / largest:.1e}" for other in others)
                depth = clearance[1:].replace("um", "µm")
                lines.append(f"| {scene.removesuffix('-tack')}, {n} | {depth} | {force * 1e3:.3f} | {told} | {off} |")
                print(lines[-1], flush=True)
    return "\n".join(lines)


def _state(scene: str, n: int, clearance: str) -> tuple[float, str, list[float]]:
    """One equilibrium: its force [N], cells of the table about its cost, forces that the peer finds from rest and from it."""
    loaded = load_scene(
        scene, [f"grid.n={n}", f"drive.clearance={clearance}", f"solver.accuracy={ACCURACY}", *QUASISTATIC]
    )
    for _ in range(2):
        # The first one compiles kernels.
        simulation = assemble(loaded, MPI.COMM_SELF)
        state, scheme, began = simulation.state, simulation.scheme, time.perf_counter()
        force = scheme.start(state)
        seconds = time.perf_counter() - began
    pairs = scheme.pairs
    scheme.measure(state)
    energy = state.energies.elastic + state.energies.adhesive
    surface = scheme.whole_cell(scheme.surface_of(state))[0].T
    peer, place = Peer(loaded), state.position
    waves = peer.minimum(place, tolerance=COARSE, energy=energy)
    brief = peer.minimum(place, tolerance=COARSE, energy=energy, memory=1)
    plain = peer.minimum(place, tolerance=COARSE, energy=energy, plain=True)
    refined = peer.minimum(place, start=surface, tolerance=FINEST)
    told = (
        f"{pairs}, {seconds:.2f} s | {waves.evaluations} ({waves.total}), {waves.seconds:.2f} s | {brief.evaluations} | "
        f"{plain.evaluations}, {plain.seconds:.2f} s"
    )
    return force, told, [waves.force, refined.force]


def loops() -> str:
    """The quasi-static loop of tri-tack, n = 64: pgfmd at several accuracies, the peer in equal steps."""
    lines = [
        "| program | steps | pairs or evaluations | time (s) | loop (nJ) | pull-off (mN) |",
        "| --- |" + " --- |" * 5,
    ]
    for accuracy in (0.1, 0.03, 0.01, 0.003):
        loaded = load_scene("tri-tack", ["grid.n=64", f"solver.accuracy={accuracy}", *QUASISTATIC])
        simulation, recorder = assemble(loaded, MPI.COMM_SELF), Recorder()
        simulation.observers.append(recorder)
        began = time.perf_counter()
        state = simulation.run()
        seconds = time.perf_counter() - began
        lines.append(
            f"| pgfmd, accuracy {accuracy} | {state.counters.steps} | {state.counters.transform_pairs} | {seconds:.1f} | "
            f"{state.energies.work * 1e9:.3f} | {-state.pull_off_force * 1e3:.3f} |"
        )
        print(lines[-1], flush=True)
    places = recorder.rows("displacement")[:, 0]
    first, deepest, last = places[0], places.min(), places.max() + loaded.adhesion.range
    for step, tolerance in ((0.4e-6, 1e-4), (0.1e-6, 1e-3), (0.1e-6, 1e-4), (0.1e-6, 1e-5), (0.025e-6, 1e-4)):
        peer, u, forces, path, evaluations, seconds = Peer(loaded), None, [], [], 0, 0.0
        down = np.linspace(first, deepest, round((first - deepest) / step) + 1)
        up = np.linspace(deepest, last, round((last - deepest) / step) + 1)[1:]
        for place in (*down, *up):
            found = peer.minimum(place, start=u, tolerance=tolerance)
            u, evaluations, seconds = found.surface, evaluations + found.evaluations, seconds + found.seconds
            forces.append(found.force)
            path.append(place)
            if place > first and found.force == 0.0:
                break
        loop = -np.trapezoid(forces, path)
        lines.append(
            f"| Adhesion, steps of {step * 1e6:g} µm, gradient {tolerance:g} | {len(path)} | {evaluations} | {seconds:.1f} | "
            f"{loop * 1e9:.3f} | {-min(forces[len(down) :]) * 1e3:.3f} |"
        )
        print(lines[-1], flush=True)
    return "\n".join(lines)


def _sphere(n: int, drive: dict, **sections: dict) -> Scene:
    """The sphere of spheres.py as a scene of pgfmd."""
    return Scene(**{
        "punch": {"pattern": "sphere", "radius": 375e-6, "curvature_radius": spheres.CURVATURE},
        "substrate": {"youngs_modulus": spheres.MODULUS, "poisson_ratio": spheres.POISSON, "boundary": "periodic"},
        "adhesion": {"law": "repulsive", "work_of_adhesion": 0.05, "range_factor": 1.0},
        "drive": drive,
        "grid": {"n": n, "length": spheres.SIDE},
        "rheology": {"model": "elastic"},
        "solver": {"accuracy": ACCURACY, "precision": "double"},
    } | sections)  # fmt: skip


def elastic() -> str:
    """A sphere under 4 mN, from rest: a rigid wall against a stiff overlap."""
    lines = [
        "| n | stiffness of overlaps | pgfmd: force at the same depth, difference | pairs | time (s) | Tamaas: iterations | time (s) |",
        "| --- |" + " --- |" * 6,
    ]
    for n in (128, 256):
        spheres.pressed(n, 4e-3)
        other = spheres.pressed(n, 4e-3)
        for factor in (1.0, 10.0, 100.0):
            drive = {"speed": "1 um/s", "preload": 4e-3, "clearance": -other.depth}
            solver = {"accuracy": ACCURACY, "scheme": "quasistatic", "precision": "double"}
            law = {"law": "repulsive", "work_of_adhesion": 0.05, "range_factor": factor}
            scene = _sphere(n, drive, adhesion=law, solver=solver)
            for _ in range(2):
                simulation = assemble(scene, MPI.COMM_SELF)
                began = time.perf_counter()
                force = simulation.scheme.start(simulation.state)
                seconds = time.perf_counter() - began
            lines.append(
                f"| {n} | {factor:g} q E* | {100 * (force / 4e-3 - 1):+.2f} % | {simulation.scheme.pairs} | {seconds:.3f} | "
                f"{other.iterations} | {other.seconds:.2f} |"
            )
            print(lines[-1], flush=True)
    return "\n".join(lines)


def creep() -> str:
    """A viscoelastic sphere under a constant force: Tamaas in equal steps, pgfmd at several accuracies."""
    n, force = 64, 4e-3
    lines = [
        f"| program | steps | iterations or pairs | time (s) | {' | '.join(f'depth at {time:g} s (µm)' for time in TIMES)} |",
        f"| --- | --- | --- | --- {'| --- ' * len(TIMES)}|",
    ]

    def line(program: str, steps: object, cost: object, seconds: float, depths) -> None:
        told = " | ".join(f"{depth * 1e6:.4f}" for depth in depths)
        lines.append(f"| {program} | {steps} | {cost} | {seconds:.2f} | {told} |")
        print(lines[-1], flush=True)

    relaxed = spheres.pressed(n, force)
    line("Tamaas, elastic, relaxed modulus", "", relaxed.iterations, relaxed.seconds, [relaxed.depth] * len(TIMES))
    for step in (1.0, 0.25, 0.05):
        found = spheres.crept(n, force, TIMES, step)
        steps = round(TIMES[-1] / step)
        line(
            f"Tamaas, steps of {step:g} s",
            steps,
            found[-1].iterations,
            found[-1].seconds,
            [each.depth for each in found],
        )
    programme = [
        {"do": "approach", "speed": "1 mm/s", "until": f"{force!r} N"},
        {"do": "hold", "of": "load", "duration": f"{TIMES[-1]!r} s"},
    ]
    rheology = {"model": "single", "modulus_ratio": spheres.RATIO, "relaxation_time": spheres.TIME}
    law = {"law": "repulsive", "work_of_adhesion": 0.05, "range_factor": OVERLAP}
    for accuracy in (0.03, 0.01, 0.003):
        solver = {"accuracy": accuracy, "precision": "double"}
        scene = _sphere(n, {"step": programme}, rheology=rheology, adhesion=law, solver=solver)
        simulation, recorder = assemble(scene, MPI.COMM_SELF), Recorder()
        simulation.observers.append(recorder)
        began = time.perf_counter()
        counters = simulation.run().counters
        seconds = time.perf_counter() - began
        place = recorder.rows("time", "displacement", "force")
        held = place[int(np.argmax(place[:, 2] >= force * (1.0 - SLACK))) :]
        depths = np.interp(TIMES, held[:, 0] - held[0, 0], -held[:, 1])
        line(f"pgfmd, accuracy {accuracy:g}", counters.steps, counters.transform_pairs, seconds, depths)
    return "\n".join(lines)


PARTS: dict[str, tuple[Callable[[], str], str, tuple[str, ...]]] = {
    "states": (states, "Adhesion", ("Adhesion", "ContactMechanics", "SurfaceTopography", "scipy")),
    "loops": (loops, "Adhesion", ("Adhesion", "ContactMechanics", "SurfaceTopography", "scipy")),
    "spheres": (elastic, "tamaas", ("tamaas",)),
    "creep": (creep, "tamaas", ("tamaas",)),
}
"""By name: what makes the table; the module that it needs; packages whose versions are told."""


def _kept(page: Path, name: str) -> str:
    """A table as it is on the page."""
    _, _, after = page.read_text(encoding="utf-8").partition(f"<!-- peers {name} -->")
    return after.partition("<!-- end -->")[0].strip()


def main() -> None:
    """The chosen tables, and the page."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("parts", nargs="*", default=list(PARTS), help=", ".join(PARTS))
    options.add_argument("--peers", help="folder of other programs")
    options.add_argument("--page", action="store_true")
    chosen = options.parse_args()
    unknown = set(chosen.parts) - set(PARTS)
    if unknown:
        options.error(f"no such part: {', '.join(sorted(unknown))}; there are {', '.join(PARTS)}")
    if chosen.peers:
        sys.path.append(chosen.peers)
    made: dict[str, str] = {}
    for name in chosen.parts:
        table, module, packages = PARTS[name]
        try:
            import_module(module)
        except ImportError as problem:
            print(f"{name}: not run, because {module} can't be imported ({problem})")
            continue
        told = ", ".join(f"{package} {version(package)}" for package in packages)
        print(f"{name}: {told}", flush=True)
        made[name] = f"{table()}\n\nWith {told}."
    if chosen.page and made:
        page = pages.page_named("peers.md")
        pages.fill(page, "peers", lambda name: made.get(name) or _kept(page, name))


if __name__ == "__main__":
    main()
