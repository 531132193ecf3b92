"""Packing of a run's state for a checkpoint: names in the file, and everything comes back."""

from dataclasses import fields

import numpy as np

from pgfmd.files.packing import arrays_of, numbers_of, unpack
from pgfmd.solver.cycles import CycleNumbers
from pgfmd.solver.state import State

RENAMED = {
    "displacement": "surface_displacement",
    "load": "effective_traction",
    "branches": "internal_variables",
    "images": "internal_displacements",
    "place": "punch_displacement",
    "preload_place": "preload_displacement",
    "followed": "followed_step",
    "past_u": "past_displacements",
    "past_w": "past_effective_tractions",
    "soft_mode": "softest_mode",
    "soft_load": "softest_mode_dual",
}
"""Names in checkpoints, which earlier builds have written, and the fields of State."""


PROGRAMMES = ("phase_place", "phase_signs", "stepped", "cycle", "cycles")
"""What a state knows of programmes of steps."""


def new_state(seed):
    rng = np.random.default_rng(seed)
    state = State(*rng.standard_normal((3, 5)), *rng.standard_normal((2, 2, 5)), position=rng.random())
    state.softest_mode, state.softest_mode_dual = rng.standard_normal((2, 5))
    return state


def test_a_checkpoint_has_the_names_of_earlier_builds():
    names = numbers_of(new_state(1))
    assert set(RENAMED) <= set(names) and not set(RENAMED.values()) & set(names)
    assert set(names) == {entry.metadata.get("stored", entry.name) for entry in fields(State)}


def test_a_checkpoint_of_a_build_without_programmes_is_read():
    state, other = new_state(1), new_state(2)
    numbers = {name: value for name, value in numbers_of(state).items() if name not in PROGRAMMES}
    unpack(other, numbers, lambda name, share: None)
    assert (other.stepped, other.cycle, list(other.phase_signs), list(other.cycles)) == (-1, CycleNumbers(), [], [])


def test_a_state_comes_back_as_it_was_under_its_own_names():
    state, other = new_state(1), new_state(2)
    state.punch_displacement, state.preload_displacement, state.followed_step = -1e-6, -2e-6, 3e-3
    state.past_displacements, state.past_effective_tractions = [state.traction + 1.0], [state.traction + 2.0]
    shares = {name: share.copy() for name, share in arrays_of(state).items()}
    assert {"displacement", "load", "branches", "images", "past_u/0", "past_w/0", "soft_load"} <= set(shares)
    unpack(other, numbers_of(state), lambda name, share: np.copyto(share, shares[name]))
    for name in RENAMED.values():
        np.testing.assert_array_equal(getattr(other, name), getattr(state, name))
