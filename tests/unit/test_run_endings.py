"""What a run says at its end: of a retraction that never began, of an audit that does not close, of foreign files."""

import csv
import json

import pytest
from mpi4py import MPI

from pgfmd.commands.run import _summary
from pgfmd.errors import ResultError
from pgfmd.files.tables import CURVE
from pgfmd.results import load
from pgfmd.results.curve import Loop, measure
from pgfmd.results.doubts import missed_preload
from pgfmd.results.status import status_of
from pgfmd.runner import Options, run_scene
from pgfmd.scene import load_scene
from pgfmd.studies.case_state import case_state_of
from pgfmd.studies.cases import cases_of
from pgfmd.studies.study_file import study_from_mapping
from pgfmd.studies.table import overview, rows_of, write_table
from tests.unit.small_runs import SCENE, run


def record_of(folder):
    return json.loads((folder / "run.json").read_text())


def started(folder, fresh=False):
    """Runs the small scene into a folder."""
    source, *changes = SCENE
    scene = load_scene(source, [*changes, "solver.max_steps=3", "output.snapshots=[]"])
    return run_scene(scene, MPI.COMM_SELF, folder, lambda line: None, Options(fresh=fresh))


# -- what does not apply -----------------------------------------------------------------------------------------------


def test_before_the_preload_nothing_has_been_pulled(tmp_path):
    folder = run(tmp_path / "run", "solver.max_steps=5")
    record = record_of(folder)
    assert record["finished"] == "max_steps reached"
    assert [record[key] for key in ("preload_N", "pull_off_force_N", "work_of_separation_J")] == [None] * 3
    assert record["work_J"] != 0.0
    text = "\n".join(_summary(record, folder))
    assert "no pull-off force, the run ended before the retraction; 5 steps" in text and "0 mN" not in text
    assert status_of(folder).preload_N is None


def test_the_preload_counts_once_it_is_met_and_the_pull_off_once_the_punch_goes_up(tmp_path):
    curve = load(run(tmp_path / "whole")).curve
    turn, retract = (int((curve["phase"] == phase).argmax()) for phase in ("turn", "retract"))
    # Past the middle of the turn it goes up already.
    for steps, known in ((turn - 1, (True, False)), (retract - 1, (True, True)), (retract, (True, True))):
        record = record_of(run(tmp_path / f"run-{steps}", f"solver.max_steps={steps}"))
        assert record["steps"] == steps
        found = tuple(record[key] is not None for key in ("preload_N", "pull_off_force_N"))
        assert found == known, steps
        assert (record["work_of_separation_J"] is None) == (record["pull_off_force_N"] is None)
        measures = measure(Loop.of(load(tmp_path / f"run-{steps}")))
        assert (measures.preload, measures.pull_off is not None) == (record["preload_N"], known[1])
        assert measures.work_of_separation == record["work_of_separation_J"]


def test_the_table_of_a_study_has_empty_cells(tmp_path):
    common = {"grid": {"n": 24}, "solver": {"max_steps": 5}}
    axes = {"drive": {"preload": ["1 mN", "2 mN"]}}
    study = study_from_mapping({"scene": SCENE[0], "set": common, "axes": axes}, "small.toml", tmp_path)
    case = cases_of(study)[0]
    run_scene(case.scene, MPI.COMM_SELF, tmp_path / "run", lambda line: None)
    rows = rows_of([case], study.axes, {case.name: case_state_of(case, tmp_path / "run", ())})
    write_table(tmp_path / "table.csv", rows, study.axes)
    with open(tmp_path / "table.csv", newline="") as file:
        line = next(csv.DictReader(file))
    names = ("pull_off_force [N]", "preload [N]", "work_of_separation [J]", "work [J]")
    assert line["state"] == "finished (max_steps reached)" and line["steps"] == "5"
    assert [line[name] for name in names] == [""] * 4
    assert " 0 " not in overview(rows)[1]


# -- the energy audit --------------------------------------------------------------------------------------------------


RECORD = {
    "finished": "detached", "accuracy": 0.01, "pull_off_force_N": 1e-3, "work_of_separation_J": 1e-9, "steps": 9,
    "transform_pairs": 9, "wall_s": 1.0, "viscous_J": 0.0, "released_J": 0.0,
}  # fmt: skip


def folder_with(tmp_path, largest):
    """A folder whose punch has done this work [J] at most."""
    (tmp_path / "curve.csv").write_text(",".join(CURVE.titles) + "\n")
    head = "time [s],work [J],elastic [J],adhesive [J],viscous [J],released [J],residual [J]"
    (tmp_path / "energy.csv").write_text(f"{head}\n0.0{',0.0' * 6}\n1.0,{largest!r}{',0.0' * 5}\n")
    return tmp_path


@pytest.mark.parametrize(
    ("work", "share", "largest", "said"),
    [
        (1e-9, 0.06, 1e-8, "closes to 6 % of the loop's work: lower solver.accuracy"),
        (1e-9, 0.04, 1e-8, ""),
        (-1e-10, 1.0, 1e-8, "closes to 0.1 nJ, and the loop's work is -0.1 nJ, little compared with 10 nJ"),
        (-1e-11, 1.0, 1e-8, ""),
        (1e-9, None, 1e-8, ""),
    ],
)
def test_an_audit_that_does_not_close_is_told_whatever_the_losses(work, share, largest, said, tmp_path):
    record = RECORD | {"work_J": work, "energy_residual": share}
    text = "\n".join(_summary(record, folder_with(tmp_path, largest)))
    assert said in text if said else "energy audit" not in text


def test_it_is_told_of_a_run_without_its_table_too(tmp_path):
    assert "closes to 50 %" in "\n".join(_summary(RECORD | {"work_J": 1e-9, "energy_residual": 0.5}, tmp_path))


def test_a_quasi_static_loop_is_told_with_its_uncertainty(tmp_path):
    known = {"work_J": 3e-10, "work_uncertainty_J": 5e-11, "unbalanced_J": 3e-11, "jump_places_J": 1e-11, "jumps": 7}
    text = "\n".join(_summary(RECORD | known, tmp_path))
    assert "loop 0.3 ± 0.05 nJ" in text and "uncertain by" not in text
    text = "\n".join(_summary(RECORD | known | {"work_uncertainty_J": 7e-11, "unbalanced_J": 5e-11}, tmp_path))
    assert "loop of 0.3 nJ is uncertain by 0.07 nJ, 0.05 nJ of it" in text and "0.01 nJ because of the places" in text
    # Neither where nothing jumps and no loop is expected, nor in other schemes.
    for other in ({"jumps": 0}, {"unbalanced_J": None, "jump_places_J": None}):
        assert "uncertain by" not in "\n".join(
            _summary(RECORD | known | {"work_uncertainty_J": 1e-9} | other, tmp_path)
        )


# -- foreign files -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("text", ["mine\n", "x,y\n1,2\n", "one line without an end"])
def test_a_foreign_curve_is_not_replaced(text, tmp_path):
    curve = tmp_path / "curve.csv"
    curve.write_text(text)
    with pytest.raises(ResultError, match=r"curve\.csv: not written by a run"):
        started(tmp_path)
    assert curve.read_text() == text and not (tmp_path / "run.lock").exists()
    assert started(tmp_path, fresh=True)["steps"] == 3
    assert (tmp_path / "previous-1" / "curve.csv").read_text() == text


@pytest.mark.parametrize("rows", ["", ",".join(CURVE.titles)[:30], ",".join(CURVE.titles) + "\n"])
def test_a_run_that_ended_before_its_first_step_is(rows, tmp_path):
    (tmp_path / "curve.csv").write_text(rows)
    assert started(tmp_path)["steps"] == 3


@pytest.mark.parametrize("text", ['{"a": 1}', "[1]", '{"finished": 3}', "1"])
def test_a_foreign_record_is_refused(text, tmp_path):
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(ResultError, match=r"run\.json: damaged: it does not say how a run has finished"):
        started(tmp_path)
    assert (tmp_path / "run.json").read_text() == text


def test_a_preload_that_was_not_met_is_told():
    assert (
        missed_preload(RECORD | {"preload_N": 1.001e-3}, 1e-3)
        == []
        == missed_preload(RECORD | {"preload_N": None}, 1e-3)
    )
    (text,) = missed_preload(RECORD | {"preload_N": 1.3e-3}, 1e-3)
    assert "0.0013 N instead of 0.001 N" in text and "drive.preload" in text
    explicit = {key: value for key, value in RECORD.items() if key != "accuracy"}
    (text,) = missed_preload(explicit | {"preload_N": 1.3e-3}, 1e-3)
    assert "solver.gfmd" in text and "accuracy" not in text
