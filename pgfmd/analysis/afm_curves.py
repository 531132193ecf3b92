"""Force curves of atomic force microscopes and indenters in their own formats, by afmformats (the extra `formats`)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from pgfmd.errors import MeasurementError
from pgfmd.results.curve import Array
from pgfmd.units import handy_quantity

from .measured_columns import Rows

PLACES = ("height (measured)", "height (piezo)")
"""Columns of afmformats with the position of the piezo [m], the better one first. Heights grow outwards."""
T = TypeVar("T")
CURE = "export the curve as a table with columns such as piezo (um), force (nN)"


def rows_of_afm(path: Path, positive_displacement: str | None, positive_force: str) -> Rows:
    """The rows of the only curve of a file: position of the piezo (not of the tip) and force.

    The positions include the compliance of the cantilever, as those of a machine do. Raises MeasurementError for files
    that afmformats doesn't know,
    that hold several curves or lack a calibration, and where afmformats is not installed.
    """
    try:
        import afmformats
    except ImportError:
        raise MeasurementError(
            f"{path}: a file of a kind that only afmformats can read, which is not installed: pip install 'pgfmd[formats]', "
            f"or {CURE}"
        ) from None
    if path.suffix.lower() not in afmformats.supported_extensions:
        raise MeasurementError(f"{path}: a kind of file that is not known; {CURE}, with the end .csv or .txt")
    if not path.is_file():
        raise MeasurementError(f"{path}: could not be read: no such file")
    curves = _tried(path, lambda: afmformats.load_data(path))
    if len(curves) != 1:
        raise MeasurementError(
            f"{path}: expected one curve, found {len(curves)}; export the one that is meant, or {CURE}"
        )
    return _rows(path, curves[0], positive_displacement, positive_force)


def _rows(path: Path, curve: Any, positive_displacement: str | None, positive_force: str) -> Rows:
    columns = set(curve.columns)
    places = [name for name in PLACES if name in columns]
    if not places or "force" not in columns:
        raise MeasurementError(
            f"{path}: expected a force and a piezo's position, found {', '.join(sorted(columns))}; calibrate the cantilever "
            f"(sensitivity and spring constant), or {CURE}"
        )
    force = _column(path, curve, "force")
    place, position = _position(path, curve, places)
    time = _column(path, curve, "time") if "time" in columns else np.full(len(force), np.nan)
    if not len(position) == len(force) == len(time):
        raise MeasurementError(f"{path}: expected as many numbers in each column, found others; {CURE}")
    if np.any(np.diff(time) < 0.0):
        time = np.full(len(force), np.nan)
    rows = Rows(path, position, force, time, np.arange(1, len(force) + 1))
    stiffness = curve.metadata.get("spring constant")
    if stiffness:
        rows.remarks.append(
            f"{path.name}: '{place}' of the piezo; the cantilever's compliance is taken off by --machine-stiffness "
            f'"{handy_quantity(stiffness, "stiffness")}"'
        )
    return rows.taken("gap", positive_displacement, positive_force)


def _position(path: Path, curve: Any, places: list[str]) -> tuple[str, Array]:
    """The first of some columns that can be read, and its numbers. For JPK files, afmformats also lists columns that
    the file does not have."""
    for place in places[:-1]:
        try:
            return place, _column(path, curve, place)
        except _Lacking:
            continue
    return places[-1], _column(path, curve, places[-1])


def _column(path: Path, curve: Any, name: str) -> Array:
    return _tried(path, lambda: np.asarray(curve[name], dtype=float))


class _Lacking(MeasurementError):
    """Errors of afmformats for a file that is complete, but not as it expects."""


def _tried(path: Path, read: Callable[[], T]) -> T:
    """The curves that afmformats reads. MeasurementError for anything that it raises: for damaged files it passes on
    errors of zip, HDF5 and others, and its own errors are not derived from Exception."""
    try:
        return read()
    except Exception as error:
        raise MeasurementError(f"{path}: afmformats can't read it ({_words(error)}); {CURE}") from None
    except BaseException as error:
        if not type(error).__module__.startswith("afmformats."):
            raise
        raise _Lacking(f"{path}: afmformats can't read it ({_words(error)}); {CURE}") from None


def _words(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
