"""The paper's scheme: its limit, its inertia, its stability, and what it does not do."""

import math

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd import scene_objects
from pgfmd.assemble import assemble
from pgfmd.errors import SceneError
from pgfmd.scene import load_scene
from pgfmd.schemes.gfmd.plugin import inertia_of_scene
from tests.physics.runs import run

FIVE = (
    "rheology.model=geometric", "rheology.elements=5", "rheology.time_ratio=6", "rheology.exponent=0.8",
    "rheology.relaxation_time=400 us",
)  # fmt: skip
FAST = ("grid.n=32", "drive.speed=200 um/s", "drive.preload=10 mN")
GFMD = "solver.scheme=gfmd"
ELASTIC = ("rheology.model=elastic", "drive.preload=1 mN", "drive.speed=50 um/s")


def curve_error(result, truth):
    """Rms difference of the forces over time, relative to the preload."""
    ours, theirs = (np.array([(row.time, row.force) for row in r.rows]).T for r in (result, truth))
    instants = np.linspace(0.0, min(ours[0, -1], theirs[0, -1]), 20_001)
    difference = np.interp(instants, *ours) - np.interp(instants, *theirs)
    return np.sqrt(np.mean(difference**2)) / result.scene.drive.preload


@pytest.mark.parametrize(("name", "extra"), [("tri-tack", ()), ("hex-tack", FIVE)], ids=["tri, N=1", "hex, N=5"])
def test_the_inertia_vanishes_as_one_over_omega(name, extra):
    truth = run(name, *FAST, *extra, "solver.accuracy=1e-5")
    errors = []
    for factor in (2, 4, 8):
        result = run(
            name, *FAST, *extra, GFMD, f"solver.gfmd.omega_tau={2 * math.pi * factor}",
            f"solver.gfmd.steps_per_tau={10 * factor}",
        )  # fmt: skip
        errors.append(curve_error(result, truth))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([1.0, 1.0], abs=0.25)


def test_the_energy_audit_closes_with_the_square_of_the_step():
    shares = []
    for steps in (20, 40):
        energies = run("tri-tack", *FAST, *FIVE, GFMD, f"solver.gfmd.steps_per_tau={steps}").state.energies
        shares.append(energies.largest_residual / energies.work)
    assert shares[0] < 1e-4
    assert shares[0] / shares[1] > 1.8


def test_elastic_steps_need_omega_and_dt_and_no_branches():
    with pytest.raises(SceneError, match=r"solver\.gfmd\.omega(.|\n)*solver\.gfmd\.dt"):
        load_scene("tri-tack", [GFMD, *ELASTIC])
    keys = ("solver.gfmd.omega=2e4 rad/s", "solver.gfmd.dt=1e-5 s")
    simulation = assemble(load_scene("tri-tack", [GFMD, *ELASTIC, *keys, "grid.n=32"]), MPI.COMM_SELF)
    state = simulation.run()
    assert state.internal_variables.size == state.effective_traction.size == state.internal_displacements.size == 0
    assert state.finished == "detached" and state.force == 0.0
    assert state.counters.transform_pairs == state.counters.steps
    assert state.preload == pytest.approx(1e-3, rel=1e-3)


def stability_number(scene, step):
    """omega dt sqrt(1 + K_0 G0/kappa_inf) with this step [s], from the formula of the half-space."""
    frequency = scene.solver_gfmd.omega
    softest = 2.0 / (2.0 * math.pi / scene.grid.length * scene.substrate.contact_modulus)
    stiffness = scene_objects.law_of(scene.adhesion).stiffness * softest
    return frequency * step * math.sqrt(1.0 + stiffness / scene_objects.series_of(scene.rheology).kappa_inf)


@pytest.mark.parametrize("extra", [ELASTIC, ()], ids=["N=0", "N=1"])
def test_steps_up_to_the_limit_run_and_beyond_it_are_refused(extra):
    overrides = (*FAST, *extra, GFMD, "solver.gfmd.omega=1e4 rad/s")
    unit = stability_number(load_scene("tri-tack", [*overrides, "solver.gfmd.dt=1 s"]), 1.0)
    allowed = load_scene("tri-tack", [*overrides, f"solver.gfmd.dt={1.99 / unit!r} s"])
    scene_objects.confirm(allowed, "tri-tack")
    energies = assemble(allowed, MPI.COMM_SELF).run().energies
    assert abs(energies.work) < 1e-4
    refused = load_scene("tri-tack", [*overrides, f"solver.gfmd.dt={2.01 / unit!r} s"])
    with pytest.raises(SceneError, match=r"solver\.gfmd(.|\n)*stable(.|\n)*solver\.gfmd\.dt = ") as caught:
        scene_objects.confirm(refused, "tri-tack")
    cure = str(caught.value).split('solver.gfmd.dt = "')[1].split(" s")[0]
    scene_objects.confirm(load_scene("tri-tack", [*overrides, f"solver.gfmd.dt={cure} s"]), "tri-tack")


def test_beyond_the_limit_the_energy_audit_explodes():
    # The bound is that of a cell in contact all over. The punch covers a fifth of it: 0.66 of the stiffness.
    keys = (GFMD, "rheology.model=elastic", "substrate.boundary=periodic", "solver.gfmd.omega=1e4 rad/s", "grid.n=32")
    unit = stability_number(load_scene("flat-punch", [*keys, "solver.gfmd.dt=1 s"]), 1.0)
    shares = []
    for number in (0.5, 2.6):
        scene = load_scene("flat-punch", [*keys, f"solver.gfmd.dt={number / unit!r} s", "drive.speed=1 mm/s"])
        energies = assemble(scene, MPI.COMM_SELF).run().energies
        shares.append(energies.largest_residual / abs(energies.work))
    assert shares[0] < 0.02
    assert shares[1] > 0.5


def test_the_papers_rule_is_unstable_for_elastic_grids_above_128():
    step = math.pi / 10
    for n, sound in ((120, True), (136, False)):
        keys = ("solver.gfmd.omega=1 rad/s", f"solver.gfmd.dt={step} s", f"grid.n={n}")
        scene = load_scene("tri-tack", [GFMD, *ELASTIC, *keys])
        assert (stability_number(scene, step) < 2.0) == sound
        if sound:
            scene_objects.confirm(scene, "tri-tack")
        else:
            with pytest.raises(SceneError, match="stable"):
                scene_objects.confirm(scene, "tri-tack")


def test_fast_pulls_shorten_the_step_and_keep_omega_dt():
    slow, fast = (inertia_of_scene(load_scene("tri-tack", [GFMD, f"drive.speed={speed} um/s"])) for speed in (1, 1e5))
    assert (slow.limited_by, fast.limited_by) == ("relaxation", "motion")
    assert slow.step == pytest.approx(20e-6) and slow.frequency == pytest.approx(2 * math.pi / 400e-6)
    scene = load_scene("tri-tack")
    assert fast.step == pytest.approx(0.01 * scene.adhesion.range / 0.1)
    for inertia in (slow, fast):
        assert inertia.frequency * inertia.step == pytest.approx(math.pi / 10)


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("substrate.boundary=free", "substrate.boundary"),
        ("solver.gfmd.omega=100 rad/s", "solver.gfmd.dt"),
        ("solver.gfmd.omega=100 Hz", "solver.gfmd.omega"),
        ("solver.gfmd.steps_per_tau=0", "solver.gfmd.steps_per_tau"),
        ("solver.gfmd.typo=1", "solver.gfmd.typo"),
    ],
)
def test_what_gfmd_cannot_do_is_refused(override, key):
    with pytest.raises(SceneError) as caught:
        load_scene("tri-tack", [GFMD, override])
    assert key in [problem.key for problem in caught.value.problems]


def test_a_start_in_contact_is_refused():
    with pytest.raises(SceneError, match=r"drive\.clearance(.|\n)*out of reach"):
        scene_objects.confirm(load_scene("tri-tack", [GFMD, "drive.clearance=0 m"]), "tri-tack")
