"""What makes a scene the quasi-static twin of another one: the same test, infinitely slowly."""

from __future__ import annotations

CHANGES = ("solver.scheme=quasistatic", "solver.modulus=relaxed", "solver.precision=auto", "output.snapshots=[]")
"""What a twin has otherwise, as overrides."""
SAME_SECTIONS = ("punch", "substrate", "adhesion", "drive", "grid")
"""Sections that a run and its twin have in common."""
NO_TIME = ("speed", "retract_speed", "turn_time", "dwell")
"""Keys of [drive] that mean nothing to a quasi-static run."""
