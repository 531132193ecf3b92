"""Names and units of columns, as headers of tables write them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from .numerals import is_numeral

Names = Mapping[str, Sequence[str]]
"""Names of columns by what they hold. Those of one letter are taken as they are, others in any case."""

_SPLITS = (
    # Name and unit of "E' (MPa)", "G' (elastic) (Pa)", "E' / MPa", "E'/MPa", "E', MPa", "force in mN", "E'_MPa", "E' MPa".
    re.compile(r"(.*?)\s*[(\[]([^()\[\]]*)[)\]]"),
    re.compile(r"(.*\S)\s*[(\[]([^()\[\]]*)[)\]]"),
    re.compile(r"(.*?)\s+/\s+(.*)"),
    re.compile(r"(.*?)/(.*)"),
    re.compile(r"(.*?)\s*,\s*(.*)"),
    re.compile(r"(.*?)\s+in\s+(\S+)"),
    re.compile(r"(.*)[\s_](\S+)"),
)
_PRIMES = str.maketrans({"″": "''", "”": "''", "“": "''", "′": "'", "’": "'", "´": "'", "`": "'", '"': "''"})
_SPELLINGS = {"pa": "Pa", "kpa": "kPa", "gpa": "GPa", "MPA": "MPa", "hz": "Hz", "khz": "kHz", "ghz": "GHz"}
"""Units in other capitals that can mean one thing only; mpa can be MPa and mPa."""
_NO_UNIT = ("-", "–", "—", "1", "_", "")


@dataclass(frozen=True)
class Named:
    """What a title says: quantity, a key of the names that were asked for; unit, "" for none; part of the measurement that
    the column belongs to, such as "approach", "" for all."""

    quantity: str
    unit: str
    part: str = ""


@dataclass(frozen=True)
class Column(Named):
    """A column whose name is known: place, from 0; title, as the header has it."""

    place: int = -1
    title: str = ""


class Vocabulary:
    """Known names of columns, and words in titles that tell the part of a measurement, such as "retract"."""

    def __init__(self, names: Names, parts: Names | None = None):
        self._names = {_key(known): quantity for quantity, several in names.items() for known in several}
        self._parts = {word.lower(): part for part, words in (parts or {}).items() for word in words}
        words = "|".join(sorted(map(re.escape, self._parts), key=len, reverse=True))
        self._word = re.compile(rf"(?:^|(?<=[\s_]))({words})(?=$|[\s_(\[/,:-])[\s_:-]*", re.I) if words else None

    def named(self, title: str) -> Named | None:
        """What a title says; None for a name that is not known."""
        text = title.strip(" \t:\u00a0\ufeff")
        if found := self._plainly(text):
            return found
        match = self._word.search(text) if self._word else None
        if match is None:
            return None
        found = self._plainly(f"{text[: match.start()]}{text[match.end() :]}".strip(" _:-"))
        return Named(found.quantity, found.unit, self._parts[match[1].lower()]) if found else None

    def part(self, text: str) -> str:
        """The part of a measurement that a cell names, "" for none."""
        match = self._word.search(text.strip()) if self._word else None
        return self._parts[match[1].lower()] if match else ""

    def count(self, cells: Sequence[str]) -> int:
        """How many quantities the cells of a line name; 0 of a line of numbers."""
        if sum(map(is_numeral, cells)) > 1:
            return 0
        return len({found.quantity for cell in cells if cell and (found := self.named(cell))})

    def _plainly(self, text: str) -> Named | None:
        if quantity := self._names.get(_key(text)):
            return Named(quantity, "")
        for split in _SPLITS:
            match = split.fullmatch(text)
            if match and (quantity := self._names.get(_key(match[1]))):
                return Named(quantity, bare_unit(match[2]))
        return None


def _key(name: str) -> str:
    """A name without differences that don't count: primes, blanks and underscores, and capitals unless it is a letter."""
    text = re.sub(r"[\s_]+", " ", name.translate(_PRIMES)).strip(" .:")
    return text if len(text) < 2 else text.lower()


def bare_unit(text: str) -> str:
    """The unit of a cell of a line of units, or behind a name: without brackets; "" for a dash."""
    # The circumflex is what is left of a text in UTF-8 that was taken for Windows-1252 once.
    unit = text.strip(" \t\"'\u00a0").strip("()[]").strip().replace("\u00c2", "")
    return "" if unit in _NO_UNIT else unit


def usual_unit(unit: str) -> str:
    """A unit as `units.parse_quantity` reads it: "N/mm2" and "N/mm²" as "N/mm^2", "kpa" as "kPa"."""
    text = re.sub(r"(?<=[^\W\d_])([23])(?!\d)", r"^\1", unit.strip().rstrip("."))
    return _SPELLINGS.get(text, text)
