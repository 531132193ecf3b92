"""Work of a quasi-static step with a spring between machine and punch. Plain NumPy.

The machine's end is at D, the punch at d = D + F/k_M. In a smooth step F is a smooth function of d; in a jump the
machine does not move, and the spring does the work -(F_0 + F_1)(d_1 - d_0)/2 on the punch, as F is linear in d.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pgfmd.solver.extrapolation import integral
from pgfmd.solver.state import State
from pgfmd.solver.trial_step import Trial

NEAREST_PAST = 0.2
"""Starts of earlier steps are used for the work of a step if those steps were at least this fraction of it: closer
points do not determine the curvature of the force."""


@dataclass(frozen=True)
class SpringWork:
    """compliance [m/N]: 1/k_M, 0 for a rigid machine. dead_load: whether the spring represents a controlled force.
    reach [m]: of the cohesive law."""

    compliance: float
    dead_load: bool
    reach: float

    def place(self, state: State) -> float:
        """Displacement d of the punch [m]. After detachment under a controlled force, which has no equilibrium, it is
        the height beyond the reach of the elastomer at rest, or the height of detachment if that is larger, or where the
        load has done the work of detachment."""
        place = state.position + self.compliance * state.force
        runaway = self.dead_load and state.preload_time is not None and state.smallest_gap >= self.reach
        # Until the step has ended, the place in the state is that of the step before.
        return min(place, max(self.reach, state.punch_displacement)) if runaway else place

    def end(self, state: State, trial: Trial) -> float:
        """The same at the end of a trial."""
        place = trial.position + self.compliance * trial.force
        return min(place, max(self.reach, self.place(state), trial.parted)) if trial.runaway else place

    def parted(self, state: State, gained: float) -> float:
        """Where [m] a dead load that detaches the punch in a step has done the work [J] by which elastomer and interface
        gain energy. An elastomer that has been pulled up far holds on beyond the reach of its surface at rest."""
        force = -state.force
        least = max(force**2 - 2.0 * gained / self.compliance, 0.0)
        return self.place(state) + self.compliance * (force - math.sqrt(least))

    def work(self, state: State, trial: Trial, smooth: bool = False) -> float:
        """Work of the punch [J] over the step by the trapezoidal rule; smooth: by the polynomial that includes starts
        of earlier steps."""
        start, end = self.place(state), self.end(state, trial)
        trapezoid = -0.5 * (state.force + self._last_force(state, trial)) * (end - start)
        if not smooth or end == start:
            return trapezoid
        places, forces = [start, end], [state.force, trial.force]
        for back, force in zip(np.cumsum(state.past_steps), state.past_forces, strict=True):
            place = state.phase_start + trial.phase.displacement(state.elapsed - back) + self.compliance * force
            nearest = places[-1] if len(places) > 2 else start
            # Only points behind it: where the punch turns, earlier points are ahead.
            if (nearest - place) * (end - start) < NEAREST_PAST * (end - start) ** 2:
                break
            places.append(place)
            forces.append(force)
        if len(places) == 2:
            return trapezoid
        return -integral([place - start for place in places], forces, lambda travel: 1.0, end - start)

    def pulled(self, state: State, trial: Trial) -> float:
        """Work [J] of a retracting punch under tension, with a linear force within the step."""
        first, last = -state.force, -self._last_force(state, trial)
        if not trial.phase.may_let_go or max(first, last) <= 0.0:
            return 0.0
        share = 1.0 if min(first, last) >= 0.0 else max(first, last) / abs(last - first)
        travel = max(self.end(state, trial) - self.place(state), 0.0)
        return 0.5 * share * (max(first, 0.0) + max(last, 0.0)) * travel

    def _last_force(self, state: State, trial: Trial) -> float:
        """Force [N] at the end of a step; after detachment under a controlled force, that force."""
        if not trial.runaway:
            return trial.force
        return min(trial.force, state.force + (self.end(state, trial) - self.place(state)) / self.compliance)
