"""Measured curves in the shapes that machines write: read to the right numbers, or refused with the cure."""

import re
import zlib
from pathlib import Path
from typing import ClassVar
from zipfile import BadZipFile

import numpy as np
import pytest
from typer.testing import CliRunner

from pgfmd.analysis.afm_curves import _rows
from pgfmd.analysis.compliance import corrected_experiment
from pgfmd.analysis.experiment import read_experiment
from pgfmd.cli import app
from pgfmd.errors import MeasurementError
from pgfmd.results.curve import measure
from tests.unit.analysis_loops import flat_punch_loop, write_folder
from tests.unit.measured_inputs import HYSTERESIS, PULL_OFF, SEPARATION, jkr_loop, written

TIME, DEPTH, FORCE, TURN = jkr_loop()
UM, MN = 1e6 * DEPTH, 1e3 * FORCE
PLAIN = "time (s),displacement (um),force (mN)"


def right(loop, closed=True, rel=0.015):
    """Whether a loop has the numbers of the closed form."""
    found = measure(loop)
    assert found.pull_off.tension == pytest.approx(PULL_OFF, rel=rel)
    assert found.work_of_separation == pytest.approx(SEPARATION, rel=rel)
    assert found.hysteresis == (pytest.approx(HYSTERESIS, rel=2 * rel) if closed else None)
    return loop


def refused(path, words, **reading):
    with pytest.raises(MeasurementError, match=words) as caught:
        read_experiment(path, **reading)
    assert path.name in str(caught.value)


def test_a_plain_table_has_the_numbers_of_the_closed_form(tmp_path):
    loop = right(read_experiment(written(tmp_path / "a.csv", PLAIN, TIME, UM, MN)))
    assert loop.treated == "" and loop.remarks == () and loop.preload == pytest.approx(10e-3, rel=1e-6)


@pytest.mark.parametrize("offset", [-0.707, 4.0])
def test_a_force_that_is_not_zero_far_away_is_taken_off(tmp_path, offset):
    loop = right(read_experiment(written(tmp_path / "offset.csv", PLAIN, TIME, UM, MN + offset)))
    assert f"force far away, {'-707 uN' if offset < 0 else '4 mN'}, taken off" in loop.treated
    given = read_experiment(tmp_path / "offset.csv", baseline=1e-3 * offset)
    np.testing.assert_allclose(given.force, loop.force, atol=1e-9)
    kept = read_experiment(tmp_path / "offset.csv", baseline=0.0)
    assert measure(kept).pull_off.tension == pytest.approx(max(PULL_OFF - 1e-3 * offset, 0.0), rel=0.015)


def test_a_drift_is_taken_off_along_a_line_and_told(tmp_path):
    drift = np.linspace(0.5, 1.5, UM.size)
    loop = read_experiment(written(tmp_path / "drift.csv", "displacement (um),force (mN)", UM, MN + drift))
    assert measure(loop).pull_off.tension == pytest.approx(PULL_OFF, rel=0.03)
    assert "the force far away drifts from 521 uN" in loop.remarks[0] and "to 1.47 mN" in loop.remarks[0]
    # A machine drifts in time, however many rows it writes.
    slow = np.where(np.arange(UM.size) < TURN, TIME, 5.0 * TIME - 4.0 * TIME[TURN - 1])
    drift = 0.5 + slow / slow[-1]
    loop = read_experiment(written(tmp_path / "slow.csv", PLAIN, slow, UM, MN + drift))
    np.testing.assert_allclose(loop.force, FORCE, atol=1e-8)


def test_a_plateau_of_tension_at_the_end_is_no_drift(tmp_path):
    end = np.arange(UM.size) >= UM.size - 14
    held = np.where(end, -2.0, MN)
    loop = read_experiment(written(tmp_path / "held.csv", PLAIN, TIME, UM, held))
    np.testing.assert_allclose(1e3 * loop.force, held, atol=1e-6)
    assert (
        loop.treated == ""
        and "0 N before the contact and -2 mN at the end, too different for a drift" in loop.remarks[0]
    )


def test_strong_adhesion_is_no_wrong_sign(tmp_path):
    # 1 N of preload, 10 N of tension, and a long way out.
    place = np.concatenate([np.linspace(-100, 4, 105), np.linspace(4, -5, 10)[1:], np.linspace(-6, -100, 95)])
    force = np.interp(place, [0.0, 4.0], [0.0, 1.0])
    force[105:114] = np.linspace(0.5, -10.0, 9)
    for snap in (0.0, -3.0):
        force[100:103] = snap
        path = written(tmp_path / "strong.csv", "displacement (um),force (N)", place, force)
        loop = read_experiment(path)
        assert loop.preload == 1.0 and measure(loop).pull_off.tension == pytest.approx(10.0, rel=0.1)
        refused(path, "expected the force to rise", positive_force="tension")
        for sense in ("compression", "tension"):
            refused(
                path, "expected the (force to rise|largest force)", positive_displacement="out", positive_force=sense
            )


def test_a_curve_that_ends_in_contact_says_that_its_zero_is_not_known(tmp_path):
    inside = DEPTH > 2e-6
    loop = read_experiment(written(tmp_path / "in.csv", PLAIN, TIME[inside], UM[inside], MN[inside] + 3.0))
    assert "do not show the force far away" in loop.remarks[0] and loop.treated == ""


def test_both_signs_flipped_are_seen(tmp_path):
    path = written(tmp_path / "pull.csv", "time (s),displacement (mm),load (N)", TIME, -UM / 1e3, -MN / 1e3)
    refused(path, "--positive-displacement out --positive-force tension")
    refused(
        written(tmp_path / "more.csv", PLAIN, TIME, -UM, 3.0 - MN),
        "--positive-displacement out --positive-force tension",
    )
    right(read_experiment(path, positive_displacement="out", positive_force="tension"))
    refused(path, "--positive-displacement in|out", positive_displacement="out")
    # What is said counts for more than a name, of an indentation as well.
    path = written(tmp_path / "depth.csv", "time (s),indentation (mm),load (N)", TIME, -UM / 1e3, MN / 1e3)
    refused(path, "--positive-displacement in|out")
    right(read_experiment(path, positive_displacement="out"))
    # A name that says it needs no flag for its own column.
    path = written(tmp_path / "zwick.csv", "time (s),extension (mm),load (N)", TIME, -UM / 1e3, -MN / 1e3)
    refused(path, "the extension is taken to grow outwards, the force in compression")
    right(read_experiment(path, positive_force="tension"))


@pytest.mark.parametrize(("coding", "mark"), [("cp1252", ";"), ("utf-16", "\t"), ("utf-8-sig", ";")])
def test_tables_of_windows_programs(tmp_path, coding, mark):
    header = mark.join(["time (s)", "displacement (µm)", "force (mN)"])
    right(read_experiment(written(tmp_path / "m.csv", header, TIME, UM, MN, mark=mark, coding=coding, decimal=",")))


def test_one_branch_alone_has_no_loop(tmp_path):
    out = slice(TURN - 1, None)
    loop = right(read_experiment(written(tmp_path / "r.csv", PLAIN, TIME[out], UM[out], MN[out])), closed=False)
    assert "holds the retraction alone" in loop.remarks[0]
    way_in = slice(0, TURN)
    loop = read_experiment(written(tmp_path / "a.csv", PLAIN, TIME[way_in], UM[way_in], MN[way_in]))
    found = measure(loop)
    assert "holds the approach alone" in loop.remarks[0] and found.pull_off is None and found.hysteresis is None
    path = written(tmp_path / "flipped.csv", PLAIN, TIME[out], -UM[out], -MN[out])
    refused(path, "expected the largest force where the punch is deepest")


def test_a_rheometers_export(tmp_path):
    header = (
        "Project:,tack,,,\n,,,,\nTest:,punch 1,,,\n,,,,\nInterval and data points:,1,190,,\n"
        "Interval data:,Point No.,Normal Force,Gap,Time\n,,,,\n,,[N],[mm],[s]"
    )
    number = np.arange(UM.size)
    columns = [""] * UM.size, number, MN / 1e3, 2.0 - UM / 1e3, TIME
    right(read_experiment(written(tmp_path / "tack.csv", header, *columns)))
    # Two intervals, whose times begin anew, each with its head; and words below the numbers.
    text = (tmp_path / "tack.csv").read_text().splitlines()
    first, rest = text[: 8 + TURN], text[8 + TURN :]
    start = float(rest[0].rpartition(",")[2])
    again = [f"{line.rpartition(',')[0]},{float(line.rpartition(',')[2]) - start:.7g}" for line in rest]
    two = [*first, "Interval and data points:,2,100,,", *text[5:8], *again, "Interval data:,end,of,the,data"]
    (tmp_path / "two.csv").write_text("\n".join(two))
    loop = right(read_experiment(tmp_path / "two.csv"))
    told = " ".join(loop.remarks)
    assert "2 blocks with the same header" in told and "its time begins anew" in told and "below the numbers" in told


@pytest.mark.parametrize(
    "header",
    [
        "Extend Z-Sense(um),Extend Force(mN),Retract Z-Sense(um),Retract Force(mN)",
        "Approach,,Retract,\nz (um),F (mN),z (um),F (mN)",
        "depth_um_Ex,Force_mN_Ex,depth_um_Rt,Force_mN_Rt",
    ],
)
def test_branches_side_by_side(tmp_path, header):
    rows = UM.size - TURN + 1
    padded = [[*map(float, column[:TURN]), *[""] * (rows - TURN)] for column in (UM, MN)]
    out = [list(map(float, column[TURN - 1 :])) for column in (UM, MN)]
    right(read_experiment(written(tmp_path / "fd.csv", header, *padded, *out)))
    # Sorted by position, both: their names say which way each goes.
    turned = [column[::-1] for column in out]
    loop = right(read_experiment(written(tmp_path / "sorted.csv", header, *padded, *turned)))
    assert "the rows of the retract run against its way" in " ".join(loop.remarks)


def test_columns_that_stand_twice_are_refused(tmp_path):
    path = written(tmp_path / "x.csv", "z (um),F (mN),z (um),F (mN)", UM, MN, UM + 1, MN)
    refused(path, "expected one column with displacement, found several.*put the rows of the retraction below")
    path = written(tmp_path / "y.csv", "z (um),gap (um),F (mN)", UM, 2 - UM, MN)
    refused(path, "one column that says the position, found 'z \\(um\\)' and 'gap \\(um\\)'")
    # The same numbers twice are one column.
    right(read_experiment(written(tmp_path / "z.csv", "z (um),F (mN),z (um)", UM, MN, UM)))


def test_sorted_halves_are_refused_and_those_with_names_are_turned(tmp_path):
    order = np.concatenate([np.arange(TURN), np.arange(TURN, UM.size)[::-1]])
    path = written(tmp_path / "s.txt", "displacement (um)\tforce (mN)", UM[order], MN[order], mark="\t")
    refused(path, r"line \d+: expected rows in the order .* sorted by position\? turn the rows of one branch round")
    names = ["approach"] * TURN + ["retract"] * (UM.size - TURN)
    header = "displacement (um),force (mN),segment"
    loop = right(read_experiment(written(tmp_path / "named.csv", header, UM[order], MN[order], names)))
    assert "were turned round" in loop.remarks[0]


def test_rows_from_the_last_to_the_first_give_energy_and_are_refused(tmp_path):
    path = written(tmp_path / "r.csv", "displacement (um),force (mN)", UM[::-1], MN[::-1])
    refused(path, r"its net work is -2\.\d+ nJ, -\d.* of all work: no elastomer gives any")


def test_of_several_cycles_one_is_chosen(tmp_path):
    times = np.concatenate([TIME + n * 1.1 * TIME[-1] for n in range(3)])
    forces = np.concatenate([np.where(MN > 0, MN, share * MN) for share in (1.0, 0.98, 0.96)])
    path = written(tmp_path / "c.csv", PLAIN, times, np.tile(UM, 3), forces)
    refused(path, "expected one cycle, found 3 .*choose one: --cycle 1 to 3")
    right(read_experiment(path, cycle=1))
    assert measure(read_experiment(path, cycle=3)).pull_off.tension == pytest.approx(0.96 * PULL_OFF, rel=0.01)
    refused(path, "expected a cycle from 1 to 3, found --cycle 4", cycle=4)
    numbers = np.repeat([1, 2, 3], UM.size)
    path = written(tmp_path / "n.csv", f"{PLAIN},cycle", times, np.tile(UM, 3), forces, numbers)
    refused(path, "found the numbers 1, 2, 3; choose one: --cycle N")
    assert measure(read_experiment(path, cycle=2)).pull_off.tension == pytest.approx(0.98 * PULL_OFF, rel=0.01)


@pytest.mark.parametrize(
    ("header", "scales"),
    [
        ("Zeit (s),Weg (µm),Kraft (mN)", (1, 1, 1)),
        ("t in s,Eindringtiefe in um,Normalkraft in mN", (1, 1, 1)),
        ("Time/s,Depth/nm,F_N/uN", (1, 1e3, 1e3)),
        ("Time (s),Piezo (um),Load (gf)", (1, 1, 1 / 9.80665)),
        ("Time (min),Position (mm),Load (kgf)", (1 / 60, 1e-3, 1e-3 / 9.80665)),
    ],
)
def test_names_and_units_of_many_programs(tmp_path, header, scales):
    columns = [scale * column for scale, column in zip(scales, (TIME, UM, MN), strict=True)]
    right(read_experiment(written(tmp_path / "m.csv", header, *columns)))


def test_rows_without_numbers_are_passed_over_only_where_nothing_is_lost(tmp_path):
    path = written(tmp_path / "m.csv", PLAIN, TIME, UM, MN, after=",,\nMean,0.5,2.5\nComment: slipped,,\n")
    loop = right(read_experiment(path))
    assert "passed over" in loop.remarks[0]
    lines = path.read_text().splitlines()
    lines[20] = "NaN,NaN,NaN"
    path.write_text("\n".join(lines))
    assert "passed over line 21, without a number" in " ".join(right(read_experiment(path)).remarks)
    lines[20] = "0.1,-3,#N/A"
    path.write_text("\n".join(lines))
    refused(path, "line 21: force = '#N/A': expected a number")


def test_a_deflection_in_volts_is_no_force(tmp_path):
    refused(written(tmp_path / "v.csv", "z (um),deflection (V)", UM, MN), "expected a unit of force, found 'V'")
    refused(written(tmp_path / "g.csv", "z (um),load (g)", UM, MN), "expected a unit of force, found 'g'")


def test_compare_takes_several_measured_curves(tmp_path):
    folder = write_folder(tmp_path / "run", flat_punch_loop(), "")
    names = [
        written(tmp_path / f"{name}.csv", PLAIN, TIME, UM, MN + offset) for name, offset in (("a", 0.0), ("b", 1.0))
    ]
    out = slice(TURN - 1, None)
    part = written(tmp_path / "part.csv", PLAIN, TIME[out], UM[out], MN[out])
    done = CliRunner().invoke(app, list(map(str, ["compare", folder, *names, part, "-o", tmp_path / "all.png"])))
    assert done.exit_code == 0, done.exception
    assert re.search(r"^b +force far away, 1 mN, taken off *$", done.stdout, re.MULTILINE)
    forces = [float(text) for text in re.findall(r"^pull-off force +(\S+)", done.stdout, re.MULTILINE)]
    assert forces[1:] == pytest.approx([PULL_OFF] * 3, rel=0.015)
    assert re.search(r"^hysteresis +- +J? *.*the loop is not closed", done.stdout, re.MULTILINE)
    assert re.search(r"holds the retraction alone", done.stdout)


class Curve:
    """A curve of afmformats that reads its columns when they are asked for; what can't be read is an error to raise."""

    metadata: ClassVar = {"spring constant": 38e3}

    def __init__(self, **columns):
        self.data = {name.replace("_", " "): values for name, values in columns.items()}
        self.data["height (measured)"] = self.data.pop("measured")
        self.data["height (piezo)"] = self.data.pop("piezo")

    @property
    def columns(self):
        return sorted(self.data)

    def __getitem__(self, name):
        if isinstance(self.data[name], BaseException):
            raise self.data[name]
        return self.data[name]


def test_columns_of_a_force_microscope_that_can_not_be_read():
    class NoSuchColumnError(BaseException):
        """As afmformats' own errors are."""

    NoSuchColumnError.__module__ = "afmformats.formats"
    lacking, path = NoSuchColumnError("could not find\ncolumn"), Path("a.jpk-force")
    rows = _rows(path, Curve(force=FORCE, measured=lacking, piezo=-DEPTH), None, "compression")
    np.testing.assert_array_equal(rows.indentation, DEPTH)
    assert "'height (piezo)'" in rows.remarks[0]
    for columns, words in (
        ({"force": FORCE, "measured": lacking, "piezo": lacking}, r"can't read it \(could not find column\); export"),
        ({"force": zlib.error("invalid block"), "measured": DEPTH, "piezo": DEPTH}, "invalid block"),
        ({"force": FORCE, "measured": BadZipFile("Bad CRC-32"), "piezo": DEPTH}, "Bad CRC-32"),
        ({"force": FORCE, "measured": DEPTH[1:], "piezo": DEPTH}, "as many numbers in each column"),
    ):
        with pytest.raises(MeasurementError, match=f"a.jpk-force: .*{words}"):
            _rows(path, Curve(**columns), None, "compression")
    with pytest.raises(KeyboardInterrupt):
        _rows(path, Curve(force=KeyboardInterrupt(), measured=DEPTH, piezo=DEPTH), None, "compression")


@pytest.mark.parametrize("end", ["h5", "tab"])
def test_a_curve_of_a_force_microscope(tmp_path, end):
    pytest.importorskip("afmformats")
    from afmformats.mod_force_distance import AFMForceDistance

    data = {
        "height (measured)": 2e-5 - DEPTH - FORCE / 38e3,
        "force": FORCE + 2e-3,
        "segment": np.arange(UM.size) >= TURN,
    }
    curve = AFMForceDistance(data, {"spring constant": 38e3, "path": tmp_path / "a", "imaging mode": "force-distance",
                                    "point count": UM.size, "enum": 0})  # fmt: skip
    curve.export_data(tmp_path / f"a.{end}", metadata=True, fmt=end)
    loop = read_experiment(tmp_path / f"a.{end}")
    assert "force far away, 2 mN, taken off" in loop.treated and '--machine-stiffness "38 kN/m"' in loop.remarks[0]
    right(corrected_experiment(loop, 38e3))
    (tmp_path / "b.h5").write_bytes(b"nothing")
    refused(tmp_path / "b.h5", "afmformats can't read it")
    (tmp_path / "b.abc").write_bytes(b"nothing")
    refused(tmp_path / "b.abc", "a kind of file that is not known; export the curve as a table")
