"""From a file of moduli to the [rheology] table of a scene: read, shift to one temperature, fit, write.

    material = characterise("dma.csv", reference_temperature=298.15)
    print(material.table())

All errors are `MeasurementError`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.errors import MeasurementError
from pgfmd.scene.fields import toml_text
from pgfmd.scene.model import LARGEST_MODULUS_RATIO

from .dma import INCOMPRESSIBLE, Moduli, Sweep, degrees, read_moduli, temperature_in_kelvin
from .moduli_columns import Kind
from .prony_fit import PronyFit, fit_series
from .relaxation_fit import RelaxationFit, fit_relaxation
from .temperature_shift import WLF, Superposition, master_curve, superpose

DIGITS = 6


@dataclass(frozen=True, eq=False)
class Material:
    """What a file of moduli says about an elastomer: its sweeps, if any, their shift, and the series fitted to them.

    left_out: sweeps that were not used, in words; notes: what was done to the moduli, or passed over in the file; unsure:
    what was taken for granted.
    """

    source: str
    sweeps: list[Sweep]
    fit: PronyFit | RelaxationFit
    wlf: WLF | None = None
    wlf_is_fitted: bool = False
    vertical: bool = False
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    unsure: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """Unit of temperatures for messages, "C" or "K", as in the file."""
        known = bool(self.sweeps) and self.sweeps[0].temperature is not None
        return self.sweeps[0].unit if known else "C"

    def shifts(self) -> list[float]:
        """log10 a_T of every sweep; 0 without a shift."""
        return [0.0 if self.wlf is None else float(self.wlf.log_shift(sweep.kelvin)) for sweep in self.sweeps]

    def report(self) -> Iterator[str]:
        """What was read, shifted and fitted, and how well, a line each."""
        fit, wlf = self.fit, self.wlf
        points = fit.time.size if isinstance(fit, RelaxationFit) else fit.omega.size
        yield f"{self.source}: {points} points from {_sweeps(self.sweeps)}"
        yield from self.notes
        for words in self.left_out:
            yield f"left out: {words}"
        if wlf is not None:
            how = "fitted" if self.wlf_is_fitted else "given"
            yield f"WLF, {how}: C1 = {wlf.C1:.4g}, C2 = {wlf.C2:.4g} K at {degrees(wlf.reference_temperature, self.unit)}"
            for sweep, shift in zip(self.sweeps, self.shifts(), strict=True):
                factor = sweep.kelvin / wlf.reference_temperature
                vertical = f", b_T = {factor:.4f}" if self.vertical else ""
                yield f"  {sweep.degrees}: a_T = {10**shift:.4g}{vertical}"
        yield from fit.report(wlf is not None)
        yield (
            f"relaxed modulus E(0) = {fit.static_modulus / 1e6:.4g} MPa, "
            f"E(infinity)/E(0) = {fit.series.kappa_inf:.4g}, so instantaneous modulus "
            f"{fit.static_modulus * fit.series.kappa_inf / 1e6:.4g} MPa"
        )

    def warnings(self) -> list[str]:
        """What a user should know before trusting the table."""
        texts = [*self.unsure, *self.fit.warnings()]
        if self.wlf is not None:
            temperatures, reference = [sweep.kelvin for sweep in self.sweeps], self.wlf.reference_temperature
            if not min(temperatures) <= reference <= max(temperatures) and self.wlf_is_fitted:
                texts.append(
                    f"the reference temperature {degrees(reference, self.unit)} lies outside the measured ones: "
                    "the master curve is extrapolated"
                )
        return texts

    def table(self) -> str:
        """The [rheology] table as TOML, with the report as comments."""
        lines = [f"# {line}" for line in self.report()] + [f"# warning: {line}" for line in self.warnings()]
        lines += ["", "# Put into [substrate] the relaxed (static) Young's modulus that belongs to this series:"]
        lines += [f'# youngs_modulus = "{self.youngs_modulus}"', "", "[rheology]"]
        for name, value in self.written_rheology().items():
            lines.append(f"{name} = {toml_text(value)}")
        return "\n".join([*lines, ""])

    @property
    def youngs_modulus(self) -> str:
        """The relaxed Young's modulus, as a scene takes it."""
        return f"{self.fit.static_modulus / 1e6:.{DIGITS}g} MPa"

    @property
    def rheology(self) -> dict[str, Any]:
        """The keys of [rheology], for `Scene(..., rheology=material.rheology)`. Weights are shares of the relaxed modulus
        that belongs to it, `fit.static_modulus` [Pa]."""
        series = self.fit.series
        if not series.elements:
            return {"model": "elastic"}
        kappa, tau = (list(map(float, values)) for values in (series.kappa, series.tau))
        return {"model": "prony", "reference": "relaxed", "kappa": kappa, "tau": tau}

    def written_rheology(self) -> dict[str, Any]:
        """The same as a scene's file has it, rounded, with units."""
        keys = self.rheology
        if "kappa" in keys:
            keys["kappa"] = [float(f"{weight:.{DIGITS}g}") for weight in keys["kappa"]]
            keys["tau"] = [f"{time:.{DIGITS}g} s" for time in keys["tau"]]
        return keys


def characterise(
    path: str | Path,
    elements: int | None = None,
    reference_temperature: float | None = None,
    wlf: tuple[float, float] | None = None,
    vertical: bool = False,
    modulus: Kind | None = None,
    poisson_ratio: float | None = None,
    usual_poisson_ratio: float = INCOMPRESSIBLE,
) -> Material:
    """Read a file of moduli, shift its sweeps to one temperature if there are several, and fit a series.

    elements: number of Maxwell elements, as few as serve if None. reference_temperature: K, needed for a shift.
    wlf: C1 and C2 (K), fitted if None. vertical: shift moduli by b_T = T/T_ref, too. modulus, poisson_ratio and
    usual_poisson_ratio: as for `dma.read_moduli`. Raises MeasurementError.
    """
    moduli = read_moduli(path, modulus, poisson_ratio, usual_poisson_ratio)
    _confirm_temperatures(path, moduli, reference_temperature, wlf)
    if vertical and wlf is None and len(moduli.sweeps) < 2:
        cure = "leave out --vertical-shift, or give --wlf C1,C2 and --reference-temperature"
        raise MeasurementError(
            f"{path}: expected sweeps at several temperatures for a vertical shift, found one; {cure}"
        )
    try:
        found = _fitted(moduli, elements, reference_temperature, wlf, vertical)
    except ValueError as error:
        raise MeasurementError(f"{path}: {error}") from None
    if found.fit.series.kappa_inf > LARGEST_MODULUS_RATIO * (1 - 10.0 ** (1 - DIGITS)):
        raise MeasurementError(
            f"{path}: E(infinity)/E(0) = {found.fit.series.kappa_inf:.3g}, a scene takes at most {LARGEST_MODULUS_RATIO:g}; "
            "leave out the highest frequencies, or measure E(0) at lower ones"
        )
    return replace(found, source=Path(path).name, notes=moduli.notes, unsure=moduli.unsure)


def fit_prony(
    path: str | Path,
    elements: int | None = None,
    temperature: float | str | None = None,
    wlf: tuple[float, float] | str | None = None,
    vertical_shift: bool = False,
    modulus: Kind | None = None,
    poisson_ratio: float | None = None,
) -> Material:
    """Fits a Prony series to measured moduli, or to a relaxation; as `pgfmd fit-prony`. `plot_fit` draws it.

    Args:
        path: a file with columns of frequency, E', E'' (or G', G''), and temperature if there are several; or of time and E.
        elements: number of Maxwell elements; None for as few as serve.
        temperature: of the tack test, in K, or a text such as "25C"; needed for sweeps at several temperatures.
        wlf: constants C1 and C2 [K], also as a text "8.86,101.6"; fitted if None.
        vertical_shift: whether moduli are divided by T/T_ref, too.
        modulus: "tensile" or "shear", where the names of the columns don't say it.
        poisson_ratio: by which shear moduli become Young's; 0.5 if None.

    Raises:
        MeasurementError: if the file can't be read, or no series fits; ValueError: for a text that is no temperature, or
        no constants.
    """
    kelvin = temperature_in_kelvin(temperature) if isinstance(temperature, str) else temperature
    constants = wlf_constants(wlf) if isinstance(wlf, str) else wlf
    return characterise(path, elements, kelvin, constants, vertical_shift, modulus, poisson_ratio)


def _fitted(
    moduli: Moduli, elements: int | None, reference: float | None, wlf: tuple[float, float] | None, vertical: bool
) -> Material:
    """The series of the moduli, after a shift if there is one. Raises ValueError."""
    if moduli.relaxation is not None:
        return Material("", [], fit_relaxation(moduli.relaxation.time, moduli.relaxation.modulus, elements))
    sweeps, law = moduli.sweeps, None
    left_out: tuple[str, ...] = ()
    if reference is not None and wlf is not None:
        law = WLF(*wlf, reference, sweeps[0].unit)
    elif reference is not None and len(sweeps) > 1:
        found: Superposition = superpose(sweeps, reference, vertical)
        sweeps, law, left_out = found.sweeps, found.wlf, found.left_out
    data = sweeps[0] if law is None else master_curve(sweeps, law, vertical)
    fit = fit_series(data.omega, data.storage, data.loss, elements)
    return Material("", sweeps, fit, law, law is not None and wlf is None, vertical, left_out)


def _confirm_temperatures(
    path: str | Path, moduli: Moduli, reference: float | None, wlf: tuple[float, float] | None
) -> None:
    """Refuse sweeps at several temperatures without a reference, and a shift without temperatures."""
    sweeps = moduli.sweeps
    if moduli.relaxation is not None:
        if reference is not None or wlf is not None:
            cure = "leave out --reference-temperature and --wlf"
            raise MeasurementError(f"{path}: a relaxation at one temperature is not shifted; {cure}")
        return
    if sweeps[0].temperature is None:
        if reference is not None or wlf is not None:
            cure = "add a column such as temperature (C), or leave out --reference-temperature and --wlf"
            raise MeasurementError(f"{path}: expected temperatures for a shift, found no such column; {cure}")
        return
    found = ", ".join(sweep.degrees for sweep in sweeps)
    if reference is None and (len(sweeps) > 1 or wlf is not None):
        raise MeasurementError(
            f"{path}: expected --reference-temperature, that of the elastomer in the tack test, for sweeps at {found}"
        )
    if len(sweeps) == 1 and wlf is None and reference is not None and abs(reference - sweeps[0].temperature) > 1.0:
        raise MeasurementError(
            f"{path}: one sweep at {found} can't be shifted to {degrees(reference, sweeps[0].unit)} without constants; "
            "give --wlf C1,C2"
        )


def _sweeps(sweeps: list[Sweep]) -> str:
    if not sweeps:
        return "a relaxation"
    if sweeps[0].temperature is None:
        return "one sweep"
    if len(sweeps) == 1:
        return f"one sweep at {sweeps[0].degrees}"
    return f"{len(sweeps)} sweeps at {sweeps[0].degrees} to {sweeps[-1].degrees}"


def wlf_constants(text: str) -> tuple[float, float]:
    """C1 and C2 (K) of a text such as "8.86,101.6". Raises ValueError."""
    try:
        C1, C2 = (float(part) for part in text.split(","))
        if np.isfinite([C1, C2]).all() and C1 > 0 and C2 > 0:
            return C1, C2
    except ValueError:
        pass
    raise ValueError(f"'{text}': expected two positive numbers, C1 and C2 in K, such as 8.86,101.6")
