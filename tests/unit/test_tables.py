"""Tables are declared once: their headers, what is written and read back, what their columns can hold, their page."""

import math
import re
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from pgfmd.errors import ResultError
from pgfmd.files.table_reading import faults_of, pieces_of, read_columns
from pgfmd.files.table_writing import TableFile
from pgfmd.files.tables import CURVE, ENERGY, EVENTS, KINDS, PATCHES, PHASES, SITES, TABLES, EventRow, PatchRow
from pgfmd.physics import contact_sites
from pgfmd.results import load
from pgfmd.results.verify import verify
from pgfmd.solver.patches import Patch
from scripts.studies.pages import filled, page_named
from scripts.studies.reference_pages import columns
from tests.unit.synthetic_results import as_version_0_1, history, write_results

HEADERS = {
    "curve": "time [s],displacement [m],indentation [m],force [N],contact_area [m^2],overlap_area [m^2],"
    "near_area [m^2],u_inf [m],step [s],cycle,stage,phase\n",
    "energy": "time [s],work [J],elastic [J],adhesive [J],viscous [J],released [J],residual [J]\n",
    "events": "time [s],displacement [m],force [N],released [J],event,joined,left,x [m],y [m],at\n",
    "patches": "snapshot,time [s],patch,area [m^2],force [N],x [m],y [m],summits,saddles,valleys,kind,nearest\n",
    "sites": "time [s],displacement [m],force [N],phase,kind,site,x [m],y [m],event,in_contact,of\n",
}
"""What users read: to the letter."""
OF_0_1 = "time [s],displacement [m],indentation [m],force [N],contact_area [m^2],u_inf [m],step [s],phase\n"
LONG = "; ".join(f"{k} ridge" for k in range(40))
"""A text of more letters than any width that an array might have for it."""


def event(k: int, **others) -> EventRow:
    return replace(EventRow(k / 3.0, -1e-6 / 7.0**k, math.pi * 10.0**-k, 0.0, "jump"), **others)


def write(path: Path, table, rows) -> Path:
    file = TableFile(table, path, MPI.COMM_SELF)
    for row in rows:
        file.append(row)
    file.close()
    return path


def test_headers_are_those_that_users_know():
    assert {table.name: table.headers[0] for table in TABLES} == HEADERS
    assert CURVE.headers[1:] == [HEADERS["curve"].replace("cycle,stage,", ""), OF_0_1]
    assert all(len(table.headers) == 1 for table in (ENERGY, EVENTS, PATCHES, SITES))
    assert [table.file for table in TABLES] == [f"{table.name}.csv" for table in TABLES]


def test_what_the_declarations_repeat_of_other_modules_agrees():
    assert KINDS == contact_sites.KINDS
    declared = [entry.name for entry in fields(PatchRow)]
    assert declared[declared.index("patch") + 1 :] == [entry.name for entry in fields(Patch)][1:]


@pytest.mark.parametrize("without_pandas", [False, True])
def test_every_digit_and_every_letter_comes_back(tmp_path, monkeypatch, without_pandas):
    if without_pandas:
        monkeypatch.setitem(sys.modules, "pandas", None)
    write_results(tmp_path, rows=20, fields=False)
    rows = [event(k, joined=LONG[: 50 * k], at="saddle 40", x=0.1 / (k + 1)) for k in range(5)]
    rows.append(event(6, event="max_steps reached", released=-0.0))
    (tmp_path / "events.csv").unlink()
    write(tmp_path / "events.csv", EVENTS, rows)
    found = load(tmp_path).events
    assert len(rows[4].joined) == 200
    for entry in EVENTS.columns:
        written = [getattr(row, entry.name) for row in rows]
        read = np.asarray(found[entry.title])
        # NaN is no number to be equal to.
        assert list(map(repr, read.tolist())) == list(map(repr, written)), entry


def test_a_text_that_fits_in_no_cell_is_refused_and_the_table_is_as_it_was(tmp_path):
    path = write(tmp_path / "events.csv", EVENTS, [event(0)])
    before, file = path.read_bytes(), TableFile(EVENTS, path, MPI.COMM_SELF)
    for text in ("a, b", "a\nb", 'say "a"'):
        with pytest.raises(ResultError, match=r"events.csv: could not be written: at = .*no commas"):
            file.append(event(1, at=text))
    assert path.read_bytes() == before and file.rows == 1


def test_an_earlier_curve_is_read_with_gaps_where_it_has_no_columns(tmp_path):
    new = read_columns(write_results(tmp_path / "new", rows=20, fields=False) / "curve.csv", CURVE)
    old = read_columns(as_version_0_1(tmp_path / "new") / "curve.csv", CURVE)
    assert list(old) == list(CURVE.titles)
    for title, values in old.items():
        if title in ("overlap_area [m^2]", "near_area [m^2]", "cycle", "stage"):
            assert np.isnan(values).all()
        else:
            expected = new["overlap_area [m^2]" if title == "contact_area [m^2]" else title]
            assert values.tolist() == expected.tolist()
    assert list(faults_of(CURVE, [old])) == []


def test_a_curve_of_an_earlier_build_is_continued_with_the_columns_that_it_has(tmp_path):
    (tmp_path / "curve.csv").write_text(CURVE.headers[1])
    write(tmp_path / "curve.csv", CURVE, history(3))
    assert (tmp_path / "curve.csv").read_text().startswith(CURVE.headers[1])
    found = read_columns(tmp_path / "curve.csv", CURVE)
    assert found["phase"].tolist() == [row.phase for row in history(3)] and np.isnan(found["stage"]).all()
    assert found["near_area [m^2]"].tolist() == [row.near_area for row in history(3)]


def test_what_a_column_cannot_hold_is_found_in_its_row(tmp_path):
    folder = write_results(tmp_path, rows=40, fields=False)
    whole = {table.name: read_columns(folder / table.file, table) for table in TABLES}
    for table in TABLES:
        assert list(faults_of(table, [whole[table.name]])) == []
    wrong = {
        ("curve", "force [N]", 7, math.nan): "not finite",
        ("curve", "near_area [m^2]", 39, -1.0): "below 0",
        ("curve", "time [s]", 24, 0.5): "falls",
        ("curve", "phase", 3, "pause"): f"none of {', '.join(map(repr, PHASES))}",
        ("energy", "viscous [J]", 0, math.inf): "not finite",
        ("events", "x [m]", 1, -math.inf): "not finite",
        ("patches", "area [m^2]", 0, -1e-9): "below 0",
        ("sites", "event", 1, "stays"): "none of 'joins', 'leaves'",
        ("sites", "in_contact", 0, -1): "below 0",
    }
    for (name, title, row, value), what in wrong.items():
        table, columns = next(table for table in TABLES if table.name == name), whole[name]
        damaged = columns | {title: np.concatenate([columns[title][:row], [value], columns[title][row + 1 :]])}
        for parts in (1, 5):
            # In pieces as well: a time may fall from one to the next.
            split = {key: np.array_split(values, parts) for key, values in damaged.items()}
            (fault,) = faults_of(table, [{key: part[k] for key, part in split.items()} for k in range(parts)])
            assert (fault.title, fault.what, fault.row) == (title, what, row), (name, parts)
    # NaN is a value where it says that there is no place.
    assert list(faults_of(EVENTS, [whole["events"] | {"x [m]": np.full(2, math.nan)}])) == []


def test_verify_holds_a_table_without_a_witness_against_its_declaration(tmp_path):
    folder = write_results(tmp_path, rows=40, fields=False)
    (folder / "run.json").unlink()

    def found():
        return {part.path.name: part for part in verify(folder)}

    assert found()["curve.csv"].fine and "its 40 rows are such as its columns can have" in found()["curve.csv"].found
    lines = (folder / "curve.csv").read_text().splitlines(keepends=True)
    for damage, told in (
        ([*lines[:20], lines[21], lines[20], *lines[22:]], "time [s] falls in row 20, and no checkpoint tells"),
        ([*lines[:20], "1.0,half\n", *lines[21:]], "line 21 is no row of it"),
        (["a,b\n", *lines[1:]], "its first line is 'a,b'"),
    ):
        (folder / "curve.csv").write_text("".join(damage))
        part = found()["curve.csv"]
        assert not part.fine and told in part.found and part.cure


def test_pieces_are_those_of_the_whole(tmp_path, monkeypatch):
    folder = write_results(tmp_path, rows=40, fields=False)
    whole = read_columns(folder / "curve.csv", CURVE)
    monkeypatch.setattr("pgfmd.files.table_reading.PIECE", 7)
    pieces = list(pieces_of(folder / "curve.csv", CURVE, 30))
    assert [len(piece["phase"]) for piece in pieces] == [7, 7, 7, 7, 2]
    for title, values in whole.items():
        assert np.concatenate([piece[title] for piece in pieces]).tolist() == values[:30].tolist()


def test_the_page_says_what_is_declared():
    page = page_named("results.md").read_text(encoding="utf-8")
    assert re.findall(r"<!-- columns (\w+) -->", page) == [table.name for table in TABLES]
    assert filled(page, "columns", columns.block) == page
    for table in TABLES:
        assert all(f"`{title}`" in columns.block(table.name) for title in table.titles)
