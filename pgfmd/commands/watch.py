"""`pgfmd watch`: a run looked at while it goes on. Serial."""

from __future__ import annotations

import contextlib
from typing import Annotated

import typer

from pgfmd.host.walltime import seconds_of

from .names import Folder

TERMINAL_SIDE, BROWSER_SIDE = 22, 384
"""Most pixels of a side of the map."""


def watch(
    directory: Folder,
    browser: Annotated[
        bool, typer.Option("--browser", help="Show it on a page of this machine, 127.0.0.1, whose address is printed.")
    ] = False,
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Of the page; any free one with 0.", metavar="N")
    ] = 0,
    every: Annotated[str, typer.Option("--every", metavar="TIME", help="Time between looks.")] = "2s",
) -> None:
    """Watch a run: its curve as it grows and its newest map, in the terminal or a browser, until it ends."""
    try:
        seconds = seconds_of(every)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--every") from None
    if port and not browser:
        raise typer.BadParameter("goes with --browser", param_hint="--port")
    from pgfmd.watching.view import View

    # Ctrl-C is how one stops looking.
    with contextlib.suppress(KeyboardInterrupt):
        if browser:
            from pgfmd.watching.server import serve

            serve(View(directory, BROWSER_SIDE), seconds, port)
        else:
            from pgfmd.watching.terminal import watch as watch_here

            watch_here(View(directory, TERMINAL_SIDE, coarse=True), seconds)
