"""Pages of docs/ with blocks that scripts write: from `<!-- KIND NAME -->` to `<!-- end -->`."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path


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
