"""Style and writing of pictures, independent of the user's settings of matplotlib: colours and lines, widths for
journals, format of numbers, and the rows of a long curve that are drawn.

A function with the decorator `picture` returns a Figure. matplotlib is only loaded when a picture is made, and without
pyplot, so that the caller's settings do not change.
"""

from __future__ import annotations

import functools
import io
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.files.regular_files import write_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

P = ParamSpec("P")
Drawn = TypeVar("Drawn", bound="Figure | None")

STYLE = {
    "font.size": 9.0,
    "axes.titlesize": 8.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.8,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "lines.linewidth": 1.4,
    "savefig.dpi": 150,
}
PALETTE = ("#00798c", "#8f1d14", "#d18f00", "#2d1657", "#e7a0c0", "#7a8f3c")
"""Colours of curves. Colour-blind readers can distinguish them, and their lightness differs for prints in grey
(tests/unit/test_palette.py)."""
TURQUOISE, RED, OCHRE, VIOLET = PALETTE[:4]
GREY = "#8a8a8a"
DASHES = (0, (4, 2))
LINES = ("-", DASHES, (0, (1, 1.2)), (0, (5, 1.5, 1, 1.5)), (0, (9, 2)), (0, (3, 1, 1, 1, 1, 1)))
"""Styles of lines, as many as colours."""
WIDTHS = {"single": 3.5, "double": 7.2}
"""Widths [inch] of pictures for a column and a page of a journal: 89 and 183 mm."""
SMALL_FONT = 7.0
"""Size [pt] of letters in a picture of a journal's width."""
FORMATS = ("png", "pdf", "svg")
FOOTER = 0.17
"""Height [inch] of the line below a picture."""
FOOTER_FONT = 6.5
MOST_TICKS = 6
"""Places on a logarithmic axis up to which each has its number."""
_width: ContextVar[str | None] = ContextVar("width", default=None)
CURVE_PARTS = 2000
"""Number of parts of a curve of which the lowest and highest points are drawn: more than a picture has columns of
pixels."""


@contextmanager
def drawing(width: str | None = None) -> Iterator[None]:
    """Context in which figures are made and written: matplotlib's defaults with STYLE. A user's matplotlibrc may
    require LaTeX, another size or a dark background.

    width: one of WIDTHS for all figures in this context, with smaller letters; None for the width of each figure.

    Raises:
        ResultError: if matplotlib can't be loaded.
    """
    try:
        import matplotlib
    except ValueError as problem:
        cure = "look at MPLBACKEND and at the file matplotlibrc of this folder or of your home"
        raise ResultError(f"matplotlib can't be loaded: {problem}; {cure}") from None

    token = _width.set(width) if width else None
    try:
        with matplotlib.rc_context():
            matplotlib.rcdefaults()
            settings: Any = matplotlib.rcParams
            settings.update(STYLE)
            if _width.get():
                settings.update({name: SMALL_FONT for name in STYLE if name.endswith("size")})
            yield
    finally:
        if token:
            _width.reset(token)


def picture(draw: Callable[P, Drawn]) -> Callable[P, Drawn]:
    """Decorator for functions that draw a figure with the project's settings, independent of the caller's."""

    @functools.wraps(draw)
    def drawn(*arguments: P.args, **options: P.kwargs) -> Drawn:
        with drawing():
            return draw(*arguments, **options)

    return drawn


def literal(text: str) -> str:
    """A title or name from a user as text in a figure, without formulas between dollar signs."""
    return text.replace("$", r"\$")


def target_folder(directory: Path, out: str | Path | None) -> Path:
    """The folder for the pictures of a results folder: `out`, which is created, or else the folder itself.
    ResultError."""
    if out is None:
        return directory
    try:
        Path(out).mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise ResultError(f"{out}: could not be made: {problem.strerror}") from None
    return Path(out)


def elsewhere(path: Path, directory: Path) -> str:
    """Advice for the message if a file could not be written into the results folder."""
    return "; --out DIR writes into another folder" if path.parent == directory else ""


def write_picture(figure: Any, path: str | Path, hint: str = "") -> Path:
    """Write a figure; ResultError if that can't be done, with `hint` at the end."""
    try:
        write_figure(Path(path), figure)
    except ResultError as problem:
        raise ResultError(f"{problem}{hint}") from problem
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise ResultError(f"{path}: could not be written: {reason}{hint}") from problem
    return Path(path)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure without a window, width and height in inches. Within `drawing` with the width of a journal, it
    has this width, and a height in proportion. It is written, and shown in a notebook, with the project's settings."""
    if name := _width.get():
        wide = WIDTHS[name]
        # Letters do not shrink in proportion, so the height is a little larger.
        width, height = wide, height * (wide / width) ** 0.7
    return _picture_class()(figsize=(width, height), layout="constrained")


@functools.cache
def _picture_class() -> type[Figure]:
    from matplotlib.figure import Figure

    class Picture(Figure):
        """A figure that is saved with the project's settings, not those of the caller."""

        def savefig(self, fname: Any, **options: Any) -> None:
            with drawing():
                super().savefig(fname, **options)

        def _repr_png_(self) -> bytes:
            """For notebooks."""
            image = io.BytesIO()
            self.savefig(image, format="png")
            return image.getvalue()

    return Picture


def room(each: float, most: int) -> int:
    """Number of panels of a width [inch] in a row of a picture with the width of a journal; `most` in other
    pictures."""
    width = _width.get()
    return max(1, min(most, int(WIDTHS[width] / each))) if width else most


def footer(figure: Figure, text: str) -> None:
    """Writes a small grey line at the foot of a finished figure, which becomes taller by it. Text that is too long is
    cut off."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    width, height = figure.get_size_inches()
    figure.set_size_inches(width, height + FOOTER)
    share = FOOTER / (height + FOOTER)
    left, bottom, right, top = 0.0, share, 1.0, 1.0
    renderer = FigureCanvasAgg(figure).get_renderer()
    legends: list[Any] = figure.legends
    for legend in legends:
        # The layout does not include a legend outside of the axes, so room is reserved for it here.
        box = legend.get_window_extent(renderer).transformed(figure.transFigure.inverted())
        legend.set_bbox_to_anchor((0, share, 1, 1 - share), transform=figure.transFigure)
        pad = 2 * legend.borderaxespad * FOOTER_FONT / 72
        # A private attribute of matplotlib, which may be renamed in later versions.
        place = getattr(legend, "_outside_loc", None)
        bottom += (box.height + pad / height) * (place == "lower")
        top -= (box.height + pad / height) * (place == "upper")
        right -= (box.width + pad / width) * (place == "right")
    layout: Any = figure.get_layout_engine()
    layout.set(rect=(left, bottom, right - left, top - bottom))
    most = int(width * 72 / (0.5 * FOOTER_FONT))
    text = text if len(text) <= most else text[: most - 1] + "…"
    figure.text(0.05 / width, 0.3 * share, literal(text), fontsize=FOOTER_FONT, color="0.45", va="bottom")


def place_ticks(axis: Any, places: Iterable[float]) -> bool:
    """Has a logarithmic x axis show its places as ticks, if they are MOST_TICKS at most, and no others; returns whether."""
    few = sorted(set(places))
    if len(few) > MOST_TICKS:
        return False
    axis.set_xticks(few)
    axis.set_xticks([], minor=True)
    return True


def signed(value: float) -> str:
    """A number of three digits with a true minus sign."""
    return f"{value:.3g}".replace("-", "\N{MINUS SIGN}")


def energy_unit(size: float) -> tuple[float, str]:
    """Factor [J] and name of the unit that brings `size` [J] to between 1 and 1000."""
    for factor, unit in ((1.0, "J"), (1e-3, "mJ"), (1e-6, "µJ"), (1e-9, "nJ"), (1e-12, "pJ"), (1e-15, "fJ")):
        if size >= factor:
            return factor, unit
    return 1e-15, "fJ"


def length_unit(size: float) -> tuple[float, str]:
    """Factor [m] and name of the unit that brings `size` [m] to between 1 and 1000; nm where it is less, or 0."""
    for factor, unit in ((1.0, "m"), (1e-3, "mm"), (1e-6, "µm")):
        if size >= factor:
            return factor, unit
    return 1e-9, "nm"


def seen_rows(*curves: np.ndarray, parts: int = CURVE_PARTS) -> np.ndarray:
    """Indices of the rows that suffice to draw a line as with all of them, in order.

    From each of `parts` equal parts, the first row and the rows of the minimum and maximum of each curve,
    (rows,). All rows if there are few.
    """
    count = len(curves[0])
    size = -(-count // parts)
    if count <= 2 * parts * (1 + len(curves)):
        return np.arange(count)
    starts = np.arange(0, count, size)
    found: list[Any] = [starts, [count - 1]]
    whole = count // size * size
    for curve in curves:
        pieces = np.asarray(curve)[:whole].reshape(-1, size)
        rest = np.asarray(curve)[whole:]
        for place in (np.argmin, np.argmax):
            found.append(starts[: len(pieces)] + place(pieces, axis=1))
            if rest.size:
                found.append([whole + place(rest)])
    return np.unique(np.concatenate(found))


def seen(*curves: np.ndarray) -> tuple[np.ndarray, ...]:
    """The curves, (rows,) each, at their `seen_rows`."""
    rows = seen_rows(*curves)
    return tuple(np.asarray(curve)[rows] for curve in curves)
