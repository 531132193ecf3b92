"""The step control of quasi-static runs.

Steps without instability are as long as their error allows. A step with an instability is abandoned immediately and
shortened, until it is so short that the jump is followed to its end. The place of the jump within that step is unknown;
the uncertainty of its energy decides whether the step is short enough.
"""

from __future__ import annotations

import math
from functools import partial

from pgfmd.errors import WRITTEN_IS_VALID, RunError
from pgfmd.physics.drive import FORCE, Ending, Phase
from pgfmd.solver.ending_search import fit, search_of, slack_of
from pgfmd.solver.state import State
from pgfmd.solver.trial_step import LARGEST_GROWTH, SAFETY, STRONGEST_CUT, Trial

from .scheme import Quasistatic

FOLLOWED = 1.0
"""Longest step in which a jump is followed, in tolerances."""
FINEST = 0.25
"""Shortest step to which a jump is located, in tolerances."""
UNCERTAINTY = 10.0
"""Accepted uncertainty of the energy released by a jump, in tolerances."""
PULL_OFF = 0.3
"""Largest change of a controlled force, in tolerances of that force, in a step in which a jump under tension is followed: it
may be the pull-off, whose force is known no better. (The tolerance of the punch's way is that of the whole punch in contact,
and too coarse where only some of it is.)"""
ROOM = 0.25
"""A jump is negligible if the uncertainty of its energy is below this fraction of the accepted one. It is followed in
longer and longer steps."""
LONGEST_FOLLOWED = 0.25
"""Longest step in which a negligible jump is followed, in ranges of adhesion."""
CUT = 0.25
LONGEST_PULLING = 0.125
"""Longest step under tension, in ranges of adhesion: the minimum of the force is about one range wide, and the largest
tension is taken at the ends of steps."""


class LoadSteps:
    """Performs one quasi-static step at a time; all decisions use numbers that are the same on all ranks.

    tolerance: of a step [ranges of adhesion]; reach [m]: the range of adhesion; preload [N]; attractive: whether the
    law attracts.
    """

    largest_try_count = 100

    def __init__(self, scheme: Quasistatic, tolerance: float, reach: float, preload: float, attractive: bool):
        self.scheme, self.tolerance, self.reach, self.preload = scheme, tolerance, reach, preload
        self.attractive = attractive
        self.slack = slack_of(preload, tolerance)

    def advance(self, state: State, phase: Phase, until: float = math.inf) -> tuple[Trial, str]:
        """Performs one step of the phase, at most to the time `until` [s] from now; returns (the accepted trial, why it
        ended): "ending", "duration", "time", or "".

        Raises RunError if no equilibrium is found.
        """
        unit = self._unit(state, phase)
        shortest = min(FOLLOWED * self.tolerance * unit, self._located(state, phase))
        finest = FINEST * shortest
        # Under tension the next jump may be the pull-off, whose force is needed.
        followed = shortest if state.force < 0.0 else min(max(state.followed_step, shortest), LONGEST_FOLLOWED * unit)
        end = phase.duration - state.elapsed
        wanted = state.step or self.tolerance * unit
        longest = math.inf
        if self.attractive:
            longest = LONGEST_PULLING * unit if state.force < 0.0 else unit
        step, why = fit(min(wanted, longest, phase.longest_step), end, until)
        search = search_of(self.scheme, state, phase, self.tolerance, self.preload, self.reach)
        for _ in range(self.largest_try_count):
            follow = step <= followed * (1.0 + 1e-9)
            trial = self.scheme.try_step(state, phase, step, sharp=search.sharp, jump=follow)
            state.counters.take(trial)
            passed = trial.is_jump and not follow and state.force < min(trial.force, 0.0)
            # Nor is a punch pulled off that is still pressed.
            passed |= trial.runaway and state.force >= 0.0 and step > finest
            shorter = self._shorter(trial, state.energies.released, step, follow, followed, finest, passed)
            if shorter is not None:
                if step <= finest and not trial.converged:
                    break
                state.counters.rejected_steps += 1
                if trial.converged and trial.is_jump:
                    followed = max(shorter, shortest)
                step, why, search.bracket = shorter, "", None
                continue
            values = partial(self.scheme.values_of, state, phase, trial)
            other = search.other_step(step, values)
            if other is not None:
                state.counters.rejected_steps += 1
                step, why = other, ""
                continue
            if trial.is_jump and not trial.runaway:
                # Negligible jumps need not be located as accurately.
                room = trial.uncertainty / self._allowed(trial, state.energies.released)
                followed = LARGEST_GROWTH * followed if room < ROOM and step > 0.5 * followed else followed
            state.followed_step, met = followed, search.is_met(values)
            if met and Ending(FORCE, self.preload, 1) in phase.endings:
                self.scheme.require_preload(state, trial, self.slack)
            self.scheme.accept(state, trial)
            # A longer step than may follow a jump would meet the next instability, and be abandoned.
            followed = shortest if state.force < 0.0 else followed
            state.step = self._next(trial, wanted if why else step, followed)
            return trial, "ending" if met else why
        raise RunError(
            f"no equilibrium found in step {state.counters.steps + 1} ({phase.name}, "
            f"d = {self.scheme.place(state):.6g} m, "
            f"load step {step * phase.fastest:.3g} m). {WRITTEN_IS_VALID} "
            f"{self.scheme.advice(state, trial)}"
        )

    def _unit(self, state: State, phase: Phase) -> float:
        """Approximate time [s] in which the punch moves by one range of adhesion."""
        scheme = self.scheme
        # In contact, part of the machine's travel stretches the spring.
        shared = scheme.machine_compliance > 0.0 and scheme.interacting(state) > 0
        share = 1.0 + scheme.contact_stiffness * scheme.machine_compliance if shared else 1.0
        return share * self.reach / phase.fastest

    def _located(self, state: State, phase: Phase) -> float:
        """The longest step [s] in which a jump may be followed that may be the pull-off of a dead load."""
        scheme = self.scheme
        if not scheme.spring.dead_load or state.force >= 0.0:
            return math.inf
        # Hardly anything is pulled off by less than the second: it is for forces that have only just become tensile.
        least = scheme.law.work_of_adhesion * math.sqrt(scheme.points.total * scheme.points.grid.cell_area)
        change = PULL_OFF * self.tolerance * max(-state.force, least)
        return change * scheme.machine_compliance / phase.fastest

    def _shorter(
        self, trial: Trial, released: float, step: float, follow: bool, followed: float, finest: float, passed: bool
    ) -> float | None:
        """The shorter step to try next; None if the trial is accepted. passed: whether it passed over a jump that may
        be the pull-off."""
        if not trial.converged or passed:
            return max(CUT * step, min(followed, 0.99 * step)) if not follow else CUT * step
        if trial.is_jump:
            well_known = trial.uncertainty <= self._allowed(trial, released)
            return None if well_known or step <= finest else max(CUT * step, 0.99 * finest)
        if trial.error <= self.tolerance or step <= finest:
            return None
        return step * min(0.8, max(STRONGEST_CUT, self._growth(trial)))

    def _allowed(self, trial: Trial, released: float) -> float:
        """Accepted uncertainty [J] of a jump: errors of many small jumps average out."""
        drop = max(trial.potential_drop, 0.0)
        return UNCERTAINTY * self.tolerance * math.sqrt(drop * (drop + released))

    def _growth(self, trial: Trial) -> float:
        return SAFETY * math.sqrt(self.tolerance / max(trial.error, 1e-300))

    def _next(self, trial: Trial, wanted: float, followed: float) -> float:
        """The step to try next. After a jump there is no history of the surface."""
        if trial.is_jump:
            return max(trial.step, followed)
        growth = self._growth(trial)
        proposal = trial.step * min(LARGEST_GROWTH, max(STRONGEST_CUT, growth))
        return max(proposal, wanted) if wanted > trial.step and growth >= 1.0 else proposal
