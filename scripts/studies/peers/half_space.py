"""Scenes of pgfmd in Adhesion and ContactMechanics: their half-space, their system, scipy's L-BFGS as the minimiser.

The law of adhesion and the heights are pgfmd's, because the same problem is to be solved; energies, forces and transforms
are the peer's. It counts displacements from the punch's side: its displacement is -u, its heights -z, its offset -d.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
import scipy.fft
import scipy.optimize

from pgfmd import scene_objects
from pgfmd.scene import Scene

FAR = 1e6
"""Height of the face outside of the punch, in ranges of adhesion: it never interacts."""
LEVEL = 1e-6
"""Energies are as low as another if they are above it by no more than this fraction of it."""
STIFF = 1e3
"""Stiffness of the mean displacement, in that of the longest wave. It does not matter: in pgfmd the mean is zero, and so it
is kept here."""


def law_of(scene: Scene) -> Any:
    """The cosine law of a scene as a Potential of Adhesion."""
    gamma, reach = scene.adhesion.work_of_adhesion, scene.adhesion.range
    base = import_module("Adhesion.Interactions").Potential

    class Cosine(base):  # type: ignore[misc]
        """-gamma/2 (1 + cos(pi g/rho)) up to g = rho; gamma (pi g/(2 rho))^2 - gamma for overlaps."""

        name = "cosine"
        r_min, r_infl = 0.0, 0.5 * reach

        def __init__(self) -> None:
            base.__init__(self)

        def __repr__(self) -> str:
            return f"cosine law, {gamma} J/m^2, {reach} m"

        def evaluate(self, gap, potential=True, gradient=False, curvature=False, mask=None):
            phase, overlap = np.pi * np.clip(gap, 0.0, reach) / reach, np.pi * np.minimum(gap, 0.0) / reach
            energy = gamma * (0.25 * overlap**2 - 0.5 * (1.0 + np.cos(phase)))
            return energy, gamma * np.pi / (2.0 * reach) * (np.sin(phase) + overlap), None

    return Cosine()


@dataclass
class Found:
    """An equilibrium: energy [J], force on the punch [N], displacement u [m]; evaluations and time [s] until its energy was as
    low as asked, and evaluations until the minimiser ended."""

    energy: float
    force: float
    surface: np.ndarray
    evaluations: int
    seconds: float
    total: int


class Peer:
    """One scene in the peer. All minimisations are in its displacements, scaled (`plain`), or in v = u/sqrt(G0), the same
    preconditioner as pgfmd's (`preconditioned`)."""

    def __init__(self, scene: Scene):
        n, length = scene.grid.n, scene.grid.length
        spacing, modulus = length / n, scene.substrate.contact_modulus
        place = (np.arange(n) + 0.5) * spacing - 0.5 * length
        x, y = np.meshgrid(place, place, indexing="ij")
        self.inside = np.hypot(x, y) <= scene.punch.outline * (1 + 1e-12)
        heights = scene_objects.topography_of(scene.punch).heights(x[self.inside], y[self.inside])
        face = np.full((n, n), FAR * scene.adhesion.range)
        face[self.inside] = heights - heights.min()
        body = import_module("ContactMechanics").PeriodicFFTElasticHalfSpace(
            (n, n), young=modulus, physical_sizes=(length, length),
            stiffness_q0=STIFF * math.pi * modulus / length,
        )  # fmt: skip
        surface = import_module("SurfaceTopography").Topography(-face, (length, length))
        self.system = import_module("Adhesion.System").SmoothContactSystem(body, law_of(scene), surface)
        self.n, self.reach = n, scene.adhesion.range
        self.unit = scene.adhesion.work_of_adhesion * spacing**2
        q = 2.0 * np.pi * np.hypot(np.fft.fftfreq(n, spacing)[:, None], np.fft.rfftfreq(n, spacing))
        q[0, 0] = np.inf
        self._root = np.sqrt(2.0 / (q * modulus) * scene.adhesion.work_of_adhesion)

    def _spread(self, v: np.ndarray, inverse: bool = False) -> np.ndarray:
        root = (
            np.divide(1.0, self._root, out=np.zeros_like(self._root), where=self._root > 0) if inverse else self._root
        )
        return scipy.fft.irfft2(root * scipy.fft.rfft2(v.reshape(self.n, self.n)), s=(self.n, self.n))

    def minimum(
        self, position: float, start: np.ndarray | None = None, tolerance: float = 1e-5, plain: bool = False,
        energy: float | None = None, memory: int = 10,
    ) -> Found:  # fmt: skip
        """The minimum that L-BFGS finds downhill from `start` (u [m], at rest by default) with the punch at `position` [m].

        tolerance: largest component of the gradient, in work of adhesion times cell over range (or over a unit v).
        energy [J]: the evaluations are counted until the potential is as low, to a part in a million. memory: updates that
        L-BFGS remembers.
        """
        fun, history = self.system.objective(-position, gradient=True), []
        first = np.zeros((self.n, self.n)) if start is None else -start

        def of_surface(x):
            value, slope = fun(self.reach * (x - x.mean()))
            history.append(value)
            return value / self.unit, (slope - slope.mean()) * self.reach / self.unit

        def of_waves(v):
            value, slope = fun(self._spread(v).ravel())
            history.append(value)
            return value / self.unit, self._spread(slope).ravel() / self.unit

        x = first / self.reach if plain else self._spread(first, inverse=True)
        options = {"maxcor": memory, "ftol": 0.0, "gtol": tolerance, "maxiter": 5000, "maxfun": 6000}
        began = time.perf_counter()
        found = scipy.optimize.minimize(
            of_surface if plain else of_waves, x.ravel(), jac=True, method="L-BFGS-B", options=options
        )
        seconds = time.perf_counter() - began
        u = self.reach * (found.x - found.x.mean()).reshape(self.n, self.n) if plain else self._spread(found.x)
        self.system.evaluate(u, -position, True, True)
        total = counted = len(history)
        if energy is not None:
            low = np.array(history) <= energy + LEVEL * abs(energy)
            counted = int(np.argmax(low)) + 1 if low.any() else total
        force = float(self.system.interaction_force.sum())
        return Found(float(self.system.energy), force, -u, counted, seconds * counted / total, total)
