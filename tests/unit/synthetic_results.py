"""A results folder as a run leaves it: a rigid sphere on a half-space with some delay, pressed in and pulled off.

Hertz's pressure and closed-form gap, shifted by a constant pull, so that the numbers have the right look and size.
"""

import itertools
import json
from pathlib import Path

import numpy as np
from mpi4py import MPI

from pgfmd.files.hdf5 import open_serial
from pgfmd.files.storage import write_run_json
from pgfmd.files.table_writing import TableFile
from pgfmd.files.tables import CURVE, ENERGY, EVENTS, PATCHES, SITES, CurveRow, EnergyRow, EventRow, PatchRow, SiteRow
from pgfmd.output.fields_file import FieldsFile

RADIUS, MODULUS, PUNCH = 5e-3, 2.67e6, 375e-6
CONTACT_GAP, NEAR_GAP = 180e-9, 400e-9
OVERLAP, NEAR = 0.7, 1.3
"""Areas of overlap and of what is near, as shares of the contact area."""
OFFSET = 2e-6
"""k [m] of indentation = -displacement - k."""
GAPS = ("contact_gap_m", "near_gap_m")
"""What version 0.1 does not say of a run."""


def history(rows: int) -> list[CurveRow]:
    """Approach to 20 um, short turn and dwell, retraction with a larger pull."""
    found = []
    for s in np.linspace(0, 1, rows):
        indentation = 1e-6 * (-4 + 24 * s / 0.4 if s < 0.4 else 20 if s < 0.5 else 20 - 32 * (s - 0.5) / 0.5)
        phase = "approach" if s < 0.38 else "turn" if s < 0.4 else "dwell" if s < 0.5 else "retract"
        way_back = max(s - 0.5, 0) / 0.5
        pull = 0.2e-3 + 0.8e-3 * min(5 * way_back, 1)
        depth = indentation + 6e-6 * way_back
        contact = np.sqrt(RADIUS * depth) if depth > 0 else 0.0
        force = 4 / 3 * MODULUS * contact**3 / RADIUS - (pull if contact else 0.0) * (1 + contact / 2e-4)
        area = np.pi * contact**2
        areas = area, OVERLAP * area, NEAR * area
        found.append(CurveRow(10 * s, -indentation - OFFSET, indentation, force, *areas, 0.0, 10 / rows, 1, 1, phase))
    return found


def sphere(nb: int, contact_radius: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """inside, gap [m], traction [Pa], displacement [m] on the block of the punch."""
    position = ((np.arange(nb) + 0.5) / nb - 0.5) * 2 * PUNCH
    r = np.hypot(position[:, None], position)
    a = max(contact_radius, 1e-6)
    peak = 2 * MODULUS * a / (np.pi * RADIUS)
    rim = 0.1e6 * np.exp(-np.maximum(r - a, 0) / 8e-6) * (r > a)
    traction = rim - peak * np.sqrt(np.maximum(1 - (r / a) ** 2, 0))
    with np.errstate(divide="ignore"):
        outer = np.sqrt(np.maximum(r**2 - a**2, 0)) * a - (2 * a**2 - r**2) * np.arccos(np.minimum(a / r, 1))
    gap = np.where(r > a, outer / (np.pi * RADIUS), -1e-9)
    displacement = r**2 / (2 * RADIUS) - gap - a**2 / RADIUS
    return r <= PUNCH, gap, traction, displacement


def write_results(
    directory: Path, rows: int = 400, nb: int = 96, snapshots: int = 6, energy: bool = True, fields: bool = True,
    contact: bool = True,
) -> Path:  # fmt: skip
    """Fill `directory` with the writers that a run uses."""
    comm = MPI.COMM_SELF
    directory.mkdir(parents=True, exist_ok=True)
    curve, found = TableFile(CURVE, directory / "curve.csv", comm), history(rows)
    for row in found:
        curve.append(row)
    curve.close()
    if fields:
        inside = sphere(nb, 1e-4)[0]
        file = FieldsFile(directory / "fields.h5", comm, 2 * nb, 4 * PUNCH, nb // 2, nb, 0, nb, inside)
        for k in np.linspace(0.12, 0.98, snapshots) * (rows - 1):
            row = found[int(k)]
            _, gap, traction, displacement = sphere(nb, np.sqrt(row.contact_area / np.pi))
            label = {"approach": "approach", "dwell": "end of dwell", "retract": "retraction"}.get(row.phase, "turn")
            file.append(label, row.time, row.displacement, row.force, gap, traction, displacement)
    if energy:
        write_energy(TableFile(ENERGY, directory / "energy.csv", comm), found)
    if contact:
        write_contact(directory, comm, found)
    told = {"contact_gap_m": CONTACT_GAP, "near_gap_m": NEAR_GAP, "indentation_offset_m": OFFSET}
    write_run_json(directory / "run.json", comm, {"finished": "detached", "steps": rows, **told})
    scene = f'[cell]\nlength = "1.5 mm"\nn = 192\n[output]\nnear_gap = "{NEAR_GAP} m"\n'
    (directory / "scene.resolved.toml").write_text(scene)
    return directory


def as_version_0_1(folder: Path) -> Path:
    """A results folder as that version would have left it: it counts gaps below zero alone, and calls that contact."""
    header, *lines = (folder / "curve.csv").read_text().splitlines()
    names = header.split(",")
    contact, overlap, near = (names.index(f"{kind}_area [m^2]") for kind in ("contact", "overlap", "near"))
    later = overlap, near, names.index("cycle"), names.index("stage")
    rows = [line.split(",") for line in lines]
    for row in rows:
        row[contact] = row[overlap]
    kept = [[cell for k, cell in enumerate(row) if k not in later] for row in (names, *rows)]
    (folder / "curve.csv").write_text("".join(",".join(row) + "\n" for row in kept))
    if (folder / "run.json").exists():
        record = json.loads((folder / "run.json").read_text())
        # Marks of tables that look otherwise now.
        record = {key: value for key, value in record.items() if key not in (*GAPS, "outputs")}
        (folder / "run.json").write_text(json.dumps(record))
    if (folder / "fields.h5").exists():
        with open_serial(folder / "fields.h5", "r+") as file:
            for name in set(GAPS) & set(file.attrs):
                del file.attrs[name]
    scene = (folder / "scene.resolved.toml").read_text().splitlines(keepends=True)
    (folder / "scene.resolved.toml").write_text("".join(line for line in scene if not line.startswith("near_gap")))
    return folder


def write_energy(file: TableFile, found: list[CurveRow]) -> None:
    """Work of the punch by the trapezoidal rule; the other terms of about the size and course of a real audit."""
    work = viscous = released = 0.0
    file.append(EnergyRow(found[0].time, *[0.0] * 6))
    for before, row in itertools.pairwise(found):
        work += 0.5 * (row.force + before.force) * (row.indentation - before.indentation)
        elastic = 0.4 * row.force * max(row.indentation, 0.0)
        adhesive = -0.05 * row.contact_area
        viscous += 0.05 * abs(row.force) * abs(row.indentation - before.indentation)
        released += 2e-9 if before.contact_area and not row.contact_area else 0.0
        file.append(EnergyRow(row.time, work, elastic, adhesive, viscous, released, 2e-4 * work * np.sin(row.time)))
    file.close()


def write_contact(directory: Path, comm, found: list[CurveRow]) -> None:
    """One patch and one summit, in contact while there is an area; the loss of it is a jump."""
    sites, patches, events = (TableFile(table, directory / table.file, comm) for table in (SITES, PATCHES, EVENTS))
    for before, row in itertools.pairwise(found):
        joins, leaves = row.contact_area > 0 == before.contact_area, before.contact_area > 0 == row.contact_area
        if joins or leaves:
            site = ("summit", 0, 0.0, 0.0, "joins" if joins else "leaves", joins, 1)
            sites.append(SiteRow(row.time, row.displacement, row.force, row.phase, *site))
        if leaves:
            jump = (2e-9, "jump", "", "1 summit", 0.0, 0.0, "summit 0")
            events.append(EventRow(row.time, row.displacement, row.force, *jump))
    row = found[len(found) // 2]
    patches.extend([PatchRow(0, row.time, 0, row.contact_area, row.force, 0.0, 0.0, 1, 0, 0, "summit", "summit")])
    events.append(EventRow(found[-1].time, found[-1].displacement, 0.0, 0.0, "detached"))
    for file in (sites, patches, events):
        file.close()
