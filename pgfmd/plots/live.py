"""A picture in a notebook that grows with a simulation."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .drawing import PALETTE, length_unit, new_figure, picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pgfmd.in_memory import Step

LEAST_HEIGHT = 1e-9
"""Smallest range of gaps [m] that a map shows."""


class LivePlot:
    """Force against displacement so far, and the newest map of the gap, drawn again while a simulation goes on.

        live = pgfmd.LivePlot()
        found = pgfmd.simulate(scene, each=live)
        live.draw()

    every [s]: time between two drawings. Needs a notebook; serial, as simulations in notebooks are. `draw` shows the last
    state. Raises RuntimeError outside of a notebook when it is first drawn.
    """

    def __init__(self, every: float = 1.0):
        self.every = every
        self._next = 0.0
        self._rows: list[tuple[float, float]] = []
        self._map: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        self._handle: Any = None

    def __call__(self, step: Step) -> None:
        """Takes up a step, and draws if it is time to."""
        self._rows.append((step.displacement, step.force))
        now = time.monotonic()
        if now >= self._next:
            self._map = step.x, step.gap
            self.draw()
            # Drawing takes at most half of the time.
            self._next = time.monotonic() + max(self.every, time.monotonic() - now)

    def draw(self) -> None:
        """Shows the present picture in the output of the cell, in the place of the one before."""
        from IPython import get_ipython
        from IPython.display import display

        if get_ipython() is None:
            raise RuntimeError("LivePlot draws in a notebook; in a program take plot_force of what `simulate` returns")
        figure = self.figure()
        if self._handle is None:
            self._handle = display(figure, display_id=True)
        else:
            self._handle.update(figure)

    @picture
    def figure(self) -> Figure:
        """The picture as a Figure of matplotlib."""
        figure = new_figure(7.2, 3.0)
        left, right = figure.subplots(1, 2)
        rows = np.array(self._rows).reshape(-1, 2)
        left.plot(-1e6 * rows[:, 0], 1e3 * rows[:, 1], color=PALETTE[0])
        left.plot(-1e6 * rows[-1:, 0], 1e3 * rows[-1:, 1], "o", color=PALETTE[1])
        left.axhline(0.0, color="0.7", linewidth=0.6)
        left.set(xlabel="indentation (µm)", ylabel="force (mN)")
        if self._map is not None:
            x, gap = self._map
            factor, unit = length_unit(float(np.nanmax(np.abs(gap), initial=LEAST_HEIGHT)))
            edge = 1e6 * float(x[-1])
            image = right.imshow(
                gap / factor, origin="lower", extent=(-edge, edge, -edge, edge), cmap="cividis", interpolation="nearest"
            )
            figure.colorbar(image, ax=right, label=f"gap ({unit})")
            right.set(xlabel="x (µm)", ylabel="y (µm)")
        return figure
