"""`fields.h5` in the readers that others use, and files of earlier versions, whose labels are texts of fixed length."""

from __future__ import annotations

import warnings

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.files import fields_layout, vtk_group
from pgfmd.files.fields_layout import SCALAR_CHUNK, Layout
from pgfmd.output.fields_file import FieldsFile
from pgfmd.results.reading import FieldsMapping
from pgfmd.results.verify import _snapshots

NB, LABELS = 6, ["snap-in", "µ" * 40, "", "pull-off γ"]


def open_file(path, surface: bool = False) -> FieldsFile:
    return FieldsFile(path, MPI.COMM_SELF, 2 * NB, 1e-3, 3, NB, 0, NB, np.ones((NB, NB), dtype=bool), surface)


LATE = "largest tension"
"""Is written after snapshots that were taken after it."""


def add(file: FieldsFile, labels: list[str], surface: bool = False) -> None:
    for label in labels:
        arrays = [np.full((NB, NB), k + file.frames) for k in (0.1, 0.2, 0.3)]
        # Every row is another one, and every column.
        arrays[0] += np.arange(NB) / 16 + np.arange(NB)[:, None] / 1024
        whole = (np.arange((2 * NB) ** 2).reshape(2 * NB, 2 * NB) + 1000.0 * file.frames, 0) if surface else None
        time = 0.5 * file.frames - (0.75 if label == LATE else 0.0)
        file.append(label, time, -1e-6 * file.frames, 1e-3 * file.frames, *arrays, surface=whole)


def make_old(path) -> None:
    """An empty file with the labels that earlier versions wrote."""
    layout = Layout(2 * NB, 1e-3, 3, NB)
    fields_layout.create(path, layout)
    with h5py.File(path, "r+") as file:
        del file["label"], file[fields_layout.LABEL_AXIS], file[vtk_group.GROUP]
        text = h5py.string_dtype("utf-8", fields_layout.LABEL_BYTES)
        labels = file.create_dataset("label", (0,), text, maxshape=(None,), chunks=(SCALAR_CHUNK,))
        labels.attrs["_Encoding"] = "utf-8"
        labels.dims[0].attach_scale(file["snapshot"])


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_xarray_opens_it_with_either_engine(tmp_path, engine):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf" if engine == "h5netcdf" else "netCDF4")
    path = tmp_path / "fields.h5"
    file = open_file(path)
    for count in (0, 4):
        add(file, LABELS[:count])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with xarray.open_dataset(path, engine=engine) as data:
                assert data["label"].dims == ("snapshot",) and list(map(str, data["label"].values)) == LABELS[:count]
                np.testing.assert_array_equal(data["time"], 0.5 * np.arange(count))
                assert data["gap"].dims == ("snapshot", "y", "x") and data["gap"].shape == (count, NB, NB)
                assert {"time", "force", "label"} <= set(data["gap"].coords)
                assert set(data.sizes) == {"snapshot", "x", "y"}
                np.testing.assert_array_equal(data["gap"][:, 0, 0], 0.1 + np.arange(count))
                assert (data["x"].attrs["axis"], data["y"].attrs["units"]) == ("X", "m")
    file.truncate(2)
    add(file, ["again"])
    with xarray.open_dataset(path, engine=engine) as data:
        assert list(data["label"].values) == [*LABELS[:2], "again"]


@pytest.mark.parametrize("old", [False, True])
def test_files_of_either_kind_grow_are_cut_back_and_verified(tmp_path, old):
    path = tmp_path / "fields.h5"
    if old:
        make_old(path)
    add(open_file(path), LABELS)
    file = open_file(path)
    file.truncate(2)
    add(file, ["another"])
    fields = FieldsMapping(path)
    assert list(fields["label"]) == [*LABELS[:2], "another"]
    assert not {fields_layout.LABEL_AXIS, vtk_group.GROUP} & set(fields)
    fields.close()
    assert _snapshots(path, 3, False).found == "3 snapshots of 3 arrays"
    with h5py.File(path, "r+") as file:
        assert file["label"].ndim == (1 if old else 2)
        file["label"][1] = b"changed" if old else np.full(fields_layout.LABEL_BYTES, b"x", dtype="S1")
    assert "numbers or label of snapshot 1" in _snapshots(path, 3, False).found


@pytest.fixture(params=[False, True], ids=["punch", "surface"])
def cut_and_grown(request, tmp_path):
    """A file of four snapshots, the last two written after it was cut back, the last taken before the third; and whether
    it holds the whole surface."""
    path, surface = tmp_path / "fields.h5", request.param
    add(open_file(path, surface), LABELS, surface)
    file = open_file(path, surface)
    file.truncate(2)
    add(file, ["another", LATE], surface)
    return path, surface


def test_the_group_for_vtk_shows_the_same_values_without_a_copy(cut_and_grown):
    path, surface = cut_and_grown
    with h5py.File(path) as file:
        group, side = file["VTKHDF"], 2 * NB if surface else NB
        assert group["Steps"].attrs["NSteps"] == 4 and list(group["Steps/Values"]) == [0.0, 0.5, 0.75, 1.0]
        assert list(group.attrs["WholeExtent"]) == [0, side - 1, 0, side - 1, 0, 0]
        x = file["x_cell" if surface else "x"]
        np.testing.assert_allclose(
            group.attrs["Origin"][0] + group.attrs["Spacing"][0] * np.arange(side), x, rtol=1e-13
        )
        for name in ("gap", "traction", "displacement"):
            shown = group["PointData"][name]
            assert shown.is_virtual == surface and shown.shape == (4, side, side)
            inside = shown[:, 3 : 3 + NB, 3 : 3 + NB] if surface else shown[:]
            np.testing.assert_array_equal(inside, file[name])
            assert np.isnan(shown[:]).sum() == 4 * (side**2 - NB**2)
        if surface:
            assert group["PointData/surface_displacement"] == file["surface_displacement"]
        assert group["FieldData/force"] == file["force"]
        assert list(group["Steps/FieldDataOffsets/force"]) == list(group["Steps/PointDataOffsets/gap"]) == [0, 1, 3, 2]


def test_a_file_of_an_earlier_version_gets_the_group_when_it_grows(tmp_path):
    make_old(tmp_path / "fields.h5")
    add(open_file(tmp_path / "fields.h5"), LABELS[:2])
    with h5py.File(tmp_path / "fields.h5") as file:
        assert file["VTKHDF/Steps"].attrs["NSteps"] == 2 and file["VTKHDF/PointData/gap"] == file["gap"]


def test_vtk_reads_each_snapshot_at_its_time(cut_and_grown):
    reading = pytest.importorskip("vtkmodules.vtkIOHDF")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    path, surface = cut_and_grown
    reader = reading.vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 4
    with h5py.File(path) as file:
        for frame, time in enumerate(file["time"]):
            reader.UpdateTimeStep(time)
            image = reader.GetOutputDataObject(0)
            for name, array in file["VTKHDF/PointData"].items():
                found = vtk_to_numpy(image.GetPointData().GetArray(name)).reshape(array.shape[1:])
                np.testing.assert_array_equal(found, array[frame])
            assert image.GetPointData().GetNumberOfArrays() == 3 + surface
            numbers = image.GetFieldData()
            assert numbers.GetArray("punch_position").GetValue(0) == file["punch_position"][frame] == -1e-6 * frame
