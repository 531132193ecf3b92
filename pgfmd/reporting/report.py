"""One file about a run or a study, for mail and for paper: numbers, curves, maps, doubts, and everything to run it again."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pgfmd import __version__
from pgfmd.errors import ResultError
from pgfmd.files.storage import CURVE_FILE, REPORT_FILE
from pgfmd.results.reading import require_folder

from .page import write_page


def report(
    source: str | Path,
    twin: str | Path | None = None,
    measured: str | Path | Sequence[str | Path] = (),
    out: str | Path | None = None,
    **options: Any,
) -> Path:
    """Writes one HTML file about a run or a study, with everything in it; returns its path. As `pgfmd report`.

    The file asks nothing of the network and stays under 5 MB: long curves are thinned to what can be seen, maps are made
    smaller, tables are packed. The page says where something was left out.

    Args:
        source: a results folder, of a run that is finished or not; or the folder of a study.
        twin: results of the quasi-static twin of a run.
        measured: a file, or files, of measured curves that are drawn over the runs'.
        out: the file; `report.html` in the folder unless said.
        options: what is done to measured curves, as of `pgfmd.compare`: machine_stiffness, correct, offset, ...

    Raises:
        ResultError: if it is no such folder, if something asked for can't be had, if the file can't be written, or
            without jinja2; MeasurementError: if a measured curve can't be read. TypeError: for options without a curve.
    """
    folder = Path(source)
    require_folder(folder)
    files = [Path(measured)] if isinstance(measured, (str, Path)) else [Path(each) for each in measured]
    if options and not files and twin is None:
        raise TypeError(f"report: {', '.join(options)} is for measured curves, and there are none")
    # Whatever it is: who reads it refuses what is no file.
    if os.path.lexists(folder / CURVE_FILE):
        from .run_page import run_page

        page = run_page(folder, None if twin is None else Path(twin), files, options)
    else:
        if twin is not None:
            raise ResultError(f"{folder}: the folder of a study, and a twin is one of a run: name the folder of a run")
        from .study_page import study_page

        page = study_page(folder, files, options)
    page.made = f"Made on {made()} by pgfmd {__version__}"
    return write_page(page, Path(out) if out is not None else folder / REPORT_FILE)


def made() -> str:
    """The date and time on this clock."""
    now = time.localtime()
    return f"{now.tm_mday} {time.strftime('%b %Y, %H:%M', now)}"
