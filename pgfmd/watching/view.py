"""What there is to be seen of a run that goes on: its status, the rows of its curve so far, the newest map.

Files that grow are read from where the last look ended. What can't be read at the moment, because the run is just
writing it, is read at the next look.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import ResultError
from pgfmd.files.storage import CURVE_FILE, FIELDS_FILE, UNDO_SUFFIX, reason
from pgfmd.files.tables import CURVE
from pgfmd.plots.maps import GapClass, class_numbers, gap_classes
from pgfmd.reporting.maps import closest, commonest
from pgfmd.results import load
from pgfmd.results.status import EMPTY, RUNNING, Status, status_of

Array = NDArray[np.float64]
NOT_YET = "no run yet"
"""Why a folder is empty in which a run may still begin."""
TITLES = ("time [s]", "indentation [m]", "force [N]")


@dataclass(frozen=True, eq=False)
class Map:
    """The newest map: the number of the class of each pixel (rows, columns) with y downward, OUTSIDE beyond the
    punch; the classes; label, time [s]."""

    numbers: NDArray[np.uint8]
    classes: list[GapClass]
    label: str
    time: float


@dataclass(frozen=True, eq=False)
class Glimpse:
    """What one look has found. time [s], indentation [m], force [N]: (rows,). map: None before the first snapshot.
    doubts: what is to be said of the files."""

    status: Status
    time: Array
    indentation: Array
    force: Array
    map: Map | None
    doubts: tuple[str, ...] = ()

    @property
    def over(self) -> bool:
        """Whether nothing more is to come."""
        waits = self.status.state == EMPTY and self.status.why == NOT_YET
        return self.status.state != RUNNING and not waits


class GrowingCurve:
    """The rows of a curve, of which each `update` reads what has been added. rows: TITLES, (rows,) each."""

    def __init__(self, path: Path):
        self.path = path
        self.forget()

    def forget(self) -> None:
        """Begins anew."""
        self.offset, self.strange = 0, 0
        self.places: list[int] = []
        self.last = b""
        self.rows: list[list[float]] = [[] for _ in TITLES]

    def update(self) -> None:
        """Reads what is new; from the start where the run was taken back to a checkpoint. ResultError if it can't be."""
        try:
            with open(self.path, "rb") as file:
                if os.fstat(file.fileno()).st_size < self.offset or not self._continues(file):
                    self.forget()
                    file.seek(0)
                found = file.read()
        except FileNotFoundError:
            self.forget()
            return
        except OSError as problem:
            raise ResultError(f"{self.path}: could not be read: {reason(problem)}") from problem
        # A line without its end is still being written.
        whole = found[: found.rfind(b"\n") + 1]
        for line in whole.splitlines(keepends=True):
            self._take(line)
        self.offset += len(whole)

    def _continues(self, file: IO[bytes]) -> bool:
        """Whether the last line that was read is still there: what a run writes after it was taken back may be as long."""
        file.seek(max(self.offset - len(self.last), 0))
        return file.read(len(self.last)) == self.last

    def _take(self, line: bytes) -> None:
        self.last = line
        cells = line.decode("utf-8", "replace").rstrip("\r\n").split(",")
        if not self.places:
            if not set(TITLES) <= set(cells):
                raise ResultError(f"{self.path}: not a curve of a run: its columns are not {', '.join(CURVE.titles)}")
            self.places = [cells.index(title) for title in TITLES]
            return
        try:
            values = [float(cells[place]) for place in self.places]
        except (IndexError, ValueError):
            self.strange += 1
            return
        for column, value in zip(self.rows, values, strict=True):
            column.append(value)


class View:
    """A run in a folder, looked at again and again. side: the most pixels of a side of its map; coarse: whether a pixel shows
    the closest of its points, not what most of them are."""

    def __init__(self, directory: Path, side: int, coarse: bool = False):
        self.directory, self.side, self.coarse = directory, side, coarse
        self.curve = GrowingCurve(directory / CURVE_FILE)
        self.map: Map | None = None
        self.seen: tuple[int, int] | None = None

    def look(self) -> Glimpse:
        """What there is now. ResultError if it is no results folder, or a file can't be read for good."""
        # First, so that what a run wrote before it ended is read afterwards.
        status = status_of(self.directory)
        self.curve.update()
        self._look_at_map()
        doubts = list(status.warnings)
        if self.curve.strange:
            doubts.append(f"{self.curve.strange} lines of {CURVE_FILE} are no rows: `pgfmd verify` it")
        time, indentation, force = (np.array(column) for column in self.curve.rows)
        return Glimpse(status, time, indentation, force, self.map, tuple(doubts))

    def _look_at_map(self) -> None:
        """Reads the newest map if there is another one than before."""
        path = self.directory / FIELDS_FILE
        writing = path.with_name(path.name + UNDO_SUFFIX)
        try:
            about = path.stat()
            mark = (about.st_size, about.st_mtime_ns)
            if mark == self.seen or writing.exists():
                return
            found = self._newest()
            # A snapshot that was begun meanwhile may have been read in part.
            after = path.stat()
            if not writing.exists() and mark == (after.st_size, after.st_mtime_ns):
                self.map, self.seen = found, mark
        except FileNotFoundError:
            self.map = self.seen = None
        except (ResultError, OSError, ValueError, KeyError, IndexError):
            # It is just being written, or lost with its run: `pgfmd verify` tells, and the next look tries again.
            return

    def _newest(self) -> Map | None:
        with load(self.directory) as results:
            labels = results.labels
            if not labels:
                return None
            classes = gap_classes(results.contact_gap, results.near_gap, results.counts_overlap)
            numbers = class_numbers(results.frame("gap", -1), classes)
            factor = max(1, -(-len(numbers) // self.side))
            time = float(np.asarray(results.fields["time"][len(labels) - 1]))
            small = closest(numbers, factor) if self.coarse else commonest(numbers, factor, len(classes))
            return Map(small[::-1], classes, labels[-1], time)


def heading(status: Status) -> str:
    """Title and folder of a run in a line."""
    return f"{status.title}  ({status.folder})" if status.title else status.folder


def line_of(status: Status) -> str:
    """How a run stands, in a line."""
    parts = [status.state if not status.why else f"{status.state} ({status.why})"]
    if status.phase and status.state == RUNNING:
        parts.append(status.phase)
    if status.time_s is not None:
        parts.append(f"t {status.time_s:.4g} s")
    if status.displacement_m is not None:
        parts.append(f"indentation {-1e6 * status.displacement_m + 0.0:.4f} um")
    if status.force_N is not None:
        parts.append(f"force {1e3 * status.force_N + 0.0:.4f} mN")
    if status.steps is not None:
        rate = "" if not status.steps_per_s or status.state != RUNNING else f", {status.steps_per_s:.1f}/s"
        parts.append(f"{status.steps} steps{rate}")
    return "  ".join([*parts, *left_of(status)])


def left_of(status: Status) -> list[str]:
    """How much of the way is done, and the time that is left, in words, as far as that is known."""
    if status.state != RUNNING:
        return []
    parts = [] if status.progress is None else [f"{100 * status.progress:.0f} % of the way"]
    if status.left_s is not None:
        from pgfmd.reporting.wording import seconds

        parts.append(
            f"about {seconds(status.left_s)} left" + (f" ({status.left_remark})" if status.left_remark else "")
        )
    elif status.left_remark:
        parts.append(status.left_remark)
    return parts
