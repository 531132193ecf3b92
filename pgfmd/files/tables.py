"""The tables of a run, each declared once: its columns with name, unit and meaning, and what a number in them can be.

Headers, the writer (table_writing.py), the reader and its checks (table_reading.py) and the tables of the page "Files
of a run" (scripts/studies/reference_pages/columns.py) are made from these declarations. A new column is a field of a row; one that tables
of an earlier version do not have says so (`after`), and reads as NaN from those.

All tables are in the order of time, and what they have in common (`time`, `displacement`, `force`) is written from the
same numbers of the same step with all their digits (`written`): what is equal in two tables then is the same step.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, get_type_hints

from .storage import CURVE_FILE, ENERGY_FILE, EVENTS_FILE, PATCHES_FILE, SITES_FILE

AS_IN_CURVE = "as in `curve.csv`"
WITHOUT_PROGRAMMES = "0.2 without programmes"
EARLIER = ("0.1", WITHOUT_PROGRAMMES)
"""What wrote tables with fewer columns, oldest first: versions, and earlier builds of this one."""
PHASES = ("approach", "turn", "dwell", "retract", "hold", "ramp", "oscillate", "follow")
KINDS = ("summit", "saddle", "valley")
"""Of sites, as physics/contact_sites.py has them."""
JOINS, LEAVES = "joins", "leaves"
CHANGED_SITES = (
    "of a jump: how many summits, saddles and valleys joined and left the contact in it, such as `1 summit; 3 saddle`; "
    "which ones, `sites.csv` says. Empty where there are none"
)
WHERE_IT_JUMPED = (
    "of a jump: the point whose traction changed most. Of points that changed as much, as mirror images do, the first. "
    "`nan` for other events"
)
CENTRE = "centre of its area. In a periodic cell, of a patch that reaches over less than half of the cell"
SITES_WITHIN = "how many of the punch's sites are in it"
WHERE_IT_IS = "where it is, relative to the punch's axis"


def column(
    unit: str, meaning: str, *, after: str = "", at_least: float | None = None, never_falls: bool = False,
    may_lack: bool = False, one_of: tuple[str, ...] = (), default: Any = None,
) -> Any:  # fmt: skip
    """A field of a row, with what its column says and can hold.

    Args:
        unit: SI; empty for texts and counts. meaning: Markdown, for the reference page.
        after: the last of EARLIER whose tables do not have the column; empty if it was always there.
        at_least: the least value. never_falls: whether no row has less than the row before. may_lack: whether NaN is a
        value. one_of: the texts that there are; empty for any.
        default: of a row that is made without it.
    """
    about = {"unit": unit, "meaning": meaning, "after": after, "at_least": at_least, "never_falls": never_falls,
             "may_lack": may_lack, "one_of": one_of}  # fmt: skip
    return field(metadata=about) if default is None else field(default=default, metadata=about)


@dataclass(frozen=True)
class Column:
    """A column of a table; kind: `float`, `int` or `str`; all else as `column` says."""

    name: str
    kind: type
    unit: str
    meaning: str
    after: str
    at_least: float | None
    never_falls: bool
    may_lack: bool
    one_of: tuple[str, ...]

    @property
    def title(self) -> str:
        """What the header calls it."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    def written(self, value: Any) -> str:
        """A value as the table has it: a float with all its digits, so that it reads back as the same number.

        Raises:
            ValueError: for a text that would be two cells, or two lines.
        """
        if self.kind is str:
            if any(mark in value for mark in ',"\n\r'):
                raise ValueError(f"{self.title} = {value!r}: a text in a table has no commas, quotes or ends of lines")
            return str(value)
        return str(int(value)) if self.kind is int else repr(float(value))


@dataclass(frozen=True)
class Table:
    """A table of a run. name: in `Results` and in checkpoints; file: its name in the folder; row: the dataclass of its
    rows, whose fields are made by `column`."""

    name: str
    file: str
    row: type

    @cached_property
    def columns(self) -> tuple[Column, ...]:
        """Its columns, in their order."""
        kinds = get_type_hints(self.row)
        return tuple(Column(entry.name, kinds[entry.name], **entry.metadata) for entry in fields(self.row))

    @cached_property
    def titles(self) -> tuple[str, ...]:
        """What the header calls the columns."""
        return tuple(entry.title for entry in self.columns)

    @cached_property
    def layouts(self) -> tuple[tuple[Column, ...], ...]:
        """The columns that tables of this version have, and of each earlier one that had others, newest first."""
        found, left = [self.columns], self.columns
        for k in reversed(range(len(EARLIER))):
            left = tuple(entry for entry in left if entry.after not in EARLIER[k:])
            if left != found[-1]:
                found.append(left)
        return tuple(found)

    @property
    def headers(self) -> list[str]:
        """First lines of `layouts`, each with its end."""
        return [",".join(entry.title for entry in columns) + "\n" for columns in self.layouts]

    def line(self, row: Any, columns: tuple[Column, ...] | None = None) -> str:
        """A row as the file has it, with all columns or those of another layout. Raises ValueError for a text that fits in
        no cell."""
        return ",".join(entry.written(getattr(row, entry.name)) for entry in columns or self.columns) + "\n"


@dataclass(frozen=True)
class CurveRow:
    """One accepted step. SI units; force positive in compression, displacement negative when pushed in."""

    time: float = column("s", "since the start of the loading programme", at_least=0.0, never_falls=True)
    displacement: float = column("m", "position $d$ of the punch, negative when it is pushed in")
    indentation: float = column(
        "m", "$-d - k$ with $k = 0$ (`indentation_offset_m` in `run.json`): counted from the first touch of the "
        "undeformed surface",
    )  # fmt: skip
    force: float = column("N", "normal force $F$ on the punch, positive in compression")
    contact_area: float = column(
        "m^2", "area of the grid points in [contact](../explanation/model.md#contact): with a gap below that of the largest "
        "traction, half the range of adhesion with `cosine`, 0 with `repulsive` (`contact_gap_m` in `run.json`)",
        at_least=0.0,
    )  # fmt: skip
    overlap_area: float = column(
        "m^2", "of those with a gap below zero, which are under compression", after="0.1", at_least=0.0
    )
    near_area: float = column(
        "m^2", "of those with a gap below `output.near_gap` (`near_gap_m`), as an optical image sees it", after="0.1",
        at_least=0.0,
    )  # fmt: skip
    u_inf: float = column(
        "m", "[estimate of the displacement far away](../explanation/model.md#the-surface-far-away) in a periodic cell, positive "
        "upward; 0 with a free boundary. No other column has it subtracted",
    )  # fmt: skip
    step: float = column("s", "length of the step that ended here", at_least=0.0)
    cycle: int = column(
        "", "number of the repeat of the programme, from 1", after=WITHOUT_PROGRAMMES, at_least=1, never_falls=True
    )
    stage: int = column(
        "", "number of the step of the programme, from 1; a turn belongs to the step that it leads to",
        after=WITHOUT_PROGRAMMES, at_least=1,
    )  # fmt: skip
    phase: str = column(
        "", "part of the programme that the step belongs to: `approach`, `turn`, `dwell` (of the displacement), `hold` (of "
        "the load), `retract`, `ramp`, `oscillate` or `follow`", one_of=PHASES,
    )  # fmt: skip


@dataclass(frozen=True)
class EnergyRow:
    """The terms of the energy audit up to `time`, each counted from the start of the run."""

    time: float = column("s", AS_IN_CURVE, at_least=0.0, never_falls=True)
    work: float = column("J", r"work done by the punch on the elastomer, $-\int F\,\mathrm{d}d$")
    elastic: float = column("J", "change of the energy stored in the elastomer")
    adhesive: float = column("J", "change of the energy of the interface, negative when contact has been gained")
    viscous: float = column("J", "energy dissipated by the viscous elements")
    released: float = column("J", "energy lost in jumps of the surface")
    residual: float = column("J", "work - elastic - adhesive - viscous - released: zero for an exact solution")


@dataclass(frozen=True)
class EventRow:
    """Something that happened at an instant: the preload, the detachment, or a jump with the energy it released."""

    time: float = column("s", AS_IN_CURVE, at_least=0.0, never_falls=True)
    displacement: float = column("m", AS_IN_CURVE)
    force: float = column("N", AS_IN_CURVE)
    released: float = column("J", "energy lost in this jump; 0 for other events")
    event: str = column(
        "",
        "`preload`, `jump`, `step end` of any other step of a programme, or how the run ended (`finished` in `run.json`)",
    )
    joined: str = column("", CHANGED_SITES, default="")
    left: str = column("", CHANGED_SITES, default="")
    x: float = column("m", WHERE_IT_JUMPED, may_lack=True, default=math.nan)
    y: float = column("m", WHERE_IT_JUMPED, may_lack=True, default=math.nan)
    at: str = column(
        "", "of a jump: the site nearest to this point, such as `saddle 40`; its number is that in `sites.csv`",
        default="",
    )  # fmt: skip


@dataclass(frozen=True)
class PatchRow:
    """A connected patch of contact in a snapshot; from `patch` on the fields of solver/patches.Patch, in their
    order."""

    snapshot: int = column(
        "", "number of the snapshot in `fields.h5`, from 0; one without contact has no rows", at_least=0,
        never_falls=True,
    )  # fmt: skip
    time: float = column("s", "of the snapshot", at_least=0.0)
    patch: int = column(
        "", "number of the patch in this snapshot, from 0, in the order of their first grid points, row by row from "
        "the lowest $y$", at_least=0,
    )  # fmt: skip
    area: float = column(
        "m^2", "of its grid points; all patches together have the `contact_area` of the curve", at_least=0.0
    )
    force: float = column(
        "N", "of its grid points alone, positive in compression. Attraction acts outside of the contact: all patches "
        "together carry more than the punch",
    )  # fmt: skip
    x: float = column("m", CENTRE)
    y: float = column("m", CENTRE)
    summits: int = column("", SITES_WITHIN, at_least=0)
    saddles: int = column("", SITES_WITHIN, at_least=0)
    valleys: int = column("", SITES_WITHIN, at_least=0)
    kind: str = column(
        "", "`summit`, `saddle` or `valley` for a patch with sites of one kind, `merged` with several, empty without "
        "any", one_of=(*KINDS, "merged", ""),
    )  # fmt: skip
    nearest: str = column(
        "", "kind of the site nearest to its centre; empty for a punch without sites", one_of=(*KINDS, "")
    )


@dataclass(frozen=True)
class SiteRow:
    """A site that joins the contact or leaves it."""

    time: float = column("s", AS_IN_CURVE, at_least=0.0, never_falls=True)
    displacement: float = column("m", AS_IN_CURVE)
    force: float = column("N", AS_IN_CURVE)
    phase: str = column("", AS_IN_CURVE, one_of=PHASES)
    kind: str = column("", "`summit`, `saddle` or `valley`", one_of=KINDS)
    site: int = column("", "number of the site", at_least=0)
    x: float = column("m", WHERE_IT_IS)
    y: float = column("m", WHERE_IT_IS)
    event: str = column("", "`joins` or `leaves`", one_of=(JOINS, LEAVES))
    in_contact: int = column("", "how many sites of this kind are in contact after this row", at_least=0)
    of: int = column("", "how many sites of this kind the punch has", at_least=0)


CURVE = Table("curve", CURVE_FILE, CurveRow)
ENERGY = Table("energy", ENERGY_FILE, EnergyRow)
EVENTS = Table("events", EVENTS_FILE, EventRow)
PATCHES = Table("patches", PATCHES_FILE, PatchRow)
SITES = Table("sites", SITES_FILE, SiteRow)
TABLES = (CURVE, ENERGY, EVENTS, PATCHES, SITES)
