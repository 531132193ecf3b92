"""A load step's work, with the punch at the end of its machine's spring. Plain NumPy.

The machine's end is at D, the punch at d = D + F/k_M. In a smooth step F is a smooth function of d; in a jump the
machine stands still and the spring works on the punch, by the trapezoid -(F_0 + F_1)(d_1 - d_0)/2, as F is linear in d
there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pgfmd.solver.extrapolation import integral
from pgfmd.solver.state import State
from pgfmd.solver.trial import Trial

NEAREST_PAST = 0.2
"""The work of a step takes the last steps' starts in, as far as these steps were no shorter than this share of it: they
are too close to tell how the force bends."""


@dataclass(frozen=True)
class SpringWork:
    """compliance [m/N]: 1/k_M, 0 for a rigid machine. dead_load: whether the spring stands for one. reach [m]: of the
    cohesive law."""

    compliance: float
    dead_load: bool
    reach: float

    def place(self, state: State) -> float:
        """Position d of the punch [m]. A punch that a dead load flings away is followed until it is out of reach of the
        elastomer at rest: there is no end to its way. If it let go of an elastomer pulled up beyond that, it stays."""
        place = state.position + self.compliance * state.force
        flung = self.dead_load and state.preload_time is not None and state.smallest_gap >= self.reach
        # The place in the state is that of the step before, until the step has ended.
        return min(place, max(self.reach, state.place)) if flung else place

    def end(self, state: State, trial: Trial) -> float:
        """The same at the end of a trial."""
        place = trial.position + self.compliance * trial.force
        return min(place, max(self.reach, self.place(state))) if trial.flung else place

    def work(self, state: State, trial: Trial, smooth: bool = False) -> float:
        """Work of the punch [J] over the step: by the trapezoid; smooth: by the polynomial through the last steps'
        starts too."""
        start, end = self.place(state), self.end(state, trial)
        trapezoid = -0.5 * (state.force + self._last_force(state, trial)) * (end - start)
        if not smooth or end == start:
            return trapezoid
        places, forces = [start, end], [state.force, trial.force]
        for back, force in zip(np.cumsum(state.past_steps), state.past_forces, strict=True):
            place = state.phase_start + trial.phase.displacement(state.elapsed - back) + self.compliance * force
            nearest = places[-1] if len(places) > 2 else start
            # Behind it, that is: where the punch turns round, its past lies ahead.
            if (nearest - place) * (end - start) < NEAREST_PAST * (end - start) ** 2:
                break
            places.append(place)
            forces.append(force)
        if len(places) == 2:
            return trapezoid
        return -integral([place - start for place in places], forces, lambda way: 1.0, end - start)

    def pulled(self, state: State, trial: Trial) -> float:
        """Work [J] of a retracting punch where it pulls, the force being linear within the step."""
        first, last = -state.force, -self._last_force(state, trial)
        if trial.phase.velocity_end <= 0.0 or max(first, last) <= 0.0:
            return 0.0
        share = 1.0 if min(first, last) >= 0.0 else max(first, last) / abs(last - first)
        way = max(self.end(state, trial) - self.place(state), 0.0)
        return 0.5 * share * (max(first, 0.0) + max(last, 0.0)) * way

    def _last_force(self, state: State, trial: Trial) -> float:
        """Force [N] at the end of a step; of a flight, that of the load, which is still there."""
        if not trial.flung:
            return trial.force
        return min(trial.force, state.force + (self.end(state, trial) - self.place(state)) / self.compliance)
