"""Both schemes against scipy's integrators of the same model, n = 16: another code path in space, time and memory."""

import numpy as np
import pytest

from tests.physics.dense import Massless, WithInertia
from tests.physics.runs import run

SMALL = ("grid.n=16", "punch.wavelength=300 um", "drive.speed=200 um/s", "drive.preload=4 mN", "output.energy=false")
FIVE = (
    "rheology.model=geometric", "rheology.elements=5", "rheology.time_ratio=6", "rheology.exponent=0.8",
    "rheology.relaxation_time=400 us",
)  # fmt: skip


def largest_difference(result, truth):
    """Of the forces at some 300 ends of steps, relative to the preload."""
    rows = result.rows
    chosen = rows[:: max(1, len(rows) // 300)]
    difference = truth.forces([row.time for row in chosen]) - [row.force for row in chosen]
    return np.abs(difference).max() / result.scene.drive.preload


# Each scheme with each pattern and each number of elements.
@pytest.mark.parametrize(("name", "extra"), [("tri-tack", ()), ("hex-tack", FIVE)], ids=["tri-1", "hex-5"])
def test_gfmd_is_the_solution_of_its_equations(name, extra):
    errors = []
    truth = None
    for steps in (100, 200):
        result = run(name, *SMALL, *extra, "solver.scheme=gfmd", f"solver.gfmd.steps_per_tau={steps}")
        truth = truth or WithInertia(result.scene)
        errors.append(largest_difference(result, truth))
        assert result.state.preload_time == pytest.approx(truth.preload_time, rel=1e-6)
    assert errors[-1] < 1e-6
    # Second order, but for where a summit comes into reach within a step.
    assert errors[0] / errors[1] > 2.5 or errors[0] < 1e-6


@pytest.mark.parametrize(("name", "extra"), [("tri-tack", FIVE), ("hex-tack", ())], ids=["tri-5", "hex-1"])
def test_inertialess_is_the_solution_of_the_massless_model(name, extra):
    result = run(name, *SMALL, *extra, "solver.accuracy=1e-7")
    truth = Massless(result.scene)
    assert largest_difference(result, truth) < 1e-6
    assert result.state.preload_time == pytest.approx(truth.preload_time, rel=1e-6)
