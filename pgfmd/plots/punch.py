"""The face of a scene's punch: a map of heights, profiles through the first contact, the histogram of heights. No MPI."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pgfmd.punch.face import Face, face_on_grid
from pgfmd.scene import Scene

from .drawing import GREY, RED, TURQUOISE, length_unit, literal, new_figure, picture, signed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_PIXELS = 1024
BINS = 80
COLOURS = "viridis"
"""Low points, which touch first, are dark. None of cmcrameri's maps is used, because it loads pyplot."""


@picture
def plot_punch(scene: Scene | str | Path | Mapping[str, Any]) -> Figure:
    """The face at the points of the scene's grid, with heights above the first contact: a map, profiles through the
    first contact, and the histogram.

    scene: a Scene, or what one is made from. Raises SceneError; ValueError, OSError for a map that can't be used.
    """
    scene = scene if isinstance(scene, Scene) else Scene(scene)
    face = face_on_grid(scene)
    figure = new_figure(8.2, 4.2)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.15, 1.0))
    _draw_map(figure, figure.add_subplot(grid[:, 0]), face)
    _draw_profiles(figure.add_subplot(grid[0, 1]), face)
    _draw_histogram(figure.add_subplot(grid[1, 1]), face)
    if scene.title:
        figure.suptitle(literal(scene.title), fontsize=9.5)
    return figure


def _draw_map(figure: Figure, axis: Axes, face: Face) -> None:
    """Heights, y upward, with the outline and the first contact."""
    across, name = length_unit(max(face.size))
    tall, unit = length_unit(face.relief)
    stride = -(-face.x.size // MOST_PIXELS)
    values = face.cut()[::stride, ::stride] / tall
    half_x, half_y = (0.5 * side / across for side in face.size)
    shown = axis.imshow(
        values, origin="lower", extent=(-half_x, half_x, -half_y, half_y), cmap=COLOURS, interpolation="nearest",
        vmin=0.0, vmax=face.relief / tall or 1.0,
    )  # fmt: skip
    row, column = face.first_contact()
    axis.plot(
        face.x[column] / across, face.y[row] / across, "+", color=RED, markersize=9, mew=1.6, label="first contact"
    )
    axis.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), handletextpad=0.2)
    axis.set(xlabel=f"x ({name})", ylabel=f"y ({name})")
    figure.colorbar(shown, ax=axis, shrink=0.8, label=f"height z ({unit}); low places touch first")


def _draw_profiles(axis: Axes, face: Face) -> None:
    """Heights along x and along y through the first contact."""
    across, name = length_unit(max(face.size))
    tall, unit = length_unit(face.relief)
    row, column = face.first_contact()
    z = face.cut() / tall
    axis.plot(
        face.x / across,
        z[row],
        color=TURQUOISE,
        linewidth=1.0,
        label=f"along x at y = {_place(face.y[row], across)} {name}",
    )
    axis.plot(
        face.y / across,
        z[:, column],
        color=GREY,
        linewidth=1.0,
        label=f"along y at x = {_place(face.x[column], across)} {name}",
    )
    axis.plot(face.x[column] / across, 0.0, "+", color=RED, markersize=9, mew=1.6)
    # In the orientation above the elastomer.
    axis.set(
        xlabel=f"x, y ({name})",
        ylabel=f"z ({unit})",
        ylim=(-0.06 * (face.relief / tall or 1.0), 1.06 * face.relief / tall or 1.0),
    )
    axis.legend(
        loc="lower center",
        bbox_to_anchor=(0.5, 1.0),
        ncols=2,
        fontsize=7.5,
        handlelength=1.2,
        columnspacing=1.0,
        borderpad=0.1,
    )


def _draw_histogram(axis: Axes, face: Face) -> None:
    """The fraction of points in intervals of height, and the cumulative fraction below a height."""
    tall, unit = length_unit(face.relief)
    z = face.z[face.inside] / tall
    if face.relief > 0.0:
        axis.hist(z, bins=BINS, weights=np.full(z.size, 100.0 / z.size), color=TURQUOISE)
    spread = float(z.std())
    axis.set(xlabel=f"z ({unit})", ylabel=f"share of points (%)\nin 1/{BINS} of the range")
    axis.set_title(
        f"range {signed(face.relief / tall)} {unit}, rms {signed(spread)} {unit}, {z.size} points",
        loc="right",
        color="0.35",
    )


def _place(value: float, unit: float) -> str:
    """A coordinate in these units. Rounding errors become 0."""
    return signed(round(value / unit, 6) + 0.0)
