"""The nouns of a scene: substrate, rheology, punch, law and drive as objects. Plain NumPy, no MPI.

What runs a scene (assemble.py) and what only looks at it (check.py, estimate.py) make them here.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from .errors import Problem, SceneError
from .map_rules import refusals
from .maps.raw import MapError
from .physics.adhesion.registry import law_of, length_of, range_by_rule
from .physics.drive import DETACHED, DISPLACEMENT, LOAD, PLACE, Drive, Phase
from .physics.film import Base, Film
from .physics.free_kernel import FreeFilm, FreeHalfSpace
from .physics.halfspace import HalfSpace, TabulatedCompliance
from .physics.heightfile import HIGHEST
from .physics.rheology import PronySeries
from .physics.topography import Topography
from .scene.programme_section import TIME
from .schemes import registry
from .solver.grid import Grid

if TYPE_CHECKING:
    from .physics.programme import Step
    from .scene.model import Punch, Rheology, Scene
    from .scene.programme_section import ProgrammeStep

Periodic = HalfSpace | TabulatedCompliance | Film
BONDED: Base = "bonded"
"""Default of how a film is attached to its base."""
PAPER_FACTOR = 0.156
"""Range factor of the paper's runs, with q_ref = 2 pi n/L: what "the automatic range of the grid" means."""
LEAST_COMPLIANCE = 1e-60
"""Compliance [m/Pa] that is not too small to be computed with; its inverse is not too large."""
SOFT_MACHINE = 1e-4
"""Load control: stiffness of the machine's spring, relative to that of the contact of the whole punch."""
SETTLED = 100.0
"""Longest retardation times after which nothing moves any more in a step that holds."""
TIME_SHARE = 1e-3
"""Share of the range of adhesion, and of the time in which the punch moves by it, that positions and times have to
tell."""


def compliance_of(scene: Scene) -> Periodic:
    """The static compliance G0 of the scene's substrate in a periodic cell (halfspace.py, film.py)."""
    substrate = scene.substrate
    if math.isfinite(substrate.thickness):
        return Film(substrate.youngs_modulus, substrate.poisson_ratio, substrate.thickness, substrate.base or BONDED)
    if substrate.compliance_file:
        return TabulatedCompliance.from_file(substrate.compliance_file)
    return HalfSpace(substrate.contact_modulus, substrate.prestrain)


def free_compliance_of(scene: Scene) -> FreeHalfSpace | FreeFilm:
    """The same of a free surface (free_kernel.py)."""
    substrate = scene.substrate
    if math.isfinite(substrate.thickness):
        return FreeFilm(
            substrate.youngs_modulus, substrate.poisson_ratio, substrate.thickness, substrate.base or BONDED
        )
    return FreeHalfSpace(substrate.contact_modulus, substrate.prestrain)


def series_of(rheology: Rheology) -> PronySeries:
    """The relaxation spectrum of a scene's [rheology]."""
    if rheology.model == "elastic":
        return PronySeries.elastic()
    if rheology.model == "single":
        return PronySeries.single(rheology.modulus_ratio, rheology.relaxation_time)
    if rheology.model == "geometric":
        return PronySeries.geometric(
            rheology.modulus_ratio, rheology.relaxation_time, rheology.elements, rheology.time_ratio, rheology.exponent
        )
    return PronySeries(np.array(rheology.kappa), np.array(rheology.tau))


def relaxation_of(scene: Scene) -> PronySeries:
    """The relaxation that a run follows: that of the scene's [rheology], none where it is quasi-static."""
    return PronySeries.elastic() if registry.scheme_of(scene).timeless else series_of(scene.rheology)


def topography_of(punch: Punch) -> Topography:
    """The lower face of a scene's [punch]."""
    names = (
        "pattern", "radius", "wavelength", "amplitude", "curvature_radius", "exponent", "layer_step", "height_jitter",
        "seed", "file", "file_size", "file_relief", "file_unit", "file_peaks", "file_detrend", "file_missing",
        "file_missing_value", "hurst", "rms_height", "rms_slope", "longest", "roll_off", "shortest", "period",
    )  # fmt: skip
    given = {name: getattr(punch, name) for name in names}
    return Topography(**{name: value for name, value in given.items() if value is not None})


def drive_of(scene: Scene) -> Drive:
    """The loading programme of a scene. Where time does not count, nothing is held.

    Under load control the speeds are about those of the punch in contact; the end of its soft spring goes that much
    faster.
    """
    drive, factor = scene.drive, 1.0
    dwell = 0.0 if registry.scheme_of(scene).timeless else drive.dwell
    if drive.control == "load":
        factor += machine_compliance(scene) * punch_stiffness(scene) / quasistatic_compliance(scene)
    approach, retract = factor * drive.speed, factor * drive.retract_speed
    found = Drive(approach, drive.preload, retract, drive.turn_time, dwell, drive.clearance, drive.control)
    return replace(found, programme=programme_of(scene)) if drive.step else found


def programme_of(scene: Scene) -> tuple[Phase, ...]:
    """The phases of a scene with steps. Raises MeasurementError or OSError for a file to follow that can't be read."""
    # Not at the top, here and below: what a scene does not use, it need not load.
    from .physics.programme import Machine, phases_of

    stiffness = punch_stiffness(scene) / quasistatic_compliance(scene)
    timeless, reach = registry.scheme_of(scene).timeless, length_of(scene.adhesion)
    series = relaxation_of(scene)
    settled = SETTLED * float(series.to_creep().retardation_times.max()) if series.elements else 1.0
    machine = Machine(load_compliance(scene), stiffness, reach, timeless, settled)
    steps = tuple(_step_of(step) for step in scene.drive.step)
    repeat = scene.drive.repeat
    if repeat is None:
        return phases_of(steps, machine)
    return phases_of(steps, machine, repeat.times, repeat.first, repeat.last)


def _step_of(step: ProgrammeStep) -> Step:
    """A step of a scene for the programme."""
    from .files.followed_path import read_path
    from .physics.programme import Step

    endings, duration = step.endings, step.duration or math.inf
    until = [(quantity, value) for quantity, value in endings if quantity != TIME]
    duration = min([duration, *(value for quantity, value in endings if quantity == TIME)])
    if step.to is not None:
        until.append((PLACE, step.to))
    if step.do == "retract" and not until and math.isinf(duration):
        until.append((DETACHED, 0.0))
    rate = {"approach": step.speed, "retract": -(step.speed or 0.0), "ramp": step.rate}.get(step.do) or 0.0
    swing = step.swing[0] if step.do == "oscillate" else 0.0
    control = LOAD if step.controls_load else DISPLACEMENT
    table = read_path(str(step.file), control) if step.file else ((), ())
    return Step(
        step.do, control, rate, duration, tuple(until), swing, step.frequency or 1.0, step.cycles or 0.0, table,
        step.turn_time,
    )  # fmt: skip


def automatic_range(scene: Scene) -> float:
    """The range of adhesion [m] that the paper's rule gives for the scene's grid."""
    q_ref = 2.0 * math.pi * scene.grid.n / scene.grid.length
    return range_by_rule(scene.adhesion, scene.substrate.contact_modulus, PAPER_FACTOR, q_ref)


def quasistatic_compliance(scene: Scene) -> float:
    """J of slow contacts: 1 of the relaxed body, and E(0)/E(infinity) of the instantaneous one, where a scheme has it."""
    return 1.0 if scene.solver.modulus == "relaxed" else 1.0 / series_of(scene.rheology).kappa_inf


def punch_stiffness(scene: Scene) -> float:
    """Static stiffness [N/m] of the contact of the whole punch, 2 a E*; half the cell for a where the punch fills
    it."""
    return 2.0 * (scene.punch.radius or 0.5 * scene.grid.length) * scene.substrate.contact_modulus


def machine_compliance(scene: Scene) -> float:
    """1/k_M [m/N] of the spring between the machine and the punch, 0 for a rigid machine; of a scene with steps, that of
    those that control the displacement."""
    drive = scene.drive
    return load_compliance(scene) if drive.control == "load" else 1.0 / drive.machine_stiffness


def load_compliance(scene: Scene) -> float:
    """1/k_M [m/N] of the soft spring by which a load is controlled."""
    return quasistatic_compliance(scene) / (SOFT_MACHINE * punch_stiffness(scene))


def springs_of(scene: Scene) -> dict[str, float]:
    """Compliance [m/N] of the machine's spring by what the machine controls, of what the programme has."""
    drive, found = scene.drive, {}
    if drive.control == "displacement" and not (drive.step and all(step.controls_load for step in drive.step)):
        found[DISPLACEMENT] = machine_compliance(scene)
    if drive.controls_load:
        found[LOAD] = load_compliance(scene)
    return found


def travel_time(scene: Scene, distance: float, force: float, inward: bool = True) -> float:
    """Time [s] in which the punch moves by `distance` [m], in or out, while the force on it changes by `force` [N] to that side.

    The machine goes that far, and as far as its spring is pressed or pulled.
    """
    drive = drive_of(scene)
    return (distance + machine_compliance(scene) * force) / (drive.speed if inward else drive.retract_speed)


def deepest_indentation(scene: Scene) -> float:
    """Indentation [m] at which an approach is given up: there linear elasticity has long lost its meaning."""
    return min(scene.punch.radius or 0.5 * scene.grid.length, scene.substrate.thickness)


def transform_side(scene: Scene, nb: int, whole_cell: bool = False, mirror: str = "") -> int:
    """Points a side of the transform, for a punch block of `nb` points a side.

    The cell's; for a free surface enough for the kernel not to wrap around, an even number for mirror images.
    """
    if scene.substrate.boundary == "periodic":
        return scene.grid.n
    # Not at the top, here and below: what a scene does not use, it need not load.
    from scipy.fft import next_fast_len

    if mirror:
        return 2 * int(next_fast_len(nb, real=True))
    return int(next_fast_len(nb + (scene.grid.n if whole_cell else nb) - 1, real=True))


def shared_out(scene: Scene, nb: int) -> tuple[int, int]:
    """What the ranks of a run share out: rows of points, in pairs but in whole planes, and in the middle of a transform the
    columns of its half spectrum. nb: rows of the punch's block."""
    rows = nb if registry.scheme_of(scene).whole_plane else (nb + 1) // 2
    return rows, transform_side(scene, nb) // 2 + 1


def confirm(scene: Scene, source: str, ranks: int = 1) -> None:
    """Look at what only the files that a scene names, and the number of ranks, can tell.

    source: how to call the scene in messages. Raises SceneError with every problem found.
    """
    problems = []
    grid = Grid(scene.grid.n, scene.grid.length)
    spacing = grid.spacing
    block_start, nb = grid.block(scene.punch.radius)
    # Near the axis, and at the rim, where profiles end and maps may.
    axis, rim = grid.coordinate(block_start + nb // 2), grid.coordinate(block_start + nb - 1 - np.arange(min(2, nb)))
    x, y = np.concatenate([[axis], rim, 0 * rim + axis]), np.concatenate([[axis], 0 * rim + axis, rim])
    try:
        with np.errstate(over="ignore", invalid="ignore"):
            raw = topography_of(scene.punch).heights(x, y)
        if not (np.abs(raw) <= HIGHEST).all():
            expected = f"a face with heights of at most {HIGHEST:g} m"
            problems.append(Problem("punch.pattern", scene.punch.pattern, expected, "look at the keys of [punch]"))
        if scene.punch.pattern == "file":
            problems += refusals(topography_of(scene.punch), spacing)
    except MapError as error:
        problems += error.problems
    except (ValueError, OSError) as error:
        dotted = "punch.file" if scene.punch.file else "punch.pattern"
        problems.append(Problem(dotted, scene.punch.file or scene.punch.pattern, "a usable topography", str(error)))
    try:
        if scene.substrate.boundary == "free":
            free_compliance_of(scene).kernel(0.0, 0.0, spacing)
        else:
            compliance = compliance_of(scene)
            # The longest and the shortest wave of the cell.
            unit, most = 2.0 * math.pi / grid.length, grid.n // 2
            found = compliance(unit * np.array([1.0, most]), unit * np.array([0.0, most]))
            if not ((found >= LEAST_COMPLIANCE) & (found <= 1.0 / LEAST_COMPLIANCE)).all():
                values = f"G0 = {found.min():g} to {found.max():g} m/Pa"
                raise ValueError(f"{values} can't be computed with; look at the units")
    except (ValueError, OSError) as error:
        own = scene.substrate.compliance_file
        dotted = "substrate.compliance_file" if own else "grid.n"
        problems.append(Problem(dotted, own or scene.grid.n, "a usable compliance", str(error)))
    problems += _overlap_problems(scene) + _time_problems(scene)
    rows, columns = shared_out(scene, nb)
    most = min(rows, columns)
    if ranks > most:
        divided = "rows of points" if registry.scheme_of(scene).whole_plane else "pairs of rows of points"
        what = divided if rows <= columns else "columns of waves"
        expected = f"work for each of the {ranks} ranks, but there is work for {most} only, by the number of {what}"
        cure = f"use {'one rank' if most == 1 else f'at most {most} ranks'}, or raise grid.n"
        problems.append(Problem("grid.n", scene.grid.n, expected, cure))
    if not problems:
        problems += registry.scheme_of(scene).problems_of(scene)
    if problems:
        raise SceneError(source, problems)


def _overlap_problems(scene: Scene) -> list[Problem]:
    """A preload that even a rigid substrate could not carry: overlaps are as deep as the punch is pressed in, at
    most."""
    law, radius = law_of(scene.adhesion), scene.punch.radius
    area = math.pi * radius**2 if radius else scene.grid.length**2
    most = law.overlap_stiffness * deepest_indentation(scene) * area
    if scene.drive.preload <= most:
        return []
    expected = f"at most {most:.3g} N, what overlaps of {deepest_indentation(scene):.3g} m can carry in this range"
    cure = "reduce it, or make adhesion.range shorter (adhesion.range_factor larger)"
    return [Problem("drive.preload", f"{scene.drive.preload:.6g} N", expected, cure)]


def _time_problems(scene: Scene) -> list[Problem]:
    """Times at which a step of the loading would be lost in rounding."""
    drive, longest = scene.drive, TIME_SHARE * scene.adhesion.range / np.finfo(float).eps
    problems = []
    if abs(drive.clearance) > longest:
        expected = f"at most {longest:.2g} m, where a position still tells parts of the range of adhesion"
        problems.append(Problem("drive.clearance", f"{drive.clearance:.3g} m", expected, "reduce it"))
    longest /= max(drive.speed, drive.retract_speed)
    if not registry.scheme_of(scene).timeless and drive.dwell > longest:
        expected = f"at most {longest:.2g} s, after which t still tells the steps of the retraction"
        problems.append(Problem("drive.dwell", f"{drive.dwell:.3g} s", expected, "reduce it, or the speeds"))
    return problems
