"""The contact in an analysis: its areas, and the loads at which sites join and leave it.

For a run that counted only overlap (`Results.counts_overlap`), no name or key says contact.
"""

from __future__ import annotations

from dataclasses import dataclass

from pgfmd.results import Results
from pgfmd.results.curve import Loop, Measures
from pgfmd.results.sites import site_loads
from pgfmd.solver.grid import Grid, PunchPoints
from pgfmd.symmetry import ALONE
from pgfmd.units import UnitError, parse_quantity

from .table import Table

COUNTED_OVERLAP = (
    "version 0.1 of pgfmd made this run and counted points with a negative gap, which leaves out what is held under "
    "tension: areas, patches and sites are those of overlap, and contact is not known"
)


@dataclass(frozen=True)
class Face:
    """The punch's face on the grid: its points, and the area [m^2] of one."""

    points: int
    cell: float

    def share(self, area: float) -> str:
        """The fraction of the face of an area [m^2], in words. "All" means that no point is missing."""
        missing = self.points - round(area / self.cell)
        if not missing:
            return "all of the punch"
        text = f"{100.0 * (1.0 - missing / self.points):.3g}"
        return f"all of the punch but {missing} of {self.points} points" if text == "100" else f"{text} % of the punch"


def _face_of(results: Results) -> Face | None:
    """The face of a run's scene; None if the scene does not determine it."""
    try:
        grid, radius = results.scene["grid"], results.scene["punch"].get("radius")
        cell = Grid(grid["n"], parse_quantity(grid["length"], "length"))
        radius = None if radius is None else parse_quantity(radius, "length")
    except (KeyError, UnitError):
        return None
    # All rows of the cell.
    return Face(PunchPoints(cell, radius, ALONE, (0, cell.n)).total, cell.cell_area)


def add_areas(table: Table, results: Results, found: Measures) -> None:
    """A section for each area that is known: at the preload, the largest, at the pull-off; and the gap below which
    points count. A remark where contact is not among them."""
    gaps = {"contact": results.contact_gap, "near": results.near_gap}
    face = _face_of(results)
    for kind, areas in found.areas.items():
        if kind == "overlap" and "contact" in found.areas and not results.contact_gap:
            # The same points.
            continue
        section, prefix = kind.capitalize(), "" if kind == "contact" else f"{kind}_"
        if kind in gaps:
            less = kind == "near" and results.near_gap <= results.contact_gap
            note = "not above that of contact: an image sees less than what is held" if less else ""
            table.add(section, f"{kind}_gap", "gap below which points count", gaps[kind], "m", note)
        for key, name, value in (
            (f"{prefix}area_at_preload", f"{kind} area at the preload", areas.at_preload),
            (f"largest_{prefix}area", f"largest {kind} area", areas.largest),
            (f"{prefix}area_at_pull_off", f"{kind} area at pull-off", areas.at_pull_off),
        ):
            if value is not None:
                table.add(section, key, name, value, "m^2", face.share(value) if face else "")
    if results.counts_overlap:
        table.remarks.append(COUNTED_OVERLAP)


def add_sites(table: Table, results: Results, loop: Loop) -> None:
    """The loads at which the first and the last site of each kind joins the contact, and leaves it."""
    if len(loop.force) < len(results.curve):
        # Of one cycle: the table of sites is that of the whole run.
        return
    section, mark, joins, leaves = "Loads at which sites change", "", "joins", "leaves"
    if results.counts_overlap:
        section, mark, joins, leaves = f"{section}, by overlap", "_overlap", "begins to overlap", "ends to overlap"
    for kind in site_loads(results, loop):
        most = f"{kind.most} of {kind.of} at most"
        for key, name, value in (
            ("first_joins", f"first {joins}", kind.first_joins), ("last_joins", f"last {joins}", kind.last_joins),
            ("first_leaves", f"first {leaves}", kind.first_leaves), ("last_leaves", f"last {leaves}", kind.last_leaves),
        ):  # fmt: skip
            note = most if key == "first_joins" else ""
            table.add(section, f"{kind.kind}{mark}_{key}", f"{kind.kind}: {name}", value, "N", note)
