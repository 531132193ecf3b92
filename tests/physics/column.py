"""A column of a film under a flat face that fills the cell, and the exact solution of what it does in any programme: traction
and surface are the same everywhere, and the history is that of a few internal variables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import solve_ivp

import pgfmd
from pgfmd import scene_objects
from pgfmd.physics.drive import DETACHED, FORCE, PLACE, TRAVEL

if TYPE_CHECKING:
    from collections.abc import Callable

    from pgfmd.physics.drive import Phase
    from pgfmd.physics.rheology import CreepSeries

RHEOLOGIES = {
    0: {"model": "elastic"},
    1: {"model": "single", "modulus_ratio": 20.0, "relaxation_time": "10 ms"},
    5: {
        "model": "geometric", "modulus_ratio": 20.0, "relaxation_time": "1 ms", "elements": 5, "time_ratio": 4.0,
        "exponent": 0.5,
    },
}  # fmt: skip
LONGEST = 10.0
"""Time [s] by which an ending must have been met."""


def column(elements: int, accuracy: float = 0.005, **drive) -> pgfmd.Scene:
    """A bonded film of 0.1 mm under a flat face of 1 mm^2, whose overlaps are about as stiff as the film relaxed."""
    short = {} if "step" in drive else {"speed": "100 um/s", "preload": "0.3 N"}
    return pgfmd.Scene(
        {
            "punch": {"pattern": "sinusoid", "wavelength": "1 mm", "amplitude": "1e-6 pm"},
            "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.4, "thickness": "0.1 mm", "base": "bonded"},
            "rheology": RHEOLOGIES[elements],
            "adhesion": {"law": "repulsive", "work_of_adhesion": "50 mJ/m^2", "range": "1 um"},
            "drive": {"clearance": "0 m", **short, **drive},
            "grid": {"n": 8, "length": "1 mm"},
            "solver": {"accuracy": accuracy},
        }
    )


@dataclass(frozen=True)
class Stretch:
    """A phase of the exact solution: begin and span [s]; force [N] and place of the punch [m], of the time since it began."""

    begin: float
    span: float
    force: Callable[[float], float]
    place: Callable[[float], float]


def exact(scene: pgfmd.Scene) -> list[Stretch]:
    """What the column does in each phase of its programme.

    f = K (D + F/k - u),  F = -A f,  u = G0 (J_inf f + sum J_m phi_m),  lambda_m dphi_m/dt = f - phi_m

    with k of the machine's spring, or of the soft one of a load. Where what is controlled changes, d is continuous.
    """
    creep, law = scene_objects.series_of(scene.rheology).to_creep(), scene_objects.law_of(scene.adhesion)
    springs = scene_objects.springs_of(scene)
    depth = float(scene_objects.compliance_of(scene)(np.zeros(1), np.zeros(1))[0])
    body = Body(scene.grid.length**2, law.stiffness, depth, creep)
    found: list[Stretch] = []
    begin, place, force, phi = 0.0, scene.drive.clearance, 0.0, np.zeros(body.weights.size)
    for phase in scene_objects.drive_of(scene).phases:
        spring = springs[phase.control]
        driven = Driven(body, phase, place - spring * force, spring, place)
        span, inner = driven.solve(phi)
        found.append(
            Stretch(
                begin,
                span,
                lambda t, x=driven, y=inner: x.force(t, y(t)),
                lambda t, x=driven, y=inner: x.place(t, y(t)),
            )
        )
        begin, phi, force, place = begin + span, inner(span), found[-1].force(span), found[-1].place(span)
    return found


class Body:
    """area [m^2], stiffness [Pa/m] of overlaps, depth [m/Pa]: G0 of the film, and the creep of its material. An elastic
    one has an element without weight."""

    def __init__(self, area: float, stiffness: float, depth: float, creep: CreepSeries):
        self.area, self.stiffness, self.depth, self.instant = area, stiffness, depth, creep.J_inf
        self.weights = np.asarray(creep.J) if creep.elements else np.zeros(1)
        self.times = np.asarray(creep.retardation_times) if creep.elements else np.ones(1)


@dataclass(frozen=True)
class Driven:
    """The body in a phase, by a drive that starts at `origin` [m], with a spring [m/N] and the punch at `started` [m]."""

    body: Body
    phase: Phase
    origin: float
    spring: float
    started: float

    def traction(self, t: float, phi: np.ndarray) -> float:
        """f [Pa] at a time [s] of the phase."""
        body = self.body
        free = self.origin + self.phase.displacement(t) - body.depth * float(body.weights @ phi)
        return body.stiffness * free / (1.0 + body.stiffness * (self.spring * body.area + body.depth * body.instant))

    def force(self, t: float, phi: np.ndarray) -> float:
        """F [N]."""
        return -self.body.area * self.traction(t, phi)

    def place(self, t: float, phi: np.ndarray) -> float:
        """d [m]."""
        return self.origin + self.phase.displacement(t) + self.spring * self.force(t, phi)

    def solve(self, phi: np.ndarray) -> tuple[float, Callable[[float], np.ndarray]]:
        """How long [s] the phase takes, and the internal variables in it."""
        events = [self._event(ending.quantity, ending.value, ending.sign, phi) for ending in self.phase.endings]
        if self.phase.ends_with == DETACHED:
            events.append(self._event(FORCE, 0.0, -1, phi))
        if any(event(0.0, phi) >= 0.0 for event in events):
            return 0.0, lambda t: phi
        found = solve_ivp(
            lambda t, phi: (self.traction(t, phi) - phi) / self.body.times, (0.0, min(self.phase.duration, LONGEST)), phi,
            method="LSODA", rtol=1e-11, atol=1e-9, events=events or None, dense_output=True,
            max_step=4.0 * self.phase.longest_step,
        )  # fmt: skip
        return found.t[-1], found.sol

    def _event(self, quantity: str, value: float, sign: int, phi: np.ndarray) -> Callable[[float, np.ndarray], float]:
        """What grows through zero where a value ends the phase."""
        values = {FORCE: self.force, PLACE: self.place, TRAVEL: lambda t, phi: abs(self.place(t, phi) - self.started)}
        sign = sign or (1 if values[quantity](0.0, phi) < value else -1)

        def event(t: float, phi: np.ndarray) -> float:
            return sign * (values[quantity](t, phi) - value)

        event.terminal, event.direction = True, 1.0
        return event


@dataclass(frozen=True)
class Errors:
    """Largest errors of the force [largest force] and of the place of the punch [m] over a run, its steps, and how much later
    [s] than the exact one each phase ended."""

    force: float
    place: float
    steps: int
    late: list[float]


def errors(scene: pgfmd.Scene) -> Errors:
    """How far a run is from the exact solution, phase by phase, each with its time from its own start."""
    stretches, rows = exact(scene), []

    def keep(step: pgfmd.in_memory.Step) -> None:
        state = step._simulation.state
        rows.append((state.stepped, state.time, state.force, state.punch_displacement))

    pgfmd.simulate(scene, each=keep)
    forces, places, late, begin = [0.0], [0.0], [], 0.0
    for number, stretch in enumerate(stretches):
        mine = [row for row in rows if row[0] == number]
        for _, time, force, place in mine:
            if time - begin <= stretch.span * (1.0 + 1e-12):
                forces.append(abs(force - stretch.force(time - begin)))
                places.append(abs(place - stretch.place(time - begin)))
        begin = mine[-1][1] if mine else begin
        late.append(begin - stretch.begin - stretch.span)
    largest = max(abs(force) for _, _, force, _ in rows)
    return Errors(max(forces) / largest, max(places), len(rows) - 1, late)
