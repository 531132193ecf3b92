"""Reading tables, snapshots, record and scene of a run. No MPI; works while the run is going on."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.files.storage import (
    CURVE_FILE,
    FIELDS_FILE,
    RUN_FILE,
    SCENE_FILE,
    UNDO_SUFFIX,
    reason,
    require_record,
    require_regular_files,
)
from pgfmd.files.table_reading import NUMPY_TYPES, is_earlier, read_columns
from pgfmd.files.tables import CURVE, ENERGY, EVENTS, PATCHES, SITES, Table
from pgfmd.physics.adhesion.registry import DEFAULT_LAW, LAWS
from pgfmd.units import parse_quantity

QUANTITIES = {"work_of_adhesion": "energy per area", "range": "length", "overlap_stiffness": "stiffness per area"}
"""Keys of [adhesion] that a law is made from, with their dimensions."""


def load(directory: str | Path) -> Results:
    """The results in a folder.

    Args:
        directory: where a run wrote, or is still writing, its results.

    Raises:
        ResultError: if it is not a results folder; on first use of a part, if this part is missing or damaged.
    """
    directory = Path(directory)
    require_folder(directory)
    try:
        require_regular_files(directory, links=True)
    except OSError as problem:
        raise ResultError(f"{directory}: could not be read: {problem.strerror}") from problem
    if not (directory / CURVE_FILE).is_file():
        cure = "name the folder that a run wrote to"
        raise ResultError(f"{directory}: not a results folder, it has no {CURVE_FILE}; {cure}")
    return Results(directory)


@contextmanager
def opened(run: Run) -> Iterator[Results]:
    """The results of a run: those of a folder are closed afterwards, those that are given stay as they are.

    Raises ResultError, as `load` does.
    """
    if isinstance(run, Results):
        yield run
        return
    with load(run) as results:
        yield results


def runs_in(path: str | Path) -> list[Path]:
    """The results folder itself, or the results folders in the folder of a study, by name.

    Raises:
        ResultError: if there is none.
    """
    path = Path(path)
    require_folder(path)
    # Whatever it is: who reads it refuses what is no file.
    if os.path.lexists(path / CURVE_FILE):
        return [path]
    found = sorted(folder.parent for folder in path.glob(f"*/{CURVE_FILE}"))
    if not found:
        raise ResultError(
            f"{path}: neither a results folder nor the folder of a study: no {CURVE_FILE} in it, or below it"
        )
    return found


def require_folder(path: Path) -> None:
    """Raises ResultError if a path is not a folder."""
    if not path.is_dir():
        raise ResultError(f"{path}: {'a file, not a results folder' if path.exists() else 'no such folder'}")


class Results:
    """The results of one run. Each part is read at its first use. SI units.

    Snapshots stay open until `close()`; also a context manager. To see what a live run has added, `load` again.
    """

    def __init__(self, directory: Path):
        self.directory = directory

    def __repr__(self) -> str:
        return f"Results({str(self.directory)!r})"

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @cached_property
    def curve(self) -> Any:
        """`curve.csv`: a pandas DataFrame, or without pandas a structured array; columns as in the file's header.

        For runs of version 0.1, `overlap_area` and `near_area` are NaN.
        """
        return _table(self.directory, CURVE)

    @cached_property
    def counts_overlap(self) -> bool:
        """Whether contact means overlap (a negative gap), as in runs of version 0.1.

        contact_area, patches, sites and the time to the preload of such a run do not include points under tension.
        False for a purely repulsive law, for which both definitions are the same.
        """
        path = self.directory / CURVE_FILE
        try:
            earlier = is_earlier(path)
        except OSError as problem:
            raise ResultError(f"{path}: could not be read: {reason(problem)}") from problem
        law = LAWS.get(str(self._adhesion.get("law")))
        return earlier and (law is None or law.attractive)

    @property
    def contact_gap(self) -> float:
        """The gap [m] below which a point is in contact in this run; 0 if it `counts_overlap`."""
        if self.counts_overlap:
            return 0.0
        if "contact_gap_m" in self.run:
            return float(self.run["contact_gap_m"])
        # A run that is going on has no record yet.
        law = LAWS.get(str(self._adhesion.get("law", DEFAULT_LAW)))
        if law is None or "range" not in self._adhesion:
            return 0.0
        given: dict[str, Any] = {name: self._adhesion.get(name) for name in ("smoothing", "file")}
        for name, dimension in QUANTITIES.items():
            text = self._adhesion.get(name)
            given[name] = None if text is None else parse_quantity(text, dimension)
        try:
            return law.of(SimpleNamespace(**given)).contact_gap
        except (OSError, ValueError) as problem:
            raise ResultError(
                f"{self.directory / SCENE_FILE}: its law of adhesion can't be told: {problem}"
            ) from problem

    @property
    def near_gap(self) -> float:
        """The gap [m] below which a point is near, that is, looks closed in an optical image."""
        from pgfmd.scene.output_section import NEAR_GAP

        given = self.scene.get("output", {}).get("near_gap")
        return NEAR_GAP if given is None else parse_quantity(given, "length")

    @property
    def _adhesion(self) -> dict:
        return self.scene.get("adhesion", {})

    @cached_property
    def energy(self) -> Any | None:
        """`energy.csv`, like `curve`; None without an energy audit."""
        return self._table_if_there(ENERGY)

    @cached_property
    def events(self) -> Any | None:
        """`events.csv`: preload, jumps, the end, like `curve`; None if there is none yet."""
        return self._table_if_there(EVENTS)

    @cached_property
    def patches(self) -> Any | None:
        """`patches.csv`: the contact patches of every snapshot, like `curve`; None if there are none."""
        return self._table_if_there(PATCHES)

    @cached_property
    def sites(self) -> Any | None:
        """`sites.csv`: summits, saddles and valleys that join or leave the contact, like `curve`; None if there is
        none."""
        return self._table_if_there(SITES)

    def _table_if_there(self, table: Table) -> Any | None:
        return _table(self.directory, table) if (self.directory / table.file).exists() else None

    @cached_property
    def run(self) -> dict:
        """`run.json`: how the run was made and how it ended; empty until it is written."""
        path = self.directory / RUN_FILE
        if not path.exists():
            return {}
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as problem:
            raise ResultError(f"{path}: could not be read: {problem}") from problem
        return require_record(path, found)

    @cached_property
    def scene(self) -> dict:
        """`scene.resolved.toml`: every setting of the run, defaults included."""
        path = self.directory / SCENE_FILE
        try:
            return tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as problem:
            raise ResultError(f"{path}: could not be read: {problem}") from problem

    @property
    def has_fields(self) -> bool:
        """Whether there is a file with snapshots."""
        return (self.directory / FIELDS_FILE).exists()

    @cached_property
    def fields(self) -> Any:
        """`fields.h5`: an xarray Dataset, or without xarray and h5netcdf a mapping of arrays; both read lazily."""
        path = self.directory / FIELDS_FILE
        if not path.exists():
            raise ResultError(f"{path}: missing, the run has written no snapshots")
        try:
            return _open_fields(path)
        except (OSError, KeyError, ValueError) as problem:
            hint = "try again in a moment if the run is going on; if it was killed, its next start repairs the file"
            cure = hint if path.with_name(path.name + UNDO_SUFFIX).exists() else "the file is damaged"
            raise ResultError(f"{path}: could not be read: {problem}; {cure}") from problem

    @property
    def labels(self) -> list[str]:
        """The snapshots' labels, in order; empty without snapshots."""
        return [str(label) for label in np.asarray(self.fields["label"][:])] if self.has_fields else []

    def frame(self, name: str, snapshot: int) -> np.ndarray:
        """One array of one snapshot, (rows, columns) over y and x; NaN outside the punch.

        Args:
            name: "gap" [m], "traction" [Pa], "displacement" [m] or "surface_displacement" [m].
            snapshot: its number, from 0; negative counts from the end.

        Raises:
            ResultError: if there is no such array or snapshot.
        """
        fields = self.fields
        if name not in fields:
            raise ResultError(f"{self.directory / FIELDS_FILE}: has no array {name!r}")
        count = len(fields["snapshot"])
        if not -count <= snapshot < count:
            raise ResultError(f"{self.directory / FIELDS_FILE}: has {count} snapshots, no number {snapshot}")
        return np.asarray(fields[name][snapshot % count])

    def close(self) -> None:
        """Closes the file of snapshots; using `fields` opens it again."""
        fields = self.__dict__.pop("fields", None)
        if fields is not None:
            fields.close()


Run = Results | str | Path
"""A run, as functions take it: its results, also those of a simulation in memory, or its folder."""


class FieldsMapping(Mapping):
    """`fields.h5` without xarray: name -> array on disk, read where it is indexed, labels as texts; `units[name]` gives
    the units, `attrs[name]` an attribute of the file."""

    def __init__(self, path: Path):
        import h5py

        from pgfmd.files.fields_layout import variables

        self._file = h5py.File(path, "r", locking=False)
        self._names, self.attrs = variables(self._file), dict(self._file.attrs)
        arrays = {name: self._file[name] for name in self._names}
        self.units = {name: array.attrs["units"] for name, array in arrays.items() if "units" in array.attrs}

    def __getitem__(self, name: str) -> Any:
        if name not in self._names:
            raise KeyError(name)
        if name != "label":
            return self._file[name]
        from pgfmd.files.fields_layout import label_of

        labels = self._file[name]
        texts = [label_of(labels, frame).decode(errors="replace") for frame in range(len(labels))]
        return np.array(texts, dtype=object)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def close(self) -> None:
        """Close the file; its arrays can't be read any more."""
        self._file.close()


def _open_fields(path: Path) -> Any:
    try:
        import h5netcdf  # noqa: F401
        import xarray
    except ImportError:
        return FieldsMapping(path)
    return xarray.open_dataset(path, engine="h5netcdf")


def _table(directory: Path, table: Table) -> Any:
    """A table of the run, without an incomplete last line of a live run."""
    return table_of(read_columns(directory / table.file, table), table)


def table_of(found: dict[str, np.ndarray], table: Table) -> Any:
    """Columns, by what the header calls them, as a pandas DataFrame, or without pandas as a structured array. Takes the
    arrays over."""
    try:
        import pandas
    except ImportError:
        rows = np.empty(
            len(found[table.titles[0]]), [(entry.title, NUMPY_TYPES[entry.kind]) for entry in table.columns]
        )
        for title in table.titles:
            rows[title] = found.pop(title)
        return rows
    # Not copied: a long table would be there twice.
    return pandas.DataFrame(found, copy=False)
