"""Simulated and measured loops over each other: read, corrected, filtered, shifted to one zero, how far they differ,
and the table of that."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.results.caption import about
from pgfmd.results.curve import Loop, Measures, measure
from pgfmd.results.cycles import count_of, cycle_of
from pgfmd.results.reading import Results, Run, opened
from pgfmd.units import in_si

from .compliance import (
    CellCompliance,
    corrected_experiment,
    corrected_simulation,
    fit_cell_compliance,
)
from .experiment import read_experiment
from .low_pass import filtered
from .table import Table

FIT_LEVELS = (0.2, 0.9)
"""Forces of the loading branch, as shares of the smaller preload, over which a measured zero is fitted."""
SAMPLES = 201


@dataclass(frozen=True, eq=False)
class Overlay:
    """Loops as they are drawn, runs first.

    runs: number of loops that are runs; the others are measured. measures: of each loop. changes: corrections of each
    loop, in words, "as measured" or "as simulated" if there are none. cell: k_cc of the first run, None without one.
    offsets [m]: shift of each experiment, positive inwards. differences: root mean square difference [N] of the force
    of each other loop from the first one in the retraction, over common indentations; None if there are none.
    """

    loops: list[Loop]
    runs: int
    measures: list[Measures]
    changes: list[str]
    cell: CellCompliance | None
    offsets: list[float]
    differences: list[float | None]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Curves that are compared: as they are drawn, and the table of their numbers.

    measured: index of the first experiment among the loops, None without one. about: the first run in one line, for
    pictures.
    """

    overlay: Overlay
    table: Table
    measured: int | None
    about: str

    @property
    def loops(self) -> list[Loop]:
        """The curves, the runs first."""
        return self.overlay.loops

    @property
    def measures(self) -> list[Measures]:
        """Numbers of each."""
        return self.overlay.measures

    @property
    def changes(self) -> list[str]:
        """Corrections of each, in words."""
        return self.overlay.changes


def compare(
    *sources: Run,
    machine_stiffness: float | str = math.inf,
    correct: str = "none",
    low_pass: float | str | None = None,
    offset: float | str = 0.0,
    positive_displacement: str | None = None,
    positive_force: str = "compression",
    cycle: int | None = None,
    baseline: float | str | None = None,
) -> Comparison:
    """Compares curves of runs and measured ones, as `pgfmd compare` does. `plot_comparison` draws them.

    Args:
        sources: results, or folders, of runs; and files of measured curves, if any.
        machine_stiffness: k_M [N/m] by which the experiments are corrected. correct: which curves are corrected for the
            compliance of the periodic cell: "experiment", "simulation" or "none" (`overlay`).
        low_pass: resolution [m] of a filter for all curves.
        offset: shift [m] of the experiments, positive inwards, or "fit".
        positive_displacement, positive_force, cycle: of measured curves, as for `experiment.read_experiment`; the
            cycle also of runs of programmes with repeats.
        baseline: measured force far away [N] that is subtracted; None for the one found in the rows.

    Quantities are SI numbers, or texts with units.

    Raises:
        ResultError: without a run, if a folder can't be read, or the curves can't be compared;
        MeasurementError: if the file can't be read; UnitError: for a text that is no such quantity.
    """
    stiffness = in_si(machine_stiffness, "stiffness")
    resolution = None if low_pass is None else in_si(low_pass, "length")
    moved = None if offset == "fit" else in_si(offset, "length")
    runs, experiments = load_loops(
        sources,
        positive_displacement=positive_displacement,
        positive_force=positive_force,
        cycle=cycle,
        baseline=None if baseline is None else in_si(baseline, "force"),
    )
    try:
        found = overlay(runs, experiments, correct, stiffness, resolution, moved)
    except ValueError as problem:
        raise ResultError(f"the curves could not be compared: {problem}") from None
    table = comparison_table(found, correct, stiffness, resolution)
    first = next(source for source in sources if isinstance(source, Results) or Path(source).is_dir())
    with opened(first) as results:
        text = about(results)
    return Comparison(found, table, len(runs) if experiments else None, text)


def overlay(
    runs: list[Loop],
    experiments: Sequence[Loop] = (),
    correct: str = "none",
    machine_stiffness: float = np.inf,
    resolution: float | None = None,
    offset: float | None = 0.0,
) -> Overlay:
    """Bring loops together.

    Args:
        runs: at least one. experiments: measured loops, if any.
        correct: one of `compliance.CORRECTIONS`. "experiment": F/k_cc of the first run is subtracted from each
            experiment, as in the paper's figures. "simulation": its own is added to each run. "none": no correction.
        machine_stiffness: k_M [N/m] by which the experiments are corrected, infinite for no correction.
        resolution: of the low-pass filter [m], for all loops; None for none.
        offset: shift [m] of the experiments after that, positive inwards, or None to fit it for each, so that in the
            approach the mean over forces of its indentation is that of the first run.

    Raises:
        ValueError: if the offset can't be fitted, or a filter's resolution is out of range.
    """
    cells = [fit_cell_compliance(run) for run in runs]
    stiffnesses = [cell.stiffness if cell else np.inf for cell in cells]
    changes = ["as simulated"] * len(runs)
    if correct == "simulation":
        runs = [corrected_simulation(run, stiffness) for run, stiffness in zip(runs, stiffnesses, strict=True)]
        changes = [_in_words({"+ F/k_cc": stiffness}, 0.0, "as simulated") for stiffness in stiffnesses]
    loops, offsets = list(runs), []
    for experiment in experiments:
        of_cell = stiffnesses[0] if correct == "experiment" else np.inf
        measured = corrected_experiment(experiment, machine_stiffness, of_cell)
        offsets.append(fitted_offset(runs[0], measured) if offset is None else offset)
        loops.append(measured.pushed_in_by(offsets[-1]))
        done = _in_words({"- F/k_M": machine_stiffness, "- F/k_cc": of_cell}, offsets[-1], "")
        changes.append(", ".join(filter(None, (experiment.treated, done))) or "as measured")
    if resolution is not None:
        loops = [filtered(loop, resolution) for loop in loops]
        changes = [f"{change}, filtered over {1e6 * resolution:.3g} um" for change in changes]
    differences = [rms_difference(loops[0], loop) for loop in loops[1:]]
    measures = [measure(loop) for loop in loops]
    return Overlay(loops, len(runs), measures, changes, cells[0], offsets, differences)


def _in_words(stiffnesses: dict[str, float], offset: float, untouched: str) -> str:
    """The corrections of the displacements of a curve in words: terms with their stiffness [N/m], infinite for none,
    and the shift [m]."""
    terms = [f"{name} ({value / 1e3:.4g} kN/m)" for name, value in stiffnesses.items() if np.isfinite(value)]
    if offset:
        terms.append(f"pushed in by {1e6 * offset:.4g} um")
    return ", ".join(terms) or untouched


def fitted_offset(run: Loop, measured: Loop) -> float:
    """The shift [m] of the measured loop, positive inwards, so that its approach fits that of a run.

    The mean, over forces from 0.2 to 0.9 of the smaller preload, of the difference of the indentations at which the
    loading branches first pass a force. Raises ValueError if the measured loop has no loading branch.
    """
    top = min(float(np.max(run.force)), float(np.max(measured.force)))
    levels = np.linspace(*FIT_LEVELS, 15) * top
    there, here = (_first_passage(loop, levels) for loop in (run, measured))
    if top <= 0.0 or there is None or here is None:
        raise ValueError(
            f"{measured.name}: an offset can only be fitted on a loading branch that passes "
            f"{FIT_LEVELS[0] * top:.3g} to {FIT_LEVELS[1] * top:.3g} N; give the offset itself"
        )
    return float(np.mean(there - here))


def _first_passage(loop: Loop, levels: np.ndarray) -> np.ndarray | None:
    """Indentations [m] at which the loading branch first reaches each force; None if it does not begin below them."""
    rows = slice(0, loop.preload_row + 1)
    highest = np.maximum.accumulate(loop.force[rows])
    if highest.size < 2 or highest[0] > levels[0]:
        return None
    rising = np.concatenate(([True], np.diff(highest) > 0))
    return np.interp(levels, highest[rising], loop.indentation[rows][rising])


def rms_difference(one: Loop, other: Loop) -> float | None:
    """Root mean square difference of forces [N] in the retraction, over equal steps of the common indentations."""
    retractions = []
    for loop in (one, other):
        rows = loop.branches["retraction"]
        place, force = loop.indentation[rows][::-1], loop.force[rows][::-1]
        if place.size < 2:
            return None
        retractions.append((np.maximum.accumulate(place), force))
    low, high = max(place[0] for place, _ in retractions), min(place[-1] for place, _ in retractions)
    if low >= high:
        return None
    at = np.linspace(low, high, SAMPLES)
    first, second = (np.interp(at, place, force) for place, force in retractions)
    return float(np.sqrt(np.mean((first - second) ** 2)))


def renamed(loops: list[Loop]) -> list[Loop]:
    """Loops with unique names: equal names of folders get numbers."""
    found: list[Loop] = []
    for loop in loops:
        taken, name, number = [known.name for known in found], loop.name, 2
        while name in taken:
            name, number = f"{loop.name} ({number})", number + 1
        found.append(dataclasses.replace(loop, name=name))
    return found


def load_loops(sources: Sequence[Run], **reading: Any) -> tuple[list[Loop], list[Loop]]:
    """Loops of runs, and of the measured files among the sources; names differ. reading: what `read_experiment` takes.

    Raises:
        ResultError: without a folder, or if one can't be read. MeasurementError: if a file can't.
    """
    files: list[Path] = []
    folders: list[Run] = []
    for source in sources:
        if not isinstance(source, Results) and not Path(source).is_dir() and Path(source).suffix:
            files.append(Path(source))
        else:
            folders.append(source)
    if not folders:
        raise ResultError("expected at least one folder of results to compare with; name it before the measured curve")
    runs = []
    for folder in folders:
        with opened(folder) as results:
            loop = Loop.of(results)
            cycle = reading.get("cycle")
            runs.append(loop if cycle is None or count_of(loop) == 1 else cycle_of(results, loop, cycle).loop)
    loops = renamed([*runs, *(read_experiment(path, **reading) for path in files)])
    return loops[: len(runs)], loops[len(runs) :]


def comparison_table(
    found: Overlay, correct: str = "none", machine_stiffness: float = np.inf, resolution: float | None = None
) -> Table:
    """A table of corrections, forces and energies of the curves. The arguments are as in `overlay`."""
    table, section, measured = Table(), "Displacements", found.loops[found.runs :]
    for number, (loop, change) in enumerate(zip(found.loops, found.changes, strict=True), 1):
        table.add(section, f"curve_{number}", loop.name, change)
    several = len(measured) > 1
    if measured and math.isfinite(machine_stiffness):
        whose = "of the experiments" if several else "of the experiment"
        table.add(section, "machine_stiffness", "machine stiffness, k_M", machine_stiffness, "N/m", whose)
    for number, (loop, offset) in enumerate(zip(measured, found.offsets, strict=True), found.runs + 1):
        if offset:
            key, what = ("offset", "the experiment") if not several else (f"offset_{number}", loop.name)
            table.add(section, key, "offset", offset, "m", f"by which {what} is pushed in")
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
        _add_measures(table, section, measures, loop.closed)
        if number:
            note = f"rms in the retraction, against {found.loops[0].name}"
            table.add(section, "difference", "difference of forces", found.differences[number - 1], "N", note)
    table.remarks += [text for loop in found.loops for text in loop.remarks]
    table.remarks += _remarks(found)
    return table


def _remarks(found: Overlay) -> list[str]:
    """A remark on runs that counted only overlap, if others have their contact."""
    areas = [(loop.name, measures.areas) for loop, measures in zip(found.loops, found.measures, strict=True)]
    old = [name for name, known in areas if "overlap" in known and "contact" not in known]
    if not old:
        return []
    text = f"{', '.join(old)}: run by version 0.1 of pgfmd, which counted overlap (gap < 0), not contact"
    mixed = any("contact" in known for _, known in areas)
    return [f"{text}; the areas of the other runs are of contact, and not to be compared with these" if mixed else text]


def _add_measures(table: Table, section: str, found: Measures, closed: bool) -> None:
    """The forces, works and areas of a curve, as in `pgfmd analyse`. closed: whether it has both branches."""
    table.add(section, "preload", "preload", found.preload, "N", "at the end of the approach")
    table.add(section, "largest_force", "largest force", found.largest_force, "N")
    tension, spread = (found.pull_off.tension, found.pull_off.uncertainty) if found.pull_off else (None, None)
    table.add(section, "pull_off_force", "pull-off force", tension, "N", uncertainty=spread)
    in_there = closed or found.pull_off is None
    tension, spread = (found.snap_in.tension, found.snap_in.uncertainty) if in_there else (None, None)
    table.add(section, "snap_in_force", "snap-in force", tension, "N", uncertainty=spread)
    work, spread = found.work_of_separation, found.work_of_separation_uncertainty
    table.add(section, "work_of_separation", "work of separation", work, "J", uncertainty=spread)
    work, spread = found.hysteresis, found.hysteresis_uncertainty
    note = "net work of the loop, as far as it goes" if closed else "the loop is not closed"
    table.add(section, "hysteresis", "hysteresis", work, "J", note, spread)
    for kind, areas in found.areas.items():
        if kind == "contact" or "contact" not in found.areas:
            prefix = "" if kind == "contact" else f"{kind}_"
            table.add(section, f"{prefix}area_at_preload", f"{kind} area at the preload", areas.at_preload, "m^2")
            table.add(section, f"{prefix}area_at_pull_off", f"{kind} area at pull-off", areas.at_pull_off, "m^2")
