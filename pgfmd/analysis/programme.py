"""What programmes of steps add to an analysis: the numbers of each cycle, and the dynamic stiffness of oscillations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import MeasurementError, SceneError
from pgfmd.files.storage import SCENE_FILE
from pgfmd.results import Results
from pgfmd.results.curve import Loop, measure
from pgfmd.results.cycles import Cycle, count_of, cycles_of

from .table import Table

SHOWN = 6
"""Cycles of a longer programme that a table shows, first ones and last ones."""
LINEAR = 0.1
"""Largest amplitude, in ranges of adhesion, at which a contact is taken to answer linearly."""
ROWS_A_CYCLE = 16
"""Fewest rows in a cycle of an oscillation that its stiffness is found from."""


@dataclass(frozen=True)
class DynamicStiffness:
    """Storage and loss of a contact [N/m] at a frequency [Hz], in a step of a programme; amplitude [m] of the punch.

    K = K' + i K'' with F = -K d for displacement and force that go like exp(i omega t).
    """

    cycle: int
    stage: int
    frequency: float
    storage: float
    loss: float
    amplitude: float

    @property
    def loss_tangent(self) -> float:
        """K''/K'."""
        return self.loss / self.storage


def stiffness_of(
    time: NDArray[np.float64], displacement: NDArray[np.float64], force: NDArray[np.float64], frequency: float
) -> tuple[complex, float]:
    """K [N/m] and the amplitude [m] from rows of whole cycles: times [s], displacements [m], forces [N], (rows,) each.

    The rows are fitted by a sine of this frequency [Hz] on a parabola, because a viscoelastic contact drifts.
    """
    t = time - time[0]
    omega = 2.0 * math.pi * frequency
    basis = np.stack([np.cos(omega * t), np.sin(omega * t), np.ones_like(t), t / t[-1], (t / t[-1]) ** 2], axis=1)
    # Each row stands for the time around it, as steps may be uneven.
    weight = np.sqrt(np.gradient(t))[:, None]
    (cosine, sine), (force_cosine, force_sine) = (
        np.linalg.lstsq(weight * basis, weight[:, 0] * values, rcond=None)[0][:2] for values in (displacement, force)
    )
    moved, pressed = complex(cosine, -sine), complex(force_cosine, -force_sine)
    return -pressed / moved, abs(moved)


def dynamic_stiffnesses(results: Results, loop: Loop) -> Iterator[DynamicStiffness]:
    """The dynamic stiffness in each oscillation of a run that is over, from the last of its full cycles, half of them.

    Raises ResultError if the scene of the run can't be read, MeasurementError for too few rows.
    """
    if loop.stage is None or loop.cycle is None or "oscillate" not in loop.phase:
        return
    from pgfmd.scene import load_scene

    steps = load_scene(results.directory / SCENE_FILE, require_files=False).drive.step
    oscillating = loop.phase == "oscillate"
    for cycle in np.unique(loop.cycle[oscillating]):
        for stage in np.unique(loop.stage[oscillating & (loop.cycle == cycle)]):
            rows = np.flatnonzero(oscillating & (loop.cycle == cycle) & (loop.stage == stage))
            step = steps[int(stage) - 1]
            frequency, cycles = float(step.frequency or 1.0), float(step.cycles or 0.0)
            if cycles < 1.0 or (rows[-1] == len(loop.time) - 1 and not results.run.get("finished")):
                # Less than a full cycle says nothing.
                continue
            # The last cycle is the one in which the amplitude falls.
            end = loop.time[rows[-1]] - 1.0 / frequency
            used = max(math.floor(0.5 * cycles), 1)
            within = rows[(loop.time[rows] <= end) & (loop.time[rows] >= end - used / frequency)]
            if len(within) < ROWS_A_CYCLE * used:
                raise MeasurementError(
                    f"{results.directory}: step {int(stage)}: {len(within)} rows in {used} cycles are too few for a "
                    f"stiffness, which takes {ROWS_A_CYCLE} a cycle: run it with a smaller output.every, or more cycles"
                )
            time, displacement, force = (values[within] for values in (loop.time, loop.displacement, loop.force))
            stiffness, amplitude = stiffness_of(time, displacement, force, frequency)
            yield DynamicStiffness(int(cycle), int(stage), frequency, stiffness.real, stiffness.imag, amplitude)


def add_oscillations(table: Table, results: Results, loop: Loop) -> None:
    """Storage and loss of the contact for each oscillation."""
    section = "Dynamic stiffness of the contact"
    try:
        for found in dynamic_stiffnesses(results, loop):
            key = f"step_{found.stage}" + (f"_cycle_{found.cycle}" if count_of(loop) > 1 else "")
            note = f"step {found.stage}, amplitude {found.amplitude * 1e9:.3g} nm"
            table.add(section, f"{key}_frequency", "frequency", found.frequency, "Hz", note)
            table.add(section, f"{key}_storage", "storage", found.storage, "N/m", "in phase")
            table.add(section, f"{key}_loss", "loss", found.loss, "N/m", f"tan delta {found.loss_tangent:.3g}")
            table.remarks += _doubts_of(found, float(results.run.get("range_m") or math.inf))
    except (MeasurementError, SceneError) as error:
        table.remarks.append(str(error))


def _doubts_of(found: DynamicStiffness, reach: float) -> Iterator[str]:
    """What spoils a dynamic stiffness; reach [m]: range of adhesion."""
    where = f"step {found.stage}, cycle {found.cycle}"
    if found.loss < 0.0:
        yield f"{where}: the loss of the contact is negative, so it is below its error: lower solver.accuracy"
    if found.amplitude > LINEAR * reach:
        yield (
            f"{where}: the amplitude of the punch, {found.amplitude * 1e9:.3g} nm, is more than {100 * LINEAR:g} % of the "
            "range of adhesion: the contact may not answer linearly"
        )


def add_cycles(table: Table, results: Results, loop: Loop) -> None:
    """The numbers of each cycle, of the first and the last ones where there are many; all are in `run.json`."""
    count = count_of(loop)
    if count == 1:
        return
    cycles = list(cycles_of(results, loop))
    left_out = range(SHOWN // 2, count - SHOWN // 2) if count > SHOWN else range(0)
    for k, cycle in enumerate(cycles):
        if k not in left_out:
            _add_cycle(table, cycle)
    if left_out:
        table.remarks.append(f"cycles {left_out[0] + 1} to {left_out[-1] + 1} are not shown: see cycles in run.json")


def _add_cycle(table: Table, cycle: Cycle) -> None:
    section, found, key = "Cycles", measure(cycle.loop), f"cycle_{cycle.number}"
    pull_off = found.pull_off.tension if found.pull_off else None
    table.add(section, f"{key}_pull_off_force", f"cycle {cycle.number}: pull-off force", pull_off, "N")
    table.add(section, f"{key}_work_of_separation", "work of separation", found.work_of_separation, "J")
    note = "net work of the cycle"
    table.add(section, f"{key}_hysteresis", "hysteresis", found.hysteresis, "J", note)
    if cycle.numbers["contact_time_s"] is not None:
        table.add(section, f"{key}_contact_time", "in contact", cycle.numbers["contact_time_s"], "s")
