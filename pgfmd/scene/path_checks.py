"""The rules of a scene about the paths that it names (see checks.py)."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from pgfmd.errors import Problem

from .draft import Draft, Unread, is_unicode

FILE_KEYS = ("punch.file", "substrate.compliance_file")


def _paths(draft: Draft, keys: tuple[str, ...]) -> Iterator[tuple[str, str, Path]]:
    """Key, text and absolute path of the paths that a scene names."""
    for dotted in keys:
        try:
            text, path = draft[dotted], draft.path(dotted)
        except Unread:
            continue
        if text is not None:
            yield dotted, text, path


def paths_can_be_written(draft: Draft) -> Iterator[Problem]:
    """Paths go into the resolved scene, and into files that are read by others."""
    for dotted, text, path in _paths(draft, (*FILE_KEYS, "output.directory")):
        if "\0" in text:
            yield draft.problem(dotted, "a path", "take out the character of code 0")
        elif not is_unicode(str(path) if dotted in FILE_KEYS else text):
            yield draft.problem(dotted, "a path in UTF-8", f"rename what is not in {str(path)!r}")
        elif text.startswith("~") and os.path.expanduser(text) == text:
            user = text.partition("/")[0]
            yield draft.problem(dotted, "a path", f"there is no home folder {user}; write ./{text} for a name with ~")


def files_exist(draft: Draft) -> Iterator[Problem]:
    for dotted, text, path in _paths(draft, FILE_KEYS):
        if os.path.isdir(path):
            yield draft.problem(dotted, "a file", f"{path} is a folder")
        elif not os.path.isfile(path) and not text.startswith("~"):
            cure = f"there is none at {path}; paths start at the scene's folder"
            yield draft.problem(dotted, "a file that exists", cure)
