"""The curve of a run: every jump finds the row of its step, one that has none is told, and who may import whom."""

import json
import shutil

import numpy as np
import pytest

from pgfmd.errors import ResultError
from pgfmd.files.tables import CURVE, EVENTS
from pgfmd.results import load
from pgfmd.results.curve import SAME_STEP, Loop, net_work_of_rows, rows_of_jumps
from tests.unit.analysis_loops import loop_of, write_folder
from tests.unit.small_runs import run

SCENE = "[solver]\naccuracy = 0.01\n"


@pytest.fixture(scope="module")
def jumpy(tmp_path_factory):
    """An elastic run that jumps, of which rows are left out."""
    return run(tmp_path_factory.mktemp("jumpy") / "out", "rheology.model=elastic", "output.every=4")


def cells(folder, table):
    """The texts of a table's cells, by title."""
    header, *lines = (folder / table.file).read_text().splitlines()
    return dict(zip(header.split(","), zip(*(line.split(",") for line in lines), strict=True), strict=True))


def test_both_tables_write_a_step_with_the_same_letters_and_each_jump_finds_its_row(jumpy):
    curve, events, results = cells(jumpy, CURVE), cells(jumpy, EVENTS), load(jumpy)
    jumps = [k for k, kind in enumerate(events["event"]) if kind == "jump"]
    rows = rows_of_jumps(results)
    assert len(jumps) == len(rows) == results.run["jumps"] > 20
    for title in SAME_STEP:
        # Not only equal as numbers: written from the same, with all digits.
        assert [events[title][k] for k in jumps] == [curve[title][row] for row in rows]
        assert all(repr(float(text)) == text for text in curve[title] + events[title])
    loop = Loop.of(results)
    assert np.flatnonzero(loop.jump).tolist() == rows.tolist() and (np.diff(rows) > 0).all()
    # A row before each jump is there, too, so that the next step is that of the jump.
    steps = np.asarray(results.curve["step [s]"])[rows]
    assert loop.time[rows] - loop.time[rows - 1] == pytest.approx(steps, rel=1e-6)


def test_rows_of_one_time_are_told_apart_by_the_rest_of_their_step(tmp_path):
    """Steps too short for the clock: three rows have the same time, the middle one is the jump's."""
    loop = loop_of([0.0, -1e-6, -1e-6, -2e-6, 0.0], [0.0, 1e-3, 3e-3, 3e-3, 0.0], turn=4, jumps=[2])
    loop.time[1:4] = 0.1
    folder = write_folder(tmp_path, loop, SCENE)
    assert rows_of_jumps(load(folder)).tolist() == [2]
    found = Loop.of(load(folder))
    assert found.jump.tolist() == [False, False, True, False, False]
    # Were all three taken for jumps, the work would be another.
    wrong = loop_of(loop.displacement, loop.force, turn=4, jumps=[1, 2, 3])
    assert net_work_of_rows(found) == net_work_of_rows(loop) != net_work_of_rows(wrong)


@pytest.mark.parametrize("title", SAME_STEP)
def test_a_jump_without_a_row_is_an_error_and_not_lost(jumpy, tmp_path, title):
    folder = shutil.copytree(jumpy, tmp_path / "out")
    lines = (folder / EVENTS.file).read_text().splitlines()
    place, row = EVENTS.titles.index(title), next(k for k, line in enumerate(lines) if ",jump," in line)
    parts = lines[row].split(",")
    parts[place] = repr(float(np.nextafter(float(parts[place]), 1.0)))
    lines[row] = ",".join(parts)
    (folder / EVENTS.file).write_text("\n".join([*lines, ""]))
    told = rf"the jump at t = {parts[0]} s in events.csv has no row in curve.csv.*try again.*pgfmd verify"
    with pytest.raises(ResultError, match=told):
        Loop.of(load(folder))


def test_jumps_of_a_live_run_after_its_last_row_are_left_out(jumpy, tmp_path):
    folder = shutil.copytree(jumpy, tmp_path / "out")
    (folder / "run.json").unlink()
    rows = rows_of_jumps(load(jumpy))
    cut = int(rows[len(rows) // 2]) - 1
    lines = (folder / CURVE.file).read_text().splitlines(keepends=True)
    (folder / CURVE.file).write_text("".join(lines[: cut + 1]) + lines[cut + 1][:20])
    assert rows_of_jumps(load(folder)).tolist() == [row for row in rows if row < cut]
    assert json.loads((jumpy / "run.json").read_text())["jumps"] == len(rows)


def test_a_run_without_jumps_or_events_has_none(tmp_path):
    folder = write_folder(tmp_path, loop_of([0.0, -1e-6, 0.0], [0.0, 1e-3, 0.0], turn=2), SCENE)
    assert rows_of_jumps(load(folder)).size == 0
    (folder / EVENTS.file).unlink()
    assert rows_of_jumps(load(folder)).size == 0 and not Loop.of(load(folder)).jump.any()
