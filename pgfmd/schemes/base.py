"""What the loop, its observers and the controllers ask of a scheme; what the loop asks of a controller.

A scheme knows how a state moves on by one step of a given length; its controller decides how long that is, and whether
the step is taken. Implicit schemes leave the state alone until a trial has been accepted; explicit ones move it on at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pgfmd.physics.cohesion import CohesiveLaw
from pgfmd.physics.drive import Phase
from pgfmd.solver.grid import PunchPoints
from pgfmd.solver.state import State
from pgfmd.solver.trial import Change

Vector = NDArray[np.floating[Any]]
"""A field at this rank's points under the punch, (size,)."""


class Polled(Protocol):
    """Iterations that ask now and then whether they are to be given up (interruption.py)."""

    poll: Callable[[], None]


class Solves(Protocol):
    """The static problems of a scheme (newton.py), as far as the loop has to know them."""

    @property
    def cg(self) -> Polled:
        """What takes long in them."""


class Scheme(Protocol):
    """What every scheme has. Methods are collective.

    points: under the punch, of this rank. height: z [m] of the punch's face at them. law: between punch and elastomer.
    audit: whether energies are followed. machine_compliance [m/N]: of the spring between the machine and the punch, 0
    for a rigid machine. cure: what to do where numbers run away. solver: of its static problems, None where it has none.
    """

    points: PunchPoints
    height: Vector
    law: CohesiveLaw
    audit: bool
    machine_compliance: float
    cure: str

    @property
    def solver(self) -> Solves | None:
        """Of its static problems; None for explicit steps, which solve nothing and never take long."""

    @property
    def pairs(self) -> int:
        """Pairs of transforms so far."""

    @property
    def transform_seconds(self) -> float:
        """Time [s] that this rank has spent in transforms."""

    def new_state(self, position: float) -> State:
        """A state with the surface at rest, the machine at `position` [m]; call `start` before stepping."""

    def start(self, state: State) -> float:
        """Brings the surface into balance with the punch at its first position; returns the force on it [N]."""

    def place(self, state: State) -> float:
        """Position d of the punch [m]: the machine's, or that at the end of its spring."""

    def measure(self, state: State) -> None:
        """Derives from the fields what the curve holds of them: contact, overlap, near points, smallest gap, far
        displacement, adhesive energy."""

    def surface_of(self, state: State) -> Vector:
        """What the surface of the whole cell is made of: this rank's share, good until the next step."""

    def whole_cell(self, kept: Vector) -> tuple[Vector, int]:
        """The surface [m] of a periodic cell from what `surface_of` gave: rows of this rank, (rows, n), and the first
        one's index."""


class ImplicitScheme(Scheme, Protocol):
    """A scheme whose steps are tried. order: of its steps in time."""

    @property
    def order(self) -> int:
        """Order of the method in time."""

    def try_step(self, state: State, phase: Phase, step: float, sharp: bool = False, jump: bool = False) -> Trial:
        """Solves a step of `step` [s] from the state, which stays as it is. sharp: for finding an event; jump: follow an
        instability to its end."""

    def accept(self, state: State, trial: Any) -> None:
        """Moves the state to the end of the last trial."""

    def advice(self, state: State, trial: Any) -> str:
        """What to do about a step that can't be solved, by its last trial."""

    def require_preload(self, state: State, trial: Any, slack: float) -> None:
        """RunError where a trial that is to end the approach misses the preload by more than `slack` [N]."""


class ExplicitScheme(Scheme, Protocol):
    """A scheme whose steps are taken as they come."""

    def step(self, state: State, phase: Phase, step: float) -> None:
        """Moves the state on by `step` [s] within the phase."""


class Taken(Protocol):
    """A step that has been taken, as the loop sees it. is_jump: whether the surface jumped in it."""

    @property
    def is_jump(self) -> bool:
        """Whether the surface jumped in it."""


class Trial(Protocol):
    """A step that was tried, as a controller judges it; solver.trial.Trial is one.

    step [s]; position [m] of the machine, force [N] on the punch at its end. converged: whether it could be solved.
    error: in ranges of adhesion, or as a share of the largest force. is_jump: whether the surface jumps in it, to
    which potential_drop [J] is what it releases. energy_error: as a share of what is allowed, 0 where nothing is.
    change: from the start of the step, where it is known.
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
    """Decides which steps are tried, and which are taken: the same on all ranks."""

    def advance(self, state: State, phase: Phase, until: float = math.inf) -> tuple[Taken, str]:
        """Takes one step of the phase, at most to the time `until` [s] from now; returns it, and why it ended there.

        The second is "preload" where the preload has been met, "duration" at the end of the phase, "time" at `until`,
        else "". Raises RunError where no step, however short, can be taken. Collective.
        """
