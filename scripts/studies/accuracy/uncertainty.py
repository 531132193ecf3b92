"""How well the uncertainties of `run.json` tell the errors: tack tests at accuracies up to 300 times coarser than one.

    python -m scripts.studies.accuracy.uncertainty            runs what is missing, some minutes, and prints the table
    python -m scripts.studies.accuracy.uncertainty --page     fills it into docs/reference/numbers.md too

Results stay in out/uncertainty. The error of a number is its difference from that of the finest run of its scene.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from mpi4py import MPI

from pgfmd.results import load
from pgfmd.runner import run_scene
from pgfmd.scene import load_scene

from .. import pages

OUT = Path("out/uncertainty")
SPHERE = (
    "punch.pattern=sphere", "punch.curvature_radius=139 um", "punch.radius=75 um", "substrate.boundary=free",
    "grid.length=300 um", "adhesion.range=0.53 um", "grid.n=48", "drive.speed=25 um/s", "drive.preload=0.1 mN",
)  # fmt: skip
TRI = ("grid.n=32", "drive.preload=1 mN")
SCENES = {
    "triangular, 1 µm/s": ("tri-tack", TRI),
    "triangular, 25 µm/s": ("tri-tack", (*TRI, "drive.speed=25 um/s")),
    "triangular, out at 100 µm/s": ("tri-tack", (*TRI, "drive.retract_speed=100 um/s")),
    "triangular, first order": ("tri-tack", (*TRI, "solver.order=1")),
    "triangular, elastic": ("tri-tack", (*TRI, "rheology.model=elastic")),
    "triangular, quasi-static": ("tri-tack", (*TRI, "solver.scheme=quasistatic")),
    "triangular, quasi-static, on a spring": (
        "tri-tack", (*TRI, "solver.scheme=quasistatic", "drive.machine_stiffness=2 kN/m")
    ),
    "hexagonal, 1 µm/s": ("hex-tack", TRI),
    "flat": ("flat-punch", ("grid.n=32",)),
    "sphere, 25 µm/s": ("tri-tack", SPHERE),
    "sphere, quasi-static": ("tri-tack", (*SPHERE, "solver.scheme=quasistatic")),
}  # fmt: skip
COARSE, FINEST = (0.03, 0.01, 0.003), 0.0003
NUMBERS = {
    "pull-off force": ("pull_off_force", "_N"),
    "snap-in force": ("snap_in_force", "_N"),
    "work of separation": ("work_of_separation", "_J"),
    "loop": ("work", "_J"),
}
SHOWN = 0.01
"""The accuracy whose errors are in the table."""


def record(name: str, accuracy: float) -> dict:
    """`run.json` of a scene at an accuracy; runs it where it has not been."""
    source, changes = SCENES[name]
    folder = OUT / f"{name.replace('µ', 'u').replace(', ', '_').replace(' ', '-').replace('/', '-')}_{accuracy:g}"
    if not (folder / "run.json").exists():
        more = (f"solver.accuracy={accuracy}", "output.snapshots=[]", "output.patches=false")
        run_scene(load_scene(source, [*changes, *more]), MPI.COMM_SELF, folder, lambda line: None)
    with load(folder) as results:
        return results.run


def table() -> str:
    """A row a scene: for each number error and uncertainty [%] at SHOWN, and the largest ratio at all accuracies."""
    lines = ["| tack test | " + " | ".join(NUMBERS) + " | error over uncertainty, at most |", "| --- |" + " --- |" * 5]
    for name in SCENES:
        finest, cells, ratios = record(name, FINEST), [], []
        for key, unit in NUMBERS.values():
            for accuracy in COARSE:
                found = record(name, accuracy)
                error, spread = found[key + unit] - finest[key + unit], found[f"{key}_uncertainty{unit}"]
                ratios.append(abs(error) / spread)
                if accuracy == SHOWN:
                    share = 100.0 / finest[key + unit]
                    cells.append(f"{share * error:+.2f} ± {share * spread:.1f}")
        print(name, [f"{ratio:.2f}" for ratio in ratios], flush=True)
        lines.append(f"| {name} | {' | '.join(cells)} | {max(ratios):.2f} |")
    return "\n".join(lines)


def main() -> None:
    """The table, and the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--page", action="store_true")
    text = table()
    print(text)
    if parser.parse_args().page:
        pages.fill(pages.page_named("numbers.md"), "uncertainty", lambda name: text)


if __name__ == "__main__":
    main()
