"""Time-temperature superposition: sweeps at several temperatures become one master curve.

    E(omega, T) = E(a_T omega, T_ref) b_T,    log10 a_T = -C1 (T - T_ref)/(C2 + T - T_ref)

after M. L. Williams, R. F. Landel, J. D. Ferry, J. Am. Chem. Soc. 77, 3701 (1955), doi:10.1021/ja01619a008. Without
the vertical shift b_T = 1; with it b_T = T/T_ref, the rubber modulus of constant density.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares, minimize_scalar

from .dma import Sweep
from .prony_fit import ladder, weights_of

FEWEST_TEMPERATURES = 3
RUNGS_PER_DECADE = 3
MARGINS = (1.0, 1.0)
"""Decades of relaxation times beyond the data: without them what lies outside distorts the ends, and C1 by 3 %."""
LARGEST_C2 = 1e5  # K; so large a C2 is Arrhenius' law


@dataclass(frozen=True)
class WLF:
    """The constants of Williams, Landel and Ferry: C1 (decades), C2 (K), at the reference temperature (K)."""

    C1: float
    C2: float
    reference_temperature: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.C1) and np.isfinite(self.C2) and self.C1 > 0 and self.C2 > 0):
            raise ValueError(
                f"C1 = {self.C1:g}, C2 = {self.C2:g} K: expected positive constants, such as 8.86 and 101.6"
            )

    def log_shift(self, temperature: ArrayLike) -> NDArray:
        """log10 a_T at a temperature (K), same shape. Raises ValueError at and below T_ref - C2."""
        difference = np.asarray(temperature, dtype=float) - self.reference_temperature
        if np.any(self.C2 + difference <= 0):
            raise ValueError(
                f"the WLF equation with C2 = {self.C2:.4g} K ends at {self.reference_temperature - self.C2:.5g} K, "
                f"found a temperature of {np.min(temperature):.5g} K; leave out the coldest sweeps or correct C2"
            )
        return -self.C1 * difference / (self.C2 + difference)

    def moved_to(self, reference_temperature: float) -> WLF:
        """The same shifts, but 1 at another reference temperature (K)."""
        C2 = self.C2 + reference_temperature - self.reference_temperature
        if C2 <= 0:
            raise ValueError(
                f"a reference temperature of {reference_temperature:.5g} K lies below "
                f"{self.reference_temperature - self.C2:.5g} K, where these measurements' WLF equation ends"
            )
        return WLF(self.C1 * self.C2 / C2, C2, reference_temperature)


def master_curve(sweeps: Sequence[Sweep], wlf: WLF, vertical: bool = False) -> Sweep:
    """All sweeps as one at the reference temperature, sorted. vertical: divide moduli by b_T = T/T_ref."""
    temperatures = np.array([sweep.temperature for sweep in sweeps], dtype=float)
    shifted = _shifted(sweeps, wlf.log_shift(temperatures), wlf.reference_temperature if vertical else None)
    return Sweep(*shifted, wlf.reference_temperature)


def fit_wlf(sweeps: Sequence[Sweep], reference_temperature: float, vertical: bool = False) -> WLF:
    """The constants for which the shifted sweeps overlap best.

    Neighbours are first laid over each other one by one; the constants through these shifts are then refined until one
    dense Prony series fits all sweeps best. reference_temperature: K.
    Raises ValueError for less than three temperatures, or if neighbours don't overlap.
    """
    sweeps = sorted(sweeps, key=lambda sweep: sweep.kelvin)
    temperatures = np.array([sweep.temperature for sweep in sweeps], dtype=float)
    if temperatures.size < FEWEST_TEMPERATURES:
        raise ValueError(
            f"C1 and C2 need at least {FEWEST_TEMPERATURES} temperatures, found {temperatures.size}; "
            "give them by --wlf C1,C2"
        )
    middle = temperatures.size // 2
    base, scale = float(temperatures[middle]), reference_temperature if vertical else None
    shifts = np.concatenate([[0.0], np.cumsum([_overlap(*pair, scale) for pair in pairwise(sweeps)])])
    shifts -= shifts[middle]
    # The unknowns are logarithms of C1 and of C2 above its least value, where the coldest sweep is shifted to infinity.
    coldest, rungs = base - temperatures[0], _rungs(sweeps, shifts)

    def constants(unknowns: NDArray) -> WLF:
        return WLF(float(np.exp(unknowns[0])), float(coldest) + float(np.exp(unknowns[1])), base)

    def of_shifts(unknowns: NDArray) -> NDArray:
        return constants(unknowns).log_shift(temperatures) - shifts

    def of_series(unknowns: NDArray) -> NDArray:
        omega, storage, loss = _shifted(sweeps, constants(unknowns).log_shift(temperatures), scale)
        return weights_of(omega, storage, loss, ladder(omega, rungs, MARGINS))[1].ravel()

    bounds = ([np.log(1e-3), np.log(1e-2)], [np.log(1e4), np.log(LARGEST_C2)])
    rough = least_squares(of_shifts, np.log([10.0, 100.0]), bounds=bounds, x_scale="jac")
    start = np.clip(rough.x, np.add(bounds[0], 1e-6), np.subtract(bounds[1], 1e-6))
    fine = least_squares(of_series, start, bounds=bounds, diff_step=1e-5, xtol=1e-10, ftol=1e-10)
    return constants(fine.x).moved_to(reference_temperature)


def _shifted(sweeps: Sequence[Sweep], shifts: NDArray, reference: float | None) -> tuple[NDArray, NDArray, NDArray]:
    """omega a_T, E' and E'' of all sweeps, sorted; the moduli are divided by T/reference where one is given."""
    factor = [1.0 if reference is None else reference / sweep.kelvin for sweep in sweeps]
    omega = np.concatenate([sweep.omega * 10.0**shift for sweep, shift in zip(sweeps, shifts, strict=True)])
    storage = np.concatenate([sweep.storage * b for sweep, b in zip(sweeps, factor, strict=True)])
    loss = np.concatenate([sweep.loss * b for sweep, b in zip(sweeps, factor, strict=True)])
    order = np.argsort(omega, kind="stable")
    return omega[order], storage[order], loss[order]


def _rungs(sweeps: Sequence[Sweep], shifts: NDArray) -> int:
    omega = _shifted(sweeps, shifts, None)[0]
    return int(RUNGS_PER_DECADE * (np.log10(omega[-1] / omega[0]) + sum(MARGINS))) + 2


def _overlap(cold: Sweep, warm: Sweep, reference: float | None) -> float:
    """log10 of a_T(warm)/a_T(cold), < 0, that lays the warm sweep over the cold one: one short series through both.

    Raises ValueError if they don't share a range of moduli.
    """
    reach = np.log10([sweep.omega[-1] / sweep.omega[0] for sweep in (cold, warm)])
    # As many rungs for every shift, or else the misfit is not continuous.
    rungs = int(RUNGS_PER_DECADE * (1.5 * reach.sum() + sum(MARGINS))) + 2

    def misfit(shift: float) -> float:
        omega, storage, loss = _shifted((cold, warm), np.array([0.0, shift]), reference)
        _, difference = weights_of(omega, storage, loss, ladder(omega, rungs, MARGINS))
        return float(np.mean(difference**2))

    coarse = np.linspace(-1.5 * reach.sum(), 0.5 * reach.sum(), 41)
    best = coarse[int(np.argmin([misfit(shift) for shift in coarse]))]
    step = coarse[1] - coarse[0]
    shift = float(minimize_scalar(misfit, bounds=(best - step, best + step), method="bounded").x)
    lowest = np.log10(cold.omega[0] / warm.omega[-1])
    if not lowest < shift < 0:
        what = "share no range of moduli" if shift <= lowest else "lie the wrong way round: the warmer one is stiffer"
        raise ValueError(
            f"the sweeps at {cold.temperature:.5g} K and {warm.temperature:.5g} K {what}; "
            "leave out one of them, or give --wlf C1,C2"
        )
    return shift
