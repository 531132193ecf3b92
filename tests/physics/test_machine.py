"""A machine that gives way, and loads that are held or ramped, in schemes with time: against the exact solution of a
column in series with the spring, against quasi-static paths, and energies that add up."""

import math
from functools import partial

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import pgfmd
from pgfmd import scene_objects

RHEOLOGIES = {
    0: {"model": "elastic"},
    1: {"model": "single", "modulus_ratio": 20.0, "relaxation_time": "10 ms"},
    5: {
        "model": "geometric", "modulus_ratio": 20.0, "relaxation_time": "1 ms", "elements": 5, "time_ratio": 4.0,
        "exponent": 0.5,
    },
}  # fmt: skip
TACK = pgfmd.Scene("tri-tack", grid={"n": 32}, drive={"speed": "20 um/s", "preload": "5 mN"}, solver={"accuracy": 0.01})


def column(elements, accuracy=0.005, **drive):
    """A film under a flat face that fills the cell: traction and surface are the same everywhere."""
    return pgfmd.Scene(
        {
            "punch": {"pattern": "sinusoid", "wavelength": "1 mm", "amplitude": "1e-6 pm"},
            "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.4, "thickness": "0.1 mm", "base": "bonded"},
            "rheology": RHEOLOGIES[elements],
            "adhesion": {"law": "repulsive", "work_of_adhesion": "50 mJ/m^2", "range": "1 um"},
            "drive": {"speed": "100 um/s", "preload": "0.3 N", "clearance": "0 m", **drive},
            "grid": {"n": 8, "length": "1 mm"},
            "solver": {"accuracy": accuracy},
        }
    )


def nothing(t):
    return np.zeros(0)


def exact(scene):
    """Phases of the column: (start, duration, F(t), d(t)) with t from the start of each, from ODEs of its elements.

    f = K (D + F/k_M - u), F = -A f, u = G0 (J_inf f + J phi), lambda dphi/dt = f - phi.
    """
    creep, law = scene_objects.series_of(scene.rheology).to_creep(), scene_objects.law_of(scene.adhesion)
    area, spring = scene.grid.length**2, scene_objects.machine_compliance(scene)
    depth = float(scene_objects.compliance_of(scene)(np.zeros(1), np.zeros(1))[0])
    weights, times = np.asarray(creep.J), np.asarray(creep.retardation_times)
    stiff = law.stiffness / (1.0 + law.stiffness * (spring * area + depth * creep.J_inf))

    def traction(phase, origin, t, phi):
        return stiff * (origin + phase.displacement(t) - depth * (weights @ phi))

    phases, begin, origin, phi = [], 0.0, scene.drive.clearance, np.zeros(weights.size)
    for phase in scene_objects.drive_of(scene).phases:
        pull = partial(traction, phase, origin)
        target = {"preload": scene.drive.preload, "detached": 0.0}.get(phase.ends_with)

        def met(t, phi, pull=pull, target=target):
            return -area * pull(t, phi) - target

        met.terminal = True
        span = phase.duration if math.isfinite(phase.duration) else 10.0
        if weights.size:
            found = solve_ivp(
                lambda t, phi, pull=pull: (pull(t, phi) - phi) / times, (0.0, span), phi, method="LSODA", rtol=1e-11,
                atol=1e-9, events=met if target is not None else None, dense_output=True,
            )  # fmt: skip
            inner, span = found.sol, found.t[-1]
        else:
            inner = nothing
            span = span if target is None else brentq(lambda t: met(t, np.zeros(0)), 1e-9, span, xtol=1e-16)

        def force(t, pull=pull, inner=inner):
            return -area * pull(t, inner(t))

        def place(t, origin=origin, phase=phase, force=force):
            return origin + phase.displacement(t) + spring * force(t)

        phases.append((begin, span, force, place))
        begin, origin, phi = begin + span, origin + phase.displacement(span), inner(span)
    return phases


def errors(scene):
    """Largest errors of force [preloads] and place [m] over a run, and how many steps it took."""
    rows, phases = [], exact(scene)
    pgfmd.simulate(scene, each=lambda step: rows.append(step.row))
    of_force, of_place = 0.0, 0.0
    for row in rows:
        begin, _, force, place = next((p for p in phases if row.time <= p[0] + p[1]), phases[-1])
        if row.time <= begin + phases[-1][1]:
            of_force = max(of_force, abs(row.force - force(row.time - begin)) / scene.drive.preload)
            of_place = max(of_place, abs(row.displacement - place(row.time - begin)))
    return of_force, of_place, len(rows)


@pytest.mark.parametrize("stiffness", ["100 kN/m", "5 kN/m"])
@pytest.mark.parametrize("elements", RHEOLOGIES)
def test_a_spring_in_series_with_a_column_is_that_of_the_exact_solution(elements, stiffness):
    of_force, of_place, _ = errors(column(elements, dwell="20 ms", machine_stiffness=stiffness))
    # The turn begins where the preload is met to 1e-4 of itself.
    assert of_force < (1e-9 if elements == 0 else 1.5e-3)
    assert of_place < (1e-13 if elements == 0 else 5e-9)


@pytest.mark.parametrize("elements", [1, 5])
def test_a_ramped_load_is_that_of_the_exact_solution(elements):
    of_force, of_place, _ = errors(column(elements, control="load"))
    assert of_force < 1e-7 and of_place < 1e-7


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
