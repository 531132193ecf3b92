"""Makes the figures, the table of errors and the tables of docs/evidence/validation.md, and the one of contact in docs/explanation/model.md.

    python -m scripts.studies.validation.figures               everything; some minutes on one core
    python -m scripts.studies.validation.figures hertz jkr     some figures; rows of the others are kept
    python -m scripts.studies.validation.figures --quick       on small grids, into out/validation-quick
    python -m scripts.studies.validation.figures --list

Into docs/figures/validation: a PNG a figure, and errors.csv. The tables of docs/evidence/validation.md, between its lines
`<!-- errors NAME -->` and `<!-- end -->`, are written anew from errors.csv, and so is the table of docs/explanation/model.md, between
`<!-- contact radius -->` and `<!-- end -->`.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Iterable
from pathlib import Path

from matplotlib import rc_context

from pgfmd.plots.drawing import STYLE

from ..pages import FIGURES as FIGURE_FOLDER
from ..pages import ROOT, fill, page_named
from . import flat, full_contact, numbers, radii, response, schemes, spheres, waves
from .choice import chosen
from .drawing import Line, number, shown

PAGE, MODEL_PAGE = page_named("validation.md"), page_named("model.md")
FOLDER = FIGURE_FOLDER / "validation"
COLUMNS = ("figure", "what", "settings", "closed form", "ours", "error")

FIGURES: dict[str, Callable] = {
    "prony-mode": response.prony_mode,
    "gfmd-mode": response.gfmd_mode,
    "sinusoid": waves.full_contact,
    "hertz": spheres.hertz_figure,
    "power-law": spheres.power_figure,
    "lee-radok": spheres.lee_radok,
    "jkr": spheres.jkr_figure,
    "maugis": spheres.maugis_figure,
    "contact-definition": radii.definition,
    "contact-radius": radii.loops,
    "contact-error": radii.errors,
    "contact-time": full_contact.crack_in_time,
    "flat-stiffness": flat.stiffness,
    "kendall": flat.kendall,
    "separation": flat.separation,
    "film": flat.film_figure,
    "westergaard": waves.westergaard,
    "johnson": waves.johnson,
    "full-contact": full_contact.closing,
    "corrugation": waves.corrugation_energy,
    "paper": numbers.paper,
    "gfmd-limit": schemes.inertia_vanishes,
    "ode": schemes.against_scipy,
}
"""Name of the figure, and of its file, and what makes it: `quick` -> figure, lines."""


def read_rows(folder: Path) -> list[dict[str, str]]:
    """The rows of errors.csv in this folder, none if there is no such file."""
    path = folder / "errors.csv"
    if not path.exists():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def write_rows(folder: Path, rows: Iterable[dict[str, str]]) -> None:
    """Writes errors.csv, in the order of FIGURES."""
    names = list(FIGURES)
    kept = sorted((row for row in rows if row["figure"] in names), key=lambda row: names.index(row["figure"]))
    with (folder / "errors.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(kept)


def row_of(figure: str, line: Line) -> dict[str, str]:
    """A row of errors.csv: numbers of ten digits."""
    values = (f"{value:.10g}" for value in (line.closed, line.ours, line.error))
    return dict(zip(COLUMNS, (figure, line.what, line.settings, *values), strict=True))


def table(rows: Iterable[dict[str, str]]) -> str:
    """Rows of errors.csv as a table of the page."""
    text = ["| what | settings | closed form | pgfmd | error |", "| --- | --- | --- | --- | --- |"]
    for row in rows:
        closed, ours, error = (float(row[column]) for column in COLUMNS[3:])
        values = (number(closed, 5), number(ours, 5), shown(closed, error))
        text.append(f"| {row['what']} | {row['settings']} | {' | '.join(values)} |")
    return "\n".join(text)


def table_of(figure: str, rows: list[dict[str, str]]) -> str:
    """The rows of one figure as a table of the page."""
    return table([row for row in rows if row["figure"] == figure])


def table_of_contact(rows: list[dict[str, str]]) -> str:
    """The rows of what counts as contact as a wide table: a line a state, a column a count, its error behind it."""
    own = [row for row in rows if row["figure"] == "contact-definition"]
    counts = list(dict.fromkeys(row["what"] for row in own))
    text = ["| force | JKR [µm] | " + " | ".join(counts) + " |", "| --- " * (len(counts) + 2) + "|"]
    for state in dict.fromkeys(row["settings"] for row in own):
        found = [row for row in own if row["settings"] == state]
        cells = [f"{number(float(row['ours']), 4)} ({shown(1.0, float(row['error']))})" for row in found]
        text.append(f"| {state} | {number(float(found[0]['closed form']), 4)} | {' | '.join(cells)} |")
    return "\n".join(text)


def make(name: str, quick: bool, folder: Path) -> list[dict[str, str]]:
    """Makes a figure and gives back its rows."""
    start = time.perf_counter()
    with rc_context(STYLE):
        figure, lines = FIGURES[name](quick)
        # The reduced metadata leave the file the same from run to run.
        figure.savefig(folder / f"{name}.png", dpi=120, metadata={"Software": None})
    print(f"# {name}: {time.perf_counter() - start:.1f} s")
    for line in lines:
        values = f"{line.closed:12.6g} {line.ours:12.6g} {line.shown_error:>12s}"
        print(f"{line.what:55s} {values}   {line.settings}", flush=True)
    return [row_of(name, line) for line in lines]


def main() -> None:
    names, quick = chosen(__doc__, "figure", FIGURES, "small grids; leaves docs alone")
    folder = ROOT / "out" / "validation-quick" if quick else FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        # Read and written anew after each figure, so that a run that is ended early leaves what it has made.
        new = make(name, quick, folder)
        write_rows(folder, [row for row in read_rows(folder) if row["figure"] != name] + new)
    if not quick:
        rows = read_rows(folder)
        fill(PAGE, "errors", lambda name: table_of(name, rows))
        fill(MODEL_PAGE, "contact", lambda name: table_of_contact(rows))


if __name__ == "__main__":
    main()
