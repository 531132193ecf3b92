"""Text files that a user brings, in whatever encoding an editor, a spreadsheet or an instrument wrote them."""

from __future__ import annotations

import codecs
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

BYTE_ORDER_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    # Before UTF-16, whose mark it begins with.
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
UNMARKED = ("utf-8", "cp1252")
"""Encodings tried without a mark. Windows' 1252 holds Latin-1 but for control characters, which no text has."""


def read_text(path: str | Path) -> str:
    """The text of a file in UTF-8, UTF-16, UTF-32 or Windows-1252 (Latin-1), with a byte order mark or without.

    Ends of lines come as "\\n", whichever they were. Raises OSError, and ValueError for what is no such text.
    """
    return decoded(Path(path).read_bytes())


def read_numbers(path: str | Path, delimiter: str | None = None) -> NDArray[np.float64]:
    """The numbers of a text file, (rows, columns); # starts a comment. delimiter: None for blanks.

    Raises OSError, and ValueError for what is no table of numbers.
    """
    lines = read_text(path).split("\n")
    if not any(line.partition("#")[0].strip() for line in lines):
        raise ValueError("holds no numbers")
    return np.loadtxt(lines, comments="#", delimiter=delimiter, ndmin=2)


def decoded(raw: bytes) -> str:
    """The text of a file's bytes, as `read_text` reads it. Raises ValueError for what is no text."""
    marked = next((coding for mark, coding in BYTE_ORDER_MARKS if raw.startswith(mark)), None)
    for coding in (marked,) if marked else UNMARKED:
        try:
            text = raw.decode(coding)
        except UnicodeDecodeError:
            continue
        if "\0" not in text:
            return text.replace("\r\n", "\n").replace("\r", "\n")
    raise ValueError("not a text file; save it as text in UTF-8")
