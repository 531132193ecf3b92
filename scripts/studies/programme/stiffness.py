"""Storage and loss of a flat punch in full contact, from `oscillate` steps over three decades of frequency."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass

import numpy as np

import pgfmd
from pgfmd import scene_objects
from pgfmd.analysis.programme import stiffness_of
from pgfmd.plots.drawing import OCHRE, RED, TURQUOISE, drawing, new_figure

from ..pages import FIGURES

RADIUS, TAU = 375e-6, 10e-3
PHASES = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 30.0)
"""Frequencies, as omega tau."""
SIZES = (16, 32, 64)
CONTROLS = {"displacement": "100 nm", "load": "1 mN"}
MACHINES = ("inf", "5 kN/m")
"""The second is softer than the contact at all frequencies."""
TABLE, PICTURE = FIGURES / "programme_stiffness.csv", FIGURES / "programme_stiffness.png"


@dataclass(frozen=True)
class Row:
    """A dynamic stiffness: grid points a side, what was controlled, the machine, omega tau, and K/(2 a E*(omega))."""

    n: int
    control: str
    machine: str
    omega_tau: float
    share_real: float
    share_imaginary: float


def scene_of(n: int, control: str, machine: str) -> pgfmd.Scene:
    """Pressed with 10 mN until it hardly creeps, then oscillating, from fast to slow."""
    amplitude = CONTROLS[control] if machine == "inf" else "500 nm"
    swings = [
        {"do": "oscillate", "amplitude": amplitude, "frequency": f"{x / (2 * math.pi * TAU)} Hz", "cycles": 2}
        for x in reversed(PHASES)
    ]
    pressed = [{"do": "ramp", "rate": "0.5 N/s", "until": "10 mN"}, {"do": "hold", "of": "load", "for": "2 s"}]
    return pgfmd.Scene(
        {
            "punch": {"pattern": "flat", "radius": RADIUS},
            "substrate": {"youngs_modulus": "2 MPa", "poisson_ratio": 0.495, "boundary": "free"},
            "rheology": {"model": "single", "modulus_ratio": 20.0, "relaxation_time": TAU},
            "adhesion": {"law": "repulsive", "work_of_adhesion": "50 mJ/m^2", "range_factor": 64.0},
            "drive": {"clearance": 0.0, "step": [*pressed, *swings], "machine_stiffness": machine},
            "grid": {"n": n, "length": 4 * RADIUS},
            "solver": {"accuracy": 3e-3},
        }
    )


def rows_of(n: int, control: str, machine: str) -> list[Row]:
    """A run, and K of the last full cycle of each oscillation."""
    scene, found = scene_of(n, control, machine), []
    curve = pgfmd.simulate(scene).curve
    time, place, force, stage = (
        curve[name].to_numpy() for name in ("time [s]", "displacement [m]", "force [N]", "stage")
    )
    swings = (curve["phase"] == "oscillate").to_numpy()
    series, ideal = scene_objects.series_of(scene.rheology), scene_objects.punch_stiffness(scene)
    for number, step in enumerate(scene.drive.step, 1):
        if step.frequency is None:
            continue
        mine = swings & (stage == number)
        end = time[mine][-1] - 1.0 / step.frequency
        last = mine & (time <= end * (1 + 1e-12)) & (time >= end - (1 + 1e-9) / step.frequency)
        omega = 2 * math.pi * step.frequency
        share = stiffness_of(time[last], place[last], force[last], step.frequency)[0] / ideal
        share /= complex(series.kappa_of(omega))
        found.append(Row(n, control, machine, omega * TAU, share.real, share.imag))
    return found


def measure() -> list[Row]:
    """All runs."""
    found = [row for n in SIZES for control in CONTROLS for row in rows_of(n, control, "inf")]
    return found + rows_of(SIZES[0], "displacement", MACHINES[1])


def save(rows: list[Row]) -> None:
    """The table as CSV."""
    with open(TABLE, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(vars(rows[0])))
        writer.writeheader()
        writer.writerows(
            {key: f"{v:.6g}" if isinstance(v, float) else v for key, v in vars(row).items()} for row in rows
        )


def draw(rows: list[Row]) -> None:
    """Storage and loss over frequency, and what they are off."""
    from pgfmd.physics.rheology import PronySeries

    series, x = PronySeries.single(20.0, TAU), np.geomspace(PHASES[0] / 1.5, PHASES[-1] * 1.5, 200)
    ideal = series.kappa_of(x / TAU)
    with drawing("double"):
        figure = new_figure(7.2, 2.9)
        left, right = figure.subplots(1, 2)
        left.loglog(x, ideal.real, color=TURQUOISE, label="storage, $2 a E'(\\omega)$")
        left.loglog(x, ideal.imag, color=RED, label="loss, $2 a E''(\\omega)$")
        for control, marker in (("displacement", "o"), ("load", "x")):
            mine = [row for row in rows if (row.n, row.control, row.machine) == (SIZES[-1], control, "inf")]
            phases = np.array([row.omega_tau for row in mine])
            shares = np.array([complex(row.share_real, row.share_imaginary) for row in mine])
            stiffness = shares * series.kappa_of(phases / TAU)
            style = {"linestyle": "", "marker": marker, "markersize": 4.5, "fillstyle": "none"}
            left.loglog(phases, stiffness.real, color=TURQUOISE, **style)
            left.loglog(phases, stiffness.imag, color=RED, **style, label=None)
            left.plot([], [], color="black", **style, label=f"{control} oscillates")
        left.set_xlabel("$\\omega\\tau$")
        left.set_ylabel("stiffness [$2 a E^*$]")
        left.legend(fontsize=7)
        for n, colour in zip(SIZES, (OCHRE, RED, TURQUOISE), strict=True):
            for control, marker in (("displacement", "o"), ("load", "x")):
                mine = [row for row in rows if (row.n, row.control, row.machine) == (n, control, "inf")]
                off = [100 * abs(complex(row.share_real, row.share_imaginary) - 1) for row in mine]
                label = f"n = {n}" if control == "displacement" else None
                right.loglog(
                    [row.omega_tau for row in mine],
                    off,
                    color=colour,
                    marker=marker,
                    lw=0.8,
                    label=label,
                    fillstyle="none",
                )
        right.set_xlabel("$\\omega\\tau$")
        right.set_ylabel("$|K/2aE^*(\\omega) - 1|$ [%]")
        right.legend(fontsize=7)
        figure.tight_layout()
        figure.savefig(PICTURE, dpi=150)


def table(rows: list[Row]) -> str:
    """For the page: by grid and control the largest error, and of the run on a spring."""
    lines = ["| n | oscillates | machine | largest error of K | of its size |", "| --- | --- | --- | --- | --- |"]
    for n, control, machine in dict.fromkeys((row.n, row.control, row.machine) for row in rows):
        shares = [
            complex(row.share_real, row.share_imaginary)
            for row in rows
            if (row.n, row.control, row.machine) == (n, control, machine)
        ]
        spring = "rigid" if machine == "inf" else machine
        error, size = max(abs(share - 1) for share in shares), max(abs(abs(share) - 1) for share in shares)
        lines.append(f"| {n} | {control} | {spring} | {100 * error:.2f} % | {100 * size:.2f} % |")
    return "\n".join(lines)
