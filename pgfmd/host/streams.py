"""Standard streams that are closed, full, without a reader, or can't encode a text. None of this must end a command. No
MPI."""

from __future__ import annotations

import codecs
import contextlib
import os
import sys
from typing import IO

from pgfmd.errors import ResultError
from pgfmd.files.storage import reason

_NAMES = ("stdin", "stdout", "stderr")
FORGIVING = "pgfmd.forgiving"
"""Error handler for letters that an encoding lacks: undecodable bytes of file names are written unchanged, other
letters as `?`."""


def open_closed() -> None:
    """Opens /dev/null in place of standard streams that the caller has closed (`>&-`).

    Otherwise the next opened file would get one of their numbers, and output of a library would end up in results.
    """
    for number, name in enumerate(_NAMES):
        try:
            os.fstat(number)
        except OSError:
            _lead_nowhere(number)
        if getattr(sys, name) is None:
            setattr(sys, name, _nothing("w" if number else "r"))


def forgive(*streams: object) -> None:
    """Makes these streams, or standard output and standard error, accept every text."""
    codecs.register_error(FORGIVING, _replaced)
    for stream in streams or (sys.stdout, sys.stderr):
        # None without a terminal; another object in a test or a notebook.
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors=FORGIVING)


def knows_every_letter() -> bool:
    """Whether standard output can encode every text."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        return codecs.lookup(encoding).name.startswith("utf-")
    except LookupError:
        return False


def say(line: str) -> None:
    """Prints a line of progress. If that fails, prints a message on stderr once, and nothing from then on."""
    try:
        print(line, flush=True)
    except UnicodeEncodeError:
        say(ascii(line)[1:-1])
    except (OSError, ValueError) as problem:
        _give_up("stdout")
        complain(
            f"warning: standard output can't be written ({reason(problem)}): this goes on without further words there"
        )


def complain(message: object) -> None:
    """A message for the user, on stderr. Never raises."""
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
    try:
        sys.stderr.write(f"pgfmd: {message}\n")
        sys.stderr.flush()
    except (OSError, ValueError):
        _give_up("stderr")


def finish(code: int) -> int:
    """Flushes the output; returns the exit code of the command, which is that of an error if flushing fails."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError) as problem:
        return refuse(problem, code)
    return code


def refuse(problem: Exception, code: int = 0) -> int:
    """Exit code of a command whose output could not be printed; prints a message unless the reader has gone."""
    _give_up("stdout")
    if not isinstance(problem, BrokenPipeError):
        complain(f"standard output can't be written: {reason(problem)}")
    return code or ResultError.exit_code


def _give_up(name: str) -> None:
    """Redirects a stream to /dev/null, including its buffered output."""
    with contextlib.suppress(OSError, ValueError):
        _lead_nowhere(getattr(sys, name).fileno())
        return
    setattr(sys, name, _nothing("w"))


def _nothing(mode: str) -> IO[str]:
    return open(os.devnull, mode)


def _lead_nowhere(number: int) -> None:
    nothing = os.open(os.devnull, os.O_RDWR)
    if nothing == number:
        os.set_inheritable(number, True)
        return
    os.dup2(nothing, number)
    os.close(nothing)


def _replaced(error: UnicodeError) -> tuple[str | bytes, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    letter = error.object[error.start]
    if "\udc80" <= letter <= "\udcff":
        return bytes([ord(letter) - 0xDC00]), error.start + 1
    return "?", error.start + 1
