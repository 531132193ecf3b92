"""The analysis of a results folder: the table, the record `analysis.json`, and the pictures."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pgfmd.errors import ResultError
from pgfmd.files.regular_files import write_atomically
from pgfmd.physics.drive import ENDED_WELL
from pgfmd.plots.drawing import drawing, elsewhere, target_folder, write_picture
from pgfmd.results import Results, load
from pgfmd.results.caption import about
from pgfmd.results.curve import Loop, Measures, measure
from pgfmd.results.cycles import cycle_of
from pgfmd.results.doubts import uncertain_loop
from pgfmd.results.uncertainty import UNBALANCED, at_stake, largest_residual

from . import pictures
from .bulges import Bulge, bulges
from .compliance import CellCompliance, fit_cell_compliance
from .contact_stiffness import stiffness_table, unloading_stiffness
from .contact_table import add_areas, add_sites
from .hysteresis import Audit, Twin, audit_of, is_quasistatic, twin_of
from .low_pass import filtered
from .table import Table
from .tabor import effective_tabor

RECORD_FILE = "analysis.json"
BLURRED = 0.05
"""Scatter of u_inf, as a fraction of its range, above which the fitted line is unreliable."""
WITHIN_STEPS = "as the run found it within its steps"
BY_ROWS = "by the parabola through the lowest rows"


@dataclass(frozen=True, eq=False)
class Analysis:
    """The analysis of a folder: table, the analysed loop, and the parts that have pictures.

    predictions: of the bearing-area model (bearing_area.Prediction), by law; about: the run in one line, for pictures; cycle: the one
    that was measured, None for the whole run.
    """

    directory: Path
    table: Table
    loop: Loop
    measures: Measures
    bulges: list[Bulge]
    cell: CellCompliance | None
    audit: Audit | None
    twin: Twin | None
    twin_loop: Loop | None
    predictions: list[Any]
    about: str = ""
    cycle: int | None = None

    @property
    def record(self) -> dict:
        """The numbers of the table in SI units, as in `analysis.json`."""
        return self.table.record()

    def write(self, out: Path | None = None) -> list[Path]:
        """Write `analysis.json` and the pictures into the folder, or into `out`; returns them. ResultError if one can't
        be written."""
        folder = target_folder(self.directory, out)
        path = folder / (RECORD_FILE if self.cycle is None else f"analysis-cycle-{self.cycle}.json")
        hint = elsewhere(path, self.directory)
        text = json.dumps(self.record, indent=2, ensure_ascii=False, allow_nan=False)
        try:
            write_atomically(path, f"{text}\n".encode())
        except ResultError as problem:
            raise ResultError(f"{problem}{hint}") from problem
        except OSError as problem:
            raise ResultError(f"{path}: could not be written: {problem.strerror}{hint}") from problem
        with drawing():
            return [path, *(write_picture(draw(self), folder / name, hint) for name, draw in self._drawings())]

    def _drawings(self) -> Iterator[tuple[str, Callable[[Analysis], Any]]]:
        """Names of pictures, and the functions that draw them, for existing parts."""
        if self.bulges:
            yield "analysis-bulges.png", pictures.plot_bulges
        if self.cell:
            yield "analysis-compliance.png", pictures.plot_compliance
        if self.audit or self.twin:
            yield "analysis-hysteresis.png", pictures.plot_hysteresis
        if self.twin_loop is not None:
            yield "analysis-twin.png", pictures.plot_twin
        if self.predictions:
            yield "analysis-bearing-area.png", pictures.plot_bearing_area


def analyse(
    directory: str | Path,
    twin: str | Path | None = None,
    bearing_area: bool = False,
    asperity: str | Path | None = None,
    resolution: float | None = None,
    cycle: int | None = None,
) -> Analysis:
    """Analyses a results folder, also of an unfinished run. Reads files only.

    Args:
        directory: of the run. twin: of its quasi-static twin; "auto" runs it first, beside the run
            (quasistatic_twin.py).
        bearing_area: whether to compare with a bearing-area model. asperity: results of a run of one isolated asperity
            for this model; implies it.
        resolution: [m] of a low-pass filter for the curve, None for none. Energies of the audit are never filtered.
        cycle: number of a cycle of a programme with repeats whose forces, works and bulges are measured; None for those of
        the whole run.

    Raises:
        ResultError: if a folder can't be read, or does not contain what is needed; SceneError if its scene can't be
            read.
    """
    twin = _own_twin(directory) if twin == "auto" else twin
    with ExitStack() as stack:
        results = stack.enter_context(load(directory))
        other = stack.enter_context(load(twin)) if twin is not None else None
        single = stack.enter_context(load(asperity)) if asperity is not None else None
        whole = Loop.of(results)
        chosen = whole if cycle is None else cycle_of(results, whole, cycle).loop
        loop = chosen if resolution is None else _filtered(chosen, resolution)
        table = Table(_title_of(results, cycle))
        found = measure(loop)
        _add_forces(table, found, resolution, BY_ROWS if "pull_off_force_N" not in loop.recorded else WITHIN_STEPS)
        _add_works(table, found)
        _add_programme(table, results, whole)
        add_areas(table, results, found)
        _add_remarks(table, results)
        places = _add_stiffness_and_bulges(table, results, loop, resolution)
        add_sites(table, results, loop)
        cell = fit_cell_compliance(whole)
        _add_compliance(table, cell)
        audit, against = (
            (None, None) if cycle else (audit_of(results), twin_of(results, whole, other) if other else None)
        )
        _add_hysteresis(table, audit, against)
        _remark_unexplained(table, results, audit)
        _add_tabor(table, results, found, other)
        predictions = []
        if bearing_area or single is not None:
            from .bearing_area import add_bearing_area

            predictions = add_bearing_area(table, results, found, single)
        twin_loop = Loop.of(other) if other else None
        return Analysis(
            results.directory, table, loop, found, places, cell, audit, against, twin_loop, predictions, about(results),
            cycle,
        )  # fmt: skip


def _own_twin(directory: str | Path) -> Path:
    """The folder of the quasi-static twin, which is run if there is none."""
    from .quasistatic_twin import run_twin

    return run_twin(directory)


def _title_of(results: Results, cycle: int | None) -> str:
    part = "" if cycle is None else f", cycle {cycle} alone"
    return f"{results.scene.get('title') or results.directory.name}: {results.directory}{part}"


def _add_stiffness_and_bulges(table: Table, results: Results, loop: Loop, resolution: float | None) -> list[Bulge]:
    """Slopes, and the bulges, which are returned: of one way out."""
    single = _single_cycle(table, results, loop, resolution)
    places = bulges(single, resolution)
    _add_stiffness(table, single)
    _add_bulges(table, places)
    return places


def _single_cycle(table: Table, results: Results, loop: Loop, resolution: float | None) -> Loop:
    """The loop where it has one cycle, else its first cycle: slopes and bulges are those of one way out."""
    if loop.cycle is None or loop.cycle[0] == loop.cycle[-1]:
        return loop
    table.remarks.append("stiffness and bulges are those of cycle 1; --cycle chooses another one")
    first = cycle_of(results, Loop.of(results), 1).loop
    return first if resolution is None else _filtered(first, resolution)


def _filtered(loop: Loop, resolution: float) -> Loop:
    try:
        return filtered(loop, resolution)
    except ValueError as problem:
        raise ResultError(f"{loop.name}: the curve could not be filtered: {problem}") from problem


def _add_forces(table: Table, found: Measures, resolution: float | None, source: str) -> None:
    if resolution is not None:
        table.add("Forces", "low_pass", "low-pass filter", resolution, "m", "of the curve; pull-off and all below")
    table.add("Forces", "preload", "preload", found.preload, "N", "at the end of the approach")
    table.add("Forces", "largest_force", "largest force", found.largest_force, "N", "what the turn adds included")
    if found.pull_off:
        tension, place = found.pull_off.tension, found.pull_off.displacement
        note = source if tension > 0.0 else "no tension in the retraction"
        table.add("Forces", "pull_off_force", "pull-off force", tension, "N", note, found.pull_off.uncertainty)
        if tension > 0.0:
            note = "negative when pushed in"
            table.add("Forces", "pull_off_displacement", "at the displacement", place, "m", note)
    else:
        table.add("Forces", "pull_off_force", "pull-off force", None, "N", "the punch has not turned round yet")
    note = "largest tension in the approach"
    table.add("Forces", "snap_in_force", "snap-in force", found.snap_in.tension, "N", note, found.snap_in.uncertainty)
    if found.time_to_preload is not None:
        note = "from the first contact" if "contact" in found.areas else "from the first overlap"
        table.add("Forces", "time_to_preload", "time to the preload", found.time_to_preload, "s", note)


def _add_works(table: Table, found: Measures) -> None:
    note, spread = "work against a tensile force in the retraction", found.work_of_separation_uncertainty
    table.add("Work", "work_of_separation", "work of separation", found.work_of_separation, "J", note, spread)
    note = "net work of the loop"
    table.add("Work", "hysteresis", "hysteresis", found.hysteresis, "J", note, found.hysteresis_uncertainty)


def _add_programme(table: Table, results: Results, whole: Loop) -> None:
    """Cycles and oscillations of a programme of steps."""
    if results.scene.get("drive", {}).get("step"):
        # Not at the top: few runs have a programme.
        from .programme import add_cycles, add_oscillations

        add_cycles(table, results, whole)
        add_oscillations(table, results, whole)


def _add_remarks(table: Table, results: Results) -> None:
    """Remarks on the run as a whole."""
    _remark_unfinished(table, results)
    _remark_thinned(table, results)
    _remark_uncertain(table, results)


def _remark_unfinished(table: Table, results: Results) -> None:
    """A remark on a run that is unfinished, or ended before the punch detached."""
    finished = results.run.get("finished")
    if finished not in ENDED_WELL:
        how = f"the run has ended early ({finished})" if finished else "the run has not ended yet"
        table.remarks.append(f"{how}: pull-off force, works and shares are those up to there")


def _remark_thinned(table: Table, results: Results) -> None:
    every = results.scene.get("output", {}).get("every", 1)
    if every > 1:
        table.remarks.append(
            f"output.every = {every} left rows out of the curve: places, areas and bulges, and filtered forces, are no "
            "better than the rows that are there"
        )


def _remark_unexplained(table: Table, results: Results, audit: Audit | None) -> None:
    """A remark on an audit whose residual is too large to split the hysteresis; the criterion is that of `pgfmd
    run`."""
    if audit and largest_residual(results) > UNBALANCED * at_stake(results, audit.work):
        table.remarks.append(
            f"the energy audit leaves {largest_residual(results) * 1e9:.3g} nJ unexplained of a loop of "
            f"{audit.work * 1e9:.3g} nJ: run it again with a lower solver.accuracy before believing energies"
        )


def _remark_uncertain(table: Table, results: Results) -> None:
    """A remark on a quasi-static loop that is poorly known; the criterion is that of `pgfmd run`."""
    table.remarks += [text[0].lower() + text[1:].removesuffix(".") for text in uncertain_loop(results.run)]


def _add_stiffness(table: Table, loop: Loop) -> None:
    section, first = "Contact stiffness", unloading_stiffness(loop)
    if first:
        note = "slope over the first tenth of the preload; in a viscous run partly the glassy response"
        table.add(section, "unloading_stiffness", "at the start of unloading", first.stiffness, "N/m", note)
    preload = loop.preload
    for entry in stiffness_table(loop):
        part = round(100 * entry.load / preload)
        note = f"around {entry.load * 1e3:.3g} mN, {part} % of the preload"
        table.add(section, f"{entry.branch}_{part}_percent", entry.branch, entry.stiffness, "N/m", note)


def _add_bulges(table: Table, places: list[Bulge]) -> None:
    for number, bulge in enumerate(places, 1):
        note = f"at the displacement {bulge.displacement * 1e6:.4g} um"
        table.add("Bulges of the retraction", f"bulge_{number}_force", bulge.kind, bulge.force, "N", note)
        table.add("Bulges of the retraction", f"bulge_{number}_displacement", "", bulge.displacement, "m")


def _add_compliance(table: Table, cell: CellCompliance | None) -> None:
    if cell is None:
        return
    section, note = "Compliance of the cell", f"u_inf = F/k_cc through the origin, {cell.rows} rows"
    table.add(section, "k_cc", "k_cc", cell.stiffness, "N/m", note)
    table.add(section, "k_cc_standard_error", "standard error", cell.standard_error, "N/m")
    table.add(section, "u_inf_scatter", "scatter of u_inf", cell.scatter, "m", "root mean square around the line")
    if cell.scatter > BLURRED * cell.span:
        table.remarks.append(
            "u_inf lags behind the force in this run, and k_cc is blurred: take that of the quasi-static twin"
        )


def _add_hysteresis(table: Table, audit: Audit | None, twin: Twin | None) -> None:
    if audit:
        section = "Hysteresis by the energy audit"
        table.add(section, "audit_work", "net work", audit.work, "J")
        for key, name, value in (
            ("viscous", "taken by viscous elements", audit.viscous),
            ("released", "released in jumps", audit.released),
            ("stored", "still stored", audit.stored),
            ("residual", "unexplained", audit.residual),
        ):
            share = audit.share(value)
            note = "" if share is None else f"{100 * share:.3g} % of the net work"
            table.add(section, f"audit_{key}", name, value, "J", note)
    if twin:
        section = "Hysteresis against the quasi-static twin"
        table.add(section, "twin_hysteresis", "multistability: the twin's loop", twin.twin_loop, "J", twin.name)
        table.add(section, "multistability_share", "share of this loop", twin.multistability_share)
        note = "what the finite speed adds; two runs can't part it further"
        table.add(section, "viscous_and_coaction", "viscous losses and coaction", twin.rest, "J", note)
        table.add(section, "viscous_and_coaction_share", "share of this loop", twin.rest_share)
        table.remarks += twin.remarks


def _add_tabor(table: Table, results: Results, found: Measures, twin: Results | None) -> None:
    """The effective Tabor number of a quasi-static pull-off: of this run, or of its twin."""
    source, pull_off = results, found.pull_off
    if not is_quasistatic(results.scene) and twin is not None and is_quasistatic(twin.scene):
        source, pull_off = twin, measure(Loop.of(twin)).pull_off
    if not is_quasistatic(source.scene):
        stiff = source.scene.get("solver", {}).get("modulus") == "instantaneous"
        cure = 'with solver.modulus = "relaxed"; this run has the instantaneous one' if stiff else "give --twin"
        table.remarks.append(f"the effective Tabor number needs a quasi-static pull-off: {cure}")
        return
    from pgfmd.files.storage import SCENE_FILE
    from pgfmd.scene import load_scene

    scene = load_scene(source.directory / SCENE_FILE, require_files=False)
    if scene.punch.radius is None or pull_off is None or not scene.adhesion.attractive or pull_off.tension <= 0.0:
        return
    adhesion, modulus = scene.adhesion, scene.substrate.contact_modulus
    tabor = effective_tabor(pull_off.tension, scene.punch.radius, modulus, adhesion.range, adhesion.work_of_adhesion)
    section = "Effective Tabor number"
    table.add(section, "quasistatic_pull_off_force", "quasi-static pull-off force", pull_off.tension, "N")
    note = "of a perfectly flat punch with this pull-off force"
    table.add(section, "effective_work_of_adhesion", "work of adhesion", tabor.work_of_adhesion, "J/m^2", note)
    table.add(section, "effective_tabor_number", "Tabor number", tabor.number, "", "sqrt(a w_eff/E*)/rho")
