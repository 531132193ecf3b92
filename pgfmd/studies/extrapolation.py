"""A quantity over the levels of a refinement: the fits and the doubts about them, as text, JSON and a picture."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pgfmd.errors import ResultError
from pgfmd.files import storage
from pgfmd.files.regular_files import write_atomically, write_figure
from pgfmd.plots.drawing import DASHES, GREY, RED, TURQUOISE, drawing, literal, new_figure, picture
from pgfmd.units import handy

from .convergence import Fit, disagreement, doubts, finest_limit, fit_power_law, local_powers
from .refinement import ACCURACY, FEWEST, MEASURES, Levels, expected_power
from .table import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

JSON_FILE, PICTURE = "converge.json", "converge.png"
LEVELS_TO_FIT_POWER = 4


@dataclass(frozen=True)
class Level:
    """A finished level. size: mesh size [m] or accuracy; range [m]; value: the quantity, SI; residual: of the audit."""

    case: str
    n: int
    range_m: float
    accuracy: float
    size: float
    value: float
    residual: float | None


@dataclass(frozen=True)
class Extrapolation:
    """The result of an extrapolation. fixed: fit with the expected or given power; free: fit with a fitted power; None
    if there is none. finest: the limit from the two finest levels with the power of the first of these fits. local: the
    powers between levels. doubts: reasons to doubt the limit. remarks: levels that were left out."""

    axis: str
    quantity: str
    levels: list[Level]
    expected: float | None
    fixed: Fit | None
    free: Fit | None
    finest: float | None
    local: list[float]
    doubts: list[str]
    remarks: list[str]

    @property
    def best(self) -> Fit | None:
        """The fit whose limit is printed first: with a known power, if there is one."""
        return self.fixed or self.free

    @property
    def size_name(self) -> str:
        """The name of the size that decreases from level to level."""
        return "accuracy" if self.axis == ACCURACY else "mesh size h"


def extrapolate(levels: Levels, rows: Sequence[Row], quantity: str, power: float | None = None) -> Extrapolation:
    """The limit of a quantity from the levels that are finished.

    quantity: of refinement.MEASURES; power: a known power, instead of the one expected by the paper. Raises ResultError
    if fewer than two levels are finished.
    """
    measure, remarks = MEASURES[quantity][0], list(levels.remarks)
    found = []
    for row in rows:
        value, scene = row.measured[measure], row.case.scene
        if row.state.complete and value is not None:
            size, residual = levels.size_of(row.case), row.measured["energy_residual [1]"]
            found.append(
                Level(row.case.name, scene.grid.n, scene.adhesion.range, scene.solver.accuracy, size, value, residual)
            )
        else:
            remarks.append(f"{row.case.name} is left out: {row.state}")
    if len(found) < FEWEST:
        raise ResultError(f"{len(found)} levels are finished, an extrapolation takes {FEWEST}; " + "; ".join(remarks))
    sizes, values = [level.size for level in found], [level.value for level in found]
    expected = power if power is not None else expected_power(levels.axis, quantity)
    fixed = fit_power_law(sizes, values, expected) if expected is not None else None
    free = fit_power_law(sizes, values) if len(found) >= LEVELS_TO_FIT_POWER else None
    best = fixed or free
    finest = finest_limit(sizes, values, best.power) if best else None
    wrong = _doubts(found, quantity, expected, fixed, free)
    return Extrapolation(
        levels.axis, quantity, found, expected, fixed, free, finest, local_powers(sizes, values), wrong, remarks
    )


def _doubts(
    found: list[Level], quantity: str, expected: float | None, fixed: Fit | None, free: Fit | None
) -> list[str]:
    best = fixed or free
    if best is None:
        needed = f"{LEVELS_TO_FIT_POWER} levels are needed to fit one; or --power"
        return [f"{len(found)} levels, and no power is known: {needed}"]
    sizes, values = [level.size for level in found], [level.value for level in found]
    finest = min(found, key=lambda level: level.size)
    noise = abs(finest.value) * (finest.residual or 0.0) if quantity == "loop" else 0.0
    texts = doubts(sizes, values, best, noise)
    if free is not None and best is not free and expected is not None:
        texts += [text for text in doubts(sizes, values, free) if text not in texts and "power" in text]
        texts += [text for text in [disagreement(free, expected)] if text]
    return texts


def report(found: Extrapolation) -> list[str]:
    """The levels, the fits and the doubts as lines."""
    _, unit, words = MEASURES[found.quantity]
    factor, unit = handy([level.value for level in found.levels], unit)
    lines = [f"{'level':16} {'n':>6} {'rho [um]':>9} {'h [um]':>8} {'accuracy':>9} {words + ' [' + unit + ']':>24}"]
    for level in found.levels:
        h = "" if found.axis == ACCURACY else f"{level.size * 1e6:.4g}"
        lines.append(
            f"{level.case:16} {level.n:>6} {level.range_m * 1e6:>9.4g} {h:>8} {level.accuracy:>9.3g} "
            f"{level.value / factor:>24.5g}"
        )
    for name, fit in (("power given", found.fixed), ("power fitted", found.free)):
        if fit is not None:
            power = _with_error(fit.power, fit.power_error if fit.free else 0.0)
            limit = _with_error(fit.limit / factor, fit.limit_error / factor)
            lines.append(f"{name}: p = {power} in {found.size_name}, limit {limit} {unit}{_spread(fit, factor)}")
    if found.finest is not None and found.best is not None:
        lines.append(f"two finest levels, p = {found.best.power:.3g}: limit {found.finest / factor:.5g} {unit}")
    known = [f"{power:.3g}" for power in found.local if not math.isnan(power)]
    if known:
        lines.append(f"powers between levels, coarse to fine: {', '.join(known)}")
    lines += [f"note: {text}" for text in found.remarks]
    if found.doubts:
        lines += ["The data do not support the extrapolation as it stands:", *(f"  - {text}" for text in found.doubts)]
    return lines


def _with_error(value: float, error: float) -> str:
    if math.isnan(error):
        return f"{value:.5g} (no error: as many parameters as levels)"
    return f"{value:.5g} ± {error:.2g}" if error else f"{value:.5g}"


def _spread(fit: Fit, factor: float) -> str:
    """The ranges of a limit in addition to its standard error."""
    parts = []
    for name, (low, high) in (("95 %", fit.limit_interval), ("leaving one level out", fit.left_out)):
        if not math.isnan(low):
            parts.append(f"{name}: {low / factor:.5g} to {high / factor:.5g}")
    return f" ({', '.join(parts)})" if parts else ""


def write(out: Path, found: Extrapolation, title: str = "") -> list[Path]:
    """Write converge.json and converge.png; returns their paths. Raises ResultError if that can't be done."""
    record = asdict(found) | {"unit": MEASURES[found.quantity][1], "supported": not found.doubts}
    paths = [out / JSON_FILE, out / PICTURE]
    try:
        text = json.dumps(storage.plain(record), indent=2, ensure_ascii=False, allow_nan=False)
        write_atomically(paths[0], f"{text}\n".encode())
        with drawing():
            write_figure(paths[1], plot_convergence(found, title))
    except OSError as error:
        raise ResultError(f"{out}: {JSON_FILE} and {PICTURE} could not be written: {storage.reason(error)}") from error
    return paths


@picture
def plot_convergence(found: Extrapolation, title: str = "") -> Figure:
    """Left the quantity against h^p with its fit down to h = 0; right differences of successive levels against h."""
    figure = new_figure(8.6, 3.6)
    left, right = figure.subplots(1, 2)
    sizes = np.array([level.size for level in found.levels])
    factor, unit = handy([level.value for level in found.levels], MEASURES[found.quantity][1])
    values = np.array([level.value for level in found.levels]) / factor
    scale, size_unit = (1.0, "") if found.axis == ACCURACY else handy(sizes, "m")
    power = found.best.power if found.best else 1.0
    fits = [(found.fixed, TURQUOISE, "-", "given"), (found.free, RED, DASHES, "fitted")]
    left.plot((sizes / scale) ** power, values, "o", color="0.15", markersize=5, zorder=3)
    fractions = np.linspace(0.0, 1.0, 200)
    for fit, colour, style, word in fits:
        if fit is not None:
            x = (sizes.max() * fractions / scale) ** power
            left.plot(x, fit(fractions) / factor, color=colour, linestyle=style, label=f"p = {fit.power:.3g}, {word}")
            low, high = fit.limit_interval
            # An interval that is larger than the axes is cut off.
            if not math.isnan(low) and high - low < 4.0 * float(np.ptp(values)) * factor:
                error = [[(fit.limit - low) / factor], [(high - fit.limit) / factor]]
                left.errorbar([0.0], [fit.limit / factor], yerr=error, fmt="D", color=colour, markersize=4, capsize=3)
            else:
                left.plot([0.0], [fit.limit / factor], "D", color=colour, markersize=4)
    name = "accuracy" if found.axis == ACCURACY else "h"
    inner = f"{name}/{size_unit}" if size_unit else name
    left.set_xlabel(f"({inner})^{power:.3g}")
    left.set_ylabel(f"{MEASURES[found.quantity][2]} ({unit})")
    if found.best is not None:
        left.legend(loc="best")
    _draw_differences(right, sizes / scale, values, sizes.max() / scale, fits, factor)
    right.set_xlabel(f"{name} of the coarser level" + (f" ({size_unit})" if size_unit else ""))
    right.set_ylabel(f"difference to the next level ({unit})")
    verdict = "" if not found.doubts else "  (not supported: see converge.json)"
    figure.suptitle(f"{literal(title)}{verdict}", fontsize=9.5)
    return figure


def _draw_differences(
    axis: Axes, sizes: np.ndarray, values: np.ndarray, largest: float, fits: list, factor: float
) -> None:
    """Absolute differences of successive levels, log-log, hollow where the quantity falls; and those of the fits."""
    order = np.argsort(sizes)[::-1]
    h, q = sizes[order], values[order]
    steps = np.diff(q)
    for rising, face, word in ((True, "0.15", "rises"), (False, "white", "falls")):
        chosen = (steps > 0.0) == rising
        chosen &= steps != 0.0
        if chosen.any():
            axis.plot(h[:-1][chosen], np.abs(steps[chosen]), "o", color="0.15", markerfacecolor=face, label=word)
    for fit, colour, style, _ in fits:
        if fit is not None and fit.amplitude:
            expected = np.abs(np.diff(fit(h / largest))) / factor
            axis.plot(h[:-1], expected, color=colour, linestyle=style)
    axis.set_xscale("log")
    axis.set_xticks(h[:-1], [f"{size:.3g}" for size in h[:-1]])
    axis.set_xticks([], minor=True)
    if (steps != 0.0).any():
        axis.set_yscale("log")
        axis.legend(loc="best", title="when refined", title_fontsize=8.0)
    axis.grid(color=GREY, alpha=0.25, linewidth=0.5)
