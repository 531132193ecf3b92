"""Reading results back: every digit, live files, missing packages, and what is said about folders that hold none."""

import subprocess
import sys

import numpy as np
import pytest

from pgfmd.errors import ResultError
from pgfmd.files.tables import CURVE
from pgfmd.results import load
from tests.unit.synthetic_results import CONTACT_GAP, NEAR_GAP, OFFSET, history, sphere, write_results


@pytest.fixture
def folder(tmp_path):
    return write_results(tmp_path / "out", rows=40, nb=16, snapshots=3)


def check_curve(curve) -> None:
    expected = history(40)
    assert len(curve) == 40
    np.testing.assert_array_equal(curve["force [N]"], [row.force for row in expected])
    np.testing.assert_array_equal(curve["indentation [m]"], [row.indentation for row in expected])
    assert list(curve["phase"]) == [row.phase for row in expected]


def check_fields(results) -> None:
    inside = sphere(16, 1e-4)[0]
    row = history(40)[int(0.55 * 39)]
    gap = sphere(16, np.sqrt(row.contact_area / np.pi))[1]
    np.testing.assert_array_equal(results.frame("gap", 1), np.where(inside, gap, np.nan))
    np.testing.assert_array_equal(results.frame("gap", -2), results.frame("gap", 1))
    assert results.labels == ["approach", "retraction", "retraction"]
    assert float(results.fields["time"][1]) == row.time
    assert results.fields["gap"].shape == (3, 16, 16)


def test_all_parts_come_back(folder):
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    with load(folder) as results:
        assert isinstance(results.curve, pandas.DataFrame) and list(results.curve.columns) == list(CURVE.titles)
        check_curve(results.curve)
        assert isinstance(results.fields, xarray.Dataset)
        check_fields(results)
        assert results.run == {
            "finished": "detached", "steps": 40, "contact_gap_m": CONTACT_GAP, "near_gap_m": NEAR_GAP,
            "indentation_offset_m": OFFSET,
        }  # fmt: skip
        assert results.scene["cell"]["n"] == 192
        assert len(results.energy) == 40
        assert list(results.sites["event"]) == ["joins", "leaves"] and list(results.sites["in_contact"]) == [1, 0]
        assert list(results.events["left"]) == ["1 summit", ""] and list(results.events["event"]) == [
            "jump",
            "detached",
        ]
        assert results.patches["summits"].dtype == np.int64 and results.patches["kind"][0] == "summit"


def test_without_pandas_and_xarray(folder, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    monkeypatch.setitem(sys.modules, "xarray", None)
    with load(folder) as results:
        assert results.curve.dtype.names == CURVE.titles
        check_curve(results.curve)
        check_fields(results)
        assert set(results.fields) >= {"gap", "traction", "displacement", "x", "y", "time", "force", "label"}
        assert results.fields.units["traction"] == "Pa"
        assert results.sites["kind"].tolist() == ["summit"] * 2 and results.events["joined"].tolist() == ["", ""]
        with pytest.raises(TypeError):
            results.fields["gap"] = 1


@pytest.mark.parametrize("tail", ["0.5", "0.5,1e-6,2e-6,0.1,1e-9,0.0,0.1,retr", "0.5,1"])
def test_line_that_a_live_run_has_begun_is_left_out(folder, tail):
    with open(folder / "curve.csv", "a") as file:
        file.write(tail)
    check_curve(load(folder).curve)


def test_header_only(folder):
    (folder / "curve.csv").write_text(",".join(CURVE.titles) + "\n")
    assert len(load(folder).curve) == 0


def test_broken_line_is_named(folder):
    with open(folder / "curve.csv", "a") as file:
        file.write("0.5,oops,2e-6,0.1,1e-9,0.0,0.1,retract\n")
    with pytest.raises(ResultError, match=r"curve\.csv: could not be read: .*oops"):
        load(folder).curve  # noqa: B018


def test_foreign_header(folder):
    (folder / "curve.csv").write_text("time,force\n0,1\n")
    with pytest.raises(ResultError, match="its first line is 'time,force'"):
        load(folder).curve  # noqa: B018


def test_folders_that_hold_no_results(tmp_path):
    with pytest.raises(ResultError, match="gone: no such folder"):
        load(tmp_path / "gone")
    (tmp_path / "letter.txt").write_text("Dear Sir")
    with pytest.raises(ResultError, match=r"letter\.txt: a file, not a results folder"):
        load(tmp_path / "letter.txt")
    with pytest.raises(ResultError, match=r"not a results folder, it has no curve\.csv"):
        load(tmp_path)


def test_missing_parts(folder):
    tables = ("energy.csv", "events.csv", "patches.csv", "sites.csv")
    for name in (*tables, "fields.h5", "run.json", "scene.resolved.toml"):
        (folder / name).unlink()
    results = load(folder)
    assert (results.run, results.labels, results.has_fields) == ({}, [], False)
    assert results.energy is results.events is results.patches is results.sites is None
    with pytest.raises(ResultError, match="no snapshots"):
        results.fields  # noqa: B018
    with pytest.raises(ResultError, match=r"scene\.resolved\.toml: could not be read"):
        results.scene  # noqa: B018


@pytest.mark.parametrize("hidden", [None, "xarray"])
def test_damaged_fields(folder, monkeypatch, hidden):
    if hidden:
        monkeypatch.setitem(sys.modules, hidden, None)
    (folder / "fields.h5").write_bytes((folder / "fields.h5").read_bytes()[:300])
    with pytest.raises(ResultError, match=r"fields\.h5: could not be read: .*the file is damaged"):
        load(folder).fields  # noqa: B018
    (folder / "fields.h5.undo").write_bytes(b"")
    with pytest.raises(ResultError, match="its next start repairs the file"):
        load(folder).fields  # noqa: B018


def test_unknown_array_and_snapshot(folder):
    with load(folder) as results:
        with pytest.raises(ResultError, match="has no array 'pressure'"):
            results.frame("pressure", 0)
        with pytest.raises(ResultError, match="has 3 snapshots, no number 3"):
            results.frame("gap", 3)


def test_damaged_record(folder):
    (folder / "run.json").write_text("{")
    with pytest.raises(ResultError, match=r"run\.json: could not be read"):
        load(folder).run  # noqa: B018
    for text in ('{"a": 1}', "[1]"):
        (folder / "run.json").write_text(text)
        with pytest.raises(
            ResultError, match=r"run\.json: damaged: it does not say how a run has finished; move it away"
        ):
            load(folder).run  # noqa: B018


def test_reading_and_plotting_start_no_mpi():
    code = "import sys, pgfmd.results, pgfmd.plots.folder; print(sorted({'mpi4py', 'h5py', 'matplotlib'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"
