"""Reading dynamic mechanical analysis (DMA): a table of frequency sweeps of E' and E'', at one temperature or several.

The file is a text with one header line that names quantity and unit of each column,

    frequency (Hz), E' (MPa), E'' (MPa), temperature (C)

separated by commas, semicolons or tabs (decimal commas are read with the latter two). A line of units below the header,
empty lines and lines starting with # are fine; columns with other names are passed over. Instead of E'' there may be
tan delta.
"""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import PgfmdError
from pgfmd.files.text import read_text
from pgfmd.units import UnitError, parse_quantity

ABSOLUTE_ZERO = -273.15
SAME_TEMPERATURE = 0.5  # K; a thermostat wanders by less, and steps of a temperature programme are larger
MOST_PROBLEMS = 5
EXAMPLE = "frequency (Hz), E' (MPa), E'' (MPa)"

NAMES = {
    "omega": ("omega", "ω", "w", "angular frequency", "angular freq"),
    "frequency": ("frequency", "freq", "f", "ν"),
    "storage": ("E'", "storage", "storage modulus", "E' storage modulus", "storage modulus E'", "E storage", "E prime"),
    "loss": ("E''", "loss", "loss modulus", "E'' loss modulus", "loss modulus E''", "E loss", "E double prime"),
    "tan delta": ("tan delta", "tan(delta)", "tan δ", "tan(δ)", "tandelta", "loss factor", "loss tangent"),
    "temperature": ("temperature", "temp", "temp.", "T"),
}
"""Column names by quantity. Those of one letter are taken as they are, the others in any case."""
SHEAR = ("G'", "G''")
PER_SECOND = {"rad/s": 1.0, "rad/sec": 1.0, "rad s^-1": 1.0, "rad·s^-1": 1.0, "1/s": 1.0, "s^-1": 1.0}
HERTZ = {"mHz": 1e-3, "Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9}
CELSIUS = ("C", "°C", "ºC", "℃", "degC", "deg C", "° C", "celsius")
KELVIN = ("K", "kelvin")


class MeasurementError(PgfmdError):
    """A file of measurements that can't be read, or from which nothing can be computed."""

    exit_code = 4


@dataclass(frozen=True, eq=False)
class Sweep:
    """A frequency sweep, sorted: omega (rad/s), storage and loss modulus (Pa), all of shape (M,); temperature (K)."""

    omega: NDArray
    storage: NDArray
    loss: NDArray
    temperature: float | None = None

    @property
    def kelvin(self) -> float:
        """The temperature [K], of a sweep that has one."""
        assert self.temperature is not None, "asked for without a temperature"
        return self.temperature


def read_dma(path: str | Path) -> list[Sweep]:
    """The sweeps of a file, one for each temperature, coldest first; one without temperature if it names none.

    Raises MeasurementError naming file, line, what was expected and a cure.
    """
    lines = _lines(Path(path))
    delimiter = next((mark for mark in "\t;," if mark in lines[0][1]), None)
    if delimiter is None:
        raise MeasurementError(
            f"{path}, line {lines[0][0]}: expected a header of several columns, such as {EXAMPLE}; "
            "separate columns by comma, semicolon or tab"
        )
    rows = [
        (number, [cell.strip() for cell in next(csv.reader([text], delimiter=delimiter))]) for number, text in lines
    ]
    (number, header), rows = rows[0], rows[1:]
    if any(_is_number(cell, delimiter) for cell in header):
        raise MeasurementError(
            f"{path}, line {number}: expected a header such as {EXAMPLE}, found numbers; name columns and units"
        )
    below = None
    units_are_named = any(_named(cell)[1] for cell in header)
    if rows and not units_are_named and not any(_is_number(cell, delimiter) for cell in rows[0][1]):
        below, rows = rows[0][1], rows[1:]
    columns = _columns(f"{path}, line {number}", header, below)
    return _isotherms(path, _values(path, rows, columns, delimiter))


def temperature_in_kelvin(text: str) -> float:
    """The temperature (K) of a text such as "25 C" or "298 K". Raises ValueError."""
    match = re.fullmatch(r"\s*([+-]?\d+(?:\.\d*)?)\s*(\S.*?)\s*", text)
    if match is None or match[2] not in (*CELSIUS, *KELVIN):
        raise ValueError(f"'{text}': expected a temperature with its unit, such as 25C or 298K")
    kelvin = float(match[1]) - (ABSOLUTE_ZERO if match[2] in CELSIUS else 0.0)
    if kelvin <= 0:
        raise ValueError(f"'{text}': expected a temperature above absolute zero")
    return kelvin


def _lines(path: Path) -> list[tuple[int, str]]:
    """Number and text of every line that is neither empty nor a comment."""
    try:
        text = read_text(path)
    except OSError as error:
        raise MeasurementError(f"{path}: could not be read: {error.strerror}") from None
    except ValueError:
        raise MeasurementError(f"{path}: expected a text file; export the measurement as CSV") from None
    lines = [(number, line) for number, line in enumerate(text.splitlines(), 1)]
    lines = [(number, line) for number, line in lines if line.strip(" \t;,") and not line.lstrip().startswith("#")]
    if not lines:
        raise MeasurementError(f"{path}: expected a table with the header {EXAMPLE}, found an empty file")
    return lines


def _number(cell: str, delimiter: str) -> float:
    return float(cell.replace(",", ".") if delimiter != "," else cell)


def _is_number(cell: str, delimiter: str) -> bool:
    try:
        _number(cell, delimiter)
    except ValueError:
        return False
    return True


def _quantity(name: str) -> str | None:
    """The key of NAMES that a column's name without unit means."""
    plain = re.sub(r"[\s_]+", " ", name.replace('"', "''")).strip()
    for mark, plainly in (("″", "''"), ("”", "''"), ("′", "'"), ("’", "'"), ("´", "'"), ("`", "'")):
        plain = plain.replace(mark, plainly)
    for quantity, names in NAMES.items():
        if plain in names or (len(plain) > 1 and plain.lower() in [known.lower() for known in names if len(known) > 1]):
            return quantity
    return next((shear for shear in SHEAR if plain.upper() == shear), None)


def _named(cell: str) -> tuple[str | None, str]:
    """(quantity, unit) of a header's cell: "E' (MPa)", "E' [MPa]", "E' / MPa", "E' MPa", "E'_MPa"; unit may be ""."""
    for pattern in (r"()(.*)", r"(.*?)\s*[(\[](.*)[)\]]", r"(.*?)\s+/\s+(.*)", r"(.*?)\s*,\s*(.*)", r"(.*)[\s_](\S+)"):
        match = re.fullmatch(pattern, cell.strip())
        if match is None:
            continue
        name, unit = (match[2], "") if pattern.startswith("()") else (match[1], match[2].strip())
        if quantity := _quantity(name):
            return quantity, unit
    return None, ""


def _columns(where: str, header: list[str], below: list[str] | None) -> dict[str, tuple[int, float]]:
    """Place and factor to SI (for degrees Celsius NaN) of the columns that are needed."""
    found: dict[str, tuple[int, str]] = {}
    for place, cell in enumerate(header):
        quantity, unit = _named(cell)
        if quantity in found:
            raise MeasurementError(
                f"{where}: expected one column with {quantity}, found '{header[found[quantity][0]]}' and '{cell}'; "
                "rename the one that is not to be used"
            )
        if quantity:
            unit = unit or (below[place].strip("()[] ") if below and place < len(below) else "")
            found[quantity] = place, unit
    wanted = ["omega" if "omega" in found else "frequency", "storage", "loss" if "loss" in found else "tan delta"]
    for quantity in wanted:
        if quantity not in found:
            name = {"frequency": "frequency or omega", "storage": "E'", "tan delta": "E'' or tan delta"}[quantity]
            cure = f"name the columns as in {EXAMPLE}"
            if any(shear in found for shear in SHEAR):
                cure = "G' and G'' are of shear: convert them by E = 2 (1 + nu) G, 3 G for an incompressible elastomer"
            raise MeasurementError(f"{where}: expected a column {name}, found {', '.join(header)}; {cure}")
    columns = {}
    for quantity in [*wanted, *(["temperature"] if "temperature" in found else [])]:
        place, unit = found[quantity]
        columns[quantity] = place, _factor(f"{where}, column '{header[place]}'", quantity, unit)
    return columns


def _factor(where: str, quantity: str, unit: str) -> float:
    """What a unit is in rad/s, Pa or K; NaN for degrees Celsius, which have no factor."""
    if quantity in ("omega", "frequency"):
        units = PER_SECOND | {name: 2 * np.pi * factor for name, factor in HERTZ.items()}
        plain = unit.replace("⁻¹", "^-1").replace("s-1", "s^-1")
        if not unit and quantity == "omega":
            return 1.0
        if plain in units:
            return units[plain]
        expected, example = "a unit of frequency: Hz, kHz, rad/s", f"{quantity} (Hz)"
    elif quantity == "temperature":
        if unit in CELSIUS:
            return np.nan
        if unit in KELVIN:
            return 1.0
        expected, example = "a unit of temperature: C or K", "temperature (C)"
    elif quantity == "tan delta":
        if unit in ("", "-", "1", "–"):
            return 1.0
        expected, example = "no unit", "tan delta"
    else:
        try:
            return parse_quantity(f"1 {unit}", "modulus")
        except UnitError:
            expected, example = (
                "a unit of modulus: Pa, kPa, MPa, GPa",
                {"storage": "E'", "loss": "E''"}[quantity] + " (MPa)",
            )
    found = f"found '{unit}'" if unit else "found none"
    raise MeasurementError(f"{where}: expected {expected}, {found}; write for instance {example}")


def _values(
    path: str | Path, rows: list[tuple[int, list[str]]], columns: dict[str, tuple[int, float]], delimiter: str
) -> dict[str, NDArray]:
    """The columns in SI units, checked; every wrong line is reported, up to a few."""
    values: dict[str, list[float]] = {quantity: [] for quantity in columns}
    problems = []
    for number, cells in rows:
        for quantity, (place, factor) in columns.items():
            cell = cells[place] if place < len(cells) else ""
            value = _number(cell, delimiter) if _is_number(cell, delimiter) else np.nan
            least = ABSOLUTE_ZERO if np.isnan(factor) else 0.0
            if not np.isfinite(value) or value < least or (value == least and quantity not in ("loss", "tan delta")):
                sign = "at or above 0" if quantity in ("loss", "tan delta") else f"above {least:g}"
                problems.append(f"{path}, line {number}: {quantity} = '{cell}': expected a number {sign}")
            values[quantity].append(value - ABSOLUTE_ZERO if np.isnan(factor) else factor * value)
    if problems:
        more = len(problems) - MOST_PROBLEMS
        tail = [f"... and {more} more like these"] if more > 0 else []
        cure = "correct or delete these lines; what lies below the instrument's resolution can't be fitted"
        raise MeasurementError("\n".join([*problems[:MOST_PROBLEMS], *tail, cure]))
    if not rows:
        raise MeasurementError(f"{path}: expected numbers below the header, found none")
    arrays = {quantity: np.array(column) for quantity, column in values.items()}
    if "tan delta" in arrays:
        arrays["loss"] = arrays["storage"] * arrays.pop("tan delta")
    if "frequency" in arrays:
        arrays["omega"] = arrays.pop("frequency")
    return arrays


def _isotherms(path: str | Path, values: dict[str, NDArray]) -> list[Sweep]:
    """Rows of the same temperature, put together and sorted by frequency."""
    temperature = values.get("temperature")
    if temperature is None:
        groups = [np.arange(values["omega"].size)]
    else:
        order = np.argsort(temperature, kind="stable")
        groups = np.split(order, np.flatnonzero(np.diff(temperature[order]) > SAME_TEMPERATURE) + 1)
    sweeps = []
    for group in groups:
        group = group[np.argsort(values["omega"][group], kind="stable")]
        mean = None
        if temperature is not None:
            mean = float(np.mean(temperature[group]))
            if np.ptp(temperature[group]) > 4 * SAME_TEMPERATURE:
                low, high = np.min(temperature[group]), np.max(temperature[group])
                raise MeasurementError(
                    f"{path}: expected frequency sweeps at fixed temperatures, found one that drifts from "
                    f"{low + ABSOLUTE_ZERO:.4g} to {high + ABSOLUTE_ZERO:.4g} C; steps between sweeps must be larger "
                    f"than {SAME_TEMPERATURE} K"
                )
        sweeps.append(Sweep(values["omega"][group], values["storage"][group], values["loss"][group], mean))
    return sweeps
