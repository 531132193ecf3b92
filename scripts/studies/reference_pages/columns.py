"""Writes the tables of columns on the page "Files of a run" anew, from their declarations (pgfmd/files/tables.py).

python -m scripts.studies.reference_pages.columns
"""

from __future__ import annotations

from itertools import groupby

from pgfmd.files.tables import TABLES, WITHOUT_PROGRAMMES, Column

from .. import pages


def block(name: str) -> str:
    """The columns of a table, as Markdown; columns in a row that mean the same share a line. StopIteration for a name
    that no table has."""
    table = next(table for table in TABLES if table.name == name)
    lines = ["| column | meaning |", "| --- | --- |"]
    for meaning, columns in groupby(table.columns, key=meaning_of):
        titles = ", ".join(f"`{column.title}`" for column in columns)
        lines.append(f"| {titles} | {meaning} |")
    return "\n".join(lines)


def meaning_of(column: Column) -> str:
    """What a column holds, and which runs have none of it."""
    if not column.after:
        return column.meaning
    versions = ["version 0.1"] + ["earlier builds of 0.2"] * (column.after == WITHOUT_PROGRAMMES)
    return f"{column.meaning} (not in runs of {' or of '.join(versions)})"


def main() -> None:
    """Fills the page."""
    pages.fill(pages.page_named("results.md"), "columns", block)


if __name__ == "__main__":
    main()
