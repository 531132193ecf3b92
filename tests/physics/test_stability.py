"""Runs far from the shipped scenes end with a finite result, a force of zero, and an energy audit that closes.

A subset of the table of scripts/studies/stability/run.py, on small grids, odd and prime ones among them.
"""

import math

import numpy as np
import pytest

from tests.physics.runs import run

ELASTIC = "rheology.model=elastic"
JITTER = "punch.height_jitter=50 nm"
FAST, SLOW = "drive.speed=1e5 um/s", "drive.speed=1e-3 um/s"
SHORT, LONG = "adhesion.range_factor=15.6", "adhesion.range_factor=0.00156"
"""Ranges of a tenth of, and ten times, the rule of the grid."""


def ratio(value):
    return f"rheology.modulus_ratio={value!r}"


def decades(elements):
    """A spectrum from 1 ns to 1000 s."""
    return (
        "rheology.model=geometric", f"rheology.elements={elements}", "rheology.relaxation_time=1e-9 s",
        f"rheology.time_ratio={10 ** (12 / (elements - 1)):.6g}", "rheology.exponent=0.5", ratio(1000),
    )  # fmt: skip


CLOSING = {
    "elastic": ("tri-tack", 23, ELASTIC),
    "elastic, heights jittered": ("hex-tack", 24, ELASTIC, JITTER),
    "elastic, deep": ("hex-tack", 24, ELASTIC, "drive.preload=1 N"),
    "elastic, short range": ("hex-tack", 24, ELASTIC, SHORT),
    "elastic, flat": ("flat-punch", 16, ELASTIC),
    "nearly elastic": ("tri-tack", 24, ratio(1.000001)),
    "half as stiff again": ("tri-tack", 23, ratio(1.5)),
    "8": ("tri-tack", 31, ratio(8)),
    "1000": ("tri-tack", 37, ratio(1000)),
    "1e6": ("flat-punch", 48, ratio(1e6)),
    "two elements twelve decades apart": ("tri-tack", 23, *decades(2)),
    "forty elements": ("tri-tack", 41, *decades(40)),
    "forty elements, held": ("hex-tack", 32, *decades(40), FAST, "drive.dwell=1e4 s"),
    "slow": ("tri-tack", 24, SLOW),
    "fast": ("tri-tack", 48, FAST),
    "fast, hexagonal": ("hex-tack", 43, FAST),
    "fast, flat": ("flat-punch", 48, FAST),
    "fast, stiff, short range": ("tri-tack", 48, FAST, ratio(1e6), SHORT),
    "short range": ("hex-tack", 24, SHORT),
    "long range": ("tri-tack", 32, LONG),
    "small preload": ("flat-punch", 48, "drive.preload=0.01 mN"),
    "large preload": ("tri-tack", 29, "drive.preload=1 N"),
    "held": ("tri-tack", 24, "drive.dwell=1e4 s"),
    "free": ("tri-tack", 32, "substrate.boundary=free", JITTER),
    "repulsive": ("tri-tack", 32, "adhesion.law=repulsive"),
}
"""Name: scene, n, overrides."""
FINISHING = {
    "coarse": ("tri-tack", 40, "solver.accuracy=0.3"),
    "coarse, elastic": ("hex-tack", 40, "solver.accuracy=0.3", ELASTIC),
    "coarse, stiff and fast": ("tri-tack", 32, "solver.accuracy=0.3", ratio(1e6), FAST),
    "coarse, forty elements": ("flat-punch", 32, "solver.accuracy=0.3", *decades(40)),
    "fine": ("flat-punch", 32, "solver.accuracy=1e-6"),
    "fine, elastic": ("flat-punch", 24, "solver.accuracy=1e-6", ELASTIC),
    "fine, hexagonal": ("hex-tack", 24, "solver.accuracy=1e-6"),
}


def ended_well(case, *overrides):
    """The final state of a run that ended detached, finite, without force."""
    scene, n, *settings = case
    state = run(scene, f"grid.n={n}", *overrides, *settings).state
    assert state.finished == "detached"
    assert state.force == 0.0
    assert all(value is None or math.isfinite(value) for value in vars(state.energies).values())
    assert all(
        np.isfinite(field).all()
        for field in (state.surface_displacement, state.effective_traction, state.traction, state.internal_variables)
    )
    return state


@pytest.mark.parametrize("name", CLOSING)
def test_the_energy_audit_closes(name):
    state = ended_well(CLOSING[name], "solver.accuracy=1e-3")
    assert state.energies.work > 0.0
    assert state.energies.largest_residual <= 0.02 * state.energies.work


@pytest.mark.parametrize("name", FINISHING)
def test_the_ends_of_the_range_of_accuracies_finish(name):
    ended_well(FINISHING[name])


@pytest.mark.parametrize("settings", [(), ("drive.preload=0.01 mN",), (FAST,)], ids=["shipped", "soft", "fast"])
def test_a_surface_that_moves_fast_does_not_jump(settings):
    """Just within reach a flat surface leaps towards the punch, but in the time of its own relaxation."""
    state = ended_well(("flat-punch", 48, *settings), "solver.accuracy=1e-3")
    assert state.counters.jumps == 0
    assert state.counters.rejected_steps < state.counters.steps
