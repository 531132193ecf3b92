"""Figure and tables of the work-precision study, from the rows of its CSV. Part of run.py."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from matplotlib import rc_context
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from pgfmd.benchmark.curve_errors import cost_at
from pgfmd.plots.drawing import STYLE, new_figure

from ..pages import fill

MEASURES = {
    "force_error": "force curve",
    "pull_off_error": "pull-off force",
    "separation_error": "work of separation",
    "area_error": "contact area",
}
COSTS = {"core_seconds": "core-seconds [s]", "pairs": "transform pairs"}
TARGET = 0.01
GRIDS = ("mesh", "range")
"""Panels whose lines run over grids, not over steps."""
BLUE, SKY, GREEN, RED, ORANGE, PURPLE, GREY, BLACK = (
    "#0072B2", "#56B4E9", "#009E73", "#D55E00", "#E69F00", "#CC79A7", "#8a8a8a", "#000000",
)  # fmt: skip
"""Okabe and Ito's colours, told apart with any colour vision; markers differ, too."""
LOOKS = {
    "inertialess": (BLUE, "o", "-"),
    "inertialess, first order": (SKY, "v", "-"),
    "inertialess, all points": (GREY, "D", "--"),
    "inertialess, mixed precision": (GREEN, "s", "-"),
    "inertialess, single precision": (BLACK, "x", "--"),
    "inertialess, N = 5": (BLUE, "p", ":"),
    "inertialess, N = 20": (SKY, "*", ":"),
    "gfmd, ω dt = π/10": (RED, "o", "-"),
    "gfmd, ω dt = π/2": (ORANGE, "s", "-"),
    "gfmd, ω τ = 2π, dt refined": (PURPLE, "v", "-"),
    "gfmd, dt = τ/20, ω refined": (BLACK, "^", "--"),
    "gfmd, ω dt = π/2, N = 5": (RED, "p", ":"),
    "gfmd, ω dt = π/2, N = 20": (ORANGE, "*", ":"),
    "gfmd, ω τ = 2π": (PURPLE, "v", "-"),
    "gfmd, N = 1": (ORANGE, "s", "-"),
    "gfmd, N = 5": (RED, "p", ":"),
    "gfmd, N = 20": (ORANGE, "*", ":"),
}
APART = "schemes apart"
ORDER = {name: place for place, name in enumerate(LOOKS)}


def in_order(rows: Iterable[dict], panel: str) -> list[dict]:
    """The rows of a panel, line by line and each from few steps to many, however the CSV has come about."""
    mine = (row for row in rows if row["panel"] == panel)
    return sorted(mine, key=lambda row: (ORDER.get(row["line"], len(ORDER)), row["line"], row["steps"]))


def lines_of(rows: Iterable[dict], panel: str) -> dict[str, list[dict]]:
    """The rows of a panel by their lines; without those of how far the schemes are apart."""
    lines: dict[str, list[dict]] = {}
    for row in in_order(rows, panel):
        if not row["line"].startswith(APART):
            lines.setdefault(row["line"], []).append(row)
    return lines


def apart(rows: Iterable[dict], panel: str, line: str) -> dict | None:
    """The row that tells how far the schemes are from each other."""
    return next((row for row in rows if row["panel"] == panel and row["line"] == line), None)


# The figure ----------------------------------------------------------------------------------------------------------
def draw(rows: Sequence[dict], path: Path) -> None:
    """One figure: errors against both costs, above the four kinds of error by themselves."""
    with rc_context({**STYLE, "lines.markersize": 4.0, "lines.linewidth": 1.1}):
        figure = new_figure(7.6, 14.5)
        axes = figure.subplots(6, 2)
        for i, (measure, name) in enumerate(MEASURES.items()):
            for j, (cost, label) in enumerate(COSTS.items()):
                floor = apart(rows, "cost", f"{APART}, N = 1")
                _panel(axes[i, j], lines_of(rows, "cost"), cost, measure, floor and floor[measure])
                axes[i, j].set_title(name, loc="left")
                axes[i, j].set(xlabel=label, ylabel="error [%]")
                axes[i, j].axhline(100 * TARGET, color=GREY, linewidth=0.7)
        _kinds(axes[4:].ravel(), rows)
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path)


def _kinds(axes, rows: Sequence[dict]) -> None:
    """The four panels of one kind of error each."""
    time, inertia, mesh, reach = axes
    floor = apart(rows, "time", APART)
    _panel(time, lines_of(rows, "time"), "steps", "force_error", floor and floor["force_error"], "lower left")
    time.set_title("error of time: force curve", loc="left")
    time.set(xlabel="steps", ylabel="error [%]")
    _panel(inertia, lines_of(rows, "inertia"), "x", "force_error", legend="upper right")
    inertia.set_title("error of inertia: force curve", loc="left")
    inertia.set(xlabel="ω τ / 2π   (the paper: 1)", ylabel="error [%]")
    names = {"mesh": ("points a side, n", "error of the mesh"), "range": ("range ρ [µm]", "distance to the finest")}
    looks = zip(MEASURES.items(), ((BLUE, "o"), (RED, "s"), (GREEN, "^"), (BLACK, "x")), strict=True)
    for (measure, name), (colour, marker) in looks:
        for axis, panel in ((mesh, "mesh"), (reach, "range")):
            for points in lines_of(rows, panel).values():
                points.sort(key=lambda row: row["x"])
                _line(axis, points, "x", measure, name, (colour, marker, "-"))
    for axis, panel in ((mesh, "mesh"), (reach, "range")):
        line = next(iter(lines_of(rows, panel)), "")
        axis.set_title(f"{names[panel][1]}, {line}", loc="left")
        axis.set(xlabel=names[panel][0], ylabel="error [%]")
        if axis.lines:
            axis.legend(fontsize=7)
        _logarithmic(axis)
    for axis, panel in ((mesh, "mesh"), (reach, "range")):
        ticks = sorted({row["x"] for points in lines_of(rows, panel).values() for row in points})
        axis.set_xticks(ticks, [f"{tick:.3g}" for tick in ticks])
        axis.set_xticks([], minor=True)


def _panel(axis, lines: dict, cost: str, measure: str, floor: float | None = None, legend: str = "") -> None:
    for name, points in lines.items():
        _line(axis, points, cost, measure, name, LOOKS.get(name, (GREY, ".", "-")))
    if floor:
        axis.axhline(100 * floor, color=GREY, linewidth=0.9, linestyle=(0, (2, 2)), label="references apart")
    _logarithmic(axis)
    if legend and axis.lines:
        axis.legend(fontsize=7, loc=legend)


def _line(axis, points: list[dict], cost: str, measure: str, name: str, look: tuple[str, str, str]) -> None:
    colour, marker, style = look
    shown = [(row[cost], 100 * row[measure]) for row in points if row[measure] > 0.0]
    if shown:
        axis.plot(*zip(*shown, strict=True), color=colour, marker=marker, linestyle=style, label=name, fillstyle="none")


def _logarithmic(axis) -> None:
    """Both axes logarithmic, with plain numbers; where there is hardly a decade, 2 and 5 have one, too."""
    axis.set(xscale="log", yscale="log")
    axis.grid(visible=True, which="major", color="#e4e4e4", linewidth=0.6)
    for side in (axis.xaxis, axis.yaxis):
        low, high = side.get_view_interval()
        side.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.12g}" if value < 1e4 else _power(value)))
        side.set_minor_formatter(NullFormatter())
        if high < 50.0 * low:
            side.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))


def _power(value: float) -> str:
    exponent = math.floor(math.log10(value) + 1e-9)
    factor = value / 10.0**exponent
    return rf"$10^{{{exponent}}}$" if abs(factor - 1.0) < 1e-6 else rf"${factor:.0f}\cdot10^{{{exponent}}}$"


# The tables ----------------------------------------------------------------------------------------------------------
def fill_page(rows: Sequence[dict], path: Path) -> None:
    """Writes the tables into a Markdown page. ValueError for a mark that is none of the tables."""
    made = {"claims": claims(rows)}
    for panel in ("cost", "time", "inertia", "mesh", "range"):
        made[panel] = error_table(rows, panel)

    def table(name: str) -> str:
        if name not in made:
            raise ValueError(f"{path}: no table {name}; there are {', '.join(made)}")
        return made[name]

    fill(path, "table", table)


def markdown(head: Sequence[str], body: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *body]
    return "".join(f"| {' | '.join(cells)} |\n" for cells in lines)


def error_table(rows: Sequence[dict], panel: str) -> str:
    """All rows of a panel."""
    head = ("line", "setting", *(f"{name} [%]" for name in MEASURES.values()), "pairs", "steps", "core-seconds")
    body = []
    for row in sorted(in_order(rows, panel), key=lambda row: row["x"]) if panel in GRIDS else in_order(rows, panel):
        errors = [f"{100 * row[measure]:.2g}" for measure in MEASURES]
        costs = [f"{row['pairs']:.0f}", f"{row['steps']:.0f}", f"{row['core_seconds']:.3g}"]
        body.append([row["line"], row["label"], *errors, *("" if row["line"].startswith(APART) else c for c in costs)])
    return markdown(head, body)


def claims(rows: Sequence[dict]) -> str:
    """The numbers that the study is about."""
    body = [*_equal_error(rows), *_sufficient(rows), *_elements(rows), *_agreement(rows)]
    return markdown(("what", "measured", "settings"), body)


def _equal_error(rows: Sequence[dict]) -> list[list[str]]:
    """inertialess against gfmd at an error of TARGET."""
    lines, body = lines_of(rows, "cost"), []
    for measure, name in MEASURES.items():
        ours = lines.get("inertialess", [])
        for other in ("gfmd, ω dt = π/10", "gfmd, ω dt = π/2"):
            ratios = []
            for cost in COSTS:
                theirs, mine = (_cost(points, measure, cost) for points in (lines.get(other, []), ours))
                if not (math.isfinite(theirs) and math.isfinite(mine)):
                    ratios.append("not reached")
                else:
                    shown = "{:,.0f} of {:,.0f}" if cost == "pairs" else "{:.3g} of {:.3g} s"
                    ratios.append(f"1/{theirs / mine:.4g} ({shown.format(mine, theirs)})")
            body.append(
                [f"inertialess / {other}, at 1 % in the {name}", f"core-seconds {ratios[0]}, pairs {ratios[1]}",
                 "tri-tack, n = 128, 10 µm/s, 1 rank"]
            )  # fmt: skip
    return body


def _cost(points: list[dict], measure: str, cost: str) -> float:
    return cost_at(TARGET, [row[measure] for row in points], [row[cost] for row in points])


def _sufficient(rows: Sequence[dict]) -> list[list[str]]:
    """Errors of the paper's setting."""
    return [
        ["gfmd at ω τ = 2π, the paper's \"sufficient\"", _errors(row), scene]
        for panel, line, scene in (
            ("cost", "gfmd, ω dt = π/10", "n = 128, 10 µm/s, dt = τ/20"),
            ("inertia", "gfmd, N = 1", "n = 64, 200 µm/s, dt = τ/4"),
            ("inertia", "gfmd, N = 5", "the same, N = 5"), ("inertia", "gfmd, N = 20", "the same, N = 20"),
        )
        for row in lines_of(rows, panel).get(line, [])
        if row["x"] == 1.0
    ]  # fmt: skip


def _errors(row: dict) -> str:
    return ", ".join(f"{name} {100 * row[measure]:.2g} %" for measure, name in MEASURES.items())


def _elements(rows: Sequence[dict]) -> list[list[str]]:
    """What elements cost."""
    spent = {(row["line"], row["label"]): row for row in rows if row["panel"] in ("elements", "gfmd-elements")}
    body = []
    for (line, label), row in spent.items():
        base = spent.get(("gfmd, N = 0" if line.startswith("gfmd") else "N = 1", label))
        if base and base is not row:
            settings = label if line.startswith("gfmd") else (
                f"{label}, {row['steps']:.0f} equal steps, {row['pairs']:.0f} and {base['pairs']:.0f} pairs"
            )  # fmt: skip
            ratio = row["core_seconds"] / base["core_seconds"]
            body.append([f"{line} over {base['line'].removeprefix('gfmd, ')}", f"{ratio:.2f}", settings])
    return body


def _agreement(rows: Sequence[dict]) -> list[list[str]]:
    """How far the schemes are from each other in the limit."""
    return [
        [
            "inertialess at accuracy 1e-6 against gfmd, extrapolated",
            _errors(row),
            f"panel {row['panel']}: {row['label']}{row['line'].removeprefix(APART)}",
        ]
        for row in rows
        if row["line"].startswith(APART)
    ]
