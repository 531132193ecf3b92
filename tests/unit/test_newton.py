"""The static adhesive problem of one implicit step, against dense linear algebra on a tiny grid."""

import numpy as np
import pytest
import scipy.fft
import scipy.optimize
from mpi4py import MPI

from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.physics.adhesion.repulsive import Repulsive
from pgfmd.physics.free_kernel import FreeHalfSpace
from pgfmd.physics.halfspace import HalfSpace
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.multiplier import free_multiplier, periodic_multiplier
from pgfmd.solver.newton import NewtonSolver
from pgfmd.solver.transform import Convolution

MODULUS, GAMMA, LENGTH = 2.65e6, 0.05, 100e-6
RANGE = 0.5e-6


class Problem:
    """A solver on a tiny grid, and the same problem with G0 as a dense matrix."""

    def __init__(self, n=10, radius=0.25 * LENGTH, free=False, attractive=True, seed=0, roughness=0.5, preload=1e-4):
        grid = Grid(n, LENGTH)
        self.points = points = PunchPoints(grid, radius, MPI.COMM_SELF)
        if free:
            make = free_multiplier(FreeHalfSpace(MODULUS), grid.spacing)
            self.convolve = Convolution(points, scipy.fft.next_fast_len(2 * points.nb - 1, real=True), make)
        else:
            self.convolve = Convolution(points, n, periodic_multiplier(HalfSpace(MODULUS), LENGTH))
        self.law = (Cosine if attractive else Repulsive)(GAMMA, RANGE)
        self.rng = np.random.default_rng(seed)
        height = roughness * RANGE * self.rng.random(points.size)
        self.height = height - height.min()
        self.area, self.preload = grid.cell_area, preload
        self.solver = NewtonSolver(points, self.convolve, self.height, self.law, preload)
        unit = np.eye(points.size)
        self.dense = np.array([self.convolve(row, points.zeros()).copy() for row in unit]).T
        self.dense = 0.5 * (self.dense + self.dense.T)
        self.scale = Cosine(GAMMA, RANGE).strength

    def solve(self, position, history, compliance, tolerance, w=None, jump=False):
        w = self.points.zeros() if w is None else w.copy()
        u = self.convolve(w, self.points.zeros())
        outcome = self.solver.solve(position, history, compliance, u, w, tolerance, jump)
        return outcome, u, w

    def potential(self, w, position, history, compliance):
        """Phi [Pa m]."""
        u = self.dense @ w
        gap = position + self.height - u
        return float(u @ (0.5 * w - history)) / compliance + self.law.potential(gap).sum()

    def residual(self, w, position, history, compliance):
        return self.law.traction(position + self.height - self.dense @ w) - (w - history) / compliance

    def minimum(self, position, history, compliance, w=None):
        """(u, w, smallest eigenvalue of the curvature) of the minimum that a dense trust-region method finds from w."""
        G = self.dense
        start = np.zeros(self.points.size) if w is None else w
        unit = self.scale * RANGE

        def value(x):
            return self.potential(self.scale * x, position, history, compliance) / unit

        def slope(x):
            return -G @ self.residual(self.scale * x, position, history, compliance) / RANGE

        def bend(x):
            stiffness = self.law.curvature(position + self.height - G @ (self.scale * x))
            return (G / compliance + G @ (stiffness[:, None] * G)) * self.scale / RANGE

        found = scipy.optimize.minimize(
            value,
            start / self.scale,
            jac=slope,
            hess=bend,
            method="trust-exact",
            options={"gtol": 1e-12, "maxiter": 2000},
        )
        x = found.x
        for _ in range(3):
            x = x - np.linalg.lstsq(bend(x), slope(x), rcond=1e-14)[0]
        # Curvature in u: A^-1 + K, the quantity that must be positive; same signature as G (A^-1 + K) G.
        return G @ (self.scale * x), self.scale * x, np.linalg.eigvalsh(bend(x)).min()


def largest_interacting(problem, u, other, position):
    gap = position + problem.height - np.maximum(u, other)
    near = gap < problem.law.range
    return np.abs(u - other)[near].max() / RANGE if near.any() else 0.0


KINDS = {"periodic": {"free": False}, "free": {"free": True}, "free, odd": {"free": True, "n": 13}}


def test_the_transform_is_a_symmetric_positive_matrix():
    for kind in KINDS.values():
        problem = Problem(**kind)
        unit = np.eye(problem.points.size)
        raw = np.array([problem.convolve(row, problem.points.zeros()).copy() for row in unit])
        np.testing.assert_allclose(raw, raw.T, atol=1e-15 * raw.max())
        assert np.linalg.eigvalsh(problem.dense).min() > 0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("compliance", [0.004, 0.3, 1.0])
@pytest.mark.parametrize("position", [1.0, 0.0, -1.5])
def test_without_adhesion_there_is_one_minimum_and_it_is_found(kind, compliance, position):
    problem = Problem(attractive=False, **KINDS[kind])
    history = 0.2 * problem.scale * problem.rng.standard_normal(problem.points.size)
    d, tolerance = position * RANGE, 1e-6
    expected, _, _ = problem.minimum(d, history, compliance)
    outcome, u, _ = problem.solve(d, history, compliance, tolerance)
    assert outcome.converged
    assert np.abs(u - expected).max() < 2 * tolerance * RANGE
    pulled = -problem.law.traction(d + problem.height - expected).sum() * problem.area
    assert outcome.force == pytest.approx(pulled, abs=tolerance * problem.preload, rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("position", [1.0, 0.6, 0.1, -0.5])
def test_a_stiff_adhesive_step_has_one_minimum_and_it_is_found(kind, position):
    problem = Problem(**KINDS[kind])
    # A^-1 + K is positive definite for any gap: K >= -K_0.
    compliance = 0.8 / (np.linalg.eigvalsh(problem.dense).max() * problem.law.stiffness)
    history = 0.2 * problem.scale * problem.rng.standard_normal(problem.points.size)
    d, tolerance = position * RANGE, 1e-6
    expected, _, smallest = problem.minimum(d, history, compliance)
    assert smallest > 0
    for start in (None, 0.5 * problem.scale * problem.rng.standard_normal(problem.points.size)):
        outcome, u, _ = problem.solve(d, history, compliance, tolerance, start)
        assert outcome.converged
        assert largest_interacting(problem, u, expected, d) < 2 * tolerance


def test_the_error_goes_with_the_tolerance():
    problem = Problem(free=True, preload=1e-2)
    compliance, d = 0.3, -0.3 * RANGE
    history = 0.1 * problem.scale * problem.rng.standard_normal(problem.points.size)
    _, _, w = problem.solve(d, history, compliance, 1e-9, jump=True)
    expected, _, smallest = problem.minimum(d, history, compliance, w)
    assert smallest > 0
    for tolerance in (1e-2, 1e-4, 1e-6):
        outcome, u, _ = problem.solve(d, history, compliance, tolerance, 1.01 * w)
        assert outcome.converged
        assert largest_interacting(problem, u, expected, d) < tolerance


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(6))
def test_every_solve_goes_downhill_to_a_minimum(kind, seed):
    """Soft, adhesive, from random starts: many minima, many saddles."""
    problem = Problem(seed=seed, roughness=3.0, **KINDS[kind])
    rng, tolerance = problem.rng, 1e-7
    d, compliance = rng.uniform(-2, 1.5) * RANGE, 10 ** rng.uniform(-1.5, 0)
    history = 0.3 * problem.scale * rng.standard_normal(problem.points.size)
    start = 0.3 * problem.scale * rng.standard_normal(problem.points.size)
    before = problem.potential(start, d, history, compliance)
    outcome, u, w = problem.solve(d, history, compliance, tolerance, start, jump=True)
    after = problem.potential(w, d, history, compliance)
    assert outcome.converged
    assert outcome.potential_drop >= 0.0
    assert outcome.potential_drop == pytest.approx((before - after) * problem.area, rel=1e-8)
    np.testing.assert_allclose(u, problem.dense @ w, atol=1e-9 * RANGE)
    # Starting the dense method from here must change next to nothing, and the curvature there must be positive.
    same, _, smallest = problem.minimum(d, history, compliance, w)
    assert smallest > 0
    assert largest_interacting(problem, u, same, d) < 20 * tolerance


def test_the_force_is_the_sum_of_tractions_and_balances_the_load():
    problem = Problem(free=True, preload=1e-5)
    d, compliance, tolerance = -RANGE, 0.5, 1e-3
    history = 0.1 * problem.scale * problem.rng.standard_normal(problem.points.size)
    outcome, u, w = problem.solve(d, history, compliance, tolerance, jump=True)
    traction = problem.law.traction(d + problem.height - u)
    np.testing.assert_allclose(problem.solver.traction, traction, rtol=1e-9, atol=1e-12 * problem.scale)
    np.testing.assert_allclose(
        problem.solver.curvature, problem.law.curvature(d + problem.height - u), atol=1e-9 * problem.law.stiffness
    )
    assert outcome.force == pytest.approx(-traction.sum() * problem.area, rel=1e-12)
    # Out of balance: at most a fifth of the tolerance, in force scales.
    unbalanced = (traction - (w - history) / compliance).sum() * problem.area
    assert abs(unbalanced) <= 0.2 * tolerance * problem.preload


def test_a_punch_out_of_reach_costs_next_to_nothing():
    problem = Problem(free=True)
    before = problem.convolve.pairs
    outcome, u, w = problem.solve(3 * RANGE, problem.points.zeros(), 0.5, 1e-3)
    assert outcome.converged and outcome.force == 0.0
    assert not u.any() and not w.any()
    assert problem.convolve.pairs - before <= 2


def test_starting_at_the_solution_stays_there():
    problem = Problem(free=True)
    d, compliance = -0.5 * RANGE, 0.5
    history = problem.points.zeros()
    _, u, w = problem.solve(d, history, compliance, 1e-9, jump=True)
    outcome, again, _ = problem.solve(d, history, compliance, 1e-4, w)
    assert outcome.newton_iterations == 1
    assert np.abs(again - u).max() < 1e-6 * RANGE


def test_a_snap_meets_negative_curvature_and_releases_energy():
    """A single summit pulled beyond its stability: the solver must leave the saddle and fall back."""
    problem = Problem(free=True, roughness=0.0)
    compliance = 1.0
    assert problem.law.stiffness * np.linalg.eigvalsh(problem.dense).max() > 5, "the scene is not unstable"
    history = problem.points.zeros()
    _, _, w = problem.solve(0.0, history, compliance, 1e-8, jump=True)
    positions = np.linspace(0, 6, 25) * RANGE
    drops, met = [], []
    for d in positions:
        outcome, u, w = problem.solve(d, history, compliance, 1e-6, w, jump=True)
        assert outcome.converged and outcome.potential_drop >= 0
        drops.append(outcome.potential_drop)
        met.append(outcome.met_negative_curvature)
    assert any(met)
    assert np.abs(w).max() == 0 or np.abs(u).max() < 1e-6 * RANGE, "the punch is free in the end"
    assert max(drops) > 5 * np.median(drops)


def test_a_solve_that_is_not_allowed_enough_corrections_says_so(monkeypatch):
    problem = Problem(free=True)
    monkeypatch.setattr(NewtonSolver, "largest_newton_count", 1)
    outcome, _, _ = problem.solve(-2 * RANGE, problem.points.zeros(), 1.0, 1e-8)
    assert not outcome.converged and outcome.newton_iterations == 1


def test_a_scene_that_fills_the_plane_is_solved_though_its_mean_has_no_compliance():
    problem = Problem(radius=None, n=8, roughness=0.3)
    assert abs(problem.dense.sum()) < 1e-12 * np.abs(problem.dense).sum(), "u(q = 0) = 0"
    d, compliance, tolerance = -RANGE, 0.4, 1e-6
    history = 0.1 * problem.scale * problem.rng.standard_normal(problem.points.size)
    outcome, u, w = problem.solve(d, history, compliance, tolerance)
    assert outcome.converged
    residual = problem.law.traction(d + problem.height - u) - (w - history) / compliance
    assert abs(residual.sum()) * problem.area <= 0.2 * tolerance * problem.preload
    assert abs(u.mean()) < 1e-12 * RANGE
    # Full contact: the law is linear, (1 + J G K_0) u = G (J K_0 (d + z) + history), and w follows from u.
    K, G = problem.law.stiffness, problem.dense
    right = G @ (compliance * K * (d + problem.height) + history)
    expected = np.linalg.solve(np.eye(u.size) + compliance * K * G, right)
    assert (d + problem.height - expected).max() < 0
    assert np.abs(u - expected).max() < tolerance * RANGE
