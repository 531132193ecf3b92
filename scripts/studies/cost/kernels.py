"""Where the processor time of a run's steps goes outside the transforms: kernel by kernel, and what Python adds.

    python -m scripts.studies.cost.kernels                                   tri-tack at n = 512, as shipped
    python -m scripts.studies.cost.kernels tri-tack grid.n=1024 drive.preload="5 mN"
    mpirun -n 2 python -m scripts.studies.cost.kernels tri-tack grid.n=512    of rank 0, waits for others included

Whole runs with their files, in a temporary folder; the start (imports, kernels, plans) is listed apart. Percent of the time of all steps, each
part without those inside it, and how often it is called for a pair of transforms.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import defaultdict

TRANSFORM = "transforms"
OTHERS = {
    "pgfmd.solver.grid.PunchPoints": ("all_rows", "summed", "maxima_of"),
    "pgfmd.solver.conjugate_gradients.ConjugateGradients": ("correct",),
    "pgfmd.solver.newton.NewtonSolver": ("solve", "_go_down", "_noise"),
    "pgfmd.schemes.path_following.PathFollowing": ("_predict", "_change", "_move_on", "_remember", "measure"),
    "pgfmd.schemes.inertialess.scheme.Inertialess": ("try_step", "accept"),
    "pgfmd.schemes.inertialess.audit.EnergyAudit": ("energies",),
    "pgfmd.solver.drift.Drift": ("extrapolated", "renewed", "disturbed", "kept"),
    "pgfmd.output.observers.Curve": ("observe",),
    "pgfmd.output.observers.Snapshots": ("observe",),
    "pgfmd.output.observers.Events": ("observe",),
    "pgfmd.output.observers.Progress": ("observe",),
    "pgfmd.output.patch_observer.ContactWatch": ("observe", "before_step"),
    "pgfmd.restart.keeper.Keeper": ("attend", "interrupts"),
    "pgfmd.solver.interruption.Question": ("__call__",),
    "pgfmd.solver.simulation.Simulation": ("_measure", "_turn_page"),
    "pgfmd.schemes.inertialess.controller.Controller": ("advance",),
}
"""What is timed beside the compiled kernels and the transforms: methods, by class."""


class Stopwatch:
    """Seconds and calls of nested parts, each without the parts inside it."""

    def __init__(self, clock):
        self.clock, self.seconds, self.calls = clock, defaultdict(float), defaultdict(int)
        self._inside: list[float] = []

    def wrap(self, owner, name: str, part: str) -> None:
        """Has every call of owner.name timed as `part`."""
        original = getattr(owner, name)

        def timed(*given, **named):
            self._inside.append(0.0)
            began = self.clock()
            try:
                return original(*given, **named)
            finally:
                taken = self.clock() - began
                self.seconds[part] += taken - self._inside.pop()
                self.calls[part] += 1
                if self._inside:
                    self._inside[-1] += taken

        setattr(owner, name, timed)

    def clear(self) -> None:
        """Forgets what there was so far."""
        self.seconds.clear()
        self.calls.clear()


def watched(clock, all_parts: bool) -> Stopwatch:
    """A stopwatch of all parts of a run's steps, or of the transforms alone."""
    import importlib

    from numba.core.dispatcher import Dispatcher

    from pgfmd.solver.transform import PairOperator

    watch = Stopwatch(clock)
    watch.wrap(PairOperator, "__call__", TRANSFORM)
    if not all_parts:
        return watch
    loaded = [module for name, module in sys.modules.items() if name.startswith("pgfmd.") and name.endswith("kernels")]
    for module in loaded:
        if "transform" in module.__name__ or "mirrored" in module.__name__:
            continue
        for name, kernel in list(vars(module).items()):
            own = isinstance(kernel, Dispatcher) and kernel.py_func.__module__ == module.__name__
            # What kernels have compiled in is not called from Python.
            if own and not kernel.targetoptions.get("inline"):
                watch.wrap(module, name, f"kernel {name}")
    for place, names in OTHERS.items():
        module, _, kind = place.rpartition(".")
        owner = getattr(importlib.import_module(module), kind)
        for name in names:
            if hasattr(owner, name):
                watch.wrap(owner, name, f"{kind}.{name}")
    return watch


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", default="tri-tack")
    parser.add_argument("overrides", nargs="*", default=[])
    parser.add_argument("--least", type=float, default=0.1, help="smallest share that is listed [%%]")
    parser.add_argument("--repeats", type=int, default=1, help="runs without a stopwatch around every part")
    parser.add_argument("--wall", action="store_true", help="by the time of day, not of the processor")
    given = parser.parse_intermixed_args()
    from pgfmd import runner
    from pgfmd.host import launch
    from pgfmd.scene import load_scene

    clock = time.perf_counter if given.wall else time.process_time
    comm, scene = launch.world(), load_scene(given.scene, given.overrides or ["grid.n=512"])
    with launch.guarded(comm):
        # Loading compiled kernels, each at its first call, is no part of a step.
        runner.warm_up(scene.solver.scheme, scene.solver.precision)
        say = print if comm.rank == 0 else (lambda line: None)
        say(f"imports and kernels {clock():.2f} s")
        # First nothing but the transforms is watched: a stopwatch around every call takes a few percent itself.
        watch = watched(clock, False)
        for _ in range(given.repeats):
            found = run(scene, comm, watch)
            inside = watch.seconds[TRANSFORM] / found["steps"]
            say(
                f"outside the transforms {100.0 * (1.0 - inside):.1f} % of {found['steps']:.2f} s, {found['pairs']} pairs"
            )
        watch = watched(clock, True)
        found = run(scene, comm, watch)
        report(watch, found, given.least, say)


def run(scene, comm, watch: Stopwatch) -> dict:
    """A whole run in a folder of its own; seconds before, in and after its steps, its pairs and its state. Collective."""
    from pgfmd import runner
    from pgfmd.solver.simulation import Simulation

    original, found = Simulation.run, {}

    def steps(self, **named):
        watch.clear()
        found["before"] = watch.clock() - began
        state = original(self, **named)
        found.update(steps=watch.clock() - began - found["before"], state=state, pairs=self.scheme.pairs)
        return state

    Simulation.run = steps
    try:
        with tempfile.TemporaryDirectory(prefix="pgfmd-outside-") as folder:
            began = watch.clock()
            runner.run_scene(scene, comm, comm.bcast(folder), say=lambda line: None)
            found["after"] = watch.clock() - began - found["before"] - found["steps"]
    finally:
        Simulation.run = original
    return found


def report(watch: Stopwatch, found: dict, least: float, say) -> None:
    """Tells the shares, largest first."""
    steps, pairs, counters = found["steps"], found["pairs"], found["state"].counters
    say(f"before the steps {found['before']:.2f} s, after them {found['after']:.2f} s")
    say(
        f"steps {steps:.2f} s: {counters.steps} ({counters.rejected_steps} refused), {counters.newton_iterations} Newton,"
        f" {pairs} pairs, {1e3 * steps / counters.steps:.2f} ms a step, {1e3 * watch.seconds[TRANSFORM] / pairs:.3f} ms a pair"
    )
    parts = dict(watch.seconds, **{"not in any part": steps - sum(watch.seconds.values())})
    kernels = sum(seconds for part, seconds in parts.items() if part.startswith("kernel"))
    outside = 100.0 * (1.0 - watch.seconds[TRANSFORM] / steps)
    say(f"with every part watched: outside {outside:.1f} %, of that compiled kernels {100.0 * kernels / steps:.1f} %")
    for part, seconds in sorted(parts.items(), key=lambda entry: -entry[1]):
        if 100.0 * seconds / steps >= least:
            calls = watch.calls[part]
            each = f"{1e6 * seconds / calls:9.1f} us {calls / pairs:6.3f} a pair" if calls else ""
            say(f"{100.0 * seconds / steps:6.2f} %  {part:44s} {each}")


if __name__ == "__main__":
    main()
