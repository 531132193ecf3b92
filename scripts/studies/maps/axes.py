"""Makes the picture of the page on height maps: how rows and columns lie under the punch, and which heights touch first.

    python -m scripts.studies.maps.axes      a second; writes docs/figures/map_axes.png

The map is one that is unlike its mirror images and its transpose. What is drawn is what pgfmd makes of the file, not of the
array.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from pgfmd.physics.topography import Topography
from pgfmd.plots.drawing import GREY, RED, TURQUOISE, drawing

OUT = Path(__file__).parents[3] / "docs" / "figures" / "map_axes.png"
NUMBERS = np.array([
    [0.2, 0.3, 0.6, 1.1, 1.6, 1.9],
    [0.4, 0.5, 0.7, 1.0, 1.3, 1.5],
    [0.9, 0.9, 1.0, 1.1, 1.2, 1.2],
    [1.6, 1.5, 1.4, 1.3, 1.2, 1.1],
])  # fmt: skip
"""z[iy, ix] in um; its lowest height is the first one of the file."""
SIZE = (0.9e-3, 0.6e-3)
RADIUS = 0.27e-3


def main() -> None:
    """Draws the picture."""
    with tempfile.TemporaryDirectory() as folder, drawing():
        from matplotlib.figure import Figure

        path = Path(folder) / "map.csv"
        np.savetxt(path, NUMBERS, delimiter=",", fmt="%.1f")
        text = path.read_text(encoding="utf-8").splitlines()
        face = Topography("file", radius=RADIUS, file=path, file_size=SIZE, file_unit="um", file_peaks="down")
        figure = Figure(figsize=(9.6, 3.0), layout="constrained")
        file, seen, profile = figure.subplots(1, 3, width_ratios=(1.0, 1.4, 1.0))
        _draw_file(file, text)
        _draw_face(figure, seen, face)
        _draw_peaks(profile)
        figure.savefig(OUT)


def _draw_file(axes, lines: list[str]) -> None:
    """The file, line by line."""
    axes.set_axis_off()
    axes.set_title("the file: z[iy, ix], a row for each y", loc="left")
    for row, line in enumerate(lines):
        height = 0.82 - 0.14 * row
        axes.text(0.22, height, line, family="monospace", size=8, transform=axes.transAxes)
        axes.text(0.0, height, f"iy = {row}", size=8, color=GREY, transform=axes.transAxes)
    axes.text(0.22, 0.93, "ix = 0, 1, 2 ...", size=8, color=GREY, transform=axes.transAxes)
    axes.text(
        0.0, 0.12, 'file_size = ["0.9 mm", "0.6 mm"]\n6 x 4 pixels of 0.15 x 0.15 mm', size=8, transform=axes.transAxes
    )


def _draw_face(figure, axes, face: Topography) -> None:
    """What pgfmd makes of it, over the whole map, with the middles of pixels and the outline of the punch."""
    x, y = (np.linspace(-0.5, 0.5, 181) * side for side in SIZE)
    heights = face.map(*np.meshgrid(x, y))
    image = axes.pcolormesh(1e3 * x, 1e3 * y, 1e6 * heights, cmap="viridis", shading="nearest", rasterized=True)
    figure.colorbar(image, ax=axes, label="height z (µm)")
    rows, columns = NUMBERS.shape
    at_x, at_y = (
        ((np.arange(count) + 0.5) / count - 0.5) * side * 1e3 for count, side in zip((columns, rows), SIZE, strict=True)
    )
    axes.plot(*(line.ravel() for line in np.meshgrid(at_x, at_y)), ".", color="white", markersize=3)
    for row, column in ((0, 0), (0, columns - 1), (rows - 1, 0)):
        axes.annotate(f"z[{row}, {column}] = {NUMBERS[row, column]}", (at_x[column], at_y[row]), color="white", size=7,
                      xytext=(-6 if column == 0 else 10, 6), textcoords="offset points", ha="left" if column == 0 else "right")  # fmt: skip
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.plot(1e3 * RADIUS * np.cos(turn), 1e3 * RADIUS * np.sin(turn), color=RED, linewidth=1.2)
    axes.plot(0.0, 0.0, "+", color=RED)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal", title="under the punch (red), its axis in the middle")


def _draw_peaks(axes) -> None:
    """Profiles of the two ways in which heights grow."""
    x = np.linspace(-1.0, 1.0, 200)
    bumps = 0.35 * np.cos(7.0 * x) - 0.25 * x**2
    axes.fill_between(x, 1.0 - bumps, 1.9, color=TURQUOISE, alpha=0.5, linewidth=0)
    axes.plot(x, 1.0 - bumps, color=TURQUOISE)
    axes.fill_between(x, -0.6, 0.4, color=GREY, alpha=0.3, linewidth=0)
    axes.text(0.0, 1.7, "punch", ha="center", va="center")
    axes.text(0.0, -0.1, "elastomer", ha="center", va="center")
    for side, way, word in ((-1.25, 1.0, '"down"'), (1.25, -1.0, '"up"')):
        axes.annotate(
            "", (side, 1.1 + 0.55 * way), (side, 1.1 - 0.55 * way), arrowprops={"arrowstyle": "->", "color": RED}
        )
        axes.text(side, 2.05, f"file_peaks\n= {word}", ha="center", va="bottom", size=8)
        axes.text(side, 0.45, "numbers\ngrow", ha="center", va="top", size=8, color=RED)
    axes.set(xlim=(-1.7, 1.7), ylim=(-0.6, 2.7), title="which heights touch first")
    axes.set_axis_off()


if __name__ == "__main__":
    main()
