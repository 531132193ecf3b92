"""Tables of numbers without names of columns in text files, such as height maps: rows of equal length.

Above them there may be whatever an instrument writes, which is kept for who knows it; cells may hold tokens for missing
numbers. What parts columns, and what a comma means, is told as for other tables (text_table.py, numerals.py).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import MeasurementError

from .numerals import Cell, NumeralError, decimal_mark, declared_mark, is_missing, is_numeral, value
from .text_lines import DELIMITERS, Line, bare, cells_of, in_words, is_comment, lines_of

_DECISIVE = re.compile(r"(?<![\d,])0,\d|(?<!\d),\d|,\d{1,2}(?!\d)|,\d{4}|\d{4},\d|,\d+[eE]")
"""A number in which a comma can't separate thousands."""
_TAIL = re.compile(r"\s#(?!N/A|NV|DIV|VALUE|NUM|REF|WERT|ZAHL|NAN).*", re.I)
"""A comment behind numbers."""


@dataclass(frozen=True)
class NumberBlock:
    """Numbers of a file: values (rows, columns), NaN where a cell has a token for a missing one; preamble and below: the lines
    above and below them, without marks of comments; header: the cells of the line right above if there are as many as columns,
    else (); first_line: of the numbers, from 1; delimiter; notes: what was passed over below."""

    values: NDArray[np.float64]
    preamble: tuple[str, ...]
    below: tuple[str, ...]
    header: tuple[str, ...]
    first_line: int
    delimiter: str
    notes: tuple[str, ...]


def read_number_block(path: str | Path) -> NumberBlock:
    """The largest block of lines of at least two numbers each, (rows, columns).

    Raises MeasurementError for a file that can't be read or has none, for lines of different lengths, and where the
    decimal mark can't be told.
    """
    path = Path(path)
    lines = [(number, _TAIL.sub("", line) if "#" in line else line) for number, line in lines_of(path, "of numbers")]
    runs = [(_longest_run(lines, delimiter), delimiter) for delimiter in DELIMITERS]
    rows, delimiter = max(runs, key=lambda found: sum(width for _, _, width in found[0]))
    if not rows:
        raise MeasurementError(
            f"{path}: expected rows of at least two numbers, found none; separate columns by comma, semicolon, tab or blank"
        )
    first, last, widths = rows[0][0], rows[-1][0], [width for _, _, width in rows]
    width = max(set(widths), key=widths.count)
    odd = next(((number, found) for number, _, found in rows if found != width), None)
    if odd:
        raise MeasurementError(
            f"{path}, line {odd[0]}: expected {width} numbers as in the other lines, found {odd[1]}; complete the line"
        )
    preamble = tuple(bare(line) for number, line in lines if number < first)
    values = _values(path, [(number, line) for number, line, _ in rows], delimiter, declared_mark(preamble))
    some = _columns_with_cells([line for _, line, _ in rows], width, delimiter)
    values = values[:, some]
    titles = cells_of(preamble[-1], delimiter) if preamble else []
    if len(titles) == width:
        titles = [title for title, kept in zip(titles, some, strict=True) if kept]
    header = tuple(titles) if len(titles) == values.shape[1] else ()
    passed = [number for number, line in lines if number > last and not is_comment(line)]
    notes = (f"{path.name}: passed over {in_words(passed)}, below the numbers",) if passed else ()
    below = tuple(bare(line) for number, line in lines if number > last)
    return NumberBlock(values, preamble, below, header, first, delimiter, notes)


def _columns_with_cells(texts: Sequence[str], width: int, delimiter: str) -> NDArray[np.bool_]:
    """All columns but one of empty cells at either end, which a mark at the beginnings or ends of all lines makes. A column of
    tokens for missing numbers is one like any other."""
    some = np.ones(width, bool)
    if delimiter != " ":
        stripped = [text.strip(" \u00a0\ufeff") for text in texts]
        some[0] = not all(text.startswith(delimiter) for text in stripped)
        some[-1] = not all(text.endswith(delimiter) for text in stripped)
    return some


def _longest_run(lines: list[Line], delimiter: str) -> list[tuple[int, str, int]]:
    """The longest run of lines of numbers by this delimiter, with the number of their cells; comments don't end it."""
    best: list[tuple[int, str, int]] = []
    run: list[tuple[int, str, int]] = []
    for number, line in lines:
        if is_comment(line):
            continue
        if width := _width(line, delimiter):
            run.append((number, line, width))
        else:
            best, run = max(best, run, key=len), []
    return max(best, run, key=len)


def _width(line: str, delimiter: str) -> int:
    """The number of cells of a line of numbers; 0 of another."""
    cells = cells_of(line, delimiter)
    if len(cells) < 2:
        return 0
    try:
        # What is most common, at once.
        for cell in cells:
            float(cell if delimiter == "," else cell.replace(",", "."))
    except ValueError:
        # A row of a map may have no number at all, but words for that, other than dashes below a title.
        if not any(letter.isalnum() for letter in line) or not all(
            is_numeral(cell) or is_missing(cell) for cell in cells
        ):
            return 0
    return len(cells)


def _values(path: Path, rows: Sequence[Line], delimiter: str, declared: str | None) -> NDArray[np.float64]:
    """The numbers, at once where the decimal mark is plain, else cell by cell."""
    texts = [line for _, line in rows]
    commas = delimiter != "," and any("," in text for text in texts)
    points = any("." in text for text in texts)
    mark = "," if commas else "."
    plain = not (commas and points) and (not commas or any(map(_DECISIVE.search, texts)))
    if plain and declared in (None, mark) and not any('"' in text or "_" in text for text in texts):
        try:
            numbers = (text.replace(",", ".") for text in texts) if commas else iter(texts)
            found = np.loadtxt(numbers, comments=None, delimiter=None if delimiter == " " else delimiter, ndmin=2)
            return np.where(np.isfinite(found), found, np.nan)
        except ValueError:
            pass
    cells = [[Cell(number, cell) for cell in cells_of(line, delimiter)] for number, line in rows]
    try:
        mark = decimal_mark(list(zip(*cells, strict=True)), delimiter, declared)
    except NumeralError as error:
        raise MeasurementError(f"{path}, {error}") from None
    return np.array([[value(cell.text, mark) for cell in row] for row in cells])
