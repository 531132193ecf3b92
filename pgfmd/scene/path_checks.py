"""The rules of a scene about the paths that it names (see checks.py)."""

from __future__ import annotations

import os
from collections.abc import Iterator

from pgfmd.errors import Problem

from .partial_scene import PartialScene, Unread, is_unicode
from .unresolved_scene import PATHS


def paths_can_be_used(partial: PartialScene) -> Iterator[Problem]:
    """Files must exist, and it must be possible to write paths into the resolved scene."""
    for dotted in (*PATHS, "output.directory"):
        try:
            text, path = partial[dotted], partial.path(dotted)
        except Unread:
            continue
        if text is None or path is None:
            continue
        if "\0" in text:
            yield partial.problem(dotted, "a path", "take out the character of code 0")
        elif dotted in PATHS and not is_unicode(str(path)):
            yield partial.problem(dotted, "a path in UTF-8", f"rename what is not in {str(path)!r}")
        elif text.startswith("~") and os.path.expanduser(text) == text:
            user = text.partition("/")[0]
            yield partial.problem(dotted, "a path", f"there is no home folder {user}; write ./{text} for a name with ~")
        elif dotted in PATHS and os.path.isdir(path):
            yield partial.problem(dotted, "a file", f"{path} is a folder")
        elif dotted in PATHS and not os.path.isfile(path):
            cure = f"there is none at {path}; paths start at the scene's folder"
            yield partial.problem(dotted, "a file that exists", cure)
