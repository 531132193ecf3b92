"""Numbers of contact: areas and sites in analyses, comparisons and studies, named by what the run has counted."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from pgfmd.analysis.contact_table import Face
from pgfmd.analysis.summary import analyse
from pgfmd.cli import app
from pgfmd.files.hdf5 import open_serial
from pgfmd.results import load
from pgfmd.results.curve import KINDS_OF_AREA, Loop, measure
from pgfmd.results.verify import verify
from pgfmd.studies.case_state import case_state_of
from pgfmd.studies.cases import cases_of
from pgfmd.studies.pictures import Plan, measures_figure
from pgfmd.studies.study_file import study_from_mapping
from pgfmd.studies.table import AREAS, COLUMNS, GAPS, overview, remarks, rows_of, write_table
from tests.unit.small_runs import SCENE, run
from tests.unit.synthetic_results import as_version_0_1


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A run of two preloads, each as it is and as version 0.1 would have left it, and one without adhesion."""
    folder = tmp_path_factory.mktemp("runs")
    for preload in (1, 2):
        case = f"preload-{preload}mN"
        run(folder / "new" / case, f"drive.preload={preload} mN")
        as_version_0_1(shutil.copytree(folder / "new" / case, folder / "old" / case))
    run(folder / "repulsive", "adhesion.law=repulsive")
    as_version_0_1(shutil.copytree(folder / "repulsive", folder / "old-repulsive"))
    return folder


def column(curve, name):
    return np.asarray(curve[f"{name} [m^2]"])


def test_a_loop_knows_its_areas_by_what_they_are(folders):
    new, old = (load(folders / age / "preload-1mN") for age in ("new", "old"))
    loop, before = Loop.of(new), Loop.of(old)
    assert tuple(loop.areas) == KINDS_OF_AREA and tuple(before.areas) == ("overlap",)
    for kind, area in loop.areas.items():
        np.testing.assert_array_equal(area, column(new.curve, f"{kind}_area"))
    assert np.all(loop.overlap <= loop.area) and loop.area.max() > 1.1 * loop.overlap.max()
    np.testing.assert_array_equal(before.overlap, loop.overlap)
    assert np.isnan(before.area).all()
    found, rows = measure(loop), (loop.preload_row, loop.turning_row + int(np.argmin(loop.force[loop.turning_row :])))
    for kind, areas in found.areas.items():
        area = loop.areas[kind]
        assert (areas.at_preload, areas.largest, areas.at_pull_off) == (area[rows[0]], area.max(), area[rows[1]])
    assert (found.largest_area, found.area_at_pull_off) == (loop.area.max(), loop.area[rows[1]])
    assert (measure(before).largest_area, measure(before).area_at_pull_off) == (None, None)
    # Forces and works are those of the record, whoever counted what.
    assert measure(before).pull_off == found.pull_off and measure(before).hysteresis == found.hysteresis


def test_where_nothing_attracts_contact_is_overlap_in_old_folders_too(folders):
    record, old = (analyse(folders / name).record for name in ("repulsive", "old-repulsive"))
    assert "overlap" not in record and "overlap" not in old and record["contact"] == old["contact"]
    assert record["contact"]["contact_gap_m"] == 0.0 and record["contact"]["largest_area_m2"] > 0.0
    assert not any("overlap" in text for text in old["remarks"])


def test_analyse_names_what_was_counted(folders):
    new, old = (analyse(folders / age / "preload-2mN") for age in ("new", "old"))
    results = load(folders / "new" / "preload-2mN")
    contact = new.record["contact"]
    assert contact["contact_gap_m"] == results.run["contact_gap_m"] == pytest.approx(0.5 * results.run["range_m"])
    assert contact["area_at_preload_m2"] == new.loop.area[new.loop.preload_row]
    assert contact["largest_area_m2"] == new.loop.area.max()
    assert new.record["near"]["near_gap_m"] == results.near_gap and new.record["near"]["largest_near_area_m2"] > 0.0
    assert new.record["overlap"]["largest_overlap_area_m2"] == new.loop.overlap.max()
    notes = {row.key: row.note for row in new.table.sections["Contact"]}
    fields = results.fields["gap"]
    points = int(np.isfinite(fields[0]).sum())
    share = new.loop.area.max() / (points * (1.5e-3 / 24) ** 2)
    assert notes["largest_area"] == f"{100 * share:.3g} % of the punch"
    # On so coarse a grid the range is long: contact reaches further than an image sees.
    (near, *_) = new.table.sections["Near"]
    assert results.near_gap < results.contact_gap and near.note.startswith("not above that of contact")
    assert "loads_at_which_sites_change" in new.record and not any("0.1" in text for text in new.table.remarks)

    assert old.record["overlap"] == new.record["overlap"]
    assert {"contact", "near", "loads_at_which_sites_change"}.isdisjoint(old.record)
    # No key may be taken for one of contact.
    assert not {"largest_area", "area_at_pull_off", "summit_first_joins"} & {
        row.key for rows in old.table.sections.values() for row in rows
    }
    assert "summit_overlap_first_joins_N" in old.record["loads_at_which_sites_change_by_overlap"]
    assert any("contact is not known" in text for text in old.table.remarks)
    times = {age: row.note for age, found in (("new", new), ("old", old))
             for row in found.table.sections["Forces"] if row.key == "time_to_preload"}  # fmt: skip
    assert times == {"new": "from the first contact", "old": "from the first overlap"}


def test_that_all_is_in_contact_is_said_where_no_point_is_missing():
    face = Face(1000000, 1e-12)
    texts = [face.share(points * 1e-12) for points in (0, 4321, 999000, 999999, 1000000)]
    assert texts == [
        "0 % of the punch", "0.432 % of the punch", "99.9 % of the punch",
        "all of the punch but 1 of 1000000 points", "all of the punch",
    ]  # fmt: skip


def test_compare_says_which_curves_count_what(folders, tmp_path):
    def told(*sources):
        done = CliRunner().invoke(app, ["compare", *map(str, sources), "--out", str(tmp_path / "both.png")])
        assert done.exit_code == 0, done.exception
        return " ".join(done.stdout.split())

    new, old = folders / "new" / "preload-1mN", folders / "old" / "preload-2mN"
    both = told(new, old)
    assert "contact area at the preload" in both and "overlap area at the preload" in both
    assert "preload-2mN: run by version 0.1 of pgfmd, which counted overlap (gap < 0), not contact; the areas" in both
    assert "overlap" not in told(new)
    alone = told(old)
    assert "contact area" not in alone and "not contact; the areas" not in alone and "not contact" in alone


def test_verify_compares_what_snapshots_say_of_contact(folders, tmp_path):
    folder = shutil.copytree(folders / "new" / "preload-1mN", tmp_path / "run")
    assert all(part.fine for part in verify(folder))
    with open_serial(folder / "fields.h5", "r+") as file:
        file.attrs["contact_gap_m"] = 1.01 * file.attrs["contact_gap_m"]
    (part,) = (part for part in verify(folder) if not part.fine)
    assert part.path.name == "fields.h5" and part.found == "changed: attribute contact_gap_m"


@pytest.fixture
def study():
    mapping = {
        "scene": SCENE[0], "set": {"grid": {"n": 24}, "output": {"snapshots": ["1 s"]}},
        "axes": {"drive.preload": ["1 mN", "2 mN"]},
    }  # fmt: skip
    return study_from_mapping(mapping, "small.toml", Path("."))


def rows_in(study, out):
    cases = cases_of(study)
    standings = {case.name: case_state_of(case, out / case.name) for case in cases}
    assert {str(standing) for standing in standings.values()} == {"finished"}
    return rows_of(cases, study.axes, standings, out)


def test_a_study_has_each_area_in_a_column_of_its_name(study, folders, tmp_path):
    rows = rows_in(study, folders / "new")
    write_table(tmp_path / "table.csv", rows, study.axes)
    lines = list(csv.DictReader((tmp_path / "table.csv").read_text().splitlines()))
    assert list(lines[0])[3:] == list(COLUMNS)
    for line in lines:
        with load(folders / "new" / line["case"]) as results:
            areas = measure(Loop.of(results)).areas
            for column, (kind, moment) in AREAS.items():
                assert float(line[column]) == getattr(areas[kind], moment), column
            assert [float(line[column]) for column in GAPS] == [results.contact_gap, results.near_gap]
    first = float(lines[0]["contact_area_at_preload [m^2]"])
    assert "contact [mm2]" in overview(rows)[0] and f"{1e6 * first:.4g}" in overview(rows)[1]
    assert remarks(rows) == []
    panel = measures_figure(Plan(rows, study.axes), "").axes[3]
    assert panel.get_ylabel() == "contact area at the preload (mm²)" and panel.get_title() == ""
    np.testing.assert_allclose(
        panel.lines[0].get_ydata(), [1e6 * float(line["contact_area_at_preload [m^2]"]) for line in lines]
    )


def test_a_study_of_old_folders_has_overlap_alone(study, folders, monkeypatch):
    rows = rows_in(study, folders / "old")
    for row in rows:
        known = {column for column in (*AREAS, *GAPS) if row.measured[column] is not None}
        assert known == {column for column, (kind, _) in AREAS.items() if kind == "overlap"}
    (told,) = remarks(rows)
    assert told.startswith("all cases: run by version 0.1") and "areas of overlap (gap < 0)" in told
    panel = measures_figure(Plan(rows, study.axes), "").axes[3]
    assert panel.get_ylabel() == "overlap area at the preload (mm²)" and len(panel.lines[0].get_xdata()) == 2
    # A logarithmic axis has the places of the study as ticks, in its own unit, and no powers of ten between them.
    monkeypatch.setattr("pgfmd.studies.pictures.WIDE", 1.5)
    panel = measures_figure(Plan(rows, study.axes), "").axes[3]
    assert panel.get_xscale() == "log"
    ticks = [[text.get_text() for text in panel.get_xticklabels(minor=minor)] for minor in (False, True)]
    assert ticks == [["1", "2"], []]


def test_a_study_that_mixes_old_and_new_folders_says_so(study, folders, tmp_path):
    out = shutil.copytree(folders / "new", tmp_path / "out")
    shutil.rmtree(out / "preload-2mN")
    shutil.copytree(folders / "old" / "preload-2mN", out / "preload-2mN")
    rows = rows_in(study, out)
    (told,) = remarks(rows)
    assert told.startswith("preload-2mN: run by version 0.1") and "the other cases count contact" in told
    panel = measures_figure(Plan(rows, study.axes), "").axes[3]
    assert list(panel.lines[0].get_xdata()) == [1e-3]
    assert panel.get_title() == "without 1 that counted overlap"
    # The command says it, too.
    (tmp_path / "small.toml").write_text(
        f'scene = "{SCENE[0]}"\n[set]\ngrid.n = 24\noutput.snapshots = ["1 s"]\n[axes]\n'
        'drive.preload = ["1 mN", "2 mN"]\n'
    )
    done = CliRunner().invoke(app, ["study", str(tmp_path / "small.toml"), "--out", str(out), "--collect"])
    assert done.exit_code == 0, done.exception
    assert f"note: {told}" in done.stdout + done.stderr


def test_a_case_whose_curve_is_damaged_has_no_areas(study, folders, tmp_path):
    out = shutil.copytree(folders / "new", tmp_path / "out")
    (out / "preload-1mN" / "curve.csv").write_text("nonsense\n")
    rows = rows_of(cases_of(study), study.axes, {
        case.name: case_state_of(case, folders / "new" / case.name) for case in cases_of(study)
    }, out)  # fmt: skip
    assert [row.measured["largest_contact_area [m^2]"] is None for row in rows] == [True, False]
    assert json.loads((out / "preload-1mN" / "run.json").read_text())["steps"] == rows[0].measured["steps"]
