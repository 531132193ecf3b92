"""Numbers as cells of tables write them: decimal points and commas, thousands separators, and what stands for no number.

A mark between digits can be read in two ways, "1,500" as 1.5 or as 1500. Which it is, is told from all numbers that
belong together, or not at all: then they are refused.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

_NUMERAL = re.compile(r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eEdD][+-]?\d+)?")
_GROUPED = re.compile(
    r"[+-]?(?:\d{1,3}(?:[ \u00a0\u2009\u202f]\d{3})+(?:[.,]\d+)?"  # 12 345,6
    r"|\d{1,3}(?:['’]\d{3})+(?:[.,]\d+)?"  # 12'345.6
    r"|\d{1,3}(?:,\d{3})+\.\d+|\d{1,3}(?:\.\d{3})+,\d+"  # 1,234.5 and 1.234,5
    r"|\d{1,3}(?:,\d{3}){2,}|\d{1,3}(?:\.\d{3}){2,})"  # 1,234,567 and 1.234.567
)
_THREE_PLACES = re.compile(r"[+-]?[1-9]\d{0,2},\d{3}")
_INTEGER = re.compile(r"[+-]?\d+")
_DECLARED = re.compile(
    r"decimal\W*(?:mark|point|separator|sign|symbol)?\s*[:=]\s*\W*?(comma|point|dot|period|,|\.)", re.I
)
_MISSING = re.compile(
    r"(?:[+-]?(?:nan|inf(?:inity)?)|n\.?/?a\.?|#[a-z/]+[!?0]*!?|-+|[–—*?]+|null|none|nil|bad|no ?data|void|missing|"
    r"[+-]?1\.#\w+)?",
    re.I,
)


class Cell(NamedTuple):
    """A cell with the number of its line."""

    line: int
    text: str


class NumeralError(ValueError):
    """Numbers whose decimal mark can't be told: says where and why, and a cure."""


def plain(cell: str) -> str:
    """A cell without what surrounds its text: blanks, quotes, and the ="..." of a spreadsheet; with a plain minus."""
    text = cell.strip(" \t\u00a0\ufeff")
    if text.startswith('="') and text.endswith('"'):
        text = text[2:-1]
    return text.strip('"').strip().replace("\u2212", "-")


def is_numeral(cell: str) -> bool:
    """Whether a cell is meant as a number, whatever its marks; tokens for a missing one are none."""
    text = plain(cell)
    return bool(_NUMERAL.fullmatch(text) or _GROUPED.fullmatch(text))


def is_missing(cell: str) -> bool:
    """Whether a cell is empty or holds a token for a number that is not there."""
    return _MISSING.fullmatch(plain(cell)) is not None


def declared_mark(lines: Sequence[str]) -> str | None:
    """The decimal mark that lines above a table declare, as in "#DECIMAL:COMMA"; None if they don't."""
    for line in lines:
        if match := _DECLARED.search(line):
            return "," if match[1].lower() in ("comma", ",") else "."
    return None


def decimal_mark(columns: Sequence[Sequence[Cell]], delimiter: str, declared: str | None = None) -> str:
    """The decimal mark, "." or ",", of the numbers of columns that belong to one table.

    delimiter: what stands between its columns: semicolons are there because decimals have commas. declared: what the
    file says. Raises NumeralError for thousands separators, for both marks in one table, and where "1,500" may be
    either.
    """
    numerals = [[Cell(cell.line, plain(cell.text)) for cell in column] for column in columns]
    grouped = next((cell for column in numerals for cell in column if _GROUPED.fullmatch(cell.text)), None)
    if grouped:
        raise NumeralError(
            f"line {grouped.line}: '{grouped.text}': expected a number without thousands separators; "
            "export or copy the numbers without them"
        )
    numerals = [[cell for cell in column if _NUMERAL.fullmatch(cell.text)] for column in numerals]
    point = next((cell for column in numerals for cell in column if "." in cell.text), None)
    comma = next((cell for column in numerals for cell in column if "," in cell.text), None)
    if point and comma:
        raise NumeralError(
            f"line {point.line}: '{point.text}' and line {comma.line}: '{comma.text}': expected one decimal mark, found "
            "numbers with a point and numbers with a comma; if one of them separates thousands, write the numbers without it"
        )
    wrong = {None: None, ".": comma, ",": point}[declared]
    if wrong:
        raise NumeralError(
            f"line {wrong.line}: '{wrong.text}': expected '{declared}' as the decimal mark, as the file declares above; "
            "correct that line, or write the numbers without thousands separators"
        )
    if not comma:
        return "."
    if declared != "," and not _commas_are_decimal(numerals, delimiter):
        raise NumeralError(
            f"line {comma.line}: '{comma.text}' can be {comma.text.replace(',', '.')} or "
            f"{comma.text.replace(',', '')}, as every number with a comma has three digits behind it; write the numbers "
            "without thousands separators, or, if the commas are decimal ones, put '# decimal: comma' into a line above "
            "the header"
        )
    return ","


def _commas_are_decimal(columns: Sequence[Sequence[Cell]], delimiter: str) -> bool:
    """Whether some number with a comma can't be a grouped one; between semicolons also whether each number of a column
    has one, which grouped ones below 1000 have not."""
    with_comma = [column for column in columns if any("," in cell.text for cell in column)]
    commas = [cell.text for column in with_comma for cell in column if "," in cell.text]
    if not all(_THREE_PLACES.fullmatch(text) for text in commas):
        return True
    return delimiter == ";" and not any(_INTEGER.fullmatch(cell.text) for column in with_comma for cell in column)


def value(cell: str, mark: str) -> float:
    """The number of a cell with this decimal mark; NaN where it is none, or is missing."""
    text = plain(cell)
    if not _NUMERAL.fullmatch(text) or (mark == "." and "," in text):
        return float("nan")
    return float(text.replace(",", ".").replace("d", "e").replace("D", "e"))
