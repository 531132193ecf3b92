"""Force curves of atomic force microscopes and indenters in their own formats, by afmformats (the extra `formats`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.errors import MeasurementError
from pgfmd.units import handy_quantity

from .measured_columns import Rows

PLACES = ("height (measured)", "height (piezo)")
"""Columns of afmformats that say the piezo's position [m], the better one first; heights grow outwards."""
CURE = "export the curve as a table with columns such as piezo (um), force (nN)"


def rows_of_afm(path: Path, positive_displacement: str | None, positive_force: str) -> Rows:
    """The rows of the only curve of a file: piezo's position, not the tip's, and force.

    The cantilever's compliance is in it, as a machine's is. Raises MeasurementError for files that afmformats doesn't know,
    that hold several curves or lack a calibration, and where afmformats is not installed.
    """
    try:
        import afmformats
        import afmformats.errors
    except ImportError:
        raise MeasurementError(
            f"{path}: a file of a kind that only afmformats can read, which is not installed: pip install 'pgfmd[formats]', "
            f"or {CURE}"
        ) from None
    if path.suffix.lower() not in afmformats.supported_extensions:
        raise MeasurementError(f"{path}: a kind of file that is not known; {CURE}, with the end .csv or .txt")
    if not path.is_file():
        raise MeasurementError(f"{path}: could not be read: no such file")
    try:
        curves = afmformats.load_data(path)
    except (
        # Which are no Exceptions.
        afmformats.errors.AFMFileFormatError,
        afmformats.errors.MissingMetaDataError,
        OSError, ValueError, KeyError, IndexError, AttributeError,
    ) as error:  # fmt: skip
        raise MeasurementError(f"{path}: afmformats can't read it ({error}); {CURE}") from None
    if len(curves) != 1:
        raise MeasurementError(
            f"{path}: expected one curve, found {len(curves)}; export the one that is meant, or {CURE}"
        )
    return _rows(path, curves[0], positive_displacement, positive_force)


def _rows(path: Path, curve: Any, positive_displacement: str | None, positive_force: str) -> Rows:
    columns = set(curve.columns)
    place = next((name for name in PLACES if name in columns), None)
    if place is None or "force" not in columns:
        raise MeasurementError(
            f"{path}: expected a force and a piezo's position, found {', '.join(sorted(columns))}; calibrate the cantilever "
            f"(sensitivity and spring constant), or {CURE}"
        )
    position, force = (np.asarray(curve[name], dtype=float) for name in (place, "force"))
    time = np.asarray(curve["time"], dtype=float) if "time" in columns else np.full(len(force), np.nan)
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
