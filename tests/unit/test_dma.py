"""Reading DMA tables: every way of writing them that is promised, and refusals that name file, line and cure."""

import re

import numpy as np
import pytest

from pgfmd.characterisation.dma import read_moduli, temperature_in_kelvin
from pgfmd.errors import MeasurementError

ROWS = [(0.1, 2.0, 0.25), (1.0, 3.5, 0.75), (10.0, 8.0, 4.0)]


def table(header, rows=ROWS, delimiter=","):
    return "\n".join([header, *(delimiter.join(str(value) for value in row) for row in rows)]) + "\n"


def read(tmp_path, content):
    path = tmp_path / "dma.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode("utf-8"))
    return read_moduli(path).sweeps


HEADERS = {
    "frequency (Hz), E' (MPa), E'' (MPa)": (2 * np.pi, 1e6, 1e6),
    "Frequency [kHz],storage modulus [kPa],loss modulus [kPa]": (2e3 * np.pi, 1e3, 1e3),
    "f / Hz,E' / GPa,E'' / kPa": (2 * np.pi, 1e9, 1e3),
    "omega (rad/s),E′ (MPa),E″ (MPa)": (1.0, 1e6, 1e6),
    "ω,E' (MPa),E'' (MPa)": (1.0, 1e6, 1e6),
    "Angular Frequency (s^-1),E' MPa,E\" MPa": (1.0, 1e6, 1e6),
    "freq_mHz,E'_MPa,E''_MPa": (2e-3 * np.pi, 1e6, 1e6),
    "frequency (rad/s),E' (N/mm^2),\"E'' (N/mm^2)\"": (1.0, 1e6, 1e6),
    "# header below\nfrequency,E',E''\nHz,MPa,[kPa]": (2 * np.pi, 1e6, 1e3),
}


@pytest.mark.parametrize("header", HEADERS)
def test_columns_and_units(tmp_path, header):
    (sweep,) = read(tmp_path, table(header))
    columns = zip(*ROWS, strict=True)
    for values, column, factor in zip((sweep.omega, sweep.storage, sweep.loss), columns, HEADERS[header], strict=True):
        np.testing.assert_allclose(values, factor * np.array(column), rtol=1e-15)
    assert sweep.temperature is None


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_decimal_commas(tmp_path, delimiter):
    header = delimiter.join(["frequency (Hz)", "E' (MPa)", "E'' (MPa)"])
    (sweep,) = read(tmp_path, table(header, ROWS, delimiter).replace(".", ","))
    np.testing.assert_array_equal(sweep.loss, [0.25e6, 0.75e6, 4e6])


@pytest.mark.parametrize("coding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_codings_comments_order_and_columns_without_a_use(tmp_path, coding):
    text = (
        "# made by hand, in °\r\n\r\ntime (s),E'' (MPa),temperature (°C),frequency (Hz),E' (MPa),note\r\n"
        "1,4,25,10,8,late\r\n# a pause\r\n2,0.25,25.2,0.1,2,\r\n,,,,,\r\n3,0.75,24.9,1,3.5,early\r\n"
    )
    (sweep,) = read(tmp_path, text.encode(coding))
    np.testing.assert_allclose(sweep.omega, 2 * np.pi * np.array([0.1, 1, 10]), rtol=1e-15)
    np.testing.assert_array_equal(sweep.storage, [2e6, 3.5e6, 8e6])
    np.testing.assert_array_equal(sweep.loss, [0.25e6, 0.75e6, 4e6])
    assert sweep.temperature == pytest.approx(298.15 + 0.1 / 3, abs=1e-12)


def test_tan_delta_stands_in_for_the_loss_modulus(tmp_path):
    (sweep,) = read(tmp_path, "f (Hz),E' (MPa),tan(delta)\n1,2,0.25\n2,4,0.5\n3,4,0\n")
    np.testing.assert_array_equal(sweep.loss, [0.5e6, 2e6, 0])


def test_temperatures_are_told_apart_and_sorted(tmp_path):
    rows = [(celsius, *row) for celsius in (30.1, -10.0, 5.0) for row in ROWS]
    sweeps = read(tmp_path, table("T (C),f (Hz),E' (MPa),E'' (MPa)", rows))
    np.testing.assert_allclose([sweep.temperature for sweep in sweeps], [263.15, 278.15, 303.25], rtol=1e-14)
    assert all(sweep.omega.size == 3 for sweep in sweeps)
    kelvin = read(tmp_path, table("T [K],f (Hz),E' (MPa),E'' (MPa)", [(300, *row) for row in ROWS]))
    assert [sweep.temperature for sweep in kelvin] == [300.0]


GOOD = "frequency (Hz),E' (MPa),E'' (MPa)"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "expected a table with the header frequency (Hz), E' (MPa)"),
        ("# only this\n", "found an empty file"),
        ("frequency of E'\n", "line 1: expected a header of several columns"),
        ("1,2,3\n2,3,4\n", "line 1: expected a header such as frequency (Hz)"),
        (
            "# c\nfrequency (Hz),E' (MPa)\n1,2\n",
            "line 2: expected a column E'' or tan delta, found frequency (Hz), E' (MPa)",
        ),
        ("E' (MPa),E'' (MPa)\n1,2\n", "expected a column frequency or omega"),
        ("frequency (Hz),G' (MPa),E'' (MPa)\n1,2,3\n", "found both ('E'' (MPa)' and 'G' (MPa)'); say which: --modulus"),
        ("frequency (1/s),E' (MPa),E'' (MPa)\n1,2,3\n", "write frequency (Hz) or omega (rad/s)"),
        ("f (s^-1),E' (MPa),E'' (MPa)\n1,2,3\n", "write frequency (Hz) or omega (rad/s)"),
        ("omega (Hz),E' (MPa),E'' (MPa)\n1,2,3\n", "an angular frequency is in rad/s, found 'Hz'"),
        ("frequency (Hz),E' (MPa),E'' (kPa),tan delta\n1,2,3,1.5\n", "it is off by a factor of 0.001"),
        (
            "frequency,E' (MPa),E'' (MPa)\n1,2,3\n",
            "column 'frequency': expected a unit of frequency: Hz, kHz, rad/s, found none",
        ),
        ("frequency (m),E' (MPa),E'' (MPa)\n1,2,3\n", "expected a unit of frequency: Hz, kHz, rad/s, found 'm'"),
        (
            "frequency (Hz),E',E'' (MPa)\n1,2,3\n",
            "column 'E'': expected a unit of modulus: Pa, kPa, MPa, GPa, found none",
        ),
        (
            "frequency (Hz),E' (MPa),E'' (mm)\n1,2,3\n",
            "found 'mm' (\"1 mm\" is a length); write for instance E'' (MPa)",
        ),
        ("frequency (Hz),E' (MPa),E'' (MPa),T (F)\n1,2,3,4\n", "expected a unit of temperature: C or K, found 'F'"),
        (
            "frequency (Hz),E' (MPa),E' (Pa),E'' (MPa)\n1,2,3,4\n",
            "expected one column with tensile storage, found 'E' (MPa)' and 'E' (Pa)'",
        ),
        (f"{GOOD}\n", "expected numbers below the header"),
        (f"{GOOD}\n1,2,3\n\n2,-4,1\n", "line 4: storage = '-4': expected a number above 0"),
        (f"{GOOD}\n1,2,3\n2,4,-1e-3\n", "line 3: loss = '-1e-3': expected a number at or above 0"),
        (f"{GOOD}\n0,2,3\n", "line 2: frequency = '0': expected a number above 0"),
        (f"{GOOD}\n1,2\n", "line 2: loss = '': expected a number"),
        (f"{GOOD}\n1,n/a,n/a\n", "line 2: storage = 'n/a': expected a number"),
        (f"{GOOD}\nn/a,n/a,n/a\n", "expected numbers below the header in line 1, found none"),
        (f"{GOOD}\n1,nan,inf\n", "line 2: loss = 'inf'"),
        (
            "T (C),frequency (Hz),E' (MPa),E'' (MPa)\n-274,1,2,3\n",
            "line 2: temperature = '-274': expected a number above -273",
        ),
        (b"\x81\x8d\x00\xff", "not a text file"),
    ],
)
def test_refusals_name_line_expectation_and_cure(tmp_path, text, words):
    with pytest.raises(MeasurementError, match=re.escape(words)) as caught:
        read(tmp_path, text)
    assert str(tmp_path / "dma.csv") in str(caught.value)


def test_many_wrong_lines_are_not_all_listed(tmp_path):
    with pytest.raises(MeasurementError, match="and 7 more like these") as caught:
        read(tmp_path, table(GOOD, [(1, 2, "x")] * 12))
    assert str(caught.value).count("line ") == 5 and "correct or delete" in str(caught.value)


def test_a_drifting_temperature_is_no_sweep(tmp_path):
    rows = [(20 + 0.4 * k, 1 + k, 2, 1) for k in range(20)]
    with pytest.raises(MeasurementError, match=r"one that drifts from 20 C to 27\.6 C"):
        read(tmp_path, table("T (C),f (Hz),E' (MPa),E'' (MPa)", rows))


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(MeasurementError, match=r"nothing\.csv: could not be read: No such file"):
        read_moduli(tmp_path / "nothing.csv")


def test_temperatures_as_options():
    for text in ("25C", "25 °C", " 25.0 degC", "298.15 K"):
        assert temperature_in_kelvin(text) == pytest.approx(298.15, rel=1e-15)
    assert temperature_in_kelvin("-10 C") == pytest.approx(263.15, rel=1e-15)
    for text in ("25", "25 F", "warm", "-300 C", "0 K"):
        with pytest.raises(ValueError, match="expected a temperature"):
            temperature_in_kelvin(text)
