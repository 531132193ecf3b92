"""The list of schemes. Loads neither their code nor MPI or numba: entries describe them (entry.py).

A scheme is a folder with its entry ENTRY in `__init__.py`, and one line here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from . import gfmd, inertialess, quasistatic
from .entry import SchemeEntry

_ENTRIES: dict[str, SchemeEntry] = {}

DEFAULT = inertialess.ENTRY.name
"""The scheme of scenes and old folders that do not name one."""
UNKNOWN = SchemeEntry(
    name="", meaning="a scheme that is not here", build="", memory="", warm_up="", inertia=True,
    unread=dict.fromkeys(("solver.accuracy", "solver.order"), "nothing is known of its steps"),
)  # fmt: skip
"""The assumed entry for an unknown scheme in a folder of another version: without any numbers."""


def register(entry: SchemeEntry) -> None:
    """Adds a scheme. Raises ValueError if there is one of that name, or one that reads its section."""
    if entry.name in _ENTRIES:
        raise ValueError(f"scheme {entry.name!r}: there is one of this name already")
    if entry.section and reader_of(entry.section):
        raise ValueError(f"scheme {entry.name!r}: [{entry.section}] is read by {reader_of(entry.section)!r} already")
    _ENTRIES[entry.name] = entry


@contextmanager
def registered(entry: SchemeEntry) -> Iterator[SchemeEntry]:
    """A context in which there is an additional scheme."""
    register(entry)
    try:
        yield entry
    finally:
        del _ENTRIES[entry.name]


def names() -> tuple[str, ...]:
    """The names of all schemes, the choices of `solver.scheme`."""
    return tuple(_ENTRIES)


def entries() -> tuple[SchemeEntry, ...]:
    """All schemes."""
    return tuple(_ENTRIES.values())


def named(name: str) -> SchemeEntry:
    """The scheme of this name. Raises KeyError if there is none."""
    return _ENTRIES[name]


def scheme_of(scene: Any) -> SchemeEntry:
    """The scheme of a Scene."""
    return _ENTRIES[scene.solver.scheme]


def scheme_in(solver: Mapping[str, Any]) -> SchemeEntry:
    """The scheme of a section `solver` as a mapping, or of `run.json`: DEFAULT if it has none, UNKNOWN for another
    name."""
    return _ENTRIES.get(solver.get("scheme", DEFAULT), UNKNOWN)


def sections() -> tuple[str, ...]:
    """The sections of a scene that belong to a single scheme."""
    return tuple(entry.section for entry in entries() if entry.section)


def reader_of(section: str) -> str:
    """The name of the only scheme that reads a section; empty if all do."""
    return next((entry.name for entry in entries() if entry.section == section), "")


for _folder in (inertialess, gfmd, quasistatic):
    register(_folder.ENTRY)
