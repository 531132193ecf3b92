"""Detection of stagnating solves. Plain Python.

At the limit of rounding the potential no longer decreases, the corrections no longer shrink, and the force imbalance
fluctuates. A solve whose tolerance is below this limit would use all the corrections that it may.
"""

from __future__ import annotations

import math

MOST_IDLE = 20
"""Number of consecutive corrections without progress after which a solve stagnates. (Close to a minimum, each
correction gains at least a decade.)"""


class Progress:
    """The progress of one solve.

    tolerance: of a correction, in ranges of adhesion; unbalanced: tolerance of the force imbalance, in the unit of
    `unsettled` below.
    """

    def __init__(self, tolerance: float, unbalanced: float):
        self.tolerance, self.unbalanced = tolerance, unbalanced
        self.idle, self.least_unsettled = 0, math.inf
        self._drop, self._size = 0.0, math.inf

    def stalls(self, drop: float, slack: float, size: float, unsettled: float) -> bool:
        """Adds a correction; returns whether the solve stagnates.

        drop: total decrease of the potential; slack: its rounding error; size: of the correction, in ranges of
        adhesion;
        unsettled: the force imbalance. Progress is a decrease of the potential by more than rounding, or halving the
        correction or the imbalance if these are above their tolerances.
        """
        # Each correction is rounded anew.
        fell = drop > self._drop + slack * (1 + self.idle)
        shrank = size >= self.tolerance and size < 0.5 * self._size
        settled = unsettled > self.unbalanced and unsettled < 0.5 * self.least_unsettled
        if fell:
            # The surface has changed: earlier values are not comparable.
            self._drop, self._size, self.least_unsettled = drop, size, unsettled
        else:
            self._size = min(self._size, size) if shrank or math.isinf(self._size) else self._size
            if settled or math.isinf(self.least_unsettled):
                self.least_unsettled = unsettled
        self.idle = 0 if fell or shrank or settled else self.idle + 1
        return self.idle >= MOST_IDLE
