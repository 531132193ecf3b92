"""Executes the notebooks of the tutorials, and keeps their outputs in them, as the pages show them.

    python -m scripts.studies.notebooks.run

Needs nbclient and ipykernel, which come with the extra `docs`. Times are those of the machine that it is run on.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import nbformat
from nbclient import NotebookClient

ROOT = Path(__file__).resolve().parents[3]
FOLDER = ROOT / "docs" / "tutorials"
LONGEST = 900
"""Time [s] that a cell may take."""


def execute(path: Path, parameters: str | None = None) -> nbformat.NotebookNode:
    """The notebook with its outputs; parameters: what the cell with that tag is replaced by. Raises CellExecutionError."""
    book = nbformat.read(path, as_version=4)
    for cell in book.cells:
        if parameters is not None and "parameters" in cell.metadata.get("tags", []):
            cell.source = parameters
    NotebookClient(book, timeout=LONGEST, kernel_name="python3", resources={"metadata": {"path": str(ROOT)}}).execute()
    for cell in book.cells:
        # When a cell was executed is of no use to a reader, and makes every execution another file.
        cell.metadata.pop("execution", None)
    return book


def main() -> None:
    """Executes all notebooks, or those that are named."""
    options = argparse.ArgumentParser(description="Execute the notebooks of the tutorials.")
    options.add_argument("names", nargs="*", help="without their ending; all by default")
    names = options.parse_args().names
    for path in sorted(FOLDER.glob("*.ipynb")):
        if not names or path.stem in names:
            print(path.relative_to(ROOT), file=sys.stderr)
            nbformat.write(execute(path), path)


if __name__ == "__main__":
    main()
