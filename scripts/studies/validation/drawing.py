"""What the figures share: colours, panels, slope triangles, and how a number is compared with a closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from pgfmd.plots.drawing import GREY, RED, TURQUOISE, new_figure

OCHRE, VIOLET = "#d18f00", "#6a4c93"
COLOURS = (TURQUOISE, RED, OCHRE, VIOLET)
MARKERS = ("o", "s", "^", "D")


@dataclass(frozen=True)
class Line:
    """One comparison: what, with which settings, the closed form and our number, in the same unit.

    The error is relative, or absolute where the closed form is zero. Where there is no closed form, as for an order of
    convergence that no theory promises, it is NaN.
    """

    what: str
    settings: str
    closed: float
    ours: float

    @property
    def error(self) -> float:
        """ours/closed - 1, or ours where the closed form is zero."""
        return self.ours / self.closed - 1.0 if self.closed else self.ours

    @property
    def shown_error(self) -> str:
        """The error for a reader, see `shown`."""
        return shown(self.closed, self.error)


def shown(closed_form: float, error: float) -> str:
    """An error in per cent, or as a number where it is absolute or below 1e-5; nothing without a closed form."""
    if math.isnan(closed_form):
        return ""
    size = abs(error)
    if closed_form == 0.0 or size < 1e-5:
        return number(error)
    digits = max(0, 1 - math.floor(math.log10(100 * size)))
    return f"{100 * error:+.{digits}f}\N{NO-BREAK SPACE}%".replace("-", "\N{MINUS SIGN}")


def number(value: float, digits: int = 3) -> str:
    """A number with a true minus sign, for a table or a title; powers of ten in words that HTML and text both show."""
    if math.isnan(value):
        return ""
    text = f"{value:.{digits}g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        raised = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        text = f"{mantissa}\N{MULTIPLICATION SIGN}10{raised}"
    return text.replace("-", "\N{MINUS SIGN}")


def panels(columns: int = 2, height: float = 2.9, rows: int = 1, **options) -> tuple[Any, np.ndarray]:
    """A figure of the width of a page, and its axes (columns,), or (rows, columns)."""
    figure = new_figure(7.4, height)
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, axes[0] if rows == 1 else axes


def closed(axis, x, y, index: int = 0, **options) -> None:
    """A closed form: a line."""
    axis.plot(x, y, **({"color": COLOURS[index], "lw": 1.2} | options))


def ours(axis, x, y, index: int = 0, **options) -> None:
    """Our numbers: open markers."""
    style = {"color": COLOURS[index], "marker": MARKERS[index], "ls": "none", "ms": 4.2, "mfc": "white", "mew": 1.0}
    axis.plot(x, y, **(style | options))


def chosen(values: np.ndarray, count: int) -> np.ndarray:
    """Indices of `count` elements at even distances in ascending `values`, the first and the last with them."""
    wanted = np.linspace(values[0], values[-1], count)
    return np.unique(np.searchsorted(values, wanted).clip(0, len(values) - 1))


def order(x, errors) -> float:
    """Order of convergence: the slope of log error against log x, over the last two points."""
    (x0, x1), (e0, e1) = np.asarray(x, float)[-2:], np.abs(np.asarray(errors, float))[-2:]
    return float(np.log(e1 / e0) / np.log(x1 / x0))


def convergence(axis, x, errors, index: int = 0, **options) -> None:
    """|error| against x, both logarithmic; the ticks are the points."""
    x, errors = np.asarray(x, float), np.abs(np.asarray(errors, float))
    ours(axis, x, errors, index, **({"ls": "-", "lw": 0.8} | options))
    axis.set(xscale="log", yscale="log")
    axis.minorticks_off()
    axis.set_xticks(x, [f"{value:.3g}" for value in x])


def triangle(axis, left: float, right: float, foot: float, slope: float) -> None:
    """A triangle that rises (or falls) with `slope` in double logarithmic axes, from (left, foot)."""
    head = foot * (right / left) ** slope
    axis.fill([left, right, right], [foot, foot, head], fc="none", ec=GREY, lw=0.8)
    place = {"xytext": (3, 0), "textcoords": "offset points", "fontsize": 7.5, "color": GREY, "va": "center"}
    axis.annotate(f"{abs(slope):g}", (right, math.sqrt(foot * head)), **place)
