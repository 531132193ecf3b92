"""Whole runs without files, for the tests of this folder and for scripts/studies/validation/errors.py: a scene in, its curve out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.output.recorder import Recorder
from pgfmd.scene import load_scene, scene_from_mapping
from pgfmd.solver.simulation import Observer

RADIUS = 375e-6
"""Radius [m] of the punch in the shipped scenes."""
CONTACT_MODULUS = 2e6 / (1 - 0.495**2)
WORK_OF_ADHESION = 0.05

# A stiff overlap without attraction: the elastic problem of a rigid punch, as far as the grid can tell.
RIGID = ("rheology.model=elastic", "adhesion.law=repulsive", "adhesion.range_factor=1")

SINUSOID = {
    "punch": {"pattern": "sinusoid", "wavelength": "100 um", "amplitude": "1 um"},
    "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495},
    "rheology": {"model": "elastic"},
    "adhesion": {"law": "repulsive", "work_of_adhesion": "50 mJ/m^2", "range_factor": 1.0},
    "drive": {"speed": "1 um/s", "preload": "1 mN"},
    "grid": {"n": 64, "length": "100 um"},
}
"""One wave in a periodic cell of half-space."""


@dataclass(frozen=True)
class Row:
    """One end of a step: time [s], programme, forces, points that press, and the energy [J] that a jump released."""

    time: float
    phase: str
    position: float
    force: float
    pressing: int
    is_jump: bool
    released: float


class _Preload(Observer):
    """Keeps the traction [Pa] and the far displacement [m] at the preload, and where the punch is then [m]."""

    def __init__(self):
        self.traction, self.far, self.position = np.zeros(0), math.nan, math.nan

    def observe(self, simulation, event) -> None:
        if event.kind == "preload":
            state = simulation.state
            self.traction, self.far, self.position = state.traction.copy(), state.far_displacement, state.position


@dataclass(frozen=True)
class Run:
    """A finished run: its scene, simulation, final state and rows; at the preload, the traction [Pa], the position of the
    punch and the far displacement [m]."""

    scene: object
    simulation: object
    state: object
    rows: list[Row]
    preloaded: np.ndarray
    preload_position: float
    far_at_preload: float

    @property
    def spacing(self) -> float:
        """Grid spacing [m]."""
        return self.simulation.points.grid.spacing

    @property
    def jumps(self) -> list[Row]:
        """Ends of steps that were jumps."""
        return [row for row in self.rows if row.is_jump]

    def phase(self, *names: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Indentation -d [m], force [N] and number of pressing points at the ends of the steps of these phases."""
        rows = [row for row in self.rows if row.phase in names]
        table = np.array([(-row.position, row.force, row.pressing) for row in rows])
        return table[:, 0], table[:, 1], table[:, 2]

    def force_at(self, indentation, *phases: str) -> np.ndarray:
        """Force [N] on the way through these phases, interpolated between steps."""
        depth, force, _ = self.phase(*phases)
        order = np.argsort(depth, kind="stable")
        return np.interp(indentation, depth[order], force[order])

    def work_of_separation(self) -> float:
        """Work [J] of the tensile forces on the way back, by the trapezoidal rule over the steps."""
        depth, force, _ = self.phase("turn", "dwell", "retract")
        tension = np.maximum(-force, 0.0)
        return float(np.sum(0.5 * (tension[1:] + tension[:-1]) * -np.diff(depth)))

    def before_last_jump(self) -> Row:
        """The last state in contact before the jump that released most on the way back."""
        rows = self.rows
        last = max((i for i, row in enumerate(rows) if row.phase == "retract"), key=lambda i: rows[i].released)
        return rows[last - 1]

    def contact_stiffness(self) -> float:
        """Force over indentation [N/m] at the preload, for a punch whose contact is complete from the first touch."""
        return self.state.preload / -self.preload_position


def run(scene: str | dict, *overrides: str) -> Run:
    """Runs a shipped scene, or one given as nested dicts, with overrides, on one rank."""
    read = scene_from_mapping if isinstance(scene, dict) else load_scene
    resolved = read(scene, overrides)
    recorder = Recorder(lambda simulation: int(np.count_nonzero(simulation.state.traction < 0)))
    simulation, preload = assemble(resolved, MPI.COMM_SELF), _Preload()
    simulation.observers += [recorder, preload]
    state = simulation.run()
    columns = (recorder.curve.column(name) for name in ("time", "phase", "displacement", "force"))
    rows = list(map(Row, *columns, recorder.measured, recorder.jump, recorder.released))
    return Run(resolved, simulation, state, rows, preload.traction, preload.position, preload.far)


def radius_of_traction(result: Run) -> float:
    """Contact radius [m] at the preload where a Hertzian p^2, a straight line in r^2, vanishes.

    Points within a tenth of the peak pressure are left out: on the rim the grid's staircase shows.
    """
    x, y = result.simulation.points.coordinates()
    pressure = -result.preloaded
    inner = pressure > 0.1 * pressure.max()
    slope, peak = np.polyfit((x * x + y * y)[inner], pressure[inner] ** 2, 1)
    return math.sqrt(-peak / slope)


def pull(n: int, modulus_ratio: float, speed: float, *overrides: str) -> Run:
    """Flat punch on one Maxwell element, pressed slowly, held until relaxed, then pulled off at `speed` [m/s].

    The turn is a thousandth of the time in which the punch moves by its range, so that it adds no motion of its own.
    """
    turn = 1e-3 * 1.5e-6 / speed
    return run(
        "flat-punch", f"grid.n={n}", f"rheology.modulus_ratio={modulus_ratio}", "drive.dwell=1 s",
        f"drive.retract_speed={speed:.9g} m/s", f"drive.turn_time={turn:.9g} s", *overrides,
    )  # fmt: skip


def orders(errors, ratio: float = 2.0) -> np.ndarray:
    """Observed orders of convergence of errors on resolutions that grow by `ratio`."""
    errors = np.asarray(errors)
    return np.log(errors[:-1] / errors[1:]) / math.log(ratio)
