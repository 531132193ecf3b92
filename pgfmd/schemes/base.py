"""Protocols of schemes and of step controllers, as the loop, observers and controllers use them.

A scheme advances a state by one step of a given length. Its controller chooses the length, and accepts or rejects the
step. Implicit schemes do not change the state until a trial step is accepted; explicit ones change it immediately.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pgfmd.physics.adhesion.base import CohesiveLaw
from pgfmd.physics.drive import Phase
from pgfmd.solver.grid import PunchPoints
from pgfmd.solver.state import State
from pgfmd.solver.trial_step import Change

Vector = NDArray[np.floating[Any]]
"""A field at this rank's points under the punch, (size,)."""


class Polled(Protocol):
    """Iterations that poll whether they are to be abandoned (interruption.py)."""

    poll: Callable[[], None]


class Solves(Protocol):
    """The solver of a scheme's static problems (newton.py), as far as the loop needs it."""

    @property
    def cg(self) -> Polled:
        """Its long iterations, which can be interrupted."""


class Scheme(Protocol):
    """The interface of every scheme. Methods are collective.

    points: under the punch, of this rank. height: z [m] of the punch's face at them. law: between punch and elastomer.
    audit: whether there is an energy audit. machine_compliance [m/N]: of the spring between machine and punch, 0 for a
    rigid machine. cure: advice if numbers diverge. solver: of static problems, None if there are none.
    """

    points: PunchPoints
    height: Vector
    law: CohesiveLaw
    audit: bool
    machine_compliance: float
    cure: str

    @property
    def solver(self) -> Solves | None:
        """The solver of static problems; None for explicit schemes, whose steps are short."""

    @property
    def pairs(self) -> int:
        """Number of pairs of transforms so far."""

    @property
    def transform_seconds(self) -> float:
        """Time [s] that this rank has spent in transforms."""

    def new_state(self, position: float) -> State:
        """A state with the surface at rest, the machine at `position` [m]; call `start` before stepping."""

    def start(self, state: State) -> float:
        """Computes the equilibrium of the surface with the punch at its first position; returns the force on the punch
        [N]."""

    def place(self, state: State) -> float:
        """Displacement d of the punch [m]: the position of the drive, corrected for a machine's spring."""

    def drive_at(self, state: State) -> float:
        """Position D [m] of what is driven: the punch, or the machine's end of its spring."""

    def control(self, control: str, state: State | None = None) -> None:
        """Prepares for phases in which the machine controls this (drive.DISPLACEMENT or LOAD). state: to be changed to it,
        the punch staying where it is; None if it is as it should be. Idempotent."""

    def values_of(self, state: State, phase: Phase, trial: Any = None) -> list[float]:
        """The values of the quantities of `phase.endings`, of the state or at the end of a trial. Collective."""

    def measure(self, state: State) -> None:
        """Computes from the fields the values of the curve: contact, overlap and near points, smallest gap, far
        displacement, adhesive energy."""

    def surface_of(self, state: State) -> Vector:
        """The field from which the surface of the whole cell can be computed: this rank's share, valid until the next
        step."""

    def whole_cell(self, kept: Vector) -> tuple[Vector, int]:
        """The surface [m] of a periodic cell from the result of `surface_of`: rows of this rank, (rows, n), and the
        index of the first one."""


class ImplicitScheme(Scheme, Protocol):
    """A scheme with trial steps. order: of its steps in time."""

    @property
    def order(self) -> int:
        """Order of the method in time."""

    def machine_share(self, state: State) -> float:
        """How many times farther what is driven goes than the punch, because of a machine's spring. Collective if there is
        one."""

    def try_step(self, state: State, phase: Phase, step: float, sharp: bool = False, jump: bool = False) -> Trial:
        """Solves a step of `step` [s] without changing the state. sharp: with a smaller tolerance, to locate an event;
        jump: follow an instability to its end."""

    def accept(self, state: State, trial: Any) -> None:
        """Advances the state to the end of the last trial."""

    def advice(self, state: State, trial: Any) -> str:
        """Advice for a step that can't be solved, from its last trial."""

    def require_preload(self, state: State, trial: Any, slack: float) -> None:
        """Raises RunError if a trial that should end the approach misses the preload by more than `slack` [N]."""


class ExplicitScheme(Scheme, Protocol):
    """A scheme without trial steps."""

    def step(self, state: State, phase: Phase, step: float) -> None:
        """Advances the state by `step` [s] within the phase."""


class Taken(Protocol):
    """An accepted step, as the loop uses it. is_jump: whether the surface jumped in it."""

    @property
    def is_jump(self) -> bool:
        """Whether the surface jumped in it."""


class Trial(Protocol):
    """A trial step, as a controller uses it; solver.trial_step.Trial is one.

    step [s]; position [m] of the machine and force [N] on the punch at its end. converged: whether it was solved.
    error: in ranges of adhesion, or relative to the largest force. is_jump: whether the surface jumps in it, which
    releases potential_drop [J]. energy_error: relative to the allowed one, 0 if there is no limit. change: from the
    start of the step, if known.
    """

    step: float
    position: float
    force: float
    converged: bool
    error: float
    energy_error: float
    is_jump: bool
    potential_drop: float
    newton_iterations: int
    cg_iterations: int
    change: Change | None


class StepController(Protocol):
    """Chooses the lengths of steps, and accepts or rejects them, in the same way on all ranks."""

    def advance(self, state: State, phase: Phase, until: float = math.inf) -> tuple[Taken, str]:
        """Performs one step of the phase, at most to the time `until` [s] from now; returns it, and why it ended there.

        The reason is "ending" if one of the values that end the phase has been met, "duration" at its end, "time" at
        `until`, else "". Raises RunError if no step, however short, is possible. Collective.
        """
