"""Makes the files of the tutorial "From raw data to an overlay": none was measured, and all numbers in them are known.

    python -m scripts.studies.raw_data.make raw

The curve is that of a run with the true elastomer, measured by a machine with a compliance, a load cell with an offset and
noise of 0.3 % of the preload. Seed 1.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np

import pgfmd
from pgfmd.characterisation.temperature_shift import WLF
from pgfmd.physics.rheology import PronySeries
from pgfmd.results.curve import Loop

STATIC_MODULUS, POISSON_RATIO = 1.2e6, 0.495
SERIES = PronySeries.geometric(400, 1e-6, elements=12, time_ratio=4, exponent=0.5)
"""The elastomer at 25 C."""
SHIFT = WLF(10.0, 105.0, 298.15)
GLASS = 238.15
"""Temperature [K] below which sweeps no longer follow the law."""
CELSIUS = np.arange(-65.0, 56.0, 15.0)
FREQUENCIES = np.geomspace(0.1, 100.0, 13)
NOISE = 0.01
RADIUS, CURVATURE, SIZE, PIXELS = 150e-6, 1.5e-3, 400e-6, 160
TILT, MISSING = 5e-3, 80
"""Of the map along x, and pixels of it that have no height."""
MACHINE_STIFFNESS = 2e3
OFFSET, DRIVE_NOISE, FAR = 0.18e-3, 3e-3, 4e-6
"""Of the load cell [N]; noise of the force as a share of the preload; how far away the test begins and ends [m]."""
SCENE = """# What is known of the tack test; the elastomer is a guess until its moduli are put in.
title = "a stamp on silicone"

[punch]
pattern = "file"
file = "map.txt"            # measured
file_peaks = "up"           # high places touch first, as in most instruments
file_detrend = "tilt"       # the sample lay askew in the instrument
file_missing = "fill"       # some pixels have no height
radius = "150 um"

[substrate]
youngs_modulus = "1 MPa"    # a guess
poisson_ratio = 0.495

[rheology]
model = "elastic"           # a guess

[adhesion]
work_of_adhesion = "60 mJ/m^2"

[drive]
speed = "20 um/s"
preload = "1.5 mN"

[grid]
n = {points}
length = "600 um"
"""


def heights(random: np.random.Generator) -> np.ndarray:
    """A dome with a weave of 80 um on it, z[iy, ix] in m, its lowest place touches first."""
    x = (np.arange(PIXELS) + 0.5) / PIXELS * SIZE - SIZE / 2
    wave = 2 * np.pi / 80e-6
    dome = (x**2 + x[:, None] ** 2) / (2 * CURVATURE)
    return (
        dome + 0.3e-6 * np.cos(wave * x) * np.cos(wave * x[:, None]) + 2e-9 * random.standard_normal((PIXELS, PIXELS))
    )


def height_map(z: np.ndarray, random: np.random.Generator) -> str:
    """The face z [m] as an instrument sees it: in nm, high places touch first, askew, some pixels without a height."""
    x = (np.arange(PIXELS) + 0.5) / PIXELS * SIZE
    seen = TILT * x - z
    seen.flat[random.choice(z.size, MISSING, replace=False)] = np.nan
    side = f"{1e6 * SIZE:.1f} µm"
    lines = ["# Channel: Height", f"# Width: {side}", f"# Height: {side}", "# Value units: nm"]
    return "\n".join([*lines, *("\t".join(f"{1e9 * height:.1f}" for height in row) for row in seen)]) + "\n"


def sweeps(random: np.random.Generator) -> str:
    """Shear moduli in the manner of a German rheometer."""
    lines = ["Project: silicone", "Frequenz [Hz];Temperatur [°C];Speichermodul G' [Pa];Verlustmodul G'' [Pa]"]
    shear = STATIC_MODULUS / (2 * (1 + POISSON_RATIO))
    for celsius in CELSIUS:
        kelvin = celsius + 273.15
        # Below the glass transition relaxation hardly slows down any more.
        shift = float(SHIFT.log_shift(max(kelvin, GLASS))) + 0.08 * max(GLASS - kelvin, 0.0)
        omega = 2 * np.pi * FREQUENCIES * 10**shift
        factors = 1 + NOISE * random.standard_normal((2, omega.size))
        moduli = shear * factors * [SERIES.storage(omega), SERIES.loss(omega) + 1e-3 * SERIES.storage(omega)]
        lines += [
            f"{frequency:.5g};{celsius:.2f};{storage:.5g};{loss:.5g}".replace(".", ",")
            for frequency, storage, loss in zip(FREQUENCIES, *moduli, strict=True)
        ]
    return "\n".join(lines) + "\n"


def measured(run: Loop, preload: float, speed: float, random: np.random.Generator) -> str:
    """A run's curve as a machine would write it: time, gap and force, from far away to far away."""
    steps = np.linspace(0.0, FAR, 40)
    depth = np.concatenate([run.indentation[0] - steps[:0:-1], run.indentation, run.indentation[-1] - steps[1:]])
    force = np.concatenate([np.zeros(39), run.force, np.zeros(39)])
    around = FAR / speed
    time = np.concatenate(
        [run.time[0] - around + steps[:-1] / speed, run.time, run.time[-1] + steps[1:] / speed]
    ) - (run.time[0] - around)  # fmt: skip
    depth = depth + force / MACHINE_STIFFNESS
    force = force + OFFSET + DRIVE_NOISE * preload * random.standard_normal(force.size)
    lines = ["Test:,stamp 7", "Operator:,nobody", "", "Time,Gap,Normal Force", "[s],[mm],[N]"]
    lines += [f"{t:.5f},{1.5 - 1e3 * d:.7f},{f:.6e}" for t, d, f in zip(time, depth, force, strict=True)]
    return "\n".join(lines) + "\n"


def make(folder: Path, points: int = 64, seed: int = 1) -> None:
    """Writes all files into a folder; points: of the grid of the scene, and of the run that stands for the experiment."""
    random = np.random.default_rng(seed)
    folder.mkdir(parents=True, exist_ok=True)
    z = heights(random)
    # With numbers of its own, so that those of the other files stay.
    (folder / "map.txt").write_text(height_map(z, np.random.default_rng([seed, 1])), encoding="utf-8")
    (folder / "sweeps.txt").write_text(sweeps(random), encoding="cp1252")
    (folder / "scene.toml").write_text(SCENE.format(points=points), encoding="utf-8")
    with tempfile.TemporaryDirectory() as out:
        # The experiment has the face itself.
        face = Path(out) / "face.npz"
        np.savez(face, z=z, size=[SIZE, SIZE], unit="m", peaks="down")
        truth = _truth(folder / "scene.toml", face)
        run = Loop.of(pgfmd.run(truth, Path(out) / "truth", say=lambda line: None))
    text = measured(run, truth.drive.preload, truth.drive.speed, random)
    (folder / "tack.csv").write_text(text, encoding="utf-8")


def _truth(scene: Path, face: Path) -> pgfmd.Scene:
    """The scene with the true elastomer and a face without tilt and missing pixels."""
    return pgfmd.Scene(scene).replace(
        punch={"file": str(face), "file_peaks": None, "file_detrend": "none", "file_missing": "refuse"},
        substrate={"youngs_modulus": STATIC_MODULUS, "poisson_ratio": POISSON_RATIO},
        rheology={"model": "prony", "kappa": SERIES.kappa, "tau": SERIES.tau},
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--points", type=int, default=64, help="grid points along a side")
    given = parser.parse_args()
    make(given.folder, given.points)
