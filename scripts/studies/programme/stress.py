"""Programmes with holds, ramps, oscillations and repeats, on rigid and soft machines, with all laws, in every scheme: does a run
get through, and does the audit close to 2 % at accuracy 1e-3?"""

from __future__ import annotations

import csv
import math
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

import pgfmd
from pgfmd.errors import PgfmdError
from pgfmd.physics.drive import ENDED_WELL

from ..pages import FIGURES

TABLE = FIGURES / "programme_stress.csv"
LARGEST_RESIDUAL = 0.02
LIMIT = 240
"""Seconds after which a case is hung."""

PRESS = {"do": "approach", "speed": "20 um/s", "until": "3 mN"}
FREE = {"do": "retract", "speed": "20 um/s", "until": "free"}
PULL = {"do": "retract", "speed": "20 um/s", "until": "-0.3 mN"}
PROGRAMMES: dict[str, list[dict]] = {
    "held load": [PRESS, {"do": "hold", "of": "load", "for": "0.2 s"}, FREE],
    "ramps of load": [
        {"do": "ramp", "rate": "20 mN/s", "until": "3 mN"}, {"do": "hold", "of": "load", "for": "0.2 s"},
        {"do": "ramp", "rate": "-20 mN/s", "until": "free"},
    ],
    "held pull": [PRESS, PULL, {"do": "hold", "of": "load", "for": "1 s"}, FREE],
    "oscillation into contact": [
        {"do": "approach", "speed": "20 um/s", "until": "0.5 mN"},
        {"do": "oscillate", "amplitude": "1 um", "frequency": "10 Hz", "cycles": 3}, FREE,
    ],
    "oscillation of load into tension": [PRESS, {"do": "oscillate", "amplitude": "4 mN", "frequency": "10 Hz", "cycles": 2}, FREE],
    "travel and area": [
        PRESS, {"do": "retract", "speed": "20 um/s", "until": "0.2 um"}, {"do": "approach", "speed": "5 um/s", "until": "3 mN"},
        {"do": "hold", "of": "load", "until": ["0.4 mm^2", "0.2 s"]}, FREE,
    ],
    "everything": [
        PRESS, {"do": "hold", "of": "load", "for": "0.1 s"}, {"do": "ramp", "rate": "20 mN/s", "until": "4 mN"},
        {"do": "hold", "for": "0.1 s"}, {"do": "oscillate", "amplitude": "20 nm", "frequency": "20 Hz", "cycles": 1},
        {"do": "oscillate", "amplitude": "0.5 mN", "frequency": "20 Hz", "cycles": 1}, PULL,
        {"do": "hold", "of": "load", "for": "0.05 s"}, {"do": "hold", "for": "0.05 s"}, FREE,
    ],
}  # fmt: skip
SPRING = {"machine_stiffness": "3 kN/m"}
SINGLE = {"model": "single", "modulus_ratio": 20.0, "relaxation_time": "5 ms"}
DRIVES = {"rigid": ({}, 1), "3 kN/m": (SPRING, 1), "3 cycles": ({}, 3), "3 cycles, 3 kN/m": (SPRING, 3)}
"""Changes of the drive, and cycles."""
SCENES: dict[str, dict[str, dict]] = {
    "as it is": {},
    "elastic": {"rheology": {"model": "elastic"}},
    "modulus ratio 1000": {"rheology": {**SINGLE, "modulus_ratio": 1000.0}},
    "13 elements over ten decades": {
        "rheology": {
            "model": "geometric", "modulus_ratio": 1000.0, "relaxation_time": "1 us", "elements": 13, "time_ratio": 6.0,
            "exponent": 0.5,
        },
    },
    "free surface": {"substrate": {"boundary": "free"}},
    "film of 70 um": {"substrate": {"thickness": "70 um"}},
    "flat punch": {"punch": {"pattern": "flat", "radius": "375 um"}},
    "short range": {"adhesion": {"range_factor": 1.0}},
    "accuracy 0.01": {"solver": {"accuracy": 0.01}},
    "dugdale": {"adhesion": {"law": "dugdale"}},
    "exponential": {"adhesion": {"law": "exponential"}},
    "lennard-jones": {"adhesion": {"law": "lennard-jones"}},
    "repulsive": {"adhesion": {"law": "repulsive"}},
    "quasistatic": {"solver": {"scheme": "quasistatic", "accuracy": 0.01}},
    "gfmd": {"solver": {"scheme": "gfmd", "gfmd": {"omega_tau": 16.0, "steps_per_tau": 64.0}}},
}  # fmt: skip
FEW = ("film of 70 um", "accuracy 0.01")
"""Scenes that are run without repeats on a spring, which tell nothing new."""
SLOW = ("quasistatic", "gfmd")
"""Scenes that are run without repeats."""


@dataclass
class Result:
    """A line of the table; numbers are NaN where the run did not get so far."""

    scene: str
    programme: str
    drive: str
    finished: str = ""
    steps: int = 0
    rejected: int = 0
    pairs: int = 0
    jumps: int = 0
    residual: float = math.nan
    seconds: float = math.nan
    verdict: str = "FAILED"


class Hang(Exception):
    """The time limit of a case is over."""


def _out_of_time(*_: object) -> None:
    raise Hang


def scene_of(scene: str, programme: str, drive: str) -> pgfmd.Scene:
    """The scene of a case."""
    more, cycles = DRIVES[drive]
    sections: dict[str, dict] = {
        "punch": {"pattern": "triangular", "radius": "375 um", "wavelength": "150 um", "amplitude": "4 um"},
        "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495},
        "rheology": SINGLE, "adhesion": {"law": "cosine", "work_of_adhesion": "50 mJ/m^2"},
        "grid": {"n": 24, "length": "1.5 mm"}, "solver": {"accuracy": 1e-3},
        "drive": {"step": PROGRAMMES[programme], **more, **({"repeat": {"times": cycles}} if cycles > 1 else {})},
    }  # fmt: skip
    for name, keys in SCENES[scene].items():
        sections[name] = keys if name in ("punch", "rheology") else {**sections[name], **keys}
    return pgfmd.Scene(sections)


def cases() -> Iterator[tuple[str, str, str]]:
    """Scene, programme and drive of all cases."""
    for scene in SCENES:
        for programme in PROGRAMMES:
            for drive in DRIVES:
                if not (scene in FEW and drive == "3 cycles, 3 kN/m") and not (scene in SLOW and "cycles" in drive):
                    yield scene, programme, drive


def run_case(scene: str, programme: str, drive: str) -> Result:
    """Runs a case for at most `LIMIT` seconds."""
    from pgfmd.assemble import assemble
    from pgfmd.output.recorder import Recorder

    result, simulation, start = Result(scene, programme, drive), None, time.perf_counter()
    signal.signal(signal.SIGALRM, _out_of_time)
    signal.alarm(LIMIT)
    try:
        given = scene_of(scene, programme, drive)
        simulation, recorder = assemble(given, MPI.COMM_SELF), Recorder()
        simulation.observers.append(recorder)
        result.finished = "not finished"
        result.finished = simulation.run().finished
        energies = simulation.state.energies
        # Where nothing dissipates, the work of the loop is zero.
        work = np.abs(recorder.energy.column("work"))
        whole = abs(energies.work) if energies.viscous or energies.released else work.max()
        result.residual = energies.largest_residual / whole if whole else 0.0
        sound = all(map(math.isfinite, (simulation.state.force, energies.work, energies.largest_residual)))
        closed = result.residual <= LARGEST_RESIDUAL or given.solver.accuracy > 1e-3
        result.verdict = "ok" if sound and closed and result.finished in ENDED_WELL else "FAILED"
    except Hang:
        result.finished = "time limit"
    except PgfmdError as error:
        result.verdict = "FAILED" if simulation else "refused"
        result.finished = " ".join(str(error).split())[:200]
    except Exception as error:
        result.finished = f"{type(error).__name__}: {error}"[:200]
    finally:
        signal.alarm(0)
    result.seconds = time.perf_counter() - start
    if simulation is not None:
        state = simulation.state
        result.steps, result.rejected, result.jumps = (
            state.counters.steps,
            state.counters.rejected_steps,
            state.counters.jumps,
        )
        result.pairs = simulation.scheme.pairs
    return result


def measure(only: str = "") -> list[Result]:
    """All cases, or those of scenes with this in their name; told as they end."""
    found = []
    for case in cases():
        if only in case[0]:
            one = run_case(*case)
            found.append(one)
            print(
                f"{one.verdict:8s}{one.scene:30s}{one.programme:34s}{one.drive:18s}{one.finished[:40]:40s}{one.steps:7d}"
                f"{one.rejected:6d}{one.pairs:8d}{one.jumps:5d}{100 * one.residual:8.2f} %{one.seconds:7.1f} s", flush=True,
            )  # fmt: skip
    return found


def save(results: list[Result]) -> None:
    """The table as CSV."""
    with open(TABLE, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [name for name in vars(results[0]) if name != "seconds"], extrasaction="ignore")
        writer.writeheader()
        for one in results:
            writer.writerow({key: f"{v:.4g}" if isinstance(v, float) else v for key, v in vars(one).items()})


def table(results: list[Result]) -> str:
    """For the page: a line for every scene."""
    lines = [
        "| scene | runs | ended well | most steps | largest residual | median residual |", "| --- | --- | --- | --- | --- | --- |",
    ]  # fmt: skip
    for scene in dict.fromkeys(one.scene for one in results):
        mine = [one for one in results if one.scene == scene and one.verdict != "refused"]
        if not mine:
            continue
        well = sum(one.verdict == "ok" for one in mine)
        shares = np.array([one.residual for one in mine])
        lines.append(
            f"| {scene} | {len(mine)} | {well} | {max(one.steps for one in mine)} | {100 * np.nanmax(shares):.2g} % | "
            f"{100 * np.nanmedian(shares):.2g} % |"
        )
    return "\n".join(lines)
