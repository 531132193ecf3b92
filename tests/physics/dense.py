"""The model as a system of ordinary differential equations for scipy: dense matrices in real space, no transform.

An independent path to what the schemes compute, for a few dozen points. u = G w on the points under the punch, with the
dense matrix G; the memory is in w and its branches, where the scheme `gfmd` has it in the modes of u.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import eigvalsh

from pgfmd import scene_objects
from pgfmd.physics.drive import PRELOAD
from pgfmd.schemes.gfmd.plugin import inertia_of_scene
from pgfmd.solver.simulation import Observer

RTOL = 1e-11


@dataclass
class Punch:
    """Heights [m] and the dense compliance [m/Pa] of the points under the punch; area [m^2] of one."""

    height: np.ndarray
    compliance: np.ndarray
    area: float


def punch_of(scene) -> Punch:
    """The points in row order, as pgfmd has them, and their influence on each other: the inverse transform of G0."""
    n, length = scene.grid.n, scene.grid.length
    position = (np.arange(n) + 0.5) * length / n - 0.5 * length
    y, x = (values.ravel() for values in np.meshgrid(position, position, indexing="ij"))
    inside = np.hypot(x, y) <= scene.punch.radius * (1 + 1e-12)
    height = scene_objects.topography_of(scene.punch).heights(x[inside], y[inside])
    q = 2.0 * np.pi * np.fft.fftfreq(n, length / n)
    kernel = np.fft.ifft2(scene_objects.compliance_of(scene)(q[None, :], q[:, None])).real
    row, column = np.divmod(np.flatnonzero(inside), n)
    matrix = kernel[row[:, None] - row[None, :], column[:, None] - column[None, :]]
    return Punch(height - height.min(), matrix, (length / n) ** 2)


class _Programme:
    """Phases one after the other; F(t) of the whole programme, from dense output."""

    def __init__(self, scene, size: int):
        self.punch, self.law, self.series = (
            punch_of(scene),
            scene_objects.law_of(scene.adhesion),
            scene_objects.series_of(scene.rheology),
        )
        self.preload = scene.drive.preload
        self.pieces = []
        self.preload_time = math.nan
        drive = scene_objects.drive_of(scene)
        time, position, state = 0.0, drive.clearance, np.zeros(size * self.punch.height.size)
        for phase in drive.phases:
            end, state = self._run(phase, time, position, state)
            position += phase.displacement(end - time)
            time = end

    def _run(self, phase, start, position, state):
        """Integrates a phase; returns its end and the state there."""

        def place(t):
            return position + phase.displacement(t - start)

        def excess(t, y):
            return self.force(place(t), y) - self.preload

        excess.terminal, excess.direction = True, 1.0
        last = (
            phase.duration
            if math.isfinite(phase.duration)
            else 3.0 * (abs(position) + 10 * self.law.range) / phase.fastest
        )
        result = solve_ivp(
            lambda t, y: self.rate(place(t), y), (start, start + last), state, method=self.method, rtol=RTOL,
            atol=RTOL * self.scale, dense_output=True, events=excess if phase.ends_with == PRELOAD else None,
        )  # fmt: skip
        assert result.success, result.message
        if phase.ends_with == PRELOAD:
            self.preload_time = result.t[-1]
        self.pieces.append((start, result.t[-1], place, result.sol))
        return result.t[-1], result.y[:, -1]

    def forces(self, times) -> np.ndarray:
        """F [N] at these times [s], sorted."""
        found = []
        for t in times:
            place, solution = next((place, sol) for start, end, place, sol in self.pieces if t <= end * (1 + 1e-12))
            found.append(self.force(place(t), solution(t)))
        return np.array(found)


class WithInertia(_Programme):
    """gfmd: kappa_inf (w'' / omega^2 + 2 w' / omega + w) = f + sum kappa_m w_m,  tau_m w_m' = w - w_m."""

    method = "DOP853"

    def __init__(self, scene):
        self.frequency = inertia_of_scene(scene).frequency
        elements = scene_objects.series_of(scene.rheology).elements
        law = scene_objects.law_of(scene.adhesion)
        # Of w [Pa], of w' [Pa/s], of the branches.
        points = punch_of(scene).height.size
        sizes = [1.0, self.frequency, *[1.0] * elements]
        self.scale = law.strength * np.repeat(sizes, points)
        super().__init__(scene, 2 + elements)

    def rate(self, d, y):
        w, v, *branches = y.reshape(-1, self.punch.height.size)
        series, omega = self.series, self.frequency
        f = self.law.traction(d + self.punch.height - self.punch.compliance @ w)
        pull = f + sum(k * b for k, b in zip(series.kappa, branches, strict=True)) - series.kappa_inf * w
        change = omega**2 / series.kappa_inf * pull - 2.0 * omega * v
        return np.concatenate([v, change, *((w - b) / t for b, t in zip(branches, series.tau, strict=True))])

    def force(self, d, y):
        w = y[: self.punch.height.size]
        return -self.punch.area * self.law.traction(d + self.punch.height - self.punch.compliance @ w).sum()


class Massless(_Programme):
    """The limit without inertia: lambda_m phi_m' = f - phi_m, with f from w = J_inf f(d + z - G w) + sum J_m phi_m."""

    method = "LSODA"

    def __init__(self, scene):
        self.creep = scene_objects.series_of(scene.rheology).to_creep()
        self.scale = scene_objects.law_of(scene.adhesion).strength
        self.guess = None
        super().__init__(scene, self.creep.elements)

    def traction(self, d, y):
        """f by Newton's method with dense matrices, from the last solution on."""
        punch, law, creep = self.punch, self.law, self.creep
        memory = creep.J @ y.reshape(-1, punch.height.size)
        w = memory.copy() if self.guess is None else self.guess
        for _ in range(50):
            gap = d + punch.height - punch.compliance @ w
            rest = w - memory - creep.J_inf * law.traction(gap)
            jacobian = np.eye(w.size) + creep.J_inf * law.curvature(gap)[:, None] * punch.compliance
            change = np.linalg.solve(jacobian, rest)
            w = w - change
            if np.abs(change).max() < 1e-13 * law.strength:
                break
        self.guess = w
        return (w - memory) / creep.J_inf

    def rate(self, d, y):
        f = self.traction(d, y)
        phi = y.reshape(-1, self.punch.height.size)
        return ((f - phi) / self.creep.retardation_times[:, None]).ravel()

    def force(self, d, y):
        return -self.punch.area * self.traction(d, y).sum()


class LowestCurvatures(Observer):
    """Keeps, in `lowest`, the lowest curvature of the energy at the end of each step, by an eigenvalue of the whole matrix.

    Relative to the elastic energy's own: 1 without adhesion, below 0 at a saddle.
    """

    def __init__(self, simulation):
        points, self.scheme = simulation.points, simulation.scheme
        dense, unit = np.zeros((points.size, points.size)), np.zeros(points.size)
        for i in range(points.size):
            unit[:], unit[i] = 0.0, 1.0
            self.scheme.solver.convolve(unit, dense[i])
        self.root, self.lowest = np.linalg.cholesky(dense), []

    def observe(self, simulation, event):
        """Takes in a step; where nothing attracts, there is nothing to be told."""
        state, law = simulation.state, self.scheme.law
        bend = law.curvature(state.position + self.scheme.height - state.surface_displacement)
        near = np.flatnonzero(bend)
        if event.kind in ("step", "jump") and near.size:
            matrix = (self.root[near].T * bend[near]) @ self.root[near]
            self.lowest.append(1.0 + eigvalsh(matrix, subset_by_index=[0, 0])[0])
