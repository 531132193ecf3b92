"""Height maps in files of arrays: .npy and .npz of NumPy, netCDF and HDF5."""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import raw as limits
from .raw import METRE, Array, Peaks, RawMap, Unit, unit_of

HEIGHTS = ("z", "heights", "height", "topography", "elevation", "surface", "map", "h", "data")
"""Names of a variable with heights, the likeliest first."""
UNEVEN = 0.02
"""Relative differences of the steps of a coordinate that rounding explains."""


def read_npy(path: Path) -> RawMap:
    """The array of a .npy file; a large one stays on the disk, as all ranks of a node share what they read of it."""
    if path.stat().st_size > 8 * limits.WHOLE:
        return RawMap(np.load(path, mmap_mode="r", allow_pickle=False), "an array")
    with open(path, "rb") as file:
        # numpy.load would take an empty file for a pickle that has ended.
        return RawMap(np.lib.format.read_array(file, allow_pickle=False), "an array")


def read_npz(path: Path) -> RawMap:
    """The array `z` of a .npz file; `size` (x, y) [m], `unit` and `peaks`, where it has them."""
    if not zipfile.is_zipfile(path):
        raise ValueError("expected a whole archive of arrays, as numpy.savez writes it")
    # Opened here, as numpy leaves a damaged one open.
    with open(path, "rb") as file, np.load(file, allow_pickle=False) as archive:
        if "z" not in archive:
            raise ValueError(f"holds {', '.join(archive.files) or 'nothing'}, expected an array named z")
        size = archive.get("size")
        if size is not None and size.shape != (2,):
            raise ValueError(f"size has the shape {size.shape}, expected (size_x, size_y)")
        unit, odd_unit = _unit(_word(archive["unit"])) if "unit" in archive else (None, "")
        peaks = _peaks(_word(archive["peaks"])) if "peaks" in archive else None
        sides = None if size is None else (float(size[0]), float(size[1]))
        return RawMap(archive["z"], "an array", unit, odd_unit, sides, METRE, peaks)


def _word(stored: Array) -> str:
    return str(stored.item()) if stored.size == 1 else ""


def _unit(text: str) -> tuple[Unit | None, str]:
    """A unit of length; or none, and what there is instead."""
    try:
        return (unit_of(text), "") if text.strip() else (None, "")
    except ValueError:
        return None, text.strip()


def _peaks(text: str) -> Peaks | None:
    found: dict[str, Peaks] = {"up": "up", "down": "down"}
    return found.get(text)


@dataclass(frozen=True, eq=False)
class Variable:
    """An array with names: name; values; axes, the names of its dimensions, "" where they have none; attributes, texts
    and numbers."""

    name: str
    values: Any
    axes: tuple[str, ...]
    attributes: Mapping[str, Any]


def read_netcdf(path: Path) -> RawMap:
    """The heights of a netCDF or HDF5 file, with sizes and units from its coordinates."""
    with open(path, "rb") as file:
        start = file.read(8)
    if start.startswith(b"CDF"):
        return _of_variables(*_classic(path))
    if start.startswith(b"\x89HDF"):
        return _of_variables(*_hdf5(path))
    raise ValueError("is neither a netCDF nor an HDF5 file")


def _classic(path: Path) -> tuple[list[Variable], Mapping[str, Any]]:
    """Variables and attributes of a file in the classic format of netCDF."""
    # Not at the top, here and below: only such maps need them.
    from scipy.io import netcdf_file

    with netcdf_file(path, "r", mmap=False) as file:
        variables = [
            Variable(name, np.array(found[...]), tuple(found.dimensions), _plain(found._attributes))
            for name, found in file.variables.items()
        ]
        return variables, _plain(file._attributes)


def _hdf5(path: Path) -> tuple[list[Variable], Mapping[str, Any]]:
    """Arrays and attributes of an HDF5 file. Where h5py is not loaded yet, that is left to another process (worker.py)."""
    if "h5py" in sys.modules:
        return hdf5_variables(path)
    from .worker import elsewhere

    return elsewhere("hdf5", path)


def hdf5_variables(path: Path) -> tuple[list[Variable], Mapping[str, Any]]:
    """Arrays of one and two dimensions in an HDF5 file, in whatever group; attributes of the file."""
    import h5py

    variables: list[Variable] = []

    def add(name: str, found: Any) -> None:
        if isinstance(found, h5py.Dataset) and found.ndim in (1, 2) and found.dtype.kind in "iufb":
            axes = tuple(next((scale.name.rpartition("/")[2] for scale in axis.values()), "") for axis in found.dims)
            variables.append(Variable(name, found[...], axes, _plain(found.attrs)))

    with h5py.File(path, "r", locking=False) as file:
        file.visititems(add)
        return variables, _plain(file.attrs)


def _plain(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes as texts and numbers."""
    found = {}
    for name, value in attributes.items():
        value = np.asarray(value)
        if value.size == 1 and value.dtype.kind in "iufbSUO":
            item = value.item()
            found[name] = item.decode("utf-8", "replace") if isinstance(item, bytes) else item
    return found


def _of_variables(variables: list[Variable], attributes: Mapping[str, Any]) -> RawMap:
    heights = _heights_among(variables)
    own = heights.attributes
    values = _scaled(heights)
    mask = next((other for other in variables if other.name == "mask" and other.values.shape == values.shape), None)
    if mask is not None:
        values = np.where(mask.values.astype(bool), np.nan, values)
    along_y, along_x = heights.axes
    if _is(along_y, "x") and _is(along_x, "y"):
        values, along_y, along_x = values.T, along_x, along_y
    sides: list[float | None] = []
    units: set[Unit | None] = set()
    for axis, name in ((1, along_x), (0, along_y)):
        line = next((other for other in variables if other.name == name and other.values.ndim == 1), None)
        side, falls = _side(line, values.shape[axis])
        values = np.flip(values, axis) if falls else values
        sides.append(side)
        unit = _unit(_unit_text(line.attributes))[0] if line is not None else None
        if side is not None:
            units.add(unit)
    unit, odd_unit = _unit(_unit_text(own))
    size = None if sides[0] is None or sides[1] is None else (sides[0], sides[1])
    peaks = _peaks(str(own.get("peaks", attributes.get("peaks", ""))))
    if len({found.metres for found in units if found}) > 1:
        raise ValueError("x and y have different units: give both the same in the file")
    return RawMap(
        values,
        f"the variable {heights.name}",
        unit,
        odd_unit,
        size,
        None if None in units else next(iter(units), None),
        peaks,
    )


def _is(name: str, axis: str) -> bool:
    return name.lower().startswith(axis)


def _heights_among(variables: list[Variable]) -> Variable:
    maps = [found for found in variables if found.values.ndim == 2 and min(found.values.shape) > 1
            and found.name != "mask"]  # fmt: skip
    for name in HEIGHTS:
        named = [found for found in maps if found.name.rpartition("/")[2].lower() == name]
        if len(named) == 1:
            return named[0]
    if len(maps) != 1:
        names = ", ".join(found.name for found in maps) or "no array of two dimensions"
        raise ValueError(f"holds {names}; expected one array of two dimensions, or one named {', '.join(HEIGHTS[:3])}")
    return maps[0]


def _unit_text(attributes: Mapping[str, Any]) -> str:
    return next((str(attributes[name]) for name in ("units", "unit", "Unit", "Units") if name in attributes), "")


def _scaled(variable: Variable) -> Array:
    """Values as the attributes of their scale tell, the missing ones as NaN."""
    own = variable.attributes
    codes = tuple(
        float(own[name]) for name in ("_FillValue", "missing_value") if isinstance(own.get(name), int | float)
    )
    factor, offset = (own.get(name, plain) for name, plain in (("scale_factor", 1.0), ("add_offset", 0.0)))
    values = variable.values
    gone = np.isin(values, codes)
    if gone.any() or (factor, offset) != (1.0, 0.0):
        values = np.where(gone, np.nan, values * float(factor) + float(offset))
    return values


def _side(line: Variable | None, count: int) -> tuple[float | None, bool]:
    """Size of a map along a coordinate in its own unit, half pixels at its ends included; and whether it falls."""
    if line is None or line.values.shape != (count,):
        return None, False
    place = np.asarray(line.values, float)
    length = line.attributes.get("length")
    steps = np.diff(place)
    if not np.isfinite(steps).all() or not (np.abs(steps - steps.mean()) <= UNEVEN * np.abs(steps.mean())).all():
        raise ValueError(f"the places along {line.name} are not evenly spaced: interpolate the map to even steps first")
    if steps.mean() == 0.0:
        return None, False
    side = float(length) if isinstance(length, int | float) else abs(float(steps.mean())) * count
    return side, bool(steps.mean() < 0.0)
