"""Which reader a file with heights asks for.

By itself pgfmd reads text, arrays of NumPy, netCDF and HDF5; all else is left to SurfaceTopography, an extra of the
installation, in a process of its own (worker.py).
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from pgfmd.errors import MeasurementError

from .arrays import read_netcdf, read_npy, read_npz
from .raw import RawMap
from .text import read_text_map

TEXT = (".csv", ".txt", ".xyz", ".asc", ".dat", ".tsv", ".prn")
ARRAYS = (".nc", ".nc4", ".cdf", ".h5", ".hdf5", ".hdf")
NO_MAPS = (".png", ".jpg", ".jpeg", ".gif", ".bmp", ".tif", ".tiff", ".pdf", ".stl", ".obj", ".ply")
"""Pictures, whose colours are no heights, and bodies."""
_READERS = (
    {".npy": read_npy, ".npz": read_npz} | dict.fromkeys(TEXT, read_text_map) | dict.fromkeys(ARRAYS, read_netcdf)
)


def read_map(path: str | Path) -> RawMap:
    """The map of a file, as it is there. Raises ValueError, which names the file and the reason; OSError."""
    path = Path(path)
    reader = _READERS.get(path.suffix.lower(), _read_instrument)
    try:
        return reader(path)
    except OSError:
        raise
    except MemoryError:
        raise ValueError(f"{path}: does not fit into memory, or is damaged") from None
    except MeasurementError as error:
        # It names the file, and the line.
        raise ValueError(str(error)) from error
    except Exception as error:
        # A damaged file makes numpy, zipfile and zlib raise whatever they like, EOFError and KeyError among them.
        raise ValueError(f"{path}: {error or 'damaged'}") from error


def _read_instrument(path: Path) -> RawMap:
    with open(path, "rb"):
        pass
    if path.suffix.lower() in NO_MAPS:
        raise ValueError(
            "unknown kind of file: neither a picture nor a body is a height map; export the heights, as text or .npy"
        )
    if find_spec("SurfaceTopography") is None:
        own = ", ".join(_READERS)
        raise ValueError(
            f"unknown kind of file without SurfaceTopography: pgfmd itself reads {own}. Instruments' own formats need "
            "pip install 'pgfmd[formats]'; or export the map as text"
        )
    # Not at the top: only such maps start another process.
    from .worker import elsewhere

    return elsewhere("instrument", path)
