"""Single precision where it is enough, and mixed where it is not."""

import numpy as np
import pytest

from tests.physics.runs import run

SCENE = ("grid.n=48", "drive.speed=20 um/s", "drive.preload=10 mN")


def forces(result, instants):
    rows = result.rows
    return np.interp(instants, [row.time for row in rows], [row.force for row in rows]) / result.scene.drive.preload


def difference(result, truth):
    """Rms difference of the forces, relative to the preload."""
    instants = np.linspace(0.0, truth.rows[-1].time, 5001)
    return np.sqrt(np.mean((forces(result, instants) - forces(truth, instants)) ** 2))


@pytest.mark.parametrize("extra", [(), ("substrate.boundary=free",)], ids=["periodic", "free"])
def test_mixed_reaches_the_accuracy_of_double(extra):
    truth = run("tri-tack", *SCENE, *extra, "solver.accuracy=1e-6")
    errors = {}
    for accuracy in ("1e-2", "1e-5"):
        double, mixed = (
            run("tri-tack", *SCENE, *extra, f"solver.accuracy={accuracy}", f"solver.precision={precision}")
            for precision in ("double", "mixed")
        )
        errors[accuracy] = difference(double, truth), difference(mixed, truth)
        # Almost all transforms are single ones, and not many more than before.
        double_pairs, single_pairs = (operator.pairs for operator in mixed.simulation.scheme.solver.operators)
        assert double_pairs < 0.1 * single_pairs
        assert double_pairs + single_pairs < 1.15 * double.simulation.scheme.pairs
        assert mixed.state.energies.largest_residual < 1.5 * double.state.energies.largest_residual
        assert mixed.state.surface_displacement.dtype == np.float64
    for double_error, mixed_error in errors.values():
        assert mixed_error < 1.3 * double_error
    assert errors["1e-5"][1] < 0.1 * errors["1e-2"][1]


EXTREMES = {
    "large modulus ratio": ("rheology.modulus_ratio=1e6",),
    "many elements": (
        "rheology.model=geometric", "rheology.elements=40", "rheology.time_ratio=2", "rheology.exponent=0.8",
        "rheology.relaxation_time=1 ns", "rheology.modulus_ratio=1e6",
    ),
    "thin film": ("substrate.thickness=20 um", "substrate.base=sliding"),
}  # fmt: skip


@pytest.mark.parametrize("extra", EXTREMES.values(), ids=EXTREMES)
def test_mixed_has_the_error_of_double_where_automatic_precision_takes_it(extra):
    common = ("grid.n=32", *SCENE[1:], *extra)
    truth = run("tri-tack", *common, "solver.accuracy=1e-5")
    for accuracy in (1e-2, 1e-4):
        double, mixed = (
            run("tri-tack", *common, f"solver.accuracy={accuracy}", f"solver.precision={precision}")
            for precision in ("double", "mixed")
        )
        assert difference(mixed, truth) < 1.2 * difference(double, truth) + 1e-6, accuracy
        residuals = [each.state.energies.largest_residual for each in (double, mixed)]
        assert residuals[1] < 1.5 * residuals[0] + accuracy * truth.state.energies.work, accuracy
        assert mixed.simulation.scheme.pairs < 1.15 * double.simulation.scheme.pairs


def test_single_suffices_at_the_default_accuracy():
    truth = run("tri-tack", *SCENE, "solver.accuracy=1e-5")
    double, single = (run("tri-tack", *SCENE, f"solver.precision={precision}") for precision in ("double", "single"))
    assert difference(single, truth) < 2.0 * difference(double, truth) + 1e-4
    state = single.state
    fields = (
        state.surface_displacement,
        state.effective_traction,
        state.traction,
        state.internal_variables,
        state.internal_displacements,
        *state.past_displacements,
    )
    assert {field.dtype for field in fields} == {np.dtype(np.float32)}
    assert state.force == 0.0 and state.finished == "detached"
    assert single.simulation.scheme.pairs < 1.4 * double.simulation.scheme.pairs


def test_first_order_is_first_order():
    truth = run("tri-tack", *SCENE, "solver.accuracy=1e-6")
    errors, steps = [], []
    for accuracy in ("1e-3", "1e-4"):
        result = run("tri-tack", *SCENE, "solver.order=1", f"solver.accuracy={accuracy}")
        errors.append(difference(result, truth))
        steps.append(result.state.counters.steps)
    order = np.log(errors[0] / errors[1]) / np.log(steps[1] / steps[0])
    assert order == pytest.approx(1.0, abs=0.25)
