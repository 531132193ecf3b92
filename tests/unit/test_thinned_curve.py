"""Curves of which `output.every` leaves rows out: what is there in any case, restarts, and what is measured on them."""

import json
import shutil

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.analysis.summary import analyse
from pgfmd.results import load
from pgfmd.results.curve import Loop
from pgfmd.runner import Options, run_scene
from pgfmd.scene import load_scene
from tests.unit.small_runs import SCENE, run

DWELL = ("drive.dwell=2 s", "solver.accuracy=0.03")
SEVEN = (*DWELL, "output.every=7")
TABLES = ("curve.csv", "energy.csv")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The same run with all rows, and with each seventh."""
    folder = tmp_path_factory.mktemp("runs")
    return run(folder / "whole", *DWELL), run(folder / "thin", *SEVEN)


def rows_of(folder, name):
    return (folder / name).read_text().splitlines()[1:]


def test_the_last_rows_of_each_phase_and_of_the_run_are_there(runs):
    whole, thin = runs
    for name in TABLES:
        every, some = rows_of(whole, name), rows_of(thin, name)
        assert len(some) < 0.5 * len(every)
        assert len(set(some)) == len(some) and set(some) < set(every)
        assert some == [row for row in every if row in set(some)] and some[-1] == every[-1]
    phases = [row.split(",")[-1] for row in rows_of(whole, "curve.csv")]
    ends = [k for k in range(len(phases) - 1) if phases[k] != phases[k + 1]]
    # Approach, turn, dwell, turn.
    assert len(ends) == 4
    for name in TABLES:
        every, some = rows_of(whole, name), rows_of(thin, name)
        assert {every[k] for k in ends} <= set(some)


def test_a_run_that_ends_for_want_of_steps_has_its_last_row_and_goes_on_as_if_it_had_not(runs, tmp_path):
    whole = rows_of(runs[0], "curve.csv")
    turn = next(k for k, row in enumerate(whole) if row.endswith("turn"))
    for steps in (turn - 1, turn + 2):
        short = run(tmp_path / f"short-{steps}", *SEVEN, f"solver.max_steps={steps}")
        assert rows_of(short, "curve.csv")[-1] == whole[steps]
        source, *changes = SCENE
        scene = load_scene(source, [*changes, *SEVEN])
        run_scene(scene, MPI.COMM_SELF, short, lambda line: None, Options(allow=("solver.max_steps",)))
        for name in TABLES:
            assert (short / name).read_bytes() == (runs[1] / name).read_bytes(), (steps, name)


def test_a_run_stopped_anywhere_has_the_same_rows(runs, tmp_path):
    phases = [row.split(",")[-1] for row in rows_of(runs[0], "curve.csv")]
    ends = [k for k in range(1, len(phases) - 1) if phases[k] != phases[k + 1]]
    stops = {3, *ends, ends[0] - 1, ends[0] + 1, len(phases) - 2}
    for steps in sorted(stops):
        folder = run(tmp_path / "stopped", *SEVEN, stop_after=steps)
        assert not (folder / "run.json").exists()
        run(folder, *SEVEN)
        for name in TABLES:
            assert (folder / name).read_bytes() == (runs[1] / name).read_bytes(), (steps, name)
        shutil.rmtree(folder)


def test_pull_off_and_works_are_those_of_the_run(tmp_path):
    folder = run(tmp_path / "run", "output.every=1000")
    record, found = json.loads((folder / "run.json").read_text()), analyse(folder)
    assert len(load(folder).curve) < 6
    assert found.measures.pull_off.tension == pytest.approx(record["pull_off_force_N"], rel=1e-12)
    assert found.measures.largest_force >= record["preload_N"]
    assert found.measures.work_of_separation == record["work_of_separation_J"]
    assert found.measures.hysteresis == record["work_J"]
    assert any("output.every = 1000" in remark for remark in found.table.remarks)
    assert Loop.of(load(folder)).force.max() >= record["preload_N"] * (1 - 1e-6)
    assert np.isfinite(found.measures.pull_off.displacement)
