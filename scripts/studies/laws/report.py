"""Figure and tables of the pull-offs of run.py."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context

from pgfmd.plots.drawing import GREY, LINES, PALETTE, STYLE, new_figure

from ..pages import FIGURES, fill, page_named

if TYPE_CHECKING:
    from .run import PullOff

MARKS = "os^Dv"
PER_TENSION = 1.5
"""JKR's pull-off in pi w R."""


def make(rows: list[PullOff]) -> None:
    """Writes figure and tables."""
    with rc_context(STYLE):
        draw(rows).savefig(FIGURES / "laws.png", dpi=150, metadata={"Software": None})
    tables = {
        "flat": lambda: by_size(rows, "flat"),
        "sphere": lambda: by_size(rows, "sphere"),
        "maugis": lambda: against_maugis(rows),
    }
    fill(page_named("laws.md"), "pull-off", lambda name: tables[name]())


def of(rows: list[PullOff], punch: str, law: str = "") -> list[PullOff]:
    """The rows of a punch, and of a law, from coarse to fine."""
    return sorted((row for row in rows if row.punch == punch and law in ("", row.law)), key=lambda row: row.n)


def laws_of(rows: list[PullOff]) -> list[str]:
    """The laws, in the order of the runs."""
    return list(dict.fromkeys(row.law for row in rows))


def lines(head: tuple[str, ...], rows: list[list[str]]) -> str:
    """A table."""
    return "\n".join("| " + " | ".join(cells) + " |" for cells in [list(head), ["---"] * len(head), *rows])


def by_size(rows: list[PullOff], punch: str) -> str:
    """A line a grid, a column a law."""
    ours, laws = of(rows, punch), laws_of(rows)
    told = []
    for n in sorted({row.n for row in ours}):
        same = {row.law: row for row in ours if row.n == n}
        first = same[laws[0]]
        cells = []
        for law in laws:
            row = same[law]
            if punch == "flat":
                cells.append(f"{row.force / row.closed:.3f}")
            else:
                cells.append(f"{PER_TENSION * row.force / row.closed:.3f} ({PER_TENSION * row.rings / row.closed:.3f})")
        residual = max(row.residual for row in same.values())
        told.append([f"{n}", f"{1e6 * first.length:.2f}", f"{first.tabor:.2f}", *cells, f"{100 * residual:.2g} %"])
    return lines(("n", "length [µm]", "Tabor number", *(f"`{law}`" for law in laws), "largest residual"), told)


def maugis_cases(rows: list[PullOff]) -> dict[tuple[str, float], dict[str, float]]:
    """Relative errors by Tabor number and grid spacing [um], for each width, and without one: they are of first order in the width."""
    found: dict[tuple[str, float], dict[str, float]] = {}
    for row in rows:
        if row.punch.startswith("Maugis"):
            _, mu, width = row.punch.split()
            found.setdefault((mu, 1e6 * row.spacing), {})[width] = row.force / row.closed - 1.0
    found = {key: case for key, case in found.items() if len(case) == 2}
    for case in found.values():
        case["0"] = 2 * case["0.1"] - case["0.2"]
    return found


def against_maugis(rows: list[PullOff]) -> str:
    """A line a Tabor number and grid."""
    told = [
        [
            mu,
            f"{h:.1f}",
            *(f"{100 * case[width]:+.2f} %".replace("-", "\N{MINUS SIGN}") for width in ("0.2", "0.1", "0")),
        ]
        for (mu, h), case in maugis_cases(rows).items()
    ]
    return lines(("Tabor number", "spacing [µm]", "$w = 0.2\\rho$", "$w = 0.1\\rho$", "$w \\to 0$"), told)


def draw(rows: list[PullOff]) -> Any:
    """Flat punch by Tabor number and by cohesive zone; sphere; Dugdale's law against Maugis."""
    figure = new_figure(7.4, 5.8)
    (first, second), (third, fourth) = figure.subplots(2, 2)
    for index, law in enumerate(laws_of(rows)):
        style = {"color": PALETTE[index], "marker": MARKS[index], "ms": 4, "mfc": "white", "label": law}
        ours = of(rows, "flat", law)
        shares = [row.force / row.closed for row in ours]
        first.plot([row.tabor for row in ours], shares, ls=LINES[index], **style)
        second.plot([row.zone for row in ours], shares, ls="none", **style)
        for punch, look in ("rings", {"color": PALETTE[index], "lw": 0.9}), ("sphere", {"ls": "none", **style}):
            ours = sorted(of(rows, punch, law), key=lambda row: row.tabor)
            third.plot([row.tabor for row in ours], [PER_TENSION * row.force / row.closed for row in ours], **look)
    zones = np.geomspace(0.02, 10, 200)
    # All of the punch at its strength: pi a^2 sigma over sqrt(8 pi E* w a^3).
    second.plot(zones, np.sqrt(math.pi / 8 / zones), color=GREY, lw=0.8, label="strength times area")
    second.set(ylim=(0.3, 1.08), xlim=(0.02, 10))
    for axis in (first, second):
        axis.axhline(1.0, color=GREY, lw=0.6)
        axis.set(xscale="log", ylabel="pull-off force over Kendall's")
    third.axhline(PER_TENSION, color=GREY, lw=0.6)
    first.set(xlabel=r"$\sqrt{a\gamma/E^*}$ / length", title="flat punch")
    second.set(xlabel=r"$E^*\gamma/(\sigma_\mathrm{th}^2 a)$", title="flat punch, by the size of a cohesive zone")
    third.set(
        xscale="log",
        xlabel=r"$R^{1/3}(\gamma/E^*)^{2/3}$ / length",
        ylabel=r"pull-off force [$\pi\gamma R$]",
        title="sphere; lines: by rings",
    )
    first.legend(loc="lower right")
    second.legend(loc="lower left")
    cases = maugis_cases(rows)
    for index, mu in enumerate(dict.fromkeys(mu for mu, _ in cases)):
        spacings = [h for other, h in cases if other == mu]
        style = {"color": PALETTE[index], "marker": MARKS[index], "ls": LINES[index], "ms": 4, "mfc": "white"}
        fourth.plot(spacings, [100 * cases[mu, h]["0"] for h in spacings], label=f"Tabor number {mu}", **style)
    fourth.axhspan(-1.0, 1.0, color=GREY, alpha=0.2, lw=0)
    fourth.set(xscale="log", yscale="symlog", xlabel="grid spacing [µm]", ylabel="distance from Maugis [%]")
    fourth.set_title("dugdale without smooth ends")
    ticks(fourth, (3, 5, 10, 20, 40))
    fourth.set_yticks([-1, 0, 1, 10], ["\N{MINUS SIGN}1", "0", "1", "10"])
    fourth.legend()
    ticks(first, (1, 1.5, 2, 3, 4, 5))
    ticks(third, (0.4, 0.6, 0.8, 1.2, 1.6))
    return figure


def ticks(axis: Any, places: tuple[float, ...]) -> None:
    """Ticks of a logarithmic axis, as numbers."""
    axis.minorticks_off()
    axis.set_xticks(places, [f"{place:g}" for place in places])
