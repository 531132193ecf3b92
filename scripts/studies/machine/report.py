"""Numbers, figure and tables of the runs of run.py: a test on the machine against the rigid one, both seen from the machine."""

from __future__ import annotations

import csv
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context

import pgfmd
from pgfmd.plots.drawing import GREY, LINES, PALETTE, STYLE, new_figure
from pgfmd.results.curve import Loop

from ..pages import DOCS, FIGURES, fill

if TYPE_CHECKING:
    from .run import Case

PAGE = DOCS / "evidence" / "machine.md"
GRID = 4001
"""Displacements of the machine at which two retractions are compared."""
BACK = ("turn", "retract")


@dataclass(frozen=True)
class Difference:
    """A test on a machine against the rigid one that is corrected afterwards: what the first has more, in per cent of the
    second, and forces in mN.

    pull_off, rigid_pull_off, uncertainty [mN]: of the two tests, and by how much the difference of them may be off.
    more_...: of the contact area at the preload, the time to it, the work of separation, and the work of the loop [%].
    largest, mean [mN]: difference of the forces at equal displacements of the machine on the way back, and its root mean
    square.
    """

    pattern: str
    speed: int
    n: int
    by_rule: bool
    stiffness: float
    rigid_pull_off: float
    pull_off: float
    uncertainty: float
    more_pull_off: float
    more_area: float
    more_time: float
    more_work_of_separation: float
    more_work: float
    largest: float
    mean: float


def seen_from_the_machine(loop: Loop, stiffness: float) -> tuple[np.ndarray, np.ndarray]:
    """Displacement D = d - F/k_M [m] of the machine on the way back, ascending, and force [N]."""
    back = np.isin(loop.phase, BACK)
    place, force = (loop.displacement - loop.force / stiffness)[back], loop.force[back]
    order = np.argsort(place, kind="stable")
    return place[order], force[order]


def difference_of(case: Case, rigid: Any, sprung: Any) -> Difference:
    """Of the results of a case and those of its rigid one."""
    assert case.stiffness is not None
    loops = Loop.of(rigid), Loop.of(sprung)
    (x, f), (y, g) = (seen_from_the_machine(loop, case.stiffness) for loop in loops)
    places = np.linspace(max(x[0], y[0]), max(x[-1], y[-1]), GRID)
    apart = 1e3 * np.abs(np.interp(places, y, g) - np.interp(places, x, f))

    def more(name: str) -> float:
        return 100 * (sprung.run[name] / rigid.run[name] - 1)

    areas = [loop.areas["contact"][loop.preload_row] for loop in loops]
    pull_offs = [1e3 * one.run["pull_off_force_N"] for one in (rigid, sprung)]
    unsure = 1e3 * np.hypot(*(one.run["pull_off_force_uncertainty_N"] for one in (rigid, sprung)))
    return Difference(
        case.pattern, case.speed, case.n, case.by_rule, case.stiffness, *pull_offs, float(unsure), more("pull_off_force_N"),
        100 * (areas[1] / areas[0] - 1), more("time_to_preload_s"), more("work_of_separation_J"), more("work_J"),
        float(apart.max()), float(np.sqrt(np.mean(apart**2))),
    )  # fmt: skip


def make(folder: Path, cases: list[Case], machine: float, write: bool) -> list[Difference]:
    """Compares all cases whose runs are in the folder; writes figure, numbers and page, or prints the numbers alone."""
    rigid = {(case.pattern, case.speed, case.n, case.by_rule): case for case in cases if case.stiffness is None}
    found = []
    for case in cases:
        if case.stiffness is not None:
            other = rigid[case.pattern, case.speed, case.n, case.by_rule]
            with pgfmd.load(folder / other.name) as one, pgfmd.load(folder / case.name) as two:
                found.append(difference_of(case, one, two))
            print(f"{case.name}: pull-off {found[-1].more_pull_off:+.2f} %", flush=True)
    if write:
        with (FIGURES / "machine.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow([field.name for field in fields(Difference)])
            writer.writerows(
                [f"{value:.5g}" if isinstance(value, float) else value for value in vars(one).values()] for one in found
            )
        with rc_context(STYLE):
            figure = draw(folder, cases, found, machine)
            figure.savefig(FIGURES / "machine.png", dpi=150, metadata={"Software": None})
        tables = {
            "grids": [one for one in found if one.stiffness == machine and not one.by_rule],
            "machines": [one for one in found if one.n == found[0].n],
            "rule": [one for one in found if one.by_rule],
        }
        fill(PAGE, "machine", lambda name: table(tables[name]))
    return found


def table(rows: list[Difference]) -> str:
    """Rows as a table of the page."""
    head = (
        "pattern", "speed [µm/s]", "n", "$k_M$ [kN/m]", "pull-off, rigid [mN]", "more pull-off", "more contact at the preload",
        "more time to the preload", "more work of separation", "more work of the loop", "largest difference of force [mN]",
    )  # fmt: skip
    text = ["| " + " | ".join(head) + " |", "| --- " * len(head) + "|"]
    for one in sorted(rows, key=lambda row: (row.pattern != "tri", row.speed, row.n, row.stiffness)):
        unsure = 100 * one.uncertainty / one.rigid_pull_off
        more = (one.more_area, one.more_time, one.more_work_of_separation, one.more_work)
        cells = [one.pattern, f"{one.speed}", f"{one.n}", f"{one.stiffness / 1e3:g}", f"{one.rigid_pull_off:.2f}"]
        cells += [
            f"{one.more_pull_off:+.1f} ± {unsure:.1f} %",
            *(f"{value:+.1f} %" for value in more),
            f"{one.largest:.2f}",
        ]
        text.append("| " + " | ".join(cells).replace("-", "\N{MINUS SIGN}") + " |")
    return "\n".join(text)


def draw(folder: Path, cases: list[Case], found: list[Difference], machine: float) -> Any:
    """Retractions on the finest grid, seen from the machine, and the difference of the pull-off by machine and grid."""
    figure = new_figure(7.4, 7.6)
    axes = figure.subplots(3, 2)
    kinds = list(dict.fromkeys((one.pattern, one.speed) for one in found))
    finest, ruled = max(one.n for one in found), any(one.by_rule for one in found)
    for axis, kind in zip(axes.flat, kinds, strict=False):
        draw_loops(
            axis,
            folder,
            [case for case in cases if (case.pattern, case.speed, case.n, case.by_rule) == (*kind, finest, ruled)],
            machine,
        )
    axes[0, 0].legend(loc="upper right")
    below = axes[2]
    for index, kind in enumerate(kinds):
        ours = [one for one in found if (one.pattern, one.speed) == kind]
        style = {
            "color": PALETTE[index],
            "ls": LINES[index],
            "marker": "os^D"[index],
            "ms": 4,
            "label": f"{kind[0]}, {kind[1]} µm/s",
        }
        softer = sorted((one for one in ours if one.n == found[0].n), key=lambda one: one.stiffness)
        below[0].plot([one.stiffness / 1e3 for one in softer], [one.more_pull_off for one in softer], **style)
        finer = [one for one in ours if one.stiffness == machine and not one.by_rule]
        below[1].plot([one.n for one in finer], [one.more_pull_off for one in finer], **style)
        ruled = [one for one in ours if one.by_rule]
        below[1].plot(
            [one.n for one in ruled],
            [one.more_pull_off for one in ruled],
            **style | {"label": None, "mfc": "white", "ms": 7},
        )
    below[0].set(
        xscale="log",
        xlabel="stiffness of the machine [kN/m]",
        ylabel="more pull-off force [%]",
        title=f"n = {found[0].n}",
    )
    below[1].set(xscale="log", xlabel="n", title=f"{machine / 1e3:g} kN/m")
    below[1].minorticks_off()
    sizes = sorted({one.n for one in found})
    below[1].set_xticks(sizes, [f"{n}" for n in sizes])
    for axis in below:
        axis.axhline(0.0, color=GREY, lw=0.6)
    below[1].legend(loc="upper left")
    return figure


def draw_loops(axis: Any, folder: Path, cases: list[Case], machine: float) -> None:
    """The ways back of one test: on the machine, rigid and corrected, rigid as it is."""
    deepest = 0.0
    for case in sorted(cases, key=lambda case: case.stiffness or 0.0):
        if case.stiffness not in (None, machine):
            continue
        with pgfmd.load(folder / case.name) as results:
            loop = Loop.of(results)
        if case.stiffness is None:
            plain = seen_from_the_machine(loop, np.inf)
            axis.plot(1e6 * plain[0], 1e3 * plain[1], color=GREY, lw=0.8, label="rigid")
        place, force = seen_from_the_machine(loop, machine)
        style = {"color": PALETTE[0], "lw": 1.4} if case.stiffness else {"color": PALETTE[1], "ls": LINES[1]}
        axis.plot(1e6 * place, 1e3 * force, label="on the machine" if case.stiffness else "rigid, corrected", **style)
        deepest = min(deepest, 1e3 * force.min())
        title = f"{case.pattern}, {case.speed} µm/s, n = {case.n}"
    axis.axhline(0.0, color=GREY, lw=0.6)
    axis.set(ylim=(1.15 * deepest, -2.0 * deepest), title=title)
    axis.set(xlabel="displacement of the machine [µm]", ylabel="force [mN]")
    tensile = place[force < -2.0 * deepest * 1e-3]
    axis.set_xlim(1e6 * tensile[0] - 0.3, 1e6 * place[-1] + 0.3)
