"""What commands print for programs and for the clipboard."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

from pgfmd.host.streams import knows_every_letter


def print_json(value: Any, indent: int | None = 2) -> None:
    """JSON on standard output; letters that its encoding lacks are written as JSON writes them down."""
    print(json.dumps(value, indent=indent, ensure_ascii=not knows_every_letter()))


def command(*words: str | Path) -> str:
    """A command line that a shell takes as it is printed."""
    return shlex.join(map(str, words))
