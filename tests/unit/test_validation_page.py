"""The page of validations and the script that makes it agree: figures, makers, and the numbers of the tables."""

import math
import re
from functools import partial

import pytest

from scripts.studies import pages
from scripts.studies.validation import figures as script
from scripts.studies.validation.drawing import Line, number

PAGE = script.PAGE.read_text(encoding="utf-8")
ROWS = script.read_rows(script.FOLDER)
MODEL_PAGE = script.MODEL_PAGE.read_text(encoding="utf-8")
SHOWN, SHOWN_OF_MODEL = (
    re.findall(r"!\[[^\]]+\]\((?:\.\./)*figures/validation/([\w-]+)\.png\)", page) for page in (PAGE, MODEL_PAGE)
)


def test_every_figure_of_the_pages_exists_and_has_a_maker():
    assert sorted(SHOWN + SHOWN_OF_MODEL) == sorted(script.FIGURES)
    for name in SHOWN + SHOWN_OF_MODEL:
        content = (script.FOLDER / f"{name}.png").read_bytes()
        assert content.startswith(b"\x89PNG")
        assert len(content) <= 120_000


def test_every_figure_has_its_table_and_its_rows():
    assert re.findall(r"<!-- errors ([\w-]+) -->", PAGE) == SHOWN
    assert {row["figure"] for row in ROWS} == set(script.FIGURES)


def tables():
    """(figure, cells) of each row of the tables of the page, read from its text."""
    for name, body in re.findall(r"<!-- errors ([\w-]+) -->\n(.*?)<!-- end -->", PAGE, flags=re.DOTALL):
        for text in body.strip().splitlines()[2:]:
            yield name, [cell.strip() for cell in text.strip().strip("|").split(" | ")]


def test_numbers_of_the_page_are_those_of_the_csv():
    shown = list(tables())
    assert len(shown) == len([row for row in ROWS if row["figure"] in SHOWN]) > len(SHOWN)
    by_figure = {name: iter([row for row in ROWS if row["figure"] == name]) for name in script.FIGURES}
    for name, (what, settings, closed, ours, error) in shown:
        row = next(by_figure[name])
        assert (what, settings) == (row["what"], row["settings"])
        assert "|" not in what + settings, "a cell must not look like two"
        for cell, column in ((closed, "closed form"), (ours, "ours")):
            expected = float(row[column])
            assert (not cell and math.isnan(expected)) or value(cell) == pytest.approx(expected, rel=1e-4, abs=1e-300)
        if error.endswith("%"):
            # Two digits.
            assert value(error[:-2]) / 100 == pytest.approx(float(row["error"]), rel=0.05)
        elif error:
            assert value(error) == pytest.approx(float(row["error"]), rel=5e-3, abs=1e-300)
        assert bool(error) != math.isnan(float(row["closed form"]))


def test_the_table_of_contact_is_that_of_the_csv():
    """Each state of the page of the model, with its three radii and their errors, is a row of errors.csv a radius."""
    (figure,) = SHOWN_OF_MODEL
    body = re.search(r"<!-- contact radius -->\n(.*?)<!-- end -->", MODEL_PAGE, flags=re.DOTALL)[1]
    header, _, *lines = ([cell.strip() for cell in text.strip("|").split(" | ")] for text in body.strip().splitlines())
    rows = {(row["settings"], row["what"]): row for row in ROWS if row["figure"] == figure}
    assert len(rows) == len(lines) * (len(header) - 2) > 0
    for state, closed, *cells in lines:
        for what, cell in zip(header[2:], cells, strict=True):
            row, (ours, error) = rows[state, what], re.fullmatch(r"([\d.]+) \((.+).%\)", cell).groups()
            assert value(closed) == pytest.approx(float(row["closed form"]), rel=1e-3)
            assert value(ours) == pytest.approx(float(row["ours"]), rel=1e-3)
            assert value(error) / 100 == pytest.approx(float(row["error"]), rel=0.05)


def value(text):
    """The number that a cell shows."""
    plain = text.strip().replace("\N{MINUS SIGN}", "-")
    if "\N{MULTIPLICATION SIGN}10" in plain:
        mantissa, power = plain.split("\N{MULTIPLICATION SIGN}10")
        return float(mantissa) * 10.0 ** int(power.translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")))
    return float(plain)


def test_errors_of_the_csv_are_those_of_its_numbers():
    for row in ROWS:
        closed, ours, error = (float(row[column]) for column in ("closed form", "ours", "error"))
        if math.isnan(closed):
            assert math.isnan(error)
        else:
            # Numbers have ten digits.
            assert error == pytest.approx(ours / closed - 1 if closed else ours, rel=1e-9, abs=2e-9 if closed else 0.0)


def test_tables_are_filled_from_rows_and_the_rest_of_the_page_is_kept():
    page = "before\n\n<!-- errors a -->\n\n| old |\n\n<!-- end -->\n\nbetween\n\n<!-- errors b -->\n<!-- end -->\n"
    rows = [script.row_of(name, Line("force [N]", "n = 8", 2.0, 1.9)) for name in ("a", "b")]
    own = partial(script.table_of, rows=rows)
    filled = pages.filled(page, "errors", own)
    assert filled.count("| force [N] | n = 8 | 2 | 1.9 | −5.0\N{NO-BREAK SPACE}% |") == 2
    assert "old" not in filled and filled.startswith("before\n\n<!-- errors a -->\n\n|") and "\n\nbetween\n\n" in filled
    assert pages.filled(filled, "errors", own) == filled
    with pytest.raises(ValueError, match="no block of the kind 'table'"):
        pages.filled(page, "table", own)


@pytest.mark.parametrize(
    ("closed", "ours", "shown"),
    [
        (-1.5, -1.602, "+6.8 %"), (2.0, 1.9, "−5.0 %"), (1.0, 1.0 + 2e-7, "2×10⁻⁷"), (0.0, 3.4e-6, "3.4×10⁻⁶"),
        (0.0, 0.0652, "0.0652"), (math.nan, 1.5, ""), (1.0, 1.00012, "+0.012 %"),
    ],
)  # fmt: skip
def test_errors_as_they_are_shown(closed, ours, shown):
    assert Line("", "", closed, ours).shown_error == shown.replace(" ", "\N{NO-BREAK SPACE}")


def test_numbers_as_they_are_shown():
    assert [number(x, 5) for x in (-0.5, 1.23456789e-7, math.nan, 0.0)] == ["−0.5", "1.2346×10⁻⁷", "", "0"]
