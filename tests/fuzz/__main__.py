"""The command line of the fuzzer: `python -m tests.fuzz --help`."""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

from .campaign import CHECK_LIMIT, Campaign, findings, tell
from .relations import RELATIONS
from .scenes import make

RUN_LIMIT = 60.0
"""Time [s] that a run, or a pair of runs, may take unless said otherwise."""


def main(arguments: list[str] | None = None) -> int:
    """Exit code 1 if there was a fault."""
    options = _parser().parse_args(arguments)
    if options.what == "show":
        print(make(options.seed, options.index, options.kind).text, end="")
        return 0
    indices = tuple(options.index or range(options.first, options.first + options.count))
    folder = (options.out or Path(tempfile.mkdtemp(prefix="pgfmd-fuzz-"))).absolute()
    limit = options.limit or (CHECK_LIMIT if options.what == "check" else RUN_LIMIT)
    campaign = Campaign(
        options.what, options.seed, indices, folder, limit, getattr(options, "only", None), options.each
    )
    wrong = tell(campaign, findings(campaign, min(options.workers, len(indices))))
    return 1 if wrong else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=sys.modules["tests.fuzz"].__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
    commands = parser.add_subparsers(dest="what", required=True)
    for what, count, about in (
        ("check", 1000, "read scenes, most of them absurd"),
        ("run", 100, "run scenes, most of them plausible"),
        ("relate", 50, "run plausible scenes in two ways that must agree"),
    ):
        command = commands.add_parser(what, help=about)
        command.add_argument("--seed", type=int, default=1)
        command.add_argument("--count", type=int, default=count, help="number of scenes (default %(default)s)")
        command.add_argument("--first", type=int, default=0, help="number of the first one")
        command.add_argument("--index", type=int, nargs="*", help="these numbers instead")
        command.add_argument("--workers", type=int, default=1)
        command.add_argument(
            "--limit", type=float, help=f"time [s] for a scene (check {CHECK_LIMIT:g}, else {RUN_LIMIT:g})"
        )
        command.add_argument("--out", type=Path, help="folder for scenes with faults and their results")
        command.add_argument("--each", action="store_true", help="tell of every scene what came of it, and its cost")
        if what == "relate":
            command.add_argument("--only", choices=RELATIONS, help="this relation alone")
    show = commands.add_parser("show", help="print a scene")
    show.add_argument("seed", type=int)
    show.add_argument("index", type=int)
    show.add_argument("kind", nargs="?", default="check", choices=("check", "run", "relate"))
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
