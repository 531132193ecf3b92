"""Contact in time under a viscoelastic sphere, and contact without a gap: a sticky wave and the paper's curved punch."""

from __future__ import annotations

import math

import numpy as np

from pgfmd.physics.adhesion.cosine import Cosine
from pgfmd.reference.cohesive_sphere import equilibrium
from tests.physics.contact import CELL, SPHERE, WAVE, Path, curved_punch, range_at, sticky_wave, viscoelastic_sphere
from tests.physics.runs import CONTACT_MODULUS, WORK_OF_ADHESION

from .drawing import GREY, Line, chosen, closed, number, ours, panels

MILLI, MICRO = 1e3, 1e6


def _since(path: Path, *phases: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s] since these phases began, contact radius and radius of overlap [m]."""
    some = path.within(*phases)
    return path.time[some] - path.time[np.argmax(some)], path.radius()[some], path.radius("overlap")[some]


def crack_in_time(quick: bool):
    """Contact under a viscoelastic sphere, held and pulled off: a crack that closes, and one that opens; two grids."""
    sizes = (48, 96) if quick else (128, 256)
    paths = [viscoelastic_sphere(n) for n in sizes]
    figure, (left, right) = panels()
    closing, opening = ("dwell",), ("retract",)
    for index, (n, path) in enumerate(zip(sizes, paths, strict=True)):
        for axis, phases in ((left, closing), (right, opening)):
            time, contact, overlap = _since(path, *phases)
            shown = time > (10e-3 if axis is left else -1)
            if axis is right:
                time = time * MILLI
            ours(axis, time[shown], contact[shown] * MICRO, index, ls="-", lw=0.7, ms=3, label=f"n = {n}")
            if index == 1:
                closed(axis, time[shown], overlap[shown] * MICRO, color=GREY, label="gap < 0")
    law = Cosine(WORK_OF_ADHESION, range_at(1.0))
    depth = float(paths[1].depth[paths[1].within(*closing)][-1])
    rest = _at_depth(depth, law)
    left.axhline(rest * MICRO, color="black", lw=1.0, label="relaxed, by rings")
    left.set(xscale="log", xlabel="time held [s]", ylabel="contact radius [µm]", ylim=(140, 350))
    left.set_title("held: the crack closes")
    left.legend(loc="upper left")
    right.set(xlabel="time since the punch moves back [ms]", ylabel="contact radius [µm]")
    right.set_title("pulled off at 10 µm/s: it opens")
    right.legend()
    held = paths[1].radius()[paths[1].within(*closing)][-1]
    lines = [Line("contact radius after 20 s [µm]; relaxed, rings", f"n = {sizes[1]}", rest * MICRO, held * MICRO)]
    for phases, name in ((closing, "closing"), (opening, "opening")):
        (coarse_time, coarse, _), (time, fine, _) = (_since(path, *phases) for path in paths)
        common = time <= coarse_time[-1]
        apart = (np.interp(time[common], coarse_time, coarse) - fine[common]) / paths[1].radius().max()
        settings = f"n = {sizes[0]} against {sizes[1]}, over the largest radius"
        lines.append(
            Line(f"{name} crack: root mean square difference", settings, 0.0, float(np.sqrt(np.mean(apart**2))))
        )
    return figure, lines


def _at_depth(depth: float, law: Cosine) -> float:
    """Relaxed contact radius [m] at an indentation [m], by rings."""
    radii = np.linspace(200e-6, 320e-6, 13)
    found = [equilibrium(float(a), law.contact_gap, SPHERE, CONTACT_MODULUS, law).indentation for a in radii]
    return float(np.interp(depth, found, radii))


REACH = 0.3e-6
"""Range [m] of the sticky wave."""


def closing(quick: bool):
    """Full contact: of a sticky wave down to the tension that tears its valleys off, and of the paper's curved punch."""
    figure, (left, right) = panels()
    return figure, [*_wave(left, 32 if quick else 64), *_punch(right, quick)]


def _wave(axis, n: int) -> list[Line]:
    path = sticky_wave(n, REACH)
    # The wave of traction that flattens the surface, but for what the law gives way.
    amplitude = 0.5 * CONTACT_MODULUS * WAVE * 1e-6
    pressure = path.force / CELL / amplitude
    back = path.within("turn", "retract")
    full = back & (path.contact == path.covered)
    axis_of = np.linspace(-1, 1, 200)
    closed(axis, axis_of, np.arccos(-axis_of) / math.pi, color="black", label="pressed part")
    some = np.flatnonzero(full)
    few = some[chosen(-pressure[some], 24)]
    for index, (area, label) in enumerate((("contact", "contact"), ("overlap", "gap < 0"))):
        ours(axis, pressure[few], getattr(path, area)[few] / path.covered, index, ms=3.5, label=label)
    tears = 1 - path.law.strength / amplitude
    axis.axvline(tears, color=GREY, lw=0.8, ls=":")
    axis.set(xlabel=r"mean pressure / $\frac{1}{2}E^*qA$", ylabel="share of the area", ylim=(-0.05, 1.05))
    axis.set_title("sticky wave on the way back, till it is torn off")
    axis.legend(loc="lower right")
    pressed = full & (np.abs(pressure) < 0.95)
    apart = path.overlap[pressed] / path.covered - np.arccos(-pressure[pressed]) / math.pi
    settings = f"n = {n}, range {REACH * MICRO:g} µm"
    return [
        Line("wave: share in contact, from 0.5 mN to no force, least", settings, 1.0,
             float((path.contact / path.covered)[back & (path.force > 0.0)].min())),
        Line("wave: mean pressure at which full contact ends [kPa]", settings, tears * amplitude / 1e3,
             float(path.force[full][-1]) / CELL / 1e3),
        Line("wave: share of gap < 0 in full contact, largest error", settings, 0.0, float(np.abs(apart).max())),
    ]  # fmt: skip


PAPER = 60.0
"""Force [mN] a little below which the paper's triangular punch is in full contact."""


def _punch(axis, quick: bool) -> list[Line]:
    sizes = (64, 128) if quick else (256, 512)
    # The relaxation time follows the range, as in the paper: 2.5 times as long for one sqrt(2) times as large.
    cases = [(n, f"rheology.relaxation_time={2.5e-3 * 2.5 ** math.log2(512 / n)} s") for n in sizes]
    lines = []
    for index, (n, key) in enumerate(cases):
        lines += _closing(axis, curved_punch(n, key), index, "1 µm/s", PAPER if n == 512 else math.nan)
    slow = curved_punch(sizes[-1], "rheology.model=elastic", "solver.scheme=quasistatic", "solver.accuracy=0.1")
    lines += _closing(axis, slow, 2, "quasi-static", math.nan)
    axis.axvline(PAPER, color=GREY, lw=0.8, ls=":")
    axis.set(xlabel="force [mN]", ylabel="share of the punch in contact", ylim=(-0.05, 1.05))
    axis.set_title("triangular punch, curvature 40 mm")
    axis.legend(loc="lower right")
    return lines


def _closing(axis, path: Path, index: int, name: str, paper: float) -> list[Line]:
    share, force = path.contact / path.covered, path.force * MILLI
    label = f"{name}, n = {path.scene.grid.n}"
    some = np.flatnonzero(force > 0)
    few = some[chosen(np.maximum.accumulate(force[some]), 24)]
    ours(axis, force[few], share[few], index, ls="-", lw=0.7, ms=3.2, label=label)
    closed(axis, force[some], (path.overlap / path.covered)[some], index, lw=0.7, ls=":")
    # From the step on after which no point is open any more.
    open_steps = np.flatnonzero(path.contact < path.covered)
    first = int(open_steps[-1]) + 1
    rest = f"{label}, range {number(path.scene.adhesion.range * MICRO)} µm"
    if first == force.size:
        return [Line("punch: share in contact at 62 mN", rest, math.nan, float(share[-1]))]
    return [
        Line("punch: force from which contact is full [mN]", rest, paper, float(force[first])),
        Line("punch: share of gap < 0 there", rest, math.nan, float(path.overlap[first] / path.covered)),
    ]
