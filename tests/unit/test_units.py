"""Quantities with units: what is read, to the last bit, and what is refused with which words."""

import math
import subprocess
import sys

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pgfmd.units import DIMENSIONS, UnitError, format_quantity, parse_quantity

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
    # J/m^2 = N/m.
    same = {"energy per area", "stiffness"}
    for other in DIMENSIONS.keys() - ({dimension} | (same if dimension in same else set())):
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
    try:
        assert isinstance(parse_quantity(text, "length"), float)
    except UnitError as error:
        assert "375 um" in error.expected


def test_pint_is_not_imported_before_a_quantity_is_read():
    code = "import sys, pgfmd.units; assert 'pint' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
