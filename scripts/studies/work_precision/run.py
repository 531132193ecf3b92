"""The work-precision study: what an error costs with either scheme, and how large each kind of error is.

    python -m scripts.studies.work_precision.run            all panels: 20 to 25 minutes of one core
    python -m scripts.studies.work_precision.run time mesh  some panels
    python -m scripts.studies.work_precision.run --quick --csv out.csv --figure out.png     small: a minute or two

Writes docs/figures/work_precision.csv and .png, and the tables of docs/evidence/work_precision.md.

Points that are in the CSV already are not measured again; delete it, or lines of it, to have them measured anew.

Panels:
cost      all four errors against core-seconds and transform pairs, on the scene of the claim. Reference: inertialess
          with a far smaller accuracy; how far it is from gfmd, extrapolated to infinite omega, is a line of its own.
time      the error of the steps alone. inertialess against gfmd, extrapolated to infinite omega; gfmd with a fixed
          omega against itself with a far shorter step.
inertia   the error of the auxiliary mass and damping: gfmd over omega against inertialess.
mesh      n refined at a fixed range of adhesion, against the finest.
range     the range of adhesion as short as each n can carry, against the shortest.
elements  equal steps with 1 and 20 Maxwell elements; gfmd-elements: a step of gfmd with 0, 1 and 5.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path

from pgfmd.benchmark.curve_errors import richardson
from pgfmd.benchmark.work_precision import Laboratory, Row, Setting, explicit, implicit, row_of, study
from pgfmd.host import launch
from pgfmd.results.curve import Loop
from pgfmd.scene import load_scene

from ..pages import FIGURES, page_named
from .elements import gfmd_steps, replayed
from .report import draw, fill_page

SCENE = "tri-tack"
TIGHT = "solver.accuracy=1e-6"
MOST_STEPS = 250
"""Of the runs that compare 1 and 20 elements."""
PAPER, LONG = 0.1, 0.5
"""omega dt, in units of pi: the paper's, and one close to the limit of stability."""


def spectrum(elements: int) -> tuple[str, ...]:
    """Overrides for 1, 5 or 20 elements, the shortest of 400 us; 5 and 20 reach up to 0.518 s alike."""
    if elements == 1:
        return ()
    ratio = 1296.0 ** (1.0 / (elements - 1))
    return (
        "rheology.model=geometric", f"rheology.elements={elements}", f"rheology.time_ratio={ratio!r}",
        "rheology.exponent=0.8", "rheology.relaxation_time=400 us",
    )  # fmt: skip


@dataclass(frozen=True)
class Size:
    """How large the study is: scenes, and multiples of pi for omega tau_min (`top`: of the extrapolation)."""

    claim: tuple[str, ...] = ("grid.n=128", "drive.speed=10 um/s")
    fast: tuple[str, ...] = ("grid.n=64", "drive.speed=200 um/s", "solver.gfmd.fast_pull=1")
    slower: str = "drive.speed=10 um/s"
    accuracies: tuple[float, ...] = (0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5)
    first_order: tuple[float, ...] = (0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4)
    paper: tuple[float, ...] = (2, 4, 8, 16)
    long: tuple[float, ...] = (2, 4, 8, 16, 32)
    apart: tuple[float, ...] = (1, 2, 4, 8)
    steps_per_tau: tuple[float, ...] = (4, 10, 20, 40)
    top: float = 256
    finest_step: float = 512
    mesh: tuple[int, ...] = (64, 96, 128, 192, 256, 384, 512)
    range: tuple[int, ...] = (64, 128, 256, 512, 1024)
    elements: int = 1024
    gfmd_elements: int = 2048
    rounds: int = 2


QUICK = Size(
    claim=("grid.n=48", "drive.speed=200 um/s", "solver.gfmd.fast_pull=1"),
    fast=("grid.n=32", "drive.speed=400 um/s", "solver.gfmd.fast_pull=1"),
    slower="drive.speed=200 um/s", accuracies=(0.1, 0.01, 1e-3), first_order=(0.1, 0.01), paper=(2, 4), long=(2, 4, 8),
    apart=(2, 4), steps_per_tau=(4, 10, 20), top=32, finest_step=64, mesh=(48, 64, 96, 128), range=(32, 64, 128),
    elements=128, gfmd_elements=128,
)  # fmt: skip


class Study:
    """The panels. Each yields the rows that `known`, the (line, label) pairs already there, doesn't hold."""

    def __init__(self, comm, size: Size, say: Callable[[str], None]):
        self.laboratory, self.size, self.say = Laboratory(comm), size, say

    def _curve(self, *overrides: str) -> Loop:
        return self.laboratory.outcome(SCENE, overrides).curve

    def _measured(self, base, settings, reference: Callable[[], Loop], known) -> Iterator[Row]:
        """The settings that are not known yet, against a reference that is only made if there are any."""
        missing = [setting for setting in settings if (setting.line, setting.label) not in known]
        if missing:
            yield from study(self.laboratory, SCENE, base, missing, reference(), self.say)

    def _massless(self, base: tuple[str, ...], top: float) -> Loop:
        """gfmd, extrapolated from top/2 and top, in units of pi, to infinite omega tau_min."""
        coarse, fine = (self._curve(*base, *setting.overrides) for setting in explicit("", [top / 2, top], [LONG]))
        return richardson(coarse, fine, 2.0)

    def _check(self, base: tuple[str, ...], top: float, line: str, known) -> Iterator[Row]:
        """A row of how far the two schemes are from each other: gfmd, extrapolated, against inertialess."""
        setting = Setting(line, f"omega tau {top / 2:g} and {top:g} pi, extrapolated", top / 2.0, ())
        if (setting.line, setting.label) in known:
            return
        outcome = self.laboratory.outcome(SCENE, (*base, TIGHT))
        yield row_of(setting, outcome, self._massless(base, top))

    def cost(self, known) -> Iterator[Row]:
        """All errors against cost; see the head of this script."""
        size, base = self.size, self.size.claim
        lines = [
            *implicit("inertialess", size.accuracies),
            *implicit("inertialess, first order", size.first_order, "solver.order=1"),
            # The defaults of version 0.1.
            *implicit("inertialess, all points", size.accuracies, "solver.symmetry=none", "solver.precision=double"),
            *implicit("inertialess, mixed precision", size.accuracies, "solver.precision=mixed"),
            *implicit("inertialess, single precision", size.accuracies, "solver.precision=single"),
            *explicit("gfmd, ω dt = π/10", size.paper, [PAPER]),
            *explicit("gfmd, ω dt = π/2", size.long, [LONG]),
            *explicit("gfmd, ω τ = 2π, dt refined", [2], [2 / steps for steps in size.steps_per_tau]),
            *explicit("gfmd, dt = τ/20, ω refined", size.apart, [omega / 20 for omega in size.apart]),
        ]
        yield from self._measured(base, lines, lambda: self._curve(*base, TIGHT), known)
        yield from self._check(base, size.long[-1], "schemes apart, N = 1", known)
        for elements in (5, 20):
            more = (*base, *spectrum(elements))
            lines = [
                *implicit(f"inertialess, N = {elements}", size.accuracies),
                *explicit(f"gfmd, ω dt = π/2, N = {elements}", size.long[:-1], [LONG]),
            ]
            yield from self._measured(more, lines, lambda more=more: self._curve(*more, TIGHT), known)
            yield from self._check(more, size.long[-2], f"schemes apart, N = {elements}", known)

    def time(self, known) -> Iterator[Row]:
        """Errors of the steps alone."""
        size, base = self.size, self.size.fast
        lines = [
            *implicit("inertialess", size.accuracies),
            *implicit("inertialess, first order", size.first_order, "solver.order=1"),
            *implicit("inertialess, single precision", size.accuracies, "solver.precision=single"),
        ]
        yield from self._measured(base, lines, lambda: self._massless(base, size.top), known)
        yield from self._check(base, size.top, "schemes apart", known)
        steps = [4.0]
        while steps[-1] < size.finest_step / 8:
            steps.append(2.0 * steps[-1])
        lines = explicit("gfmd, ω τ = 2π", [2], [2 / count for count in steps])
        finest = explicit("", [2], [2 / size.finest_step])[0].overrides
        yield from self._measured(base, lines, lambda: self._curve(*base, *finest), known)

    def inertia(self, known) -> Iterator[Row]:
        """Error of the auxiliary inertia, over omega tau_min."""
        size = self.size
        omegas = [2.0**k for k in range(int(math.log2(size.top)))]
        for elements in (1, 5, 20):
            base = (*size.fast, *spectrum(elements))
            lines = explicit(f"gfmd, N = {elements}", omegas, [LONG])
            yield from self._measured(base, lines, lambda base=base: self._curve(*base, TIGHT), known)

    def mesh(self, known) -> Iterator[Row]:
        """n refined at the range of adhesion that is automatic at n = 128, or the third of the grids."""
        *grids, finest = self.size.mesh
        reach = load_scene(SCENE, [f"grid.n={min(128, grids[2])}"]).adhesion.range
        base = (self.size.slower, "solver.accuracy=1e-3", f"adhesion.range={1e6 * reach!r} um")
        lines = [Setting(f"ρ = {1e6 * reach:.3g} µm", f"n = {n}", n, (f"grid.n={n}",)) for n in grids]
        yield from self._measured(base, lines, lambda: self._curve(*base, f"grid.n={finest}"), known)

    def range(self, known) -> Iterator[Row]:
        """The automatic range of each grid, against the shortest.

        A limit of no range was extrapolated and given up: quantities don't go with a power of rho yet.
        """
        *grids, finest = self.size.range
        base = (self.size.slower, "solver.accuracy=1e-3", "drive.clearance=2.5 um")
        reach = {n: 1e6 * load_scene(SCENE, [f"grid.n={n}"]).adhesion.range for n in grids}
        lines = [Setting("ρ automatic", f"n = {n}, ρ = {reach[n]:.3g} µm", reach[n], (f"grid.n={n}",)) for n in grids]
        yield from self._measured(base, lines, lambda: self._curve(*base, f"grid.n={finest}"), known)

    def elements(self, known) -> Iterator[Row]:
        """Equal steps with 1 and 20 elements."""
        n, rounds = self.size.elements, self.size.rounds
        for speed in ("10 um/s", "1 um/s"):
            if not any(f"n = {n}, {speed}" in label for _, label in known):
                yield from replayed(self.laboratory.comm, n, speed, MOST_STEPS, rounds, self.say)

    def gfmd_elements(self, known) -> Iterator[Row]:
        """A step of gfmd with 0, 1 and 5 elements."""
        if not any(f"n = {self.size.gfmd_elements}" in label for _, label in known):
            yield from gfmd_steps(self.laboratory.comm, self.size.gfmd_elements, 6 * self.size.rounds)


PANELS = ("cost", "time", "inertia", "mesh", "range", "elements", "gfmd-elements")


class Table:
    """The CSV of all rows, each behind the name of its panel; read once, and written line by line by rank 0."""

    columns = ("panel", *(field.name for field in fields(Row)))

    def __init__(self, path: Path, writes: bool):
        self.path, self.writes, self.rows = path, writes, []
        if path.exists():
            with open(path, newline="", encoding="utf-8") as file:
                self.rows = [_typed(row) for row in csv.DictReader(file)]
        elif writes:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(",".join(self.columns) + "\n", encoding="utf-8")

    def known(self, panel: str) -> set[tuple[str, str]]:
        """(line, label) of the panel's rows."""
        return {(row["line"], row["label"]) for row in self.rows if row["panel"] == panel}

    def add(self, panel: str, row: Row) -> dict:
        """Appends a row; returns it as a mapping."""
        values = {"panel": panel, **asdict(row)}
        self.rows.append(values)
        if self.writes:
            with open(self.path, "a", newline="", encoding="utf-8") as file:
                short = {name: f"{v:.6g}" if isinstance(v, float) else v for name, v in values.items()}
                csv.DictWriter(file, self.columns).writerow(short)
        return values


def _typed(row: dict[str, str]) -> dict:
    texts = ("panel", "line", "label")
    return {name: value if name in texts else float(value) for name, value in row.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("panels", nargs="*", metavar="PANEL", help=f"of {', '.join(PANELS)} (default: all)")
    parser.add_argument("--quick", action="store_true", help="small scenes and few settings")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="table of all rows; continued if it exists")
    parser.add_argument("--figure", type=Path, metavar="FILE")
    parser.add_argument("--page", type=Path, metavar="FILE", help="Markdown page whose tables are filled in")
    options = parser.parse_args()
    unknown = set(options.panels) - set(PANELS)
    if unknown:
        parser.error(f"no panel {', '.join(sorted(unknown))}; there are {', '.join(PANELS)}")
    if options.quick and not options.csv:
        parser.error("--quick needs a --csv of its own")
    comm = launch.world()
    with launch.guarded(comm):
        measure(comm, options)


def measure(comm, options: argparse.Namespace) -> None:
    """Runs the panels, then makes figure and tables of all rows that there are. Collective."""
    first = comm.rank == 0
    say = partial(print, flush=True) if first else lambda line: None
    path = options.csv or FIGURES / "work_precision.csv"
    table = launch.on_first(comm, lambda: Table(path, True))
    table.writes = first
    panels = Study(comm, QUICK if options.quick else Size(), say)
    for name in options.panels or PANELS:
        for row in getattr(panels, name.replace("-", "_"))(table.known(name)):
            table.add(name, row)
            say(
                f"{name:8s} {row.line:34s} {row.label:40s} force {100 * row.force_error:9.4f} %  {row.pairs:8d} pairs  "
                f"{row.core_seconds:9.3f} core-s"
            )
    if not first:
        return
    figure = options.figure or (None if options.quick else FIGURES / "work_precision.png")
    page = options.page or (None if options.quick else page_named("work_precision.md"))
    if figure:
        draw(table.rows, figure)
        say(f"{figure} drawn")
    if page:
        fill_page(table.rows, page)
        say(f"{page}: tables filled in")


if __name__ == "__main__":
    main()
