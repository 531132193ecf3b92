"""The command line of scripts that make one or some of a table of things."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping

PLURALS = {"study": "studies", "figure": "figures"}


def chosen(doc: str, kind: str, table: Mapping[str, Callable], quick_help: str) -> tuple[Iterable[str], bool]:
    """The names asked for, all if none is, and whether to be quick; `--list` shows the table and ends the program."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar=kind, help=f"names of {PLURALS[kind]}; all if none is given")
    parser.add_argument("--quick", action="store_true", help=quick_help)
    parser.add_argument("--list", action="store_true", help=f"the {PLURALS[kind]} and what they show")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.names if name not in table]
    if unknown:
        parser.error(f"no {kind} {', '.join(unknown)}; choose from {', '.join(table)}")
    if arguments.list:
        for name, maker in table.items():
            print(f"{name:15s} {maker.__doc__.splitlines()[0]}")
        sys.exit()
    return arguments.names or table, arguments.quick
