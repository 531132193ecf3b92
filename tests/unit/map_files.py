"""Height maps in files, as instruments, programs and people write them; all made here, for tests."""

from pathlib import Path

import h5py
import numpy as np
from scipy.io import netcdf_file

RADIUS = 5e-3
COUNT, SIZE = 24, 840e-6


def middles(count, size):
    """Middles of pixels [m] around 0."""
    return ((np.arange(count) + 0.5) / count - 0.5) * size


def sphere(count=COUNT, size=SIZE):
    """Heights [m] of r^2/(2 R), z[iy, ix]."""
    x = middles(count, size)
    return (x**2 + x[:, None] ** 2) / (2 * RADIUS)


def lopsided(rows=20, columns=30, size=(900e-6, 800e-6)):
    """Heights [m] that are unlike their mirror images and their transpose."""
    x, y = middles(columns, size[0]), middles(rows, size[1])[:, None]
    return 1e-6 * (2.0 + np.sin(4e3 * x + 0.3) + 0.6 * np.cos(5e3 * y + 1.0) + 2e6 * x * y)


def matrix(path, z, delimiter=",", fmt="%.9g", head="", comma=False, end="", coding="utf-8"):
    """A matrix in a text file. comma: of decimals; end: behind each row."""
    rows = [delimiter.join(fmt % number for number in row) for row in z]
    text = "\n".join((row.replace(".", ",") if comma else row) + end for row in rows)
    Path(path).write_bytes((head + text + "\n").encode(coding))


def table(path, z, size, head="", delimiter=" ", factors=(1.0, 1.0, 1.0), order=None):
    """x, y and z of all pixels. factors: what the numbers are multiplied by; order: of the rows."""
    x, y = np.meshgrid(middles(z.shape[1], size[0]), middles(z.shape[0], size[1]))
    rows = np.column_stack([x.ravel() * factors[0], y.ravel() * factors[1], z.ravel() * factors[2]])
    rows = rows if order is None else rows[order]
    rows = rows[np.isfinite(rows[:, 2])]
    Path(path).write_text(head + "".join(delimiter.join(f"{number:.9g}" for number in row) + "\n" for row in rows))


def classic(path, z, size, unit="um", factor=1e6, first="y", **attributes):
    """A netCDF file in its classic format. first: the dimension that comes first; with "x" the array is z[ix, iy]."""
    with netcdf_file(path, "w") as file:
        for name, count, side in (("x", z.shape[1], size[0]), ("y", z.shape[0], size[1])):
            file.createDimension(name, count)
            line = file.createVariable(name, "f8", (name,))
            line[:] = np.arange(count) / count * side * factor
            line.length, line.unit = side * factor, unit
        heights = file.createVariable("heights", "f8", ("x", "y") if first == "x" else ("y", "x"))
        heights[:] = (z.T if first == "x" else z) * factor
        heights.unit = unit
        for name, value in attributes.items():
            setattr(heights, name, value)


def hdf5(path, z, size, unit="um", factor=1e6, falling=False):
    """An HDF5 file with dimension scales, as netCDF4 and xarray write it. falling: y falls along the rows."""
    with h5py.File(path, "w") as file:
        places = middles(z.shape[1], size[0]), middles(z.shape[0], size[1])
        file["x"], file["y"] = places[0] * factor, places[1][:: -1 if falling else 1] * factor
        file["z"] = (z[::-1] if falling else z) * factor
        for axis, name in enumerate(("y", "x")):
            file[name].make_scale(name)
            file[name].attrs["units"] = unit
            file["z"].dims[axis].attach_scale(file[name])
        file["z"].attrs["units"] = unit
