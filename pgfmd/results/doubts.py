"""What is to be said of a run's own numbers where they are not what was asked for, or not to be believed. No MPI."""

from __future__ import annotations

from pathlib import Path

from pgfmd.errors import ResultError

from .reading import load
from .uncertainty import LEAST_LOOP, UNBALANCED, UNCERTAIN, at_stake

MISSED = 0.01
"""By how much a preload may be missed, relative to itself, without a word at the end of a run."""


def missed_preload(record: dict, asked: float | None) -> list[str]:
    """What is said of a preload [N] that a run could not meet. record: of `run.json`."""
    met = record.get("preload_N")
    if met is None or asked is None or abs(met - asked) <= MISSED * asked:
        return []
    if "accuracy" not in record:
        cure = "the force rose by so much within one step. Take shorter steps ([solver.gfmd])."
    else:
        cure = (
            "the force jumps from below to that much. Choose a drive.preload on either side of the jump, or a smaller "
            "solver.accuracy."
        )
    return [f"The preload is {met:.4g} N instead of {asked:.4g} N: {cure}"]


def unbalanced(record: dict, directory: Path) -> list[str]:
    """What is said of an energy audit that does not close, in any scheme; nothing of one that does. record: of
    `run.json`."""
    if record.get("energy_residual") is None or record.get("work_J") is None:
        return []
    work = record["work_J"]
    residual = record["energy_residual"] * abs(work)
    if residual <= UNBALANCED * abs(work):
        # At stake is no less than that: no need to read the table.
        return []
    try:
        scale = at_stake(load(directory), work)
    except ResultError:
        # The table of a finished run may be gone.
        scale = abs(work)
    if residual <= UNBALANCED * scale:
        return []
    way = "lower solver.accuracy" if "accuracy" in record else "take shorter steps ([solver.gfmd])"
    cure = f"{way} before believing energies"
    if scale == abs(work):
        return [f"The energy audit closes to {100 * residual / scale:.2g} % of the loop's work: {cure}."]
    return [
        f"The energy audit closes to {residual * 1e9:.2g} nJ, and the loop's work is {work * 1e9:.2g} nJ, "
        f"little compared with {scale / LEAST_LOOP * 1e9:.2g} nJ in the approach: {cure}."
    ]


def uncertain_loop(record: dict) -> list[str]:
    """What is said of the loop of a quasi-static run that is poorly known; nothing of other runs. record: of
    `run.json`."""
    by_solves, by_jumps = record.get("unbalanced_J"), record.get("jump_places_J")
    work, spread = record.get("work_J"), record.get("work_uncertainty_J")
    if by_solves is None or by_jumps is None or work is None or spread is None or not record.get("jumps"):
        return []
    if spread <= UNCERTAIN * abs(work):
        return []
    return [
        f"The loop of {work * 1e9:.3g} nJ is uncertain by {spread * 1e9:.2g} nJ, {by_solves * 1e9:.2g} nJ of it because the "
        f"equilibria are not exact, which widens the loop, and {by_jumps * 1e9:.2g} nJ because of the places of jumps: "
        "lower solver.accuracy before believing it."
    ]
