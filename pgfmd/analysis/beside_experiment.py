"""What `pgfmd compare` reads, and the table that it prints."""

from __future__ import annotations

import math
from pathlib import Path

from pgfmd.errors import ResultError
from pgfmd.results import load
from pgfmd.results.curve import Loop, Measures

from .comparison import Overlay, renamed
from .experiment import read_experiment
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
    """What has been done to each curve, and their forces and energies side by side.

    measured: whether the last loop is an experiment. The other arguments as in `comparison.overlay`.
    """
    table, section = Table(), "Displacements"
    for number, (loop, change) in enumerate(zip(found.loops, found.changes, strict=True), 1):
        table.add(section, f"curve_{number}", loop.name, change)
    if measured and math.isfinite(machine_stiffness):
        table.add(section, "machine_stiffness", "machine stiffness, k_M", machine_stiffness, "N/m", "of the experiment")
    if measured and found.offset:
        table.add(section, "offset", "offset", found.offset, "m", "by which the experiment is pushed in")
    if found.cell is not None:
        done = {
            "experiment": "taken off the experiment" if measured else "not used: there is no experiment",
            "simulation": "of the first run; each simulation takes up its own",
            "none": "not used; --correct takes it in",
        }[correct]
        table.add(section, "k_cc", "compliance of the cell, k_cc", found.cell.stiffness, "N/m", done)
    if resolution is not None:
        table.add(section, "low_pass", "low-pass filter", resolution, "m", "of all curves")
    for number, (loop, measures) in enumerate(zip(found.loops, found.measures, strict=True)):
        section = f"Curve {number + 1}, {loop.name}"
        _add_measures(table, section, measures)
        if number:
            note = f"rms on the way out, against {found.loops[0].name}"
            table.add(section, "difference", "difference of forces", found.differences[number - 1], "N", note)
    table.remarks += _remarks(found)
    return table


def _remarks(found: Overlay) -> list[str]:
    """Of curves whose runs counted overlap alone, beside others that know their contact."""
    areas = [(loop.name, measures.areas) for loop, measures in zip(found.loops, found.measures, strict=True)]
    old = [name for name, known in areas if "overlap" in known and "contact" not in known]
    if not old:
        return []
    text = f"{', '.join(old)}: run by version 0.1 of pgfmd, which counted overlap (gap < 0), not contact"
    mixed = any("contact" in known for _, known in areas)
    return [f"{text}; the areas of the other runs are of contact, and not to be compared with these" if mixed else text]


def _add_measures(table: Table, section: str, found: Measures) -> None:
    """The forces, works and areas of a curve, as `pgfmd analyse` has them."""
    table.add(section, "preload", "preload", found.preload, "N", "at the end of the approach")
    table.add(section, "largest_force", "largest force", found.largest_force, "N")
    tension, spread = (found.pull_off.tension, found.pull_off.uncertainty) if found.pull_off else (None, None)
    table.add(section, "pull_off_force", "pull-off force", tension, "N", uncertainty=spread)
    tension, spread = found.snap_in.tension, found.snap_in.uncertainty
    table.add(section, "snap_in_force", "snap-in force", tension, "N", uncertainty=spread)
    work, spread = found.work_of_separation, found.work_of_separation_uncertainty
    table.add(section, "work_of_separation", "work of separation", work, "J", uncertainty=spread)
    work, spread = found.hysteresis, found.hysteresis_uncertainty
    table.add(section, "hysteresis", "hysteresis", work, "J", "net work of the loop, as far as it goes", spread)
    for kind, areas in found.areas.items():
        if kind == "contact" or "contact" not in found.areas:
            prefix = "" if kind == "contact" else f"{kind}_"
            table.add(section, f"{prefix}area_at_preload", f"{kind} area at the preload", areas.at_preload, "m^2")
            table.add(section, f"{prefix}area_at_pull_off", f"{kind} area at pull-off", areas.at_pull_off, "m^2")
