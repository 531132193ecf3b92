"""Drawing in the project's own manner, whatever matplotlib is set to by its user, and writing pictures.

matplotlib is loaded when a picture is made, and without pyplot: the caller's own settings are not touched.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

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
