"""The schemes there are. Loads none of them, no MPI, no numba: what they can do is told by their entries (entry.py).

A scheme is a folder, whose `__init__.py` holds its entry as ENTRY, and one line here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from . import gfmd, inertialess, quasistatic
from .entry import SchemeEntry

_ENTRIES: dict[str, SchemeEntry] = {}

DEFAULT = inertialess.ENTRY.name
"""The scheme of scenes, and of old folders, that name none."""
UNKNOWN = SchemeEntry(
    name="", meaning="a scheme that is not here", build="", memory="", warm_up="", inertia=True,
    unread=dict.fromkeys(("solver.accuracy", "solver.order"), "nothing is known of its steps"),
)  # fmt: skip
"""What is supposed of the scheme of a folder that some other pgfmd has written: nothing that would lend it a number."""


def register(entry: SchemeEntry) -> None:
    """Adds a scheme. ValueError where there is one of that name, or one that reads its section."""
    if entry.name in _ENTRIES:
        raise ValueError(f"scheme {entry.name!r}: there is one of this name already")
    if entry.section and reader_of(entry.section):
        raise ValueError(f"scheme {entry.name!r}: [{entry.section}] is read by {reader_of(entry.section)!r} already")
    _ENTRIES[entry.name] = entry


@contextmanager
def registered(entry: SchemeEntry) -> Iterator[SchemeEntry]:
    """Within this, there is one more scheme."""
    register(entry)
    try:
        yield entry
    finally:
        del _ENTRIES[entry.name]


def names() -> tuple[str, ...]:
    """What `solver.scheme` may be."""
    return tuple(_ENTRIES)


def entries() -> tuple[SchemeEntry, ...]:
    """All schemes."""
    return tuple(_ENTRIES.values())


def named(name: str) -> SchemeEntry:
    """The scheme of this name. KeyError where there is none."""
    return _ENTRIES[name]


def scheme_of(scene: Any) -> SchemeEntry:
    """The scheme of a Scene."""
    return _ENTRIES[scene.solver.scheme]


def scheme_in(solver: Mapping[str, Any]) -> SchemeEntry:
    """The scheme of a section `solver` as a mapping, or of `run.json`: DEFAULT where it names none, UNKNOWN where that is
    not here."""
    return _ENTRIES.get(solver.get("scheme", DEFAULT), UNKNOWN)


def sections() -> tuple[str, ...]:
    """The sections of a scene that only one scheme reads."""
    return tuple(entry.section for entry in entries() if entry.section)


def reader_of(section: str) -> str:
    """The name of the scheme that alone reads a section; empty where all do."""
    return next((entry.name for entry in entries() if entry.section == section), "")


for _folder in (inertialess, gfmd, quasistatic):
    register(_folder.ENTRY)
