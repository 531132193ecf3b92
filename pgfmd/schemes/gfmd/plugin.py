"""The scheme gfmd and scenes: building it, its cost, and remarks on its inertia."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from pgfmd import scene_objects
from pgfmd.errors import Problem
from pgfmd.forecast.effort import Effort, effort_of_steps
from pgfmd.forecast.estimate import Memory, map_bytes_of, output_bytes, punch_points
from pgfmd.forecast.progress import Moment, TravelProgress, time_left
from pgfmd.physics.adhesion.registry import law_of

from .inertia import Inertia, contact_stiffness, inertia_of, instability

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from pgfmd.scene import Scene
    from pgfmd.schemes.base import Scheme, StepController
    from pgfmd.schemes.entry import Overrides

STEP_COST = 1.2
"""Time of a step relative to that of two pairs (estimate.pair_seconds): its pair has all rows."""
WORTH_TELLING = 0.01
"""Additional viscosity due to inertia, relative to that of the material, above which there is a remark."""


def build(scene: Scene, comm: Intracomm, mirror: str) -> tuple[Scheme, StepController]:
    """Scheme and controller of a scene. Collective."""
    # Not at the top, because forecasts need no MPI.
    from pgfmd.assemble import heights_of
    from pgfmd.solver.grid import Grid, PunchPoints
    from pgfmd.solver.transform import Plane

    from .controller import FixedSteps
    from .scheme import Gfmd

    plane = Plane(comm, scene.grid.n)
    slab = (plane.row_start, plane.real.shape[0])
    points = PunchPoints(Grid(scene.grid.n, scene.grid.length), scene.punch.radius, comm, slab)
    law, series, inertia = law_of(scene.adhesion), scene_objects.series_of(scene.rheology), inertia_of_scene(scene)
    compliance, height, output = scene_objects.compliance_of(scene), heights_of(scene, points), scene.output
    scheme = Gfmd(
        points, plane, compliance, height, law, series, inertia, output.energy, output.near_gap,
        scene_objects.machine_compliance(scene), scene.drive.control == "load",
    )  # fmt: skip
    return scheme, FixedSteps(scheme, inertia.step, scene.drive.preload)


def inertia_of_scene(scene: Scene) -> Inertia:
    """The auxiliary inertia of a scene."""
    series, law = scene_objects.series_of(scene.rheology), law_of(scene.adhesion)
    # The punch's own speeds: under load control the end of its soft spring goes far ahead.
    drive = replace(scene_objects.drive_of(scene), speed=scene.drive.speed, retract_speed=scene.drive.retract_speed)
    return inertia_of(scene.solver_gfmd, series, law, drive)


def memory(scene: Scene, ranks: int) -> Memory:
    """Memory of the rank with the largest share: whole-plane modes u, their velocity and N elements, complex, (n,
    columns), and twice G0 on half of them; heights, u and f of the points, of which one rank may hold all; the
    transform's real plane, and two spectral arrays before and after the transpose."""
    n, points = scene.grid.n, punch_points(scene)
    columns, rows = math.ceil((n // 2 + 1) / ranks), math.ceil(n / ranks)
    spectral = 16.0 * n * columns
    state = (2 + scene_objects.series_of(scene.rheology).elements) * spectral
    mine = 8.0 * min(points.total, rows * points.nb)
    modes = state + 16.0 * (n // 2 + 1) * columns
    transform = 8.0 * rows * n + 16.0 * rows * (n // 2 + 1) + 2.0 * spectral
    output = output_bytes(scene, points, ranks, 8.0)
    return Memory(3.0 * mine + modes, transform, state, transform + map_bytes_of(scene.punch), output)


def effort(scene: Scene) -> Effort:
    """One pair a step."""
    # All rows, where the fused transform has those under the punch.
    return effort_of_steps(scene, inertia_of_scene(scene).step, 2.0, STEP_COST)


def steps_left(scene: Scene, moment: Moment, travel: TravelProgress) -> tuple[float, str]:
    """From the remaining time."""
    return time_left(scene, moment, travel) / inertia_of_scene(scene).step, ""


def numerics(scene: Scene) -> dict[str, float]:
    """Inertia and step, for the record."""
    inertia = inertia_of_scene(scene)
    return {"omega_rad_s": inertia.frequency, "dt_s": inertia.step}


def warm_up(precision: str) -> tuple[Overrides, ...]:
    """A single scene: every step uses every kernel."""
    return (["solver.max_steps=3"],)


def problems(scene: Scene) -> list[Problem]:
    """Problems: a start within the range of adhesion, and steps that are too long."""
    found = []
    law, clearance = law_of(scene.adhesion), scene_objects.drive_of(scene).clearance
    if clearance < law.reach:
        cure = 'leave it out, or set solver.scheme = "inertialess"'
        expected = f"a start out of reach, at least {law.reach:.3g} m, as gfmd begins with a surface at rest"
        found.append(Problem("drive.clearance", f"{clearance:.3g} m", expected, cure))
    inertia = inertia_of_scene(scene)
    cure = instability(inertia, _contact_stiffness(scene), scene_objects.series_of(scene.rheology).kappa_inf)
    if cure:
        found.append(Problem("solver.gfmd.dt", f"{inertia.step:.3g} s", "a stable time step", cure))
    return found


def lines(scene: Scene) -> Iterator[tuple[str, float, str, str]]:
    """Inertia, step, stability, and additional viscosity."""
    inertia, series = inertia_of_scene(scene), scene_objects.series_of(scene.rheology)
    yield "frequency omega of the inertia", inertia.frequency, "rad/s", ""
    yield "time step", inertia.step, "s", f"set by the {inertia.limited_by}"
    note = "omega dt sqrt(1 + K_0 G0/kappa_inf), below 2 where stable"
    yield "stability number", inertia.stiffest(_contact_stiffness(scene), series.kappa_inf), "", note
    if series.elements:
        share = inertia.added_viscosity(series)
        yield "viscosity that the inertia adds", share, "", "2 kappa_inf/omega over sum kappa_n tau_n"


def remarks(scene: Scene) -> Iterator[str]:
    """A step that follows a speed which the punch exceeds, and the additional viscosity due to inertia, which the paper
    neglects but is known exactly."""
    series, inertia = scene_objects.series_of(scene.rheology), inertia_of_scene(scene)
    if scene.drive.control == "load" and inertia.limited_by == "motion":
        yield (
            f"solver.gfmd: the time step, {inertia.step:.3g} s, is that of a punch at drive.speed, but under load control "
            "the punch falls into contact and comes off faster; see with half of solver.gfmd.fast_pull whether the curve "
            "stays the same"
        )
    if not series.elements:
        return
    share = inertia.added_viscosity(series)
    if share > WORTH_TELLING:
        yield (
            f"solver.gfmd: at low frequencies the inertia adds {100 * share:.2g} % to the viscosity of the material; "
            "the error of the curve falls with 1/omega"
        )


def _contact_stiffness(scene: Scene) -> float:
    law = law_of(scene.adhesion)
    return contact_stiffness(scene_objects.compliance_of(scene), law, scene.grid.n, scene.grid.length)
