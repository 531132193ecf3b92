"""Tables with named columns in text files, as instruments, spreadsheets and people write them: curves, moduli.

    vocabulary = Vocabulary({"force": ("force", "load"), "time": ("time", "t")})
    table = read_table(path, vocabulary, "time (s), force (mN)")
    values = table.numbers({column.quantity: column for column in table.columns})

What may stand above the names of the columns, below their numbers and between blocks of them is passed over, and said
(`TextTable.notes`); names have their units behind them or in a line below. Columns are parted by tabs, semicolons, commas
or blanks; what a comma in a number means is told from all of them (numerals.py). Where something can be read in two
ways the file is refused, with a cure.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import MeasurementError
from pgfmd.units import UnitError, parse_quantity

from .column_names import Column, Vocabulary, bare_unit, usual_unit
from .numerals import Cell, NumeralError, decimal_mark, declared_mark, is_missing, is_numeral, value
from .text_lines import DELIMITERS, Line, bare, cells_of, holds_units, in_words, is_comment, lines_of, titles_of

LONGEST_HEAD = 1000
"""How many lines that hold something may stand above the names of the columns."""
LINES_OF_UNITS = 3
"""How far below the names the line of units may be."""
MOST_PROBLEMS = 5
LONGEST_SHOWN = 80
_STATISTICS = re.compile(
    r"(?:mean|average|avg|std|st\.? ?dev|s\.?d\.|standard dev|min|max|minimum|maximum|median|sum|total|count|"
    r"mittel|mittelwert|standardabw|summe|anzahl)\w*\.?:?",
    re.I,
)
"""First cells of lines that say something about the rows above."""

Row = tuple[int, list[str]]
"""The number of a line, and its cells."""


@dataclass(frozen=True, eq=False)
class TextTable:
    """A table: preamble, the lines above its header without marks of comments; header_line, from 1; header, the cells
    as they are; columns, those with a known name, in the order of the file; rows; delimiter; repeated: lines in which the
    header stands again, above further blocks; notes: what of the file was passed over, for the user to know."""

    path: Path
    preamble: tuple[str, ...]
    header_line: int
    header: tuple[str, ...]
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    delimiter: str
    repeated: tuple[int, ...]
    notes: tuple[str, ...]

    @property
    def where(self) -> str:
        """File and line of the header, for messages."""
        return f"{self.path}, line {self.header_line}"

    @property
    def titles(self) -> str:
        """The header, for messages."""
        return ", ".join(title for title in self.header if title)

    def found(self, quantity: str) -> list[Column]:
        """The columns of a quantity, in the order of the file."""
        return [column for column in self.columns if column.quantity == quantity]

    def cells(self, place: int) -> list[Cell]:
        """The cells of a column, "" where a row is too short."""
        return [Cell(line, _cell(cells, place)) for line, cells in self.rows]

    def numbers(self, columns: Mapping[str, Column]) -> dict[str, NDArray[np.float64]]:
        """The numbers of columns, by their keys, in the units of the file; NaN where there is none.

        Raises MeasurementError where their decimal mark can't be told (numerals.py), and without rows.
        """
        if not self.rows:
            raise MeasurementError(
                f"{self.path}: expected numbers below the header in line {self.header_line}, found none"
            )
        cells = {key: self.cells(column.place) for key, column in columns.items()}
        try:
            mark = decimal_mark(list(cells.values()), self.delimiter, declared_mark(self.preamble))
        except NumeralError as error:
            raise MeasurementError(f"{self.path}, {error}") from None
        return {key: np.array([value(cell.text, mark) for cell in column]) for key, column in cells.items()}

    def factor(self, column: Column, dimension: str, example: str, expected: str = "") -> float:
        """What the unit of a column is in SI units; dimension: a key of `units.DIMENSIONS`; example: of a title;
        expected: what the message says, if not "a unit of (dimension)".

        Raises MeasurementError for a column without a unit, or with one of another dimension.
        """
        try:
            return parse_quantity(f"1 {usual_unit(column.unit)}", dimension)
        except UnitError as error:
            found = f"found '{column.unit}' ({error.cure})" if column.unit else "found none"
            raise MeasurementError(
                f"{self.where}, column '{column.title}': expected {expected or f'a unit of {dimension}'}, {found}; "
                f"write for instance {example}"
            ) from None

    def refuse(self, problems: Sequence[str], cure: str = "") -> MeasurementError:
        """An error that lists wrong cells, up to a few: problems name line and cell; cure: what else can be said."""
        more = len(problems) - MOST_PROBLEMS
        tail = [f"... and {more} more like these"] if more > 0 else []
        listed = [f"{self.path}, {problem}" for problem in problems[:MOST_PROBLEMS]]
        return MeasurementError("\n".join([*listed, *tail, f"correct or delete these lines{cure}"]))


def read_table(path: str | Path, vocabulary: Vocabulary, example: str) -> TextTable:
    """The table of a file whose columns have names.

    vocabulary: what to look for; the header is the line with most of it. example: of a header, for messages. Raises
    MeasurementError for a file that can't be read, without a header, or with rows that are longer than it.
    """
    path = Path(path)
    lines = lines_of(path, example)
    head = max(_heads(lines, vocabulary), key=lambda head: head.rank, default=None)
    if head is None:
        raise _no_header(path, lines, example)
    return _Body(path, lines, head, vocabulary).table()


@dataclass(frozen=True)
class _Head:
    """A line that may hold the names of the columns: its index among the lines, its cells, and how good it is."""

    index: int
    cells: list[str]
    delimiter: str
    rank: tuple[int, bool, bool, int, int]


def _heads(lines: list[Line], vocabulary: Vocabulary) -> Iterator[_Head]:
    """Lines that name a quantity, each by each delimiter, the better ones of a higher rank: those with more names, with
    numbers below, in no comment, and earlier in the file."""
    for place, delimiter in enumerate(DELIMITERS):
        for index, (_, line) in enumerate(lines[:LONGEST_HEAD]):
            if delimiter not in line or (is_comment(line) and not _may_name(lines, index)):
                continue
            width = len(_first_numbers(lines, index, delimiter))
            cells = titles_of(bare(line), delimiter, width)
            if count := vocabulary.count(cells):
                yield _Head(index, cells, delimiter, (count, width > 1, not is_comment(line), -index, -place))


def _may_name(lines: list[Line], index: int) -> bool:
    """Whether a comment may hold the names of columns: with the numbers right below, or other comments between."""
    following = next((line for _, line in lines[index + 1 :] if not is_comment(line)), "")
    return any(sum(map(is_numeral, cells_of(following, delimiter))) > 1 for delimiter in DELIMITERS)


def _first_numbers(lines: list[Line], index: int, delimiter: str) -> list[str]:
    """The cells of the first line below with numbers, if it comes before much else; [] if there is none."""
    left = LINES_OF_UNITS + 1
    for _, line in lines[index + 1 :]:
        if is_comment(line):
            continue
        cells = cells_of(line, delimiter)
        if any(map(is_numeral, cells)):
            return cells
        left -= 1
        if not left:
            break
    return []


def _no_header(path: Path, lines: list[Line], example: str) -> MeasurementError:
    """What is said of a file without a name that is known: of the line above the first numbers."""
    rows = [(number, line) for number, line in lines if not is_comment(line)]
    if not rows:
        return MeasurementError(f"{path}: expected a table with the header {example}, found an empty file")
    for delimiter in DELIMITERS:
        place = next(
            (at for at, (_, line) in enumerate(rows) if sum(map(is_numeral, cells_of(line, delimiter))) > 1), None
        )
        if place == 0:
            where = f"{path}, line {rows[0][0]}"
            return MeasurementError(
                f"{where}: expected a header such as {example}, found numbers; name columns and units"
            )
        if place:
            number, line = rows[place - 1]
            found = ", ".join(cell for cell in cells_of(line, delimiter) if cell)
            where = f"{path}, line {number}"
            return MeasurementError(
                f"{where}: expected a header such as {example}, found {found}; name columns and units"
            )
    return MeasurementError(
        f"{path}, line {rows[0][0]}: expected a header of several columns, such as {example}, and numbers below; "
        "separate columns by comma, semicolon or tab"
    )


class _Body:
    """The rows below a header: units, repeated headers and what is no row sorted out."""

    def __init__(self, path: Path, lines: list[Line], head: _Head, vocabulary: Vocabulary):
        self.path, self.head, self.vocabulary = path, head, vocabulary
        self.line = lines[head.index][0]
        self.preamble = tuple(bare(line) for _, line in lines[: head.index])
        self.notes: list[str] = []
        self.repeated: list[int] = []
        below = [
            (number, line) for number, line in lines[head.index + 1 :] if not is_comment(line) or holds_units(line)
        ]
        self.cells = [(number, cells_of(bare(line), head.delimiter)) for number, line in below]
        known = [(place, title, vocabulary.named(title)) for place, title in enumerate(head.cells)]
        self.columns = [
            Column(found.quantity, found.unit, found.part, place, title) for place, title, found in known if found
        ]

    def table(self) -> TextTable:
        """The whole. Raises MeasurementError."""
        self._take_units()
        rows = self._rows()
        self._refuse_surplus(rows)
        self._join_equal_columns(rows)
        return TextTable(
            self.path, self.preamble, self.line, tuple(self.head.cells), tuple(self.columns), tuple(rows),
            self.head.delimiter, tuple(self.repeated), tuple(self.notes),
        )  # fmt: skip

    def _numbers_in(self, cells: Sequence[str]) -> int:
        """How many known columns have a number in a row."""
        return sum(is_numeral(_cell(cells, column.place)) for column in self.columns)

    def _is_empty(self, cells: Sequence[str]) -> bool:
        """Whether no known column says anything in a row."""
        return all(is_missing(_cell(cells, column.place)) for column in self.columns)

    def _take_units(self) -> None:
        """The units of columns that have none behind their names, from the first line below that holds some."""
        for number, cells in self.cells[:LINES_OF_UNITS]:
            if any(map(is_numeral, cells)) or cells == self.head.cells:
                return
            below = {column.place: bare_unit(_cell(cells, column.place)) for column in self.columns}
            if not any(below.values()) or all(column.unit for column in self.columns):
                continue
            for place, column in enumerate(self.columns):
                unit = below[column.place]
                if unit and column.unit and usual_unit(unit) != usual_unit(column.unit):
                    raise MeasurementError(
                        f"{self.path}, line {self.line}, column '{column.title}': expected one unit, but line {number} "
                        f"has '{unit}'; delete the wrong one"
                    )
                self.columns[place] = replace(column, unit=column.unit or unit)
            return

    def _rows(self) -> list[Row]:
        """The rows that hold numbers, and those in their midst that should; notes are taken of what is left out."""
        rows: list[Row] = []
        behind: list[Row] = []
        least, in_head = min(2, self.vocabulary.count(self.head.cells)), False
        for number, cells in self.cells:
            some = self._numbers_in(cells)
            if some and not _STATISTICS.fullmatch(next(filter(None, cells))):
                rows += [*behind, (number, cells)]
                behind, in_head = [], False
            elif cells == self.head.cells:
                # A new block; what stands between it and the last full row belongs to its head, as its units do.
                while rows and self._numbers_in(rows[-1][1]) < len(self.columns):
                    rows.pop()
                self.repeated.append(number)
                behind, in_head = [], True
            elif not some and self.vocabulary.count(cells) >= least:
                raise MeasurementError(
                    f"{self.path}, line {number}: expected one table, found names of columns that differ from those in "
                    f"line {self.line} ({', '.join(filter(None, cells))[:LONGEST_SHOWN]}); put each table into a file "
                    "of its own"
                )
            elif rows and not in_head:
                behind.append((number, cells))
        return self._noted(rows, behind)

    def _noted(self, rows: list[Row], footer: list[Row]) -> list[Row]:
        """The rows without those in which every known column is empty; what is left out is noted."""
        empty = [number for number, cells in rows if not self._numbers_in(cells) and self._is_empty(cells)]
        below = [number for number, cells in footer if not self._is_empty(cells)]
        if self.repeated:
            blocks = len(self.repeated) + 1
            self.notes.append(f"{self.path.name}: {blocks} blocks with the same header, put together")
        if empty:
            self.notes.append(f"{self.path.name}: passed over {in_words(empty)}, without a number")
        if below:
            self.notes.append(f"{self.path.name}: passed over {in_words(below)}, below the numbers")
        return [(number, cells) for number, cells in rows if number not in set(empty)] if empty else rows

    def _refuse_surplus(self, rows: list[Row]) -> None:
        """Raises MeasurementError where a row has cells that belong to no column: those before may be misplaced."""
        width = _width(self.head.cells)
        for number, cells in rows:
            if _width(cells) > width:
                cure = "give every column a name in the header"
                if self.head.delimiter == ",":
                    cure = "decimal commas need semicolons between the columns, and thousands separators have to go"
                shown = self.head.delimiter.join(cells)[:LONGEST_SHOWN]
                raise MeasurementError(
                    f"{self.path}, line {number}: expected {width} cells as in the header, found {_width(cells)} "
                    f"('{shown}'); {cure}"
                )

    def _join_equal_columns(self, rows: list[Row]) -> None:
        """Of columns of one quantity and unit with the same cells one is kept."""
        kept: list[Column] = []
        for column in self.columns:
            same = (column.quantity, column.unit, column.part)
            twins = [other for other in kept if (other.quantity, other.unit, other.part) == same]
            if not any(all(_cell(row, twin.place) == _cell(row, column.place) for _, row in rows) for twin in twins):
                kept.append(column)
        self.columns = kept


def _cell(cells: Sequence[str], place: int) -> str:
    return cells[place] if place < len(cells) else ""


def _width(cells: Sequence[str]) -> int:
    """Number of cells up to the last one that is not empty."""
    return max((place for place, cell in enumerate(cells, 1) if cell), default=0)
