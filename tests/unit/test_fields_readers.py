"""`fields.h5` in the readers that others use, and files of earlier versions, whose labels are texts of fixed length."""

from __future__ import annotations

import warnings

import h5py
import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.files import fields_layout
from pgfmd.files.fields_layout import SCALAR_CHUNK, Layout
from pgfmd.output.fields_file import FieldsFile
from pgfmd.results.reading import FieldsMapping
from pgfmd.results.verify import _snapshots

NB, LABELS = 6, ["snap-in", "µ" * 40, "", "pull-off γ"]


def open_file(path) -> FieldsFile:
    return FieldsFile(path, MPI.COMM_SELF, 2 * NB, 1e-3, 3, NB, 0, NB, np.ones((NB, NB), dtype=bool))


def add(file: FieldsFile, labels: list[str]) -> None:
    for label in labels:
        arrays = [np.full((NB, NB), k + file.frames) for k in (0.1, 0.2, 0.3)]
        file.append(label, 0.5 * file.frames, -1e-6, 1e-3, *arrays)


def make_old(path) -> None:
    """An empty file with the labels that earlier versions wrote."""
    layout = Layout(2 * NB, 1e-3, 3, NB)
    fields_layout.create(path, layout)
    with h5py.File(path, "r+") as file:
        del file["label"], file[fields_layout.LABEL_AXIS]
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
    assert list(fields["label"]) == [*LABELS[:2], "another"] and fields_layout.LABEL_AXIS not in fields
    fields.close()
    assert _snapshots(path, 3, False).found == "3 snapshots of 3 arrays"
    with h5py.File(path, "r+") as file:
        assert file["label"].ndim == (1 if old else 2)
        file["label"][1] = b"changed" if old else np.full(fields_layout.LABEL_BYTES, b"x", dtype="S1")
    assert "numbers or label of snapshot 1" in _snapshots(path, 3, False).found
