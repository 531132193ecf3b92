"""Drawing in the project's own manner, whatever matplotlib is set to by its user, and writing pictures: the style, the
colours, how numbers are written, and which rows of a long curve are drawn.

matplotlib is loaded when a picture is made, and without pyplot: the caller's own settings are not touched.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.files.regular_files import write_figure

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
TURQUOISE, RED, GREY = "#00798c", "#b3352b", "#8a8a8a"
CURVE_PARTS = 2000
"""Parts of a curve of which the lowest and highest points are drawn: more than a picture has columns of pixels."""


@contextmanager
def drawing() -> Iterator[None]:
    """Around the making and the writing of figures: matplotlib's defaults with STYLE. A user's matplotlibrc may ask for
    LaTeX that is not there, for another size or for dark paper.

    Raises:
        ResultError: if matplotlib can't be loaded with the user's set-up.
    """
    try:
        import matplotlib
    except ValueError as problem:
        cure = "look at MPLBACKEND and at the file matplotlibrc of this folder or of your home"
        raise ResultError(f"matplotlib can't be loaded: {problem}; {cure}") from None

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(STYLE)
        yield


def literal(text: str) -> str:
    """A title or a name of a user's as text of a figure: its dollars don't begin a formula."""
    return text.replace("$", r"\$")


def target_folder(directory: Path, out: str | Path | None) -> Path:
    """The folder for the pictures of a results folder: `out`, which is made, or else the folder itself. ResultError."""
    if out is None:
        return directory
    try:
        Path(out).mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        raise ResultError(f"{out}: could not be made: {problem.strerror}") from None
    return Path(out)


def elsewhere(path: Path, directory: Path) -> str:
    """What to do, added to a message, where a file could not be written into the results folder."""
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


def new_figure(width: float, height: float) -> Any:
    """An empty figure, width and height in inches, that belongs to no window."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


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


def seen_rows(*curves: np.ndarray) -> np.ndarray:
    """Numbers of the rows with which a line looks as with all of them, in their order.

    Of each of `CURVE_PARTS` equal parts the first row, and where each of the curves, (rows,), is lowest and highest.
    All rows where they are not many.
    """
    count = len(curves[0])
    size = -(-count // CURVE_PARTS)
    if count <= 2 * CURVE_PARTS * (1 + len(curves)):
        return np.arange(count)
    starts = np.arange(0, count, size)
    found: list[Any] = [starts, [count - 1]]
    whole = count // size * size
    for curve in curves:
        parts = np.asarray(curve)[:whole].reshape(-1, size)
        rest = np.asarray(curve)[whole:]
        for place in (np.argmin, np.argmax):
            found.append(starts[: len(parts)] + place(parts, axis=1))
            if rest.size:
                found.append([whole + place(rest)])
    return np.unique(np.concatenate(found))


def seen(*curves: np.ndarray) -> tuple[np.ndarray, ...]:
    """The curves, (rows,) each, at their `seen_rows`."""
    rows = seen_rows(*curves)
    return tuple(np.asarray(curve)[rows] for curve in curves)
