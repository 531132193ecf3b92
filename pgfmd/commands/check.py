"""What a scene means before it is run: SI values, scales, cost, warnings. No MPI, nothing large allocated."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pgfmd import coarsening
from pgfmd.forecast import map_advice
from pgfmd.forecast.advice import remarks, warnings
from pgfmd.forecast.effort import Effort, ahead_summary, effort_of
from pgfmd.forecast.estimate import FILE_BYTES, OWN_BYTES, memory_of, punch_points
from pgfmd.forecast.indentation import punch_speeds
from pgfmd.forecast.plausibility import face_of
from pgfmd.forecast.run_times import ranks_of as _ranks
from pgfmd.forecast.run_times import run_times
from pgfmd.physics.adhesion.registry import law_of
from pgfmd.reference import corrugation, maugis, tabor
from pgfmd.scene import Scene
from pgfmd.scene.fields import extra_of, written
from pgfmd.scene.model import SECTIONS, unused_keys
from pgfmd.scene.precision import best_precision
from pgfmd.scene_objects import automatic_range, confirm, machine_compliance, series_of, topography_of
from pgfmd.schemes import registry
from pgfmd.symmetry import expected
from pgfmd.units import DIMENSIONS, handy_quantity

if TYPE_CHECKING:
    from pgfmd.scene.model import Punch

TELLING_SPREAD = 1.5
"""Factor of uncertainty up to which an estimate is printed as a number; above it, as a range."""
CORRUGATIONS = {"triangular": "tri", "hexagonal": "hex"}


@dataclass(frozen=True)
class Line:
    """One number of the report: name, value, SI unit, and what it says."""

    name: str
    value: float | int | str
    unit: str = ""
    note: str = ""


@dataclass(frozen=True)
class Report:
    """Sections of lines; warnings: what may spoil the result; remarks: what is good to know."""

    title: str
    sections: dict[str, list[Line]]
    warnings: list[str]
    remarks: list[str]

    def __getitem__(self, name: str) -> float | int | str:
        """The value of the line with this name."""
        return next(line.value for lines in self.sections.values() for line in lines if line.name == name)

    def __contains__(self, name: str) -> bool:
        return any(line.name == name for lines in self.sections.values() for line in lines)


def check(source: Scene | str | Path | Mapping[str, Any], ranks: int = 1, *, source_name: str = "") -> Report:
    """Scales, memory, cost and warnings of a scene before it is run on a number of ranks, as `pgfmd check`.

    source: a scene, or what one is made from; source_name: what messages call it. Raises SceneError for a scene that
    can't be run.
    """
    scene = source if isinstance(source, Scene) else Scene(source)
    confirm(scene, source_name or (source if isinstance(source, str) else scene.title or "scene"), ranks)
    return report(scene, ranks)


def report(scene: Scene, ranks: int = 1) -> Report:
    """All lines about a scene, for a run on `ranks` ranks."""
    sections = {
        "Scene (SI)": list(_values(scene)),
        "Punch": list(_punch(scene)),
        "Adhesion": list(_adhesion(scene)),
        "Rheology": list(_rheology(scene)),
        "Cost": list(_cost(scene, ranks)),
    }
    times, advice = run_times(scene, ranks)
    sections["Cost"] += [_time(count, seconds, note, effort_of(scene).spread) for count, seconds, note in times]
    return Report(scene.title, sections, list(warnings(scene, ranks)), [*remarks(scene), *advice])


def cohesive_zone(scene: Scene) -> float:
    """Length [m] of the zone at a crack where the law pulls: Dugdale's (pi/4) E* gamma/sigma_th^2, static modulus."""
    adhesion = scene.adhesion
    return math.pi / 4 * scene.substrate.contact_modulus * adhesion.work_of_adhesion / law_of(adhesion).strength ** 2


def _values(scene: Scene) -> Iterator[Line]:
    for name, model in SECTIONS.items():
        section = scene.section(name)
        for field, info in model.model_fields.items():
            value = getattr(section, field)
            if value is None or value == () or field in unused_keys(scene, name):
                continue
            extra = extra_of(info)
            if field in ("step", "repeat"):
                yield from _programme(f"{name}.{field}", written(value, extra))
                continue
            note = f"because {best_precision(scene).reason}" if _is_chosen(scene, field) else ""
            yield Line(f"{name}.{field}", _plain(value), _unit(extra.get("dimension", "")), note)


def _programme(name: str, found: Any) -> Iterator[Line]:
    """The steps of a programme, a line for each, or its repeats."""
    for number, table in enumerate(found if isinstance(found, list) else [found], 1):
        texts = {key: ", ".join(value) if isinstance(value, list) else str(value) for key, value in table.items()}
        what = texts.pop("do", "") or texts.pop("times")
        note = ", ".join(f"{key} {text}" for key, text in texts.items())
        yield Line(f"{name}.{number}" if isinstance(found, list) else f"{name}.times", what, "", note)


def _is_chosen(scene: Scene, field: str) -> bool:
    """Whether a key's value was chosen by `best_precision`."""
    return field == "precision" and scene.solver.automatic_precision


def _plain(value: Any) -> float | int | str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return ", ".join(f"{entry:.6g}" if isinstance(entry, float) else str(entry) for entry in value)
    return value


def _unit(dimension: str) -> str:
    return DIMENSIONS[dimension].unit if dimension in DIMENSIONS else ""


def _punch(scene: Scene) -> Iterator[Line]:
    face = face_of(scene)
    note = f"{handy_quantity(face.relief, 'length')} from the lowest to the highest point of the face"
    yield Line("height range", face.relief, "m", note)
    yield Line("steepest slope", face.slope, "", "1 is 45 degrees; small slopes are assumed")
    if scene.punch.pattern == "rough":
        yield from _roughness(scene.punch)
    yield from (Line(*line) for line in map_advice.facts_of(scene))


def _roughness(punch: Punch) -> Iterator[Line]:
    """What was asked of a random face, and what of it lies below the punch, without curvature and layers."""
    surface = topography_of(punch).random
    period, here = surface.expected, surface.realised(punch.radius)
    period_text, count = handy_quantity(punch.period, "length"), surface.waves()[0].size
    yield Line("waves of the random face", count, "", f"in a period of {period_text}, with uniform phases")
    asked = {name: "asked for" if getattr(punch, name) else "by its spectrum" for name in ("rms_height", "rms_slope")}
    where = "in the cell" if punch.radius is None else "below the punch"
    note = f"{where}; {handy_quantity(period.height, 'length')} over a period, {asked['rms_height']}"
    yield Line("rms height", here.height, "m", note)
    yield Line("rms slope", here.slope, "", f"{where}; {period.slope:.3g} over a period, {asked['rms_slope']}")
    note = f"{where}, (z_xx + z_yy)/2; {period.curvature:.3g} 1/m over a period, by its spectrum"
    yield Line("rms curvature", here.curvature, "1/m", note)
    yield Line("largest slope of the random face", here.steepest, "", f"{where}, as far as its points tell")


def _adhesion(scene: Scene) -> Iterator[Line]:
    adhesion, punch, modulus = scene.adhesion, scene.punch, scene.substrate.contact_modulus
    energy, reach, own = adhesion.work_of_adhesion, adhesion.range, automatic_range(scene)
    yield Line("contact modulus E*", modulus, "Pa", "E/(1 - nu^2), static")
    yield Line("range rho", reach, "m", f"{reach / own:.3g} times the automatic range of this grid, {own * 1e6:.4g} um")
    if not adhesion.attractive:
        return
    law, points = law_of(adhesion), cohesive_zone(scene) * scene.grid.n / scene.grid.length
    yield Line("theoretical strength sigma_th", law.strength, "Pa", law.strength_note)
    if law.reach != reach:
        yield Line("reach of the law", law.reach, "m", f"{law.reach / reach:.3g} rho; no traction beyond")
    yield from (Line(*fact) for fact in law.facts())
    yield Line("cohesive zone at a crack", cohesive_zone(scene), "m", "(pi/4) E* gamma/sigma_th^2, static")
    # It goes with the square of the range.
    note = f"{points * (own / reach) ** 2:.2g} at the automatic range"
    yield Line("grid points in the cohesive zone", points, "", note)
    if punch.radius is not None:
        number = tabor.flat_punch(punch.radius, modulus, energy, reach)
        yield Line("Tabor number of the whole punch", number, "", "sqrt(a gamma/E*)/rho")
    summit = topography_of(punch).summit_radius
    if math.isfinite(summit) and summit > 0.0:
        yield Line("summit radius", summit, "m")
        number = tabor.asperity(summit, modulus, energy, reach)
        yield Line("Tabor number of a summit", number, "", "R^(1/3) (gamma/E*)^(2/3)/rho")
        number = maugis.transition_parameter(summit, modulus, energy, law.strength)
        yield Line("Maugis's lambda of a summit", number, "", "by its strength; 0.1 is DMT, 5 JKR")
    if punch.pattern in (*CORRUGATIONS, "sinusoid", "rough"):
        stored = _full_contact_energy(punch, modulus)
        note = "adhesive over elastic energy of full contact; hardly sticky below 1/2"
        yield Line("gamma/v_full", energy / stored, "", note)


def _full_contact_energy(punch: Punch, modulus: float) -> float:
    """Elastic energy per area [J/m^2] of static full contact."""
    if punch.pattern == "rough":
        wave_numbers, amplitudes = topography_of(punch).random.waves()
        # A wave and its opposite.
        return 2.0 * corrugation.spectrum_energy(amplitudes / 2, wave_numbers, modulus)
    wave_number = 2.0 * math.pi / punch.wavelength
    if punch.pattern == "sinusoid":
        return corrugation.spectrum_energy([punch.amplitude / 2] * 2, [wave_number] * 2, modulus)
    return corrugation.full_contact_energy(punch.amplitude, wave_number, modulus)


def _rheology(scene: Scene) -> Iterator[Line]:
    series = series_of(scene.rheology)
    creep = series.to_creep()
    yield Line("kappa_inf", series.kappa_inf, "", "instantaneous over relaxed modulus")
    yield Line("J_inf", creep.J_inf, "", "1/kappa_inf")
    note = "rho/v, mean of the approach" if machine_compliance(scene) else "rho/v"
    yield Line("time to move by rho", scene.adhesion.range / punch_speeds(scene)[0], "s", note)
    for index, (tau, kappa) in enumerate(zip(series.tau, series.kappa, strict=True), 1):
        yield Line(f"relaxation time {index}", float(tau), "s", f"kappa = {kappa:.4g}")
    yield from (Line(*line) for line in registry.scheme_of(scene).lines_of(scene))
    for index, (time, weight) in enumerate(zip(creep.retardation_times, creep.J, strict=True), 1):
        yield Line(f"retardation time {index}", float(time), "s", f"J = {weight:.4g}")


def _cost(scene: Scene, ranks: int) -> Iterator[Line]:
    points, memory, effort = punch_points(scene), memory_of(scene, ranks), effort_of(scene)
    yield Line("grid spacing h", scene.grid.length / scene.grid.n, "m")
    yield Line("points under the punch", points.total, "", f"in a block of {points.nb} x {points.nb}")
    yield _symmetry(scene)
    yield _coarse_grid(scene)
    yield Line("fields per rank", memory.peak, "B", f"on {_ranks(ranks)}")
    program = f"{OWN_BYTES / 1e6:.0f} MB for the program on each rank and {FILE_BYTES / 1e6:.0f} MB for its files"
    yield Line("memory in all", memory.in_all(ranks), "B", f"with {program}")
    yield _expected("expected steps", effort.steps, effort)
    yield _expected("expected transform pairs", effort.pairs, effort)
    ahead, share = ahead_summary(scene)
    if ahead:
        yield Line("run ahead", ahead, "", f"places the snapshots before the preload; {share}")


def _time(ranks: int, seconds: float, note: str, spread: float) -> Line:
    """The expected time on some ranks; a range where the number of pairs is one."""
    name = f"expected time on {_ranks(ranks)}"
    if spread <= TELLING_SPREAD:
        return Line(name, seconds, "s", note)
    shortest, longest = (handy_quantity(seconds * factor, "time", 2) for factor in (1.0 / spread, spread))
    return Line(name, f"{shortest} to {longest}", "", note)


def _expected(name: str, value: float, effort: Effort) -> Line:
    """An estimate; where it may be far off, the range that it is in."""
    if effort.spread <= TELLING_SPREAD:
        return Line(name, _rounded(value), "", f"an estimate, within a factor of {effort.spread:.2g}")
    why = (
        f"no better is known of scenes with {effort.unlike}"
        if effort.unlike
        else f"no better is known of {effort.kind} scenes"
    )
    return Line(name, f"{_rounded(value / effort.spread)} to {_rounded(value * effort.spread)}", "", why)


def _symmetry(scene: Scene) -> Line:
    found = expected(scene)
    value = {"": "none", "x": "x", "xy": "x, y"}[found.mirror]
    if not found.mirror:
        return Line("mirror symmetry", value, "", f"all points are stepped: {found.reason}")
    part = {"x": "half", "xy": "a quarter"}[found.mirror]
    return Line("mirror symmetry", value, "", f"{part} of the points stand for all, and {part} of the work is done")


def _coarse_grid(scene: Scene) -> Line:
    found = coarsening.expected(scene)
    if not found.factor:
        return Line("coarser grid", "none", "", found.reason)
    m = found.factor
    return Line("coarser grid", scene.grid.n // m, "", f"cells a side of {m} x {m} points, which save transform pairs")


def _rounded(value: float) -> int:
    """Two significant digits: more would pretend to be known."""
    digits = max(0, math.floor(math.log10(max(value, 1.0))) - 1)
    return round(value / 10**digits) * 10**digits
