"""Docstrings as they are written here, plain text that is no reStructuredText, made fit for Sphinx.

Indented paragraphs are formulas or examples. Lines such as "radius: of the punch [m]" are a list where there are
several, and so is what follows a line "Args:" or "Raises:". Everything else is text; only `names` in backticks are
marked up.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator

SECTIONS = {"Args:": "Arguments", "Raises:": "Raises", "Returns:": "Returns", "Attributes:": "Attributes"}
ENTRY = re.compile(r"[A-Za-z_][\w., *]{0,60}(\([^)]*\)|\[[^\]]*\])?(, [^:]{0,40})?: ")


def process(_app, _what, _name, _object, _options, lines: list[str]) -> None:
    """Sphinx's event `autodoc-process-docstring`: changes the lines in place."""
    text = "\n".join(lines)
    paragraphs = [block for block in re.split(r"\n\s*\n", text) if block.strip()]
    lines[:] = [line for paragraph in paragraphs for line in (*_paragraph(paragraph.strip("\n").split("\n")), "")]


def _paragraph(lines: list[str]) -> Iterator[str]:
    if lines[0] in SECTIONS:
        yield from (f"**{SECTIONS[lines[0]]}**", "")
        yield from _entries(textwrap.dedent("\n".join(lines[1:])).split("\n"))
    elif all(line.startswith(" ") for line in lines):
        yield from ("::", "", *("    " + line for line in textwrap.dedent("\n".join(lines)).split("\n")))
    elif ENTRY.match(lines[0]) and sum(ENTRY.match(line) is not None for line in lines) > 1:
        yield from _entries(lines)
    else:
        yield _escaped(" ".join(line.strip() for line in lines))


def _entries(lines: list[str]) -> Iterator[str]:
    """A list with an item for every line that begins one; the others continue the item before."""
    items: list[str] = []
    for line in lines:
        if items and (line.startswith(" ") or not ENTRY.match(line)):
            items[-1] += " " + line.strip()
        else:
            items.append(line.strip())
    yield from ("- " + _escaped(item) for item in items)


def _escaped(text: str) -> str:
    """Text with code in backticks, and no other markup."""
    parts = re.split(r"`+([^`]+)`+", text)
    parts[::2] = [re.sub(r"([\\*|_`])", r"\\\1", part) for part in parts[::2]]
    parts[1::2] = [f"``{part}``" for part in parts[1::2]]
    return "".join(parts)
