"""The paper's tack tests on its machine, a spring of 38.1 kN/m, against tests on a rigid machine that are corrected
afterwards by d_machine = d - F/k_M. Makes docs/figures/machine.png, machine.csv and the tables of docs/evidence/machine.md.

    python -m scripts.studies.machine.run                    everything; ten minutes on one core
    python -m scripts.studies.machine.run --n 256            runs of one grid only, nothing is drawn
    python -m scripts.studies.machine.run --quick            n = 64, into out/machine-quick; a minute
    python -m scripts.studies.machine.run --draw-only        figure and tables from the runs that are there

Runs stay in out/machine; what is finished is not run again.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import pgfmd

from ..pages import ROOT
from . import report

MACHINE = 38.1e3
"""The stiffness of the paper's machine [N/m] ("Experimental methods")."""
PATTERNS = {"tri": "tri-tack", "hex": "hex-tack"}
BY_RULE = {"tri": "1 ms", "hex": "0.5 ms"}
"""Relaxation times on the finest grid by the paper's rule: 2.5 times as long as at n = 2048, for a range that is sqrt(2) times
as large. The other runs have those of n = 2048, whatever the grid."""
SPEEDS = (1, 25)
"""[um/s], those that the paper has for both patterns."""
SIZES = (256, 512, 1024)
SOFTER = (3e3, 10e3, 100e3)
"""Other machines [N/m], on the first grid."""


@dataclass(frozen=True)
class Case:
    """One run: pattern, speed [um/s], grid points a side, stiffness of the machine [N/m], None if it is rigid, and whether
    the relaxation time is that of the paper's rule."""

    pattern: str
    speed: int
    n: int
    stiffness: float | None = None
    by_rule: bool = False

    @property
    def name(self) -> str:
        """Of its folder."""
        machine = f"{1e-3 * self.stiffness:g}kNm" if self.stiffness else "rigid"
        return f"{self.pattern}_{self.speed}ums_{self.n}_{machine}" + "_rule" * self.by_rule

    @property
    def scene(self) -> pgfmd.Scene:
        """The shipped scene with its changes. Differences are small: so is the accuracy."""
        drive: dict = {"speed": f"{self.speed} um/s"}
        if self.stiffness:
            drive["machine_stiffness"] = f"{self.stiffness:g} N/m"
        scene = pgfmd.Scene(PATTERNS[self.pattern], drive=drive, grid={"n": self.n}, solver={"accuracy": 1e-3})
        return scene.replace(rheology={"relaxation_time": BY_RULE[self.pattern]}) if self.by_rule else scene


def cases(sizes: tuple[int, ...]) -> list[Case]:
    """All runs: rigid and on the paper's machine on each grid, on the last by the rule as well; on other machines on the
    first."""
    found = []
    for n in sizes:
        for by_rule in (False, True) if n > sizes[0] and n == sizes[-1] else (False,):
            machines = (None, MACHINE, *(SOFTER if n == sizes[0] else ()))
            found += [Case(*kind, n, machine, by_rule) for kind in product(PATTERNS, SPEEDS) for machine in machines]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--n", type=int, action="append", help="make the runs of this grid only, and draw nothing")
    parser.add_argument("--quick", action="store_true", help="a small grid; leaves docs alone")
    parser.add_argument("--draw-only", action="store_true", help="run nothing")
    options = parser.parse_args()
    sizes = (64,) if options.quick else SIZES
    folder: Path = ROOT / "out" / ("machine-quick" if options.quick else "machine")
    for case in cases(sizes):
        if not options.draw_only and (options.n is None or case.n in options.n):
            print(f"# {case.name}", flush=True)
            pgfmd.run(case.scene, folder / case.name, say=lambda line: None).close()
    if options.n is None:
        report.make(folder, cases(sizes), MACHINE, write=not options.quick)


if __name__ == "__main__":
    main()
