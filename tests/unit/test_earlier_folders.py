"""Folders as version 0.1 wrote them, whose contact is overlap: read with that meaning, and not gone on with."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from typer.testing import CliRunner

from pgfmd.analysis.summary import analyse
from pgfmd.cli import app
from pgfmd.errors import ResultError
from pgfmd.files.table_reading import CurveTail
from pgfmd.files.tables import CURVE
from pgfmd.restart.checkpoint_layout import examine
from pgfmd.results import load
from pgfmd.results.reading import FieldsMapping
from pgfmd.results.status import status_of
from pgfmd.results.verify import verify
from pgfmd.runner import run_scene
from pgfmd.scene import load_scene
from tests.unit.small_runs import run
from tests.unit.synthetic_results import as_version_0_1

SCENE = ("tri-tack", ["grid.n=24", "drive.preload=1 mN", 'output.snapshots=["1 s"]'])
"""That of small_runs."""


@pytest.fixture(scope="module")
def new(tmp_path_factory):
    return run(tmp_path_factory.mktemp("new") / "out")


@pytest.fixture
def old(new, tmp_path):
    return as_version_0_1(shutil.copytree(new, tmp_path / "old"))


def test_what_a_run_has_counted_is_known(new, tmp_path):
    with load(new) as results:
        reach, curve = results.run["range_m"], results.curve
        assert (results.contact_gap, results.near_gap, results.counts_overlap) == (reach / 2, 5e-7, False)
        told = results.fields.attrs
        assert (told["contact_gap_m"], told["near_gap_m"]) == (reach / 2, 5e-7)
        for k, time in enumerate(results.fields["time"].values):
            gap, row = results.frame("gap", k), curve[curve["time [s]"] == time].iloc[0]
            cell = results.scene["grid"]["n"] ** -2 * 1.5e-3**2
            for name, level in (("contact", reach / 2), ("overlap", 0.0), ("near", 5e-7)):
                assert row[f"{name}_area [m^2]"] == pytest.approx(cell * np.count_nonzero(gap < level), rel=1e-12)
            assert row["contact_area [m^2]"] > 1.2 * row["overlap_area [m^2]"]
    plain = FieldsMapping(new / "fields.h5")
    assert plain.attrs["contact_gap_m"] == reach / 2
    plain.close()
    # Of a run that goes on there is no record yet.
    live = shutil.copytree(new, tmp_path / "live")
    (live / "run.json").unlink()
    assert load(live).contact_gap == pytest.approx(reach / 2, rel=1e-15) and not load(live).counts_overlap


def test_an_earlier_folder_is_read_with_its_own_meaning(new, old):
    now, before = load(new), load(old)
    assert (before.contact_gap, before.near_gap, before.counts_overlap) == (0.0, 5e-7, True)
    assert np.array_equal(before.curve["contact_area [m^2]"], now.curve["overlap_area [m^2]"])
    assert before.curve[["overlap_area [m^2]", "near_area [m^2]"]].isna().all().all()
    assert np.array_equal(before.curve["force [N]"], now.curve["force [N]"])
    tail = CurveTail(old / "curve.csv")
    assert tail.earlier and not tail.strange and tail.rows[-1].force == CurveTail(new / "curve.csv").rows[-1].force
    assert np.isnan(tail.rows[-1].near_area) and tail.rows[-1].phase == "retract"
    analyse(old)
    assert status_of(old).state == "finished" and status_of(old).warnings == []
    assert {part.path.name for part in verify(old) if not part.fine} == {"curve.csv"}
    invoked = CliRunner().invoke(app, ["compare", str(old), str(new), "--out", str(old.parent / "both")])
    assert invoked.exit_code == 0, invoked.output


def test_without_attraction_nothing_has_changed_its_meaning(new, old):
    path = old / "scene.resolved.toml"
    path.write_text(path.read_text().replace('law = "cosine"', 'law = "repulsive"'))
    assert load(old).counts_overlap is False and load(old).contact_gap == 0.0


def test_an_earlier_run_is_not_gone_on_with(tmp_path):
    stopped = run(tmp_path / "out", stop_after=20)
    as_version_0_1(stopped)
    before = {path.name: path.read_bytes() for path in stopped.iterdir() if path.is_file()}
    with pytest.raises(ResultError, match=r"version 0\.1 of pgfmd.*can't go on.*--fresh"):
        run_scene(load_scene(*SCENE), MPI.COMM_SELF, stopped, lambda line: None)
    assert {path.name: path.read_bytes() for path in stopped.iterdir() if path.is_file()} == before
    (told,) = status_of(stopped).warnings
    assert "version 0.1" in told and "--fresh" in told


def test_a_checkpoint_that_version_0_1_has_written_is_refused_and_left_alone(tmp_path):
    """`run_of_0_1` is what its program left when it was stopped after 23 steps of this scene."""
    folder = shutil.copytree(Path(__file__).parent / "run_of_0_1", tmp_path / "out")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert examine(folder / "checkpoint.h5")["pgfmd"] == "0.1.0"
    invoked = CliRunner().invoke(app, ["run", SCENE[0], *SCENE[1][:2], "--out", str(folder)])
    assert invoked.exit_code == 4
    assert re.search("version 0.1 of pgfmd.*finish it with version 0.1.*--fresh", invoked.stderr.replace("\n", " "))
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before
    found = status_of(folder)
    assert (found.state, found.steps, len(found.warnings)) == ("resumable", 23, 1)
    with load(folder) as results:
        assert results.counts_overlap and len(results.curve) == 24
        area = results.curve["contact_area [m^2]"].iloc[-1]
    assert 0.0 < area < 4.4e-7
    assert CliRunner().invoke(app, ["verify", str(folder)]).exit_code == 0


def test_an_earlier_run_that_had_not_begun_is_begun(tmp_path):
    (tmp_path / "curve.csv").write_text(CURVE.headers[1])
    assert load(run(tmp_path, "solver.max_steps=3")).counts_overlap is False


def test_an_earlier_run_that_is_finished_is_left_alone(old):
    told = []
    record = run_scene(load_scene(*SCENE), MPI.COMM_SELF, old, told.append)
    assert record["finished"] == "detached" and "contact_gap_m" not in record and "this run is finished" in told[-1]
