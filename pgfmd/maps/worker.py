"""Reading with libraries that load MPI, in a process of its own: instruments' files and HDF5.

SurfaceTopography's NuMPI, and an h5py on parallel HDF5, import mpi4py, which would make a process a part of MPI: a login
node may not allow that, and a child of a rank must not be a second rank. So whoever asks for such a map starts this
module; NuMPI is given none of mpi4py, and mpi4py does not start MPI.
"""

from __future__ import annotations

import importlib
import os
import pickle
import subprocess
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from .raw import Array, RawMap, Unit, unit_of

REFUSED = 3
"""Exit code of a process that tells by its error stream why a file can't be read."""
PATIENCE = 600.0
"""Time [s] after which a reader is given up."""
WITHOUT_MARKS = {"hgt": ".hgt", "nms": ".nms"}
"""Formats without a mark of their own, which any file may seem to be, and the endings of their names."""
EITHER_SENSE = ("asc", "xyz", "npy", "npz", "h5", "nc")
"""Formats that anything may write, and that do not say which way heights grow."""
_PROGRAM = "import sys; sys.path.append(sys.argv.pop(1)); from pgfmd.maps.worker import main; main(*sys.argv[1:])"


def elsewhere(action: str, path: Path) -> Any:
    """What a function of this module, "instrument" or "hdf5", makes of a file, in a process of its own.

    Raises ValueError with the reason why it can't be read.
    """
    package = Path(__file__).parents[2]
    # mpi4py reads this; whoever started us may have told it otherwise.
    surroundings = os.environ | {"MPI4PY_RC_INITIALIZE": "0", "MPI4PY_RC_FINALIZE": "0"}
    with tempfile.TemporaryDirectory(prefix="pgfmd-") as folder:
        out = Path(folder) / "map"
        command = [sys.executable, "-P", "-c", _PROGRAM, str(package), action, str(path), str(out)]
        try:
            done = subprocess.run(
                command, env=surroundings, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
                timeout=PATIENCE, check=False,
            )  # fmt: skip
        except subprocess.TimeoutExpired:
            raise ValueError(f"could not be read within {PATIENCE:.0f} s") from None
        if done.returncode:
            lines = [line for line in done.stderr.splitlines() if line.strip()] or [f"exit code {done.returncode}"]
            raise ValueError("\n".join(lines) if done.returncode == REFUSED else f"could not be read: {lines[-1]}")
        with open(out, "rb") as file:
            return pickle.load(file)


def main(action: str, path: str, out: str) -> None:
    """What the process does: writes what it has found into the file `out`."""
    try:
        found = {"instrument": instrument, "hdf5": hdf5}[action](Path(path))
    except ValueError as error:
        print(error, file=sys.stderr)
        sys.exit(REFUSED)
    with open(out, "wb") as file:
        pickle.dump(found, file, protocol=pickle.HIGHEST_PROTOCOL)


def hdf5(path: Path) -> Any:
    """The variables of an HDF5 file (arrays.py)."""
    from .arrays import hdf5_variables

    return hdf5_variables(path)


def instrument(path: Path) -> RawMap:
    """The default channel of a file that SurfaceTopography knows. ValueError."""
    library = surface_topography()
    try:
        reader = library.open_topography(str(path))
    except Exception as error:
        # A reader of a damaged file raises whatever it likes; the reasons of forty readers help nobody.
        raise ValueError(f"unknown kind of file: SurfaceTopography {library.__version__} can't read it") from error
    with reader:
        name = reader.format()
        if WITHOUT_MARKS.get(name, path.suffix.lower()) != path.suffix.lower():
            raise ValueError(f"unknown kind of file: SurfaceTopography {library.__version__} can't read it")
        if name == "mat":
            # A matrix of MATLAB has no axes.
            raise ValueError("a file of MATLAB does not say which way x goes: save its map as .npy, z[iy, ix]")
        channel = reader.default_channel
        if channel.dim != 2:
            raise ValueError(f"channel {channel.name} is a profile along a line, expected a map")
        sizes = channel.physical_sizes
        try:
            found = reader.topography(channel_index=channel.index, **({} if sizes else {"physical_sizes": (1.0, 1.0)}))
            heights: Array = np.ma.filled(np.ma.asarray(found.heights(), dtype=float), np.nan)
        except Exception as error:
            raise ValueError(f"read as {name}, but its heights can't be: {error or type(error).__name__}") from error
        others = ", ".join(other.name for other in reader.channels if other.index != channel.index)
    unit, odd_unit = _unit_of_heights(channel, found)
    lateral = _length(found.unit if isinstance(found.unit, str) else channel.lateral_unit)
    x, y = found.physical_sizes
    notes = (f"channel {channel.name} is taken; there are also {others}",) if others else ()
    # Its heights are [ix, iy], and those of instruments grow away from the body.
    heights = np.ascontiguousarray(heights.T)
    return RawMap(
        heights,
        f"a file of the format {name}",
        unit,
        odd_unit,
        (float(x), float(y)) if sizes else None,
        lateral,
        None if name in EITHER_SENSE else "up",
        notes=notes,
    )


def surface_topography() -> ModuleType:
    """The library, without MPI where that has not been loaded. ValueError where it can't be imported."""
    try:
        if "NuMPI" not in sys.modules and "mpi4py" not in sys.modules:
            sys.modules["mpi4py"] = None  # type: ignore[assignment]
            try:
                importlib.import_module("NuMPI")
            finally:
                # h5py may need it.
                del sys.modules["mpi4py"]
        return importlib.import_module("SurfaceTopography")
    except ImportError as error:
        raise ValueError(f"SurfaceTopography can't be imported: {error}") from None


def _unit_of_heights(channel: Any, found: Any) -> tuple[Unit | None, str]:
    text = (found.unit or "") if channel.is_height_channel else (channel.data_unit or channel.name)
    if isinstance(text, tuple):
        text = text[-1] or ""
    unit = _length(text)
    return unit, "" if unit else str(text)


def _length(text: str | None) -> Unit | None:
    try:
        return unit_of(text) if text else None
    except ValueError:
        return None
