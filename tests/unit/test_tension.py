"""The lowest force within a step, and the work that a retracting punch does under tension."""

from types import SimpleNamespace

import numpy as np
import pytest

from pgfmd.physics.drive import Phase
from pgfmd.schemes.inertialess.audit import tension_of
from pgfmd.schemes.inertialess.retardation import IMPLICIT_EULER, SDIRK2

RETRACT, APPROACH = Phase("retract", 2.0, 2.0), Phase("approach", -2.0, -2.0)


def step(force, phase=RETRACT, tableau=SDIRK2, length=0.5, is_jump=False):
    """State, trial and work of a step in which the force (a function of the time) is exactly known."""
    forces = [force(node * length) for node in tableau.nodes]
    trial = SimpleNamespace(step=length, phase=phase, forces=forces, force=forces[-1], is_jump=is_jump, runaway=False)
    times = np.linspace(0, length, 20_001)
    work = -np.trapezoid(force(times), times) * phase.velocity_end
    pulled = np.trapezoid(np.maximum(-force(times), 0.0), times) * max(phase.velocity_end, 0.0)
    return SimpleNamespace(elapsed=0.0, force=force(0.0)), trial, tableau, work, pulled


@pytest.mark.parametrize(
    "force",
    [
        lambda t: 3.0 - 20.0 * t + 30.0 * t**2,  # through zero, its least within the step
        lambda t: -1.0 - 4.0 * t + 10.0 * t**2,  # all under tension, its least within the step
        lambda t: 1.0 - 5.0 * t + 0.0 * t,
        lambda t: 2.0 + t,
    ],
)
def test_parabolas_are_followed(force):
    *given, pulled = step(force)
    lowest, found = tension_of(*given)
    assert lowest == pytest.approx(force(np.linspace(0, 0.5, 20_001)).min(), abs=2e-3)
    assert found == pytest.approx(pulled, rel=2e-3, abs=1e-12)


def test_a_whole_step_under_tension_has_the_work_of_the_step():
    *given, _ = step(lambda t: -2.0 - t)
    assert tension_of(*given)[1] == given[-1]


def test_approaches_and_free_punches_do_no_work_of_separation():
    *given, _ = step(lambda t: -1.0 - t, phase=APPROACH)
    assert tension_of(*given) == (-1.5, 0.0)
    *given, _ = step(lambda t: 0.0 * t)
    assert tension_of(*given) == (0.0, 0.0)


def test_jumps_and_single_stages_have_their_ends_alone():
    *given, pulled = step(lambda t: 1.0 - 8.0 * t, tableau=IMPLICIT_EULER)
    assert tension_of(*given)[0] == -3.0
    assert tension_of(*given)[1] == pytest.approx(pulled, rel=5e-3)
    *given, _ = step(lambda t: 3.0 - 20.0 * t + 30.0 * t**2, is_jump=True)
    assert tension_of(*given)[0] == pytest.approx(0.5)
