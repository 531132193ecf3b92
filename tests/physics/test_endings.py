"""Runs at the limits of rounding: they end, and where they can't be finished, with a cure that works."""

import re

import pytest
from mpi4py import MPI

from pgfmd import scene_objects
from pgfmd.assemble import assemble
from pgfmd.errors import RunError, SceneError
from pgfmd.runner import warm_up
from pgfmd.scene import load_scene, scene_from_mapping
from pgfmd.solver.trial_step import Change, Trial

QUASISTATIC, LOAD = "solver.scheme=quasistatic", "drive.control=load"


def finish(scene, *overrides):
    """The simulation of a shipped scene or a mapping, run to its end."""
    made = load_scene(scene, overrides) if isinstance(scene, str) else scene_from_mapping(scene, overrides)
    simulation = assemble(made, MPI.COMM_SELF)
    simulation.run()
    return simulation


def cured(scene, *overrides):
    """The simulation after what the message of its failure asks for has been done, and that message."""
    with pytest.raises(RunError) as caught:
        finish(scene, *overrides)
    message = str(caught.value)
    preload = re.search(r'Raise drive\.preload to "([^"]+)" or more', message)
    assert preload, message
    return finish(scene, *overrides, f"drive.preload={preload[1]}")


def test_a_preload_that_single_precision_cannot_balance_does_not_hold_up_the_run():
    simulation = finish("flat-punch", "grid.n=8", QUASISTATIC, "solver.precision=single", "drive.preload=1e-9 N")
    counters = simulation.state.counters
    assert simulation.state.finished == "detached"
    assert counters.newton_iterations < 50 * (counters.steps + counters.rejected_steps)


@pytest.mark.parametrize("keys", [(QUASISTATIC,), ("rheology.model=elastic",)], ids=["quasistatic", "inertialess"])
def test_a_preload_below_rounding_is_an_error_and_the_cure_works(keys):
    assert cured("flat-punch", "grid.n=8", "drive.preload=1e-22 N", *keys).state.finished == "detached"


def test_what_single_precision_cannot_balance_mixed_precision_can():
    tiny = ("flat-punch", "grid.n=8", QUASISTATIC, "drive.preload=1e-13 N")
    with pytest.raises(RunError, match=r'Set solver\.precision = "mixed"'):
        finish(*tiny, "solver.precision=single")
    assert finish(*tiny, "solver.precision=mixed").state.preload == pytest.approx(1e-13, rel=1e-3)


WIDE = {
    "punch": {"pattern": "power", "radius": "583 m", "curvature_radius": "1036 m", "exponent": 1.0001},
    "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.4999999, "thickness": "11.4 m", "base": "bonded"},
    "rheology": {"model": "elastic"},
    "adhesion": {"work_of_adhesion": "334 J/m^2"},
    "drive": {"speed": "1 m/s", "preload": "4.5e-8 N", "control": "load"},
    "grid": {"n": 41, "length": "4667 m"},
    "solver": {"scheme": "quasistatic", "accuracy": 0.3},
}
"""Forces of 1e11 preloads."""


def test_under_load_control_a_cure_is_a_larger_preload():
    assert cured(WIDE).state.finished == "detached"


def test_corrections_that_vanish_in_a_soft_spring_end_the_solve():
    scene = {
        "punch": {"pattern": "hexagonal", "radius": "375 um", "wavelength": "1.875 mm", "amplitude": "4.0125 um"},
        "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": -0.5, "boundary": "free"},
        "rheology": {"model": "elastic"},
        "adhesion": {"work_of_adhesion": "402 mJ/m^2"},
        "drive": {"speed": "1 um/s", "preload": "0.7 N", "control": "load"},
        "grid": {"n": 4, "length": "1.5 mm"},
        "solver": {"scheme": "quasistatic", "max_steps": 150},
    }
    counters = finish(scene).state.counters
    # A correction or two a step are enough; a few steps have to find out that no more can be done.
    assert counters.newton_iterations < 10 * (counters.steps + counters.rejected_steps)


def test_rounding_in_a_soft_spring_is_no_jump():
    scene = {
        "punch": {"pattern": "flat", "radius": "375 um"},
        "substrate": {"youngs_modulus": "52764.9 Pa", "poisson_ratio": 0.4008},
        "rheology": {"model": "elastic"},
        "adhesion": {"work_of_adhesion": "1.5115e-4 J/m^2", "range": "1.25791 um"},
        "drive": {"speed": "1 um/s", "preload": "1.15 mN", "control": "load"},
        "grid": {"n": 5, "length": "1.5 mm"},
        "solver": {"scheme": "quasistatic", "accuracy": 1e-3},
    }
    state = finish(scene).state
    assert state.finished == "detached" and state.counters.jumps <= 2 and state.counters.steps < 200


def test_a_quasistatic_run_ends_where_the_punch_lets_go_within_a_long_turn():
    scene = ("flat-punch", "grid.n=8", QUASISTATIC, LOAD, "drive.retract_speed=1 cm/s", "drive.turn_time=0.02 s")
    simulation = finish(*scene)
    assert simulation.state.finished == "detached" and simulation.phase.name == "turn"
    assert simulation.state.counters.steps < 200


def test_steps_that_vanish_in_the_time_end_the_run():
    simulation = assemble(load_scene("flat-punch", ["grid.n=8"]), MPI.COMM_SELF)
    scheme, state = simulation.scheme, simulation.state
    state.elapsed = state.time = 1.0

    def take(step: float, moved: float = 0.0):
        change = Change(moved, moved, 0.0, 0.0, (0.0,), step)
        scheme._require_time(state, Trial(step, state.position, simulation.phase, True, change=change))
        state.last_step = step

    # One after a longer one, growing ones, and those in which the surface jumps, are what they should be.
    for step, moved in ((1e-3, 0.0), (1e-17, 0.0), (2e-17, 0.0), (1e-17, 1.0), (1e-16, 0.0)):
        take(step, moved)
    with pytest.raises(RunError, match="time stands still"):
        take(1e-17)


def test_scenes_whose_times_and_places_rounding_hides_are_refused():
    for key, cure in (("drive.dwell", "s"), ("drive.clearance", "m")):
        with pytest.raises(SceneError, match=f"{key}.*expected at most") as caught:
            scene_objects.confirm(load_scene("tri-tack", [f"{key}=1e20 {cure}"]), "tri-tack")
        most = re.search(r"expected at most (\S+) ", str(caught.value))[1]
        scene_objects.confirm(load_scene("tri-tack", [f"{key}={0.9 * float(most)!r} {cure}"]), "tri-tack")


def test_kernels_of_quasistatic_runs_in_single_precision_can_be_compiled_beforehand():
    # By a scene that has no spring, which single precision refuses.
    warm_up("quasistatic", "single")
