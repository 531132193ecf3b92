"""Works of the punch from the rows of a loop alone, where no run tells what it integrated itself.

Forces between two rows are taken to be linear in the displacement; a row at which the surface jumped is met with the
force of the row before where the punch goes up to a jump against that.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .loop import Loop


def forces_met(loop: Loop) -> tuple[np.ndarray, np.ndarray]:
    """Forces [N] at the start and at the end of each step between rows, (rows - 1,), as the punch meets them."""
    before = loop.force[:-1]
    return before, np.where(loop.jump[1:] & loop.held, before, loop.force[1:])


def net_work_of_rows(loop: Loop) -> float:
    """Work of the punch [J] over all rows, -int F dd: the area of a closed loop."""
    before, after = forces_met(loop)
    return float(-0.5 * (before + after) @ np.diff(loop.displacement))


def separation_of_rows(loop: Loop) -> float:
    """Work [J] that the punch does while it goes up against a tensile force; of a step through zero force the part
    under tension."""
    before, after = forces_met(loop)
    start, end = np.maximum(-before, 0.0), np.maximum(-after, 0.0)
    mean = 0.5 * (start + end)
    crossing = before * after < 0.0
    span = np.abs(before - after)[crossing]
    mean[crossing] = 0.5 * np.maximum(start, end)[crossing] ** 2 / span
    moved = np.maximum(np.diff(loop.displacement), 0.0)
    return float(mean @ moved)
