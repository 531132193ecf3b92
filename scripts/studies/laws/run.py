"""Pull-off by a dead load under all laws of adhesion, of a flat punch and of a sphere, as their range falls: Kendall, JKR,
Maugis. Makes docs/figures/laws.png, laws.csv and the tables of docs/evidence/laws.md.

    python -m scripts.studies.laws.run            everything; a quarter of an hour on one core
    python -m scripts.studies.laws.run maugis     a part of it: flat, sphere, maugis
    python -m scripts.studies.laws.run --quick    small grids, a minute; only prints
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass, fields
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

import pgfmd
from pgfmd.physics.adhesion.base import CohesiveLaw
from pgfmd.physics.adhesion.registry import law_of
from pgfmd.reference import flat_punch, jkr, maugis, tabor
from pgfmd.reference.cohesive_sphere import CohesiveSphere

from ..pages import FIGURES
from . import report

MODULUS, WORK = 2e6 / (1 - 0.495**2), 0.05
"""E* [Pa] and work of adhesion [J/m^2] of the shipped scenes."""
RADIUS, SPHERE = 375e-6, 10e-3
"""Of the flat punch, and of curvature of the sphere [m]."""
KENDALL = -flat_punch.pull_off_force(RADIUS, MODULUS, WORK)
JKR = -jkr.load_controlled_pull_off(SPHERE, MODULUS, WORK).force
LAWS: dict[str, dict[str, Any]] = {
    "cosine": {}, "dugdale": {}, "exponential": {}, "lennard-jones": {},
    "table": {"file": str(Path(__file__).with_name("law.txt")), "work_of_adhesion": "50 mJ/m^2", "range": "auto"},
}  # fmt: skip
FLAT_SIZES = (32, 64, 128, 256, 512)
SPHERE_SIZES = {138: 1.35e-3, 276: 1.35e-3, 368: 0.9e-3}
"""Grid points a side, with the radius [m] of an outline beyond which no law reaches; the cell is four times as wide."""
RING_FACTORS = (0.04, 0.08, 0.16, 0.32, 0.64)
"""Range factors on the first of these grids at which the sphere is solved by rings alone."""
MAUGIS = {0.1: (0.9e-3, (92, 184, 368)), 0.3: (0.6e-3, (123, 245, 368)), 1.0: (0.45e-3, (184, 368, 552))}
"""Tabor numbers for Maugis's sphere, with the outline [m] that its range needs and grids ..."""
WIDTHS = (0.2, 0.1)
"""... and the widths of the smooth ends of Dugdale's law, in ranges: the error is of first order in them."""


@dataclass(frozen=True)
class PullOff:
    """One pull-off by a dead load. punch: "flat" or "sphere"; n: grid points a side, spacing [m] apart; length [m] over which the traction of
    the law comes and goes, and its strength [Pa]; force [N]; closed [N]: the closed form, of Kendall, JKR or Maugis; rings
    [N]: the same law on a sphere without a grid; residual of the audit, relative to the work of the loop."""

    punch: str
    law: str
    n: int
    spacing: float
    length: float
    strength: float
    force: float
    closed: float
    rings: float
    residual: float

    @property
    def tabor(self) -> float:
        """By the length."""
        if self.punch == "flat":
            return tabor.flat_punch(RADIUS, MODULUS, WORK, self.length)
        return tabor.asperity(SPHERE, MODULUS, WORK, self.length)

    @property
    def zone(self) -> float:
        """Length of the cohesive zone of a crack, E* w/strength^2 without a factor, over the radius of the flat punch, or
        that of JKR's sphere at its pull-off."""
        radius = RADIUS if self.punch == "flat" else jkr.load_controlled_pull_off(SPHERE, MODULUS, WORK).contact_radius
        return MODULUS * WORK / self.strength**2 / radius


def pulled_off(scene: pgfmd.Scene, punch: str, closed: float, with_rings: bool = False) -> PullOff:
    """Runs a scene and finds its pull-off."""
    found, law = pgfmd.simulate(scene), law_of(scene.adhesion)
    residual, work = (np.asarray(found.energy[f"{name} [J]"]) for name in ("residual", "work"))
    numbers = (
        scene.grid.n,
        scene.grid.length / scene.grid.n,
        law.length,
        law.strength,
        float(found.run["pull_off_force_N"]),
        closed,
    )
    rings = by_rings(law) if with_rings else math.nan
    return PullOff(punch, scene.adhesion.law, *numbers, rings, float(np.abs(residual).max() / work[-1]))


def flat(law: str, n: int, **solver: Any) -> pgfmd.Scene:
    """The flat punch under a dead load, with the automatic range."""
    adhesion = {"law": law, **LAWS[law]}
    return pgfmd.Scene(
        "flat-punch",
        grid={"n": n},
        adhesion=adhesion,
        drive={"control": "load"},
        solver={"scheme": "quasistatic", **solver},
    )


def sphere(n: int, adhesion: dict[str, Any], outline: float | None = None) -> pgfmd.Scene:
    """A sphere under a dead load."""
    outline = outline or SPHERE_SIZES[n]
    return pgfmd.Scene(
        "hertz", punch={"radius": f"{outline} m"}, grid={"n": n, "length": f"{4 * outline} m"}, adhesion=adhesion,
        drive={"control": "load", "preload": "0.2 mN"}, solver={"scheme": "quasistatic"},
    )  # fmt: skip


def by_rings(law: CohesiveLaw, largest_radius: float = 230e-6, rings: int = 300) -> float:
    """The largest tension [N] of the sphere under a law, by rings: the contact shrinks from ring to ring."""
    outer = 1.25 * math.sqrt(largest_radius**2 + 2.4 * SPHERE * law.reach)
    body = CohesiveSphere(SPHERE, MODULUS, law, np.linspace(0.0, outer, rings + 1))
    found, least = None, 0.0
    for ring in range(body.ring_at(largest_radius), 2, -1):
        found = body.at_ring(ring, law.contact_gap, found)
        if least < 0.0 and found.force > 0.99 * least:
            break
        least = min(least, found.force)
    return -least


def dugdale(mu: float, width: float, n: int) -> tuple[pgfmd.Scene, float]:
    """The sphere under Dugdale's law at a Tabor number, with smooth ends of a width [ranges], and Maugis's pull-off [N]."""
    reach = SPHERE ** (1 / 3) * (WORK / MODULUS) ** (2 / 3) / mu
    adhesion = {
        "law": "dugdale", "range": f"{reach} m", "smoothing": width, "overlap_stiffness": f"{60 * WORK / reach**2} Pa/m",
    }  # fmt: skip
    transition = maugis.transition_parameter(SPHERE, MODULUS, WORK, WORK / reach)
    return sphere(n, adhesion, MAUGIS[mu][0]), -maugis.pull_off_force(SPHERE, WORK, transition)


def flats(quick: bool) -> Iterator[PullOff]:
    """Flat punches."""
    for law in LAWS:
        for n in FLAT_SIZES[: 2 if quick else None]:
            yield pulled_off(flat(law, n), "flat", KENDALL)


def spheres(quick: bool) -> Iterator[PullOff]:
    """Spheres, on grids and by rings alone."""
    sizes = list(SPHERE_SIZES)[: 1 if quick else None]
    for law, keys in LAWS.items():
        for n in sizes:
            # A range twice as long for the grid as usual: no contact line is pinned by it.
            yield pulled_off(sphere(n, {"law": law, "range_factor": 0.04, **keys}), "sphere", JKR, True)
        for factor in () if quick else RING_FACTORS:
            same = law_of(sphere(sizes[0], {"law": law, "range_factor": factor, **keys}).adhesion)
            tension = by_rings(same)
            yield PullOff("rings", law, 0, math.nan, same.length, same.strength, tension, JKR, tension, math.nan)


def maugis_spheres(quick: bool) -> Iterator[PullOff]:
    """Spheres under Dugdale's law."""
    for mu, (_, grids) in MAUGIS.items():
        for width in WIDTHS:
            for n in grids[: 1 if quick else None]:
                scene, closed = dugdale(mu, width, n)
                yield pulled_off(scene, f"Maugis {mu:g} {width:g}", closed)


PARTS = {"flat": flats, "sphere": spheres, "maugis": maugis_spheres}
PUNCHES = {"flat": ("flat",), "sphere": ("sphere", "rings"), "maugis": ("Maugis",)}
"""First words of the punches of each part."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", choices=[[], *PARTS], help="some parts; rows of the others are kept")
    parser.add_argument("--quick", action="store_true", help="small grids; leaves docs alone")
    parser.add_argument("--draw-only", action="store_true", help="figure and tables from laws.csv")
    options = parser.parse_args()
    parts = [] if options.draw_only else options.parts or list(PARTS)
    made = [word for part in parts for word in PUNCHES[part]]
    rows = [row for row in read() if row.punch.split()[0] not in made]
    for one in chain.from_iterable(PARTS[part](options.quick) for part in parts):
        shares = f"{one.force / one.closed:.4f} {one.rings / one.closed:.4f} {one.residual:.1e}"
        print(f"{one.punch:16s} {one.law:14s} n = {one.n:4d}  {shares}", flush=True)
        rows.append(one)
    if not options.quick:
        write(rows)
        report.make(rows)


def write(rows: list[PullOff]) -> None:
    """Writes laws.csv, in SI units."""
    with (FIGURES / "laws.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([field.name for field in fields(PullOff)])
        writer.writerows(
            [f"{value:.6g}" if isinstance(value, float) else value for value in vars(row).values()] for row in rows
        )


def read() -> list[PullOff]:
    """The rows of laws.csv, none if there is no such file."""
    if not (FIGURES / "laws.csv").exists():
        return []
    with (FIGURES / "laws.csv").open(newline="", encoding="utf-8") as file:
        kinds = {field.name: {"str": str, "int": int, "float": float}[str(field.type)] for field in fields(PullOff)}
        return [PullOff(**{name: kinds[name](text) for name, text in row.items()}) for row in csv.DictReader(file)]


if __name__ == "__main__":
    main()
