"""Output to terminals and pipes that know fewer letters than what is said: a title in Greek must not end a command."""

from __future__ import annotations

import codecs
import sys

FORGIVING = "pgfmd.forgiving"
"""Handler of letters that an encoding lacks: a byte of a file's name that is no text goes out as it is, others as
`?`."""


def forgive(*streams: object) -> None:
    """From here on these streams, or else standard output and standard error, take every text."""
    codecs.register_error(FORGIVING, _replaced)
    for stream in streams or (sys.stdout, sys.stderr):
        # None without a terminal; something else where a test or a notebook listens.
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=FORGIVING)


def knows_every_letter() -> bool:
    """Whether standard output takes every text as it is."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        return codecs.lookup(encoding).name.startswith("utf-")
    except LookupError:
        return False


def _replaced(error: UnicodeError) -> tuple[str | bytes, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    letter = error.object[error.start]
    if "\udc80" <= letter <= "\udcff":
        return bytes([ord(letter) - 0xDC00]), error.start + 1
    return "?", error.start + 1
