"""Reading a measured curve: a table of position and force, and time if there is one, units in its header.

    displacement (um), force (mN), time (s)
    2.1, -0.03, 0.00

files/text_table.py describes the tables, measured_columns.py the known columns, and measured_checks.py the conditions
for every curve. Files of atomic force microscopes are read by afmformats (afm_curves.py).
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pgfmd.results.curve import Loop
from pgfmd.units import handy_quantity

from .measured_checks import (
    confirm_deepest,
    confirm_loss,
    confirm_signs,
    one_cycle,
    turn_of,
    without_baseline,
)
from .measured_columns import rows_of

TABLES = (".csv", ".txt", ".dat", ".tsv", ".asc", ".prn", ".xls", ".log", ".lvm", ".out", ".xy")
"""Suffixes of files that are read as tables. Other files are read by afmformats."""


def read_experiment(
    path: str | Path,
    positive_displacement: str | None = None,
    positive_force: str = "compression",
    cycle: int | None = None,
    baseline: float | None = None,
) -> Loop:
    """A measured curve as a loop, its rows in the order of the measurement; split at the largest force.

    Args:
        path: the file.
        positive_displacement: "in" if displacements grow when the punch is pushed in, as the paper's do, or "out". None
            for the sense given by the name of the column: a gap and an extension grow outwards, an indentation, a
            displacement and a piezo's position inwards.
        positive_force: "compression" or "tension".
        cycle: which of several cycles, from 1.
        baseline: force far away [N], with the sign of the file, that is subtracted; None for the one found in the rows.

    Raises:
        MeasurementError: naming file, line, what was expected and a cure.
        ValueError: for another word than these.
    """
    if positive_displacement not in ("in", "out", None) or positive_force not in ("compression", "tension"):
        raise ValueError("expected 'in' or 'out', and 'compression' or 'tension'")
    path = Path(path)
    if path.suffix.lower() in TABLES or not path.suffix:
        rows = rows_of(path, positive_displacement, positive_force)
    else:
        from .afm_curves import rows_of_afm

        rows = rows_of_afm(path, positive_displacement, positive_force)
    confirm_signs(rows)
    confirm_deepest(rows)
    rows = one_cycle(rows, cycle)
    turn, both = turn_of(rows)
    if baseline is None:
        force, treated = without_baseline(rows, turn)
    else:
        offset = baseline if positive_force == "compression" else -baseline
        force = rows.force - offset
        treated = f"force far away, {handy_quantity(offset, 'force', 4)} as given, taken off" if offset else ""
    if both:
        confirm_loss(replace(rows, force=force))
    else:
        branch = "retraction" if turn < len(force) // 2 else "approach"
        rows.remarks.append(f"{path.name}: holds the {branch} alone, so that its loop is not closed")
    count = len(force)
    phase = np.where(np.arange(count) <= turn, "approach", "retract")
    unknown = np.full(count, np.nan)
    return Loop(
        path.stem, rows.time, -rows.indentation, force, unknown, unknown, phase, np.zeros(count, bool), closed=both,
        treated=treated, remarks=tuple(rows.remarks),
    )  # fmt: skip
