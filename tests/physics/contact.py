"""Areas of contact at every step of a run, for the tests of contact and the figures of docs/evidence/validation.md."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.output.recorder import Recorder
from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.scene import load_scene, scene_from_mapping
from tests.physics.runs import CONTACT_MODULUS, SINUSOID, WORK_OF_ADHESION

SPHERE = 10e-3
"""Radius [m] of the sphere of the scene `hertz`."""
TENSION = math.pi * WORK_OF_ADHESION * SPHERE
"""pi w R [N], the unit of adhesive forces on it."""
ABOUT = (SPHERE, CONTACT_MODULUS, WORK_OF_ADHESION)
"""R, E*, w: what the closed forms of adhesive spheres take."""


@dataclass(frozen=True)
class Path:
    """All steps of a run as arrays (steps,): time [s], force [N], indentation -d [m], areas [m^2] of contact, of
    overlap (gap < 0) and of what is within the range, and the phase of the programme each belongs to.

    depth [m]: the indentation of the punch's axis, which lies between grid points; what a run calls z = 0 is the lowest
    grid point of a sphere. covered [m^2]: the area of all points of the punch. largest_gap [m].
    """

    scene: object
    time: np.ndarray
    force: np.ndarray
    depth: np.ndarray
    contact: np.ndarray
    overlap: np.ndarray
    near: np.ndarray
    largest_gap: np.ndarray
    phase: np.ndarray
    covered: float

    @property
    def law(self) -> Cosine:
        """The law of the run."""
        return Cosine(self.scene.adhesion.work_of_adhesion, self.scene.adhesion.range)

    def radius(self, area: str = "contact") -> np.ndarray:
        """Radius [m] of a disc as large as one of the areas."""
        return np.sqrt(getattr(self, area) / math.pi)

    def within(self, *phases: str) -> np.ndarray:
        """Which steps belong to these phases (steps,)."""
        return np.isin(self.phase, phases)


def _largest_gap(simulation) -> float:
    """The largest gap [m] under the punch."""
    state = simulation.state
    return (np.float64(state.position) + simulation.scheme.height - state.surface_displacement).max()


def path_of(scene: str | dict, *overrides: str, only_to_preload: bool = False) -> Path:
    """Runs a shipped scene, or one given as nested dicts, on one rank, to its end or to the preload."""
    read = scene_from_mapping if isinstance(scene, dict) else load_scene
    reach = read(scene, overrides).adhesion.range
    resolved = read(scene, [*overrides, f"output.near_gap={reach!r} m"])
    simulation, recorder = assemble(resolved, MPI.COMM_SELF), Recorder(_largest_gap)
    simulation.observers.append(recorder)
    simulation.run(only_to_preload)
    time, force, depth, *areas = recorder.rows(
        "time", "force", "indentation", "contact_area", "overlap_area", "near_area"
    ).T  # fmt: skip
    phases, largest = recorder.curve.column("phase").astype(str), np.array(recorder.measured)
    cell = simulation.points.grid.cell_area
    if resolved.punch.pattern == "sphere":
        # The four points around the axis are z = 0 in a run, h/sqrt(2) from it.
        depth = depth + cell / (4 * resolved.punch.curvature_radius)
    return Path(resolved, time, force, depth, *areas, largest, phases, simulation.points.total * cell)


def range_at(tabor: float) -> float:
    """The range [m] at which the sphere has a Tabor number."""
    return SPHERE ** (1 / 3) * (WORK_OF_ADHESION / CONTACT_MODULUS) ** (2 / 3) / tabor


def sphere_loop(tabor: float, n: int, *overrides: str, outline: float = 420e-6, preload: float = 1e-3) -> Path:
    """Quasi-static loop of a sticky sphere, alone on an infinite plane, at a Tabor number on n points across 4 a.

    outline [m]: radius of the punch, out of which there is nothing; no cohesive zone may reach it.
    """
    return path_of(
        "hertz", "adhesion.law=cosine", f"adhesion.range={range_at(tabor)!r} m", f"punch.radius={outline!r} m",
        f"grid.length={4 * outline!r} m", f"grid.n={n}", f"drive.preload={preload!r} N", "solver.scheme=quasistatic",
        "solver.accuracy=0.1", "output.energy=false", *overrides,
    )  # fmt: skip


def viscoelastic_sphere(n: int, *overrides: str) -> Path:
    """Loop of a sticky sphere on one Maxwell element, Tabor number 1 when relaxed: pressed at 10 um/s, held for ten of
    its retardation times of 2 s, so that the closing crack comes to rest, and pulled off at 10 um/s."""
    return path_of(
        "hertz", "adhesion.law=cosine", f"adhesion.range={range_at(1.0)!r} m", "punch.radius=420 um",
        "grid.length=1.68 mm", f"grid.n={n}", "drive.preload=1 mN", "drive.speed=10 um/s", "drive.dwell=20 s",
        "rheology.model=single", "rheology.modulus_ratio=20", "rheology.relaxation_time=100 ms", "output.energy=false",
        "solver.accuracy=3e-3", *overrides,
    )  # fmt: skip


WAVE = 2 * math.pi / 100e-6
"""Wave number [1/m] of SINUSOID of runs.py."""
CELL = (100e-6) ** 2


def sticky_wave(n: int, reach: float, *overrides: str) -> Path:
    """Quasi-static loop of a wave of 1 um and 100 um length in a periodic cell, with a range [m], pressed flat."""
    return path_of(
        SINUSOID, "adhesion.law=cosine", f"adhesion.range={reach!r} m", f"grid.n={n}", "solver.scheme=quasistatic",
        "solver.accuracy=0.03", "drive.preload=0.7 mN", *overrides,
    )  # fmt: skip


def curved_punch(n: int, *overrides: str) -> Path:
    """The triangular punch with a curvature of 40 mm, pressed at 1 um/s to 62 mN; the relaxation time follows the range."""
    return path_of(
        "tri-tack", f"grid.n={n}", "punch.curvature_radius=40 mm", "drive.preload=62 mN", "solver.accuracy=0.03",
        "output.energy=false", *overrides, only_to_preload=True,
    )  # fmt: skip
