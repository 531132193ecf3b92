"""Closed forms that pgfmd is tested against and that users can compare their runs with.

Plain functions on NumPy arrays, SI units, no scene and no MPI. Signs: a force on the punch is positive in compression,
an indentation is positive when the punch is pushed in, a traction on the elastomer is positive when it pulls up.
`contact_modulus` is E* = E/(1 - nu^2), `work_of_adhesion` is the paper's gamma (J/m^2).
"""

from . import (
    cohesive_sphere,
    corrugation,
    film,
    flat_punch,
    hertz,
    jkr,
    maugis,
    power_law,
    prony,
    sinusoid,
    tabor,
    ting,
    wavy,
)

__all__ = [
    "cohesive_sphere",
    "corrugation",
    "film",
    "flat_punch",
    "hertz",
    "jkr",
    "maugis",
    "power_law",
    "prony",
    "sinusoid",
    "tabor",
    "ting",
    "wavy",
]
