"""The material of slow motion, f = w + tau dw/dt with u = G0 w, by Euler's explicit method at the points under the punch.

tau = sum kappa_n tau_n is all that is left of a relaxation spectrum whose times are short beside the motion.
"""

import numpy as np

from pgfmd.solver.state import State


class KelvinVoigt:
    """points: PunchPoints; convolve: G0 between them; height z [m]; law: CohesiveLaw; tau [s]; far_weights of the far
    displacement; near_gap [m]. Steps are taken by gfmd's controller."""

    machine_compliance, solver, audit = 0.0, None, True
    cure = "Try a smaller solver.accuracy."

    def __init__(self, points, convolve, height, law, tau, far_weights, near_gap):
        self.points, self.convolve, self.height, self.law, self.tau = points, convolve, height, law, tau
        self.far_weights, self.near_gap = far_weights, near_gap
        self._new = points.zeros()

    @property
    def pairs(self):
        return self.convolve.pairs

    @property
    def transform_seconds(self):
        return self.convolve.seconds

    def place(self, state):
        return state.position

    def drive_at(self, state):
        return state.position

    def surface_of(self, state):
        return state.effective_traction

    def whole_cell(self, kept):
        return self.convolve.whole_cell(kept)

    def new_state(self, position):
        points = self.points
        nothing = np.zeros((0, points.size))
        fields = (points.zeros() for _ in range(3))
        return State(*fields, nothing, nothing.copy(), position, phase_start=position)

    def start(self, state):
        return self._touch(state)

    def step(self, state, phase, step):
        """One step of Euler's: w takes its share of f - w, and u follows."""
        energies, before, force = state.energies, state.position, state.force
        change = step / self.tau * (state.traction - state.effective_traction)
        state.effective_traction += change
        self.convolve(state.effective_traction, self._new)
        moved = self._new - state.surface_displacement
        state.surface_displacement, self._new = self._new, state.surface_displacement
        lost, stored = self._sums(change * moved, state.effective_traction * state.surface_displacement)
        energies.viscous += self.tau / step * lost * self.points.grid.cell_area
        energies.elastic = 0.5 * stored * self.points.grid.cell_area
        state.elapsed += step
        state.time += step
        state.position = state.phase_start + phase.displacement(state.elapsed)
        state.force = state.least_force = self._touch(state)
        way = state.position - before
        energies.work -= 0.5 * (force + state.force) * way
        if phase.velocity_end > 0.0 and way > 0.0:
            energies.work_of_separation -= 0.5 * (min(force, 0.0) + min(state.force, 0.0)) * way
        state.last_step = step
        state.counters.steps += 1

    def measure(self, state):
        gap, law = self._gap(state), self.law
        contact, overlap, near, energy, far = self._sums(
            gap < law.contact_gap,
            gap < 0.0,
            gap < self.near_gap,
            law.potential(gap),
            self.far_weights * state.effective_traction,
        )
        state.contact_points, state.overlap_points, state.near_points = int(contact), int(overlap), int(near)
        state.smallest_gap = -self.points.maximum_of(-gap.min(initial=np.inf))
        state.energies.adhesive, state.far_displacement = energy * self.points.grid.cell_area, far

    def _gap(self, state):
        return state.position + self.height - state.surface_displacement

    def _touch(self, state):
        """The traction on the present surface; returns the force on the punch [N]."""
        state.traction[:] = self.law.traction(self._gap(state))
        return -self._sums(state.traction)[0] * self.points.grid.cell_area

    def _sums(self, *values):
        local = np.zeros((len(values), self.points.rows))
        if self.points.rows:
            local[:, 0] = [value.sum() for value in values]
        return self.points.total_of(local)
