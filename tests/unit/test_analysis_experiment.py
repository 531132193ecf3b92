"""Reading measured curves: units, delimiters, signs, and messages that help."""

import numpy as np
import pytest

from pgfmd.analysis.experiment import read_experiment
from pgfmd.errors import MeasurementError

ROWS = [(0.0, 0.0, 0.0), (1.0, 4.0, 2.0), (2.0, 9.0, 4.0), (0.5, 2.0, 6.0), (-1.0, -1.0, 8.0)]


def write(path, header, rows=ROWS, mark=","):
    lines = [header, *(mark.join(map(str, row)) for row in rows)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    "header",
    [
        "displacement (um),force (mN),time (s)",
        "Displacement [µm],Load [mN],Time [s]",
        "displacement_um,force_mN,time_s",
        "indentation / um,F / mN,t / s",
        "# a comment\n\nindentation (um),force (mN),time (s)",
        "depth (um),normal force (mN),time (s)",
    ],
)
def test_columns_are_read_in_si_units(tmp_path, header):
    loop = read_experiment(write(tmp_path / "exp.csv", header))
    np.testing.assert_allclose(loop.indentation, [1e-6 * row[0] for row in ROWS], rtol=1e-12, atol=1e-20)
    np.testing.assert_allclose(loop.force, [1e-3 * row[1] for row in ROWS], rtol=1e-12, atol=1e-20)
    np.testing.assert_array_equal(loop.time, [row[2] for row in ROWS])
    assert loop.name == "exp" and loop.preload_row == 2
    assert loop.phase.tolist() == ["approach"] * 3 + ["retract"] * 2


def test_semicolons_with_decimal_commas_foreign_columns_and_no_time(tmp_path):
    rows = [tuple(str(value).replace(".", ",") for value in (row[1], "ok", row[0])) for row in ROWS]
    loop = read_experiment(write(tmp_path / "exp.csv", "force (mN);remark;displacement (nm)", rows, ";"))
    np.testing.assert_allclose(loop.indentation, [1e-9 * row[0] for row in ROWS], rtol=1e-12, atol=1e-20)
    assert np.isnan(loop.time).all()


def test_signs_are_told_and_a_contradiction_is_refused(tmp_path):
    both = [(-row[0], -row[1]) for row in ROWS]
    path = write(tmp_path / "exp.csv", "displacement (um),force (mN)", both)
    plain = read_experiment(write(tmp_path / "plain.csv", "displacement (um),force (mN)", [row[:2] for row in ROWS]))
    turned = read_experiment(path, "out", "tension")
    np.testing.assert_array_equal(turned.force, plain.force)
    np.testing.assert_array_equal(turned.indentation, plain.indentation)
    with pytest.raises(MeasurementError, match=r"--positive-displacement in\|out"):
        read_experiment(path, "out", "compression")
    with pytest.raises(ValueError, match="'in' or 'out'"):
        read_experiment(path, "up")


def test_a_curve_of_pgfmd_itself_is_a_measurement_too(tmp_path):
    header = "time [s],displacement [m],indentation [m],force [N],contact_area [m^2]"
    rows = [(row[2], -1e-6 * row[0], 1e-6 * row[0], 1e-3 * row[1], 0.0) for row in ROWS]
    loop = read_experiment(write(tmp_path / "curve.csv", header, rows))
    np.testing.assert_allclose(loop.indentation, [1e-6 * row[0] for row in ROWS], rtol=1e-12, atol=1e-20)


@pytest.mark.parametrize(
    ("header", "rows", "words"),
    [
        ("displacement,force (mN),time (s)", ROWS, "column 'displacement': expected a unit of length, found none"),
        ("displacement (mN),force (mN),time (s)", ROWS, '"1 mN" is a force'),
        ("displacement (um),force (furlong),time (s)", ROWS, "found 'furlong'"),
        ("displacement (um),moment (Nm),time (s)", ROWS, "expected columns for displacement .* found displacement"),
        ("force (mN),load (N),displacement (um)", ROWS, "one column with force, found several"),
        ("displacement (um),force (mN)", [(0, 0), (1, "x"), (2, 3), (1, 1)], "line 3: force = 'x': expected a number"),
        ("displacement (um),force (mN)", [(0, 0), (1,), (2, 3), (1, 1)], "line 3: force = '': expected a number"),
        ("displacement (um),force (mN)", [(0, 0), (1, 1)], "at least 4 rows of numbers, found 2"),
        ("displacement (um),force (mN)", [(1, 1)] * 6, "found neither"),
        (
            "displacement (um),force (mN),time (s)",
            [(0, 1, 2), (2, 3, 3), (1, 1, 2.5), (0, 0, 9)],
            "line 4: time = '2.5': expected a time that does not fall, it was '3' in line 3; bring the rows",
        ),
        (
            "time (s),displacement (um),force (mN)",
            [("0,00", "10,1", "20,0"), ("0,10", "10,2", "20,5")] * 2,
            r"line 2: expected 3 cells as in the header, found 6 \('0,00,10,1,20,0'\); decimal commas need semicolons",
        ),
        ("displacement (um),force (mN),", [(0, 1), (2, 3), (1, 1, "x"), (0, 0)], "line 4: expected 2 cells .* found 3"),
        ("displacement (um),force (mN)", [(0, 1), (2, "", 3), (1, 1), (0, 0)], "line 3: expected 2 cells .* found 3"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, header, rows, words):
    with pytest.raises(MeasurementError, match=words) as caught:
        read_experiment(write(tmp_path / "exp.csv", header, rows))
    assert "exp.csv" in str(caught.value)


def test_empty_cells_at_the_end_and_equal_times_are_fine(tmp_path):
    rows = [(*row[:2], min(row[2], 5.0), "", "") for row in ROWS]
    loop = read_experiment(write(tmp_path / "exp.csv", "displacement (um),force (mN),time (s),", rows))
    np.testing.assert_array_equal(loop.time, [0, 2, 4, 5, 5])


def test_cells_beyond_the_header_need_a_name_where_commas_part_nothing(tmp_path):
    path = write(tmp_path / "exp.csv", "displacement (um);force (mN)", ROWS, ";")
    with pytest.raises(MeasurementError, match=r"found 3 .*; give every column a name in the header"):
        read_experiment(path)


def test_many_wrong_lines_are_counted(tmp_path):
    path = write(tmp_path / "exp.csv", "displacement (um),force (mN)", [(1, 1), *[("?", 1), (1, "?")] * 5])
    with pytest.raises(MeasurementError, match="and 5 more like these"):
        read_experiment(path)


def test_files_that_are_no_tables(tmp_path):
    with pytest.raises(MeasurementError, match=r"missing\.csv: could not be read"):
        read_experiment(tmp_path / "missing.csv")
    (tmp_path / "empty.csv").write_text("\n# nothing\n")
    with pytest.raises(MeasurementError, match="found an empty file"):
        read_experiment(tmp_path / "empty.csv")
    (tmp_path / "raw.csv").write_bytes(b"\x00\x81\xff\x00")
    with pytest.raises(MeasurementError, match=r"raw\.csv: could not be read: not a text file"):
        read_experiment(tmp_path / "raw.csv")
