"""When a solve no longer gets anywhere, and what becomes of it then."""

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.physics.halfspace import HalfSpace
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.solver.machine import ConvolutionWithSpring
from pgfmd.solver.multiplier import periodic_multiplier
from pgfmd.solver.newton import NewtonSolver
from pgfmd.solver.stagnation import MOST_IDLE, Progress
from pgfmd.solver.transform import Convolution

MODULUS, GAMMA, LENGTH, RANGE = 2.65e6, 0.05, 100e-6, 0.5e-6


def corrections_until_stalled(corrections) -> int:
    """How many of (drop, size, unsettled) are taken in before no more are expected."""
    progress = Progress(tolerance=1e-3, unbalanced=1.0)
    for count, (drop, size, unsettled) in enumerate(corrections, 1):
        if progress.stalls(drop, 1e-12, size, unsettled):
            return count
    return 0


def test_a_potential_that_falls_is_progress_however_long_it_takes():
    assert corrections_until_stalled((2e-12 * count, 0.5, 10.0) for count in range(1000)) == 0


@pytest.mark.parametrize(
    "correction",
    [
        lambda count: (0.0, 1e-9, 10.0 + (-1) ** count),
        lambda count: (1e-13 * count, 1e-9, 10.0),
        lambda count: (0.0, 0.5, 0.1),
        lambda count: (0.0, 1e-9 * 0.4**count, 0.5 * 0.4**count),
    ],
    ids=["a force that goes up and down", "a fall below rounding", "a correction that stays", "what is small enough"],
)  # fmt: skip
def test_what_gets_nowhere_is_noticed(correction):
    assert MOST_IDLE <= corrections_until_stalled(correction(count) for count in range(200)) <= MOST_IDLE + 2


def test_a_force_that_is_halved_again_and_again_is_progress():
    assert corrections_until_stalled((0.0, 1e-9, 1e9 * 0.49**count) for count in range(20)) == 0


class Sprung:
    """A flat punch on a soft spring, whose machine's end is `far` ranges deep."""

    def __init__(self, far: float, preload: float = 1e-4, dtype=np.float64):
        grid = Grid(10, LENGTH)
        self.points = points = PunchPoints(grid, 0.25 * LENGTH, MPI.COMM_SELF)
        self.convolve = Convolution(points, 10, periodic_multiplier(HalfSpace(MODULUS), LENGTH), dtype=dtype)
        self.position, self.force = -far * RANGE, 1e-3
        self.spring = far * RANGE / self.force
        self.area = grid.cell_area
        self.sprung = ConvolutionWithSpring(self.convolve, self.spring, 1.0)
        law = Cosine(GAMMA, RANGE)
        self.solver = NewtonSolver(points, self.sprung, points.zeros(dtype), law, preload)

    def solve(self, above: float, tolerance: float = 1e-3, **options):
        """From where the spring holds the punch `above` ranges over the surface that its force makes."""
        points = self.points
        w = points.zeros(self.solver.dtype)
        w[:] = -1.0 / (points.total * self.area)
        surface = self.convolve(w, points.zeros(self.solver.dtype)).max()
        # d + C F = u + above, with u = surface * F.
        w *= (above * RANGE - self.position) / (self.spring - surface)
        u = self.sprung(w, points.zeros(self.solver.dtype))
        outcome = self.solver.solve(self.position, points.zeros(), 1.0, u, w, tolerance, **options)
        return outcome, u, w


def test_a_surface_out_of_reach_of_a_loaded_punch_is_brought_back_to_it():
    # Set free, it would be a thousand ranges within the punch.
    problem = Sprung(far=1e3)
    outcome, _, w = problem.solve(above=2.0, jump=True)
    assert outcome.converged
    place = problem.position + problem.spring * outcome.force
    assert outcome.force == pytest.approx(-w.sum() * problem.area, rel=1e-6)
    gap = place - problem.convolve(w, problem.points.zeros())
    pull = problem.solver.law.traction(gap).sum() * problem.area
    assert outcome.force == pytest.approx(-pull, rel=1e-3)


def test_a_force_that_rounding_cannot_balance_ends_the_solve_and_is_told():
    problem = Sprung(far=1.0, preload=1e-14, dtype=np.float32)
    outcome, _, _ = problem.solve(above=0.1, jump=True)
    assert not outcome.converged and outcome.newton_iterations < 100
    assert outcome.left_over > 1.0
    # Beside the force that is there it is nothing.
    outcome, _, _ = problem.solve(above=0.1, jump=True, largest_force=1e-14)
    assert outcome.converged and outcome.newton_iterations < 100
