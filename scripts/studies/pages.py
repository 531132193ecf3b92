"""Where the pages and pictures of docs/ are, and the blocks of pages that studies write: from `<!-- KIND NAME -->` to
`<!-- end -->`."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
FIGURES = DOCS / "figures"
"""Pictures of the pages, and the tables of numbers that pictures and pages are made from."""


def page_named(name: str) -> Path:
    """The page of docs/ with this file name, in whichever folder. LookupError unless there is just one."""
    found = [path for path in DOCS.rglob(name) if "_build" not in path.parts]
    if len(found) != 1:
        raise LookupError(f"docs/ has {len(found)} pages with the name {name}, where one was expected")
    return found[0]


def fill(page: Path, kind: str, block: Callable[[str], str]) -> None:
    """Writes the blocks of a kind anew in a file; `block` is given their names. ValueError if there is none."""
    page.write_text(filled(page.read_text(encoding="utf-8"), kind, block), encoding="utf-8")


def filled(text: str, kind: str, block: Callable[[str], str]) -> str:
    """The same for the text of a page."""

    def replaced(match: re.Match) -> str:
        return f"{match[1]}\n\n{block(match[2]).strip()}\n\n<!-- end -->"

    text, count = re.subn(rf"(<!-- {kind} ([\w-]+) -->)\n.*?<!-- end -->", replaced, text, flags=re.DOTALL)
    if not count:
        raise ValueError(f"the page has no block of the kind {kind!r}")
    return text
