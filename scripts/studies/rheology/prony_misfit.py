"""How many Maxwell elements does a power law need? Prints the misfit for N elements, as a table in Markdown.

    python -m scripts.studies.rheology.prony_misfit

The target is E = E(0) [1 + (i omega)^beta] with beta = 0.5, from omega = 1 over eight and ten decades, ten points each.
Errors are relative, of E' and E''; "plain" is the ladder of times from one end of the data to the other, "moved" has
the ends where they fit best, as in `pgfmd fit-prony`. The last column is E(infinity)/E(0) of the latter.
"""

from __future__ import annotations

import numpy as np

from pgfmd.characterisation.prony_fit import fit_series, ladder, weights_of

EXPONENT = 0.5
DECADES = (8, 10)
ELEMENTS = (1, 2, 3, 5, 8, 10, 12, 16, 20, 40)
POINTS_PER_DECADE = 10


def rms(misfit: np.ndarray) -> float:
    """Root mean square in percent."""
    return 100 * float(np.sqrt(np.mean(misfit**2)))


def main() -> None:
    print("| decades | N | plain, rms (%) | moved, rms (%) | largest (%) | E(inf)/E(0) |")
    print("| --- | --- | --- | --- | --- | --- |")
    for decades in DECADES:
        omega = np.geomspace(1.0, 10.0**decades, decades * POINTS_PER_DECADE + 1)
        modulus = 1 + (1j * omega) ** EXPONENT
        for elements in ELEMENTS:
            _, misfit = weights_of(omega, modulus.real, modulus.imag, ladder(omega, elements))
            fit = fit_series(omega, modulus.real, modulus.imag, elements)
            figures = f"{rms(misfit):.2g} | {100 * fit.rms:.2g} | {100 * fit.largest[0]:.3g}"
            print(f"| {decades} | {elements} | {figures} | {fit.series.kappa_inf:.3g} |")


if __name__ == "__main__":
    main()
