"""What precision.py runs: scenes, accuracies, grids."""

from __future__ import annotations

from dataclasses import dataclass

PRECISIONS = ("double", "mixed")
ALL = (0.3, 1e-2, 1e-3, 1e-4, 1e-5)
COARSE = (0.3, 1e-2, 1e-3)
SLOW = (0.1, 0.03, 0.01)
"""Of scenes whose surface jumps, which take a hundred times as many transforms."""
SPHERE = ("adhesion.law=cosine", "adhesion.range_factor=0.156", "rheology.model=single", "rheology.modulus_ratio=250",
          "rheology.relaxation_time=400 us")  # fmt: skip
OWN = {
    "wave": {
        "punch": {"pattern": "sinusoid", "wavelength": "150 um", "amplitude": "0.5 um"},
        "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495},
        "rheology": {"model": "single", "modulus_ratio": 250, "relaxation_time": "400 us"},
        "adhesion": {"work_of_adhesion": "50 mJ/m^2"},
        "drive": {"speed": "10 um/s", "preload": "2 mN"},
        "grid": {"n": 64, "length": "150 um"},
    }
}
"""Scenes that none of the shipped ones can be changed to: a wave that fills the cell."""


@dataclass(frozen=True)
class Case:
    """A scene with its overrides, the accuracies at which it is run, and that of its reference."""

    name: str
    scene: str
    overrides: tuple[str, ...]
    accuracies: tuple[float, ...] = ALL
    reference: float = 1e-6


def _geometric(elements: int, ratio: float, shortest: str = "40 us", step: float = 6.0) -> tuple[str, ...]:
    return (
        "rheology.model=geometric", f"rheology.elements={elements}", f"rheology.time_ratio={step}",
        "rheology.exponent=0.8", f"rheology.relaxation_time={shortest}", f"rheology.modulus_ratio={ratio:g}",
    )  # fmt: skip


CASES = (
    Case("tri, 10 µm/s, n = 128", "tri-tack", ("grid.n=128", "drive.speed=10 um/s")),
    Case("tri, 1 µm/s, n = 64", "tri-tack", ("grid.n=64", "drive.preload=10 mN")),
    Case("tri, 0.1 µm/s, n = 64", "tri-tack", ("grid.n=64", "drive.speed=0.1 um/s", "drive.preload=10 mN"), COARSE, 1e-4),
    Case("tri, 1 mm/s, n = 128", "tri-tack", ("grid.n=128", "drive.speed=1 mm/s")),
    Case("tri, 0.1 m/s, n = 64", "tri-tack", ("grid.n=64", "drive.speed=0.1 m/s")),
    Case("tri, first order, n = 64", "tri-tack", ("grid.n=64", "drive.speed=20 um/s", "solver.order=1"), COARSE, 1e-5),
    Case("tri, free, n = 64", "tri-tack", ("grid.n=64", "drive.speed=10 um/s", "substrate.boundary=free")),
    Case(
        "tri, film of 100 µm, n = 64", "tri-tack",
        ("grid.n=64", "drive.speed=10 um/s", "substrate.thickness=100 um"),
    ),
    Case(
        "tri, sliding film of 20 µm, n = 64", "tri-tack",
        ("grid.n=64", "drive.speed=10 um/s", "substrate.thickness=20 um", "substrate.base=sliding"),
    ),
    Case(
        "tri, free film of 100 µm, n = 64", "tri-tack",
        ("grid.n=64", "drive.speed=10 um/s", "substrate.thickness=100 um", "substrate.boundary=free"),
    ),
    Case("hex, 10 µm/s, n = 64", "hex-tack", ("grid.n=64", "drive.speed=10 um/s")),
    Case("hex, 25 µm/s, n = 256", "hex-tack", ("grid.n=256", "drive.speed=25 um/s"), (0.1, 1e-2, 1e-3), 1e-4),
    Case("flat, 10 µm/s, n = 64", "flat-punch", ("grid.n=64",)),
    Case("flat, κ∞ = 4, 0.1 µm/s, n = 64", "flat-punch", ("grid.n=64", "rheology.modulus_ratio=4", "drive.speed=0.1 um/s"), COARSE, 1e-4),
    Case("sphere, free, 10 µm/s, n = 64", "hertz", ("grid.n=64", *SPHERE, "drive.speed=10 um/s")),
    Case("sphere, elastic, repulsive, n = 64", "hertz", ("grid.n=64",)),
    Case("wave in the whole cell, n = 64", "wave", ("grid.n=64",)),
    Case("tri, κ∞ = 1.5, n = 64", "tri-tack", ("grid.n=64", "rheology.modulus_ratio=1.5", "drive.speed=100 um/s"), COARSE, 1e-4),
    Case("tri, κ∞ = 1e4, n = 64", "tri-tack", ("grid.n=64", "rheology.modulus_ratio=1e4", "drive.speed=10 um/s")),
    Case("tri, κ∞ = 1e6, n = 64", "tri-tack", ("grid.n=64", "rheology.modulus_ratio=1e6", "drive.speed=10 um/s")),
    Case("tri, κ∞ = 1e6, 1 mm/s, n = 128", "tri-tack", ("grid.n=128", "rheology.modulus_ratio=1e6", "drive.speed=1 mm/s")),
    Case("flat, κ∞ = 1e6, 1 µm/s, n = 64", "flat-punch", ("grid.n=64", "rheology.modulus_ratio=1e6", "drive.speed=1 um/s")),
    Case("tri, N = 5, κ∞ = 250, n = 64", "tri-tack", ("grid.n=64", "drive.speed=10 um/s", *_geometric(5, 250))),
    Case("hex, N = 5, κ∞ = 1e6, n = 64", "hex-tack", ("grid.n=64", "drive.speed=10 um/s", *_geometric(5, 1e6, "1 us"))),
    Case("tri, N = 20, κ∞ = 1000, n = 64", "tri-tack", ("grid.n=64", "drive.speed=10 um/s", *_geometric(20, 1e3, "1 us", 2.0))),
    Case("tri, N = 40, κ∞ = 1e6, n = 64", "tri-tack", ("grid.n=64", "drive.speed=10 um/s", *_geometric(40, 1e6, "1 ns", 2.0))),
    Case(
        "tri, dwell of 1e4 s, n = 64", "tri-tack",
        ("grid.n=64", "drive.speed=10 um/s", "drive.dwell=1e4 s"), COARSE, 1e-4,
    ),
    Case(
        "tri, start in contact, n = 64", "tri-tack",
        ("grid.n=64", "drive.speed=10 um/s", "drive.clearance=-1 um"),
    ),
    Case("tri, 10 µm/s, n = 512", "tri-tack", ("grid.n=512", "drive.speed=10 um/s"), (1e-2, 1e-3), 1e-4),
    Case("tri, elastic, n = 48", "tri-tack", ("grid.n=48", "rheology.model=elastic", "drive.preload=5 mN"), SLOW, 1e-3),
    Case("hex, elastic, n = 48", "hex-tack", ("grid.n=48", "rheology.model=elastic", "drive.preload=2 mN"), SLOW, 1e-3),
    Case("flat, elastic, n = 48", "flat-punch", ("grid.n=48", "rheology.model=elastic"), SLOW, 1e-3),
    Case("sphere, elastic, n = 48", "hertz", ("grid.n=48", *SPHERE[:2]), SLOW, 1e-3),
    Case("tri, quasistatic, n = 48", "tri-tack", ("grid.n=48", "solver.scheme=quasistatic", "drive.preload=5 mN"), SLOW, 1e-3),
    Case("hex, quasistatic, n = 48", "hex-tack", ("grid.n=48", "solver.scheme=quasistatic", "drive.preload=2 mN"), SLOW, 1e-3),
    Case(
        "hex, quasistatic, instantaneous, n = 48", "hex-tack",
        ("grid.n=48", "solver.scheme=quasistatic", "solver.modulus=instantaneous", "drive.preload=2 mN"), SLOW, 1e-3,
    ),
    Case(
        "hex, quasistatic, spring, n = 48", "hex-tack",
        ("grid.n=48", "solver.scheme=quasistatic", "drive.machine_stiffness=2 kN/m", "drive.preload=2 mN"), SLOW, 1e-3,
    ),
    Case("hex, quasistatic, n = 128", "hex-tack", ("grid.n=128", "solver.scheme=quasistatic", "drive.preload=2 mN"), (0.1, 0.03), 3e-3),
    Case("flat, quasistatic, n = 48", "flat-punch", ("grid.n=48", "solver.scheme=quasistatic"), SLOW, 1e-3),
    Case(
        "sphere, quasistatic, n = 48", "hertz", ("grid.n=48", *SPHERE, "solver.scheme=quasistatic"), SLOW, 1e-3,
    ),
)  # fmt: skip

COSTS = (
    ("tri", "tri-tack", ("drive.speed=10 um/s",), (32, 48, 64, 96, 128, 192, 256, 512, 1024)),
    ("hex", "hex-tack", ("drive.speed=25 um/s",), (48, 64, 128, 256)),
    ("tri, free", "tri-tack", ("drive.speed=10 um/s", "substrate.boundary=free"), (48, 64, 96, 128, 256)),
    ("tri, N = 5", "tri-tack", ("drive.speed=10 um/s", *_geometric(5, 250)), (48, 64, 128, 256)),
    ("hertz", "hertz", (), (64, 128, 256, 512)),
    ("flat, elastic", "flat-punch", ("rheology.model=elastic",), (64, 128, 256)),
)
"""Of the second table: name, scene, overrides, grids."""


SCATTERS = (
    ("flat, κ∞ = 4, 0.1 µm/s, n = 64", 0.01, 1e-4, 9),
    ("hex, elastic, n = 48", 0.03, 3e-3, 9),
    ("tri, quasistatic, n = 48", 0.1, 2e-3, 9),
    ("tri, quasistatic, n = 48", 0.03, 2e-3, 9),
)
"""Of the third table: scenes whose surface jumps, and at which accuracies they are run: so many within a fourth of one,
against a reference."""
SPREAD = 1.25
