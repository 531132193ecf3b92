"""From a DMA file to the [rheology] table of a scene: read, shift to one temperature, fit, write.

    material = characterise("dma.csv", reference_temperature=298.15)
    print(material.table())

All errors are `MeasurementError`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pgfmd.scene.model import LARGEST_MODULUS_RATIO

from .dma import ABSOLUTE_ZERO, MeasurementError, Sweep, read_dma, temperature_in_kelvin
from .prony_fit import PronyFit, fit_series
from .temperature_shift import WLF, fit_wlf, master_curve

DIGITS = 6


@dataclass(frozen=True, eq=False)
class Material:
    """What a DMA file says about an elastomer: its sweeps, their shift if any, and the series fitted to them."""

    source: str
    sweeps: list[Sweep]
    fit: PronyFit
    wlf: WLF | None = None
    wlf_is_fitted: bool = False
    vertical: bool = False

    def shifts(self) -> list[float]:
        """log10 a_T of every sweep; 0 without a shift."""
        return [0.0 if self.wlf is None else float(self.wlf.log_shift(sweep.kelvin)) for sweep in self.sweeps]

    @property
    def rheology(self) -> dict[str, Any]:
        """The keys of [rheology], for `Scene(..., rheology=material.rheology)`. The static modulus that belongs to it is
        `fit.static_modulus` [Pa]."""
        series = self.fit.series
        if not series.elements:
            return {"model": "elastic"}
        return {"model": "prony", "kappa": list(map(float, series.kappa)), "tau": list(map(float, series.tau))}

    def report(self) -> Iterator[str]:
        """What was read, shifted and fitted, and how well, a line each."""
        fit, wlf = self.fit, self.wlf
        yield f"{self.source}: {fit.omega.size} points from {_sweeps(self.sweeps)}"
        if wlf is not None:
            how = "fitted" if self.wlf_is_fitted else "given"
            yield f"WLF, {how}: C1 = {wlf.C1:.4g}, C2 = {wlf.C2:.4g} K at {_celsius(wlf.reference_temperature)}"
            for sweep, shift in zip(self.sweeps, self.shifts(), strict=True):
                factor = sweep.kelvin / wlf.reference_temperature
                vertical = f", b_T = {factor:.4f}" if self.vertical else ""
                yield f"  {_celsius(sweep.kelvin)}: a_T = {10**shift:.4g}{vertical}"
        what = "master curve" if wlf is not None else "frequencies"
        yield f"{what}: {fit.omega[0]:.3g} to {fit.omega[-1]:.3g} rad/s, {fit.decades:.1f} decades"
        size, modulus, omega = fit.largest
        yield (
            f"fit of {fit.series.elements} elements: misfit {100 * fit.rms:.2g} % rms, "
            f"largest {100 * size:.2g} % ({modulus} at {omega:.3g} rad/s)"
        )
        yield f"E(0) = {fit.static_modulus / 1e6:.4g} MPa, E(infinity)/E(0) = {fit.series.kappa_inf:.4g}"

    def warnings(self) -> list[str]:
        """What a user should know before trusting the table."""
        texts = self.fit.warnings()
        if self.wlf is not None:
            temperatures, reference = [sweep.kelvin for sweep in self.sweeps], self.wlf.reference_temperature
            if not min(temperatures) <= reference <= max(temperatures) and self.wlf_is_fitted:
                texts.append(
                    f"the reference temperature {_celsius(reference)} lies outside the measured ones: "
                    "the master curve is extrapolated"
                )
        return texts

    def table(self) -> str:
        """The [rheology] table as TOML, with the report as comments."""
        fit = self.fit
        lines = [f"# {line}" for line in self.report()] + [f"# warning: {line}" for line in self.warnings()]
        lines += ["", "# Put into [substrate] the static modulus that belongs to this series:"]
        lines += [f'# youngs_modulus = "{fit.static_modulus / 1e6:.{DIGITS}g} MPa"', "", "[rheology]"]
        if not fit.series.elements:
            return "\n".join([*lines, 'model = "elastic"', ""])
        kappa = ", ".join(f"{weight:.{DIGITS}g}" for weight in fit.series.kappa)
        tau = ", ".join(f'"{time:.{DIGITS}g} s"' for time in fit.series.tau)
        return "\n".join([*lines, 'model = "prony"', f"kappa = [{kappa}]", f"tau = [{tau}]", ""])


def characterise(
    path: str | Path,
    elements: int | None = None,
    reference_temperature: float | None = None,
    wlf: tuple[float, float] | None = None,
    vertical: bool = False,
) -> Material:
    """Read a DMA file, shift its sweeps to one temperature if there are several, and fit a series.

    elements: number of Maxwell elements, as few as serve if None. reference_temperature: K, needed for a shift.
    wlf: C1 and C2 (K), fitted if None. vertical: shift moduli by b_T = T/T_ref, too.
    Raises MeasurementError.
    """
    sweeps = read_dma(path)
    _confirm_temperatures(path, sweeps, reference_temperature, wlf)
    if vertical and wlf is None and len(sweeps) == 1:
        cure = "leave out --vertical-shift, or give --wlf C1,C2 and --reference-temperature"
        raise MeasurementError(
            f"{path}: expected sweeps at several temperatures for a vertical shift, found one; {cure}"
        )
    try:
        shift = None
        # Where there is a shift, `_confirm_temperatures` has seen that there is a reference.
        reference = reference_temperature or 0.0
        if wlf is not None:
            shift = WLF(*wlf, reference)
        elif len(sweeps) > 1:
            shift = fit_wlf(sweeps, reference, vertical)
        data = sweeps[0] if shift is None else master_curve(sweeps, shift, vertical)
        fit = fit_series(data.omega, data.storage, data.loss, elements)
    except ValueError as error:
        raise MeasurementError(f"{path}: {error}") from None
    if fit.series.kappa_inf > LARGEST_MODULUS_RATIO * (1 - 10.0 ** (1 - DIGITS)):
        raise MeasurementError(
            f"{path}: E(infinity)/E(0) = {fit.series.kappa_inf:.3g}, a scene takes at most {LARGEST_MODULUS_RATIO:g}; "
            "leave out the highest frequencies, or measure E(0) at lower ones"
        )
    return Material(Path(path).name, sweeps, fit, shift, shift is not None and wlf is None, vertical)


def fit_prony(
    path: str | Path,
    elements: int | None = None,
    temperature: float | str | None = None,
    wlf: tuple[float, float] | str | None = None,
    vertical_shift: bool = False,
) -> Material:
    """Fits a Prony series to a DMA measurement; as `pgfmd fit-prony`. `plot_fit` draws it.

    Args:
        path: a file with columns of frequency, E', E'', and temperature if there are several.
        elements: number of Maxwell elements; None for as few as serve.
        temperature: of the tack test, in K, or a text such as "25C"; needed for sweeps at several temperatures.
        wlf: constants C1 and C2 [K], also as a text "8.86,101.6"; fitted if None.
        vertical_shift: whether moduli are divided by T/T_ref, too.

    Raises:
        MeasurementError: if the file can't be read, or no series fits; ValueError: for a text that is no temperature, or
        no constants.
    """
    kelvin = temperature_in_kelvin(temperature) if isinstance(temperature, str) else temperature
    return characterise(path, elements, kelvin, wlf_constants(wlf) if isinstance(wlf, str) else wlf, vertical_shift)


def _confirm_temperatures(
    path: str | Path, sweeps: list[Sweep], reference: float | None, wlf: tuple[float, float] | None
) -> None:
    """Refuse sweeps at several temperatures without a reference, and a shift without temperatures."""
    if sweeps[0].temperature is None:
        if reference is not None or wlf is not None:
            cure = "add a column such as temperature (C), or leave out --reference-temperature and --wlf"
            raise MeasurementError(f"{path}: expected temperatures for a shift, found no such column; {cure}")
        return
    found = ", ".join(_celsius(sweep.kelvin) for sweep in sweeps)
    if reference is None and (len(sweeps) > 1 or wlf is not None):
        raise MeasurementError(
            f"{path}: expected --reference-temperature, that of the elastomer in the tack test, for sweeps at {found}"
        )
    if len(sweeps) == 1 and wlf is None and reference is not None and abs(reference - sweeps[0].temperature) > 1.0:
        raise MeasurementError(
            f"{path}: one sweep at {found} can't be shifted to {_celsius(reference)} without constants; "
            "give --wlf C1,C2"
        )


def _celsius(kelvin: float) -> str:
    return f"{kelvin + ABSOLUTE_ZERO + 0.0:.4g} C"


def _sweeps(sweeps: list[Sweep]) -> str:
    if sweeps[0].temperature is None:
        return "one sweep"
    if len(sweeps) == 1:
        return f"one sweep at {_celsius(sweeps[0].temperature)}"
    lowest, highest = _celsius(sweeps[0].kelvin), _celsius(sweeps[-1].kelvin)
    return f"{len(sweeps)} sweeps at {lowest} to {highest}"


def wlf_constants(text: str) -> tuple[float, float]:
    """C1 and C2 (K) of a text such as "8.86,101.6". Raises ValueError."""
    try:
        C1, C2 = (float(part) for part in text.split(","))
        if np.isfinite([C1, C2]).all() and C1 > 0 and C2 > 0:
            return C1, C2
    except ValueError:
        pass
    raise ValueError(f"'{text}': expected two positive numbers, C1 and C2 in K, such as 8.86,101.6")
