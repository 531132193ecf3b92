"""All pictures of a results folder, and those of several runs together. Reads files only, no MPI."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pgfmd.errors import ResultError
from pgfmd.results import Results, load
from pgfmd.results.curve import Loop
from pgfmd.results.cycles import count_of
from pgfmd.results.reading import runs_in

from .curves import QUANTITIES, plot_curve, plot_energy, plot_force, plot_time
from .cycles import plot_cycles
from .drawing import drawing, elsewhere, target_folder, write_picture
from .maps import pages_of, plot_contact_maps, plot_stress_maps, stress_limit
from .numbers import NUMBERS, plot_numbers
from .sites import plot_sites

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Draw = Callable[[], "Figure"]
PAGED = ("contact-maps", "stress-maps")
"""Pictures with several pages."""


def plot_results(
    directory: str | Path,
    out: str | Path | None = None,
    greys: int = 4,
    contact_gap: float | None = None,
    near_gap: float | str | None = None,
    form: str = "png",
    width: str | None = None,
    limit: float | None = None,
) -> list[Path]:
    """Makes every picture for which the folder has data, in this folder or in `out`. Returns the files.

    `force-displacement.png` and `time.png` always; `contact-maps.png`, `stress-maps.png` with snapshots, more than
    twelve on further pages, `contact-maps-2.png` and so on; `cycles.png` of a programme with repeats; `energy.png` with
    an audit; `sites.png` where summits, saddles or valleys have met the elastomer. Further pages of an earlier plot are
    removed.

    Args:
        greys, contact_gap, near_gap: of the maps of contact (`plot_contact_maps`).
        form: of the files, one of drawing.FORMATS.
        width: of a column or a page of a journal, one of drawing.WIDTHS; None for each picture's own.
        limit: of the maps of stress [Pa].

    Raises:
        ResultError: if it is not a results folder, its table is still empty, or a picture can't be written.
    """
    with load(directory) as results, drawing(width):
        if not len(results.curve):
            raise ResultError(f"{results.directory}: nothing to plot yet, curve.csv has no rows")
        folder = target_folder(results.directory, out)
        contact = partial(plot_contact_maps, results, greys=greys, contact_gap=contact_gap, near_gap=near_gap)
        written = []
        for name, draw in pictures_of(results, contact, limit):
            path = folder / f"{name}.{form}"
            written.append(write_picture(draw(), path, elsewhere(path, results.directory)))
        for kind in PAGED:
            _remove_pages(folder, kind, form, len(pages_of(results)))
        return written


def _remove_pages(folder: Path, kind: str, form: str, last: int) -> None:
    """Removes pages of maps after the last, which are of an earlier run, or of this one before it was cut back."""
    page = max(last, 1) + 1
    while (path := folder / f"{_paged(kind, page)}.{form}").is_file():
        try:
            path.unlink()
        except OSError as problem:
            raise ResultError(
                f"{path}: is of an earlier plot, and could not be removed: {problem.strerror}"
            ) from problem
        page += 1


def pictures_of(
    results: Results, contact: Callable[..., Figure] | None = None, limit: float | None = None
) -> Iterator[tuple[str, Draw]]:
    """Name of each picture for which a run has data, and the function that draws it.

    contact: function that draws a page of maps of contact; by default `plot_contact_maps` of the run. limit: of the
    stress [Pa].
    """
    yield "force-displacement", partial(plot_force, results)
    yield "time", partial(plot_time, results)
    if results.run.get("cycles") or (results.scene.get("drive", {}).get("repeat") and count_of(Loop.of(results)) > 1):
        yield "cycles", partial(plot_cycles, results)
    pages = range(1, len(pages_of(results)) + 1)
    for page in pages:
        yield _paged("contact-maps", page), partial(contact or partial(plot_contact_maps, results), page=page)
    if len(pages) > 1 and limit is None:
        limit = stress_limit(results)
    for page in pages:
        yield _paged("stress-maps", page), partial(plot_stress_maps, results, page=page, limit=limit)
    if results.energy is not None and len(results.energy):
        yield "energy", partial(plot_energy, results)
    if results.sites is not None and len(results.sites):
        yield "sites", partial(plot_sites, results)


def _paged(name: str, page: int) -> str:
    return name if page == 1 else f"{name}-{page}"


def plot_against(
    directories: Sequence[str | Path], out: str | Path, x: str = "", y: str = "", log: str = "", form: str = "png",
    width: str | None = None,
) -> list[Path]:  # fmt: skip
    """Draws several runs in one picture; returns the files written into the folder `out`.

    Without x and y, `curves` (forces and contact against indentation) and `time`. Else one against the other: columns of
    the curves (`plot_curve`), or numbers of the runs (`plot_numbers`).

    directories: results folders, and folders of studies, which stand for their cases. Raises ResultError if one is
    neither, can't be read, or a picture can't be written; ValueError for an unknown name.
    """
    runs = [run for directory in directories for run in runs_in(directory)]
    if not (x or y):
        drawn: dict[str, Draw] = {"curves": partial(plot_force, *runs), "time": partial(plot_time, *runs)}
    elif (y or "force") in QUANTITIES and (x or "indentation") in QUANTITIES:
        x, y = x or "indentation", y or "force"
        drawn = {f"{y}-{x}": partial(plot_curve, *runs, x=x, y=y, log=log)}
    elif not y or y in NUMBERS:
        y = y or "pull-off"
        name = f"{y}-{x.rpartition('.')[2]}" if x else y
        drawn = {name: partial(plot_numbers, *runs, x=x, y=y, log=log)}
    else:
        raise ValueError(
            f"{y!r} can't be drawn against {x or 'a key'!r}: expected columns of curves ({', '.join(QUANTITIES)}), or one "
            f"of {', '.join(NUMBERS)} against a key of the scenes"
        )
    with drawing(width):
        folder = target_folder(Path(out), out)
        return [write_picture(draw(), folder / f"{name}.{form}") for name, draw in drawn.items()]
