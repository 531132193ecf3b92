"""A page: its content as plain data, and how that becomes one file with everything in it."""

from __future__ import annotations

import base64
import gzip
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from pgfmd.errors import ResultError
from pgfmd.files.regular_files import write_atomically
from pgfmd.files.storage import reason

from .charts import Chart
from .maps import Slides
from .wording import Entry

MOST_BYTES = 5_000_000
"""Of a page: mail takes it."""
MOST_PLAIN = 400_000
"""A table of more bytes is packed (gzip)."""
MOST_EMBEDDED = 1_000_000
"""Letters (base64) of all files in a page."""
GOOD, FAIR, BAD = "good", "fair", "bad"


@dataclass(frozen=True)
class Download:
    """A file in the page: its name, its content as an address, about how large it is."""

    name: str
    address: str
    size: str


@dataclass
class Downloads:
    """The files of a page, as long as there is room for them; `left_out` says of which there was none, `notes` what else
    is to be said of them."""

    files: list[Download] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    letters: int = 0

    def add(self, name: str, content: bytes, kind: str = "text/plain") -> None:
        """A file, packed where it is large; left out, with a word, where there is no room."""
        size = len(content)
        if size > MOST_PLAIN and kind != "application/zip":
            name, content, kind = f"{name}.gz", gzip.compress(content, mtime=0), "application/gzip"
        text = base64.b64encode(content).decode()
        if self.letters + len(text) > MOST_EMBEDDED:
            self.left_out.append(f"{name} ({bytes_of(size)})")
            return
        self.letters += len(text)
        kind += ";charset=utf-8" if kind.startswith("text/") else ""
        self.files.append(Download(name, f"data:{kind};base64,{text}", bytes_of(len(content))))

    def add_zip(self, name: str, contents: Mapping[str, bytes]) -> None:
        """Several files as one archive."""
        archive = io.BytesIO()
        with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
            for each, content in contents.items():
                # A fixed date: the same folder makes the same page.
                file.writestr(zipfile.ZipInfo(each, (1980, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)
        self.add(name, archive.getvalue(), "application/zip")


@dataclass
class Block:
    """A heading with entries below it."""

    heading: str
    entries: list[Entry]
    note: str = ""


@dataclass
class Page:
    """What a page says, from its head to its foot; templates/report.html shows it.

    kind: GOOD, FAIR or BAD, of the state. cards: the numbers that are looked at first. doubts: warnings and remarks.
    cases: of a study, a head and a row a case, each with the row's kind. blocks: further numbers; folded ones are details,
    the keys of the scene, and making, versions and processes. repeat: commands; needs: what they need.
    """

    title: str
    about: str
    state: str
    kind: str = GOOD
    made: str = ""
    cards: list[Entry] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    charts: list[Chart] = field(default_factory=list)
    slides: Slides | None = None
    slides_missing: str = ""
    cases: list[tuple[str, list[str]]] = field(default_factory=list)
    pictures: list[tuple[str, str]] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)
    details: list[Block] = field(default_factory=list)
    scene: list[Block] = field(default_factory=list)
    making: list[Block] = field(default_factory=list)
    repeat: list[str] = field(default_factory=list)
    needs: list[str] = field(default_factory=list)
    downloads: Downloads = field(default_factory=Downloads)


def html_of(page: Page) -> str:
    """The page as HTML with everything in it. ResultError without jinja2."""
    try:
        from jinja2 import Environment, StrictUndefined
    except ImportError:
        raise ResultError("a report needs jinja2, which is not installed: pip install 'pgfmd[report]'") from None
    # Everything is escaped, but for what `trusted` gives: texts of users' files are among it.
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    template = environment.from_string(asset("report.html"))
    data = {"charts": [chart.data() for chart in page.charts], "slides": page.slides.data if page.slides else None}
    return template.render(page=page, data=script_data(data), style=trusted("style.css"), scripts=trusted(
        "charts.js") + trusted("slides.js"))  # fmt: skip


def asset(name: str) -> str:
    """A file of the folder templates."""
    return (files("pgfmd.reporting") / "templates" / name).read_text(encoding="utf-8")


def trusted(name: str) -> Any:
    """A script or style of our own, not to be escaped."""
    from markupsafe import Markup

    return Markup(asset(name))


def script_data(data: Any) -> Any:
    """Data as JSON within a script element: nothing in it can end the element, or begin a comment."""
    from markupsafe import Markup

    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for letter in "<>&\u2028\u2029":
        text = text.replace(letter, f"\\u{ord(letter):04x}")
    return Markup(text)


def write_page(page: Page, path: Path) -> Path:
    """Writes the page; ResultError if that can't be done, or if it is too large."""
    content = html_of(page).encode("utf-8", "replace")
    if len(content) > MOST_BYTES:
        raise ResultError(f"{path}: would be {bytes_of(len(content))} large, more than {bytes_of(MOST_BYTES)}")
    try:
        write_atomically(path, content)
    except OSError as problem:
        raise ResultError(f"{path}: could not be written: {reason(problem)}") from problem
    return path


def bytes_of(size: int) -> str:
    """A number of bytes as a person says it: "12 kB"."""
    for factor, name in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if size >= factor:
            return f"{size / factor:.3g} {name}"
    return f"{size} bytes"
