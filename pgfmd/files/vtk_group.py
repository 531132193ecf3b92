"""The group `/VTKHDF` of `fields.h5`, by which ParaView and VTK (from 9.4 on) read its snapshots as images over time.

Format: https://docs.vtk.org/en/latest/vtk_file_formats/vtkhdf_file_format. The group has no arrays of its own, only links to
those at the root, so it grows and is cut back with them. Its own are the number of steps, their times, and which snapshot each
is: VTK needs them in the order of time, and the snapshot of the largest tension is written last. No MPI.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import h5py
import numpy as np

if TYPE_CHECKING:
    from .fields_layout import Layout

GROUP = "VTKHDF"
NUMBERS_SHOWN = ("force", "punch_position")
"""Numbers of a snapshot that are shown with it, as data of the field."""
CHUNK = 64
"""Steps for which room is made at once."""


def add(file: h5py.File, layout: Layout) -> None:
    """Adds the group to a file, with the snapshots that are in it.

    VTK has one grid for all arrays. If the file holds the surface of the whole cell, this is the cell's, and the arrays of
    the punch's block are virtual: their values stay where they are, and all around is NaN.
    """
    group = file.create_group(GROUP)
    side = "x_cell" if layout.surface else "x"
    start, count = layout.axes[side][0], len(layout.axes[side])
    spacing = layout.length / layout.n
    group.attrs["Version"] = np.array([2, 0])
    # VTK reads text of fixed length only.
    group.attrs["Type"] = np.bytes_("ImageData")
    group.attrs["WholeExtent"] = np.array([0, count - 1, 0, count - 1, 0, 0])
    group.attrs["Origin"] = np.array([start, start, 0.0])
    group.attrs["Spacing"] = np.full(3, spacing)
    group.attrs["Direction"] = np.eye(3).ravel()
    points, numbers = group.create_group("PointData"), group.create_group("FieldData")
    for name in NUMBERS_SHOWN:
        numbers[name] = _link(name)
    for name, (_, _, points_a_side, _) in layout.arrays.items():
        if points_a_side == count:
            points[name] = _link(name)
        else:
            _add_virtual(file, points, name, layout)
    steps = group.create_group("Steps")
    steps.attrs["NSteps"] = 0
    order = _growing(steps, "Order", "i8")
    # A dimension of its own, for readers of netCDF.
    order.make_scale("Order")
    _growing(steps, "Values", "f8").dims[0].attach_scale(order)
    for shown, offsets in ((points, "PointDataOffsets"), (numbers, "FieldDataOffsets")):
        places = steps.create_group(offsets)
        for name in shown:
            places[name] = h5py.SoftLink(order.name)
    update(file)


def update(file: h5py.File) -> None:
    """Brings the steps to the snapshots that there are, if the file has the group."""
    if GROUP not in file:
        return
    steps, times = file[GROUP]["Steps"], file["time"][:]
    order = np.argsort(times, kind="stable")
    for name, values in (("Order", order), ("Values", times[order])):
        steps[name].resize(len(times), axis=0)
        steps[name][:] = values
    steps.attrs.modify("NSteps", len(times))


def _growing(group: h5py.Group, name: str, dtype: str) -> h5py.Dataset:
    return group.create_dataset(name, (0,), dtype, maxshape=(None,), chunks=(CHUNK,))


def _link(name: str) -> h5py.SoftLink:
    """A link by name. With a second hard link, HDF5 may call a dimension by it, and h5netcdf no longer finds it."""
    return h5py.SoftLink(f"/{name}")


def _add_virtual(file: h5py.File, group: h5py.Group, name: str, layout: Layout) -> None:
    """An array over the whole cell that shows that of the block, for any number of snapshots."""
    n, nb, start, endless = layout.n, layout.nb, layout.block_start, h5py.h5s.UNLIMITED
    # With one snapshot to begin with, whatever there is: an array of none does not grow with its source.
    whole = h5py.VirtualLayout((1, n, n), "f8", maxshape=(None, n, n))
    block = h5py.VirtualSource(".", f"/{name}", (1, nb, nb), "f8", maxshape=(None, nb, nb))
    inside = slice(start, start + nb)
    whole[0:endless, inside, inside] = block[0:endless, :, :]
    # Like all other variables: the same run gives the same bytes.
    whole.dcpl.set_obj_track_times(False)
    array = group.create_virtual_dataset(name, whole, fillvalue=np.nan)
    array.attrs.update({key: file[name].attrs[key] for key in ("units", "long_name", "_FillValue")})
    for dimension, axis in enumerate(("snapshot", "y_cell", "x_cell")):
        array.dims[dimension].attach_scale(file[axis])
