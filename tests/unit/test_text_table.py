"""Tables of text files: decimal marks that are told or refused, headers found among other lines, blocks of numbers."""

import numpy as np
import pytest

from pgfmd.errors import MeasurementError
from pgfmd.files.column_names import Vocabulary, usual_unit
from pgfmd.files.number_block import read_number_block
from pgfmd.files.numerals import is_missing, is_numeral, value
from pgfmd.files.text_table import read_table

NAMES = Vocabulary({"force": ("force", "F"), "time": ("time", "t")})


def file_of(tmp_path, text, coding="utf-8"):
    path = tmp_path / "table.txt"
    path.write_bytes(text.encode(coding))
    return path


def columns_of(path):
    table = read_table(path, NAMES, "time (s), force (mN)")
    return table, table.numbers({column.quantity: column for column in table.columns})


def test_numerals_and_what_is_none():
    for text in ("1", "-1.5", "+2,5", ".5", "1e-3", "1.5D+02", "1,234.5", "1 234", "12'345", "\u22125", '="1.5"'):
        assert is_numeral(text), text
    for text in ("", "a", "1.2.3", "12:30:01", "2026-11-28", "1_000", "nan", "5 mN", "E'"):
        assert not is_numeral(text), text
    for text in ("", "NaN", "n/a", "#N/A", "#DIV/0!", "--", "-", "?", "inf", "1.#QNAN", "no data"):
        assert is_missing(text), text
    assert not any(map(is_missing, ("0", "um", "mN", "pause")))
    assert [value(text, ",") for text in ("1,5", "2", "1,5D2")] == [1.5, 2.0, 150.0]
    assert np.isnan(value("1,5", "."))


@pytest.mark.parametrize(
    ("numbers", "mark", "words"),
    [
        (
            ["1,527", "0.1"],
            "\t",
            "'0.1' and line 2: '1,527': expected one decimal mark, found numbers with a point and",
        ),
        (["1,527", "22,496"], "\t", "'1,527' can be 1.527 or 1527"),
        (["1,527", "950"], ";", "'1,527' can be 1.527 or 1527"),
        (["1,234,567", "1"], "\t", "without thousands separators"),
        (["1.234,5", "1,5"], ";", "line 2: '1.234,5': expected a number without thousands separators"),
        (["12 345", "1"], ";", "without thousands separators"),
        (["1'234.5", "1"], ",", "without thousands separators"),
    ],
)
def test_thousands_separators_are_refused(tmp_path, numbers, mark, words):
    rows = "\n".join(f"{number}{mark}{row}" for row, number in enumerate(numbers))
    with pytest.raises(MeasurementError, match=words):
        columns_of(file_of(tmp_path, f"force (mN){mark}time (s)\n{rows}\n"))


@pytest.mark.parametrize(
    ("numbers", "mark"),
    [(["1,5", "2"], "\t"), (["0,500", "1,250"], "\t"), (["1,527", "2,040"], ";"), (['"1,52"', "2"], ",")],
)
def test_decimal_commas_are_told(tmp_path, numbers, mark):
    rows = "\n".join(f"{number}{mark}{row}" for row, number in enumerate(numbers))
    _, found = columns_of(file_of(tmp_path, f"force (mN){mark}time (s)\n{rows}\n"))
    expected = [float(number.strip('"').replace(",", ".")) for number in numbers]
    np.testing.assert_array_equal(found["force"], expected)


def test_a_declaration_above_the_table_decides(tmp_path):
    text = "force (mN)\ttime (s)\n1,527\t0\n22,496\t1\n"
    _, found = columns_of(file_of(tmp_path, f"# decimal: comma\n{text}"))
    np.testing.assert_array_equal(found["force"], [1.527, 22.496])
    with pytest.raises(MeasurementError, match=r"expected '\.' as the decimal mark, as the file declares"):
        columns_of(file_of(tmp_path, f"#DECIMAL:POINT\n{text}"))


@pytest.mark.parametrize(
    "text",
    [
        "Report of 3 tests\nOperator: time lord\n\nforce (mN);time (s)\n1;2\n3;4\n",
        "##force/mN;time/s\n1;2\n3;4\n",
        "time\tforce\ns\tmN\nA\tB\n2\t1\n4\t3\n",
        "force (mN)   time (s)\n 1.0  2.0\n 3.0  4.0\n",
        "# columns: force_mN time_s\n1 2\n3 4\n",
        "# columns: force time\n# units: mN s\n1 2\n3 4\n",
        "force (\u00c2mN),time (s)\n1,2\n3,4\n",
        '"force\n(mN)","time (s)"\n1,2\n3,4\n',
        "force [mN],time [s],remark,\n1,2,first,\n3,4,,\n",
        "force (mN),time (s)\n1,2\n\npause\nforce (mN),time (s)\n3,4\n",
    ],
)
def test_headers_are_found_with_their_units(tmp_path, text):
    table, found = columns_of(file_of(tmp_path, text))
    assert {column.quantity: column.unit for column in table.columns} == {"force": "mN", "time": "s"}
    np.testing.assert_array_equal(found["force"], [1, 3])
    np.testing.assert_array_equal(found["time"], [2, 4])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "found an empty file"),
        ("# nothing\n", "found an empty file"),
        ("1,2\n3,4\n", "line 1: expected a header .* found numbers"),
        ("a,b\n1,2\n", "line 1: expected a header such as time .s., force .mN., found a, b"),
        ("head\n\nx;y\n1;2\n", "line 3: expected a header .* found x, y"),
        ("only words\n", "line 1: expected a header of several columns"),
        ("force (mN),time (s)\n", "expected numbers below the header in line 1, found none"),
        ("force (mN),time (s)\n1,2,3\n", "expected 2 cells as in the header, found 3"),
        ("force (mN),time (s)\n1,2\ntime (s),force (mN)\n3,4\n", "line 3: .*differ from those in line 1"),
        ("force (mN),time\nN,s\n1,2\n", "column 'force .mN.': expected one unit, but line 2 has 'N'"),
    ],
)
def test_what_is_no_table_is_refused(tmp_path, text, words):
    with pytest.raises(MeasurementError, match=words):
        columns_of(file_of(tmp_path, text))


def test_units_in_other_spellings():
    assert [usual_unit(unit) for unit in ("kpa", "N/mm2", "N/mm²", "hz", "s.")] == ["kPa", "N/mm^2", "N/mm²", "Hz", "s"]


@pytest.mark.parametrize(
    ("text", "delimiter"),
    [
        ("# Width: 840 µm\n# Value units: µm\n1.5 2.5 3.5\n4.5 5.5 6.5\n", " "),
        ("1.5,2.5,3.5,\n4.5,5.5,6.5,\n", ","),
        ("1,5;2,5;3,5\n4,5;5,5;6,5\n", ";"),
        ("1,5\t2,5\t3,5\r\n4,5\t5,5\t6,5\r\n", "\t"),
        ("Profile of today\n12\n\n1.5 2.5 3.5 # first\n4.5 5.5 6.5\n", " "),
        ("1,5 2,5 3,5\n4,5 5,5 6,5\n", " "),
    ],
)
@pytest.mark.parametrize("coding", ["utf-8", "cp1252", "utf-16"])
def test_blocks_of_numbers(tmp_path, text, delimiter, coding):
    block = read_number_block(file_of(tmp_path, text, coding))
    np.testing.assert_array_equal(block.values, [[1.5, 2.5, 3.5], [4.5, 5.5, 6.5]])
    assert block.delimiter == delimiter
    if "Width" in text:
        assert block.preamble == ("Width: 840 µm", "Value units: µm") and block.first_line == 3


def test_blocks_with_missing_numbers_names_and_words_below(tmp_path):
    block = read_number_block(file_of(tmp_path, "X (um);Y (um);Z (um)\n1,5;2;NaN\n2,25;;---\nend of file\n"))
    assert block.header == ("X (um)", "Y (um)", "Z (um)") and block.first_line == 2
    np.testing.assert_array_equal(block.values, [[1.5, 2, np.nan], [2.25, np.nan, np.nan]][:2])
    assert "line 4, below the numbers" in block.notes[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("words\nand more words\n", "expected rows of at least two numbers"),
        ("1 2 3\n4 5\n6 7 8\n", "line 2: expected 3 numbers as in the other lines, found 2"),
        ("1,527;950\n2,040;11,740\n", "'1,527' can be 1.527 or 1527"),
        ("1,234.5;2\n3;4\n", "without thousands separators"),
    ],
)
def test_blocks_that_can_be_read_in_two_ways_are_refused(tmp_path, text, words):
    with pytest.raises(MeasurementError, match=words):
        read_number_block(file_of(tmp_path, text))
