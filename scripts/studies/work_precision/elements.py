"""What Maxwell elements cost: equal steps with few and many of them. Panels of run.py.

`replayed`: the scheme inertialess. The steps that a run with one element has chosen are taken again with 1 and with 20
elements, with and without the energy audit. The 20 have nearly the same relaxation time, so that the surface moves
alike and solves take as many transforms: what is left is the cost of the elements themselves.
`gfmd_steps`: single steps of the scheme gfmd with 0, 1 and 5 elements.

Times are processor times of single steps, the best of several rounds, the longest of all ranks.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator

from pgfmd.assemble import assemble
from pgfmd.benchmark.work_precision import Row
from pgfmd.scene import load_scene
from pgfmd.solver.simulation import Simulation

SCENE = "tri-tack"
ALIKE = (
    "rheology.model=geometric", "rheology.elements=20", "rheology.time_ratio=1.002", "rheology.exponent=0",
    "rheology.relaxation_time=392.5 us",
)  # fmt: skip
"""20 elements, of 392.5 to 407.7 us: as viscous as one of 400 us."""
LADDER = (
    "rheology.model=geometric", "rheology.elements=5", "rheology.time_ratio=6", "rheology.exponent=0.8",
    "rheology.relaxation_time=400 us",
)  # fmt: skip
STILL = ("rheology.model=elastic", "solver.gfmd.omega=1000 rad/s", "solver.gfmd.dt=1e-6 s")


class Recording:
    """A controller that notes the steps which another one takes."""

    def __init__(self, controller):
        self.controller, self.steps = controller, []

    def advance(self, state, phase, until: float = math.inf):
        """Takes a step, and notes its length and why it ended."""
        trial, why = self.controller.advance(state, phase, until)
        self.steps.append((trial.step, why))
        return trial, why


class Replay:
    """A controller that takes the noted steps again, and times each."""

    def __init__(self, scheme, steps: list[tuple[float, str]]):
        self.scheme, self.steps, self.seconds, self.unsolved = scheme, steps, [], 0

    def advance(self, state, phase, until: float = math.inf):
        """Takes the next of the noted steps, whatever its error."""
        step, why = self.steps[len(self.seconds)]
        start = time.process_time()
        trial = self.scheme.try_step(state, phase, step)
        self.unsolved += not trial.converged
        state.counters.newton_iterations += trial.newton_iterations
        self.scheme.accept(state, trial)
        self.scheme.measure(state)
        self.seconds.append(time.process_time() - start)
        return trial, why


def replayed(
    comm, n: int, speed: str, most: int, rounds: int, say: Callable[[str], None]
) -> Iterator[Row]:  # fmt: skip
    """Rows of the steps with 1 and 20 elements, without and with the audit: x = N, core_seconds of all steps.

    speed: of the punch; most: number of steps, at most. Collective.
    """
    base = (f"drive.speed={speed}",)
    first = _simulation(comm, n, base, False)
    first.max_steps = most
    recording = Recording(first.controller)
    first.controller = recording
    first.run()
    kinds = [(1, False, ()), (20, False, ALIKE), (1, True, ()), (20, True, ALIKE)]
    best: list[list[float]] = [[math.inf] * len(recording.steps) for _ in kinds]
    done = []
    for _ in range(rounds):
        done.clear()
        for i, (_, audit, spectrum) in enumerate(kinds):
            simulation = _simulation(comm, n, (*base, *spectrum), audit)
            # A punch that sticks a little longer must not end the comparison, nor one that lets go earlier.
            simulation.max_steps = len(recording.steps)
            simulation.controller = replay = Replay(simulation.scheme, recording.steps)
            simulation.run()
            best[i] = [min(pair) for pair in zip(best[i], replay.seconds, strict=False)]  # one may end early
            done.append((simulation, replay))
    steps = min(len(seconds) for seconds in best)
    for (elements, audit, _), seconds, (simulation, replay) in zip(kinds, best, done, strict=True):
        if replay.unsolved:
            say(f"N = {elements}: {replay.unsolved} of {steps} steps were not solved")
        spent = sum(max(comm.allgather(value)) for value in seconds[:steps])
        label = f"n = {n}, {speed}, {'with' if audit else 'without'} audit"
        counters = simulation.state.counters
        pairs = simulation.scheme.pairs
        yield _row(f"N = {elements}", label, elements, pairs, steps, counters.newton_iterations, spent)


def _simulation(comm, n: int, overrides: tuple[str, ...], audit: bool) -> Simulation:
    keys = (f"grid.n={n}", f"output.energy={'true' if audit else 'false'}", *overrides)
    return assemble(load_scene(SCENE, keys), comm)


def gfmd_steps(comm, n: int, rounds: int) -> Iterator[Row]:
    """Rows of a step of gfmd with 0, 1 and 5 elements: x = N, core_seconds of the best step."""
    kinds = {0: STILL, 1: (), 5: LADDER}
    simulations = {
        elements: _simulation(comm, n, ("solver.scheme=gfmd", *keys), False) for elements, keys in kinds.items()
    }
    best = dict.fromkeys(kinds, math.inf)
    for simulation in simulations.values():
        simulation.scheme.start(simulation.state)
    for _ in range(rounds):
        for elements, simulation in simulations.items():
            comm.Barrier()
            start = time.process_time()
            simulation.controller.advance(simulation.state, simulation.phase)
            best[elements] = min(best[elements], max(comm.allgather(time.process_time() - start)))
    for elements in kinds:
        yield _row(f"gfmd, N = {elements}", f"n = {n}, one step", elements, 1, 1, 0, best[elements])


def _row(line: str, label: str, elements: int, pairs: int, steps: int, iterations: int, seconds: float) -> Row:
    nothing = math.nan
    return Row(
        line, label, elements, nothing, nothing, nothing, nothing, pairs, steps, 0, iterations, seconds, nothing
    )  # fmt: skip
