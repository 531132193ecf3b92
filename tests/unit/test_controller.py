"""The step controller on surfaces that are written down as formulas, and the quadrature of the punch's work."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from pgfmd.errors import RunError
from pgfmd.physics.drive import FORCE, PRELOAD, Ending, Phase
from pgfmd.schemes.inertialess.controller import ENERGY_CUT, MOST_REPEATS, Controller, StepLimits
from pgfmd.solver.ending_search import PRELOAD_TOLERANCE, Bracket, values_of
from pgfmd.solver.extrapolation import integral
from pgfmd.solver.state import State
from pgfmd.solver.trial_step import Change, Trial

TOLERANCE, RANGE, SPEED, SHORTEST = 1e-3, 1e-6, 1e-6, 1e-2
RETRACT, APPROACH = (
    Phase("retract", SPEED, SPEED),
    Phase("approach", -SPEED, -SPEED, ends_with=PRELOAD, endings=(Ending(FORCE, 1.0, 1),)),
)


class Surface:
    """A scheme whose steps change the surface by `moved(step)`, of which a quarter counts as an error; energy_error and
    force [N] as functions of the step."""

    order = 2

    def __init__(self, moved, energy_error=lambda step: 0.0, force=lambda step: 0.0):
        self.moved, self.energy_error, self.force = moved, energy_error, force
        self.tried, self.accepted = [], []

    def try_step(self, state, phase, step, sharp=False, jump=False):
        moved = self.moved(step)
        self.tried.append(step)
        return Trial(
            step, phase.displacement(step), phase, converged=math.isfinite(moved), error=0.25 * moved, is_jump=jump,
            force=self.force(step), energy_error=self.energy_error(step),
            change=Change(moved, moved, 0.0, 0.0, (0.0,), step) if math.isfinite(moved) else None,
        )  # fmt: skip

    def machine_share(self, state):
        return 1.0

    points = SimpleNamespace(grid=SimpleNamespace(cell_area=1e-12))

    def values_of(self, state, phase, trial=None):
        return values_of(phase, state, (trial or state).force, 0.0, lambda: 0.0)

    def accept(self, state, trial):
        self.accepted.append(trial)

    def require_preload(self, state, trial, slack):
        assert abs(trial.force) < math.inf and slack > 0.0

    def advice(self, state, trial):
        return "Give it up."


def controller(scheme, attractive=True, preload=1.0):
    return Controller(scheme, StepLimits(TOLERANCE, RANGE, SHORTEST, attractive), preload)


def state(step):
    empty = np.zeros(0)
    return State(empty, empty, empty, np.zeros((0, 0)), np.zeros((0, 0)), 0.0, step=step)


def test_a_step_within_the_tolerance_is_taken_and_the_next_one_aims_at_it():
    scheme, here = Surface(lambda step: 2e-3 * (step / 0.1) ** 3), state(0.1)
    trial, why = controller(scheme).advance(here, RETRACT)
    assert scheme.tried == [0.1] and not trial.is_jump and why == ""
    assert here.step == pytest.approx(0.1 * 0.85 * 2 ** (1 / 3))


@pytest.mark.parametrize("exponent", [1.0, 0.75])
def test_a_surface_that_is_merely_fast_does_not_jump(exponent):
    """However short the step, it moves by more than the tolerance within the time below which a step may be a jump."""
    scheme, here = Surface(lambda step: 0.5 * (step / 1e-6) ** exponent), state(0.1)
    trial, _ = controller(scheme).advance(here, RETRACT)
    assert trial.error > TOLERANCE and not trial.is_jump
    assert trial.step < 1e-3 * SHORTEST


@pytest.mark.parametrize("height", [0.01, 1.0])
def test_a_change_that_does_not_shrink_with_the_step_is_a_jump(height):
    scheme, here = Surface(lambda step: height + 1e-3 * step), state(0.1)
    trial, _ = controller(scheme).advance(here, RETRACT)
    assert trial.is_jump and trial.step < 1e-3 * SHORTEST
    assert here.step == 0.0


def test_a_jump_that_longer_steps_have_met_but_the_last_has_not_is_left_to_the_next_step():
    """Where the longer trials cross the instability and the short one ends before it."""
    scheme, here = Surface(lambda step: 1.0 if step > 1e-5 else 5e-3), state(0.1)
    trial, _ = controller(scheme).advance(here, RETRACT)
    assert not trial.is_jump and trial.step <= 1e-5


def test_without_attraction_nothing_jumps():
    scheme = Surface(lambda step: 1.0)
    trial, _ = controller(scheme, attractive=False).advance(state(0.1), RETRACT)
    assert not trial.is_jump


def test_a_surface_without_equilibrium_is_an_error_and_not_a_hang():
    scheme = Surface(lambda step: math.inf)
    with pytest.raises(RunError, match=r"no equilibrium.*Give it up"):
        controller(scheme).advance(state(0.1), RETRACT)
    assert len(scheme.tried) <= Controller.largest_try_count


def test_steps_are_not_cut_to_less_than_time_can_tell():
    scheme, here, hold = Surface(lambda step: math.inf), state(0.1), Phase("dwell", 0.0, 0.0, 10.0)
    here.elapsed = 1.0
    with pytest.raises(RunError, match="no equilibrium"):
        Controller(scheme, StepLimits(TOLERANCE, RANGE, math.inf, True), 1.0).advance(here, hold)
    assert 1e-18 < min(scheme.tried) < 1e-16


def test_a_step_whose_energies_do_not_balance_is_taken_again_and_shorter():
    scheme, here = Surface(lambda step: 1e-6, lambda step: (step / 0.05) ** 2), state(0.1)
    controller(scheme).advance(here, RETRACT)
    assert scheme.tried == pytest.approx([0.1, 0.1 * 0.85 / 2])
    assert here.step == pytest.approx(0.85 * 0.05)


def test_errors_of_energy_that_no_step_can_mend_cost_a_bounded_number_of_trials():
    scheme, here = Surface(lambda step: 1e-3 * (step / 0.1) ** 3, lambda step: 1e6), state(0.1)
    steps = []
    for _ in range(40):
        controller(scheme).advance(here, RETRACT)
        steps.append(scheme.accepted[-1].step)
    assert len(scheme.tried) <= 40 + 10 * MOST_REPEATS
    unhindered = 0.85 * 0.1 * 4.0 ** (1 / 3)
    assert steps[-1] == pytest.approx(unhindered / ENERGY_CUT[2], rel=1e-6)
    assert min(steps) > 0.9 * steps[-1]


def test_the_preload_is_met_by_the_step_that_ends_the_approach():
    scheme, here = Surface(lambda step: 1e-4, force=lambda step: 40.0 * step**2), state(0.5)
    here.phase_signs = [1]
    trial, why = controller(scheme).advance(here, APPROACH)
    assert why == "ending" and trial.force == pytest.approx(1.0, rel=PRELOAD_TOLERANCE)


def test_the_integral_of_a_parabola_times_a_line_is_exact():
    times, span = [0.0, 0.29, 1.0], 0.8
    value, factor = (lambda t: 2.0 - 3.0 * t + 5.0 * t**2), (lambda t: 0.3 - 1.7 * t)
    product = np.polynomial.Polynomial([2.0, -3.0, 5.0]) * np.polynomial.Polynomial([0.3, -1.7])
    found = integral(times, [value(t) for t in times], factor, span)
    assert found == pytest.approx(product.integ()(span), rel=1e-14)


@pytest.mark.parametrize("preload", [1e-3, 1e-9, 1e-14])
def test_a_preload_that_is_tiny_beside_a_step_is_met(preload):
    bracket, step = Bracket(0.0, -preload), 1.0
    excess = step + 0.3 * step**2 - preload
    for _ in range(60):
        step = bracket.narrow(step, excess)
        excess = step + 0.3 * step**2 - preload
        if abs(excess) <= 1e-4 * preload:
            break
    assert abs(excess) <= 1e-4 * preload


def test_a_force_that_jumps_over_the_preload_ends_the_search():
    bracket, step, tries = Bracket(0.0, -1.0), 1.0, 0
    while step is not None:
        tries, step = tries + 1, bracket.narrow(step, step - 1.0 if step < 0.37 else 5.0 + step)
    assert tries < 40 and bracket.low < 0.37 <= bracket.high and bracket.high - bracket.low < 1e-6
