"""Loops and folders made of closed forms, for the tests of the analysis."""

from pathlib import Path

import numpy as np

from pgfmd.files.tables import CURVE, ENERGY, EVENTS
from pgfmd.results.curve import Loop

MODULUS, WORK, PUNCH = 2.649e6, 0.05, 375e-6


def loop_of(displacement, force, turn, jumps=(), u_inf=0.0, area=0.0) -> Loop:
    """A loop from its rows; turn: the first row of the retraction."""
    rows = len(force)
    phase = np.where(np.arange(rows) < turn, "approach", "retract")
    jump = np.isin(np.arange(rows), jumps)
    same = np.ones(rows)
    time, displacement, force = np.arange(rows) * 0.1, np.asarray(displacement, float), np.asarray(force, float)
    return Loop("made", time, displacement, force, area * same, u_inf * same, phase, jump)


def triangle(preload_depth=10e-6, end=4e-6, rows=401, turn_rows=201):
    """Displacements [m] of a punch that goes in from zero, and out to `end`; and the row after the turning point."""
    way_in = np.linspace(0.0, -preload_depth, turn_rows)
    way_out = np.linspace(-preload_depth, end, rows - turn_rows + 1)[1:]
    return np.concatenate((way_in, way_out)), turn_rows


def flat_punch_loop() -> Loop:
    """Kendall's flat punch: straight in and out, and off at once at its pull-off force."""
    stiffness = 2 * PUNCH * MODULUS
    off = np.sqrt(2 * np.pi * WORK * PUNCH / MODULUS)
    displacement, turn = triangle(20e-6, off)
    displacement = np.append(displacement, off * (1 + 1e-9))
    force = np.append(-stiffness * displacement[:-1], 0.0)
    return loop_of(displacement, force, turn, jumps=[len(force) - 1])


def write_folder(folder: Path, loop: Loop, scene: str, released: float = 0.0, viscous: float = 0.0) -> Path:
    """A results folder with this loop, as a finished run leaves it; energies in the last row of the audit."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [",".join(CURVE.titles)]
    columns = (
        loop.time, loop.displacement, loop.indentation, loop.force, loop.area, loop.area, loop.area, loop.u_inf,
        loop.time * 0 + 0.1,
    )  # fmt: skip
    rows = zip(*columns, loop.phase, strict=True)
    lines += [",".join([*map(repr, map(float, row)), "1", "1", phase]) for *row, phase in rows]
    (folder / "curve.csv").write_text("\n".join(lines) + "\n")
    audit = [ENERGY.titles, (0.0,) * 7, (float(loop.time[-1]), released + viscous, 0.0, 0.0, viscous, released, 0.0)]
    (folder / "energy.csv").write_text("".join(",".join(map(str, row)) + "\n" for row in audit))
    events = [",".join(EVENTS.titles)]
    values = {"event": "jump", "joined": "", "left": "", "at": ""}
    for k in np.flatnonzero(loop.jump):
        same = {"time [s]": loop.time, "displacement [m]": loop.displacement, "force [N]": loop.force}
        values |= {title: repr(float(numbers[k])) for title, numbers in same.items()}
        events.append(",".join(values.get(name, "0.0") for name in EVENTS.titles))
    (folder / "events.csv").write_text("\n".join(events) + "\n")
    (folder / "scene.resolved.toml").write_text(scene)
    (folder / "run.json").write_text('{"finished": "detached", "indentation_offset_m": 0.0}\n')
    return folder
