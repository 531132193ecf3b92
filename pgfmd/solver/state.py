"""Everything that evolves during a run. A checkpoint holds exactly the contents of State.

Fields are point vectors (size,) of the local points under the punch (see grid.PunchPoints). A checkpoint takes any
array as this rank's share of a whole along the last axis; metadata of a field mark exceptions (files/packing.py).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from .cycles import CycleNumbers


@dataclass
class Energies:
    """Energies [J] since the start: work of the punch, stored in the elastomer, in the interface, dissipated, released
    in jumps.

    `elastic_start` and `adhesive_start` are those of the first state (not zero if a scene starts in contact). Quasi-static
    runs also know how uncertain their loop is, else None: `unbalanced` [J], the work over the path of the forces that
    solves leave without balance, and `jump_variance` [J^2], of the energies released, because the places of jumps within
    their steps are unknown.
    """

    work: float = 0.0
    elastic: float = 0.0
    adhesive: float = 0.0
    viscous: float = 0.0
    released: float = 0.0
    elastic_start: float = 0.0
    adhesive_start: float = 0.0
    largest_residual: float = 0.0
    work_of_separation: float = 0.0
    unbalanced: float | None = field(default=None, metadata={"unknown": None})
    jump_variance: float | None = field(default=None, metadata={"unknown": None})

    @property
    def residual(self) -> float:
        """Work minus all other terms: zero for an exact solution."""
        stored = self.elastic - self.elastic_start + self.adhesive - self.adhesive_start
        return self.work - stored - self.viscous - self.released


class Solved(Protocol):
    """The numbers of iterations of a trial step or a single solve."""

    @property
    def newton_iterations(self) -> int: ...

    @property
    def cg_iterations(self) -> int: ...


@dataclass
class Counters:
    """The cost of a run so far."""

    steps: int = 0
    rejected_steps: int = 0
    newton_iterations: int = 0
    cg_iterations: int = 0
    transform_pairs: int = 0
    jumps: int = 0

    def take(self, solved: Solved) -> None:
        """Adds the iterations of a Trial, or of the Outcome of a single solve."""
        self.newton_iterations += solved.newton_iterations
        self.cg_iterations += solved.cg_iterations


UNKNOWN_PHASE = -1
"""Phase of the last step of a checkpoint that does not say it."""


@dataclass
class State:
    """Time, programme, fields, history of the predictor, step controller, energies, counters.

    time [s].
    position [m]: of the punch, or, in quasistatic with a machine's spring, of the drive.
    punch_displacement, preload_displacement [m]: displacement d of the punch at the end of the last step, and where it
    met the preload.
    phase: index in the programme. elapsed [s], phase_start [m], phase_place [m]: time since its start, and positions of
    the drive and of the punch there. phase_signs: from which side the values that end the phase are reached, as of
    drive.Ending. stepped: index of the phase of the last step. Checkpoints of builds that knew no programmes lack these,
    whose phases end with the preload alone.
    surface_displacement [m]: u of the surface, positive upward.
    effective_traction [Pa]: w, the traction that would give the relaxed body the displacement u = G0 w.
    traction [Pa]: f on the surface.
    internal_variables [Pa]: phi_m of the retardation (Kelvin) elements, (N, size).
    internal_displacements [m]: psi_m = G0 phi_m, (N, size), or (0, size) without the energy audit.
    past_displacements, past_effective_tractions, past_steps, past_forces: up to two earlier ends of steps, newest first:
    u, w, the length [s] of the step that started there, and the force [N].
    drift: factor of the covariance of u - G0 w of the present surface and the past ones (drift.py).
    step [s]: length of the next step to try.
    followed_step [s]: longest step that follows an instability downhill (schemes/quasistatic/controller.py).
    least_force [N]: lowest force within the last step.
    pull_off_force, snap_in_force [N]: lowest forces within all steps of the retraction and of the approach, zero or
    negative; *_at_ends: at the ends of these steps.
    largest_force [N]: at the end of any step, zero or positive.
    contact_points, overlap_points, near_points: numbers of points with a gap below the law's contact_gap, below zero,
    and below the scheme's near_gap.
    cycle, cycles: numbers of the present cycle of a programme with repeats, and of those that are over.
    began_free: whether the punch was free at the start of this phase, or of the turn before it. has_detached: whether it
    has been pulled off.
    unmet: steps of a programme that ended because the punch was free, before what was to end them.
    started: whether the first equilibrium has been computed.

    The scheme quasistatic also keeps the softest mode of the last equilibrium, softest_mode [m], and its dual, the
    traction softest_mode_dual [Pa]. Its position is the machine's; that of the punch differs by the elongation of the
    spring between them.

    The scheme gfmd has no effective traction, internal displacements or past. It has `modes` u [m] and
    `mode_velocities` du/dt [m/s] (of the middle of the last step), spectral, complex, (n, columns of this rank);
    `internal_variables` are the displacements u_m [m] of its Maxwell elements, (N, n, columns); `power` [W] is the
    dissipation in the elements at the end of the last step.

    Metadata `stored` is a field's name in checkpoints, where it differs: files keep the names of earlier versions.
    """

    surface_displacement: np.ndarray = field(metadata={"stored": "displacement"})
    effective_traction: np.ndarray = field(metadata={"stored": "load"})
    traction: np.ndarray
    internal_variables: np.ndarray = field(metadata={"stored": "branches"})
    internal_displacements: np.ndarray = field(metadata={"stored": "images"})
    position: float
    time: float = 0.0
    punch_displacement: float = field(default=0.0, metadata={"stored": "place"})
    preload_displacement: float = field(default=0.0, metadata={"stored": "preload_place"})
    phase: int = 0
    elapsed: float = 0.0
    phase_start: float = 0.0
    phase_place: float = field(default=0.0, metadata={"unknown": 0.0})
    phase_signs: list[int] = field(default_factory=list, metadata={"unknown": ()})
    stepped: int = field(default=0, metadata={"unknown": UNKNOWN_PHASE})
    cycle: CycleNumbers = field(default_factory=CycleNumbers, metadata={"unknown": CycleNumbers()})
    cycles: list[list[float | None]] = field(default_factory=list, metadata={"unknown": ()})
    step: float = 0.0
    last_step: float = 0.0
    followed_step: float = field(default=0.0, metadata={"stored": "followed"})
    power: float = 0.0
    force: float = 0.0
    least_force: float = 0.0
    contact_points: int = 0
    overlap_points: int = 0
    near_points: int = 0
    smallest_gap: float = np.inf
    far_displacement: float = 0.0
    first_contact_time: float | None = None
    preload_time: float | None = None
    preload: float = 0.0
    pull_off_force: float = 0.0
    snap_in_force: float = 0.0
    largest_force: float = field(default=0.0, metadata={"unknown": np.nan})
    pull_off_at_ends: float = field(default=0.0, metadata={"unknown": np.nan})
    snap_in_at_ends: float = field(default=0.0, metadata={"unknown": np.nan})
    finished: str = ""
    unmet: list[str] = field(default_factory=list)
    began_free: bool = True
    has_detached: bool = False
    started: bool = False
    past_displacements: list[np.ndarray] = field(
        default_factory=list, metadata={"like": "surface_displacement", "stored": "past_u"}
    )
    past_effective_tractions: list[np.ndarray] = field(
        default_factory=list, metadata={"like": "effective_traction", "stored": "past_w"}
    )
    past_steps: list[float] = field(default_factory=list)
    past_forces: list[float] = field(default_factory=list)
    softest_mode: np.ndarray | None = field(default=None, metadata={"stored": "soft_mode"})
    softest_mode_dual: np.ndarray | None = field(default=None, metadata={"stored": "soft_load"})
    modes: np.ndarray | None = None
    mode_velocities: np.ndarray | None = None
    drift: np.ndarray = field(default_factory=lambda: np.zeros((1, 1)), metadata={"replicated": True})
    energies: Energies = field(default_factory=Energies)
    counters: Counters = field(default_factory=Counters)

    def forget_history(self) -> None:
        """Drops the history of the predictor, after a kink in d(t) or a jump of the surface."""
        self.past_displacements.clear()
        self.past_effective_tractions.clear()
        self.past_steps.clear()
        self.past_forces.clear()
        self.drift = self.drift[:1, :1]
