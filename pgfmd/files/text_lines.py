"""Lines of a text file with a table in it: comments told from rows, and a row cut into cells."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from pgfmd.errors import MeasurementError

from .text import read_text

DELIMITERS = ("\t", ";", ",", " ")
"""What may part columns, in the order in which they are tried; " " stands for any number of blanks."""
COMMENTS = ("#", "%", "//")
_CELL_GOES_ON = re.compile(r'(?:^|[\t;,])"(?:[^"]|"")*$')
_SPREADSHEET_ERROR = re.compile(r"#(?:N/A|NV|DIV|VALUE|NUM|REF|WERT|ZAHL|NAN)", re.I)
"""What begins with a hash and is no comment."""
_INTRODUCTION = re.compile(r"^\s*(?:columns|fields|names|units?)\s*[:=]\s*", re.I)
_UNITS = re.compile(r"[\s#%/]*units?\s*[:=]", re.I)
_MOST_LINES_OF_A_CELL = 3

Line = tuple[int, str]
"""The number of a line, from 1, and its text."""


def lines_of(path: Path, example: str) -> list[Line]:
    """Every line of a file that holds something; one whose last cell goes on in the next is put together with it.

    example: of what was expected, for messages. Raises MeasurementError for a file that can't be read, or holds nothing.
    """
    try:
        text = read_text(path)
    except OSError as error:
        raise MeasurementError(f"{path}: could not be read: {error.strerror}") from None
    except ValueError:
        raise MeasurementError(
            f"{path}: could not be read: not a text file; expected a table, export the measurement as CSV or text"
        ) from None
    physical = text.split("\n")
    found: list[Line] = []
    number = 0
    while number < len(physical):
        line, first = physical[number], number + 1
        if _CELL_GOES_ON.search(line):
            ends = (
                at for at in range(first, first + _MOST_LINES_OF_A_CELL) if at < len(physical) and '"' in physical[at]
            )
            last = next(ends, number)
            line, number = " ".join(map(str.strip, physical[number : last + 1])) if last > number else line, last
        number += 1
        if line.strip(" \t;,\u00a0\ufeff\f"):
            found.append((first, line))
    if not found:
        raise MeasurementError(f"{path}: expected a table with the header {example}, found an empty file")
    return found


def is_comment(line: str) -> bool:
    """Whether a line begins with a mark of comments."""
    start = line.lstrip(" \ufeff")
    return start.startswith(COMMENTS) and not _SPREADSHEET_ERROR.match(start)


def holds_units(line: str) -> bool:
    """Whether a comment introduces units of columns."""
    return _UNITS.match(line) is not None


def bare(line: str) -> str:
    """A line without the marks of a comment, nor the word by which programs introduce names or units of columns."""
    return _INTRODUCTION.sub("", line.lstrip(" \ufeff").lstrip("#%/").strip(" "), count=1) if is_comment(line) else line


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of a line, without blanks around them."""
    if delimiter == " ":
        return line.split()
    if '"' in line:
        # By itself csv refuses cells of more than 131072 letters, as a wide map has between other delimiters.
        csv.field_size_limit(max(csv.field_size_limit(), len(line) + 1))
        cells = next(csv.reader([line], delimiter=delimiter), [])
    else:
        cells = line.split(delimiter) if line else []
    return [cell.strip(" \u00a0\ufeff") for cell in cells]


def titles_of(line: str, delimiter: str, width: int) -> list[str]:
    """The cells of a line of names; between blanks as many as `width`, units in brackets with their names, [] if they
    are not so many."""
    if delimiter != " ":
        return cells_of(line, delimiter)
    text = line.strip()
    splits = (re.split(r"\s{2,}|\t", text), re.split(r"\s+(?![(\[/])(?![^(\[]*[)\]])", text), text.split())
    return next((cells for cells in splits if len(cells) == width), [])


def in_words(numbers: list[int]) -> str:
    """Numbers of lines as a message names them."""
    return f"line {numbers[0]}" if len(numbers) == 1 else f"{len(numbers)} lines from {numbers[0]} to {numbers[-1]}"
