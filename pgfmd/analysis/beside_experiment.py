"""What `pgfmd compare` reads, and the table that it prints."""

from __future__ import annotations

import math
from pathlib import Path

from pgfmd.errors import ResultError
from pgfmd.results import load

from .comparison import Overlay, renamed
from .experiment import read_experiment
from .loop import Loop
from .table import Table


def load_loops(
    sources: list[Path], positive_displacement: str = "in", positive_force: str = "compression"
) -> tuple[list[Loop], Loop | None]:
    """Loops of folders, and of the one file among them; names differ.

    Raises:
        ResultError: without a folder, with several files, or if a folder can't be read. MeasurementError: if the file
            can't.
    """
    files = [path for path in sources if not path.is_dir() and path.suffix]
    folders = [path for path in sources if path not in files]
    if not folders:
        raise ResultError("expected at least one folder of results to compare with; name it before the measured curve")
    if len(files) > 1:
        names = ", ".join(map(str, files))
        raise ResultError(f"expected one measured curve, found {names}; compare them one after the other")
    runs = []
    for folder in folders:
        with load(folder) as results:
            runs.append(Loop.of(results))
    measured = [read_experiment(path, positive_displacement, positive_force) for path in files]
    loops = renamed([*runs, *measured])
    return loops[: len(runs)], loops[-1] if measured else None


def comparison_table(
    found: Overlay, measured: bool, correct: str, machine_stiffness: float, resolution: float | None
) -> Table:
    """What has been done to the curves, and their forces and energies side by side.

    measured: whether the last loop is an experiment. The other arguments as in `comparison.overlay`.
    """
    table, section = Table(), "Corrections"
    if measured:
        given = math.isfinite(machine_stiffness)
        note = "taken off the experiment's displacement, F/k_M" if given else "nothing is taken off"
        table.add(section, "machine_stiffness", "machine stiffness", machine_stiffness, "N/m", note)
        table.add(section, "offset", "offset", found.offset, "m", "by which the experiment is pushed in")
    if found.cell is not None:
        done = {
            "experiment": "F/k_cc taken off the experiment" if measured else "no correction: there is no experiment",
            "simulation": "F/k_cc added to each simulation, with its own k_cc",
            "none": "no correction",
        }[correct]
        table.add(section, "k_cc", "compliance of the cell, k_cc", found.cell.stiffness, "N/m", done)
    if resolution is not None:
        table.add(section, "low_pass", "low-pass filter", resolution, "m", "of all curves")
    for number, (loop, measures) in enumerate(zip(found.loops, found.measures, strict=True)):
        section = f"Curve {number + 1}, {loop.name}"
        table.add(section, "largest_force", "largest force", measures.largest_force, "N")
        tension = None if measures.pull_off is None else measures.pull_off.tension
        table.add(section, "pull_off_force", "pull-off force", tension, "N")
        table.add(section, "work_of_separation", "work of separation", measures.work_of_separation, "J")
        table.add(section, "hysteresis", "hysteresis", measures.hysteresis, "J", "net work of the rows that there are")
        if number:
            note = f"rms on the way out, against {found.loops[0].name}"
            table.add(section, "difference", "difference of forces", found.differences[number - 1], "N", note)
    return table
