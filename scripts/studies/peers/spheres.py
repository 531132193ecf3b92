"""Contact of a sphere without adhesion in Tamaas, elastic and viscoelastic.

Lengths are given to it in sides of the cell, pressures in relaxed shear moduli. Its viscoelastic solver depends on the
units: unless the relaxed shear modulus is 1, a contact under a constant force does not end at its relaxed size (Tamaas 2.9.0).
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

SIDE, CURVATURE, MODULUS, POISSON = 1.5e-3, 10e-3, 2e6, 0.495
"""Side of the periodic cell [m], radius of the sphere [m], relaxed Young's modulus [Pa], Poisson's ratio."""
SHEAR = MODULUS / (2.0 * (1.0 + POISSON))
"""Relaxed shear modulus [Pa], the unit of pressures in Tamaas."""
RATIO, TIME = 10.0, 1.0
"""Instantaneous over relaxed modulus, and relaxation time [s]: the retardation time is RATIO TIME."""
TOLERANCE = 1e-10


@dataclass
class Pressed:
    """A sphere under a force: depth below the mean surface [m], area in contact [m^2], largest pressure [Pa], cost."""

    depth: float
    area: float
    pressure: float
    iterations: int
    seconds: float


def heights(n: int) -> np.ndarray:
    """The surface of the sphere [sides of the cell], its summit at 0; the way up that Tamaas has."""
    place = (np.arange(n) + 0.5) / n - 0.5
    x, y = np.meshgrid(place, place, indexing="ij")
    surface = -(x**2 + y**2) / (2.0 * CURVATURE / SIDE)
    return surface - surface.max()


def _counter(tamaas: Any) -> Any:
    class Counter(tamaas.Functional):  # type: ignore[misc,name-defined]
        """Adds nothing to the solver's functional, and counts its gradients: one an iteration."""

        def __init__(self) -> None:
            super().__init__()
            self.count = 0

        def computeF(self, *arguments):
            return 0.0

        def computeGradF(self, *arguments):
            self.count += 1

    return Counter()


def pressed(n: int, force: float, modulus: float = MODULUS) -> Pressed:
    """The elastic sphere under a force [N]: a rigid wall, Polonsky and Keer's conjugate gradients."""
    tamaas, surface = import_module("tamaas"), heights(n)
    tamaas.set_log_level(tamaas.LogLevel.error)
    model = _model(tamaas, n, modulus)
    solver, counter = tamaas.PolonskyKeerRey(model, surface, TOLERANCE), _counter(tamaas)
    solver.addFunctionalTerm(counter)
    began = time.perf_counter()
    solver.solve(force / (SIDE**2 * SHEAR))
    return _seen(model, surface, counter.count, time.perf_counter() - began)


def crept(n: int, force: float, times: Sequence[float], step: float) -> list[Pressed]:
    """The viscoelastic sphere under a constant force [N] at these times [s], multiples of the step [s]."""
    tamaas, surface = import_module("tamaas"), heights(n)
    tamaas.set_log_level(tamaas.LogLevel.error)
    model = _model(tamaas, n, MODULUS)
    solver, counter = (
        tamaas.MaxwellViscoelastic(model, surface, TOLERANCE, step, [RATIO - 1.0], [TIME]),
        _counter(tamaas),
    )
    solver.addFunctionalTerm(counter)
    began, found = time.perf_counter(), []
    for done in range(1, round(times[-1] / step) + 1):
        solver.solve(force / (SIDE**2 * SHEAR))
        if any(abs(done * step - end) < 0.5 * step for end in times):
            found.append(_seen(model, surface, counter.count, time.perf_counter() - began))
    return found


def _model(tamaas: Any, n: int, modulus: float) -> Any:
    model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [1.0, 1.0], [n, n])
    model.E, model.nu = modulus / SHEAR, POISSON
    return model


def _seen(model: Any, surface: np.ndarray, iterations: int, seconds: float) -> Pressed:
    u, pressure = np.array(model.displacement), np.array(model.traction)
    touching, cell = pressure > 0.0, (SIDE / len(surface)) ** 2
    depth = SIDE * float((u - surface)[touching].mean() - u.mean())
    return Pressed(depth, float(touching.sum()) * cell, SHEAR * float(pressure.max()), iterations, seconds)
