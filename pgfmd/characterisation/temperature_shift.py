"""Time-temperature superposition: sweeps at several temperatures become one master curve.

    E(omega, T) = E(a_T omega, T_ref) b_T,    log10 a_T = -C1 (T - T_ref)/(C2 + T - T_ref)

after M. L. Williams, R. F. Landel, J. D. Ferry, J. Am. Chem. Soc. 77, 3701 (1955), doi:10.1021/ja01619a008. Without
the vertical shift b_T = 1; with it b_T = T/T_ref, the rubber modulus of constant density.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares, minimize_scalar

from .dma import Sweep, degrees
from .prony_fit import ladder, weights_of

FEWEST_TEMPERATURES = 3
RUNGS_PER_DECADE = 3
MARGINS = (1.0, 1.0)
"""Decades of relaxation times beyond the data: without them what lies outside distorts the ends, and C1 by 3 %."""
LARGEST_C2 = 1e5  # K; so large a C2 is Arrhenius' law
LEAST_RISE = 0.1
"""Share by which E' has to rise over a sweep, or the sweep determines no shift: noise is nearly as large."""
OFF_THE_LAW, SHARE_OFF = 0.3, 0.1
"""How far the shift of the coldest sweep may be from the law of the others, in decades and as a share of it."""


@dataclass(frozen=True)
class WLF:
    """The constants of Williams, Landel and Ferry: C1 (decades), C2 (K), at the reference temperature (K)."""

    C1: float
    C2: float
    reference_temperature: float
    unit: str = field(default="K", compare=False)  # of temperatures in messages

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
                f"the WLF equation with C2 = {self.C2:.4g} K ends at {self._shown(self.reference_temperature - self.C2)}, "
                f"found a temperature of {self._shown(np.min(temperature))}; leave out the coldest sweeps or correct C2"
            )
        return -self.C1 * difference / (self.C2 + difference)

    def moved_to(self, reference_temperature: float) -> WLF:
        """The same shifts, but 1 at another reference temperature (K)."""
        C2 = self.C2 + reference_temperature - self.reference_temperature
        if C2 <= 0:
            raise ValueError(
                f"a reference temperature of {self._shown(reference_temperature)} lies below "
                f"{self._shown(self.reference_temperature - self.C2)}, where these measurements' WLF equation ends"
            )
        return WLF(self.C1 * self.C2 / C2, C2, reference_temperature, self.unit)

    def _shown(self, kelvin: float) -> str:
        return degrees(float(kelvin), self.unit)


def master_curve(sweeps: Sequence[Sweep], wlf: WLF, vertical: bool = False) -> Sweep:
    """All sweeps as one at the reference temperature, sorted. vertical: divide moduli by b_T = T/T_ref."""
    temperatures = np.array([sweep.temperature for sweep in sweeps], dtype=float)
    shifted = _shifted(sweeps, wlf.log_shift(temperatures), wlf.reference_temperature if vertical else None)
    return Sweep(*shifted, wlf.reference_temperature)


@dataclass(frozen=True, eq=False)
class Superposition:
    """Sweeps that a law lays over each other: wlf, the law; sweeps, coldest first; left_out: in words, those that it
    does not hold for."""

    wlf: WLF
    sweeps: list[Sweep]
    left_out: tuple[str, ...] = ()


def superpose(sweeps: Sequence[Sweep], reference_temperature: float, vertical: bool = False) -> Superposition:
    """The sweeps whose shifts follow the law of Williams, Landel and Ferry, which holds above the glass transition, and
    that law at the reference temperature (K).

    Left out are, from the cold end on, sweeps whose storage modulus hardly changes with the frequency, so that they
    determine no shift, and then those whose shift is not that of the law through all others. Raises ValueError as
    `fit_wlf` does.
    """
    sweeps = sorted(sweeps, key=lambda sweep: sweep.kelvin)
    telling = [number for number, sweep in enumerate(sweeps) if _rise(sweep) > LEAST_RISE]
    first = telling[0] if telling else 0
    words = []
    if first:
        flat = ", ".join(sweep.degrees for sweep in sweeps[:first])
        words.append(
            f"{_counted(first)} at {flat}: E' hardly changes with the frequency, so that no shift is determined"
        )
    _confirm_number(sweeps)
    steps = _steps(sweeps[first:], reference_temperature if vertical else None)
    while len(sweeps) - first > FEWEST_TEMPERATURES:
        law = _law_of_steps(sweeps[first + 1 :], steps[1:])
        if steps[0] is None or law is None:
            break
        cold, warm = (sweep.kelvin for sweep in sweeps[first : first + 2])
        ends = cold <= law.reference_temperature - law.C2
        expected = -np.inf if ends else float(law.log_shift(warm) - law.log_shift(cold))
        if abs(steps[0] - expected) <= max(OFF_THE_LAW, SHARE_OFF * abs(steps[0])):
            break
        of_law = "where that of the others ends" if ends else f"that of the others is {-expected:.2g}"
        words.append(
            f"one sweep at {sweeps[first].degrees}: its shift against the next is {-steps[0]:.2g} decades, {of_law}; the "
            "law holds above the glass transition"
        )
        first, steps = first + 1, steps[1:]
    law = _refined(sweeps[first:], steps, reference_temperature, vertical)
    return Superposition(law, sweeps[first:], tuple(words))


def fit_wlf(sweeps: Sequence[Sweep], reference_temperature: float, vertical: bool = False) -> WLF:
    """The constants for which the shifted sweeps overlap best.

    Neighbours are first laid over each other one by one; the constants through these shifts are then refined until one
    dense Prony series fits all sweeps best. reference_temperature: K.
    Raises ValueError for less than three temperatures, or if neighbours don't overlap.
    """
    sweeps = sorted(sweeps, key=lambda sweep: sweep.kelvin)
    _confirm_number(sweeps)
    steps = _steps(sweeps, reference_temperature if vertical else None)
    return _refined(sweeps, steps, reference_temperature, vertical)


def _confirm_number(sweeps: Sequence[Sweep]) -> None:
    if len(sweeps) < FEWEST_TEMPERATURES:
        raise ValueError(
            f"C1 and C2 need at least {FEWEST_TEMPERATURES} temperatures, found {len(sweeps)}; give them by --wlf C1,C2"
        )


def _refined(
    sweeps: Sequence[Sweep], steps: Sequence[float | None], reference_temperature: float, vertical: bool
) -> WLF:
    """The law for which one dense series fits all sweeps best, from that of the steps on."""
    _confirm_number(sweeps)
    scale = reference_temperature if vertical else None
    temperatures = np.array([sweep.temperature for sweep in sweeps], dtype=float)
    start = _law_of_steps(sweeps, steps)
    if start is None:
        raise ValueError(
            "E' hardly changes with the frequency in most sweeps: no shift is determined; give --wlf C1,C2"
        )
    base, unit = start.reference_temperature, sweeps[0].unit
    coldest, rungs = base - temperatures[0], _rungs(sweeps, start.log_shift(temperatures))

    def of_series(unknowns: NDArray) -> NDArray:
        shifts = _law(unknowns, coldest, base).log_shift(temperatures)
        omega, storage, loss = _shifted(sweeps, shifts, scale)
        return weights_of(omega, storage, loss, ladder(omega, rungs, MARGINS))[1].ravel()

    unknowns = np.log([start.C1, start.C2 - coldest])
    begin = np.clip(unknowns, np.add(BOUNDS[0], 1e-6), np.subtract(BOUNDS[1], 1e-6))
    fine = least_squares(of_series, begin, bounds=BOUNDS, diff_step=1e-5, xtol=1e-10, ftol=1e-10)
    found = _law(fine.x, coldest, base)
    return WLF(found.C1, found.C2, base, unit).moved_to(reference_temperature)


BOUNDS = (np.log([1e-3, 1e-2]), np.log([1e4, LARGEST_C2]))
"""Of the unknowns: logarithms of C1 and of C2 above its least value, where the coldest sweep is shifted to infinity."""


def _law(unknowns: NDArray, coldest: float, base: float) -> WLF:
    """The law of these unknowns at the temperature base (K); coldest: how far the coldest sweep is below it."""
    return WLF(float(np.exp(unknowns[0])), float(coldest) + float(np.exp(unknowns[1])), base)


def _law_of_steps(sweeps: Sequence[Sweep], steps: Sequence[float | None]) -> WLF | None:
    """The law through the shifts between neighbours, as far as they are known; None where too few are."""
    temperatures = np.array([sweep.temperature for sweep in sweeps], dtype=float)
    known = np.array([step is not None for step in steps])
    if known.sum() < 2:
        return None
    wanted = np.array([step for step in steps if step is not None])
    base = float(temperatures[temperatures.size // 2])
    coldest = base - temperatures[0]

    def off(unknowns: NDArray) -> NDArray:
        return np.diff(_law(unknowns, coldest, base).log_shift(temperatures))[known] - wanted

    found = least_squares(off, np.log([10.0, 100.0]), bounds=BOUNDS, x_scale="jac")
    return _law(found.x, coldest, base)


def _steps(sweeps: Sequence[Sweep], reference: float | None) -> list[float | None]:
    """log10 of a_T(warm)/a_T(cold) of neighbours, None where one of them determines none. ValueError names all that don't
    overlap."""
    steps: list[float | None] = []
    problems = []
    for cold, warm in pairwise(sweeps):
        if min(_rise(cold), _rise(warm)) <= LEAST_RISE:
            steps.append(None)
            continue
        try:
            steps.append(_overlap(cold, warm, reference))
        except ValueError as problem:
            problems.append(str(problem))
    if problems:
        raise ValueError(f"{'; '.join(problems)}; leave out one of each, measure between them, or give --wlf C1,C2")
    return steps


def _rise(sweep: Sweep) -> float:
    """Share by which E' rises over a sweep, from the mean of its lowest third of frequencies to that of the highest."""
    third = max(1, sweep.omega.size // 3)
    return float(np.mean(sweep.storage[-third:]) / np.mean(sweep.storage[:third]) - 1.0)


def _counted(number: int) -> str:
    return "one sweep" if number == 1 else f"{number} sweeps"


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
        raise ValueError(f"the sweeps at {cold.degrees} and {warm.degrees} {what}")
    return shift
