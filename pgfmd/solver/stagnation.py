"""When a solve no longer gets anywhere. Plain Python.

Newton's corrections end in rounding: the potential no longer falls, the corrections no longer shrink, and what is out
of balance goes up and down. A solve that is not content with that would go on for all the corrections it may have.
"""

from __future__ import annotations

import math

MOST_IDLE = 20
"""Corrections in a row without progress, after which none is expected. (Close to a minimum, each one gains at least a
decade.)"""


class Progress:
    """Follows the corrections of one solve.

    tolerance: of a correction, in ranges of adhesion; unbalanced: the force out of balance that is allowed, in the unit
    of `unsettled` below.
    """

    def __init__(self, tolerance: float, unbalanced: float):
        self.tolerance, self.unbalanced = tolerance, unbalanced
        self.idle, self.least_unsettled = 0, math.inf
        self._drop, self._size = 0.0, math.inf

    def stalls(self, drop: float, slack: float, size: float, unsettled: float) -> bool:
        """Takes in a correction; whether it is the last of so many that have not got anywhere.

        drop: by how much the potential has fallen in all; slack: what rounding may make of that; size: of the
        correction, in ranges of adhesion; unsettled: the force out of balance. To get somewhere is to fall by more than
        rounding, or to halve the correction or the force where these are not small enough yet.
        """
        # Each correction is rounded anew.
        fell = drop > self._drop + slack * (1 + self.idle)
        shrank = size >= self.tolerance and size < 0.5 * self._size
        settled = unsettled > self.unbalanced and unsettled < 0.5 * self.least_unsettled
        if fell:
            # The surface is another one now: what it was before is no measure.
            self._drop, self._size, self.least_unsettled = drop, size, unsettled
        else:
            self._size = min(self._size, size) if shrank or math.isinf(self._size) else self._size
            if settled or math.isinf(self.least_unsettled):
                self.least_unsettled = unsettled
        self.idle = 0 if fell or shrank or settled else self.idle + 1
        return self.idle >= MOST_IDLE
