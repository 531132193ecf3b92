"""Results of an analysis as sections of named numbers: a table for readers and a record for programs."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

from pgfmd import sections
from pgfmd.files.storage import plain

SUFFIXES = {
    "N": "N", "m": "m", "J": "J", "s": "s", "N/m": "N_per_m", "m^2": "m2", "J/m^2": "J_per_m2", "Pa": "Pa", "m/s": "m_per_s",
    "1/m": "per_m", "rad/s": "rad_per_s", "Hz": "Hz",
}  # fmt: skip
"""Units at the end of keys of a record."""


@dataclass(frozen=True)
class Row:
    """One number: key of the record, without unit; name, value, SI unit, note, and its uncertainty in this unit, None
    if unknown."""

    key: str
    name: str
    value: float | int | str | None
    unit: str = ""
    note: str = ""
    uncertainty: float | None = None


@dataclass
class Table:
    """Sections of rows by title. remarks: limitations of the numbers."""

    title: str = ""
    sections: dict[str, list[Row]] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)

    def add(
        self, section: str, key: str, name: str, value: float | int | str | None, unit: str = "", note: str = "",
        uncertainty: float | None = None,
    ) -> None:  # fmt: skip
        """Adds a row; a section begins with its first row."""
        if value is None:
            uncertainty = None
        if uncertainty:
            # Plain characters: a terminal may have no others.
            note = f"± {uncertainty:.2g}, {note}" if note else f"± {uncertainty:.2g}"
        self.sections.setdefault(section, []).append(Row(key, name, value, unit, note, uncertainty))

    def __getitem__(self, key: str) -> Any:
        """The value of a row, by its key without unit. KeyError if there is none."""
        for rows in self.sections.values():
            for row in rows:
                if row.key == key:
                    return row.value
        raise KeyError(key)

    def __contains__(self, key: str) -> bool:
        return any(row.key == key for rows in self.sections.values() for row in rows)

    def record(self) -> dict:
        """Nested dicts for JSON: section, then key with its unit, as in `pull_off_force_N`, and where one is known
        `pull_off_force_uncertainty_N`; None if there is none."""
        found: dict[str, Any] = {"title": self.title}
        for section, rows in self.sections.items():
            entries = found[re.sub(r"\W+", "_", section.lower())] = {}
            for row in rows:
                suffix = f"_{SUFFIXES[row.unit]}" if row.unit else ""
                entries[f"{row.key}{suffix}"] = row.value
                if row.uncertainty is not None:
                    entries[f"{row.key}_uncertainty{suffix}"] = row.uncertainty
        found["remarks"] = self.remarks
        return plain(found)


def show(table: Table) -> None:
    """Print on standard output."""
    sections.show(table.title, table.sections, [("note", "", text) for text in table.remarks], digits=5)
