"""Quantities with units: what is read, to the last bit, and what is refused with which words."""

import math
import re
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgfmd.units import (
    DIMENSIONS,
    UnitError,
    _si_factor,
    _usual_factor,
    format_quantity,
    handy_quantity,
    parse_quantity,
)

FIXED = settings(derandomize=True, database=None, deadline=None)
LENGTHS = {"m": 0, "mm": -3, "um": -6, "µm": -6, "μm": -6, "nm": -9, "km": 3}


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("375 um", "length", 375e-6),
        ("375 µm", "length", 375e-6),  # micro sign
        ("375 μm", "length", 375e-6),  # Greek mu
        ("375um", "length", 375e-6),
        ("  1.5  mm ", "length", 1.5e-3),
        ("1_000 nm", "length", 1e-6),
        ("-3 um", "length", -3e-6),
        ("1 inch", "length", 0.0254),
        ("400 us", "time", 400e-6),
        ("2 min", "time", 120.0),
        ("1 um/s", "speed", 1e-6),
        ("60 um/min", "speed", 1e-6),
        ("2 um s^-1", "speed", 2e-6),
        ("40 mN", "force", 40e-3),
        ("2 MPa", "modulus", 2e6),
        ("2 N/mm^2", "modulus", 2e6),
        ("2 N/mm²", "modulus", 2e6),
        ("50 mJ/m^2", "energy per area", 50e-3),
        ("50 mJ/m**2", "energy per area", 50e-3),
        ("50 mN/m", "energy per area", 50e-3),
        ("5e6 1/m", "wavenumber", 5e6),
        ("5 1/um", "wavenumber", 5e6),
        ("5e6 m^-1", "wavenumber", 5e6),
        ("5 mm⁻¹", "wavenumber", 5e3),
        ("inf", "length", math.inf),
        ("inf m", "length", math.inf),
        (math.inf, "length", math.inf),
    ],
)
def test_a_quantity_has_the_bits_of_its_decimal_value(text, dimension, value):
    assert parse_quantity(text, dimension) == value


def test_nan_is_read_as_nan_for_the_caller_to_refuse():
    assert math.isnan(parse_quantity("nan m", "length"))


@pytest.mark.parametrize("number", [3, 2.5, 0, "3", "2.5"])
def test_a_bare_number_is_refused_and_the_unit_to_write_is_named(number):
    with pytest.raises(UnitError) as error:
        parse_quantity(number, "force")
    assert f'write "{number} N"' in error.value.cure
    assert "40 mN" in error.value.expected


@pytest.mark.parametrize(
    ("text", "dimension", "words"),
    [
        ("3 s", "length", '"3 s" is a time'),
        ("3 N/m", "force", '"3 N/m" is an energy per area'),
        ("3 kg", "length", "[mass]"),
        ("3 umm/s", "speed", 'did you mean "um/s"?'),
        ("3 blurbs", "length", '"blurbs" is not known'),
        ("", "force", "the text is empty"),
        ("   ", "force", "the text is empty"),
        ("um", "length", "a number, a space and a unit"),
        ("3 um + 2 um", "length", "a number, a space and a unit"),
        ("2**9999999 m", "length", "a number, a space and a unit"),
        ("3 um^12345678", "length", "a number, a space and a unit"),
        ("3 __import__", "length", "a number, a space and a unit"),
    ],
)
def test_what_is_not_such_a_quantity_is_refused_with_a_cure(text, dimension, words):
    with pytest.raises(UnitError) as error:
        parse_quantity(text, dimension)
    assert words in error.value.cure


@pytest.mark.parametrize("value", [True, None, [1], {"a": 1}])
def test_other_types_are_refused(value):
    with pytest.raises(UnitError, match="a length with its unit"):
        parse_quantity(value, "length")


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_every_dimension_reads_its_own_example_and_no_other(dimension):
    assert parse_quantity(DIMENSIONS[dimension].example, dimension) > 0
    # J/m^2 = N/m, and a radian has no dimension: the keys themselves tell these apart.
    pairs = ({"energy per area", "stiffness"}, {"angular frequency", "frequency"})
    for other in DIMENSIONS.keys() - {dimension}.union(*(pair for pair in pairs if dimension in pair)):
        with pytest.raises(UnitError):
            parse_quantity(DIMENSIONS[other].example, dimension)


@FIXED
@given(st.floats(allow_nan=False), st.sampled_from(sorted(DIMENSIONS)))
def test_what_is_written_is_read_back_to_the_same_bits(value, dimension):
    assert parse_quantity(format_quantity(value, dimension), dimension) == value


@FIXED
@given(st.integers(-(10**12), 10**12), st.integers(-20, 20), st.sampled_from(sorted(LENGTHS)), st.sampled_from(" \t"))
def test_a_prefix_shifts_the_decimal_point_and_nothing_else(digits, power, unit, gap):
    assert parse_quantity(f"{digits}e{power}{gap}{unit}", "length") == float(f"{digits}e{power + LENGTHS[unit]}")


@FIXED
@given(st.text(max_size=20) | st.from_regex(r"[0-9.e+-]{1,6} ?[a-zA-Zµ/*^0-9 ²-]{0,8}", fullmatch=True))
def test_any_text_is_either_read_or_refused_in_our_words(text):
    refused = ""
    try:
        value = parse_quantity(text, "length")
    except UnitError as error:
        refused = error.expected
    assert "375 um" in refused if refused else isinstance(value, float)


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_the_factors_of_usual_units_are_those_of_pint(dimension):
    usual = DIMENSIONS[dimension].usual
    known = {unit: _usual_factor(unit, dimension) for unit in (*usual, usual[0].replace("m", "dm"), "inch", "m^m")}
    assert all(factor == _si_factor(unit)[0] for unit, factor in known.items() if factor is not None)
    assert {unit for unit in usual if known[unit] is None} <= {
        "um/min",
        "mm/min",
        "N/min",
        "mN/min",
        "Hz",
        "kHz",
        "mHz",
    }


def test_pint_is_not_imported_for_shipped_scenes():
    code = (
        "import sys; from pgfmd.scene import load_scene, shipped_scenes; [load_scene(name) for name in shipped_scenes()];"
        "assert 'pint' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


# Hints ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "dimension", "hint"),
    [
        ("375 Um", "length", 'did you mean "um"?'),
        ("375 UM", "length", 'did you mean "um"?'),
        ("40 Mn", "force", 'did you mean "mN" or "MN"?'),
        ("2 mpa", "modulus", 'did you mean "MPa" or "mPa"?'),
        ("1 µm/S", "speed", 'did you mean "um/s"?'),
        ("1 M", "length", 'did you mean "m"?'),
        ("5 1/MM", "wavenumber", 'did you mean "1/mm"?'),
        ("2 Mega", "modulus", 'the unit "Mega" is not known'),
        ("0,5 um/s", "speed", '"0.5 um/s"'),
        ("1,000 um", "length", '"1.000 um" or "1000 um"'),
        ("1,5", "length", 'write a decimal point, "1.5"'),
        ("50 mJ/m2", "energy per area", 'write powers with ^, as in "J/m^2"'),
    ],
)
def test_a_hint_names_a_unit_of_the_dimension_that_is_wanted(text, dimension, hint):
    with pytest.raises(UnitError) as error:
        parse_quantity(text, dimension)
    assert hint in error.value.cure
    named = re.findall(r'"([^"]+)"', error.value.cure.partition("did you mean")[2])
    assert all(unit in DIMENSIONS[dimension].usual for unit in named)


@pytest.mark.parametrize("dimension", DIMENSIONS)
def test_the_usual_units_are_of_their_dimension(dimension):
    for unit in DIMENSIONS[dimension].usual:
        assert parse_quantity(f"1 {unit}", dimension) > 0
    assert DIMENSIONS[dimension].unit in DIMENSIONS[dimension].usual


@pytest.mark.parametrize("text", ["1 dB", "3 dBm", "1 Np", "7 pH", "2 decade", "1 octave", "20 degC", "1 delta_degF"])
@pytest.mark.parametrize("dimension", ["length", "force"])
def test_units_of_logarithms_and_temperatures_are_refused(text, dimension):
    with pytest.raises(UnitError):
        parse_quantity(text, dimension)


@pytest.mark.parametrize("text", ["1e400 m", "1e99999999999999999999 m", "-1e99999999999999999999 m"])
def test_a_number_that_is_too_large_is_not_infinite(text):
    with pytest.raises(UnitError, match="finite number"):
        parse_quantity(text, "length")


def test_a_number_that_is_too_small_is_zero():
    assert parse_quantity("1e-99999999999999999999 m", "length") == parse_quantity("1e-400 m", "length") == 0.0


@pytest.mark.parametrize(
    ("value", "dimension", "text"),
    [
        (375e-6, "length", "375 um"),
        (999.9996e-6, "length", "1 mm"),
        (-3e-7, "length", "-300 nm"),
        (4.0, "length", "4 m"),
        (0.0, "length", "0 m"),
        (1e-15, "length", "0.001 pm"),
        (1e16, "modulus", "1e+04 TPa"),
        (5e-2, "energy per area", "50 mJ/m^2"),
        (15700.0, "angular frequency", "1.57e+04 rad/s"),
        (2.5e-5, "speed", "25 um/s"),
        (60.0, "time", "60 s"),
        (7200.0, "time", "2 h"),
        (4e6, "time", "46.3 days"),
        (math.inf, "time", "inf s"),
    ],
)
def test_messages_show_the_unit_that_a_person_would_use(value, dimension, text):
    assert handy_quantity(value, dimension) == text


def test_fewer_digits_need_no_exponent():
    shown = [handy_quantity(value, "length", 2) for value in (289.6e-9, 2.896e-6, 0.9996e-6)]
    assert shown == ["290 nm", "2.9 um", "1 um"]
