"""Contact of a sphere without adhesion in Tamaas, elastic and viscoelastic."""

from __future__ import annotations

import time
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

SIDE, CURVATURE, MODULUS, POISSON = 1.5e-3, 10e-3, 2e6, 0.495
"""Side of the periodic cell [m], radius of the sphere [m], relaxed Young's modulus [Pa], Poisson's ratio."""
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
    """The surface of the sphere [m], its summit at 0; the way up that Tamaas has."""
    place = (np.arange(n) + 0.5) * SIDE / n - 0.5 * SIDE
    x, y = np.meshgrid(place, place, indexing="ij")
    surface = -(x**2 + y**2) / (2.0 * CURVATURE)
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
    solver.solve(force / SIDE**2)
    return _seen(model, surface, counter.count, time.perf_counter() - began)


def crept(n: int, force: float, end: float, step: float) -> tuple[Pressed, Pressed]:
    """The viscoelastic sphere under a constant force [N] after the first step and at time `end` [s]."""
    tamaas, surface = import_module("tamaas"), heights(n)
    tamaas.set_log_level(tamaas.LogLevel.error)
    model = _model(tamaas, n, MODULUS)
    shear = MODULUS / (2.0 * (1.0 + POISSON))
    solver = tamaas.MaxwellViscoelastic(model, surface, TOLERANCE, step, [(RATIO - 1.0) * shear], [TIME])
    began = time.perf_counter()
    solver.solve(force / SIDE**2)
    first = _seen(model, surface, 0, time.perf_counter() - began)
    for _ in range(1, round(end / step)):
        solver.solve(force / SIDE**2)
    return first, _seen(model, surface, 0, time.perf_counter() - began)


def _model(tamaas: Any, n: int, modulus: float) -> Any:
    model = tamaas.ModelFactory.createModel(tamaas.model_type.basic_2d, [SIDE, SIDE], [n, n])
    model.E, model.nu = modulus, POISSON
    return model


def _seen(model: Any, surface: np.ndarray, iterations: int, seconds: float) -> Pressed:
    u, pressure = np.array(model.displacement), np.array(model.traction)
    touching, cell = pressure > 0.0, (SIDE / len(surface)) ** 2
    depth = float((u - surface)[touching].mean() - u.mean())
    return Pressed(depth, float(touching.sum()) * cell, float(pressure.max()), iterations, seconds)
