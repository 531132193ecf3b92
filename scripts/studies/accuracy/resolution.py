"""What the grid, the law and the cell make of simple contacts: fills the tables of docs/explanation/resolution.md.

    python -m scripts.studies.accuracy.resolution        # five minutes on one core

Whole runs against closed forms and finer grids, beside the estimates of `pgfmd check` (pgfmd/forecast/resolution.py).
"""

from __future__ import annotations

import math

import numpy as np

from pgfmd.forecast.resolution import image_stiffness, overlap_share, summit_points
from pgfmd.reference import hertz
from tests.physics.runs import CONTACT_MODULUS, run

from ..pages import fill, page_named

LENGTH, SPHERE = 1.5e-3, 0.01
"""Side of the cell and radius of the sphere of the scene "hertz" [m]."""
COARSE, FINE = 32, 128
"""Points a side of the grid that is judged, and of the one it is held against."""
REACHES = (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0)
"""sqrt(2 R rho), within which a sphere is lower than the range, in grid spacings."""
PLACES = ((0.5, 0.5), (0.0, 0.0), (0.25, 0.25), (0.5, 0.0))
"""Where the sphere's axis is, in spacings from a grid point."""
CONTACTS = (
    (32, 1.0, 1.0, 4e-3),
    (32, 0.3, 1.0, 4e-3),
    (32, 1.0, 10.0, 20e-3),
    (64, 1.0, 10.0, 20e-3),
    (64, 5.0, 100.0, 40e-3),
)
"""Grid points a side, range factor, E(infinity)/E(0) and preload [N] of a sphere without attraction."""
FILMS = ((0.495, "bonded"), (0.495, "sliding"), (0.3, "bonded"))
THICKNESSES = (1 / 32, 1 / 8, 1 / 4, 1 / 2, 1.0, 4.0)
"""Thickness of the film, in sides of the cell."""


def rigid_error(reach: float, place: tuple[float, float]) -> float:
    """Relative error of the pull-off force 2 pi R gamma of a sphere on a rigid plane, as a sum over grid points.

    In units of sqrt(2 R rho), rho and gamma, where it is pi.
    """
    index = np.arange(-math.ceil(2 * reach) - 2, math.ceil(2 * reach) + 3)
    x, y = np.meshgrid((index - place[0]) / reach, (index - place[1]) / reach)
    height = x**2 + y**2
    near = height[height - height.min() < 1.0] - height.min()
    gaps = np.linspace(0.0, 1.0, 401)[:, None] + near
    pull = np.where(gaps < 1.0, 0.5 * math.pi * np.sin(math.pi * np.minimum(gaps, 1.0)), 0.0).sum(axis=1)
    return pull.max() / reach**2 / math.pi - 1.0


def elastic_pull_off(n: int, reach: float) -> float:
    """Pull-off force [N] of an elastic sphere whose range is the automatic one of the coarse grid."""
    spacing = LENGTH / COARSE
    rho = 0.5 * (reach * spacing) ** 2 / SPHERE
    gamma = 2.0 * rho**2 * 0.156 * 2.0 * math.pi / spacing * CONTACT_MODULUS / math.pi**2
    found = run(
        "hertz", f"grid.n={n}", "adhesion.law=cosine", f"adhesion.work_of_adhesion={gamma:.9g} J/m^2", "solver.accuracy=0.02",
        f"adhesion.range={rho:.9g} m", f"drive.preload={6.0 * math.pi * SPHERE * gamma:.9g} N",
    )  # fmt: skip
    return -found.state.pull_off_force


def pull_off() -> str:
    lines = [
        "| grid points of the summit | rigid, at worst (%) | elastic, automatic range (%) |",
        "| --- | --- | --- |",
    ]
    for reach in REACHES:
        worst = max((rigid_error(reach, place) for place in PLACES), key=abs)
        error = elastic_pull_off(COARSE, reach) / elastic_pull_off(FINE, reach) - 1.0 if reach > 0.25 else math.nan
        elastic = "" if math.isnan(error) else f"{100 * error:+.0f}"
        lines.append(f"| {math.pi * reach**2:.3g} | {100 * worst:+.0f} | {elastic} |")
    return "\n".join(lines)


def overlap() -> str:
    lines = [
        "| $n$ | `range_factor` | $E(\\infty)/E(0)$ | preload (mN) | grid points below the surface | overlap, estimated (%) "
        "| indentation too large by (%) |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for n, factor, ratio, load in CONTACTS:
        rheology = ["rheology.model=single", f"rheology.modulus_ratio={ratio}", "rheology.relaxation_time=1000 s"]
        found = run(
            "hertz",
            f"grid.n={n}",
            f"adhesion.range_factor={factor}",
            f"drive.preload={load} N",
            *(rheology if ratio > 1 else []),
        )
        exact = float(hertz.indentation(load, SPHERE, ratio * CONTACT_MODULUS))
        error = -found.preload_position / exact - 1.0
        lines.append(
            f"| {n} | {factor:g} | {ratio:g} | {1e3 * load:g} | {summit_points(found.scene):.0f} | "
            f"{100 * overlap_share(found.scene):.1f} | {100 * error:+.1f} |"
        )
    return "\n".join(lines)


def film() -> str:
    lines = ["| film | thickness over cell | stiffness, periodic over free | estimate |", "| --- | --- | --- | --- |"]
    for ratio, base in FILMS:
        for share in THICKNESSES:
            runs = [
                run(
                    "flat-punch", "grid.n=48", "rheology.model=elastic", "adhesion.law=repulsive", "adhesion.range_factor=20",
                    f"substrate.poisson_ratio={ratio}", f"substrate.boundary={boundary}", f"substrate.base={base}",
                    f"substrate.thickness={share * LENGTH:.9g} m", "drive.preload=1 mN", "solver.scheme=quasistatic",
                    "output.snapshots=[]",
                )
                for boundary in ("periodic", "free")
            ]  # fmt: skip
            measured = runs[0].contact_stiffness() / runs[1].contact_stiffness()
            lines.append(
                f"| {base}, $\\nu = {ratio}$ | {share:.3g} | {measured:.2f} | {image_stiffness(runs[0].scene):.2f} |"
            )
    return "\n".join(lines)


def main() -> None:
    tables = {"pull-off": pull_off, "overlap": overlap, "film": film}
    fill(page_named("resolution.md"), "table", lambda name: tables[name]())


if __name__ == "__main__":
    main()
