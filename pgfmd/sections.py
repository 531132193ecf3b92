"""Sections of named numbers, printed: what `check` and `analyse` show."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from typing import Any


def show(title: str, sections: Mapping[str, Iterable[Any]], notes: Iterable[tuple[str, str, str]], digits: int) -> None:
    """Prints a title, a table a section, and lines below; plain text where the output is not a terminal.

    sections: rows by title, each with `name`, `value`, `unit` and `note`. notes: (kind, style, text), such as
    ("warning", "yellow", "..."). digits: of numbers that are no whole ones.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False, width=None if sys.stdout.isatty() else 140)
    if title:
        console.print(title, style="bold", markup=False)
    for heading, rows in sections.items():
        table = Table(box=None, pad_edge=False, show_header=False, title=heading)
        table.title_justify, table.title_style = "left", "bold"
        for _ in range(4):
            table.add_column(overflow="fold")
        for row in rows:
            value = row.value
            text = f"{value:.{digits}g}" if isinstance(value, float) else "-" if value is None else str(value)
            table.add_row(*(Text(cell) for cell in (row.name, text, row.unit, row.note)))
        console.print()
        console.print(table)
    console.print()
    for kind, style, text in notes:
        console.print(f"{kind}: {text}", style=style, markup=False, soft_wrap=not console.is_terminal)
