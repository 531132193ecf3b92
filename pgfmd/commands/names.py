"""Options and arguments that name files and folders: an empty one is a variable that is not set, and is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer


def named(text: str | Path) -> Path:
    """The path that a user names, or a default. A usage error if it is empty: that would be the current folder."""
    if not str(text).strip():
        raise typer.BadParameter("is empty: name a file or folder (`.` is the current folder)")
    return Path(text)


def path_option(*names: str, metavar: str, help: str) -> Any:
    """An option that names a file or a folder."""
    return typer.Option(*names, metavar=metavar, parser=named, help=help)


Folder = Annotated[Path, typer.Argument(metavar="DIR", parser=named, help="A folder that a run wrote to.")]
