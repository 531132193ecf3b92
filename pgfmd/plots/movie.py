"""Movies of a run: the map of a field beside the force curve, along which a marker runs. Reads files only, no MPI."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import ResultError
from pgfmd.results import Results
from pgfmd.results.curve import Loop
from pgfmd.results.reading import Run, opened
from pgfmd.units import handy, handy_quantity

from .curves import ZOOM_BELOW, at_foot, axis_unit, draw_branches, labelled, zoom_on_tension
from .drawing import RED, drawing, literal, new_figure, picture
from .field_colours import COLOURINGS
from .maps import bare, draw_image, draw_outline, draw_scale_bar, half_side, shortened, thinned
from .video_files import Film, Picture, write_video

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FRAMES, RATE = 100, 20.0
"""Frames of a movie, and how many are shown in a second, unless said otherwise."""
SIZE = (8.6, 4.6)
"""Width and height [inch]; the line at the foot comes on top."""
DPI = {".mp4": 140, ".gif": 90}
"""Pixels an inch by format. GIFs grow fast."""
EVEN = ("time", "displacement")


@dataclass(frozen=True)
class Made:
    """A movie that was written. snapshots: different ones that it shows; remarks: what is to be known of it."""

    path: Path
    frames: int
    snapshots: int
    remarks: tuple[str, ...]


def movie(
    run: Run,
    path: str | Path | None = None,
    field: str = "gap",
    even: str = "time",
    frames: int = FRAMES,
    rate: float = RATE,
    limit: float | None = None,
) -> Made:
    """Writes a movie of the snapshots of a run: the map of a field, and a marker on the force curve.

    All frames have the same scale of colours. A frame shows the snapshot that is nearest to its time, and the marker is where
    that snapshot was taken. Where there are fewer snapshots than frames, some are shown for several frames.

    Args:
        run: results, or their folder.
        path: of the movie, .mp4 or .gif. A movie is written as a GIF if ffmpeg is not there. Without a path,
            `movie-<field>.mp4` in the folder of the run.
        field: "gap", "traction", "displacement" or "contact", in the classes of `plot_contact_maps`.
        even: in what the frames are evenly spaced: "time", or "displacement", the way of the punch, which leaves out
            times at which it rests.
        frames: how many there are.
        rate: frames a second.
        limit: end of the scale of colours, [m] or [Pa]; None for one that suits all snapshots (field_colours.py).

    Raises:
        ResultError: if the run can't be read, or has no snapshots, or the movie can't be written.
        ValueError: for an unknown field, spacing or format, or a number out of range.
    """
    _require(field, even, frames, rate, limit)
    with opened(run) as results, drawing():
        path = Path(path) if path is not None else results.directory / f"movie-{field}.mp4"
        order = chosen(results, even, frames)
        stage = Stage(results, field, list(dict.fromkeys(order)), limit)
        shots = [(snapshot, order.count(snapshot)) for snapshot in dict.fromkeys(order)]
        film = Film(lambda dpi: stage.film(shots, dpi), DPI, rate, stage.colours)
        written, remarks = write_video(path, film)
        if len(shots) < frames:
            remarks = (_few(results, len(shots), frames), *remarks)
        return Made(written, frames, len(shots), remarks)


def _require(field: str, even: str, frames: int, rate: float, limit: float | None) -> None:
    """Raises ValueError for what a movie can't be made of."""
    if field not in COLOURINGS:
        raise ValueError(f"field: {field!r}: expected one of {', '.join(COLOURINGS)}")
    if even not in EVEN:
        raise ValueError(f"even: {even!r}: expected one of {', '.join(EVEN)}")
    if frames < 1:
        raise ValueError(f"frames: {frames}: expected 1 or more")
    if not 1.0 <= rate <= 100.0:
        raise ValueError(f"rate: {rate}: expected 1 to 100 frames a second")
    if limit is not None and not (COLOURINGS[field][1] and 0.0 < limit < math.inf):
        raise ValueError(f"limit: {limit}: expected a number above zero, for a field with a scale of colours")


def chosen(results: Results, even: str, frames: int) -> list[int]:
    """The snapshot of each frame, in the order of time: that nearest to each of evenly spaced moments, from the first
    snapshot to the last. ResultError without snapshots."""
    if not results.labels:
        raise ResultError(
            f'{results.directory}: has no snapshots to be shown; output.snapshots asks for them, such as "every 1 s"'
        )
    times = np.asarray(results.fields["time"][:], dtype=float)
    order = np.argsort(times, kind="stable")
    place = times[order]
    if even == "displacement":
        loop = Loop.of(results)
        way = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(loop.displacement)))))
        place = np.interp(place, loop.time, way)
    wanted = np.linspace(place[0], place[-1], frames)
    return [int(order[np.argmin(np.abs(place - each))]) for each in wanted]


def _few(results: Results, snapshots: int, frames: int) -> str:
    """What is said where there are fewer snapshots than frames, and how a run gets as many."""
    time = Loop.of(results).time
    apart = handy_quantity(float(time[-1] - time[0]) / frames, "time", 2)
    cure = f'a run with output.snapshots = ["every {apart}"] has as many'
    return f"{snapshots} snapshots for {frames} frames, so some are shown for several; {cure}"


@picture
def plot_frame(run: Run, snapshot: int = -1, field: str = "gap", limit: float | None = None) -> Figure:
    """One frame of a movie, on the scale of colours of all snapshots: the map of a field, and where it is on the force
    curve.

    Args:
        run: results, or their folder.
        snapshot: its number, from 0; negative counts from the end.
        field, limit: as of `movie`.

    Raises:
        ResultError: if the run can't be read, or has no such snapshot.
        ValueError: for an unknown field, or a limit out of range.
    """
    _require(field, EVEN[0], FRAMES, RATE, limit)
    with opened(run) as results:
        count = len(results.labels)
        if not -count <= snapshot < count:
            raise ResultError(f"{results.directory}: has {count} snapshots, no number {snapshot}")
        stage = Stage(results, field, range(count), limit)
        stage.show(snapshot % count)
        return stage.figure


class Stage:
    """The figure of a movie, and what changes in it from snapshot to snapshot.

    figure: without a snapshot until `show`. colours: (any, 3), those of the field, for formats with few colours.
    """

    def __init__(self, results: Results, field: str, snapshots: Sequence[int], limit: float | None):
        self.results, self.loop = results, Loop.of(results)
        time, force, position = (np.asarray(results.fields[name][:]) for name in ("time", "force", "punch_position"))
        self.moments = list(zip(results.labels, time, force, -position - self.loop.offset, strict=True))
        self.colouring = COLOURINGS[field][0](results, snapshots, limit)
        tension = -float(self.loop.force.min())
        zoomed = 0.0 < tension < ZOOM_BELOW * float(self.loop.force.max())
        self.figure = new_figure(*SIZE)
        grid = self.figure.add_gridspec(2 if zoomed else 1, 2, width_ratios=(1.35, 1))
        self._draw_map(self.figure.add_subplot(grid[:, 0]), snapshots[0])
        self.across = axis_unit([self.loop.indentation], "m")
        self.along = axis_unit([self.loop.force], "N")
        self.markers = [self._draw_curve(self.figure.add_subplot(grid[0, 1]))]
        if zoomed:
            close = self.figure.add_subplot(grid[1, 1])
            self.markers.append(self._draw_curve(close))
            zoom_on_tension(close, [self.loop], self.across[0], self.along[0], tension)
        self.markers[-1].axes.set_xlabel(labelled("indentation", self.across[1]))
        self.figure.align_ylabels([marker.axes for marker in self.markers])
        at_foot(self.figure, [results])
        self._time = _steady(float(self.loop.time[-1]), "s")
        self._force = _steady(float(np.abs(self.loop.force).max()), "N")

    def _draw_map(self, axis: Any, snapshot: int) -> None:
        half, shown = half_side(self.results), self.colouring
        self.image = draw_image(axis, shown.paint(snapshot), half)
        # Told beforehand: the layout leaves room for two lines.
        self.title = axis.set_title("\n", linespacing=1.3)
        outline = draw_outline(axis, thinned(self.results, "gap", snapshot), half)
        self.moving: list[Any] = [self.image, self.title, *([] if outline is None else [outline])]
        draw_scale_bar(axis, half)
        bare(axis)
        if shown.scale is not None:
            bar = self.figure.colorbar(shown.scale, ax=axis, shrink=0.85, pad=0.03, extend=shown.extend)
            bar.set_label(shown.label)
            bar.outline.set_linewidth(0.5)
        if shown.patches:
            self.figure.legend(
                handles=shown.patches, loc="outside lower left", ncols=4, handlelength=1.2, columnspacing=1.4
            )

    def _draw_curve(self, axis: Any) -> Any:
        """Draws the curve; returns the marker on it."""
        axis.axhline(0, color="0.8", linewidth=0.8, zorder=0)
        x, y = self.loop.indentation / self.across[0], self.loop.force / self.along[0]
        draw_branches(axis, self.loop, x, y, 0, 1, "")
        if not hasattr(self, "markers"):
            axis.legend(loc="best")
        axis.set_ylabel(labelled("force", self.along[1]))
        look: dict[str, Any] = {"color": RED, "markersize": 7, "markeredgecolor": "white", "zorder": 5}
        return axis.plot([], [], "o", **look)[0]

    @property
    def colours(self) -> NDArray[np.uint8]:
        """Colours (any, 3) that the field may have."""
        from matplotlib.colors import to_rgba_array

        scale = self.colouring.scale
        found = [to_rgba_array([patch.get_facecolor() for patch in self.colouring.patches])]
        if scale is not None:
            found.append(scale.cmap(np.linspace(0.0, 1.0, 128)))
        return np.round(255 * np.concatenate(found)[:, :3]).astype(np.uint8)

    def show(self, snapshot: int) -> None:
        """Shows a snapshot."""
        self.image.set_data(self.colouring.paint(snapshot))
        label, time, force, indentation = self.moments[snapshot]
        for marker in self.markers:
            marker.set_data([indentation / self.across[0]], [force / self.along[0]])
        texts = [
            _text(time, *self._time),
            f"indentation {_text(indentation, *self.across, 2)}",
            f"force {_text(force, *self._force)}",
        ]
        self.title.set_text(f"{literal(shortened(label, 40))}\n{',  '.join(texts)}")

    def film(self, shots: Sequence[tuple[int, int]], dpi: int) -> Iterator[Picture]:
        """Pictures of snapshots, each with the number of frames for which it is shown.

        What does not change is drawn once.
        """
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        self.figure.set_dpi(dpi)
        canvas = FigureCanvasAgg(self.figure)
        self.show(shots[0][0])
        # Once, for the layout, which must not change from frame to frame.
        canvas.draw()
        self.figure.set_layout_engine("none")
        moving = [*self.moving, *self.markers]
        for artist in moving:
            artist.set_animated(True)
        canvas.draw()
        still = canvas.copy_from_bbox(self.figure.bbox)
        for snapshot, count in shots:
            canvas.restore_region(still)
            self.show(snapshot)
            for artist in moving:
                artist.axes.draw_artist(artist)
            yield np.asarray(canvas.buffer_rgba())[..., :3].copy(), count
        for artist in moving:
            artist.set_animated(False)


def _steady(largest: float, unit: str) -> tuple[float, str, int]:
    """Factor and name of a unit, and decimals, by which numbers up to `largest` have four digits, in each frame as many."""
    factor, name = handy([largest], unit)
    return factor, name, 3 - math.floor(math.log10(max(largest / factor, 1.0)))


def _text(value: float, factor: float, unit: str, decimals: int) -> str:
    # Without the sign of a zero.
    return f"{round(value / factor, decimals) + 0.0:.{decimals}f} {unit}".replace("-", "\N{MINUS SIGN}")
