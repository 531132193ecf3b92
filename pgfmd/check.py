"""What a scene means before it is run: SI values, scales, cost, warnings. No MPI, nothing large allocated."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from dataclasses import dataclass

from pgfmd.cohesion import range_of_adhesion
from pgfmd.estimate import PROGRAM_BYTES, depth_of, effort_of, memory_of, punch_points
from pgfmd.parts import deepest_indentation, law_of, series_of, topography_of
from pgfmd.reference import corrugation, tabor
from pgfmd.scene_model import SECTIONS, unused_keys
from pgfmd.units import DIMENSIONS

PAPER_FACTOR = 0.156
"""Range factor of the paper's runs, with q_ref = 2 pi n/L; the automatic range of this grid is meant with it."""
PINNING_SHARE, COARSE_POINTS, JUMP_FACTOR = 0.5, 8, 0.38
"""Share of the automatic range below which lattice pinning spoils a result; points that a wavelength should have; a flat
punch jumps in zero time where kappa_inf is below this factor times n (at the automatic range)."""
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


def report(scene, ranks: int = 1) -> Report:
    """Everything that can be said about a scene, for a run on `ranks` ranks."""
    sections = {
        "Scene (SI)": list(_values(scene)),
        "Adhesion": list(_adhesion(scene)),
        "Rheology": list(_rheology(scene)),
        "Cost": list(_cost(scene, ranks)),
    }
    return Report(scene.title, sections, list(_warnings(scene, ranks)), list(_remarks(scene)))


def automatic_range(scene) -> float:
    """The range of adhesion [m] that the paper's rule gives for the scene's grid."""
    q_ref = 2.0 * math.pi * scene.grid.n / scene.grid.length
    return range_of_adhesion(
        scene.adhesion.work_of_adhesion, scene.substrate.contact_modulus, PAPER_FACTOR, q_ref
    )


def cohesive_zone(scene) -> float:
    """Length [m] of the zone at a crack where the law pulls: Dugdale's (pi/4) E* gamma/sigma_th^2, static modulus."""
    adhesion = scene.adhesion
    return math.pi / 4 * scene.substrate.contact_modulus * adhesion.work_of_adhesion / law_of(adhesion).strength ** 2


def jump_threshold(scene) -> float:
    """kappa_inf below which a flat punch jumps in zero time: 0.38 n at the automatic range, more at a shorter one."""
    return JUMP_FACTOR * scene.grid.n * (automatic_range(scene) / scene.adhesion.range) ** 2


def _values(scene) -> Iterator[Line]:
    for name, model in SECTIONS.items():
        section = getattr(scene, name)
        for field, info in model.model_fields.items():
            value = getattr(section, field)
            if value is None or value == () or field in unused_keys(scene, name):
                continue
            extra = info.json_schema_extra or {}
            yield Line(f"{name}.{field}", _plain(value), _unit(extra.get("dimension", "")), "")


def _plain(value: object) -> float | int | str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, tuple):
        return ", ".join(f"{entry:.6g}" if isinstance(entry, float) else str(entry) for entry in value)
    return value


def _unit(dimension: str) -> str:
    return DIMENSIONS[dimension].unit if dimension in DIMENSIONS else ""


def _adhesion(scene) -> Iterator[Line]:
    adhesion, punch, modulus = scene.adhesion, scene.punch, scene.substrate.contact_modulus
    energy, reach, own = adhesion.work_of_adhesion, adhesion.range, automatic_range(scene)
    yield Line("contact modulus E*", modulus, "Pa", "E/(1 - nu^2), static")
    yield Line("range rho", reach, "m", f"{reach / own:.3g} times the automatic range of this grid, {own * 1e6:.4g} um")
    if adhesion.law != "cosine":
        return
    zone = cohesive_zone(scene)
    yield Line("theoretical strength sigma_th", law_of(adhesion).strength, "Pa", "pi gamma/(2 rho)")
    spacing = scene.grid.length / scene.grid.n
    yield Line("cohesive zone at a crack", zone, "m", "(pi/4) E* gamma/sigma_th^2, static")
    yield Line("grid points in the cohesive zone", zone / spacing, "", "1.6 at the automatic range")
    if punch.radius is not None:
        number = tabor.flat_punch(punch.radius, modulus, energy, reach)
        yield Line("Tabor number of the whole punch", number, "", "sqrt(a gamma/E*)/rho")
    summit = topography_of(punch).summit_radius
    if math.isfinite(summit) and summit > 0.0:
        yield Line("summit radius", summit, "m")
        number = tabor.asperity(summit, modulus, energy, reach)
        yield Line("Tabor number of a summit", number, "", "R^(1/3) (gamma/E*)^(2/3)/rho")
    if punch.pattern in (*CORRUGATIONS, "sinusoid"):
        stored = _full_contact_energy(punch, modulus)
        note = "adhesive over elastic energy of full contact; hardly sticky below 1/2"
        yield Line("gamma/v_full", energy / stored, "", note)


def _full_contact_energy(punch, modulus: float) -> float:
    """Elastic energy per area [J/m^2] of static full contact."""
    wave_number = 2.0 * math.pi / punch.wavelength
    if punch.pattern == "sinusoid":
        return corrugation.spectrum_energy([punch.amplitude / 2] * 2, [wave_number] * 2, modulus)
    return corrugation.full_contact_energy(punch.amplitude, wave_number, modulus)


def _rheology(scene) -> Iterator[Line]:
    series = series_of(scene.rheology)
    creep = series.to_creep()
    yield Line("kappa_inf", series.kappa_inf, "", "E(infinity)/E(0)")
    yield Line("J_inf", creep.J_inf, "", "1/kappa_inf")
    yield Line("time to move by rho", scene.adhesion.range / scene.drive.speed, "s", "rho/v")
    for index, (tau, kappa) in enumerate(zip(series.tau, series.kappa, strict=True), 1):
        yield Line(f"relaxation time {index}", float(tau), "s", f"kappa = {kappa:.4g}")
    for index, (time, weight) in enumerate(zip(creep.retardation_times, creep.J, strict=True), 1):
        yield Line(f"retardation time {index}", float(time), "s", f"J = {weight:.4g}")


def _cost(scene, ranks: int) -> Iterator[Line]:
    points, memory, effort = punch_points(scene), memory_of(scene, ranks), effort_of(scene)
    total = ranks * (memory.peak + PROGRAM_BYTES)
    yield Line("grid spacing h", scene.grid.length / scene.grid.n, "m")
    yield Line("points under the punch", points.total, "", f"in a block of {points.nb} x {points.nb}")
    yield Line("fields per rank", memory.peak, "B", f"on {_ranks(ranks)}")
    yield Line("memory in all", total, "B", f"with {PROGRAM_BYTES / 1e6:.0f} MB for the program on each rank")
    yield Line("expected steps", _rounded(effort.steps), "", "an estimate, within a factor of 3")
    yield Line("expected transform pairs", _rounded(effort.pairs), "", "an estimate, within a factor of 3")
    note = "a rough guess; `pgfmd bench transform` measures a pair"
    yield Line("expected time on one rank", effort.seconds, "s", note)


def _ranks(count: int) -> str:
    return "1 rank" if count == 1 else f"{count} ranks"


def _rounded(value: float) -> int:
    """Two significant digits: more would pretend to be known."""
    digits = max(0, math.floor(math.log10(max(value, 1.0))) - 1)
    return int(round(value / 10**digits)) * 10**digits


def _warnings(scene, ranks: int) -> Iterator[str]:
    punch, adhesion = scene.punch, scene.adhesion
    own, spacing = automatic_range(scene), scene.grid.length / scene.grid.n
    if adhesion.law == "cosine" and adhesion.range < 0.999 * own:
        text = f"adhesion.range is {adhesion.range / own:.2g} of the automatic range of this grid, {own * 1e6:.4g} um: "
        if adhesion.range < PINNING_SHARE * own:
            yield text + "rho too small for the grid; below half of the automatic range lattice pinning spoils the result"
        else:
            yield text + "at the automatic range the mesh error is a percent or two, at half of it lattice pinning spoils the result"
    if punch.wavelength is not None and punch.wavelength < COARSE_POINTS * spacing:
        points = punch.wavelength / spacing
        needed = math.ceil(COARSE_POINTS * scene.grid.length / punch.wavelength)
        yield f"grid.n: only {points:.3g} points a wavelength; below {COARSE_POINTS} asperities are distorted, use n >= {needed}"
    yield from _preload_warnings(scene)
    yield from _speed_warnings(scene)
    if scene.substrate.boundary == "periodic" and punch.radius is not None and scene.grid.length < 3.0 * punch.radius:
        yield (
            f"grid.length is only {scene.grid.length / punch.radius:.3g} punch radii: its periodic images carry part of the load; "
            'the paper has 4, substrate.boundary = "free" has no images'
        )
    needed, present = ranks * (memory_of(scene, ranks).peak + PROGRAM_BYTES), _physical_memory()
    if needed > 0.9 * present:
        yield f"memory: {needed / 1e9:.3g} GB are needed in all, this machine has {present / 1e9:.3g} GB"


def _preload_warnings(scene) -> Iterator[str]:
    """Preloads that a static punch in full contact would reach only very deep, if at all."""
    punch, substrate = scene.punch, scene.substrate
    if punch.radius is None or math.isfinite(substrate.thickness) or substrate.compliance_file:
        return
    deepest, depth = deepest_indentation(scene), depth_of(scene)
    if depth > deepest:
        yield (
            f"drive.preload: even in full contact a static punch carries it only at an indentation of {depth * 1e6:.3g} um, "
            f"but the approach is given up at {deepest * 1e6:.3g} um; reduce the preload"
        )
    elif depth > 0.2 * punch.radius:
        yield (
            f"drive.preload: an indentation of about {depth * 1e6:.3g} um is {depth / punch.radius:.2g} of the punch's radius; "
            "linear elasticity of small slopes does not hold there"
        )


def _speed_warnings(scene) -> Iterator[str]:
    series = series_of(scene.rheology)
    if not series.elements:
        return
    for name, speed in (("speed", scene.drive.speed), ("retract_speed", scene.drive.retract_speed)):
        passing = scene.adhesion.range / speed
        if passing < 0.01 * float(series.tau.min()):
            yield (
                f"drive.{name}: the punch moves by rho in {passing:.2g} s, far below the shortest relaxation time, "
                f"{series.tau.min():.2g} s: nothing relaxes while bonds break, the material is a glass of modulus kappa_inf E*"
            )
            return


def _remarks(scene) -> Iterator[str]:
    punch, series = scene.punch, series_of(scene.rheology)
    least = jump_threshold(scene)
    if scene.adhesion.law == "cosine" and series.kappa_inf < least:
        what = "the scene is elastic" if not series.elements else f"kappa_inf = {series.kappa_inf:.4g} is below {least:.3g}"
        yield (
            f"jumps: {what} (flat punches: about 0.38 n at the automatic range), so the surface may jump in zero time; "
            "such jumps are listed in events.csv with the energy they release"
        )
    if scene.substrate.boundary == "periodic" and punch.radius is not None:
        yield (
            "periodic cell: the far displacement u_inf is extrapolated; for a flat punch and L = 4a it is about 11 % off that of a "
            'free surface. substrate.boundary = "free" needs no such correction and costs the same'
        )
    if series.elements:
        longest = float(series.to_creep().retardation_times.max())
        passing = scene.adhesion.range / max(scene.drive.speed, scene.drive.retract_speed)
        if passing > 1000.0 * longest:
            yield f"speed: rho/v = {passing:.2g} s is 1000 times the longest retardation time; the test is nearly quasi-static"


def _physical_memory() -> float:
    return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
