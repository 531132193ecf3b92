"""Follows every internal link of the built pages: files and anchors, in pages, notebooks and their pictures.

python docs/check_links.py docs/_build/html     prints what leads nowhere; exit code 1 if anything does
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

TARGETS = ("href", "src", "poster", "data")
"""Attributes whose value is an address."""


class Page(HTMLParser):
    """Addresses that a page refers to, with their lines, and the names that it can be entered by."""

    def __init__(self, text: str):
        super().__init__()
        self.links: list[tuple[int, str]] = []
        self.names: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Takes the addresses and names of an element."""
        for key, value in attrs:
            if key == "id" or (key == "name" and tag == "a"):
                self.names.add(value or "")
            elif key in TARGETS and value:
                self.links.append((self.getpos()[0], value))


def dead_links(root: Path) -> Iterator[str]:
    """A line for each link of the pages below a folder that leads to no file of it, or to no anchor of a page."""
    pages = {path.resolve(): Page(path.read_text(encoding="utf-8")) for path in sorted(root.rglob("*.html"))}
    for path, page in pages.items():
        for line, link in page.links:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            where = f"{path.relative_to(root.resolve())}:{line}: {link}"
            if not target.is_file():
                yield f"{where}: there is no such file"
            elif target in pages and parts.fragment and unquote(parts.fragment) not in pages[target].names:
                yield f"{where}: the page has no such anchor"


def main() -> int:
    """Examines the pages in the folder that is given."""
    root = Path(sys.argv[1])
    if not any(root.rglob("*.html")):
        print(f"{root}: has no pages; scripts/docs builds them", file=sys.stderr)
        return 2
    dead = list(dead_links(root))
    print(*dead, sep="\n", end="\n" * bool(dead), file=sys.stderr)
    return 1 if dead else 0


if __name__ == "__main__":
    sys.exit(main())
