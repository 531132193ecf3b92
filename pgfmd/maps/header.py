"""What the lines above the numbers of a map in a text file say: sizes, units, what means a missing pixel.

Programs write `# Width: 840.0 µm`, `"XY Calibration","693.7","nm"`, `x-length = 840`, `cellsize 35`, `Height [nm]`. A line about
a unit of length that is not understood is kept as a doubt, so that nobody takes micrometres for metres.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from .raw import Unit, unit_of

_NUMBER = r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
_KEY_AND_VALUE = re.compile(r"(?P<key>[^:=;,\t]*[^\W\d_][^:=;,\t]*?)\s*[:=;,\t]+\s*(?P<value>.*)")
_KEY_AND_NUMBER = re.compile(rf"(?P<key>[A-Za-z][\w -]*?)\s+(?P<value>{_NUMBER}\s*\S*)")
_UNIT_IN_KEY = re.compile(r"(?P<key>.*?)\s*(?:[\[(](?P<bracket>[^\])]*)[\])]|\s/\s*(?P<slash>\S+))\s*")
_QUANTITY = re.compile(rf"(?P<number>{_NUMBER})[\s,;\t]*(?P<unit>[^\d\s,;]\S*)?")
_HEIGHTS_IN = re.compile(
    r"\b(?:heights?|z|values?|data|topography|höhen?|hoehen?)\s*(?:\bin\s+|/\s*|[\[(]\s*)(?P<unit>[^\s\])(,;]+)",
    re.IGNORECASE,
)
_CHANNEL = re.compile(r"(?![xy]\b|lateral|width|scan|size)[^\d:=;,\[(]+[\[(](?P<unit>[^\])]+)[\])]", re.IGNORECASE)
"""The name of a channel with its unit, and nothing else."""
_LENGTH_UNIT = re.compile(
    r"(?<![^\W\d_])(?:(?:[nuµμm~?]m|Å)(?![^\W\d_]|[./-]?y)|angstrom|micron|(?:nano|micro|mikro|milli|[nuµμ])met(?:er|re))",
    re.IGNORECASE,
)
"""A unit of length in a line of words, other than the months of a date."""
_HEIGHT_WORDS = ("z", "height", "heights", "höhe", "höhen", "hoehe", "topography")

_NAMES = {
    "width": "width, x length, length x, x range, x size, size x, scan size x, x scan size, scan width, image width, breite, x extent, "
    "extent x, x amplitude, lx, xlength, xrange, xsize",
    "height": "height, y length, length y, y range, y size, size y, scan size y, y scan size, scan height, image height, höhe, hoehe, "
    "y extent, extent y, y amplitude, ly, ylength, yrange, ysize",
    "size": "scan size, scansize, scan range, image size, physical size, map size, field of view, fov, scan area, size",
    "pixel": "pixel size, pixelsize, xy calibration, lateral resolution, cellsize, cell size, pixel spacing, lateral sampling, "
    "sampling, point spacing, xy spacing, pixel pitch",
    "pixel x": "pixel size x, x pixel size, dx, x increment, increment x, x spacing, spacing x, x step, pixel width, xinc",
    "pixel y": "pixel size y, y pixel size, dy, y increment, increment y, y spacing, spacing y, y step, pixel height, yinc",
    "unit": "value units, value unit, z unit, z units, unit z, data unit, data units, height unit, height units, unit of heights, "
    "zunit, z einheit, z axis unit, units, unit, einheit",
    "lateral": "xy unit, xy units, x unit, y unit, unit xy, unit x, unit y, lateral unit, lateral units, xunit, yunit, x units, y units",
    "code": "nodata value, nodata, no data value, no data, missing value, missing, fill value, fillvalue, invalid value, invalid, "
    "void, bad value, undefined value",
    "columns": "ncols, columns, x pixels, x points, pixels x, points x",
    "rows": "nrows, rows, lines, y pixels, y points, pixels y, points y",
}  # fmt: skip
_MEANINGS = {name.strip(): meaning for meaning, names in _NAMES.items() for name in names.split(",")}
_OF_ALL = ("units", "unit", "einheit")
_OTHER_UNITS = re.compile(
    r"(?:[munpkMGµμ]?(?:V|A|N|Pa|Hz)|volts?|rad|mrad|deg|degrees?|grad|°|%|°C|eV|a\.?u\.?|arb\.?|lsb|counts?)",
    re.IGNORECASE,
)
"""Units of channels that hold no heights."""
_SIDES = ("width", "height")
_STEPS = ("pixel x", "pixel y")


@dataclass
class Header:
    """lengths: numbers with their units, by what they are: "width" and "height" of the map, "pixel x" and "pixel y"; unit
    of the heights; odd_unit: its name where it is none of length; lateral unit; codes that mean a missing pixel; doubts:
    lines about lengths that are not understood; common: the unit of all lengths, of a line such as "units: um"; names: all
    names of lines that are understood, as they are written, in small letters."""

    lengths: dict[str, tuple[float, Unit | None]] = field(default_factory=dict)
    unit: Unit | None = None
    odd_unit: str = ""
    lateral: Unit | None = None
    codes: list[float] = field(default_factory=list)
    doubts: list[str] = field(default_factory=list)
    common: Unit | None = None
    names: set[str] = field(default_factory=set)

    def size(self, shape: tuple[int, int]) -> tuple[tuple[float, float] | None, Unit | None]:
        """(x, y) of a map of so many rows and columns, and its unit, None where x or y has none; None for no size."""
        counts = shape[::-1]
        along_x, along_y = (
            self._side(side, step, count) for side, step, count in zip(_SIDES, _STEPS, counts, strict=True)
        )
        if along_x is None or along_y is None:
            return None, None
        (x, unit_x), (y, unit_y) = along_x, along_y
        if unit_x is None or unit_y is None:
            return (x, y), None
        return (x * unit_x.metres, y * unit_y.metres), Unit("m", 1.0)

    def _side(self, side: str, step: str, count: int) -> tuple[float, Unit | None] | None:
        if side in self.lengths:
            length, unit = self.lengths[side]
            # Without a unit it may be a number of pixels.
            if unit is not None or length != count:
                return length, unit or self.lateral
        if step in self.lengths:
            length, unit = self.lengths[step]
            return length * count, unit or self.lateral
        return None


def understood(lines: Sequence[str]) -> Header:
    """What lines say, without the marks of comments in front of them."""
    header = Header()
    for line in lines:
        text = " ".join(line.replace('"', " ").split(" ")).strip()
        if text and not _take(header, text) and _LENGTH_UNIT.search(text):
            header.doubts.append(text)
    return header


def _take(header: Header, text: str) -> bool:
    """Whether a line is understood; what it says goes into the header."""
    match = _KEY_AND_VALUE.fullmatch(text) or _KEY_AND_NUMBER.fullmatch(text)
    if match is None:
        return _take_unit(header, text)
    key, value = match["key"], match["value"].strip()
    split = _UNIT_IN_KEY.fullmatch(key)
    unit_of_key = (split["bracket"] or split["slash"] or "") if split else ""
    name = re.sub(r"[\s_\-]+", " ", split["key"] if split else key).strip().lower()
    meaning = _MEANINGS.get(name)
    if meaning in ("unit", "lateral"):
        return _take_name_of_unit(header, name, meaning, value)
    if name in _HEIGHT_WORDS and not _QUANTITY.search(value):
        # The name of a channel, perhaps with its unit.
        return _take_unit(header, f"{name} in {value.strip(' ,;')}") or _take_unit(header, text)
    numbers = [(_number(found["number"]), found["unit"] or "") for found in _QUANTITY.finditer(value)]
    if meaning is None or not numbers or not _QUANTITY.match(value):
        return _take_unit(header, text)
    header.names.add(name)
    if meaning == "code":
        header.codes.append(numbers[0][0])
        return True
    if meaning in ("columns", "rows"):
        return True
    lengths = [_with_unit(number, unit or unit_of_key) for number, unit in numbers[:2]]
    if None in lengths:
        return False
    return _take_lengths(header, meaning, lengths)


def _take_lengths(header: Header, meaning: str, lengths: list) -> bool:
    """One length for both sides, or one each; a scan size of one number is that of square pixels only: it is kept as both."""
    names = {"size": _SIDES, "pixel": _STEPS}.get(meaning, (meaning,))
    if len(names) == 1:
        lengths = lengths[:1]
    elif len(lengths) == 1:
        lengths = lengths * 2
    elif lengths[0][1] is None:
        # Of "10 x 5 um" the unit is that of both.
        lengths[0] = lengths[0][0], lengths[1][1]
    for name, length in zip(names, lengths, strict=True):
        header.lengths.setdefault(name, length)
    return True


def _take_name_of_unit(header: Header, name: str, meaning: str, text: str) -> bool:
    try:
        unit = unit_of(text)
    except ValueError:
        if meaning == "unit":
            header.odd_unit = text
        return meaning == "unit"
    if meaning == "unit":
        header.unit = unit
        header.common = unit if name in _OF_ALL else header.common
    else:
        header.lateral = unit
    return True


def _take_unit(header: Header, text: str) -> bool:
    """Whether a line names the unit of the heights, as "Height [nm]" or "z in um" does."""
    match = _HEIGHTS_IN.search(text) or _CHANNEL.fullmatch(text)
    if match is None:
        return False
    text = match["unit"].strip().rstrip(".:")
    try:
        header.unit = unit_of(text)
    except ValueError:
        if not is_other_unit(text):
            return False
        header.odd_unit = text
    return True


def is_other_unit(text: str) -> bool:
    """Whether a text is a unit of something other than a length, such as V or deg."""
    return _OTHER_UNITS.fullmatch(text.strip()) is not None


def _number(text: str) -> float:
    return float(text.replace(",", "."))


def _with_unit(number: float, unit: str) -> tuple[float, Unit | None] | None:
    """A length and its unit; None where the unit is none of length."""
    if not unit or unit in ("x", "×", "*", "px", "pixel", "pixels"):
        return number, None
    try:
        return number, unit_of(unit)
    except ValueError:
        return None
