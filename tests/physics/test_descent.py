"""The descent to static states: against Newton's method and dense matrices, with its transforms counted."""

import numpy as np
import pytest
import scipy.linalg
from mpi4py import MPI

from pgfmd.assemble import assemble
from pgfmd.output.recorder import Recorder
from pgfmd.scene import load_scene
from pgfmd.schemes.quasistatic.lobpcg import SoftestMode
from pgfmd.solver import contact_kernels, descent_kernels
from pgfmd.solver.descent import FLAT, Descent, newton_step
from tests.physics.dense import LowestCurvatures


def scene(name, n, *changes):
    """A quasi-static scene."""
    return load_scene(name, [f"grid.n={n}", "solver.scheme=quasistatic", *changes])


def test_the_step_in_two_unknowns_is_that_of_lapacks_modes():
    rng = np.random.default_rng(0)
    for number in range(300):
        root, bend, slope = rng.normal(size=(4, 2)), 2.0 * rng.normal(size=(2, 2)), rng.normal(size=2)
        norm, bend = root.T @ root, bend + bend.T
        if number % 3 == 0:
            # Directions that know nothing of each other.
            norm, bend = np.diag(np.diag(norm)), np.diag(np.diag(bend))
        values, modes = scipy.linalg.eigh(norm + bend, norm)
        parts = modes.T @ slope / np.maximum(np.abs(values), FLAT)
        step, fall, lowest = newton_step(three(norm), three(bend), tuple(slope), 1e-8)
        np.testing.assert_allclose(step, modes @ parts, rtol=1e-6)
        assert fall == pytest.approx(0.5 * (modes.T @ slope) @ parts, rel=1e-6)
        assert lowest == pytest.approx(values[0], rel=1e-6, abs=1e-9)
    # A last move that is none, or a multiple of the other direction.
    for p in (0.0, -0.7):
        step, fall, lowest = newton_step((2.0, 2.0 * p, 2.0 * p * p), (6.0, 6.0 * p, 6.0 * p * p), (1.0, p), 1e-8)
        assert (
            step == pytest.approx((1.0 / 8.0, 0.0))
            and fall == pytest.approx(1.0 / 16.0)
            and lowest == pytest.approx(4.0)
        )


def three(matrix):
    """Entries 00, 01, 11 of a symmetric matrix."""
    return matrix[0, 0], matrix[0, 1], matrix[1, 1]


def test_a_probe_is_the_surface_moved():
    rng = np.random.default_rng(1)
    simulation = assemble(scene("hex-tack", 20), MPI.COMM_SELF)
    solver, points = simulation.scheme.solver, simulation.points
    size, offset, law = points.size, points.offset, solver.law_numbers
    u, z, p = (0.5 * solver.law.range * rng.normal(size=size) for _ in range(3))
    w, dz, dp = (1e4 * rng.normal(size=size) for _ in range(3))
    history, (b, c), compliance, position = 1e3 * rng.normal(size=size), (-0.2, 0.7), 0.4, -0.2e-6
    results = [np.zeros((3, size)) for _ in range(2)]
    rows, expected = np.zeros((10, points.rows)), np.zeros((4, points.rows))
    descent_kernels.probe(
        solver.height, position, u, w, b, z, dz, c, p, dp, history, compliance, law, offset, *results[0], rows
    )
    move, turn = b * z + c * p, b * dz + c * dp
    contact_kernels.evaluate(
        solver.height,
        position,
        u,
        w,
        move,
        turn,
        1.0,
        compliance,
        history,
        compliance,
        law,
        offset,
        *results[1],
        expected,
    )
    np.testing.assert_allclose(results[0], results[1], rtol=1e-9, atol=1e-9 * np.abs(results[1]).max())
    totals, (_, k, r) = rows.sum(axis=1), results[1]
    np.testing.assert_allclose(totals[:4], expected.sum(axis=1), rtol=1e-9)
    np.testing.assert_allclose(totals[4:6], [z @ r, p @ r], rtol=1e-9)
    np.testing.assert_allclose(totals[6:9], [(z * k) @ z, (z * k) @ p, (p * k) @ p], rtol=1e-9)
    near = (position + solver.height - u < solver.law.reach) | (k != 0.0)
    assert rows[9].max() == pytest.approx(np.abs(move[near]).max())
    sums = np.zeros((6, points.rows))
    descent_kernels.products(k, z, dz, p, dp, offset, sums)
    np.testing.assert_allclose(sums[:3].sum(axis=1), totals[6:9], rtol=1e-9)
    np.testing.assert_allclose(sums[3:].sum(axis=1), [z @ dz, p @ dz, p @ dp], rtol=1e-9)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("hertz", ["grid.n=48"]),
        ("tri-tack", ["grid.n=64", "adhesion.range=8 um"]),
        ("tri-tack", ["grid.n=48", "adhesion.law=repulsive", "adhesion.range=1 um", "solver.precision=mixed"]),
        ("flat-punch", ["grid.n=32", "solver.precision=single"]),
    ],
)
def test_where_there_is_one_minimum_newtons_method_finds_it_too(name, changes):
    simulation = assemble(scene(name, 48, *changes), MPI.COMM_SELF)
    solver, points, law = simulation.scheme.solver, simulation.points, simulation.scheme.law
    nothing, forces, surfaces = np.zeros(points.size, solver.dtype), [], []
    for solve in (solver.solve, Descent(solver).solve):
        u, w = (points.zeros(solver.dtype) for _ in range(2))
        outcome = solve(-1e-6, nothing, 1.0, u, w, 1e-4, True)
        assert outcome.converged and outcome.potential_drop > 0.0
        forces.append(outcome.force)
        surfaces.append(u)
        np.testing.assert_allclose(solver.convolve(w, points.zeros(solver.dtype)), u, atol=1e-6 * np.abs(u).max())
    near = -1e-6 + solver.height - surfaces[0] < law.range
    assert np.abs(surfaces[0] - surfaces[1])[near].max() < 5e-4 * law.range
    assert forces[1] == pytest.approx(forces[0], abs=1e-3 * abs(forces[0]))


def test_a_symmetric_punch_lets_go_as_a_whole():
    # With a mode of the search in the span of the descent it came off from one side, in 24 jumps.
    simulation = assemble(scene("flat-punch", 32), MPI.COMM_SELF)

    def lopsided(simulation):
        whole = simulation.points.to_rows(simulation.state.surface_displacement, 0.0)
        return max(np.abs(whole - whole[::-1]).max(), np.abs(whole - whole[:, ::-1]).max())

    recorder = Recorder(lopsided)
    simulation.observers.append(recorder)
    state = simulation.run()
    assert state.counters.jumps <= 3 and max(recorder.measured) < 1e-3 * simulation.scheme.law.range


@pytest.mark.parametrize(("name", "clearance", "most"), [("tri-tack", "-2 um", 75), ("hex-tack", "-2 um", 70)])
def test_a_state_from_rest_takes_few_transforms(name, clearance, most):
    # Newton's method took 160 and 145 pairs, with its search for the softest mode. It is in these numbers.
    changes = [f"drive.clearance={clearance}", "drive.preload=100 mN"]
    simulation = assemble(scene(name, 256, *changes), MPI.COMM_SELF)
    force = simulation.scheme.start(simulation.state)
    assert simulation.scheme.pairs <= most
    sharp = assemble(scene(name, 256, *changes, "solver.accuracy=1e-4"), MPI.COMM_SELF)
    assert force == pytest.approx(sharp.scheme.start(sharp.state), rel=1e-3)


def test_a_loop_takes_two_thirds_of_the_transforms_of_newtons_method():
    # 14059 pairs then; loop and pull-off are those at accuracy 0.001. Within a step it is chance where a jump begins, so
    # that the rounding of another processor moves both: the pull-off by half of the accuracy.
    state = assemble(scene("hex-tack", 64, "drive.preload=5 mN"), MPI.COMM_SELF).run()
    assert state.counters.transform_pairs <= 9400
    assert state.energies.released == pytest.approx(0.2713e-9, rel=0.04)
    assert -state.pull_off_force == pytest.approx(3.1714e-3, rel=5e-3)


def test_three_iterations_find_saddles_that_one_would_pass(monkeypatch):
    lowest, pairs = [], []
    for blind in (False, True):
        if blind:
            # As if a mode were enough that is followed from step to step.
            monkeypatch.setattr(SoftestMode, "most_iterations", 1)
            monkeypatch.setattr(SoftestMode, "_softened", lambda *_: False)
        simulation = assemble(scene("hex-tack", 32, "drive.preload=5 mN", "solver.accuracy=0.03"), MPI.COMM_SELF)
        watch = LowestCurvatures(simulation)
        earlier = simulation.scheme.pairs
        simulation.observers.append(watch)
        state = simulation.run()
        assert state.counters.jumps > 30 and len(watch.lowest) > 150
        lowest.append(min(watch.lowest))
        pairs.append(state.counters.transform_pairs - earlier)
    assert lowest[0] > -0.01 and lowest[1] < -0.02
    # The search is cheap: without most of it, the run takes hardly less than two thirds.
    assert pairs[0] < 1.6 * pairs[1]


def test_an_elastic_scene_starts_in_contact_by_the_same_descent():
    changes = ["drive.clearance=-3 um", "drive.preload=100 mN"]
    elastic = assemble(load_scene("tri-tack", ["grid.n=128", "rheology.model=elastic", *changes]), MPI.COMM_SELF)
    slow = assemble(scene("tri-tack", 128, *changes), MPI.COMM_SELF)
    forces = [simulation.scheme.start(simulation.state) for simulation in (elastic, slow)]
    assert forces[0] == pytest.approx(forces[1], rel=1e-3)
    # Newton's method took 141.
    assert elastic.scheme.pairs <= 45
