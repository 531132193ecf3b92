"""A run in the terminal: status, curve and newest map, drawn with letters, until it ends."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pgfmd.host.streams import knows_every_letter, say
from pgfmd.plots.curves import axis_unit, labelled
from pgfmd.plots.drawing import seen
from pgfmd.reporting.maps import OUTSIDE

from .view import Glimpse, Map, View, heading, line_of

if TYPE_CHECKING:
    from rich.console import RenderableType

Array = NDArray[np.float64]
BRAILLE = 0x2800
"""The first of the letters of 2 by 4 dots."""
DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""The bits of its dots, row by row from above."""
SHADES = "█▓▒░"
LETTERS = "#+-."
"""Of the classes of gaps from overlap on, where the terminal has no shades."""


def watch(view: View, every: float, rest: Callable[[float], None] = time.sleep) -> None:
    """Shows a run until it ends, every so many seconds: drawn on a terminal, a line each time elsewhere.

    rest: waits so many seconds. Raises ResultError as `View.look` does, KeyboardInterrupt.
    """
    if sys.stdout.isatty():
        _draw(view, every, rest)
        return
    before = ""
    while True:
        glimpse = view.look()
        line = line_of(glimpse.status)
        if line != before:
            say(line)
        before = line
        if glimpse.over:
            return
        rest(every)


def _draw(view: View, every: float, rest: Callable[[float], None]) -> None:
    from rich.console import Console
    from rich.live import Live

    console = Console(highlight=False)
    with Live(console=console, auto_refresh=False, vertical_overflow="crop") as live:
        while True:
            glimpse = view.look()
            live.update(picture(glimpse, *shutil.get_terminal_size()), refresh=True)
            if glimpse.over:
                return
            rest(every)


def picture(glimpse: Glimpse, columns: int, rows: int) -> RenderableType:
    """All that is shown, for a terminal of so many letters."""
    from rich.text import Text

    letters = knows_every_letter()
    lines = [heading(glimpse.status), line_of(glimpse.status), *(f"warning: {text}" for text in glimpse.doubts)]
    room = max(rows - len(lines) - 5, 6)
    drawn = map_lines(glimpse.map, letters) if glimpse.map else []
    beside = len(drawn[0]) + 3 if drawn and columns >= len(drawn[0]) + 3 + 40 and room >= len(drawn) else 0
    curve = curve_lines(glimpse, columns - beside - 1, min(room, 24), letters)
    if beside:
        below = [f"newest map, {glimpse.map.label}" if glimpse.map else "", *legend(glimpse.map, letters)]
        curve += [""] * (len(drawn) - len(curve))
        drawn += [""] * (len(curve) - len(drawn))
        width = columns - beside - 1
        curve = [f"{left:<{width}}   {right}" for left, right in zip(curve, drawn, strict=True)]
        lines += ["", *curve, "  ".join(below)]
    else:
        lines += ["", *curve]
    return Text("\n".join(line[: max(columns - 1, 1)] for line in lines))


def curve_lines(glimpse: Glimpse, columns: int, rows: int, letters: bool = True) -> list[str]:
    """Force against indentation, as lines of letters with the ends of both axes."""
    if len(glimpse.force) < 2:
        return ["(no curve yet)"]
    across, along = axis_unit([glimpse.indentation], "m"), axis_unit([glimpse.force], "N")
    x, y = seen(glimpse.indentation / across[0], glimpse.force / along[0])
    low, high = float(y.min()), float(y.max())
    ends = [f"{high:.3g}", f"{low:.3g}"]
    width = max(map(len, ends)) + 1
    body = dots(x, y, max(columns - width - 1, 10), max(rows - 2, 3), letters)
    border = "│" if letters else "|"
    heads = [ends[0], *[""] * (len(body) - 2), ends[1]]
    lines = [f"{head:>{width}}{border}{row}" for head, row in zip(heads, body, strict=True)]
    left, right = f"{x.min():.3g}", f"{x.max():.3g}"
    title = labelled("indentation", across[1])
    space = max(columns - width - 1 - len(left) - len(right), len(title))
    foot = f"{'':>{width + 1}}{left}{title:^{space}}{right}"
    return [labelled("force", along[1]), *lines, foot]


def dots(x: Array, y: Array, columns: int, rows: int, letters: bool = True) -> list[str]:
    """A line through points, (points,) each, as lines of letters; each letter is 2 by 4 dots, or else one."""
    across, up = (2, 4) if letters else (1, 1)
    wide, tall = columns * across - 1, rows * up - 1
    place = [_placed(values, size) for values, size in ((x, wide), (-np.asarray(y), tall))]
    steps = np.maximum(*(np.abs(np.diff(values)) for values in place)).astype(int) + 1
    grid = np.zeros((rows * up, columns * across), bool)
    for k, count in enumerate(steps):
        share = np.linspace(0.0, 1.0, count + 1)
        right, down = (np.rint(values[k] + share * (values[k + 1] - values[k])).astype(int) for values in place)
        grid[down, right] = True
    if not letters:
        return ["".join("*" if one else " " for one in row) for row in grid]
    bits = sum(
        grid[row::4, column::2].astype(int) * DOTS[row][column] for row in range(4) for column in range(2)
    )  # fmt: skip
    return ["".join(chr(BRAILLE + one) if one else " " for one in row) for row in np.asarray(bits)]


def _placed(values: Array, size: int) -> Array:
    """Values brought to between 0 and size; all in the middle where they are equal."""
    low, high = float(np.min(values)), float(np.max(values))
    return np.full(len(values), 0.5 * size) if high <= low else (np.asarray(values) - low) / (high - low) * size


def map_lines(found: Map, letters: bool = True) -> list[str]:
    """A map as lines of letters, two for each point."""
    shades = _shades(found, letters)
    return ["".join("  " if each == OUTSIDE else 2 * shades[each] for each in row) for row in found.numbers]


def legend(found: Map | None, letters: bool = True) -> list[str]:
    """What the letters of a map mean."""
    if found is None:
        return []
    labels = [each.label.replace("µ", "u") if not letters else each.label for each in found.classes]
    return [f"{shade} {label}" for shade, label in zip(_shades(found, letters), labels, strict=False)]


def _shades(found: Map, letters: bool) -> str:
    """A letter for each class, the last always the one for what is open."""
    shades = SHADES if letters else LETTERS
    return shades[: len(found.classes) - 1] + shades[-1]
