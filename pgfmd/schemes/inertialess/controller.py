"""The adaptive step control.

A step is accepted if its error is below the tolerance; the length of the next one is chosen for 0.85 of it. Ends of
phases and requested times are met exactly. The end of the approach, where the force reaches the preload, is found by
regula falsi on the length of the step. A step that is rejected even though it is far shorter than all relaxation times
is a jump of the surface, and is accepted as one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial

from pgfmd.errors import WRITTEN_IS_VALID, RunError
from pgfmd.physics.drive import FORCE, Ending, Phase
from pgfmd.schemes.base import ImplicitScheme, Trial
from pgfmd.solver.ending_search import fit, search_of, slack_of
from pgfmd.solver.state import State
from pgfmd.solver.trial_step import LARGEST_GROWTH, SAFETY, STRONGEST_CUT

CUT_ON_FAILURE = 0.25
TELLING = 2.0
"""Ratio of the lengths of two rejected steps from which on their changes distinguish a jump from a motion."""
ENERGY_CUT = {1: 8.0, 2: 24.0}
"""Largest factor by which the energy audit may shorten a step, by the order of the scheme. (In elastic scenes errors of
the solves, which do not shrink with the step, limit it sooner.)"""
WORTH_AGAIN = 0.6
"""A step is repeated for the audit if it should have been shorter than this fraction of its length."""
MOST_REPEATS = 3
"""Most repetitions of a step for this reason."""
JUMP_STEP = 1e-3
"""A rejected step may be a jump if it is below this fraction of the shortest relaxation time, and JUMP_MOTION holds."""
JUMP_MOTION = 0.5
"""The step must also be below this fraction of the time in which the punch moves by tolerance times range."""


@dataclass(frozen=True)
class StepLimits:
    """tolerance of a step's error [ranges of adhesion]; range [m]; shortest relaxation time [s], infinite where
    elastic.

    attractive: whether the law attracts. Without attraction there are no jumps, and only the error limits the step.
    """

    tolerance: float
    range: float
    shortest_time: float
    attractive: bool

    def largest(self, phase: Phase) -> float:
        """Longest step [s]: the punch moves by at most one range of adhesion, so that no contact is missed, and the motion
        of the drive is told."""
        longest = self.range / phase.fastest if self.attractive and phase.fastest > 0.0 else math.inf
        return min(longest, phase.longest_step)

    def first(self, phase: Phase) -> float:
        """First step [s] of a phase, without information about the error."""
        if phase.fastest > 0.0:
            return self.tolerance * self.range / phase.fastest
        return self.shortest_time if math.isfinite(self.shortest_time) else phase.duration

    def jump(self, phase: Phase) -> float:
        """Length [s] below which a rejected step may be a jump."""
        if phase.fastest == 0.0:
            return JUMP_STEP * self.shortest_time if math.isfinite(self.shortest_time) else 0.0
        motion = JUMP_MOTION * self.tolerance * self.range / phase.fastest
        return min(JUMP_STEP * self.shortest_time, motion)


class Controller:
    """Performs one step at a time with a scheme; all decisions use numbers that are the same on all ranks."""

    largest_try_count = 200

    def __init__(self, scheme: ImplicitScheme, limits: StepLimits, preload: float):
        self.scheme, self.limits, self.preload = scheme, limits, preload
        self.slack = slack_of(preload, limits.tolerance)

    def advance(self, state: State, phase: Phase, until: float = math.inf) -> tuple[Trial, str]:
        """Performs one step of the phase, at most to the time `until` [s] from now; returns (the accepted Trial, why it
        ended).

        The reason is "ending" if a value has ended the phase, "duration" at the end of the phase, "time" at `until`, else
        "". Raises RunError if no step, however short, can be solved.
        """
        limits = self._limits_of(state)
        end = phase.duration - state.elapsed
        wanted = state.step or limits.first(phase)
        step, why = fit(min(wanted, limits.largest(phase)), end, until)
        search, repeats = search_of(self.scheme, state, phase, limits.tolerance, self.preload, self.limits.range), 0
        refused: list[Trial] = []
        for _ in range(self.largest_try_count):
            short = step < limits.jump(phase) or state.elapsed + step == state.elapsed
            last_resort = bool(refused) and search.bracket is None and short
            trial = self.scheme.try_step(state, phase, step, sharp=search.sharp, jump=last_resort)
            # Without attraction there are no jumps: the cause of the rejection was an inaccurate earlier solve.
            trial.is_jump = last_resort and limits.attractive and trial.converged and _jumped(trial, refused)
            state.counters.take(trial)
            if not trial.converged or not (last_resort or trial.error <= limits.tolerance):
                if last_resort:
                    break
                state.counters.rejected_steps += 1
                refused.append(trial)
                step, why, search.bracket = step * self._cut(phase, trial, limits), "", None
                continue
            wish = self._wish(phase, trial, limits)
            if wish < WORTH_AGAIN and repeats < MOST_REPEATS and search.bracket is None and not last_resort:
                state.counters.rejected_steps += 1
                repeats += 1
                step, why = step * max(STRONGEST_CUT, wish), ""
                continue
            values = partial(self.scheme.values_of, state, phase, trial)
            other = search.other_step(step, values)
            if other is not None:
                state.counters.rejected_steps += 1
                step, why = other, ""
                continue
            met = search.is_met(values)
            if met and Ending(FORCE, self.preload, 1) in phase.endings:
                self.scheme.require_preload(state, trial, self.slack)
            self._accept(state, phase, trial, wanted if why else step, limits)
            return trial, "ending" if met else why
        raise RunError(self._stuck(state, phase, trial))

    def _limits_of(self, state: State) -> StepLimits:
        """The limits, with the share of a machine's spring in what is driven."""
        share = self.scheme.machine_share(state)
        return self.limits if share == 1.0 else replace(self.limits, range=share * self.limits.range)

    def _accept(self, state: State, phase: Phase, trial: Trial, wanted: float, limits: StepLimits) -> None:
        self.scheme.accept(state, trial)
        if trial.is_jump:
            state.step = 0.0
            return
        growth = self._wish(phase, trial, limits)
        proposal = trial.step * min(LARGEST_GROWTH, max(STRONGEST_CUT, growth))
        if trial.error > self.limits.tolerance:
            # Accepted as a last resort: shorter steps have not helped.
            proposal = max(proposal, trial.step)
        # A step shortened by an event is no reason to shorten the next one.
        state.step = max(proposal, wanted) if wanted > trial.step and growth >= 1.0 else proposal

    def _cut(self, phase: Phase, trial: Trial, limits: StepLimits) -> float:
        if not trial.converged or not math.isfinite(trial.error):
            return CUT_ON_FAILURE
        return min(0.8, max(STRONGEST_CUT, self._wish(phase, trial, limits)))

    def _wish(self, phase: Phase, trial: Trial, limits: StepLimits) -> float:
        """Factor by which the step could have been longer."""
        share: float = (self.limits.tolerance / max(trial.error, 1e-300)) ** (1.0 / (self.scheme.order + 1))
        by_error = SAFETY * share
        by_error = min(by_error, limits.largest(phase) / trial.step)
        by_energy: float = SAFETY * max(trial.energy_error, 1e-300) ** -0.5
        return min(by_error, max(by_energy, by_error / ENERGY_CUT[self.scheme.order]))

    def _stuck(self, state: State, phase: Phase, trial: Trial) -> str:
        return (
            f"no equilibrium found in step {state.counters.steps + 1} ({phase.name}, t = {state.time:.6g} s, "
            f"d = {state.position:.6g} m, step {trial.step:.3g} s). {WRITTEN_IS_VALID} "
            f"{self.scheme.advice(state, trial)}"
        )


def _jumped(trial: Trial, refused: list[Trial]) -> bool:
    """Whether a repeatedly rejected step is a jump, that is, whether its change has not decreased with the step.

    Without a history, as after a jump, the whole change counts as an error, and a surface that just moves faster than
    the punch is rejected as well. If that were taken for a jump, the history would be lost again, and so on.
    """
    known = [(other.step, other.change.largest) for other in refused if other.change is not None]
    longer = [other for other in known if other[0] >= TELLING * trial.step] or known[:1]
    if not longer or trial.change is None:
        return True
    step, change = longer[-1]
    return trial.change.largest > change * math.sqrt(trial.step / step)
