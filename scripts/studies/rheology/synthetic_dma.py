"""Prints a DMA file that was never measured: a known series and WLF law, with noise. For trying pgfmd fit-prony.

    python -m scripts.studies.rheology.synthetic_dma > synthetic.csv

Seven sweeps of 16 frequencies from 0.1 to 100 Hz at -15 to 45 C; standard deviation of the noise 2 %, seed 1.
"""

from __future__ import annotations

import numpy as np

from pgfmd.characterisation.temperature_shift import WLF
from pgfmd.physics.rheology import PronySeries

STATIC_MODULUS = 2e6
SERIES = PronySeries.geometric(1000, 1e-7, elements=20, time_ratio=3, exponent=0.5)
SHIFT = WLF(8.86, 101.6, 298.15)
CELSIUS = np.arange(-15, 46, 10)
FREQUENCIES = np.geomspace(0.1, 100, 16)
NOISE = 0.02


def lines(noise: float = NOISE, seed: int = 1) -> list[str]:
    """The file, a text a line."""
    random = np.random.default_rng(seed)
    texts = [
        "# SYNTHETIC data, not a measurement: E(0) = 2 MPa, PronySeries.geometric(1000, 1e-7, 20, 3, 0.5),",
        f"# WLF with C1 = 8.86, C2 = 101.6 K at 25 C, noise {100 * noise:g} %",
        "temperature (C),frequency (Hz),E' (MPa),E'' (MPa)",
    ]
    for celsius in CELSIUS:
        omega = 2 * np.pi * FREQUENCIES * 10 ** SHIFT.log_shift(celsius + 273.15)
        factors = 1 + noise * random.standard_normal((2, omega.size))
        moduli = STATIC_MODULUS / 1e6 * factors * [SERIES.storage(omega), SERIES.loss(omega)]
        for frequency, storage, loss in zip(FREQUENCIES, *moduli, strict=True):
            texts.append(f"{celsius},{frequency:.5g},{storage:.5g},{loss:.5g}")
    return texts


if __name__ == "__main__":
    print("\n".join(lines()))
