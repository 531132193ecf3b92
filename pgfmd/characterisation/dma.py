"""Reading measured moduli: frequency sweeps of dynamic mechanical analysis (DMA), or a relaxation, from a table.

The file is a text with a line that names quantity and unit of each column (files/text_table.py says how free it may be),

    frequency (Hz), E' (MPa), E'' (MPa), temperature (C)

for sweeps at one temperature or several; instead of E'' there may be tan delta or the phase angle, and instead of E' the
complex modulus E*. A relaxation has the columns time and E. Shear moduli G become tensile ones, E = 2 (1 + nu) G.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pgfmd.errors import MeasurementError
from pgfmd.files.column_names import Vocabulary, bare_unit, usual_unit
from pgfmd.files.number_block import read_number_block
from pgfmd.files.text_table import TextTable, read_table
from pgfmd.units import UnitError, parse_quantity

from .moduli_columns import ABSOLUTE_ZERO, CELSIUS, CYCLES, EXAMPLE, KELVIN, NAMES, PER_SECOND, Chosen, Kind, choose

SAME_TEMPERATURE = 0.5  # K; a thermostat wanders by less, and steps of a temperature programme are larger
SOFTEST, STIFFEST = 10.0, 2e12
"""Moduli [Pa] beyond which no solid is: a file that has none between them has another unit."""
INCOMPRESSIBLE = 0.5
CONTRADICTION = 0.05
"""How far E''/E' of a file may be from its tan delta."""
HEADERLESS = {".tts": ("omega", "storage", "loss"), ".gt": ("time", "relaxation"), ".osc": ("omega", "storage", "loss")}
"""Columns of RepTate's files by their names' ends; the format has them in rad/s, s and Pa, of shear."""


@dataclass(frozen=True, eq=False)
class Sweep:
    """A frequency sweep, sorted: omega (rad/s), storage and loss modulus (Pa), all of shape (M,); temperature (K), None
    where it is not known; unit: "C" or "K", in which the file has it."""

    omega: NDArray
    storage: NDArray
    loss: NDArray
    temperature: float | None = None
    unit: str = "K"

    @property
    def kelvin(self) -> float:
        """The temperature [K], of a sweep that has one."""
        assert self.temperature is not None, "asked for without a temperature"
        return self.temperature

    @property
    def degrees(self) -> str:
        """The temperature as the file has it, for messages."""
        return degrees(self.temperature, self.unit)


@dataclass(frozen=True, eq=False)
class Relaxation:
    """A stress relaxation, sorted: time (s) after the strain was applied, and modulus (Pa), both of shape (M,)."""

    time: NDArray
    modulus: NDArray


@dataclass(frozen=True, eq=False)
class Moduli:
    """What a file holds: sweeps, coldest first, or a relaxation; Young's moduli. notes: what was done to them, or passed
    over. unsure: what was taken for granted, as no name says it."""

    sweeps: list[Sweep]
    relaxation: Relaxation | None = None
    notes: tuple[str, ...] = ()
    unsure: tuple[str, ...] = ()


def read_moduli(
    path: str | Path,
    modulus: Kind | None = None,
    poisson_ratio: float | None = None,
    usual_poisson_ratio: float = INCOMPRESSIBLE,
) -> Moduli:
    """The moduli of a file: sweeps, one for each temperature, or a relaxation.

    modulus: "shear" or "tensile", where the names of the columns don't say. poisson_ratio: of shear moduli, E = 2 (1 +
    nu) G; the usual one if None. Raises MeasurementError naming file, line, what was expected and a cure.
    """
    path = Path(path)
    unsure: tuple[str, ...] = ()
    if path.suffix.lower() in HEADERLESS and (known := _reptate(path)):
        values, notes = known
        kind: Kind = "shear"
        if modulus == "tensile":
            raise MeasurementError(f"{path}: a {path.suffix} file holds shear moduli; leave out --modulus tensile")
        unit = "C"
    else:
        table = read_table(path, Vocabulary(NAMES), EXAMPLE)
        chosen = choose(table, modulus)
        values, kind, unit = _values(table, chosen), chosen.kind, _unit_of(chosen)
        notes, unsure = table.notes, _unsure(chosen, modulus)
    if poisson_ratio is not None and kind == "tensile":
        raise MeasurementError(
            f"{path}: these are tensile moduli, which need no Poisson's ratio; leave out --poisson, or say --modulus shear"
        )
    if kind == "shear":
        nu = usual_poisson_ratio if poisson_ratio is None else poisson_ratio
        notes = (*notes, f"shear moduli, as Young's: E = 2 (1 + nu) G with nu = {nu:g}")
        for part in {"storage", "loss", "relaxation"} & values.keys():
            values[part] = 2.0 * (1.0 + nu) * values[part]
    _refuse_other_units(path, values)
    if "time" in values:
        relaxation, passed = _relaxation(path, values, unit)
        return Moduli([], relaxation, (*notes, *passed), unsure)
    return Moduli(_isotherms(path, values, unit), None, notes, unsure)


def temperature_in_kelvin(text: str) -> float:
    """The temperature (K) of a text such as "25 C" or "298 K". Raises ValueError."""
    match = re.fullmatch(r"\s*([+-]?\d+(?:\.\d*)?)\s*(\S.*?)\s*", text)
    if match is None or match[2] not in (*CELSIUS, *KELVIN):
        raise ValueError(f"'{text}': expected a temperature with its unit, such as 25C or 298K")
    kelvin = float(match[1]) - (ABSOLUTE_ZERO if match[2] in CELSIUS else 0.0)
    if kelvin <= 0:
        raise ValueError(f"'{text}': expected a temperature above absolute zero")
    return kelvin


def degrees(kelvin: float | None, unit: str = "C") -> str:
    """A temperature in the unit "C" or "K", for messages."""
    if kelvin is None:
        return "an unknown temperature"
    return f"{kelvin + ABSOLUTE_ZERO + 0.0:.4g} C" if unit == "C" else f"{kelvin:.5g} K"


def _reptate(path: Path) -> tuple[dict[str, NDArray], tuple[str, ...]] | None:
    """The columns of a file of RepTate that names no units: parameters in its first line, numbers below. None where a line
    above the numbers has units, or a frequency, whose unit may be Hz."""
    block = read_number_block(path)
    names = HEADERLESS[path.suffix.lower()]
    parameters = dict(
        part.partition("=")[::2] for part in (block.preamble or ("",))[0].strip().split(";") if "=" in part
    )
    if len(block.preamble) > 2 or block.values.shape[1] < len(names) or any(map(_has_units, block.preamble)):
        return None
    values = dict(zip(names, block.values.T, strict=False))
    if not all(np.isfinite(column).all() for column in values.values()):
        raise MeasurementError(
            f"{path}: expected numbers in its first {len(names)} columns; complete or delete the others"
        )
    notes: tuple[str, ...] = (
        f"{path.suffix} file: columns {', '.join(names)} in the units of RepTate (rad/s, s, Pa, C)",
    )
    try:
        if "T" in parameters:
            values["temperature"] = np.full(len(block.values), float(parameters["T"]) - ABSOLUTE_ZERO)
        if (strain := float(parameters.get("gamma", 1.0))) not in (0.0, 1.0):
            values["relaxation"] = values["relaxation"] / strain
            notes = (*notes, f"stress over the strain gamma = {strain:g} of its first line")
    except (ValueError, KeyError):
        raise MeasurementError(
            f"{path}, line 1: expected parameters such as T=25;gamma=1; found {block.preamble[0].strip()}"
        ) from None
    return values, notes


def _has_units(line: str) -> bool:
    """Whether a line above numbers names a unit of modulus, frequency or time, or a frequency."""
    words = [bare_unit(word) for word in re.split(r"[\s;,]+|(?<=[^\W\d_]|['\")])(?=[(\[])", line)]
    # After a slash as in "G'/kPa".
    words += [word.partition("/")[2].strip("()[]") for word in words if "/" in word]
    return any(map(_is_unit, words)) or any(
        found.quantity == "frequency" for word in words if (found := Vocabulary(NAMES).named(word))
    )


def _is_unit(word: str) -> bool:
    if word in CYCLES or word in PER_SECOND:
        return True
    for dimension in ("modulus", "time"):
        # "h" and "d" are units as well, but no word of a header that is one letter says so.
        if len(word) > 1 or word == "s":
            with contextlib.suppress(UnitError):
                parse_quantity(f"1 {usual_unit(word)}", dimension)
                return True
    return False


def _unsure(chosen: Chosen, modulus: Kind | None) -> tuple[str, ...]:
    if chosen.named or modulus is not None:
        return ()
    titles = " and ".join(
        f"'{c.title}'" for q, c in chosen.columns.items() if q in ("storage", "loss", "complex", "relaxation")
    )
    return (
        f"{titles} are called by neither E nor G and are taken for tensile moduli; if they are of shear (a rotational "
        "rheometer's are), give --modulus shear, else E is a third of what it should be",
    )


def _unit_of(chosen: Chosen) -> str:
    return "C" if np.isnan(chosen.factors.get("temperature", 1.0)) else "K"


def _values(table: TextTable, chosen: Chosen) -> dict[str, NDArray]:
    """omega, storage and loss, or time and relaxation, and temperature, in SI units; every wrong line is reported."""
    found = table.numbers(chosen.columns)
    problems: list[str] = []
    for row, (line, cells) in enumerate(table.rows):
        for quantity, column in chosen.columns.items():
            value, factor = found[quantity][row], chosen.factors[quantity]
            least = ABSOLUTE_ZERO if np.isnan(factor) else 0.0
            at_least = quantity in ("loss", "tan delta", "phase", "time")
            if not np.isfinite(value) or value < least or (value == least and not at_least):
                cell = cells[column.place] if column.place < len(cells) else ""
                sign = "at or above 0" if at_least else f"above {least:g}"
                name = quantity.split()[-1] if quantity != "tan delta" else quantity
                problems.append(f"line {line}: {name} = '{cell}': expected a number {sign}")
    if problems:
        raise table.refuse(problems, "; what lies below the instrument's resolution can't be fitted")
    values = {
        quantity: found[quantity] - ABSOLUTE_ZERO if np.isnan(factor) else factor * found[quantity]
        for quantity, factor in chosen.factors.items()
    }
    return _storage_and_loss(table, values)


def _storage_and_loss(table: TextTable, values: dict[str, NDArray]) -> dict[str, NDArray]:
    """With E' and E'' from whatever says them: tan delta or phase angle, and the size of the complex modulus."""
    if "frequency" in values:
        rate = values.pop("frequency")
        if np.max(np.abs(rate / values.setdefault("omega", rate) - 1.0)) > CONTRADICTION:
            raise MeasurementError(
                f"{table.where}: expected an angular frequency of 2 pi times the frequency, the columns differ by other "
                "factors; delete the wrong one"
            )
    ratio = values.pop("tan delta", None)
    if "phase" in values:
        phase = values.pop("phase")
        if np.any(phase >= 0.5 * np.pi):
            raise MeasurementError(
                f"{table.where}: expected phase angles below 90°, found {np.degrees(phase.max()):.4g}°"
            )
        ratio = np.tan(phase)
    if ratio is not None and "complex" in values:
        values["storage"] = values.pop("complex") / np.sqrt(1.0 + ratio**2)
    if ratio is not None and "loss" not in values:
        values["loss"] = values["storage"] * ratio
    elif ratio is not None:
        own = values["loss"] / values["storage"]
        off = float(np.median(np.abs(own / np.maximum(ratio, 1e-9) - 1.0)))
        if off > CONTRADICTION:
            raise MeasurementError(
                f"{table.where}: expected tan delta to be the loss over the storage modulus, it is off by a factor of "
                f"{float(np.median(own / np.maximum(ratio, 1e-9))):.3g}; look at the units of both moduli, or delete the "
                "column of tan delta"
            )
    return values


def _refuse_other_units(path: Path, values: dict[str, NDArray]) -> None:
    """Raises MeasurementError for moduli that no solid has."""
    modulus = values["relaxation" if "time" in values else "storage"]
    largest = float(np.max(modulus))
    if not SOFTEST <= largest <= STIFFEST:
        what = "softer than any gel" if largest < SOFTEST else "stiffer than diamond"
        raise MeasurementError(
            f"{path}: expected moduli of a solid, the largest is {largest:.3g} Pa, {what}; look at the unit: mPa is a "
            "thousandth of a pascal, MPa a million"
        )


def _relaxation(path: Path, values: dict[str, NDArray], unit: str) -> tuple[Relaxation, tuple[str, ...]]:
    """A relaxation at one temperature, without rows at time 0, at which nothing has begun. Raises MeasurementError."""
    temperature = values.get("temperature")
    if temperature is not None and np.ptp(temperature) > 4 * SAME_TEMPERATURE:
        low, high = (degrees(float(edge), unit) for edge in (np.min(temperature), np.max(temperature)))
        raise MeasurementError(
            f"{path}: expected a relaxation at one temperature, found {low} to {high}; put each into a file of its own"
        )
    order = np.argsort(values["time"], kind="stable")
    time, modulus = values["time"][order], values["relaxation"][order]
    begun = time > 0.0
    notes = () if begun.all() else (f"passed over {np.sum(~begun)} of {begun.size} rows, at time 0",)
    if not begun.any() or modulus[begun][-1] > 1.02 * np.max(modulus[begun][: max(1, begun.sum() // 10)]):
        raise MeasurementError(
            f"{path}: expected a modulus that falls with time, it rises; a relaxation is the stress over a strain that is "
            "held, from the moment when the strain is reached"
        )
    return Relaxation(time[begun], modulus[begun]), notes


def _isotherms(path: Path, values: dict[str, NDArray], unit: str) -> list[Sweep]:
    """Rows of the same temperature, put together and sorted by frequency."""
    temperature = values.get("temperature")
    if temperature is None:
        groups: Sequence[NDArray] = [np.arange(values["omega"].size)]
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
                low, high = (
                    degrees(float(edge), unit) for edge in (np.min(temperature[group]), np.max(temperature[group]))
                )
                raise MeasurementError(
                    f"{path}: expected frequency sweeps at fixed temperatures, found one that drifts from "
                    f"{low} to {high}; steps between sweeps must be larger than {SAME_TEMPERATURE} K"
                )
        sweeps.append(Sweep(values["omega"][group], values["storage"][group], values["loss"][group], mean, unit))
    return sweeps
