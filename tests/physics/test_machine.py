"""A machine that gives way, and loads that are held or ramped, in schemes with time: against the exact solution of a
column in series with the spring, against quasi-static paths, and energies that add up."""

import pytest

import pgfmd
from pgfmd import scene_objects
from tests.physics.column import RHEOLOGIES, column, errors

TACK = pgfmd.Scene("tri-tack", grid={"n": 32}, drive={"speed": "20 um/s", "preload": "5 mN"}, solver={"accuracy": 0.01})


@pytest.mark.parametrize("stiffness", ["100 kN/m", "5 kN/m"])
@pytest.mark.parametrize("elements", RHEOLOGIES)
def test_a_spring_in_series_with_a_column_is_that_of_the_exact_solution(elements, stiffness):
    found = errors(column(elements, dwell="20 ms", machine_stiffness=stiffness))
    # The turn begins where the preload is met to 1e-4 of itself.
    assert found.force < (1e-9 if elements == 0 else 1.5e-3)
    assert found.place < (1e-13 if elements == 0 else 5e-9)


@pytest.mark.parametrize("elements", [1, 5])
def test_a_ramped_load_is_that_of_the_exact_solution(elements):
    found = errors(column(elements, control="load"))
    assert found.force < 1e-7 and found.place < 1e-7


def final(scene):
    """The state of a finished run."""
    states = []
    pgfmd.simulate(scene, each=lambda step: states or states.append(step._simulation.state))
    return states[0]


SPRUNG = {"machine_stiffness": "3 kN/m"}
LOADED = {"control": "load"}


@pytest.mark.parametrize("drive", [SPRUNG, LOADED], ids=["spring", "load"])
def test_energies_add_up_ever_better_with_a_spring(drive):
    shares = []
    for accuracy in (0.01, 0.0025):
        energies = final(TACK.replace(drive=drive, solver={"accuracy": accuracy})).energies
        shares.append(energies.largest_residual / (energies.viscous + energies.released))
    assert shares[1] < min(0.005, 0.6 * shares[0])


@pytest.mark.parametrize("drive", [SPRUNG, LOADED], ids=["spring", "load"])
def test_explicit_steps_of_a_small_mass_see_the_same_machine(drive):
    scene = TACK.replace(grid={"n": 24}, drive={"speed": "1 mm/s", **drive}, solver={"accuracy": 1e-3})
    massless = final(scene)
    found = [
        final(scene.replace(solver={"scheme": "gfmd", "gfmd": {"omega_tau": frequency, "steps_per_tau": 4.0 * frequency}}))
        for frequency in (8.0, 16.0)
    ]  # fmt: skip
    apart = [abs(state.pull_off_force / massless.pull_off_force - 1.0) for state in found]
    assert apart[1] < 0.03 and apart[1] < 0.65 * apart[0]
    # The energy that a jump releases is known to first order in the step.
    left = [state.energies.largest_residual for state in found]
    assert left[1] < 0.6 * left[0] and left[1] < 5e-3 * (found[1].energies.viscous + found[1].energies.released)


def test_a_dead_load_flings_the_punch_out_of_reach():
    state = final(TACK.replace(drive=LOADED))
    assert state.finished == "detached" and state.smallest_gap >= scene_objects.law_of(TACK.adhesion).reach
    # What it released is the work of the load on the last way, and the interface's.
    assert state.energies.released > 0.0 and state.counters.jumps == 2


def test_an_elastic_punch_under_load_loses_what_its_jumps_release_as_quasistatically():
    scene = TACK.replace(drive=LOADED, rheology={"model": "elastic", "modulus_ratio": None, "relaxation_time": None})
    quick, still = final(scene).energies, final(TACK.replace(drive=LOADED, solver={"scheme": "quasistatic"})).energies
    assert quick.largest_residual < 0.03 * quick.released
    assert quick.released == pytest.approx(still.released, rel=0.02)
    assert quick.work == pytest.approx(still.work, rel=0.02)
