"""The live tables of a run: what their columns are called and what a row of each holds, units in the header."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from .csv_file import CsvFile

CURVE_COLUMNS = (
    "time [s]",
    "displacement [m]",
    "indentation [m]",
    "force [N]",
    "contact_area [m^2]",
    "overlap_area [m^2]",
    "near_area [m^2]",
    "u_inf [m]",
    "step [s]",
    "phase",
)
LATER_COLUMNS = ("overlap_area [m^2]", "near_area [m^2]")
"""Columns of the curve that those of version 0.1 don't have: its `contact_area` is what is now `overlap_area`."""
EARLIER_CURVE_COLUMNS = tuple(name for name in CURVE_COLUMNS if name not in LATER_COLUMNS)
ENERGY_COLUMNS = (
    "time [s]",
    "work [J]",
    "elastic [J]",
    "adhesive [J]",
    "viscous [J]",
    "released [J]",
    "residual [J]",
)


@dataclass(frozen=True)
class CurveRow:
    """One accepted step. SI units; force positive in compression, displacement negative when pushed in.

    contact_area: of the points with a gap below the law's contact_gap (physics/cohesion.py); overlap_area: below zero;
    near_area: below the scene's output.near_gap.
    """

    time: float
    displacement: float
    indentation: float
    force: float
    contact_area: float
    overlap_area: float
    near_area: float
    u_inf: float
    step: float
    phase: str


@dataclass(frozen=True)
class EnergyRow:
    """The terms of the energy audit [J] up to `time` [s], each counted from the start of the run."""

    time: float
    work: float
    elastic: float
    adhesive: float
    viscous: float
    released: float
    residual: float


EVENT_COLUMNS = (
    "time [s]",
    "displacement [m]",
    "force [N]",
    "released [J]",
    "event",
    "joined",
    "left",
    "x [m]",
    "y [m]",
    "at",
)
PATCH_COLUMNS = (
    "snapshot",
    "time [s]",
    "patch",
    "area [m^2]",
    "force [N]",
    "x [m]",
    "y [m]",
    "summits",
    "saddles",
    "valleys",
    "kind",
    "nearest",
)
SITE_COLUMNS = (
    "time [s]",
    "displacement [m]",
    "force [N]",
    "phase",
    "kind",
    "site",
    "x [m]",
    "y [m]",
    "event",
    "in_contact",
    "of",
)


@dataclass(frozen=True)
class EventRow:
    """Something that happened at an instant: the preload, the detachment, or a jump with the energy [J] it released.

    Of a jump: `joined` and `left`, the sites whose contact changed, such as "1 summit; 3 saddle"; `x`, `y` [m], where
    the traction changed most, NaN for other events; `at`, the site nearest to that, such as "saddle 40".
    """

    time: float
    displacement: float
    force: float
    released: float
    event: str
    joined: str = ""
    left: str = ""
    x: float = math.nan
    y: float = math.nan
    at: str = ""


@dataclass(frozen=True)
class PatchRow:
    """A patches.Patch of a snapshot, in the order of its fields."""

    snapshot: int
    time: float
    patch: int
    area: float
    force: float
    x: float
    y: float
    summits: int
    saddles: int
    valleys: int
    kind: str
    nearest: str


@dataclass(frozen=True)
class SiteRow:
    """A site that "joins" the contact or "leaves" it: then `in_contact` sites of its kind are in contact, `of` there
    are."""

    time: float
    displacement: float
    force: float
    phase: str
    kind: str
    site: int
    x: float
    y: float
    event: str
    in_contact: int
    of: int


class CurveFile(CsvFile):
    """`curve.csv`: force, position and contact of the accepted steps (`CurveRow`)."""

    def __init__(self, path: str | Path, comm, every: int = 1):
        super().__init__(path, comm, CURVE_COLUMNS, every)


class EnergyFile(CsvFile):
    """`energy.csv`: the energy audit (`EnergyRow`)."""

    def __init__(self, path: str | Path, comm, every: int = 1):
        super().__init__(path, comm, ENERGY_COLUMNS, every)


class EventFile(CsvFile):
    """`events.csv`: jumps, the preload, the detachment (`EventRow`)."""

    def __init__(self, path: str | Path, comm):
        super().__init__(path, comm, EVENT_COLUMNS)


class PatchFile(CsvFile):
    """`patches.csv`: the contact patches of every snapshot (`PatchRow`)."""

    def __init__(self, path: str | Path, comm):
        super().__init__(path, comm, PATCH_COLUMNS)


class SiteFile(CsvFile):
    """`sites.csv`: summits, saddles and valleys that join the contact or leave it (`SiteRow`)."""

    def __init__(self, path: str | Path, comm):
        super().__init__(path, comm, SITE_COLUMNS)
